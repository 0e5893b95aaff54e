"""Loads on bodies and self-weight, compared with beam theory."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput, platform_stiffness, solve_assembly, solve_exact
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.closure import linearise, virtual_joints
from forcefit.assembly.linear.load import loads_on_frames
from forcefit.assembly.linear.reference.reduction import FreeMotion, reduce_problem
from forcefit.assembly.model.robot import BeamLink, Frame, MatrixLink, Robot
from forcefit.assembly.robots import load_robot
from forcefit.stiffness.screws import rotation_matrix
from tests.robots_for_tests import planar_four_bar

L, RADIUS, E, RHO, G = 0.8, 0.02, 70e9, 2700.0, 9.81
AREA = np.pi * RADIUS**2
EI = E * np.pi * RADIUS**4 / 4
Q = RHO * AREA * G  # [N/m]


def cantilever(cuts=1, theory="euler"):
    """Return a beam along x as ``cuts`` links in series."""
    link = BeamLink({"radius": RADIUS}, E, 0.3, density=RHO, theory=theory)
    frames = tuple(
        Frame(f"p{i}", f"p{i - 1}" if i else "base", [L / cuts, 0, 0], link=link)
        for i in range(cuts)
    )
    return Robot("cantilever", frames[-1].name, frames)


@pytest.mark.parametrize("cuts", [1, 2, 5])
def test_self_weight_deflection_equals_beam_theory(cuts):
    """The tip deflects by q L^4 / 8 EI with slope q L^3 / 6 EI."""
    answer = solve_assembly(home_posture(cantilever(cuts)), gravity=[0, 0, -G])
    expected = [0, Q * L**3 / (6 * EI), 0, 0, 0, -Q * L**4 / (8 * EI)]
    assert np.allclose(answer.platform_screw, expected, rtol=1e-9, atol=1e-15)
    assert answer.duality_gap() <= 1e-9 * answer.energy


def test_self_weight_deflection_of_timoshenko_beam_includes_shear():
    """The shear deflection is q L^2 / 2 k G A with k = 6 (1 + nu) / (7 + 6 nu)."""
    answer = solve_assembly(
        home_posture(cantilever(theory="timoshenko")), gravity=[0, 0, -G]
    )
    shear = 6 * 1.3 / (7 + 6 * 0.3) * E / 2.6 * AREA
    expected = -Q * L**4 / (8 * EI) - Q * L**2 / (2 * shear)
    assert answer.platform_screw[5] == pytest.approx(expected, rel=1e-9)


def test_eccentric_mass_causes_a_moment():
    """A mass of 2 kg is 0.3 m beyond the tip of a rigid arm on a torsion spring."""
    K = np.diag([np.inf] * 6).astype(float)
    K[2, 2] = 500.0
    frames = (
        Frame("hinge", rotation=[-np.pi / 2, 0, 0], joint="revolute",
              joint_stiffness=K),
        Frame("arm", "hinge", [0.5, 0, 0], [np.pi / 2, 0, 0], mass=2.0,
              centre_of_mass=[0.3, 0, 0]),
    )  # fmt: skip
    robot = Robot("arm", "arm", frames)
    answer = solve_assembly(home_posture(robot), gravity=[0, 0, -G])
    angle = 2.0 * G * 0.8 / 500.0  # moment 2 g (0.5 + 0.3) about +y
    assert answer.platform_screw[1] == pytest.approx(angle, rel=1e-12)
    assert answer.platform_screw[5] == pytest.approx(-0.5 * angle, rel=1e-12)
    assert answer.joint_wrenches[0, 2] == pytest.approx(2 * G * 0.8, rel=1e-12)


def test_load_on_a_body_does_not_deform_its_distal_joint():
    """The load is transmitted by the link, but not by its distal joint."""
    K = 1e5 * np.eye(6)
    frames = (
        Frame("body", link=MatrixLink(K), joint="revolute", joint_stiffness=K),
        Frame("tip", "body"),
    )
    robot = Robot("two", "tip", frames)
    bodies = np.zeros((2, 6))
    bodies[0, 3] = 50.0
    answer = solve_assembly(home_posture(robot), bodies=bodies)
    assert answer.link_screws[0, 3] == pytest.approx(5e-4)
    assert np.abs(answer.joint_screws).max() == 0.0
    assert answer.wrenches[0, 3] == pytest.approx(50.0)
    assert answer.joint_wrenches[0, 3] == 0.0
    on_platform = solve_assembly(home_posture(robot), load=[0, 0, 0, 50.0, 0, 0])
    assert on_platform.joint_screws[0, 3] == pytest.approx(5e-4)


def test_base_reactions_of_a_closed_loop_sum_to_its_weight():
    """The reactions of both chains are added."""
    robot = planar_four_bar()
    heavy = tuple(
        replace(f, mass=1.5, centre_of_mass=[0.02, 0.01, 0.03])
        if f.name in {"pin_b", "rocker", "crank"} else f
        for f in robot.frames
    )  # fmt: skip
    answer = solve_assembly(
        home_posture(replace(robot, frames=heavy)), gravity=[0, 0, -G]
    )
    roots = [i for i, p in enumerate(answer.posture.robot.parents) if p < 0]
    T = answer.posture.transforms
    total = sum(T[i, :3, :3] @ answer.wrenches[i, 3:] for i in roots)
    assert np.allclose(total, [0, 0, -4.5 * G], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("size", [1e6, 1e8])
def test_large_loads_cause_proportional_deflections(size):
    """The loads are about 1e8 N."""
    posture = home_posture(load_robot("irsbot2"))
    once, twice = (
        solve_assembly(posture, [0, 0, 0, 0, 0, k * size]).platform_screw[5]
        for k in (1, 2)
    )
    compliance = platform_stiffness(posture).compliance[5, 5]
    assert twice - once == pytest.approx(compliance * size, rel=1e-6)


@pytest.mark.parametrize(("shift", "hangs"), [(0.0, True), (1e-9, False)])
def test_pendulum_is_in_equilibrium_only_when_hanging(shift, hangs):
    """If the mass hangs below the hinge, its moment is only round-off.

    If the centre of mass is displaced by 1 nm, there is no equilibrium.
    """
    at, turn = np.array([0.1, 0.2, 0.7]), np.array([-0.3, 0.2, 0.9])
    inside = rotation_matrix(turn).T @ [shift, 0.0, -0.3]
    frames = (
        Frame("hinge", translation=at, rotation=turn, joint="revolute"),
        Frame("bob", "hinge", mass=2.0, centre_of_mass=inside),
    )
    posture = home_posture(Robot("pendulum", "bob", frames))
    if hangs:
        answer = solve_assembly(posture, gravity=[0, 0, -G])
        assert np.linalg.norm(answer.wrenches[0, 3:]) == pytest.approx(2.0 * G)
    else:
        with pytest.raises(FreeMotion, match="it moves hinge rz"):
            solve_assembly(posture, gravity=[0, 0, -G])


def test_load_about_a_free_hinge_is_rejected():
    """A rotation about z moves a platform at (0.5, 0.25) by (-0.25, 0.5) per rad."""
    link = MatrixLink(1e6 * np.eye(6))
    frames = (
        Frame("hinge", joint="revolute"),
        Frame("tip", "hinge", [0.5, 0.25, 0.0], link=link),
    )
    expected = (
        r"it moves hinge rz; the platform moves along \[0 0 1 -0.25 0.5 0\] \[rad, m\]"
    )
    with pytest.raises(FreeMotion, match=expected):
        solve_assembly(home_posture(Robot("r", "tip", frames)), [0, 0, 1, 0, 0, 0])


def test_link_wrenches_of_a_chain_balance_the_distal_loads(rng):
    """The wrench at the start of each beam balances all loads beyond this start."""
    link = BeamLink({"width": 0.02, "height": 0.03}, E, 0.3, density=RHO)
    frames = tuple(
        Frame(f"p{k}", f"p{k - 1}" if k else "base", rng.normal(size=3),
              rng.normal(size=3), link=link)
        for k in range(3)
    )  # fmt: skip
    robot = Robot("bent", "p2", frames)
    posture, load = home_posture(robot), rng.normal(size=6) * [1, 1, 1, 9, 9, 9]
    gravity = rng.normal(size=3)
    answer = solve_assembly(posture, load, gravity=gravity)
    T = posture.transforms
    origins = np.concatenate([np.zeros((1, 3)), T[:, :3, 3]])
    for k in range(3):
        R, arm = T[k, :3, :3], origins[3] - origins[k]
        force, moment = load[3:].copy(), load[:3] + np.cross(arm, load[3:])
        for i in range(k, 3):
            span = origins[i + 1] - origins[i]
            W = RHO * 6e-4 * np.linalg.norm(span) * gravity
            force += W
            moment += np.cross((origins[i] + origins[i + 1]) / 2 - origins[k], W)
        start = answer.start_wrenches[k]
        np.testing.assert_allclose(R @ start[3:], force, rtol=1e-9)
        np.testing.assert_allclose(R @ start[:3], moment, rtol=1e-9, atol=1e-9)
        if k:
            before, tip = T[k - 1, :3, :3], answer.tip_wrenches[k - 1]
            np.testing.assert_allclose(before @ tip[3:], force, rtol=1e-9)
            np.testing.assert_allclose(before @ tip[:3], moment, rtol=1e-9, atol=1e-9)


def beam_on_two_pins():
    """Return a beam of 0.8 m along x with hinges about y at both ends."""
    turn = [np.pi / 2, 0, 0]
    link = BeamLink({"radius": RADIUS}, E, 0.3, density=RHO)
    frames = (
        Frame("a", rotation=turn, joint="revolute"),
        Frame("b", "a", [L, 0, 0], joint="revolute", link=link),
        Frame("end", "b"),
        Frame("ground", translation=[L, 0, 0], rotation=turn),
    )
    return Robot("pinned", "end", frames, (("end", "ground"),))


def test_beam_on_two_pins_has_zero_end_moments():
    """The end forces are q L / 2.

    The deformation of the beam corresponds to end moments of q L^2 / 12.
    """
    posture = home_posture(beam_on_two_pins())
    answer = solve_assembly(posture, gravity=[0, 0, -G])
    row = posture.robot.index("b")
    half, scale = Q * L / 2, np.array([Q * L**2] * 3 + [Q * L] * 3)
    up = [0, 0, 0, 0, half, 0]  # the y axis of the beam points up
    np.testing.assert_allclose(answer.tip_wrenches[row] / scale, up / scale, atol=1e-9)
    down = [0, 0, 0, 0, -half, 0]
    start = answer.start_wrenches[row]
    np.testing.assert_allclose(start / scale, down / scale, atol=1e-9)
    assert abs(answer.wrenches[row, 2]) == pytest.approx(Q * L**2 / 12, rel=1e-9)
    np.testing.assert_allclose(
        answer.tip_wrenches[row], answer.joint_wrenches[row], atol=1e-9 * Q * L
    )
    exact = solve_exact(posture, gravity=[0, 0, -G])
    assert np.abs(exact.tip_wrenches[row, :3]).max() < 1e-9 * Q * L**2
    assert exact.tip_wrenches[row, 4] == pytest.approx(half, rel=1e-3)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"load": np.zeros(5)}, r"load: found .* \(5,\), expected \(6,\)"),
        ({"load": np.zeros((3, 6))}, r"load: .*\(3, 6\), expected \(6,\) or \(2, 6\)"),
        ({"bodies": np.zeros((2, 6))}, r"bodies: .*\(2, 6\), expected \(8, 6\)"),
        ({"gravity": np.zeros((3, 3))}, r"gravity: .*\(3, 3\), expected \(3,\) or \(2"),
        ({"gravity": 9.81}, r"gravity: found an array of shape \(\), expected \(3,\)"),
    ],
)
def test_loads_of_wrong_shape_are_rejected(given, message):
    """The loads are applied at two postures of a robot of eight frames."""
    posture = home_posture(load_robot("four_bar"))
    with pytest.raises(BadInput, match=message):
        solve_assembly([posture, posture], **given)


def reduced(robot, load=None):
    """Return the reduced problem of a robot in its home pose."""
    posture = home_posture(robot)
    loads = None if load is None else loads_on_frames(posture, load)
    return reduce_problem(linearise(posture), virtual_joints(robot), loads)


def turn_and_slide():
    """Return a pin about z in series with a slider along z and a link of 10 m."""
    return Robot("chain", "tip", (
        Frame("turn", joint="revolute"),
        Frame("slide", "turn", [10, 0, 0], joint="prismatic"),
        Frame("tip", "slide"),
    ))  # fmt: skip


@pytest.mark.parametrize("load", [1e-9, 1.0, 1e9])
def test_message_about_a_free_motion_does_not_depend_on_the_load(load):
    """Loads of 0.3 N m and 2 N drive a rotation and a translation."""
    with pytest.raises(FreeMotion) as told:
        reduced(turn_and_slide(), load * np.array([0, 0, 2.0, 0, 0, 0.3]))
    assert "it moves turn rz, slide tz; " in str(told.value)
    with pytest.raises(FreeMotion) as told:
        reduced(turn_and_slide(), load * np.array([0, 0, 0.15, 0, 0, 2.0]))
    assert "it moves slide tz, turn rz; " in str(told.value)
    with pytest.raises(FreeMotion) as told:
        reduced(turn_and_slide(), load * np.array([0, 0, 0, 0, 0, 2.0]))
    text = str(told.value)
    assert "it moves slide tz; the platform moves along [0 0 0 0 0 1] [rad, m]" in text
