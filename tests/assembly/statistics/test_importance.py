"""Sobol indices of functions and of robots."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import load_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.statistics.clearance_positions import CLEARANCE_MODELS
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.importance import (
    SaltelliDesign,
    linear_importance,
    sobol_importance,
    sobol_indices,
    source_groups,
)
from forcefit.assembly.statistics.importance_table import ImportanceOptions
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.assembly.statistics.summary import summarise, summary_text
from tests.tolerances_for_tests import arm, parallel, without_clearances

THREE = [(str(i), np.array([i])) for i in range(3)]  # groups of a single variable


def test_sobol_indices_of_ishigami_function_equal_published_values():
    """Parameters a = 7 and b = 0.1, see Saltelli et al. (2008), p. 196."""

    def ishigami(x):
        value = np.sin(x[:, 0]) * (1 + 0.1 * x[:, 2] ** 4) + 7 * np.sin(x[:, 1]) ** 2
        return np.stack([value, 3 * value + 1], axis=1)

    def sample(stream, count):
        rng = np.random.default_rng(stream)
        return rng.uniform(-np.pi, np.pi, size=(count, 3))

    found = sobol_importance(ishigami, sample, THREE, 20_000)
    first, total = [0.3139, 0.4424, 0.0], [0.5576, 0.4424, 0.2437]
    for row in range(2):  # the indices do not depend on scale and offset
        np.testing.assert_allclose(found.first[row, :, 0], first, atol=0.03)
        np.testing.assert_allclose(found.total[row, :, 0], total, atol=0.03)
    inside = (found.total[..., 1] <= total) & (total <= found.total[..., 2])
    assert inside.mean() >= 0.5
    # The variance is 1/2 + a^2/8 + b pi^4/5 + b^2 pi^8/18 = 13.845.
    assert found.variance[0] == pytest.approx(13.845, rel=0.03)


def test_sobol_indices_of_a_constant_result_are_nan():
    """The first result is 3 x + 2 y + z."""
    A, B = np.random.default_rng(4).normal(size=(2, 400, 3))
    design = SaltelliDesign(A, B, THREE)
    results = design.rows(0, len(design)) @ [[3.0], [2.0], [1.0]]
    rounded = 1e6 + 1e-8 * np.sign(results)
    found = sobol_indices(design, np.hstack([results, rounded, np.nan * results]))
    assert np.isfinite(found.first[0]).all()
    assert np.isnan(found.first[1:]).all()
    assert np.isnan(found.variance[2])


@pytest.mark.slow
def test_sobol_indices_of_a_linear_robot_equal_closed_form():
    """The platform screw is linear in the errors."""
    robot = without_clearances(load_robot("irsbot2"))
    sources = tolerance_sources(robot, [1e-3] * 3 + [1e-4] * 3)
    one = linear_response(place_robot(robot))
    groups = source_groups(sources, "kind")
    columns = 6 * sources.frame + sources.component
    expected = linear_importance(one.screws[:, columns], sources, groups)
    np.testing.assert_allclose(expected.sum(axis=1), 1.0, rtol=1e-12)
    found = sobol_importance(
        lambda values: one.solve(sources.errors(values)).platform_screw,
        lambda stream, k: sources.draw(0, k, 1, stream), groups, 4000,
    )  # fmt: skip
    # Four standard errors are about 4 / sqrt(4000).
    np.testing.assert_allclose(found.first[..., 0], expected, atol=0.065)
    np.testing.assert_allclose(found.total[..., 0], expected, atol=0.065)
    spread = (one.screws[:, columns] ** 2 * sources.variance).sum(axis=1)
    np.testing.assert_allclose(found.variance, spread, rtol=0.1)


def test_failed_draws_are_omitted_and_counted():
    """The failures do not depend on a and b in the result 2 a + b."""

    def failing(x):
        return np.where(x[:, 2] < 0.01, np.nan, 2 * x[:, 0] + x[:, 1])[:, None]

    def sample(stream, count):
        return np.random.default_rng(stream).random((count, 3))

    found = sobol_importance(failing, sample, THREE, 8000)
    np.testing.assert_allclose(found.first[0, :, 0], [0.8, 0.2, 0.0], atol=0.05)
    np.testing.assert_allclose(found.total[0, :, 0], [0.8, 0.2, 0.0], atol=0.05)
    # A and B fail independently. For the third variable, the mixed draw fails with B.
    np.testing.assert_allclose(found.failed[0], 1 - 0.99**2, atol=0.006)
    assert np.isfinite(found.variance).all()


@pytest.fixture(scope="module")
def stiff():
    """Return a platform that moves by 0.9 and 0.1 times the errors of two springs."""
    robot = parallel(9e6, 1e6)
    sources = tolerance_sources(robot, [0, 0, 0, 1e-5, 0, 0], ("one", "two"))
    return Experiment(home_posture(robot), sources)


def test_importance_table_contains_gains_in_um_per_um(stiff):
    """The gains are 0.9 and 0.1. The parts are the gains times the standard deviation
    1e-5 / sqrt(3).
    """
    data = run_draws(stiff, 50, importance=ImportanceOptions(3000, "source"))
    said = summarise(data)
    report = said["importance"]["platform"]
    for name, gain in (("one.TX", 0.9), ("two.TX", 0.1)):
        assert report[name]["error_unit"] == "m"
        assert report[name]["translation_gain"] == pytest.approx(gain, rel=0.05)
        part = gain * 1e-5 / np.sqrt(3)
        assert report[name]["translation_part"] == pytest.approx(part, rel=0.05)
    lines = summary_text(said).splitlines()
    first = next(i for i, line in enumerate(lines) if "for each um" in line)
    name, _, gain = lines[first + 1].split()[:3]
    assert (name, lines[first + 2].split()[0]) == ("one.TX", "two.TX")
    assert float(gain) == pytest.approx(0.9, rel=0.05)


def test_importance_of_errors_does_not_depend_on_clearance_model():
    """The gain of an error at the tip of an arm is 1 in every clearance model, although
    the pin clearance of 0.1 mm moves the tip.
    """
    robot = arm(radial=1e-4)
    sources = tolerance_sources(robot, [0, 0, 0, 1e-6, 0, 0], ("tip",))
    for play in CLEARANCE_MODELS:
        experiment = Experiment(
            home_posture(robot), sources, clearance=play, margins=False
        )
        said = summarise(
            run_draws(experiment, 20, importance=ImportanceOptions(500, "source"))
        )
        found = said["importance"]["platform"]["tip.TX"]
        assert found["translation_gain"] == pytest.approx(1.0, rel=0.1)
        expected = "worst" if play == "worst" else "least"
        assert said["importance"]["clearance"] == expected


def test_groups_by_kind_include_all_legs():
    robot = load_robot("irsbot2")
    sources = tolerance_sources(robot, [1e-3, 0, 0, 1e-4, 0, 0])
    names = [name for name, _ in source_groups(sources, "kind")]
    assert names == ["link_a.RX", "link_a.TX", "link_b.RX", "link_b.TX"]
    assert [len(c) for _, c in source_groups(sources, "frame")] == [2] * 4
    with pytest.raises(ValueError, match="by is 'leg'"):
        source_groups(sources, "leg")


def test_linear_importance_equals_squared_slopes_times_variances(stiff):
    """Uniform errors within 1 and 2 have variances in the ratio 1 : 4."""
    limits = stiff.sources.limit * 0 + [1.0, 2.0]
    sources = replace(stiff.sources, scale=limits, least=0 * limits, centre=0 * limits)
    slopes = np.array([[3.0, 1.0], [0.0, 5.0]])
    groups = [("one", np.array([0])), ("two", np.array([1])), ("all", np.arange(2))]
    ratio = sources.variance[1] / sources.variance[0]
    assert ratio == pytest.approx(4.0)
    np.testing.assert_allclose(
        linear_importance(slopes, sources, groups),
        [[9 / 13, 4 / 13, 1.0], [0.0, 1.0, 1.0]],
    )
