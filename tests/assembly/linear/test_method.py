"""Every solver takes a method, and its answer says which one gave it."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear import energy, zone
from assembly.linear.energy import solve_assembly
from assembly.linear.pose_error import bound_pose_error
from assembly.linear.reference import pose_error as reach
from assembly.linear.zone import zone_margin
from assembly.model.robot import Clearance
from assembly.platform_stiffness.platform_stiffness import platform_stiffness
from assembly.solvers import one_problem
from assembly.solvers.method import METHODS
from tests.robots_for_tests import (
    NUMBERS,
    assemble_at,
    coaxial_beams,
    irsbot2_with,
    stack,
)

GAP = np.array([0, 0, 0, 1e-4, 0, 0])
LOAD = [0.0, 0, 0, 10, 0, -50]


def beams():
    return home_posture(coaxial_beams(GAP, clearance=Clearance(radial=2e-5)))


def rigid():
    """Rigid rows: what the compiled method leaves to the reference."""
    robot = coaxial_beams(GAP, clearance=Clearance(1e-3))
    frames = tuple(replace(frame, link=None) for frame in robot.frames)
    return home_posture(replace(robot, frames=frames))


def questions(posture):
    """Every public solver, of one posture and of many."""
    T, off = stack([posture])
    assembly, many = solve_assembly(posture), solve_assembly([posture])
    return (
        lambda method: solve_assembly(posture, method=method),
        lambda method: solve_assembly([posture], method=method),
        lambda method: solve_assembly(posture, LOAD, method=method),
        lambda method: solve_assembly([posture], LOAD, method=method),
        lambda method: assemble_at(posture.robot, T, method=method),
        lambda method: zone_margin(posture, method=method),
        lambda method: zone_margin([posture], method=method),
        lambda method: bound_pose_error(assembly, method=method),
        lambda method: bound_pose_error(many, method=method),
        lambda method: platform_stiffness(posture, "contact", method=method),
        lambda method: platform_stiffness([posture], method=method),
    )


@pytest.mark.parametrize("method", METHODS)
def test_an_answer_says_the_method_that_was_asked_for(method):
    for ask in questions(beams()):
        found = ask(method).method
        assert (found if isinstance(found, str) else found[0]) == method


def test_another_word_is_refused_and_both_methods_are_named():
    for ask in questions(beams()):
        with pytest.raises(ValueError, match="is 'numpy', expected 'compiled' or 'ref"):
            ask("numpy")


def test_the_reference_calls_nothing_compiled(monkeypatch):
    """Numpy and Clarabel alone, from the linearisation to the bracket."""

    def refused(*given):
        raise AssertionError("a compiled function was called")

    posture = beams()
    for module, names in (
        (energy, ["assemble_side_by_side"]),
        (zone, ["margins_side_by_side"]),
        (one_problem, ["interior_point", "newton", "farthest"]),
    ):
        for name in names:
            monkeypatch.setattr(module, name, refused)
    found = solve_assembly(posture, method="reference")
    assert found.energy > 0.0
    assert zone_margin(posture, method="reference").margin > 0.0
    for assumption in reach.ASSUMPTIONS:
        bounds = bound_pose_error(found, assumption, method="reference")
        assert 0.0 < np.diff(bounds.translation_error) <= 1e-6
    many = solve_assembly([posture], method="reference")
    many = bound_pose_error(many, method="reference")
    assert many[0].translation_error[0] > 0.0


@pytest.mark.parametrize("load", [None, LOAD])
def test_what_is_not_proved_compiled_is_the_references_answer_to_the_bit(load):
    """It says so, of one posture and of many."""
    posture = rigid()
    asked = solve_assembly(posture, load, method="reference")
    one, many = solve_assembly(posture, load), solve_assembly([posture], load)
    assert one.method == many.method[0] == "reference"
    assert np.array_equal(one.clearances, asked.clearances)
    assert one.energy == many.energy[0] == asked.energy
    assert np.array_equal(many.multipliers[0], asked.multipliers)
    assert list(many.method).count("reference") == 1


def test_only_the_point_that_is_not_proved_is_the_references(monkeypatch):
    """One of three, with its own errors."""
    robot = irsbot2_with(NUMBERS["cases"][0])
    postures = [home_posture(robot)] * 3
    errors = robot.errors * np.array([1.0, 0.5, 2.0])[:, None, None]
    whole = solve_assembly(postures, errors=errors)
    solve = energy.assemble_side_by_side

    def uncertified(structure, T, errors, mismatch, loads, out):
        solve(structure, T, errors, mismatch, loads, out)
        out["outcome"][len(T) // 2] = 4

    monkeypatch.setattr(energy, "assemble_side_by_side", uncertified)
    found = solve_assembly(postures, errors=errors)
    assert found.method.tolist() == ["compiled", "reference", "compiled"]
    halved = replace(postures[1], robot=robot.with_errors(errors[1]))
    asked = solve_assembly(halved, method="reference")
    assert found.energy[1] == asked.energy
    assert np.array_equal(found.energy[[0, 2]], whole.energy[[0, 2]])
    assert found.to_xarray().method.values.tolist() == found.method.tolist()


def test_the_classical_stiffness_is_the_reference():
    assert platform_stiffness(beams()).method == "reference"
