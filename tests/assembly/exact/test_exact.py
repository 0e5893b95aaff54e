"""Tests of the exact equilibrium against closed forms and simulations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, root

import forcefit.assembly.exact.exact as exact
from forcefit import CannotAssemble, solve_assembly, solve_exact
from forcefit.assembly.exact.descent import NotConverged, energy_of
from forcefit.assembly.kinematics.posture import home_posture, place_many, place_robot
from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.stiffness.screws import rotation_matrix, rotation_vector
from forcefit.validation.multibody.simulation import (
    SimulationModel,
    simulate_assembly,
    without_clearance,
)
from tests.robots_for_tests import NUMBERS, coaxial_beams, irsbot2_with, small_clearance

CASES = {case["name"]: case for case in NUMBERS["cases"]}
A, B, D = 0.3, 0.25, 0.4  # [m] lengths of two bars, and distance between their hinges
ALPHA = np.arccos((A**2 + D**2 - B**2) / (2 * A * D))  # angle of bar one to the x axis
# angle of bar two to the x axis
BETA = np.pi - np.arccos((B**2 + D**2 - A**2) / (2 * B * D))
# stiffnesses of both hinges [N m/rad] and of bar two [N/m]
K_ONE, K_TWO, K_BAR = 40.0, 70.0, 9e4


def only(row, value):
    """Return the stiffness of a joint that is compliant in one direction only."""
    return np.diag([value if k == row else np.inf for k in range(6)])


def two_bars(longer, clearance=None, stretch=False):
    """Return two bars on elastic hinges, connected by a pin.

    Bar two is too long by ``longer`` [m].
    """
    soft = only(3, K_BAR) if stretch else None
    frames = (
        Frame("one", rotation=[0, 0, ALPHA], joint="revolute",
              joint_stiffness=only(2, K_ONE)),
        Frame("pin", "one", [A, 0, 0], [0, 0, BETA - ALPHA], joint="revolute",
              clearance=clearance),
        Frame("end_one", "pin"),
        Frame("two", translation=[D, 0, 0], rotation=[0, 0, BETA], joint="revolute",
              joint_stiffness=only(2, K_TWO)),
        Frame("bar", "two", [B, 0, 0], joint_stiffness=soft,
              geometric_error=[0, 0, 0, longer, 0, 0]),
        Frame("end_two", "bar"),
    )  # fmt: skip
    return home_posture(Robot("bars", "end_one", frames, (("end_one", "end_two"),)))


def triangle(length):
    """Return the rotations of both bars for a given length of bar two."""
    one = np.arccos((A**2 + D**2 - length**2) / (2 * A * D)) - ALPHA
    two = np.pi - np.arccos((length**2 + D**2 - A**2) / (2 * length * D)) - BETA
    return np.array([one, two])


def pendulum(stiffness, length):
    """Return a rigid bar along x on an elastic hinge."""
    hinge = Frame("hinge", joint="revolute", joint_stiffness=only(2, stiffness))
    tip = Frame("tip", "hinge", [length, 0, 0])
    return home_posture(Robot("bar", "tip", (hinge, tip)))


# Comparison with closed forms at large rotations


@pytest.mark.parametrize("longer", [1e-4, 0.05, 0.12])
def test_rotations_of_two_bars_equal_law_of_cosines(longer):
    one, two = triangle(B + longer)
    answer = solve_exact(two_bars(longer))
    assert abs(one) > 0.2 or longer < 0.1
    assert answer.joint_screws[0, 2] == pytest.approx(one, abs=1e-12)
    assert answer.joint_screws[3, 2] == pytest.approx(two, abs=1e-12)
    assert answer.clearance_screws[1, 2] == pytest.approx(two - one, abs=1e-12)
    energy = K_ONE * one**2 / 2 + K_TWO * two**2 / 2
    assert answer.energy == pytest.approx(energy, rel=1e-11)
    turned = rotation_vector(rotation_matrix([0, 0, two]))
    assert np.abs(answer.platform_screw[:3] - turned).max() < 1e-12


def test_linearisation_error_equals_closed_form():
    """Both solutions are known in closed form."""
    longer, step = 0.06, 1e-6
    slopes = (triangle(B + step) - triangle(B - step)) / (2 * step)
    turns, springs = triangle(B + longer), np.array([K_ONE, K_TWO])
    energy, exactly = (springs @ q**2 / 2 for q in (slopes * longer, turns))
    error = solve_exact(two_bars(longer)).linearisation_error
    assert error.energy == pytest.approx(energy - exactly, rel=1e-7)
    assert error.relative_energy == pytest.approx(energy / exactly - 1, rel=1e-7)
    assert error.rotation[2] == pytest.approx(slopes[1] * longer - turns[1], rel=1e-7)


def bar_force(e, longer):
    """Return dE/de, where e is the elongation of bar two."""
    length, step = B + longer + e, 1e-6
    slope = (triangle(length + step) - triangle(length - step)) / (2 * step)
    return K_BAR * e + np.array([K_ONE, K_TWO]) * triangle(length) @ slope


@pytest.mark.parametrize("longer", [0.05, 0.12])
def test_energy_of_elastic_bar_equals_closed_form(longer):
    """The elongation of the bar is the solution of a scalar equation."""
    e = brentq(bar_force, -longer, longer, args=(longer,), xtol=1e-15)
    one, two = triangle(B + longer + e)
    answer = solve_exact(two_bars(longer, stretch=True))
    assert abs(e) > 1e-4
    assert answer.joint_screws[4, 3] == pytest.approx(e, rel=1e-8)
    assert answer.joint_screws[0, 2] == pytest.approx(one, rel=1e-8)
    energy = (K_ONE * one**2 + K_TWO * two**2 + K_BAR * e**2) / 2
    assert answer.energy == pytest.approx(energy, rel=1e-12)
    assert answer.least_curvature > 0


@pytest.mark.parametrize(("longer", "bound"), [(0.12, 0.1), (-0.1, 0.4)])
def test_passive_joint_stops_at_its_motion_limit(longer, bound):
    """The bar deforms because the rotation of the pin is limited.

    The linear model does not reach the second limit, but finite motions do.
    """
    free = solve_exact(two_bars(longer, stretch=True))

    def beyond(e):
        one, two = triangle(B + longer + e)
        return abs(two - one) - bound

    e = brentq(beyond, *sorted([-longer, 0.0]), xtol=1e-15)
    answer = solve_exact(two_bars(longer, Clearance(spin=bound), stretch=True))
    assert abs(free.clearance_screws[1, 2]) > bound
    assert (abs(free.linear.clearance_screws[1, 2]) > bound) == (longer > 0)
    assert abs(answer.clearance_screws[1, 2]) == pytest.approx(bound, rel=1e-12)
    assert answer.joint_screws[4, 3] == pytest.approx(e, rel=1e-9)
    assert answer.clearance_excess() < 1e-12


def pin_gap(one, two, longer):
    """Return the vector from the end of bar two to the end of bar one."""
    first = A * np.array([np.cos(ALPHA + one), np.sin(ALPHA + one)])
    second = (B + longer) * np.array([np.cos(BETA + two), np.sin(BETA + two)])
    return first - second - [D, 0]


@pytest.mark.parametrize("longer", [0.02, 0.06])
def test_pin_with_clearance_touches_rim_at_minimum_energy(longer):
    """The energy is minimal under the condition that the pin touches the rim."""
    clearance = 5e-3

    def balance(z):
        one, two, force = z
        gap = pin_gap(one, two, longer) / clearance
        across = np.array([-np.sin(ALPHA + one), np.cos(ALPHA + one)])
        along = np.array([np.sin(BETA + two), -np.cos(BETA + two)])
        return [
            one + force * A * (gap @ across),
            K_TWO / K_ONE * two + force * (B + longer) * (gap @ along),
            gap @ gap - 1,
        ]

    found = root(balance, [*triangle(B + longer), 0.1], tol=1e-14)
    one, two, force = found.x
    answer = solve_exact(two_bars(longer, Clearance(radial=clearance)))
    assert np.abs(found.fun).max() < 1e-12
    assert force > 0
    assert answer.joint_screws[0, 2] == pytest.approx(one, rel=1e-9)
    assert answer.joint_screws[3, 2] == pytest.approx(two, rel=1e-9)
    energy = (K_ONE * one**2 + K_TWO * two**2) / 2
    assert answer.energy == pytest.approx(energy, rel=1e-11)
    gap = np.hypot(*answer.clearance_screws[1, 3:5])
    assert gap == pytest.approx(clearance, rel=1e-12)


def test_error_within_clearance_causes_no_energy():
    """The bar is too long by 4 mm, and the clearance is 5 mm."""
    answer = solve_exact(two_bars(4e-3, Clearance(radial=5e-3)))
    assert energy_of(answer.placement) < 1e-12  # [J]; 0.04 J without clearance
    assert answer.energy == 0.0
    assert answer.closure_residual() < 1e-12
    assert answer.clearance_excess() == 0.0


def test_pin_tilts_within_clearance_if_axes_are_not_parallel():
    """The angle between the hinge axes is 0.1 rad, so the pin must tilt."""
    posture = two_bars(0.06, Clearance(tilt=0.2))
    errors = posture.robot.errors.copy()
    errors[4, 0] = 0.1  # twist of bar two, which no joint can compensate
    answer = solve_exact(replace(posture, robot=posture.robot.with_errors(errors)))
    assert np.hypot(*answer.clearance_screws[1, :2]) == pytest.approx(0.1, rel=1e-12)
    assert answer.joint_screws[0, 2] == pytest.approx(triangle(B + 0.06)[0], rel=1e-11)
    assert answer.closure_residual() < 1e-12


def test_load_on_rigid_loop_closes_the_smaller_clearance():
    """The load is transmitted by the clearance of 0.2 mm, which closes first."""
    arm = [0.1, 0, 0], [0.5, 0.2, -0.3]
    frames = (
        Frame("near", clearance=Clearance(axial=1e-3)), Frame("tip", "near", *arm),
        Frame("far", clearance=Clearance(axial=2e-4),
              geometric_error=[0, 0, 0, 0, 0, 5e-4]),
        Frame("end", "far", *arm),
    )  # fmt: skip
    posture = home_posture(Robot("slides", "tip", frames, (("tip", "end"),)))
    answer = solve_exact(posture, [0, 0, 0, 0, 0, 5.0])
    assert answer.platform_screw == pytest.approx([0, 0, 0, 0, 0, 7e-4], abs=1e-12)
    assert answer.clearance_screws[[0, 2], 5] == pytest.approx([7e-4, 2e-4], rel=1e-9)
    assert answer.potential == pytest.approx(-5 * 7e-4, rel=1e-9)
    assert answer.closure_wrenches[0, 5] == pytest.approx(-5.0, rel=1e-9)


@pytest.mark.parametrize(("force", "side"), [(30.0, 1.0), (10.0, -8.0), (0.0, 25.0)])
def test_pendulum_under_dead_load_equals_closed_form(force, side):
    """In equilibrium, k a = L (P sin a + F cos a)."""
    stiffness, length = 10.0, 0.5

    def balance(a):
        return stiffness * a - length * (force * np.sin(a) + side * np.cos(a))

    angle = brentq(balance, *sorted([0.2 * np.sign(side), 2.5 * np.sign(side)]))
    answer = solve_exact(pendulum(stiffness, length), [0, 0, 0, -force, side, 0])
    assert abs(angle) > 0.3
    assert answer.joint_screws[0, 2] == pytest.approx(angle, abs=1e-9)
    work = -force * length * (np.cos(angle) - 1) + side * length * np.sin(angle)
    assert answer.potential == pytest.approx(stiffness * angle**2 / 2 - work, rel=1e-12)
    assert answer.wrenches[0, 2] == pytest.approx(stiffness * angle, rel=1e-9)
    curvature = stiffness - length * (force * np.cos(angle) - side * np.sin(angle))
    assert answer.least_curvature == pytest.approx(curvature, rel=1e-7)


def test_rotation_of_pendulum_equals_moment_over_stiffness():
    """The rotation is moment / stiffness = 0.8 rad."""
    answer = solve_exact(pendulum(10.0, 0.5), [0, 0, 8.0, 0, 0, 0])
    assert answer.joint_screws[0, 2] == pytest.approx(0.8, rel=1e-12)
    assert answer.platform_screw[:3] == pytest.approx([0, 0, 0.8], abs=1e-12)


def test_unstable_equilibrium_has_negative_curvature():
    """The upright bar has the curvature k - P L = -5 N m/rad."""
    answer = solve_exact(pendulum(10.0, 0.5), [0, 0, 0, -30.0, 0, 0])
    assert answer.joint_screws[0, 2] == 0.0
    assert answer.least_curvature == pytest.approx(-5.0, rel=1e-12)


# Problems without a solution


def test_rigid_loop_that_cannot_close_raises_cannot_assemble():
    robot = coaxial_beams([0, 0, 0, 1e-3, 0, 0], clearance=small_clearance())
    with pytest.raises(CannotAssemble):
        solve_exact(home_posture(robot.with_links({"one": None, "two": None})))


@pytest.mark.parametrize("load", [None, [0, 0, 0, 1, 0, 0]])
def test_solution_of_another_problem_is_rejected_as_start(load):
    posture = two_bars(0.01)
    start = solve_assembly(posture if load else two_bars(0.02))
    with pytest.raises(ValueError, match="start: found the linear solution of another"):
        solve_exact(posture, load, start)


def test_too_few_steps_raise_not_converged(monkeypatch):
    monkeypatch.setattr(exact, "_STEPS", 1)
    posture = place_robot(irsbot2_with(CASES["literal"]), pose={"tz": -0.5})
    message = (
        r"exact equilibrium of irsbot2: after 1 steps, the relative loop-closure "
        r"residual is \S+ and the relative force residual is \S+"
    )
    with pytest.raises(NotConverged, match=message) as caught:
        solve_exact(posture)
    assert isinstance(caught.value, SolverFailed)
    assert caught.value.problem == "exact equilibrium of irsbot2"


# IRSBot-2 with the errors of the paper


@pytest.mark.parametrize("case", CASES)
def test_exact_solution_of_irsbot2_converges(case):
    """The points are inside and at the boundary of the workspace."""
    places = [(0, -0.5), (-0.525, -0.1), (0.35, -0.075), (-0.6, 0), (0.025, -0.6)]
    poses = np.full((len(places), 6), np.nan)
    poses[:, [0, 2]] = places
    for posture in place_many(irsbot2_with(CASES[case]), poses)[0]:
        answer = solve_exact(posture)
        assert answer.closure_residual() < 1e-12
        assert answer.stationarity < 1e-9
        assert answer.clearance_excess() < 1e-12
        assert answer.least_curvature > 0
        shift = np.linalg.norm(answer.linearisation_error.translation)
        assert 1e-6 < shift < 1e-3  # [m]


def as_springs(robot, **options):
    """Return a multibody model in which all links are springs."""
    links = [frame for frame in robot.frames if frame.link is not None]
    stiffness = {frame.name: np.linalg.inv(link_compliance(frame)) for frame in links}
    return SimulationModel("spring", stiffness, **options)


@pytest.mark.exudyn
@pytest.mark.parametrize("place", [(0, -0.5), (-0.15, -0.6)])
@pytest.mark.parametrize("case", CASES)
def test_exact_solution_agrees_with_simulation(case, place):
    """All links are springs, and clearances are omitted.

    The force law of the springs in the simulation has a relative error of s^2 / 24 for
    a rotation of s rad, which explains the tolerances of rotations and wrenches.
    """
    robot = without_clearance(irsbot2_with(CASES[case]))
    posture = place_robot(robot, pose=dict(zip(("tx", "tz"), place, strict=True)))
    answer = solve_exact(posture)
    other = simulate_assembly(posture, model=as_springs(robot))
    assert answer.linearisation_error.energy != pytest.approx(0, abs=0.1)  # [J]
    assert other.energy == pytest.approx(answer.energy, rel=1e-9)
    difference = np.abs(other.platform_screw - answer.platform_screw)
    assert difference[:3].max() < 2e-7
    assert difference[3:].max() < 1e-8
    assert np.abs(other.transforms - answer.transforms).max() < 2e-7
    wrenches = other.closure_wrenches - answer.closure_wrenches
    assert np.abs(wrenches).max() < 2e-5 * np.abs(answer.closure_wrenches).max()


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.parametrize("case", CASES)
def test_exact_solution_with_clearances_agrees_with_simulation(case):
    """To first order, contact deformation lowers the energy by twice its own energy."""
    robot = irsbot2_with(CASES[case])
    posture = place_robot(robot, pose={"tx": 0.1, "tz": -0.4})
    answer = solve_exact(posture)
    other = simulate_assembly(posture, model=as_springs(robot, clearances=True))
    energy = other.energy + 2 * other.contact_energy
    assert energy == pytest.approx(answer.energy, rel=5e-4)
    difference = np.abs(other.platform_screw - answer.platform_screw)
    assert difference[:3].max() < 1e-6
    assert difference[3:].max() < 1e-8
