"""Use of the reference method for points that the compiled method cannot certify."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import Clearance, platform_stiffness, solve_assembly
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear import energy
from tests.robots_for_tests import NUMBERS, coaxial_beams, irsbot2_with

GAP = np.array([0, 0, 0, 1e-4, 0, 0])
LOAD = [0.0, 0, 0, 10, 0, -50]


def beams():
    return home_posture(coaxial_beams(GAP, clearance=Clearance(radial=2e-5)))


def rigid():
    """Return a robot with rigid loops, which the compiled method does not cover."""
    robot = coaxial_beams(GAP, clearance=Clearance(1e-3))
    frames = tuple(replace(frame, link=None) for frame in robot.frames)
    return home_posture(replace(robot, frames=frames))


@pytest.mark.parametrize("load", [None, LOAD])
def test_unproved_point_has_the_result_of_the_reference_method(load):
    """The field ``method`` contains the method used."""
    posture = rigid()
    asked = solve_assembly(posture, load, method="reference")
    one, many = solve_assembly(posture, load), solve_assembly([posture], load)
    assert one.method == many.method[0] == "reference"
    assert np.array_equal(one.clearances, asked.clearances)
    assert one.energy == many.energy[0] == asked.energy
    assert np.array_equal(many.multipliers[0], asked.multipliers)
    assert list(many.method).count("reference") == 1


def test_only_unproved_points_use_the_reference_method(monkeypatch):
    """One of three points cannot be certified."""
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


def test_classical_stiffness_of_one_posture_uses_the_reference_method():
    assert platform_stiffness(beams()).method == "reference"
