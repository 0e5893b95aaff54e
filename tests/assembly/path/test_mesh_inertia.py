"""Tests of the inertia of mesh links against beams and rigid bodies."""

from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.assembly.files.solved_links import solved_link
from forcefit.assembly.model.link_kinds import MeshSolution
from forcefit.assembly.model.robot import BeamLink, Frame, MeshLink, Robot
from forcefit.assembly.path.inertial_loads import inertial_loads
from forcefit.assembly.path.mesh_inertia import mesh_end_wrenches
from tests.assembly.path.moving_robots_for_tests import hinge, moving_drives

MESHES = Path(__file__).parents[3] / "meshes"
LENGTH, RADIUS, E, RHO = 0.452, 0.04, 70e9, 2700.0
G = np.array([2.0, -9.0, 3.0])


def rod_mass(section_inertia):
    """Return the consistent mass matrix of a rod along x by Gauss integration."""
    area, L = np.pi * RADIUS**2, LENGTH
    s, w = np.polynomial.legendre.leggauss(8)
    s, w = (s + 1) / 2, w / 2 * L
    M = np.zeros((12, 12))
    for x, weight in zip(s, w, strict=True):
        shift, turn = np.zeros((2, 3, 12))
        shift[0, [3, 9]] = turn[0, [0, 6]] = 1 - x, x
        cubic = [1 - 3 * x**2 + 2 * x**3, L * (x - 2 * x**2 + x**3),
                 3 * x**2 - 2 * x**3, L * (x**3 - x**2)]  # fmt: skip
        slope = [6 * (x**2 - x) / L, 1 - 4 * x + 3 * x**2, 6 * (x - x**2) / L,
                 3 * x**2 - 2 * x]  # fmt: skip
        shift[1, [4, 2, 10, 8]] = cubic
        turn[2, [4, 2, 10, 8]] = slope
        sign = np.array([1, -1, 1, -1])
        shift[2, [5, 1, 11, 7]] = cubic * sign
        turn[1, [5, 1, 11, 7]] = -np.array(slope) * sign
        M += weight * RHO * area * shift.T @ shift
        turning = section_inertia * np.diag([2, 1, 1])
        M += weight * RHO * turn.T @ turning @ turn
    return M


def turned_arm(link):
    """Return the motion of a link on three accelerated hinges."""
    frames = (
        hinge("z"), hinge("x", "z", rotation=[0, np.pi / 2, 0]),
        hinge("y", "x", [0.1, 0, 0.05], rotation=[np.pi / 3, 0, 0]),
        Frame("tip", "y", [LENGTH, 0, 0], link=link),
    )  # fmt: skip
    names = ("q.z", "q.x", "q.y")
    path = np.array([[[0.3, -0.4, 0.6]], [[4.0, -7, 5]], [[60.0, 90.0, -40]]])
    return moving_drives(Robot("arm", "tip", frames), names, tuple(path))


def with_mass(M):
    """Return a mesh link along x with a given mass matrix."""
    solved = SimpleNamespace(
        centers=np.array([[0, 0, 0], [LENGTH, 0, 0]]),
        link=SimpleNamespace(compliance=np.zeros((6, 6))),
    )
    link = MeshLink(Path("rod.stl"), "x=0", "x=1", E, 0.3, RHO)
    return replace(link, solution=MeshSolution(solved, E, "", M))


def test_loads_of_thin_mesh_link_equal_beam_loads():
    """The rotary inertia of the sections is omitted."""
    beam = BeamLink({"radius": RADIUS}, E, 0.3, RHO, "euler")
    by_beam = inertial_loads(turned_arm(beam), G)
    thin = replace(by_beam.beams[3], m=np.zeros((1, 3)))
    R = thin.data.axes
    expected = [
        np.hstack([w[:, :3] @ R.T, w[:, 3:] @ R.T])
        for w in (thin.at_tip(), thin.at_base(thin.at_tip()))
    ]
    tip, base, span = mesh_end_wrenches(turned_arm(with_mass(rod_mass(0.0))), 3, G)
    np.testing.assert_allclose(span, [LENGTH, 0, 0], atol=1e-15)
    size = np.abs(expected).max()
    np.testing.assert_allclose(tip, expected[0], atol=1e-12 * size)
    np.testing.assert_allclose(base, expected[1], atol=1e-12 * size)


def test_sum_of_mesh_link_loads_equals_rigid_body_load():
    """The resultant satisfies the Newton-Euler equations of a cylinder."""
    second = np.pi * RADIUS**4 / 4
    motion = turned_arm(with_mass(rod_mass(second)))
    found = inertial_loads(motion, G)
    mass = RHO * np.pi * RADIUS**2 * LENGTH
    across = mass * (3 * RADIUS**2 + LENGTH**2) / 12
    body = Frame(
        "tip", "y", [LENGTH, 0, 0], mass=mass, centre_of_mass=[-LENGTH / 2, 0, 0],
        inertia=np.diag([mass * RADIUS**2 / 2, across, across]),
    )  # fmt: skip
    robot = motion.postures.robot
    rigid = replace(robot, frames=(*robot.frames[:3], body))
    moved = replace(motion, postures=replace(motion.postures, robot=rigid))
    expected = inertial_loads(moved, G).bodies[0, 3]
    total = found.bodies[0, 3] + found.carried[0, 2]
    p = motion.postures.transforms[0, :, :3, 3]
    total[:3] += np.cross(p[2] - p[3], found.carried[0, 2, 3:])
    np.testing.assert_allclose(total, expected, atol=1e-11 * np.abs(expected).max())


@pytest.mark.slow
def test_loads_of_meshed_bar_agree_with_beam_loads():
    """For a short bar with L / r = 11, the loads differ by less than 2 %."""
    solid = MeshLink(MESHES / "distal_plain.stl", "z=0", "z=0.452", E, 0.3, RHO)
    solid = solved_link(Frame("tip", translation=[LENGTH, 0, 0], link=solid))
    beam = BeamLink({"radius": RADIUS}, E, 0.3, RHO)
    by_mesh, by_beam = (inertial_loads(turned_arm(link), G) for link in (solid, beam))
    for name, part in product(("bodies", "carried"), (slice(0, 3), slice(3, 6))):
        found, expected = (getattr(one, name)[..., part] for one in (by_mesh, by_beam))
        size = np.abs(expected).max()
        np.testing.assert_allclose(found, expected, atol=0.02 * size)
