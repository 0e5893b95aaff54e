"""``forcefit assembly sweep`` and ``plot``: output files and invalid input."""

import json
import os
import signal
import time
import zlib

import pytest
import xarray

from forcefit.assembly.sweeps.selection import BY_CLEARANCE, FINITE
from forcefit.commands import app as command

ERRORS = """
[[errors]]
frames = ["elbow", "arm"]
most = [1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5]
"""


def test_sweep_with_all_options_writes_one_file(run, tmp_path):
    (tmp_path / "errors.toml").write_text(ERRORS)
    (tmp_path / "poses.csv").write_text("id,pose.tx,pose.ty\na,0,0.13\nb,0,0.5\n")
    words = ["five_bar", "--poses", tmp_path / "poses.csv",
             "--errors", tmp_path / "errors.toml", "--draws", "2", "--seed", "5",
             "--vary", "elbow.link.young=7e10,2.1e11", "--wrench-of", "left.arm",
             "--quantities", ",".join(["default", *BY_CLEARANCE, *FINITE])]  # fmt: skip
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
        # stiffer springs require more energy to close the same gap
        energy = data.energy.isel(posture=0).values
        assert (energy[1] >= energy[0]).all()
        # errors within the clearances require exactly zero energy
        assert ((energy == 0.0) | (energy > 1e-20)).all()
    assert sorted(p.name for p in tmp_path.glob("x.nc*")) == ["x.nc"]


def messages(err):
    """Return the number of messages; slow machines also print a progress line."""
    lines = [line for line in err.splitlines() if line != "robot: 0 of 1"]
    assert all(line.startswith("forcefit: ") for line in lines)
    return len(lines)


def test_progress_line_is_printed_during_a_long_step(capsys, monkeypatch):
    """The line appears in a log file before the computation ends."""
    import forcefit.commands.progress

    monkeypatch.setattr(forcefit.commands.progress, "_DELAY", 0.0)
    with forcefit.commands.progress.progress_bars() as update:
        update("points", 3, 12)
        said = ""
        while "points: 3 of 12" not in said:  # printed by a different thread
            said += capsys.readouterr().err
        assert said == "points: 3 of 12\n"


@pytest.mark.slow
def test_plot_draws_a_saved_sweep_without_solving(run, tmp_path, monkeypatch):
    file, picture = tmp_path / "x.nc", tmp_path / "x.png"
    grid = "tx=-0.01:0.01:0.01,ty=0.12:0.14:0.02"
    assert run("assembly", "sweep", "five_bar", "--grid", grid, "-o", file)[0] == 0
    from forcefit.assembly.sweeps import points

    monkeypatch.setattr(points, "_solve_reached", None)
    status, out, err = run("assembly", "plot", file, "--figure", picture)
    assert (status, out, err) == (0, "", "")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert run("assembly", "plot", file, "--at", "tx=0", "--figure", picture)[0] == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["sweep", "five_bar", "-o", "x.nc"], "expected exactly one of --grid"),
        (["sweep", "five_bar", "--grid", "tx=0", "-o", "x.nc", "--workers", "2",
          "--scheduler", "tcp://h:1"], "found both --workers and --scheduler"),
        (["sweep", "five_bar", "--poses", "no.csv", "-o", "x.nc"],
         "no.csv: cannot be read: No such file"),
        (["sweep", "five_bar", "--grid", "tx=0", "--vary", "left.elbow.young=1",
          "-o", "x.nc"], 'five_bar: no number "left.elbow.young"'),
        (["plot", "no.nc", "--figure", "x.png"],
         "no.nc: no such file; expected a data set"),
    ],
)  # fmt: skip
def test_invalid_sweep_input_has_one_message_and_no_output(
    run, tmp_path, monkeypatch, words, message
):
    monkeypatch.chdir(tmp_path)
    status, out, err = run("assembly", *words)
    assert (status, out) == (2, "")
    assert message in err
    assert messages(err) == 1
    assert list(tmp_path.iterdir()) == []


def test_sweep_rejects_a_journal_of_a_different_sweep(run, tmp_path):
    from forcefit.assembly.sweeps.sweep import journal_path

    file = tmp_path / "x.nc"
    journal = journal_path(file)
    line = b'{"kind": "forcefit sweep journal 2", "robot": "delta"}'
    journal.write_bytes(b"%s %08x\n" % (line, zlib.crc32(line)))
    status, _, err = run("assembly", "sweep", "five_bar", "--grid", "tx=0", "-o", file)
    assert status == 2
    assert "journal of another sweep: found robot 'delta'" in err
    assert "expected robot 'five_bar'" in err
    assert not file.exists()


STIFF = """
name = "stiff"
platform = "p"
[[frame]]
name = "drive"
parent = "base"
joint = "prismatic"
actuated = true
[[frame]]
name = "p"
parent = "drive"
[[frame]]
name = "slide"
parent = "base"
joint = "prismatic"
[[frame]]
name = "q"
parent = "slide"
geometric_error = [0, 0, 0, 1e-4, 0, 0]
[[closure]]
frames = ["p", "q"]
"""
GRIDS = {
    "one point": ("q.drive=0", []),
    "a line": ("q.drive=0:0.2:0.1", []),
    "a map": ("q.drive=0:0.2:0.1", ["--vary", "p.mass=1,2"]),
}


@pytest.mark.parametrize(
    ("errors", "grid"),
    [("1e-4", "one point"), ("0", "one point"), ("1e-4", "a map"), ("0", "a line"),
     *(pytest.param(*case, marks=pytest.mark.slow)
       for case in (("0", "a map"), ("1e-4", "a line")))],
)  # fmt: skip
def test_sweep_without_a_finite_value_has_a_summary_and_a_figure(
    run, tmp_path, errors, grid
):
    """A rigid robot with errors has neither a finite margin nor an energy.

    The figure is drawn by the sweep or from the saved file.
    """
    robot, file, picture = (tmp_path / n for n in ("r.toml", "x.nc", "x.png"))
    robot.write_text(STIFF.replace("1e-4", errors))
    axes, words = GRIDS[grid]
    figure = [] if grid == "one point" else ["--figure", picture]
    if errors != "0":
        words = [*words, *figure]
    status, out, err = run("assembly", "sweep", robot, "--grid", axes, "-o", file,
                           *words, "--json", "-")  # fmt: skip
    assert status == 0
    assert "Warning" not in err
    found = json.loads(out)
    if errors != "0":
        assert list(found["status"]) == ["cannot assemble"]
        assert found["quantities"]["energy"] is None
        assert found["quantities"]["margin"] is None
    elif figure:
        assert run("assembly", "plot", file, "--figure", picture) == (0, "", "")
    if figure:
        assert picture.read_bytes().startswith(b"\x89PNG")


def test_sweep_prints_why_the_first_point_failed(run, tmp_path):
    robot, file = tmp_path / "r.toml", tmp_path / "x.nc"
    robot.write_text(STIFF)
    status, out, _ = run("assembly", "sweep", robot, "--grid", "q.drive=0", "-o", file)
    assert status == 0
    assert "\ncannot assemble, for example: a rigid loop stays open by 0.0001" in out


def test_sweep_without_a_reachable_point_has_a_summary_and_a_figure(run, tmp_path):
    file, picture = tmp_path / "x.nc", tmp_path / "x.png"
    words = ["--grid", "tx=5:6:0.5,ty=7:8:0.5", "-o", file, "--figure", picture]
    status, out, err = run("assembly", "sweep", "five_bar", *words)
    assert (status, out) == (1, "out of reach: 9\n")
    assert "Warning" not in err
    assert run("assembly", "plot", file, "--figure", picture, "--at", "tx=5")[0] == 0


def test_sweep_over_poses_and_designs_draws_a_map(run, tmp_path):
    (tmp_path / "poses.csv").write_text("id,pose.tx,pose.ty\na,0,0.13\nb,0,0.14\n")
    words = ["--vary", "elbow.link.young=2e11,7e10,1e11", "-o", tmp_path / "x.nc",
             "--figure", tmp_path / "x.svg"]  # fmt: skip
    status, _, err = run("assembly", "sweep", "five_bar", "--poses",
                         tmp_path / "poses.csv", *words)  # fmt: skip
    assert (status, "Warning" in err) == (0, False)
    assert (tmp_path / "x.svg").read_bytes().startswith(b"<?xml")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-o", "robot.toml"], 'robot.toml: found the ending ".toml", expected a '
         "NetCDF file of forcefit: .nc"),
        (["-o", "other.nc"], "other.nc: found a file that is not a NetCDF file of "
         "forcefit; it is not overwritten"),
        (["-o", "measured.nc"], "measured.nc: found a NetCDF file that does not "
         "contain a sweep of forcefit"),
        (["-o", "x.nc", "--figure", "x.xyz"], 'x.xyz: found the ending ".xyz", '
         "expected a picture: .png or .svg or .pdf"),
        (["-o", "x.nc", "--json", "robot.toml"], 'found the ending ".toml", expected a '
         "JSON file: .json"),
        (["-o", "x.nc", "--figure", "x.png"], "figure: found a single point"),
        (["-o", "x.nc", "--json", "full.json"], "full.json: found a device, pipe or "
         "socket, expected a regular file"),
    ],
)  # fmt: skip
def test_sweep_does_not_overwrite_files_of_other_programs(
    run, tmp_path, monkeypatch, words, message
):
    monkeypatch.chdir(tmp_path)
    for name in ("robot.toml", "other.nc"):
        (tmp_path / name).write_text("mine\n")
    xarray.Dataset({"x": 1}).to_netcdf("measured.nc", engine="h5netcdf")
    os.symlink("/dev/full", "full.json")
    before = {p: p.lstat().st_mtime_ns for p in tmp_path.iterdir()}
    status, out, err = run("assembly", "sweep", "five_bar", "--grid", "tx=0,ty=0.13",
                           *words)  # fmt: skip
    assert (status, out) == (2, "")
    assert message in err
    assert messages(err) == 1
    assert {p: p.lstat().st_mtime_ns for p in tmp_path.iterdir()} == before


def test_sweep_overwrites_the_file_of_an_earlier_sweep(run, tmp_path):
    for grid in ("tx=0,ty=0.13", "tx=0,ty=0.14"):
        words = ["five_bar", "--grid", grid, "-o", tmp_path / "x.nc"]
        assert run("assembly", "sweep", *words)[0] == 0
    with xarray.open_dataset(tmp_path / "x.nc") as data:
        assert data.ty.values.tolist() == [0.14]


@pytest.mark.parametrize("kind", [SystemError, ValueError, KeyboardInterrupt])
def test_ctrl_c_in_compiled_code_has_exit_status_130(kind, run, monkeypatch):
    """Compiled code may raise a different error; matplotlib raises ValueError."""

    def interrupted(**_):
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(5)  # waits for the signal
        except KeyboardInterrupt:
            raise kind("Invalid bounding box") from None

    monkeypatch.setattr(command, "app", interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # if ignored
    try:
        status, _, err = run("study")
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert (status, err) == (130, "forcefit: interrupted\n")


def test_error_without_ctrl_c_is_raised_unchanged(run, monkeypatch):
    def failed(**_):
        raise ValueError("Invalid bounding box")

    monkeypatch.setattr(command, "app", failed)
    with pytest.raises(ValueError, match="bounding box"):
        run("study")


def test_damaged_sweep_file_has_one_message(run, tmp_path, monkeypatch):
    """Some damaged files fail only after HDF5 has opened them."""
    from forcefit.commands import sweep

    monkeypatch.setattr(sweep, "save_figure", lambda *_: None)  # is slow
    file = tmp_path / "x.nc"
    words = ["five_bar", "--grid", "tx=0:0.01:0.01,ty=0.13", "-o", file]
    assert run("assembly", "sweep", *words)[0] == 0
    content = file.read_bytes()
    for place in range(100, len(content), len(content) // 6):
        spoilt = content[:place] + bytes(40) + content[place + 40 :]
        file.write_bytes(spoilt)
        status, _, err = run("assembly", "plot", file, "--figure", tmp_path / "x.svg")
        assert status in {0, 2}
        assert messages(err) == (status == 2)


@pytest.mark.parametrize(
    ("words", "said"),
    [(["--gravity", "z=-9.81"], 1), (["--load", "fx=1"], 1), ([], 0)],
)  # fmt: skip
def test_sweep_reports_that_frequencies_neglect_load_and_gravity(
    run, tmp_path, words, said
):
    grid = ["--grid", "tx=0,ty=0.13", "--assumption", "none", "--frequencies", "1"]
    target = ["-o", tmp_path / "x.nc"]
    status, _, err = run("assembly", "sweep", "five_bar", *grid, *words, *target)
    assert status == 0
    assert err.count("the frequencies neglect load and gravity") == said
