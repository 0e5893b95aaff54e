"""Arrays that pass the virtual joints of a robot to the compiled methods."""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.linear.closure import (
    VirtualJoints,
    closure_signs,
    virtual_joints,
)
from forcefit.assembly.model.clearance import clearance_bounds, component_bounds
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.solvers.cones import cone_starts


class Structure(NamedTuple):
    """Arrays that describe a robot independently of its posture.

    The robot has n frames and closures with np different patterns of signs.

    Attributes:
        size: [m] reference length.
        platform: index of the platform's frame.
        on_path: (n,) 1 if the frame is on the path to the platform.
        patterns: (np, closures) signs of the frames in the closures.
        pattern_of: (n,) row of ``patterns`` for each frame.
        springs: (ny, 6) spring columns in their frame's axes, sorted by group; springs
            that are in no closure are last.
        spring_frame: (ny,) frame of each spring.
        spring_order: (ny,) indices of the springs among the virtual joints' columns.
        of_joint: (ny,) 1 for a joint's spring, 0 for a link's.
        groups: (ng + 1,) index of the first spring of each group; the last entry is the
            first spring in no closure.
        group_pattern: (ng,) row of ``patterns`` for each group.
        group_on_path: (ng,) 1 if the group is on the path to the platform.
        cone_frame: (nu,) frame of each clearance.
        cone_axis: (nu,) component of each clearance in its screw.
        cone_size: (nu,) [rad or m] bound of each clearance.
        starts: (cones + 1,) index of the first clearance of each cone, then nu.
        free_frame: (nq,) frame of each free motion.
        free_axis: (nq,) component of each free motion in its screw.
        free_lead: (nq,) [m/rad] translation along z per angle, of a helical joint.
        free_bound: (nq,) [rad or m] motion limit that is not included as a cone; inf
            without a limit.
    """

    size: float
    platform: int
    on_path: NDArray
    patterns: NDArray
    pattern_of: NDArray
    springs: NDArray
    spring_frame: NDArray
    spring_order: NDArray
    of_joint: NDArray
    groups: NDArray
    group_pattern: NDArray
    group_on_path: NDArray
    cone_frame: NDArray
    cone_axis: NDArray
    cone_size: NDArray
    starts: NDArray
    free_frame: NDArray
    free_axis: NDArray
    free_lead: NDArray
    free_bound: NDArray


@lru_cache(maxsize=32)
def structure_of(
    robot: Robot, springs: bool = True, own_axes_free: bool = False,
    bounded_motion: bool = False,
) -> tuple[VirtualJoints, Structure]:  # fmt: skip
    """Return the virtual joints of a robot as columns and as arrays.

    Args:
        robot: any robot.
        springs: see :func:`forcefit.assembly.linear.closure.virtual_joints`.
        own_axes_free: see the same function.
        bounded_motion: see the same function.

    Returns:
        The columns; and the same data as arrays.
    """
    joints = virtual_joints(robot, springs, own_axes_free, bounded_motion)
    rows = tuple((robot.index(a), robot.index(b)) for a, b in robot.closures)
    tree = _Tree(robot.index(robot.platform), rows, robot)
    return joints, _structure(joints, tree, own_axes_free)


@dataclass(frozen=True)
class _Tree:
    """Data of a robot that a structure contains in addition to the virtual joints."""

    platform: int
    closures: tuple[tuple[int, int], ...]
    robot: Robot = field(compare=False)


@lru_cache(maxsize=32)
def _structure(joints: VirtualJoints, tree: _Tree, own_axes_free: bool) -> Structure:
    """Return the arrays of a robot, which do not depend on its errors."""
    robot = tree.robot
    on_path = robot.on_path[tree.platform]
    signs = closure_signs(robot).T.astype(float)
    patterns, pattern_of = np.unique(signs, axis=0, return_inverse=True)
    # All springs of a group have the same signs in all closures. Either all or none of
    # them are on the path to the platform.
    spring_frame, springs = _by_frame(joints.elastic)
    acting = np.any(signs[spring_frame] != 0.0, axis=1)
    key = 2 * pattern_of[spring_frame] + on_path[spring_frame]
    order = np.lexsort((np.arange(len(key)), key))
    order, alone = order[acting[order]], order[~acting[order]]
    keys, starts = np.unique(key[order], return_index=True)
    groups = np.append(starts, len(order)).astype(np.int64)
    order = np.append(order, alone)
    cone_frame, cones = _by_frame(joints.cones)
    free_frame, free = _by_frame(joints.free)
    bounds = component_bounds(clearance_bounds(robot, own_axes_free))
    # The rotation of a helical joint comes before its translation.
    free_axis = (free != 0).argmax(axis=1) if len(free) else np.zeros(0, dtype=int)
    cone_axis = np.abs(cones).argmax(axis=1) if len(cones) else np.zeros(0, dtype=int)
    return Structure(
        size=size_of(robot),
        platform=tree.platform,
        on_path=on_path.astype(float),
        patterns=patterns,
        pattern_of=pattern_of.astype(np.int64),
        springs=np.ascontiguousarray(springs[order]),
        spring_frame=spring_frame[order],
        spring_order=order,
        of_joint=(~joints.links[order]).astype(np.int64),
        groups=groups,
        group_pattern=keys // 2,
        group_on_path=(keys % 2).astype(float),
        cone_frame=cone_frame,
        cone_axis=cone_axis,
        cone_size=cones.sum(axis=1),
        starts=cone_starts(joints.group),
        free_frame=free_frame,
        free_axis=free_axis,
        free_lead=np.where(free_axis == 2, free[:, 5], 0.0),
        free_bound=bounds[free_frame, free_axis],
    )


def _by_frame(columns: NDArray) -> tuple[NDArray, NDArray]:
    """Return the frame of each column, and its screw in frame axes, (count, 6)."""
    blocks = columns.T.reshape(columns.shape[1], len(columns) // 6, 6)
    frame = np.abs(blocks).max(axis=2).argmax(axis=1) if len(blocks) else np.zeros(0)
    frame = frame.astype(np.int64)
    return frame, np.ascontiguousarray(blocks[np.arange(len(blocks)), frame])
