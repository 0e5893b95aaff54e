"""Rotation of a 3-UPU robot within its clearances, computed from finite geometry.

The expected values are those of docs/seoul.md.  The twist of a leg is the angle about
the leg between the inner axes of its two universal joints.  Four hinges that tilt by at
most c allow a twist of 4 c / (u . n), with u along the leg and n normal to the axes of
a universal joint.
"""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit import bound_pose_error, place_robot, solve_assembly
from forcefit.assembly.exchange.robot_files import load_robot
from tests.test_tutorials import DOCS, ROOT, blocks

BASE, PLATFORM, TILT = 0.24, 0.08, 2e-4  # radii [m] and hinge tilt [rad]
ANGLES = 2 * np.pi * np.arange(3) / 3
RADIAL = np.stack([np.cos(ANGLES), np.sin(ANGLES), 0 * ANGLES], axis=1)
TANGENTIAL = np.cross([0, 0, 1], RADIAL)


def unit(vectors):
    """Normalise vectors along the last axis."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def hinge_tilts(position, outer, turns):
    """Return the total hinge tilt of each leg with locked drives, (n, 3) [rad]."""
    lengths = np.linalg.norm(position + (PLATFORM - BASE) * RADIAL, axis=1)
    rotations = Rotation.from_rotvec(turns).as_matrix()
    corners = np.einsum("nab,kb->nka", rotations, RADIAL) * PLATFORM - BASE * RADIAL
    x = np.tile(position, (len(turns), 1))
    for _ in range(6):  # Newton iterations for the position at given leg lengths
        legs = x[:, None] + corners
        longer = np.linalg.norm(legs, axis=-1) - lengths
        x = x - np.linalg.solve(unit(legs), longer[..., None])[..., 0]
    along = unit(x[:, None] + corners)
    low = unit(np.cross(outer, along))
    high = unit(np.cross(np.einsum("nab,kb->nka", rotations, outer), along))
    sine = (along * np.cross(low, high)).sum(-1)
    twist = np.arctan2(sine, (low * high).sum(-1))
    return twist * (along * np.cross(outer, low)).sum(-1)


def farthest(position, outer, tilt, rays, step):
    """Return the directions with the largest rotation [rad] within the hinge limits."""
    rays, steps = unit(rays), 0
    while True:
        tilts = hinge_tilts(position, outer, (steps + 1) * step * rays)
        possible = np.abs(tilts).max(axis=1) <= 4 * tilt
        if not possible.any():
            return rays, steps * step
        rays, steps = rays[possible], steps + 1


def largest_finite_rotation(position, outer, tilt):
    """Return the largest rotation [rad] with locked drives.

    The search is along rays from the nominal orientation.  A second search is near the
    ray with the largest rotation.
    """
    limits = hinge_tilts(position, outer, 1e-6 * np.eye(3)).T / 1e-6
    corners = [np.linalg.pinv(limits) @ signs for signs in product([1, -1], repeat=3)]
    basis = np.linalg.svd(limits)[2]
    around, aside = np.meshgrid(np.arange(0, 2 * np.pi, np.pi / 60),
                                np.linspace(-0.06, 0.06, 31))  # fmt: skip
    near = np.stack([aside, np.cos(around), np.sin(around)], axis=-1) @ basis
    rays = np.vstack([corners, near.reshape(-1, 3)])
    rays, _ = farthest(position, outer, tilt, rays, tilt)
    shifts = np.stack(np.meshgrid(*3 * [0.02 * np.linspace(-1, 1, 7)]), -1) @ basis
    shifts = np.vstack([shifts.reshape(-1, 3), 0.1 * shifts.reshape(-1, 3)])
    return farthest(position, outer, tilt, rays[0] + shifts, tilt / 10)[1]


@pytest.fixture(scope="module")
def seoul(tmp_path_factory):
    """Return the robot of docs/seoul.md."""
    path = tmp_path_factory.mktemp("seoul") / "seoul.toml"
    texts = {title: text for _, title, text in blocks(DOCS / "seoul.md")}
    path.write_text(texts["seoul.toml"])
    return load_robot(path)


def first_order(robot, position):
    """Return the bound of (27) on the rotation [rad]."""
    pose = dict(zip(("tx", "ty", "tz"), position, strict=True))
    return bound_pose_error(solve_assembly(place_robot(robot, pose))).rotation_error[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("x", "y", "shown"),
    [(0.0, 0.0, 45), (0.02, 0.01, 74), (0.05, 0.02, 21.5), (0.1, 0.05, 8.9)],
)
def test_finite_rotation_agrees_with_the_documentation(x, y, shown):
    """The search along rays gives a lower bound on the largest rotation."""
    found = largest_finite_rotation((x, y, 0.45), RADIAL, TILT)
    assert shown <= 1e3 * found <= 1.04 * shown


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-1, 1e-2])
def test_finite_rotation_approaches_first_order_rotation(seoul, factor):
    position = (0.02, 0.01, 0.45)
    bound = first_order(seoul, position)
    finite = largest_finite_rotation(position, RADIAL, factor * TILT) / factor
    assert finite == pytest.approx(bound, rel=factor + 0.01)


@pytest.mark.slow
def test_first_order_rotation_of_tsai_robot_equals_finite_rotation():
    """The robot is far from singular, so rotations of 3 mrad are small."""
    robot = load_robot(ROOT / "examples" / "drawn" / "three_upu.toml")
    for position in ((0.0, 0.0, 0.45), (0.02, 0.01, 0.45)):
        finite = largest_finite_rotation(position, TANGENTIAL, TILT)
        assert finite == pytest.approx(first_order(robot, position), rel=0.02)
