"""Monte Carlo runs: blocks, provenance, interruption and commands."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import xarray

from forcefit import BadInput, load_robot, place_robot
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.statistics import monte_carlo
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.importance_table import ImportanceOptions
from forcefit.assembly.statistics.monte_carlo import provenance, run_draws
from forcefit.assembly.statistics.plot import (
    allocation_figure,
    histogram_figure,
    tornado_figure,
)
from forcefit.assembly.statistics.replay import journalled
from forcefit.assembly.sweeps.sweep import journal_path
from tests.tolerances_for_tests import arm

ERRORS = """errors = [
    { frames = ["link_a", "link_b"], most = [4e-3, 4e-3, 4e-3, 2e-4, 2e-4, 2e-4] }
]"""
PLAN = """
tolerance = [
    { name = "length", frames = ["link_a", "link_b"], components = ["TX"] },
    { name = "twist", frames = ["link_a", "link_b"], components = ["RX"] },
]
[limits]
margin_free = 1.0
"""


@pytest.fixture(scope="module")
def experiment():
    robot = load_robot("irsbot2")
    sources = tolerance_sources(robot, [4e-3] * 3 + [2e-4] * 3)
    posture = place_robot(robot, pose={"tx": 0.1, "tz": -0.5})
    return Experiment(posture, sources, seed=5)


@pytest.mark.parametrize("at", [60, 200])
def test_killed_run_resumes_and_writes_the_same_file(
    experiment, monkeypatch, tmp_path, at
):
    """The run is killed once during the draws and once during the importance."""
    monkeypatch.setattr(monte_carlo, "BLOCK", 64)
    groups = ImportanceOptions(16, "kind")
    path, whole = tmp_path / "draws.nc", tmp_path / "whole.nc"
    run_draws(experiment, 100, whole, importance=groups)

    def kill(done, total):
        if done > at:
            raise RuntimeError

    with pytest.raises(RuntimeError):
        run_draws(experiment, 100, path, progress=kill, importance=groups)
    assert not path.exists()
    seen = []
    run_draws(experiment, 100, path, workers=2, importance=groups,
              progress=lambda done, total: seen.append(done))  # fmt: skip
    assert seen[0] > at
    assert path.read_bytes() == whole.read_bytes()
    assert not journal_path(path).exists()


@pytest.mark.slow
def test_repeatedly_killed_command_resumes_and_writes_the_same_file(tmp_path):
    """The process receives SIGKILL after increasing times."""
    limits = "margin_free = 2.0\ntranslation = 8e-4"
    plan = "yield = 0.9\ndraws = 200\n" + PLAN.replace("margin_free = 1.0", limits)
    (tmp_path / "plan.toml").write_text(plan)
    base = [sys.executable, "-m", "forcefit", "assembly", "tolerances", "irsbot2",
            "--grid", "tx=0:0.1:0.1,tz=-0.5", "--plan", "plan.toml", "--draws",
            "100"]  # fmt: skip
    here = {"cwd": tmp_path, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run([*base, "-o", "whole.nc"], check=True, **here)
    path, whole = tmp_path / "killed.nc", (tmp_path / "whole.nc").read_bytes()
    for wait in range(4, 90, 6):
        process = subprocess.Popen([*base, "-o", "killed.nc"], **here)
        try:
            assert process.wait(wait) == 0
            break
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if path.exists():  # the process may have finished
            break
    assert path.read_bytes() == whole


@pytest.mark.slow
def test_statistics_and_tolerances_commands_write_results_and_figures(
    run, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "errors.toml").write_text(ERRORS)
    (tmp_path / "plan.toml").write_text(PLAN)
    status, out, _ = run(
        "assembly", "statistics", "irsbot2", "--errors", "errors.toml", "--pose",
        "tx=0.1,tz=-0.5", "--draws", 200, "--limit", "energy=0.1", "--yield-strength",
        "2e8", "--importance", 16, "-o", "d.nc", "--json", "-",
    )  # fmt: skip
    assert status == 0
    said = json.loads(out)
    assert said["draws"] == 200
    assert 0 < said["within_limits"]["probability"] < 1
    assert len(said["safety"]) == 4
    assert said["quantities"]["translation"]["clearance"] == "worst"
    assert "link_a.TX" in said["importance"]["platform"]
    status, _, _ = run(
        "assembly", "tolerances", "irsbot2", "--grid", "tx=-0.1:0.1:0.2,tz=-0.5",
        "--plan", "plan.toml", "--draws", 50, "-o", "t.nc", "--json", "t.json",
    )  # fmt: skip
    assert status == 0
    found = json.loads((tmp_path / "t.json").read_text())["allocation"]
    assert found["worst"]["margin_free"]["proven"] == pytest.approx(1, rel=1e-3)
    with xarray.open_dataset(tmp_path / "d.nc", engine="h5netcdf") as data:
        title = histogram_figure(data).get_suptitle()
        assert "pose errors: clearance worst: largest pose errors" in title
        assert "of the 200 of 200 draws that assemble" in title
        assert len(tornado_figure(data).axes) == 6
        with pytest.raises(ValueError, match="requires a data set of random draws"):
            histogram_figure(data.drop_vars("energy"))
    with xarray.open_dataset(tmp_path / "t.nc", engine="h5netcdf") as data:
        allocation_figure(data)
        with pytest.raises(ValueError, match="requires a data set of random draws"):
            histogram_figure(data)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--errors", "none.toml"], "none.toml: cannot be read"),
        (["--errors", "errors.toml", "--clearance", "mots"], "--clearance"),
        (["--errors", "errors.toml", "--contact-length", "0.3"],
         "--contact-length: found with --clearance worst, expected --clearance "
         "contact"),
        (["--errors", "errors.toml", "--clearance", "contact",
          "--contact-length", "0"],
         "--contact-length: found 0.0, expected > 0 m"),
        (["--errors", "errors.toml", "--seed", "9" * 40], "--seed"),
        (["--errors", "errors.toml", "--limit", "enrgy=3"], 'quantity "enrgy"'),
        (["--errors", "errors.toml", "--limit", "margin=1", "--no-margins"],
         "the margins are not computed"),
        (["--errors", "errors.toml", "-o", "no/d.nc"], "no folder"),
    ],
)  # fmt: skip
def test_invalid_statistics_options_are_rejected_with_one_line(
    run, arguments, message, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "errors.toml").write_text(ERRORS)
    status, _, err = run("assembly", "statistics", "irsbot2", *arguments)
    assert status == 2
    assert message in err
    assert err.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["errors.toml"]


def test_tolerances_of_a_robot_without_errors_are_rejected(run):
    status, _, err = run("assembly", "tolerances", "four_bar", "--grid", "tx=0.2")
    assert status == 2
    assert "found no geometric_error in any frame" in err


@pytest.fixture(scope="module")
def driven():
    """Return a driven arm with position errors of its tip."""
    robot = arm()
    sources = tolerance_sources(robot, [0, 0, 1e-3, 1e-4, 1e-4, 0], ("tip",))
    return Experiment(place_robot(robot), sources, clearance="least", margins=False)


@pytest.mark.parametrize("workers", [1, 2])
def test_block_size_and_workers_do_not_change_the_draws(driven, monkeypatch, workers):
    """The runs have 21 draws and 20 rows of a design."""
    asked = ImportanceOptions(4, "source", 0.5)
    whole = run_draws(driven, 21, importance=asked)
    monkeypatch.setattr(monte_carlo, "BLOCK", 4)
    data = run_draws(driven, 21, workers=workers, importance=asked)
    for name in ("translation", "platform_screw", "energy"):
        np.testing.assert_array_equal(data[name], whole[name])
    for name in ("total_index", "part", "gain"):
        np.testing.assert_allclose(data[name], whole[name], rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(data["draw"], np.arange(21))
    assert data.attrs["importance_draws"] == 4


def test_killed_run_resumes_with_another_confidence_level(driven, tmp_path):
    """A different number of base draws is rejected."""

    def kill(done, total):
        if done:
            raise RuntimeError

    path = tmp_path / "draws.nc"
    with pytest.raises(RuntimeError):
        run_draws(driven, 3, path, progress=kill, importance=4)
    with pytest.raises(BadInput, match="importance"):
        run_draws(driven, 3, path, importance=ImportanceOptions(5))
    seen = []
    run_draws(
        driven, 3, path, importance=ImportanceOptions(4, level=0.5),
        progress=lambda done, total: seen.append((done, total)),
    )  # fmt: skip
    assert seen == [(3, 23), (23, 23)]


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 2}, {"margins": True}, {"stress": False}, {"load": (0.0,) * 6},
        {"gravity": (0.0, 0.0, -9.81)}, {"clearance": "worst"},
        {"precision": (1e-6, 1e-5)}, {"stiffness": "contact"},
    ],
)  # fmt: skip
def test_runs_with_different_options_have_different_provenance(driven, change):
    """Equal runs have equal provenance."""
    before, after = provenance(driven), provenance(replace(driven, **change))
    assert before == provenance(replace(driven))
    (name,) = change
    assert {
        k for k in before.keys() | after.keys() if before.get(k) != after.get(k)
    } == {name}


def test_runs_with_different_errors_or_postures_have_different_hashes(driven):
    sources = driven.sources
    turned = place_robot(driven.posture.robot, {"rz": 0.1})
    others = [replace(driven, posture=turned)]
    for name in ("component", "kind", "centre", "scale", "least", "limit"):
        changed = {name: np.minimum(getattr(sources, name) + 1, 5)}
        others.append(replace(driven, sources=replace(sources, **changed)))
    digests = {
        provenance(one)["sources_and_posture_sha256"] for one in [driven, *others]
    }
    assert len(digests) == len(others) + 1


def squares(path, values, computed, stop=None):
    """Return squares and doubles of values, and the values that were computed."""

    def both(x):
        computed.append(x)
        return x * x, np.array([[x, 2.0 * x]])

    with journalled(path, {"whose": "mine"}) as replay:
        found = [replay.recall(lambda x=x: both(x), x, "square") for x in values]
        assert replay.asked == (0 if path is None else len(values))
        if stop:
            raise stop
    return found


@pytest.mark.parametrize("changed", [None, 1])
def test_stored_results_are_reused_only_for_equal_arguments(changed, tmp_path):
    path, values = tmp_path / "out.nc", [3.0, 4.0, 5.0]
    first, second = [], []
    with pytest.raises(RuntimeError):
        squares(path, values[:2], first, RuntimeError)
    assert journal_path(path).exists()
    if changed is not None:
        values[changed] = 7.0
    found = squares(path, values, second)
    assert first == [3.0, 4.0]
    assert second == ([5.0] if changed is None else [7.0, 5.0])
    for x, (square, both) in zip(values, found, strict=True):
        assert float(square) == x * x
        np.testing.assert_array_equal(both, [[x, 2 * x]])
    assert not journal_path(path).exists()


def test_results_are_computed_every_time_if_no_file_is_given():
    computed = []
    assert len(squares(None, [1.0, 1.0], computed)) == 2
    assert computed == [1.0, 1.0]
