"""Tests of the simulation against closed-form solutions."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, MatrixLink, Robot
from forcefit.validation.multibody.motion import placement
from forcefit.validation.multibody.simulation import SimulationModel, simulate_assembly
from tests.multibody_for_tests import (
    FLAT,
    NU,
    ROUND,
    UNIT,
    E,
    coaxial,
    random_stiffness,
    tip_stiffness,
)

pytestmark = pytest.mark.exudyn
G = E / (2 * (1 + NU))
AREA, SECOND = math.pi * 0.04**2, math.pi * 0.04**4 / 4


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def cantilever(link, length=0.5, **more):
    frame = Frame("tip", translation=[length, 0, 0], link=link, **more)
    return home_posture(Robot("cantilever", "tip", (frame,)))


@pytest.mark.parametrize(
    ("row", "stiffness"), [(0, G * 2 * SECOND / 0.8), (3, E * AREA / 0.8)]
)
def test_energy_of_axial_or_twist_misfit_equals_closed_form(row, stiffness):
    """The energy is g^2 EA / (2 (2 L)), with GJ in place of EA for a twist."""
    error = np.zeros(6)
    error[row] = 1e-3
    assembly = simulate_assembly(coaxial(error))
    assert assembly.energy == pytest.approx(1e-6 * stiffness / 2, rel=1e-9)
    # each beam deforms by half of the misfit, under the force k g
    assert assembly.platform_screw[row] == pytest.approx(0.5e-3, rel=1e-9)
    assert assembly.link_wrenches[0, row] == pytest.approx(-1e-3 * stiffness, rel=1e-9)
    assert assembly.link_wrenches[2, row] == pytest.approx(1e-3 * stiffness, rel=1e-9)


def test_energy_of_a_small_misfit_equals_cantilevers_in_series(rng):
    """The energy is g (C1 + C2)^-1 g / 2, with C of a cantilever where the beams meet.

    The effect of finite rotations is proportional to the misfit, so the energy is
    extrapolated to a misfit of zero.
    """
    L = 0.4
    error = 1e-4 * rng.uniform(-1, 1, 6) * UNIT[::-1]
    shear = 6 * (1 + NU) / (7 + 6 * NU)
    b = 1 / (E * SECOND)
    C = np.diag([L / (G * 2 * SECOND), b * L, b * L, L / (E * AREA), 0, 0])
    C[4, 4] = C[5, 5] = b * L**3 / 3 + L / (G * AREA * shear)
    C1, C2 = C.copy(), C.copy()
    # fy rotates the tip of beam 1 (along +x) about +z, and that of beam 2 about -z
    C1[2, 4] = C1[4, 2] = C2[1, 5] = C2[5, 1] = b * L**2 / 2
    C1[1, 5] = C1[5, 1] = C2[2, 4] = C2[4, 2] = -b * L**2 / 2
    expected = error @ np.linalg.solve(C1 + C2, error) / 2
    full, half = (simulate_assembly(coaxial(error), scale) for scale in (1.0, 0.5))
    extrapolated = 2 * half.energy / 0.25 - full.energy
    assert extrapolated == pytest.approx(expected, rel=1e-6)
    assert full.energy != pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("elements", [1, 2, 5])
@pytest.mark.parametrize("theory", ["timoshenko", "euler"])
def test_corrected_beam_element_has_the_exact_bending_deflection(elements, theory):
    """The deflection is P L^3 / 3EI + P L / GA for any number of elements."""
    L, P = 0.5, 1e-3
    posture = cantilever(replace(FLAT, theory=theory))
    along, across = 0.05**3 * 0.02 / 12, 0.02**3 * 0.05 / 12
    shear = 10 * (1 + NU) / (12 + 11 * NU) if theory == "timoshenko" else math.inf
    for axis, second in ((4, along), (5, across)):
        assembly = simulate_assembly(
            posture, model=SimulationModel(elements=elements), load=P * np.eye(6)[axis]
        )
        expected = P * L**3 / (3 * E * second) + P * L / (G * 1e-3 * shear)
        assert assembly.platform_screw[axis] == pytest.approx(expected, rel=1e-8)
        assert assembly.energy == pytest.approx(P * expected / 2, rel=1e-8)


def test_beam_under_an_end_moment_is_a_circular_arc():
    """The curvature M / EI is constant, so the tip is at (sin a, 1 - cos a) L / a."""
    L = 0.5
    moment = E * SECOND / L
    assembly = simulate_assembly(cantilever(ROUND), load=[0, 0, moment, 0, 0, 0])
    expected = [0, 0, 1, L * (math.sin(1) - 1), L * (1 - math.cos(1)), 0]
    np.testing.assert_allclose(assembly.platform_screw, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", ["link", "joint_stiffness"])
def test_deformation_with_a_full_stiffness_matrix_equals_closed_form(rng, kind):
    """The screw is K^-1 w, and the energy is w K^-1 w / 2."""
    K = random_stiffness(rng)
    wrench = 1e-3 * rng.normal(size=6)  # small, so the response is linear
    turn = np.array([0.3, -0.4, 0.5])
    more = {"link": MatrixLink(K)} if kind == "link" else {"joint_stiffness": K}
    frame = Frame("tip", translation=[0.1, 0.2, 0.3], rotation=turn, **more)
    assembly = simulate_assembly(
        home_posture(Robot("spring", "tip", (frame,))), load=wrench
    )
    R = placement(turn, np.zeros(3))[:3, :3]
    own = np.concatenate([R.T @ wrench[:3], R.T @ wrench[3:]])
    screw = np.linalg.solve(K, own)
    got = assembly.link_screws if kind == "link" else assembly.joint_screws
    size = np.abs(screw * UNIT).max()
    assert np.abs((got[0] - screw) * UNIT).max() < 1e-7 * size
    assert assembly.energy == pytest.approx(own @ screw / 2, rel=1e-7)
    wrenches = assembly.link_wrenches if kind == "link" else assembly.joint_wrenches
    np.testing.assert_allclose(wrenches[0], own, rtol=1e-6)


@pytest.mark.parametrize("links", ["beam", "spring"])
@pytest.mark.parametrize("elements", [1, 3])
def test_sag_of_a_heavy_cantilever_equals_closed_form(links, elements):
    """The sag is q L^4 / 8EI + q L^2 / 2GA, plus that of a mass at the tip.

    Gravity is 1e-4 m/s^2, so that the sag is linear.
    """
    L, g, rho, offset = 0.5, 1e-4, 2700.0, 0.1
    posture = cantilever(
        replace(FLAT, density=rho), mass=2.0, centre_of_mass=[offset, 0, 0]
    )
    second = 0.05**3 * 0.02 / 12
    area = 1e-3 * 10 * (1 + NU) / (12 + 11 * NU)
    q, P = rho * 1e-3 * g, 2.0 * g
    expected = q * L**4 / (8 * E * second) + q * L**2 / (2 * G * area)
    expected += P * L**3 / (3 * E * second) + P * L / (G * area)
    expected += P * offset * L**2 / (2 * E * second)
    K = {"tip": tip_stiffness(posture.robot.frame("tip"))}
    assembly = simulate_assembly(
        posture, model=SimulationModel(links, K, elements=elements), gravity=[0, -g, 0]
    )
    assert assembly.platform_screw[4] == pytest.approx(-expected, rel=1e-6)


def test_error_of_a_heavy_beam_is_of_fourth_order():
    """The error of the tip pose decreases with the fourth power of the element length.

    The beam is a steel wire of 1 m length and 8 mm diameter under three times gravity.
    """
    wire = BeamLink({"radius": 0.004}, 200e9, 0.3, density=7800.0)
    posture = cantilever(wire, 1.0)
    screws = [
        simulate_assembly(
            posture, model=SimulationModel(elements=n), gravity=[0, -30, 0]
        ).platform_screw
        for n in (4, 8, 16, 64)
    ]
    assert abs(screws[-1][2]) > 0.04
    for part in (slice(0, 3), slice(3, 6)):
        left = [np.linalg.norm((s - screws[-1])[part]) for s in screws[:3]]
        assert np.log2(left[0] / left[1]) == pytest.approx(4, abs=0.1)
        assert np.log2(left[1] / left[2]) == pytest.approx(4, abs=0.1)


def test_couple_of_dead_forces_is_proportional_to_cosine_of_angle():
    """For a spring of 2 N m/rad and a couple of 1 N m, 2 angle = cos(angle)."""
    frames = (
        Frame(
            "tip", translation=[0.3, 0, 0], rotation=[0.4, -0.3, 0.7], joint="revolute",
            joint_stiffness=np.diag([np.inf, np.inf, 2.0, np.inf, np.inf, np.inf]),
        ),
        Frame("hand", "tip", rotation=[0.1, 0.2, 0.3]),
    )  # fmt: skip
    posture = home_posture(Robot("spring", "hand", frames))
    z = placement([0.4, -0.3, 0.7], np.zeros(3))[:3, 2]
    assembly = simulate_assembly(posture, couple=1.0 * z)
    turn = assembly.joint_screws[0][2]
    assert turn > 0.4
    assert 2 * turn == pytest.approx(np.cos(turn), rel=1e-9)


@pytest.mark.parametrize("clearance", [None, Clearance(radial=1e-5)])
def test_bearing_is_free_about_its_axis_and_otherwise_elastic(clearance):
    """A bar connects a bearing with a misaligned wall.

    Finite rotations and contact compliance change the results by about 1e-3.
    """
    K = np.diag([2e4, 2e4, 0.0, 1.2e8, 1.2e8, 6e7])
    error = [0, 1e-4, 3e-3, 0, 0, 2e-4]
    frames = (
        Frame("hub", joint="revolute", joint_stiffness=K, clearance=clearance),
        Frame("tip", "hub", translation=[0.3, 0, 0]),
        Frame("wall", translation=[0.3, 0, 0], joint_stiffness=np.diag([1e9] * 6),
              geometric_error=error),
        Frame("end", "wall"),
    )  # fmt: skip
    posture = home_posture(Robot("hub", "tip", frames, (("tip", "end"),)))
    assembly = simulate_assembly(
        posture, model=SimulationModel(clearances=clearance is not None)
    )
    linear = solve_assembly(posture)
    assert linear.energy > 0.1
    assert assembly.energy == pytest.approx(linear.energy, rel=2e-3)
    assert abs(assembly.joint_wrenches[0][2]) < 1e-6 * abs(
        assembly.joint_wrenches[0][1]
    )
    ours, theirs = linear.joint_screws[0], assembly.joint_screws[0]
    np.testing.assert_allclose(theirs[[1, 5]], ours[[1, 5]], rtol=5e-3)
    turned = linear.clearance_screws[0][2]
    assert turned > 2e-3
    assert assembly.clearance_screws[0][2] == pytest.approx(turned, rel=1e-3)


def test_pose_of_a_serial_chain_is_the_product_of_its_motions():
    """The pose of each frame is the product of finite motions, with large errors."""
    error = np.array([0.3, -0.2, 0.1, 0.01, 0.02, -0.03])
    frames = (
        Frame("turn", translation=[0, 0, 1], rotation=[0.2, 0, 0], joint="revolute",
              actuated=True, position=0.7, geometric_error=error),
        Frame("slide", "turn", translation=[0.5, 0, 0], joint="prismatic",
              actuated=True, position=0.2, geometric_error=error[::-1] / 3),
        Frame("hand", "slide", rotation=[0, 1.0, 0], geometric_error=-error),
    )  # fmt: skip
    assembly = simulate_assembly(home_posture(Robot("arm", "hand", frames)))

    def moved(turn, shift=(0.0, 0.0, 0.0)):
        turn = Rotation.from_rotvec(np.array(turn))
        return RigidTransform.from_components(np.array(shift), turn)

    def slip(s):
        return moved(s[:3], s[3:])

    turn = moved([0.2, 0, 0], [0, 0, 1]) * slip(error)
    slide = turn * moved([0, 0, 0.7]) * moved([0, 0, 0], [0.5, 0, 0])
    slide = slide * slip(error[::-1] / 3)
    hand = slide * moved([0, 0, 0], [0, 0, 0.2]) * moved([0, 1.0, 0]) * slip(-error)
    for T, expected in zip(assembly.transforms, (turn, slide, hand), strict=True):
        np.testing.assert_allclose(T, expected.as_matrix(), rtol=0, atol=1e-14)


def test_rocker_of_a_four_bar_with_a_long_coupler_equals_closed_form():
    """The end of the rocker is at the intersection of circles about (0, 1) and (2, 0).

    The crank of length 1 is at 90 degrees.  Coupler, rocker and base have length 2, and
    the coupler is too long by 0.02.
    """

    def meeting(coupler):
        chord = math.sqrt(5)
        a = (coupler**2 - 4 + 5) / (2 * chord)
        h = math.sqrt(coupler**2 - a**2)
        along, up = np.array([2, -1]) / chord, np.array([1, 2]) / chord
        return np.array([0, 1]) + a * along + h * up

    pin, shut = meeting(2.0), meeting(2.02)
    tilt = math.atan2(pin[1] - 1, pin[0])
    lean = math.atan2(pin[1], pin[0] - 2)
    frames = (
        Frame("crank", joint="revolute", actuated=True, position=math.pi / 2),
        Frame("crank_pin", "crank", translation=[1, 0, 0], joint="revolute",
              position=tilt - math.pi / 2),
        Frame("coupler", "crank_pin", translation=[2, 0, 0], joint="revolute",
              position=lean - tilt,
              geometric_error=[0, 0, 0, 0.02, 0, 0]),
        Frame("coupler_end", "coupler"),
        Frame("rocker", translation=[2, 0, 0], joint="revolute", position=lean),
        Frame("rocker_end", "rocker", translation=[2, 0, 0]),
    )  # fmt: skip
    closure = (("coupler_end", "rocker_end"),)
    assembly = simulate_assembly(
        home_posture(Robot("four-bar", "coupler_end", frames, closure))
    )
    np.testing.assert_allclose(
        assembly.platform_screw[3:5], shut - pin, rtol=0, atol=1e-9
    )
    assert assembly.gap <= 1e-12
    assert assembly.energy == 0.0
