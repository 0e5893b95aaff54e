"""Ball clearance |(TX, TY, TZ)| <= c, compared with closed forms and cvxpy."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput, Clearance, Frame, Robot, bound_pose_error, zone_margin
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.reference.as_printed import (
    energy_as_printed,
    margin_as_printed,
)
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.platform_stiffness.deflection import clearance_names
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from tests.robots_for_tests import coaxial_beams, random_robot

C = 10e-6  # [m]


def with_balls(robot):
    """Return the robot with ball clearances in place of radial clearances."""

    def changed(frame):
        given = frame.clearance
        if given is None or frame.joint == "prismatic":
            return frame
        ball = Clearance(tilt=given.tilt, spin=given.spin, ball=given.radial)
        return replace(frame, clearance=ball)

    return replace(robot, frames=tuple(changed(f) for f in robot.frames))


def pointed(clearance, at=(0.0, 0.0, 0.0)):
    """Return the assembly of a tip on a single joint with clearance."""
    frames = (Frame("joint", clearance=clearance), Frame("tip", "joint", list(at)))
    return solve_assembly(home_posture(Robot("tip", "tip", frames)))


@pytest.mark.parametrize(("method", "width"), [("compiled", 1e-9), ("reference", 5e-7)])
def test_ball_clearance_allows_equal_motions_in_all_directions(method, width):
    """A circumscribed cylinder with radial = axial = c allows sqrt(2) c."""
    for clearance, expected in (
        (Clearance(ball=C), C),
        (Clearance(radial=C, axial=C), np.sqrt(2) * C),
        # The tip is 0.1 m from a joint that tilts by 1 mrad.
        (Clearance(ball=C, tilt=1e-3), C + 0.1e-3),
    ):
        found = bound_pose_error(
            pointed(clearance, [0.1, 0, 0]), tolerance_translation=1e-9, method=method
        )
        low, high = found.translation_error
        assert low <= expected * (1 + 1e-9)
        assert high >= expected * (1 - 1e-9)
        assert high - low < width


@pytest.mark.parametrize("gap", [0.5 * C, 1.7 * C, 40 * C])
def test_energy_depends_on_the_distance_beyond_a_ball_clearance(gap):
    """Two springs of 1e6 N/m in series deform by the gap minus the radius."""
    direction = np.array([1.0, -2.0, 2.0]) / 3
    screw = [0, 0, 0, *(gap * direction)]
    robot = coaxial_beams(screw, clearance=Clearance(ball=C))
    answer = solve_assembly(home_posture(robot))
    beyond = max(0.0, gap - C)
    assert answer.energy == pytest.approx(0.5e6 * beyond**2 / 2, rel=1e-8, abs=1e-15)
    moved = answer.clearance_screws[robot.index("joint"), 3:]
    assert np.linalg.norm(moved) == pytest.approx(min(gap, C), rel=1e-6)
    if beyond:
        unit = moved / np.linalg.norm(moved)
        assert abs(unit @ direction) == pytest.approx(1.0, rel=1e-12)
    margin = zone_margin(home_posture(robot)).margin
    assert margin == pytest.approx(gap / C, rel=1e-7)


@pytest.mark.parametrize("seed", range(24))
def test_energy_and_margin_with_ball_clearances_agree_with_cvxpy(seed):
    """The tolerances equal those for robots without ball clearances."""
    rng = np.random.default_rng(seed)
    posture = home_posture(with_balls(random_robot(rng, 2 + seed % 2, 1 + seed % 3)))
    zone = zone_margin(posture)
    try:
        expected = margin_as_printed(posture)
    except RuntimeError:
        expected = None
    assert zone.margin == pytest.approx(
        np.inf if expected is None else expected, rel=1e-6, abs=1e-7
    )
    try:
        many = solve_assembly(posture, errors=posture.robot.errors[None])
        answer = solve_assembly(posture)
    except (CannotAssemble, FreeMotion):
        return
    if not np.isfinite(many.energy[0]):
        return
    scale = max(answer.energy, 1e-6 * answer.energy_without_clearance, 1e-9)
    energy, _ = energy_as_printed(posture)
    for found in (answer.energy, many.energy[0]):
        assert found == pytest.approx(energy, rel=1e-6, abs=1e-6 * scale)
    assert answer.duality_gap() < 1e-8 * scale
    assert answer.clearance_excess() < 1e-9


@pytest.mark.parametrize("assumption", ["frozen", "free"])
def test_compiled_pose_errors_with_ball_clearances_agree_with_the_reference(
    assumption,
):
    compiled = 0
    for seed in range(24):
        draw = np.random.default_rng(seed)
        robot = with_balls(random_robot(draw, 1 + seed % 3, 1 + seed // 3 % 3))
        errors = robot.errors * np.array([0.0, 0.1, 0.5])[:, None, None]
        found = solve_assembly(home_posture(robot), errors=errors)
        many = bound_pose_error(found, assumption)
        solved = np.flatnonzero((many.status == "ok") & ~many.one_by_one)
        compiled += len(solved)
        for i in solved[:2].tolist():
            one = bound_pose_error(found[i], assumption, method="reference")
            for name in ("rotation_error", "translation_error"):
                (low, high), other = getattr(many, name)[i], getattr(one, name)
                assert high - low <= 1e-6
                assert low <= other[1] + 1e-12
                assert high >= other[0] - 1e-12
    assert compiled > 20


def pressed(force, clearance):
    """Return a pin on a spring of 1e6 N/m and 1e4 N m/rad, 0.1 m before the tip."""
    K = np.diag([1e4, 1e4, 1e4, 1e6, 1e6, 1e6])
    frames = (
        Frame("arm", translation=[0.5, 0, 0], joint_stiffness=K),
        Frame("pin", "arm", clearance=clearance),
        Frame("tip", "pin"),
    )
    return home_posture(Robot("pin", "tip", frames)), [0, 0, 0, *force]


@pytest.mark.parametrize("method", ["contact", "exact"])
def test_ball_clearance_in_contact_is_compliant_along_its_surface(method):
    """Perpendicular to the force F, the contact acts as a spring F / c in series."""
    direction = np.array([2.0, -1.0, 2.0]) / 3
    posture, load = pressed(300.0 * direction, Clearance(ball=50e-6))
    C = platform_stiffness(posture, method, load).compliance[3:, 3:]
    along = np.outer(direction, direction)
    expected = 1e-6 * np.eye(3) + 50e-6 / 300.0 * (np.eye(3) - along)
    np.testing.assert_allclose(C, expected, atol=1e-3 * 50e-6 / 300.0)


def test_ball_clearance_has_a_distinct_name_in_results():
    posture, load = pressed([0, 0, 300.0], Clearance(ball=C, tilt=1e-3))
    joints = solve_assembly(posture, load).joints
    marked = np.ones(2, dtype=bool)
    assert clearance_names(joints, marked) == {"pin tilt", "pin ball"}


@pytest.mark.parametrize("key", ["radial", "axial"])
def test_ball_clearance_replaces_radial_and_axial_bounds(key):
    with pytest.raises(BadInput, match=f'clearance.{key}: found together with "ball"'):
        Clearance(ball=C, **{key: C})
    with pytest.raises(BadInput, match=r"clearance\.ball: found a bound on a sliding"):
        Frame("slide", joint="prismatic", clearance=Clearance(ball=C))
