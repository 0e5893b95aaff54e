"""Upper bounds for springs in series, and verification by random draws."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Clearance
from forcefit.assembly.statistics.requirement import Requirement
from forcefit.assembly.statistics.verification import prove_worst, verify_yield
from tests.robots_for_tests import coaxial_beams
from tests.tolerances_for_tests import PLAY, plan_for, silent

ENDS = [("one", 3), ("two", 3)]
T = np.array([2.0, 3.0]) * PLAY
REACH = 5 * PLAY  # sum of both errors


def springs(stiffnesses, limits, clearance=None):
    """Return a requirement on two equal bars in series at several postures."""
    play = None if clearance is None else Clearance(radial=clearance)
    postures = [
        home_posture(coaxial_beams(np.zeros(6), (k, k), clearance=play))
        for k in stiffnesses
    ]
    return Requirement(postures, plan_for(postures[0].robot, ENDS, [1, 1], limits))


@pytest.mark.parametrize(("limit", "scale"), [(0.01, 0.2), (0.25, 1.0), (1.0, 1.0)])
def test_energy_bound_of_springs_equals_closed_form(limit, scale):
    """The energy is k (t1 + t2)^2 / 4 for the largest stiffness of three postures."""
    worst, found = prove_worst(springs([4e5, 4e6, 1e6], {"energy": limit}), T, silent)
    np.testing.assert_allclose(worst["energy"], 4e6 * REACH**2 / 4, rtol=1e-4)
    assert found == pytest.approx(scale, rel=1e-4)


@pytest.mark.parametrize(("limit", "scale"), [(1.0, 0.2), (4.0, 0.8), (6.0, 1.0)])
def test_margin_bound_of_springs_equals_closed_form(limit, scale):
    """The margin is (t1 + t2) / p = 5 for any stiffness."""
    worst, found = prove_worst(springs([1e6, 1e5], {"margin": limit}, PLAY), T, silent)
    np.testing.assert_allclose(worst["margin"], 5.0, rtol=1e-5)
    assert found == pytest.approx(scale, rel=1e-5)


def test_force_limit_has_no_proven_scale():
    """The largest force found is k (t1 + t2) / 2, without an upper bound."""
    limits = {"energy": 0.01, "force": 60.0}
    worst, found = prove_worst(springs([1e6], limits), T, silent)
    assert worst["force"][0] == pytest.approx(1e6 * REACH / 2, rel=1e-6)
    assert np.isnan(worst["force"][1])
    assert worst["energy"][1] == pytest.approx(1e6 * REACH**2 / 4, rel=1e-4)
    assert np.isnan(found)
    several = springs([1e6], {"margin": 4.0, "energy": 1.0, "margin_free": 2.0}, PLAY)
    assert prove_worst(several, T, silent)[1] == pytest.approx(0.4, rel=1e-5)


class Given:
    """Requirement with two limits at two postures and given utilisations."""

    cases = [("a", 0), ("a", 1), ("b", 0), ("b", 1)]
    postures = (None, None)

    def __init__(self, lower, upper, asked_yield):
        self.asked_yield, self.plan = asked_yield, self
        self.bounds = np.array([lower, upper])

    def draws_of(self, stream, count):
        """Return the indices of the draws as errors."""
        return np.arange(count)[:, None].astype(float)

    def spread(self, tolerances):
        return tolerances

    def utilisations(self, values):
        return self.bounds[:, :, np.rint(values[:, 0] / 2.0).astype(int)]


TWO = np.array([2.0])


def test_draw_passes_if_all_limits_are_satisfied_at_all_postures():
    """Of 600 draws, 60 fail at the first posture and 30 at the second."""
    share = np.full((4, 600), 0.5)
    share[0, 240:270] = 1.5  # first limit, first posture
    share[2, 580:] = 2.5  # limit b
    share[2, 260:280] = 1.5  # ten of these draws fail at the first posture
    share[3, 570:600] = 1.1
    share[1, 0] = 1 + 5e-10  # rounding
    found = verify_yield(Given(share, share, 0.9), TWO, 600, silent, 14, 0.9)
    assert found["draws"] == 600
    assert found["posture_yields"] == [1 - 60 / 600, 1 - 30 / 600]
    assert found["worst_posture_yield"] == 1 - 60 / 600
    assert found["yield"]["probability"] == 1 - 70 / 600
    assert found["yield"]["undecided"] == 0
    assert found["largest_share_of_a_limit"] == 2.5
    assert found["verdict"] == "not contradicted"


def test_draw_is_undecided_if_a_limit_is_between_its_bounds():
    lower, upper = np.full((2, 4, 10), 0.5)
    lower[0, :3] = upper[0, :3] = 1.5  # fail
    upper[1, 2:5] = 1.5  # one of these draws fails at the first posture
    lower[1, 3] = 1 + 5e-10  # rounding
    found = verify_yield(Given(lower, upper, 0.2), TWO, 10, silent)
    assert found["yield"]["probability"] == 0.5
    assert found["yield"]["undecided"] == 2
    assert found["posture_yields"] == [0.7, 0.7]


@pytest.mark.parametrize(
    ("failing", "asked", "verdict"),
    [
        (0, 1.0, "no draw failed"),
        (1, 1.0, "contradicted"),
        # For 0 failures of 100, the lower bound on the yield is 1 - 0.025^(1/100) =
        # 0.9638.
        (0, 0.96, "shown"),
        (0, 0.97, "not contradicted"),
        # For 10 failures of 100, the interval is 0.824 to 0.951.
        (10, 0.82, "shown"),
        (10, 0.83, "not contradicted"),
        (10, 0.95, "not contradicted"),
        (10, 0.96, "contradicted"),
    ],
)
def test_verdict_agrees_with_the_confidence_interval(failing, asked, verdict):
    share = np.zeros((4, 100))
    share[2, :failing] = 2.0
    found = verify_yield(Given(share, share, asked), TWO, 100, silent)
    assert found["verdict"] == verdict
