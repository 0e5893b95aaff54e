"""Results of ``assembly stiffness``: keys, sums, statuses."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.robot import Frame, MatrixLink, Robot
from forcefit.assembly.report.platform_stiffness import (
    DIRECTIONS,
    stiffness_of,
    stiffness_text,
)
from forcefit.assembly.report.share_pictures import plot_shares
from forcefit.assembly.robots import load_robot


def total(shares):
    """Sum of all shares of a direction."""
    return shares.get("forces", 0.0) + sum(
        value
        for kind in ("links", "joints", "clearances")
        for value in shares.get(kind, {}).values()
    )


@pytest.mark.parametrize("exact", [False, True])
def test_compliance_shares_sum_to_one_in_every_direction(exact):
    load = [0, 0, 0, 10.0, -20.0, -50.0]
    posture = home_posture(load_robot("hexapod"))
    results = stiffness_of(posture, load, state="exact" if exact else "nominal")
    assert results["status"] == "ok"
    for name in DIRECTIONS:
        assert total(results["shares"][name]) == pytest.approx(1.0, rel=1e-9)
    C, K = np.array(results["compliance"]), np.array(results["stiffness"])
    np.testing.assert_allclose(C @ K, np.eye(6), atol=1e-6)


def test_free_motion_is_reported_and_other_entries_stay_finite():
    slide = Frame("slide", joint="prismatic", link=MatrixLink(np.eye(6)))
    tip = Frame("tip", "slide")
    results = stiffness_of(home_posture(Robot("slider", "tip", (slide, tip))))
    assert results["status"] == "free motion"
    np.testing.assert_allclose(results["free_motions"], [[0, 0, 0, 0, 0, 1]])
    C = np.array(results["compliance"])
    assert np.isnan(C[5]).all()
    np.testing.assert_allclose(C[:5, :5], np.eye(5), atol=1e-12)
    said = " ".join(stiffness_text(results).split())
    assert "free motion 1 [0 0 0 0 0 1]" in said


def test_load_without_resistance_is_reported_as_no_equilibrium():
    slide = Frame("slide", joint="prismatic", link=MatrixLink(np.eye(6)))
    posture = home_posture(Robot("slider", "tip", (slide, Frame("tip", "slide"))))
    results = stiffness_of(posture, [0, 0, 0, 0, 0, 1.0], state="exact")
    assert results["status"] == "no equilibrium"
    assert "no equilibrium" in stiffness_text(results)


def test_bars_of_the_share_chart_sum_to_100_percent_per_direction():
    results = stiffness_of(home_posture(load_robot("four_bar")))
    (axes,) = plot_shares(results).axes
    heights = [bar.get_height() for bar in axes.patches]
    np.testing.assert_allclose(sum(heights), 600.0)


def test_contact_compliance_equals_differences_of_the_least_energy_solution():
    """Central differences of (22); the load presses clearances of two legs."""
    posture = place_robot(load_robot("irsbot2"), {"tx": 0.1, "tz": -0.5})
    load, step = np.array([0, 0, 0, 20.0, 50.0, -100.0]), np.eye(6)[5]
    ahead, back = (
        solve_assembly(posture, load + sign * step).platform_screw for sign in (1, -1)
    )
    results = stiffness_of(posture, load, state="contact")
    assert results["state"] == "contact"
    moved = (ahead[5] - back[5]) / 2
    assert results["compliance"][5, 5] == pytest.approx(moved, rel=1e-4)
    # other than the nominal one, which clearances have no part in
    nominal = stiffness_of(posture, load)
    assert (nominal["compliance"][5, 5] / moved - 1) ** 2 > 1e-6
