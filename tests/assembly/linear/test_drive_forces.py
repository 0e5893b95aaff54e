"""Statics of redundantly actuated robots with prescribed drive forces."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput, platform_stiffness, solve_assembly, solve_exact
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.force_control import with_drive_forces
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, MatrixLink, Robot
from tests.assembly.exact.test_exact import only

ALONG_X = [0.0, np.pi / 2, 0.0]  # rotates the z axis to the x axis
METHODS = ("compiled", "reference")


def opposing_slides(k_rod, k_first=np.inf, k_second=np.inf):
    """Return two collinear slides that are connected by a rod along x.

    Both slide coordinates increase along +x.
    """
    stiff = np.diag([1e9, 1e9, 1e9, k_rod, 1e9, 1e9])
    frames = (
        Frame("first", rotation=ALONG_X, joint="prismatic", actuated=True,
              joint_stiffness=_along(k_first)),
        Frame("rod", "first", [0, 0, 1.0], [0, -np.pi / 2, 0],
              link=MatrixLink(stiff)),
        Frame("second", translation=[2.0, 0, 0], rotation=ALONG_X, joint="prismatic",
              actuated=True, joint_stiffness=_along(k_second)),
        Frame("block", "second", [0, 0, -1.0], [0, -np.pi / 2, 0]),
    )  # fmt: skip
    return Robot("slides", "block", frames, (("rod", "block"),))


def _along(k):
    return np.diag([np.inf] * 5 + [k])


@pytest.mark.parametrize("solve", [solve_assembly, solve_exact])
@pytest.mark.parametrize("method", METHODS)
def test_drive_force_of_a_slide_equals_the_rod_force(solve, method):
    """The force F stretches rod and first drive in series: x = F (1/k_rod + 1/k_1)."""
    F, k_rod, k_1 = 200.0, 4e6, 1e7
    robot = with_drive_forces(opposing_slides(k_rod, k_1, 3e7), {"second": F})
    assembly = solve(home_posture(robot), method=method)
    x = F / k_rod + F / k_1
    assert assembly.platform_screw[3] == pytest.approx(x, rel=1e-9)
    # The rod is in tension.
    np.testing.assert_allclose(assembly.tip_wrenches[1], [0, 0, 0, F, 0, 0], atol=2e-6)
    assert assembly.energy == pytest.approx(F * x / 2, rel=1e-9)
    # The drive exerts the reaction on its block.
    assert assembly.tip_wrenches[2][5] == pytest.approx(-F, rel=1e-9)
    assert assembly.posture.platform[0, 3] == 1.0  # no nominal motion


def test_work_of_the_drive_is_twice_the_linear_elastic_energy():
    """The work of a constant force is twice the elastic energy."""
    robot = with_drive_forces(opposing_slides(4e6), {"second": 120.0})
    assembly = solve_assembly(home_posture(robot))
    assert assembly.work == pytest.approx(2 * assembly.energy, rel=1e-12)
    assert assembly.certified
    assert assembly.loaded


def test_force_controlled_drive_has_no_stiffness():
    """With position control, the stiffness is k_2 + 1/(1/k_1 + 1/k_rod)."""
    k_rod, k_1, k_2 = 4e6, 1e7, 3e7
    robot = opposing_slides(k_rod, k_1, k_2)
    series = 1 / (1 / k_rod + 1 / k_1)
    for machine, expected in (
        (robot, series + k_2), (with_drive_forces(robot, {"second": 500.0}), series)
    ):  # fmt: skip
        posture = home_posture(machine)
        for state in ("nominal", "contact", "exact"):
            C = platform_stiffness(posture, state=state).compliance
            assert C[3, 3] == pytest.approx(1 / expected, rel=1e-9)


def crossed_cranks(radius=0.004):
    """Return a parallelogram linkage with two driven cranks at 60 deg.

    The cranks are 0.3 m long, and the coupler is a beam of 0.5 m along x.
    """
    beam = BeamLink({"radius": radius}, 7e10, 0.3, None, "euler")
    up = np.pi / 3
    frames = (
        Frame("crank", joint="revolute", actuated=True, position=up),
        Frame("pin", "crank", [0.3, 0, 0], joint="revolute", position=-up),
        Frame("coupler", "pin", [0.5, 0, 0], link=beam),
        Frame("rocker", translation=[0.5, 0, 0], joint="revolute", actuated=True,
              position=up),
        Frame("knee", "rocker", [0.3, 0, 0], joint="revolute", position=-up),
        Frame("end", "knee"),
    )  # fmt: skip
    return Robot("cranks", "coupler", frames, (("coupler", "end"),))


@pytest.mark.parametrize("torque", [12.0, -3.0])
def test_coupler_force_equals_crank_torque_divided_by_lever_arm(torque):
    """The axial force N of the coupler satisfies N r sin 60 deg = -torque.

    A positive torque compresses the coupler.  The rocker rotates by |N| L / (EA r sin
    60 deg).
    """
    robot = with_drive_forces(crossed_cranks(), {"rocker": torque})
    posture = home_posture(robot)
    assembly = solve_assembly(posture)
    force = torque / (0.3 * np.sin(np.pi / 3))
    np.testing.assert_allclose(
        assembly.tip_wrenches[2], [0, 0, 0, -force, 0, 0], atol=1e-9 * abs(force)
    )
    shorter = force * 0.5 / (7e10 * np.pi * 0.004**2)
    assert assembly.platform_screw[3] == pytest.approx(-shorter, rel=1e-9)
    turned = assembly.clearance_screws[robot.index("rocker"), 2]
    assert turned == pytest.approx(shorter / (0.3 * np.sin(np.pi / 3)), rel=1e-9)
    assert assembly.work == pytest.approx(torque * turned, rel=1e-12)
    # moment that the crank's drive transmits to the base
    assert assembly.tip_wrenches[0][2] == pytest.approx(torque, rel=1e-9)
    assert solve_exact(posture).platform_screw[3] == pytest.approx(-shorter, rel=1e-3)


def test_force_control_of_the_sole_drive_of_a_motion_is_rejected():
    robot = crossed_cranks()
    crank = replace(robot.frames[3], actuated=False)
    robot = replace(robot, frames=(*robot.frames[:3], crank, *robot.frames[4:]))
    posture = home_posture(with_drive_forces(robot, {"crank": 1.0}))
    with pytest.raises(FreeMotion, match="the load drives a motion that no joint"):
        solve_assembly(posture)


@pytest.mark.parametrize("torque", [1e-3, 40.0])
def test_hinge_rotates_by_drive_torque_over_stiffness(torque):
    """The rotation is 0.8 rad = 40 N m / 50 N m/rad."""
    hinge = Frame("hinge", joint="revolute", joint_stiffness=only(2, 50.0),
                  drive_force=torque)  # fmt: skip
    robot = Robot("arm", "arm", (hinge, Frame("arm", "hinge", [0.4, 0, 0])))
    posture = home_posture(robot)
    angle = torque / 50.0
    assert solve_assembly(posture).platform_screw[2] == pytest.approx(angle, rel=1e-9)
    exact = solve_exact(posture)
    expected = [0, 0, angle, 0.4 * (np.cos(angle) - 1), 0.4 * np.sin(angle), 0]
    np.testing.assert_allclose(exact.platform_screw, expected, atol=1e-9)
    assert exact.energy == pytest.approx(50.0 * angle**2 / 2, rel=1e-9)


@pytest.mark.parametrize("solve", [solve_assembly, solve_exact])
def test_drive_torque_balances_a_weight(solve):
    """With a torque m g l of the drive, the hinge spring does not deform."""
    hinge = Frame("hinge", joint="revolute", joint_stiffness=only(2, 50.0),
                  drive_force=2.0 * 9.81 * 0.4)  # fmt: skip
    arm = Frame("arm", "hinge", [0.4, 0, 0], mass=2.0)
    posture = home_posture(Robot("arm", "arm", (hinge, arm)))
    assembly = solve(posture, gravity=[0, -9.81, 0])
    np.testing.assert_allclose(assembly.platform_screw, np.zeros(6), atol=1e-15)


def test_drive_force_moves_other_joints_within_their_clearance():
    """Tension moves the rod end by its whole axial clearance of 20 um."""
    robot = opposing_slides(4e6)
    first = replace(robot.frames[0], clearance=Clearance(axial=2e-5))
    robot = replace(robot, frames=(first, *robot.frames[1:]))
    for F in (100.0, -100.0):
        driven = with_drive_forces(robot, {"second": F})
        screw = solve_assembly(home_posture(driven)).platform_screw
        assert screw[3] == pytest.approx(np.sign(F) * 2e-5 + F / 4e6, rel=1e-9)


def test_drive_forces_at_many_postures_equal_those_at_single_postures():
    robot = with_drive_forces(crossed_cranks(), {"rocker": 5.0})
    postures = [place_robot(robot, joints={"crank": q}) for q in (0.7, 1.0, 1.2)]
    together = solve_assembly(postures)
    for k, posture in enumerate(postures):
        one = solve_assembly(posture)
        np.testing.assert_allclose(together[k].platform_screw, one.platform_screw)
        assert together[k].energy == pytest.approx(one.energy, rel=1e-9)


def test_force_control_of_unknown_and_coupled_drives_is_rejected():
    robot = crossed_cranks()
    with pytest.raises(BadInput, match=r'no drive "rockr"; did you mean "rocker"'):
        with_drive_forces(robot, {"rockr": 1.0})
    with pytest.raises(BadInput, match='no drive "pin"'):
        with_drive_forces(robot, {"pin": 1.0})
    K = np.diag([1e3] * 3 + [1e6] * 3)
    K[0, 2] = K[2, 0] = 10.0
    rocker = replace(robot.frames[3], joint_stiffness=K)
    robot = replace(robot, frames=(*robot.frames[:3], rocker, *robot.frames[4:]))
    with pytest.raises(BadInput, match=r'"rocker"\.joint_stiffness: found coupling'):
        with_drive_forces(robot, {"rocker": 1.0})
    with pytest.raises(BadInput, match=r'"a"\.drive_force: found 3 on a fixed joint'):
        Frame("a", drive_force=3.0)


@pytest.mark.parametrize("solve", [solve_assembly, solve_exact])
def test_screw_drive_force_equals_torque_divided_by_lead(solve):
    """A nut that cannot rotate loads a spring by M / h, since 2 pi M = F P per turn."""
    pitch, k, M = 0.005, 2e6, 3.0
    screw = Frame("screw", joint="helical", pitch=pitch, actuated=True)
    nut = Frame("nut", "screw", joint="revolute")
    rail = Frame("rail", joint="prismatic", joint_stiffness=_along(k))
    frames = screw, nut, Frame("end", "nut"), rail, Frame("table", "rail")
    robot = Robot("press", "table", frames, (("end", "table"),))
    posture = home_posture(with_drive_forces(robot, {"screw": M}))
    assembly = solve(posture)
    force = M / (pitch / (2 * np.pi))
    assert assembly.platform_screw[5] == pytest.approx(force / k, rel=1e-9)
    assert assembly.energy == pytest.approx(force**2 / k / 2, rel=1e-9)
