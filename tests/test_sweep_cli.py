"""``forcefit assembly sweep`` and ``plot``: what they write, and how they refuse."""

import json

import pytest
import xarray

import forcefit

ERRORS = """
[[errors]]
frames = ["elbow", "arm"]
most = [1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5]
"""


def test_everything_at_once_ends_in_one_file_and_one_object(run, tmp_path):
    (tmp_path / "errors.toml").write_text(ERRORS)
    (tmp_path / "poses.csv").write_text("id,pose.tx,pose.ty\na,0,0.13\nb,0,0.5\n")
    words = ["five_bar", "--poses", tmp_path / "poses.csv",
             "--errors", tmp_path / "errors.toml", "--draws", "2", "--seed", "5",
             "--vary", "elbow.link.young=7e10,2.1e11", "--wrench", "left.arm",
             "--play-alone", "--linearisation"]  # fmt: skip
    status, out, _ = run("assembly", "sweep", *words, "-o", tmp_path / "x.nc",
                         "--json", "-")  # fmt: skip
    found = json.loads(out)
    assert status == 0
    assert found["axes"] == {"elbow.link.young": 2, "posture": 2, "draw": 2}
    assert found["status"] == {"ok": 4, "out of reach": 4}
    assert found["seed"] == 5
    assert found["quantities"]["energy"]["units"] == "J"
    assert found["command"].startswith("forcefit assembly sweep five_bar --poses ")
    assert "--workers" not in found["command"]
    with xarray.open_dataset(tmp_path / "x.nc") as data:
        assert data.wrench.dims[-2:] == ("frame", "wrench_component")
        assert data.ty.values.tolist() == [0.13, 0.5]
        assert data.posture.values.tolist() == ["a", "b"]
        assert float(data.linearisation_translation.max()) < 1e-6
        # springs that are stiffer never close the same gap with less energy
        energy = data.energy.isel(posture=0).values
        assert (energy[1] >= energy[0]).all()
        # and what planar errors within the play cost is nothing, not its rounding
        assert ((energy == 0.0) | (energy > 1e-20)).all()
    assert sorted(p.name for p in tmp_path.glob("x.nc*")) == ["x.nc"]


def test_a_saved_sweep_is_drawn_without_solving(run, tmp_path, monkeypatch):
    file, picture = tmp_path / "x.nc", tmp_path / "x.png"
    grid = "tx=-0.01:0.01:0.01,ty=0.12:0.14:0.02"
    assert run("assembly", "sweep", "five_bar", "--grid", grid, "-o", file)[0] == 0
    from assembly.sweeps import points

    monkeypatch.setattr(points, "_solve_reached", None)
    status, out, err = run("assembly", "plot", file, "-o", picture)
    assert (status, out, err) == (0, "", "")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert run("assembly", "plot", file, "--at", "tx=0", "-o", picture)[0] == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["sweep", "five_bar", "-o", "x.nc"], "expected --grid or --poses"),
        (["sweep", "five_bar", "--grid", "tx=0", "-o", "x.nc", "--workers", "2",
          "--scheduler", "tcp://h:1"], "found --workers and --scheduler, expected one"),
        (["sweep", "five_bar", "--poses", "no.csv", "-o", "x.nc"],
         "no.csv: cannot be read: No such file"),
        (["sweep", "five_bar", "--grid", "tx=0", "--vary", "left.elbow.young=1",
          "-o", "x.nc"], 'five_bar: no number "left.elbow.young"'),
        (["sweep", "five_bar", "--grid", "tx=0", "--errors", "no.toml", "--draws", "2",
          "-o", "x.nc"], "no.toml: cannot be read: No such file"),
        (["plot", "no.nc", "-o", "x.png"], "no.nc: no such file; expected a data set"),
    ],
)  # fmt: skip
def test_bad_input_is_one_message_and_nothing_is_written(run, tmp_path, monkeypatch,
                                                         words, message):  # fmt: skip
    monkeypatch.chdir(tmp_path)
    status, out, err = run("assembly", *words)
    assert (status, out) == (2, "")
    assert message in err
    assert err.startswith("forcefit: ")
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_journal_of_another_grid_is_refused(run, tmp_path):
    from assembly.sweeps.sweep import journal_path

    file = tmp_path / "x.nc"
    journal = journal_path(file)
    journal.write_text('{"kind": "forcefit sweep journal 1", "robot": "delta"}\n')
    status, _, err = run("assembly", "sweep", "five_bar", "--grid", "tx=0", "-o", file)
    assert status == 2
    assert "journal of another sweep: found robot 'delta'" in err
    assert "expected robot 'five_bar'" in err
    assert not file.exists()


def test_ctrl_c_in_compiled_code_is_130_too(run, monkeypatch):
    """Python says so by a SystemError whose cause is the interrupt."""

    def interrupted(**_):
        raise SystemError("returned a result with an exception set") from (
            KeyboardInterrupt()
        )

    monkeypatch.setattr(forcefit, "app", interrupted)
    assert run("study")[0] == 130
