"""Assembly margins for the errors in a robot file at several postures."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput, Clearance, Frame, Robot, load_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.statistics.tolerances import (
    grid_postures,
    identity_of,
    left_out_text,
    present_errors,
)
from tests.robots_for_tests import coaxial_beams
from tests.three_upu_for_tests import three_upu
from tests.tolerances_for_tests import PLAY, plan_for

K = 1e6  # [N/m]


def bars(play, errors):
    """Return two coaxial bars with a joint clearance and length errors."""
    robot = coaxial_beams(np.zeros(6), (K, K), clearance=Clearance(radial=play))
    lengths = [errors.get(frame.name, 0.0) for frame in robot.frames]
    return home_posture(robot.with_errors(np.outer(lengths, np.eye(6)[3])))


ERRORS = {"one": 3 * PLAY, "two": -1 * PLAY, "mount": 0.5 * PLAY}


def test_present_errors_report_contributions_to_the_largest_margin():
    """At one posture, the gap is 3 + 1 - 0.5 = 3.5 clearances.

    The shares are 3 / 3.5, 1 / 3.5 and -0.5 / 3.5, and the springs are deformed by 2.5
    clearances. The other posture has a larger clearance.
    """
    seen = []
    postures = [bars(4 * PLAY, ERRORS), bars(PLAY, ERRORS), bars(2 * PLAY, {})]
    found = present_errors(postures, "rigid", lambda *step: seen.append(step))
    assert seen == [(1, 3), (2, 3), (3, 3)]
    assert (found["postures"], found["quantity"]) == (3, "margin")
    np.testing.assert_allclose(found["margins"], [3.5 / 4, 3.5, 0.0], atol=1e-6)
    assert found["largest_margin"] == pytest.approx(3.5)
    assert found["factor_on_errors"] == pytest.approx(1 / 3.5)
    assert found["assemblable_share"] == pytest.approx(2 / 3)
    assert found["energy_there"] == pytest.approx(K * (2.5 * PLAY) ** 2 / 4, rel=1e-6)
    slopes = {key: [one[key] for one in found["slopes"]] for key in found["slopes"][0]}
    assert slopes["error"] == ["one.TX", "two.TX", "mount.TX"]
    assert slopes["value"] == list(ERRORS.values())
    signs = np.array([1.0, -1.0, -1.0])
    for key, expected in (
        ("share_of_margin", np.array([3, 1, -0.5]) / 3.5),
        ("margin_slope", signs / PLAY),
        ("energy_slope", signs * K * 2.5 * PLAY / 2),
    ):  # fmt: skip
        np.testing.assert_allclose(slopes[key], expected, rtol=1e-6)


def test_energy_of_errors_within_clearance_is_zero():
    """For rigid bodies that cannot be assembled, margin and energy are NaN."""
    within = present_errors([bars(PLAY, {"one": 0.5 * PLAY})], "rigid")
    assert within["energy_there"] == pytest.approx(0.0, abs=1e-12)
    assert within["assemblable_share"] == 1.0
    frames = (
        Frame("one", translation=[0.5, 0, 0], geometric_error=[0, 0, 0, 3e-4, 0, 0]),
        Frame("two", "base", [0.5, 0, 0]),
        Frame("end", "one", clearance=Clearance(radial=PLAY)),
    )
    rigid = Robot("pin", "end", frames, (("end", "two"),))
    found = present_errors([home_posture(rigid)], "rigid")
    assert found["largest_margin"] == pytest.approx(3.0)
    assert np.isnan(found["energy_there"])
    assert np.isnan(found["slopes"][0]["energy_slope"])


def test_grid_of_postures_contains_only_reachable_postures():
    robot = load_robot("irsbot2")
    postures, _ = grid_postures(robot, "tx=-0.1:0.1:0.1,tz=-9.5:-0.5:9")
    places = [(p.pose()["tx"], p.pose()["tz"]) for p in postures]
    np.testing.assert_allclose(places, [(x, -0.5) for x in (-0.1, 0.0, 0.1)], atol=1e-9)
    with pytest.raises(
        BadInput, match="^grid: found no posture that the robot reaches"
    ):
        grid_postures(robot, "tx=0,tz=-9")


def test_allocation_identity_changes_with_every_input():
    robot = load_robot("irsbot2")
    postures = [place_robot(robot, {"tx": x, "tz": -0.5}) for x in (0.0, 0.1)]
    links = [("leg1.link_a", 3), ("leg2.link_a", 3)]
    plan = plan_for(robot, links, [1, 2], {"energy": 1.0})
    own = identity_of(postures, plan, 50)
    assert own == identity_of(list(postures), replace(plan), 50)
    others = [
        identity_of(postures[:1], plan, 50), identity_of(postures[::-1], plan, 50),
        identity_of(postures, plan, 51),
        *(identity_of(postures, replace(plan, **change), 50) for change in (
            {"costs": plan.costs + 1}, {"most": plan.most / 2}, {"seed": 2},
            {"least": plan.least + 1e-9}, {"limits": {"energy": 2.0}}, {"draws": 7},
            {"cost": "logarithm"}, {"asked_yield": 0.5}, {"clearance": "least"},
            {"group": plan.group[::-1]},
            {"sources": plan_for(robot, links[::-1], [1, 2], {}).sources},
        )),
    ]  # fmt: skip
    told = {str(sorted(one.items())) for one in [own, *others]}
    assert len(told) == len(others) + 1


def test_singular_postures_of_a_grid_are_omitted_and_counted():
    """The 3-UPU robot is singular above its centre."""
    postures, left_out = grid_postures(
        three_upu(seed=1), "tx=-0.02:0.02:0.02,ty=0,tz=0.45"
    )
    assert [round(p.pose()["tx"], 6) for p in postures] == [-0.02, 0.02]
    assert left_out == {"singular": 1}
    assert "the first-order analysis is inconclusive" in left_out_text(left_out)
