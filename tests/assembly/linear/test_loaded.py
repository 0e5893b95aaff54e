"""Compiled solution of (22) under loads, compared with closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.certificate import unproved
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.measurement.settled_clearance import without_joint_clearances
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.robots import BUILT_IN, load_robot
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.solvers.method import METHODS
from tests.robots_for_tests import NUMBERS, coaxial_beams, irsbot2_with, random_robot

LOAD = np.array([1.0, 2.0, 3.0, 30.0, 10.0, -100.0])
GRAVITY = (1.0, 2.0, -9.81)


def compiled(posture, *loads, **others):
    """Solve one posture by the compiled kernels."""
    many = solve_assembly([posture], *loads, **others)
    assert set(many.method) == {"compiled"}
    assert many.certified.all()
    return many


@pytest.mark.parametrize("force", [0.5, 50.0, 300.0])
def test_second_spring_deforms_only_after_the_pin_touches_its_bore(force):
    """A second spring acts through a pin with radial clearance c.

    The displacement satisfies k1 x = w for x <= c and k1 x + k2 (x - c) = w for x > c.
    """
    k1, k2, c = 1e6, 3e6, 1e-4
    robot = coaxial_beams([0.0] * 6, (k1, k2), clearance=Clearance(radial=c))
    robot = replace(robot, platform="one")
    many = compiled(home_posture(robot), [0, 0, 0, 0.6 * force, 0.8 * force, 0])
    x = force / k1 if force <= k1 * c else (force + k2 * c) / (k1 + k2)
    stored = k1 * x**2 / 2 + k2 * max(0.0, x - c) ** 2 / 2
    assert many.platform_screw[0, 3:5] == pytest.approx([0.6 * x, 0.8 * x], rel=1e-7)
    assert many.energy[0] == pytest.approx(stored, rel=2e-8)


def test_load_moves_an_open_chain_to_the_boundary_of_its_clearance():
    """The displacement of spring and pin in series is c + w / k."""
    k, c, force = 1e5, 2e-4, 7.0
    frames = (
        Frame("arm", link=MatrixLink(k * np.eye(6))),
        Frame("pin", "arm", clearance=Clearance(radial=c)),
        Frame("tip", "pin"),
    )
    many = compiled(home_posture(Robot("hung", "tip", frames)), [0, 0, 0, 0, -force, 0])
    assert many.platform_screw[0, 4] == pytest.approx(-c - force / k, rel=1e-12)
    assert many.energy[0] == pytest.approx(force**2 / (2 * k), rel=1e-12)
    assert many.work[0] == pytest.approx(force * c + force**2 / k, rel=1e-12)


@pytest.mark.parametrize("name", ["irsbot2", "3rrr", "five_bar", "four_bar"])
def test_displacements_due_to_loads_and_errors_add_without_clearance(name, rng):
    """Superposition is valid, and the platform compliance is symmetric."""
    posture = home_posture(without_joint_clearances(load_robot(name)))
    robot = posture.robot
    errors = 1e-4 * rng.normal(size=robot.errors.shape)
    if name == "irsbot2":  # its proximal loops are rigid
        errors[~np.any(irsbot2_with(NUMBERS["cases"][0]).errors, axis=1)] = 0.0
    erring = replace(posture, robot=robot.with_errors(errors))
    alone = solve_assembly([erring]).platform_screw[0]
    loaded = compiled(posture, LOAD, gravity=GRAVITY).platform_screw[0]
    both = compiled(erring, LOAD, gravity=GRAVITY).platform_screw[0]
    C = np.array([compiled(posture, w).platform_screw[0] for w in np.eye(6)[3:]])
    size = np.abs(both).reshape(2, 3).max(axis=1).repeat(3) + 1e-12
    assert np.abs((both - alone - loaded) / size).max() < 1e-9
    assert C[:, 3:] == pytest.approx(C[:, 3:].T, rel=1e-8, abs=1e-9 * np.abs(C).max())


@pytest.mark.parametrize("kappa", [0.0, 0.2, 1.0])
@pytest.mark.parametrize("size", [1e-3, 1.0, 10.0])
def test_all_points_of_irsbot2_are_certified(grid, kappa, size):
    robot, postures = grid
    erring = robot.with_errors(kappa * robot.errors)
    postures = [replace(posture, robot=erring) for posture in postures]
    many = solve_assembly(postures, size * LOAD, gravity=size * np.array(GRAVITY))
    assert many.loaded.all()
    assert set(many.method) == {"compiled"}
    assert many.certified.all()
    assert many.closure_residual().max() < 1e-11
    assert many.clearance_excess().max() < 1e-14


def cases_at_random():
    """Yield random robots, including robots that no kernel covers."""
    for name in sorted(BUILT_IN):
        yield home_posture(BUILT_IN[name]())
    for seed in range(60):
        rng = np.random.default_rng(seed)
        yield home_posture(random_robot(rng, 1 + seed % 3, 1 + seed // 3 % 3))


@pytest.mark.parametrize("loaded", [False, True])
def test_compiled_and_reference_methods_agree_on_random_robots(
    loaded,
):
    """The potentials agree for loads on all bodies and errors of any magnitude."""
    solved = 0
    for number, home in enumerate(cases_at_random()):
        rng = np.random.default_rng(number)
        errors = 10.0 ** rng.uniform(-5, -3) * rng.normal(size=home.robot.errors.shape)
        if home.robot.name.lower().startswith("irsbot"):
            errors = irsbot2_with(NUMBERS["cases"][0]).errors
        if home.robot.errors.any():
            errors = rng.uniform(0.1, 1.0) * home.robot.errors
        posture = replace(home, robot=home.robot.with_errors(errors))
        size = 10.0 ** rng.uniform(-2, 2)
        given = (
            size * rng.normal(size=6), 0.3 * size * rng.normal(size=errors.shape),
            GRAVITY,
        ) if loaded else ()  # fmt: skip
        many = solve_assembly([posture], *given)
        try:
            reference = solve_assembly(posture, *given, method="reference")
        except FreeMotion:
            assert many.status[0] == "no equilibrium"
            continue
        except (CannotAssemble, SolverFailed) as error:
            reason = str(error)
            assert many.status[0] != "ok"
            assert many.reason[0] == reason
            assert np.isnan(many.energy[0])
            continue
        if many.method[0] == "reference":
            continue
        solved += 1
        assert many.certified[0]
        assert unproved(reference) == ""
        on_errors = reference.frame_loads.body @ errors.ravel()
        potential = many.energy[0] - many.work[0] - on_errors
        # The uncertainty of the reference includes the round-off in the closures.
        gaps = many.duality_gap()[0] + reference.uncertainty + 1e-15 * abs(on_errors)
        assert abs(potential - reference.potential) <= gaps
        assert many.energy_without_clearance[0] == pytest.approx(
            reference.energy_without_clearance, rel=1e-7, abs=1e-15
        )
        # With clearance, the screw can be non-unique.
        if not len(reference.clearances):
            size = np.abs(reference.platform_screw).max() + 1e-12
            off = np.abs(many.platform_screw[0] - reference.platform_screw)
            assert off.max() < 1e-6 * size
    assert solved


@pytest.mark.parametrize("method", METHODS)
def test_load_moves_a_pin_to_its_motion_limit(
    method,
):
    """Without the limit of 1e-3 rad, the pin has no equilibrium."""
    pin = Frame("pin", joint="revolute", clearance=Clearance(spin=1e-3))
    load = [0, 0, 2.0, 0, 0, 0]
    for own, status in ((pin, "ok"), (replace(pin, clearance=None), "no equilibrium")):
        robot = Robot("pin", "end", (own, Frame("end", "pin", [1.0, 0, 0])))
        found = solve_assembly([home_posture(robot)], load, method=method)
        assert found.status.tolist() == [status]
        if status == "ok":
            assert found.platform_screw[0, 2] == pytest.approx(1e-3, rel=1e-6)
