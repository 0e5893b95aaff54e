"""Data of 3D scenes: displacements, forces and platform errors."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.assembly.report.error_body import ErrorBody
from forcefit.assembly.report.scene import robot_scene
from tests.pages_for_tests import parse

FORCE, LENGTH = 50.0, 0.4


def cantilever(force=FORCE):
    """Return a round bar along x with a load at its tip."""
    beam = BeamLink({"radius": 0.01}, 2e11, 0.3, theory="euler")
    tip = Frame("tip <b>", translation=[LENGTH, 0, 0], link=beam)
    return solve_assembly(home_posture(Robot("bar", "tip <b>", (tip,))),
                          [0, 0, 0, 0, 0, -force])  # fmt: skip


def scene_of(assembly, closing=None, body=None):
    (spec,) = parse(robot_scene(assembly, closing, body, "")).figures
    return spec


def test_displacement_of_a_bar_equals_that_of_a_cantilever():
    """The deflection is w(s) = F s^2 (3 L - s) / (6 E I)."""
    (bar,) = scene_of(cantilever())["bodies"]
    moved, nominal = np.array(bar["moved"]), np.array(bar["nominal"])
    s = nominal[:, 0]
    stiffness = 2e11 * np.pi * 0.01**4 / 4
    line = -FORCE * s**2 * (3 * LENGTH - s) / (6 * stiffness)
    np.testing.assert_allclose(moved[:, 2], line, rtol=1e-9, atol=1e-15)
    assert moved[4, 2] / moved[-1, 2] == pytest.approx(5 / 16)
    np.testing.assert_allclose(moved[:, :2], 0.0, atol=1e-12)
    assert bar["name"] == "tip <b>"
    assert bar["elastic"]


def test_arrows_show_the_forces_in_base_axes():
    (arrow,) = scene_of(cantilever())["forces"]
    np.testing.assert_allclose(arrow["force"], [0, 0, -FORCE], atol=1e-9)


def test_scene_contains_the_closing_motion_and_the_error_body():
    assembly = cantilever()
    frames = np.tile(assembly.posture.transforms, (3, 1, 1, 1))
    frames[0, 0, 2, 3] += 1e-3
    points = 1e-4 * np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [-1, -1, -1]])
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])
    body = ErrorBody("translation", points, faces, np.eye(3), np.ones(3))
    spec = scene_of(assembly, frames, body)
    np.testing.assert_allclose(np.array(spec["closing"])[:, 0, 2], [1e-3, 0, 0])
    np.testing.assert_array_equal(spec["body"]["points"], points)
    np.testing.assert_allclose(spec["body"]["origin"], [LENGTH, 0, 0])
    assert "0.1732 mm" in spec["body"]["text"]  # sqrt(3) times 0.1 mm


def test_unloaded_robot_is_drawn_without_displacement():
    spec = scene_of(cantilever(0.0))
    assert spec["forces"] == []
    assert spec["exaggeration"] == 1.0
    assert not np.any(spec["bodies"][0]["moved"])
