"""Tests of equilibrium, objectivity, failures and memory of the simulation."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from forcefit.assembly.robots import load_robot
from forcefit.inputs.table import BadInput
from forcefit.validation.multibody import exudyn_solver
from forcefit.validation.multibody.exudyn_parts import OutOfTime
from forcefit.validation.multibody.motion import (
    exponential,
    inverse,
    logarithm,
    placement,
)
from forcefit.validation.multibody.simulation import (
    SimulationFailed,
    SimulationModel,
    closing_sequence,
    simulate_assembly,
)
from tests.multibody_for_tests import FLAT, ROUND, block, coaxial, random_stiffness

pytestmark = pytest.mark.exudyn


def overconstrained(rng, errors):
    """Return a platform on three legs, each with two beams and a joint spring."""
    legs, closures = [], []
    for k, angle in enumerate((0.0, 2.1, 4.2)):
        spot = [0.3 * math.cos(angle), 0.3 * math.sin(angle), 0]
        legs += [
            Frame(f"leg{k}.foot", translation=spot, rotation=[0, 0, angle],
                  geometric_error=errors[k]),
            Frame(f"leg{k}.knee", f"leg{k}.foot", translation=[0, 0, 0.2], link=ROUND,
                  joint="revolute", joint_stiffness=random_stiffness(rng, 1e5)),
            Frame(f"leg{k}.top", f"leg{k}.knee", translation=[0.1, 0, 0.2], link=FLAT),
            Frame(f"leg{k}.tip", f"leg{k}.top", rotation=[0, 0, -angle],
                  translation=[-0.1 - 0.3, 0, 0]),
        ]  # fmt: skip
        if k:
            closures.append(("leg0.tip", f"leg{k}.tip"))
    return home_posture(Robot("table", "leg0.tip", tuple(legs), tuple(closures)))


def test_spring_wrenches_balance_closure_wrenches(rng):
    """Equilibrium is checked in the deformed state."""
    posture = overconstrained(rng, rng.uniform(-2e-3, 2e-3, (3, 6)))
    load = np.array([3.0, -2.0, 5.0, 40.0, 30.0, -100.0])
    assembly = simulate_assembly(posture, load=load)
    robot, P = posture.robot, posture.platform[:3, 3]
    moved = P + assembly.platform_screw[3:]
    load = load + np.concatenate([np.cross(moved - P, load[3:]), np.zeros(3)])
    on_leg = [assembly.closure_wrenches.sum(axis=0) + load, *-assembly.closure_wrenches]
    for frame in robot.frames:
        row, leg = robot.index(frame.name), int(frame.name[3])
        R, p = assembly.transforms[row, :3, :3], assembly.transforms[row, :3, 3]
        w = on_leg[leg]
        own = np.concatenate([R.T @ (w[:3] - np.cross(p - P, w[3:])), R.T @ w[3:]])
        if frame.joint_stiffness is not None:
            # Exudyn evaluates springs in mean axes, rotated by about 1e-3 rad
            np.testing.assert_allclose(
                assembly.joint_wrenches[row], own, rtol=0, atol=3e-3 * np.abs(own).max()
            )
        if frame.name.endswith("top"):
            np.testing.assert_allclose(
                assembly.link_wrenches[row], own, rtol=0, atol=1e-6 * np.abs(own).max()
            )


def test_results_rotate_with_the_robot(rng):
    """The simulation is objective."""
    errors = rng.uniform(-2e-3, 2e-3, (3, 6))
    posture = overconstrained(rng, errors)
    turn = np.array([1.0, -2.0, 1.5])
    R = placement(turn, np.zeros(3))[:3, :3]
    pole = Frame("pole", rotation=turn)
    legs = tuple(
        replace(f, parent="pole") if f.parent == "base" else f
        for f in posture.robot.frames
    )
    turned_robot = replace(posture.robot, frames=(pole, *legs))
    placed = simulate_assembly(posture)
    there = simulate_assembly(home_posture(turned_robot))
    assert there.energy == pytest.approx(placed.energy, rel=1e-8)
    screw = np.concatenate([
        R.T @ there.platform_screw[:3],
        R.T @ there.platform_screw[3:],
    ])
    np.testing.assert_allclose(screw, placed.platform_screw, rtol=0, atol=1e-10)


def test_repeated_simulations_are_bit_identical(rng):
    posture = overconstrained(rng, rng.uniform(-2e-3, 2e-3, (3, 6)))
    first, second = simulate_assembly(posture), simulate_assembly(posture)
    assert np.array_equal(first.platform_screw, second.platform_screw)
    assert np.array_equal(first.link_wrenches, second.link_wrenches)
    assert first.energy == second.energy


def test_simulation_fails_for_rigid_bodies_that_do_not_fit():
    words = "a closure error of 0.0001 rad or m remains"
    with pytest.raises(SimulationFailed, match=words) as error:
        simulate_assembly(block())
    assert error.value.robot == "block"


def test_simulation_fails_for_an_unresisted_load():
    """A moment of 10 N m acts about the axis of a free pin."""
    frames = (Frame("pin", joint="revolute"), Frame("tip", "pin"))
    posture = home_posture(Robot("pendulum", "tip", frames))
    with pytest.raises(SimulationFailed, match="no equilibrium while closures are clo"):
        simulate_assembly(posture, load=[0, 0, 10.0, 0, 0, 0])


def test_simulation_prints_nothing(capfd, rng):
    simulate_assembly(coaxial(1e-4 * np.ones(6)))
    assert capfd.readouterr() == ("", "")


def test_spring_link_without_matrix_is_rejected():
    with pytest.raises(BadInput, match="link of frame 'a' is simulated as a spring"):
        simulate_assembly(coaxial(np.zeros(6)), model=SimulationModel("spring"))
    with pytest.raises(BadInput, match="links = 'shell', expected one of"):
        simulate_assembly(coaxial(np.zeros(6)), model=SimulationModel("shell"))


def test_logarithm_inverts_the_exponential_map(rng):
    """A series is used below an angle of 1e-3."""
    for size in (0.0, 1e-9, 0.999e-3, 1.001e-3, 0.1, 3.0):
        direction = rng.normal(size=3)
        turn = size * direction / np.linalg.norm(direction)
        screw = np.concatenate([turn, rng.normal(size=3)])
        T = exponential(screw)
        np.testing.assert_allclose(logarithm(T), screw, rtol=0, atol=1e-13)
        np.testing.assert_allclose(T @ exponential(-screw), np.eye(4), atol=1e-14)
        np.testing.assert_allclose(inverse(T), exponential(-screw), atol=1e-14)


def test_closing_sequence_reduces_gaps_evenly(rng):
    """The gaps decrease in equal steps from the open robot to the assembly."""
    posture = overconstrained(rng, rng.uniform(-2e-3, 2e-3, (3, 6)))
    robot = posture.robot
    sequence = closing_sequence(posture, steps=5)
    gaps = [
        np.linalg.norm(T[robot.index(first), :3, 3] - T[robot.index(second), :3, 3])
        for first, second in robot.closures
        for T in sequence
    ]
    gaps = np.reshape(gaps, (len(robot.closures), -1))
    assert len(sequence) >= 6
    # Deformation of the connectors changes the gaps by about one per cent.
    expected = gaps[:, :1] * np.linspace(1, 0, 6)
    np.testing.assert_allclose(gaps[:, :6], expected, atol=0.02 * gaps.max())
    assert gaps[:, -1].max() < 1e-11
    shut = simulate_assembly(posture).transforms
    np.testing.assert_allclose(sequence[-1], shut, rtol=0, atol=1e-9)


def resident():
    """Return the resident memory of this process in MiB."""
    status = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    (line,) = (line for line in status if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024


def assert_no_leak(simulate, count):
    """Check the memory, of which a model that is not released occupies half a MiB."""
    for _ in range(count // 5):
        simulate()
    before = resident()
    for _ in range(count):
        simulate()
    assert resident() - before < 10


@pytest.mark.slow
def test_repeated_simulations_do_not_leak_memory(rng):
    posture = overconstrained(rng, rng.uniform(-2e-3, 2e-3, (3, 6)))
    assert_no_leak(lambda: simulate_assembly(posture), 500)


@pytest.mark.slow
def test_simulations_with_contacts_or_failures_do_not_leak_memory():
    """Every second simulation fails because of its time limit."""
    clearance = Clearance(axial=3e-5, radial=1e-5)
    frames = list(coaxial([0, 0, 0, 1e-5, 0, 1e-4]).robot.frames)
    frames[0] = replace(frames[0], clearance=clearance)
    frames.insert(1, Frame("a_tip", "a"))
    posture = home_posture(Robot("coaxial", "a_tip", tuple(frames), (("a_tip", "b"),)))

    def both():
        contacts = SimulationModel(clearances=True)
        simulate_assembly(posture, model=contacts)
        with pytest.raises(OutOfTime):
            simulate_assembly(posture, model=contacts, time_limit=0.0)

    assert_no_leak(both, 50)


def relax(model, start, _steps):
    """Simulate 60 s of damped motion from the last state, as a static solver."""
    settings = model.exu.SimulationSettings()
    settings.linearSolver.solverType = model.exu.LinearSolverType.EigenSparse
    settings.solution.file.write = False
    run = settings.timeIntegration
    run.startTime, run.endTime, run.numberOfSteps = start, start + 60.0, 600
    run.verboseMode = 0
    run.generalizedAlpha.spectralRadius = 0.1  # damps oscillations
    run.generalizedAlpha.computeInitialAccelerations = False
    run.newton.useModifiedNewton = False
    run.newton.relativeTolerance = run.newton.absoluteTolerance = 1e-6
    kind = model.exu.DynamicSolverType.GeneralizedAlpha
    model.mbs.SolveDynamic(settings, solverType=kind, updateInitialValues=True)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["coaxial beams", "table on three legs", "irsbot2"])
def test_dynamic_relaxation_reaches_the_same_equilibrium(case, rng, monkeypatch):
    """The same model is simulated in time until all bodies are at rest."""
    if case == "irsbot2":
        robot = load_robot("irsbot2")
        errors = np.zeros((len(robot.frames), 6))
        for name in ("leg1.link_a", "leg2.link_b", "leg1.tip"):
            errors[robot.index(name)] = rng.uniform(-1, 1, 6) * (
                [1e-2] * 3 + [1e-4] * 3
            )
        posture = place_robot(robot.with_errors(errors), {"tx": 0.1, "tz": -0.45})
    elif case == "coaxial beams":
        posture = coaxial(1e-3 * rng.uniform(-1, 1, 6))
    else:
        posture = overconstrained(rng, rng.uniform(-2e-3, 2e-3, (3, 6)))
    static = simulate_assembly(posture)
    monkeypatch.setattr(exudyn_solver, "equilibrate", relax)
    relaxed = simulate_assembly(posture)
    assert relaxed.energy == pytest.approx(static.energy, rel=1e-8)
    np.testing.assert_allclose(
        relaxed.platform_screw, static.platform_screw, rtol=0, atol=1e-10
    )
