"""Tests of clearances that are modelled as contacts."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear import assembled
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.assembly.robots import load_robot
from forcefit.validation.crosscheck.crosscheck import crosscheck
from forcefit.validation.crosscheck.verdict import verdict
from forcefit.validation.multibody import exudyn_model
from forcefit.validation.multibody.contact import (
    ClearanceCone,
    cone_energy,
    cone_forces,
    joint_clearance,
)
from forcefit.validation.multibody.exudyn_parts import OutOfTime
from forcefit.validation.multibody.simulation import SimulationModel, simulate_assembly
from tests.robots_for_tests import with_frames

pytestmark = pytest.mark.exudyn

E, NU = 60e9, 0.3
ROUND = BeamLink({"radius": 0.04}, E, NU)
AREA = math.pi * 0.04**2
DISC = ClearanceCone((3, 4), 3e-5, 1e12)


def coaxial(error, clearance, length=0.4):
    """Return two misaligned beams, with clearance at the end of the first beam."""
    frames = (
        Frame("a", translation=[length, 0, 0], rotation=[0, math.pi / 2, 0],
              link=ROUND, geometric_error=error, clearance=clearance),
        Frame("a_tip", "a", rotation=[0, -math.pi / 2, 0]),
        Frame("wall", translation=[2 * length, 0, 0]),
        Frame("b", "wall", translation=[-length, 0, 0], link=ROUND),
    )  # fmt: skip
    return home_posture(Robot("coaxial", "a_tip", frames, (("a_tip", "b"),)))


def push(cone, screw, width):
    """Return the wrench of a contact, (6,)."""
    wrench = np.zeros(6)
    for row, value in cone_forces(cone, screw, width):
        wrench[row] += value
    return wrench


@pytest.mark.parametrize("arm", [0.0, 0.04, -0.04])
def test_contact_force_is_the_gradient_of_its_energy(arm):
    """The gradient is computed by differences inside, at and outside the bound."""
    disc = replace(DISC, arm=arm)
    unit = np.array([0.04, 0.04, 1, 1, 1, 1])  # displacement per unit motion
    for r in (0.0, 1e-5, 2.999e-5, 3.001e-5, 3.3e-5):
        for width in (3.0, 1e-2):
            screw = np.array([0.1, -0.2, 0.3, 0.6, 0.8, 0.4]) * r / unit
            for k in range(6):
                step = 5e-10 / unit[k] * np.eye(6)[k]
                more = cone_energy(disc, screw + step, width)
                less = cone_energy(disc, screw - step, width)
                slope = (more - less) / (1e-9 / unit[k])
                scale = disc.stiffness * disc.size * unit[k]
                force = push(disc, screw, width)[k]
                assert force == pytest.approx(slope, abs=2e-5 * scale)


def test_pin_in_two_bushes_has_contact_at_the_radial_clearance():
    """At z = h, the pin's axis is at (TX + h RY, TY - h RX)."""
    clearance = Clearance(radial=3e-5, tilt=7.5e-4, axial=1e-5)
    bushes = joint_clearance(Frame("f", clearance=clearance), bushes=True)
    assert [(c.rows, c.size, c.arm) for c in bushes.cones] == [
        ((5,), 1e-5, 0.0), ((3, 4), 3e-5, 0.04), ((3, 4), 3e-5, -0.04)
    ]  # fmt: skip
    assert bushes.unlocked == (0, 1, 3, 4, 5)
    _, far, near = bushes.cones
    tilted = [0, 7.5e-4, 0, 0, 0, 0]
    assert far.offsets(tilted) == pytest.approx([3e-5, 0])
    assert near.offsets(tilted) == pytest.approx([-3e-5, 0])
    both = push(far, [0, 7.5e-4, 0, 3e-5, 0, 0], 1e-4)
    assert both[3] > 0
    assert both[1] == pytest.approx(0.04 * both[3])


@pytest.mark.parametrize("misfit", [5e-5, 1e-4])
def test_energy_with_axial_clearance_equals_closed_form(misfit):
    """The energy is (g - c)^2 EA / 2(2L) for a misfit g and a clearance c = 30 um.

    The tolerance is twice the effect of the smoothing width, 9 nm.
    """
    stiffness = E * AREA / 0.8
    check = simulate_assembly(
        coaxial([0, 0, 0, 0, 0, misfit], Clearance(axial=3e-5)),
        model=SimulationModel(clearances=True),
    )
    expected = (misfit - 3e-5) ** 2 * stiffness / 2
    allowed = 2 * 9e-9 / (misfit - 3e-5)
    assert check.rigid_energy == pytest.approx(expected, rel=allowed)


@pytest.mark.parametrize("pause", [0.0, 0.05])
def test_time_limit_of_a_simulation_does_not_affect_other_simulations(
    pause, monkeypatch
):
    """All models share Exudyn's timer.

    With a pause of 0.05 s, the simulation would take minutes without a time limit.
    """
    contacts = SimulationModel(clearances=True)
    posture = coaxial([0, 0, 0, 0, 0, 1e-4], Clearance(axial=3e-5))
    with monkeypatch.context() as patch:
        patch.setattr(
            exudyn_model, "cone_forces",
            lambda *args: time.sleep(pause) or cone_forces(*args),
        )  # fmt: skip
        with pytest.raises(OutOfTime, match="time limit was reached while") as error:
            simulate_assembly(posture, model=contacts, time_limit=max(pause, 1e-3))
    assert error.value.robot == "coaxial"
    assert simulate_assembly(posture, model=contacts).rigid_energy > 0


def test_keyboard_interrupt_in_the_solver_is_raised(monkeypatch):
    """Exudyn replaces a KeyboardInterrupt by another exception."""

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(exudyn_model, "cone_forces", interrupted)
    posture = coaxial([0, 0, 0, 0, 0, 1e-4], Clearance(axial=3e-5))
    with pytest.raises(KeyboardInterrupt):
        simulate_assembly(posture, model=SimulationModel(clearances=True))


def test_energy_of_a_ball_agrees_with_the_exact_model():
    """The tolerance is the effect of the smoothing of contacts."""
    posture = coaxial([0, 0, 0, 6e-5, -9e-5, 3e-5], Clearance(ball=3e-5))
    exact = solve_exact(posture)
    found = simulate_assembly(posture, model=SimulationModel(clearances=True))
    assert found.rigid_energy == pytest.approx(exact.energy, rel=3e-3)
    moved = found.clearance_screws[0, 3:]
    assert np.linalg.norm(moved) == pytest.approx(3e-5, rel=2e-2)
    np.testing.assert_allclose(moved, exact.clearance_screws[0, 3:], atol=1e-6)


def test_crosscheck_of_a_joint_with_a_ball_passes():
    posture = coaxial([1e-3, 0, 0, 6e-5, -9e-5, 3e-5], Clearance(ball=3e-5, tilt=5e-4))
    check = crosscheck(posture, (1.0, 0.5, 0.25), clearances=True)
    assert check.passed, check.checks


@pytest.mark.slow
def test_crosscheck_of_irsbot2_with_clearances_passes(irsbot2):
    """The optimality gap decreases with the scale."""
    check = crosscheck(
        place_robot(irsbot2, {"tx": 0.0, "tz": -0.5}), (1.0, 0.5, 0.25), clearances=True
    )
    assert check.passed, check.checks
    # The contacts are about 1000 times as stiff as the links.
    assert check.metric.limits["spring deformation"].value < 5e-3
    assert check.metric.gaps[0] > check.metric.gaps[1] > check.metric.gaps[2] > 0


@pytest.mark.slow
def test_energy_with_clearances_agrees_with_the_exact_model(irsbot2):
    """At the full errors of the paper, the linear energy differs by more than 1 %."""
    posture = place_robot(irsbot2, {"tx": 0.1, "tz": -0.15})
    check = crosscheck(posture, (1.0, 0.5), links="spring", clearances=True)
    assert check.passed, check.checks
    assert abs(check.metric.energies["exact"][0]) < 3e-3
    assert abs(check.metric.energies["linear"][0]) > 1e-2


def heavy():
    """Return two heavy, misaligned beams with bodies of 6 kg and a clearance."""
    light = coaxial([0, 0, 0, 6e-5, 2e-5, 5e-5], Clearance(radial=2e-5, axial=2e-5))
    return home_posture(with_frames(
        light.robot, lambda f: f.link is not None, mass=6.0,
        link=replace(ROUND, density=2000.0), centre_of_mass=[0.0, 0.01, 0.02],
    ))  # fmt: skip


@pytest.mark.parametrize("links", ["beam", "spring"])
def test_crosscheck_with_weight_and_clearances_passes(links):
    """The acceleration is about 100 times that of gravity.

    The deflections then exceed the clearance.
    """
    check = crosscheck(
        heavy(), (1.0, 0.5), links=links, gravity=[0, 300.0, -900.0], clearances=True
    )
    assert check.passed, check.text()
    assert abs(check.metric.energies["exact"][0]) < 0.02
    assert (check.pairs[0].between > 0) == (links == "beam")
    light = crosscheck(heavy(), (1.0, 0.5), links=links, clearances=True)
    ratio = check.pairs[0].linear.energy / light.pairs[0].linear.energy
    assert abs(ratio - 1) > 0.1


def test_crosscheck_with_clearances_fails_for_a_wrong_weight(monkeypatch):
    """The weight in the linear model is 5 % too large."""
    right = assembled.weights
    monkeypatch.setattr(
        assembled, "weights", lambda at, g: right(at, 1.05 * np.asarray(g))
    )
    check = crosscheck(heavy(), (1.0, 0.5), gravity=[0, 300.0, -900.0], clearances=True)
    assert not check.passed


def drawn(name, size, pose=None):
    """Return a built-in robot with random errors of 1 mrad and 0.1 mm times a size."""
    robot = load_robot(name)
    sources = tolerance_sources(robot, size * np.array([1e-3] * 3 + [1e-4] * 3))
    errors = sources.errors(sources.draw(0, 1, seed=7))[0]
    posture = home_posture(robot) if pose is None else place_robot(robot, pose)
    return replace(posture, robot=robot.with_errors(errors))


@pytest.mark.parametrize(
    ("name", "size", "pose", "said"),
    [pytest.param("hexapod", 1.0, None, "no signal", marks=pytest.mark.slow),
     pytest.param("delta", 1.0, None, "no signal", marks=pytest.mark.slow),
     ("arm6", 1.0, None, "no signal"),
     pytest.param("four_bar", 1.0, None, "passed", marks=pytest.mark.slow),
     pytest.param("irsbot2", 0.1, {"tx": 0.1, "tz": -0.5}, "passed",
                  marks=pytest.mark.slow)],
)  # fmt: skip
def test_energy_is_zero_for_errors_within_the_clearance(name, size, pose, said):
    """Without overconstraint, the cross-check has no signal."""
    check = crosscheck(drawn(name, size, pose), (1.0, 0.5), clearances=True)
    assert check.pairs[0].linear.energy == pytest.approx(0.0, abs=1e-20)
    assert check.pairs[0].simulated.energy < 1e-8
    assert verdict(check) == said


@pytest.mark.parametrize(
    ("name", "load"),
    [pytest.param("hexapod", [0, 0, 0, 0, 0, -200], marks=pytest.mark.slow),
     pytest.param("delta", [0, 0, 0, 0, 0, -50], marks=pytest.mark.slow),
     ("five_bar", [0, 0, 0, 0, -20, 0])],
)  # fmt: skip
def test_optimality_gap_under_a_load_is_relative_to_the_stored_energy(name, load):
    """Without errors, assembly requires no energy."""
    check = crosscheck(
        home_posture(load_robot(name)), (1.0, 0.5), load=load, clearances=True
    )
    assert check.passed
    assert 0 <= check.metric.gaps[0] < 0.02
