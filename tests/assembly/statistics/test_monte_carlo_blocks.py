"""Blocks, provenance and journals of Monte Carlo runs."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput, place_robot
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.statistics import monte_carlo
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.importance_table import ImportanceOptions
from forcefit.assembly.statistics.monte_carlo import provenance, run_draws
from forcefit.assembly.statistics.replay import journalled
from forcefit.assembly.sweeps.sweep import journal_path
from tests import tolerances_for_tests


@pytest.fixture(scope="module")
def arm():
    """Return a driven arm with position errors of its tip."""
    robot = tolerances_for_tests.arm()
    sources = tolerance_sources(robot, [0, 0, 1e-3, 1e-4, 1e-4, 0], ("tip",))
    return Experiment(place_robot(robot), sources, clearance="least", margins=False)


@pytest.mark.parametrize("workers", [1, 2])
def test_block_size_and_workers_do_not_change_the_draws(arm, monkeypatch, workers):
    """The runs have 21 draws and 20 rows of a design."""
    asked = ImportanceOptions(4, "source", 0.5)
    whole = run_draws(arm, 21, importance=asked)
    monkeypatch.setattr(monte_carlo, "BLOCK", 4)
    data = run_draws(arm, 21, workers=workers, importance=asked)
    for name in ("translation", "platform_screw", "energy"):
        np.testing.assert_array_equal(data[name], whole[name])
    for name in ("total_index", "part", "gain"):
        np.testing.assert_allclose(data[name], whole[name], rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(data["draw"], np.arange(21))
    assert data.attrs["importance_draws"] == 4


def test_killed_run_resumes_with_another_confidence_level(arm, tmp_path):
    """A different number of base draws is rejected."""

    def kill(done, total):
        if done:
            raise RuntimeError

    path = tmp_path / "draws.nc"
    with pytest.raises(RuntimeError):
        run_draws(arm, 3, path, progress=kill, importance=4)
    with pytest.raises(BadInput, match="importance"):
        run_draws(arm, 3, path, importance=ImportanceOptions(5))
    seen = []
    run_draws(
        arm, 3, path, importance=ImportanceOptions(4, level=0.5),
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
def test_runs_with_different_options_have_different_provenance(arm, change):
    """Equal runs have equal provenance."""
    before, after = provenance(arm), provenance(replace(arm, **change))
    assert before == provenance(replace(arm))
    (name,) = change
    assert {
        k for k in before.keys() | after.keys() if before.get(k) != after.get(k)
    } == {name}


def test_runs_with_different_errors_or_postures_have_different_hashes(arm):
    sources = arm.sources
    turned = place_robot(arm.posture.robot, {"rz": 0.1})
    others = [replace(arm, posture=turned)]
    for name in ("component", "kind", "centre", "scale", "least", "limit"):
        value = getattr(sources, name) + 1
        others.append(
            replace(arm, sources=replace(sources, **{name: np.minimum(value, 5)}))
        )
    digests = {provenance(one)["sources_and_posture_sha256"] for one in [arm, *others]}
    assert len(digests) == len(others) + 1


class Killed(Exception):
    """Exception that interrupts a computation."""


def run(path, values, computed, stop=None, whose="mine"):
    """Return squares and doubles of values, and the values that were computed."""

    def both(x):
        computed.append(x)
        return x * x, np.array([[x, 2.0 * x]])

    with journalled(path, {"whose": whose}) as replay:
        found = [replay.recall(lambda x=x: both(x), x, "square") for x in values]
        assert replay.asked == (0 if path is None else len(values))
        if stop:
            raise stop
    return found


@pytest.mark.parametrize("changed", [None, 1])
def test_stored_results_are_reused_only_for_equal_arguments(changed, tmp_path):
    path, values = tmp_path / "out.nc", [3.0, 4.0, 5.0]
    first, second = [], []
    with pytest.raises(Killed):
        run(path, values[:2], first, Killed())
    assert journal_path(path).exists()
    if changed is not None:
        values[changed] = 7.0
    found = run(path, values, second)
    assert first == [3.0, 4.0]
    assert second == ([5.0] if changed is None else [7.0, 5.0])
    for x, (square, both) in zip(values, found, strict=True):
        assert float(square) == x * x
        np.testing.assert_array_equal(both, [[x, 2 * x]])
    assert not journal_path(path).exists()


def test_results_are_computed_every_time_if_no_file_is_given():
    computed = []
    assert len(run(None, [1.0, 1.0], computed)) == 2
    assert computed == [1.0, 1.0]
