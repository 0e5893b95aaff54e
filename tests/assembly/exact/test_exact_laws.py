"""Tests of general properties of the exact equilibrium."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from forcefit import BeamLink, Clearance, Frame, Robot, solve_assembly, solve_exact
from forcefit.assembly.exact.equilibrium import active_clearances
from forcefit.assembly.kinematics.closure_rates import closure_signs
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.robots import load_robot
from forcefit.assembly.robots.delta import delta
from forcefit.assembly.robots.hexapod import hexapod
from forcefit.validation.multibody.simulation import without_clearance
from tests.assembly.exact.test_exact import pendulum, two_bars
from tests.assembly.kinematics.test_closing import parallelograms
from tests.robots_for_tests import NUMBERS, irsbot2_with, random_robot

CASES = {case["name"]: case for case in NUMBERS["cases"]}


@pytest.mark.parametrize("case", CASES)
def test_linearisation_error_is_of_second_order(case):
    """The error of the pose is proportional to s^2 for geometric errors times s.

    The relative error of the energy is proportional to s.
    """
    robot = without_clearance(irsbot2_with(CASES[case]))
    posture = place_robot(robot, pose={"tx": 0.1, "tz": -0.45})
    turns, shifts, energies = [], [], []
    for s in (1 / 32, 1 / 64, 1 / 128):
        scaled = replace(posture, robot=robot.with_errors(s * robot.errors))
        error = solve_exact(scaled).linearisation_error
        turns.append(np.linalg.norm(error.rotation))
        shifts.append(np.linalg.norm(error.translation))
        energies.append(abs(error.relative_energy))
    for values, slope in ((turns, 2), (shifts, 2), (energies, 1)):
        found = np.log2(np.array(values[:-1]) / values[1:])
        assert np.abs(found - slope).max() < 0.05


@pytest.mark.parametrize("seed", [1, 2, 3, 5])
def test_energy_derivative_by_geometric_error_equals_force(seed):
    rng = np.random.default_rng(seed)
    robot, step = random_robot(rng, legs=3), 1e-6
    answer = solve_exact(home_posture(robot))
    through = closure_signs(robot).T @ answer.closure_wrenches
    expected = -through[0, 3:] @ robot.fixed_transforms[0, :3, :3]
    energies = np.zeros((3, 2))
    for k in range(3):
        for side, sign in enumerate((1, -1)):
            errors = robot.errors.copy()
            errors[0, 3 + k] += sign * step
            moved = home_posture(robot.with_errors(errors))
            energies[k, side] = solve_exact(moved).energy
    found = (energies[:, 0] - energies[:, 1]) / (2 * step)
    # the second term is the round-off of the energy divided by the step
    assert np.abs(found - expected).max() < 1e-5 * np.abs(through[:, 3:]).max() + 1e-7


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_exact_solution_converges_if_rods_can_spin(seed):
    """The rods of the Delta robot spin, which hardly changes the energy."""
    rng = np.random.default_rng(seed)
    robot = delta()
    errors = 1e-4 * rng.uniform(-1, 1, robot.errors.shape)
    posture = home_posture(robot.with_errors(errors))
    answer = solve_exact(posture, [1, 2, 0, 20, -10, -30])
    assert answer.stationarity < 1e-9
    assert answer.least_curvature > 0
    assert np.abs(answer.placement.own).max() > 0.1


@pytest.mark.parametrize(
    ("name", "component", "value"),
    [
        ("arm6", 5, -100.0), ("arm6", 2, 1.0), ("delta", 5, -1.0), ("four_bar", 0, 1.0),
        ("five_bar", 0, 0.01),
    ],
)  # fmt: skip
def test_platform_displacement_satisfies_castigliano_theorem(name, component, value):
    """The theorem also applies if some contacts have no force because of symmetry."""
    posture = home_posture(load_robot(name))
    unit, step = np.eye(6)[component], 1e-3
    low, middle, high = (solve_exact(posture, share * value * unit)
                         for share in (1 - step, 1.0, 1 + step))  # fmt: skip
    assert middle.stationarity < 1e-7
    slope = (high.potential - low.potential) / (2 * step * value)
    # the tolerance is the error of the central difference
    assert -slope == pytest.approx(middle.platform_screw[component], rel=1e-5)


def loaded_arm(pieces=1):
    """Return the equilibrium of the six-axis arm with random errors under a load."""
    robot = load_robot("arm6")
    rng = np.random.default_rng(2)
    errors = rng.uniform(-1, 1, (len(robot.frames), 6)) * [*[2e-2] * 3, *[1e-3] * 3]
    beams = [f for f in robot.frames if hasattr(f.link, "pieces")]
    links = {f.name: replace(f.link, pieces=pieces) for f in beams}
    assert links
    posture = place_robot(robot.with_links(links).with_errors(errors))
    return solve_exact(posture, [1.0, -2.0, 0.5, 20.0, 30.0, -40.0])


def test_beam_with_two_elements_agrees_with_one_element():
    """The deformations are small, so one beam element per link is sufficient."""
    whole, cut = loaded_arm(), loaded_arm(pieces=2)
    assert len(cut.placement.transforms) > len(whole.placement.transforms)
    for name in ("link_screws", "wrenches"):
        one, other = getattr(whole, name), getattr(cut, name)
        for part in (slice(3), slice(3, 6)):
            size = np.abs(one[:, part]).max()
            assert size > 0
            assert other[:, part] == pytest.approx(one[:, part], abs=2e-2 * size)


def test_start_from_nearby_solution_finds_same_equilibrium():
    """The load is increased by 1 %.  A solution of another robot is ignored."""
    posture = loaded_arm().posture
    load = np.array([1.0, -2.0, 0.5, 20.0, 30.0, -40.0])
    before = solve_exact(posture, load)
    again = solve_exact(posture, 1.01 * load)
    near = solve_exact(posture, 1.01 * load, near=before)
    assert near.platform_screw == pytest.approx(again.platform_screw, rel=1e-9)
    other = solve_exact(home_posture(load_robot("five_bar")), [0, 0, 0, 1, 0, 0])
    stranger = solve_exact(posture, load, near=other)
    assert np.array_equal(stranger.platform_screw, before.platform_screw)


@pytest.mark.parametrize("point", [(0.2, 0.0, 0.0), (-0.1, 0.3, 0.0)])
def test_force_at_platform_point_moves_with_platform(point):
    """In equilibrium, k a = r x F, where r is the rotated point of application."""
    k, L, force = 10.0, 0.5, np.array([4.0, 9.0])
    posture = pendulum(k, L)
    x, y = L + point[0], point[1]

    def balance(a):
        c, s = np.cos(a), np.sin(a)
        arm = [c * x - s * y, s * x + c * y]
        return k * a - (arm[0] * force[1] - arm[1] * force[0])

    angle = brentq(balance, -1.5, 1.5)
    load = [0, 0, 0, *force, 0]
    answer = solve_exact(posture, load, point=point)
    assert answer.joint_screws[0, 2] == pytest.approx(angle, abs=1e-9)
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    work = force @ ((R - np.eye(2)) @ [x, y])
    assert answer.potential == pytest.approx(k * angle**2 / 2 - work, rel=1e-9)
    # in the linear model, the load is the force and its moment about the origin
    moment = point[0] * force[1] - point[1] * force[0]
    start = solve_assembly(posture, [0, 0, moment, *force, 0])
    assert answer.linear.load == pytest.approx(start.load, abs=1e-12)
    given = solve_exact(posture, load, start=start, point=point)
    assert given.platform_screw == pytest.approx(answer.platform_screw, rel=1e-12)


@pytest.mark.parametrize("pieces", [1, 3, 5])
@pytest.mark.parametrize("radius", [0.01, 0.03])
def test_displacement_is_proportional_to_small_loads(pieces, radius):
    """Displacements are proportional to loads between 1e-9 N and 1 N.

    For small loads, the change of the energy in a step is below its round-off.
    """
    link = BeamLink({"radius": radius}, 7e10, 0.3, pieces=pieces)
    arm = Frame("arm", translation=[0.5, 0.1, 0.2], rotation=[0, 0, 0.4], link=link)
    posture = home_posture(Robot("arm", "arm", (arm,)))
    load = np.array([0.1, 0.0, 0.2, 0.2, -0.4, 0.3])
    C = solve_assembly(posture, load).platform_screw
    for size in 10.0 ** np.arange(-9, 1):
        for given in ({"load": size * load}, {"bodies": size * load[None]}):
            answer = solve_exact(posture, **given)
            assert answer.stationarity <= 1e-7
            for part in (slice(3), slice(3, 6)):
                found = answer.platform_screw[part] / size
                tol = 1e-3 * np.abs(C[part]).max() + 1e-15 / size  # second: round-off
                assert found == pytest.approx(C[part], abs=tol)


def test_robot_without_errors_has_no_displacement():
    robot = hexapod()
    answer = solve_exact(home_posture(robot.with_errors(0 * robot.errors)))
    assert answer.energy == 0.0
    assert np.abs(answer.platform_screw).max() < 1e-12


def test_rounded_lengths_cause_no_energy():
    """Crank lengths with six digits cause gaps of up to 1e-6 m in the loops."""
    posture = home_posture(parallelograms(digits=6))
    assert posture.mismatch > 1e-9
    assert solve_exact(posture).energy == 0.0


def test_contact_force_equals_energy_derivative_by_clearance():
    """The product of force and clearance c is -c dE/dc."""
    clearance, step = 5e-3, 1e-6
    low, here, high = (
        solve_exact(two_bars(0.06, Clearance(radial=c)))
        for c in (clearance - step, clearance, clearance + step)
    )
    active, force = active_clearances(here.expansion)
    assert active.tolist() == [True]
    saved = (low.energy - high.energy) / (2 * step)
    assert force == pytest.approx([clearance * saved], rel=1e-6)
