"""Assembly constraints, linear in the small screws.

Eqs (8) and (16)-(20) are generalised to any tree with closures.  The two chains that
end at a closure must have the same motion:

    sum over frames j of  sign_kj M_j (dl_j + de_j + dc_j + db_j)  =  0.

The sign is +1 on the first chain, -1 on the second chain, and 0 for frames that belong
to neither or to both.  All screws are expressed at the platform's origin in base axes.
The multiplier of closure k is therefore the wrench at the platform's origin that the
second chain of k exerts on the first.

======  ===========  ========  ===================================================
symbol  code         shape     meaning
======  ===========  ========  ===================================================
y       ``elastic``  (6n, ny)  links and joint springs, scaled: energy = y.y / 2
u       ``cones``    (6n, nu)  clearances in discs, intervals or balls of radius 1
q       ``free``     (6n, nq)  unbounded motions, in units of their screws
======  ===========  ========  ===================================================
"""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.closure_rates import closure_signs
from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.model.clearance import (
    CONES,
    clearance_bounds,
    scales_with_margin,
)
from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.assembly.model.links import (
    compliance_factor,
    link_compliances,
    motion_map,
    spring_compliances,
)
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, quoted
from forcefit.results.display import html_table, short_repr


@dataclass(frozen=True, eq=False)
class VirtualJoints:
    """Basis columns for the small screws of links, clearances, springs and joints.

    Attributes:
        robot: robot of n frames.
        elastic: (6n, ny) columns of links and joint springs.
        links: (ny,) bool, True for columns of links and False for columns of joints.
        cones: (6n, nu) columns of bounded clearances, each scaled by its bound.
        group: (nu,) cone of each column: two columns for a disc, three for a ball.
        scaled: (nu,) bool, True if the cone of the column is scaled by the margin of
            problem (21).
        free: (6n, nq) unit columns of unbounded motions.
        bounded_motion: frames whose passive joint has a motion limit that is modelled
            as a cone.
    """

    robot: Robot
    elastic: NDArray
    links: NDArray
    cones: NDArray
    group: NDArray
    scaled: NDArray
    free: NDArray
    bounded_motion: frozenset[int]

    __repr__, _repr_html_ = short_repr, html_table


def virtual_joints(
    robot: Robot, springs: bool = True, own_axes_free: bool = False,
    bounded_motion: bool | frozenset[int] = False,
) -> VirtualJoints:  # fmt: skip
    """Return basis columns for all small screws of a robot.

    Args:
        robot: robot of n frames.
        springs: whether links and joints are elastic.  They are rigid in problem (21).
        own_axes_free: whether passive joints with stiffness move freely about (or
            along) their z axis.  If False, the motion about z is elastic, or rigid if
            ``springs`` is False.
        bounded_motion: whether to impose the motion limits of passive joints; or the
            set of frames whose limits are imposed.  The limits are rarely active, so
            callers first omit them and then check whether the solution exceeds a limit.

    Returns:
        The columns.
    """
    if isinstance(bounded_motion, bool):
        bounded_motion = frozenset(range(len(robot.frames)) if bounded_motion else ())
    key = _JointsKey(_parts(robot), robot)
    return _virtual_joints(key, springs, own_axes_free, bounded_motion)


@dataclass(frozen=True)
class _JointsKey:
    """Cache key of virtual joints; it does not depend on errors and masses."""

    parts: tuple
    robot: Robot = field(compare=False)


def _parts(robot: Robot) -> tuple:
    """Return the properties of a robot that determine its virtual joints."""
    return tuple(
        (
            f.parent, f.joint, f.pitch, f.actuated, f.clearance, id(f.link),
            f.translation.tobytes(), f.rotation.tobytes(),
            None if f.joint_stiffness is None else f.joint_stiffness.tobytes(),
        )
        for f in robot.frames
    )  # fmt: skip


@lru_cache(maxsize=16)
def _virtual_joints(
    key: _JointsKey, springs: bool, own_axes_free: bool,
    bounded_motion: frozenset[int],
) -> VirtualJoints:  # fmt: skip
    """Return the basis columns of virtual joints, cached by key."""
    robot = key.robot
    bounds = clearance_bounds(robot, own_axes_free)
    scaled = scales_with_margin(robot)
    left_out = [i not in bounded_motion for i in range(len(bounds))]
    bounds = np.where(
        np.array(left_out)[:, None] & ~scaled & (bounds > 0), np.inf, bounds
    )
    links = joints = np.zeros((0, 6, 6))
    if springs:
        links, joints = link_compliances(robot), spring_compliances(robot)
    if springs and own_axes_free:
        for C, frame in zip(joints, robot.frames, strict=True):
            if frame.compliant:
                C[frame.own_axis] = C[:, frame.own_axis] = 0.0
    elastic, is_link = _elastic(links, joints, robot)
    cones, group, cone_scaled = _cones(bounds, scaled)
    return VirtualJoints(
        robot=robot,
        elastic=elastic,
        links=is_link,
        cones=cones,
        group=group,
        scaled=cone_scaled,
        free=_free(bounds, robot),
        bounded_motion=bounded_motion,
    )


def _elastic(
    links: NDArray, joints: NDArray, robot: Robot
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Return the columns of springs, and whether each column belongs to a link."""
    count = len(robot.frames)
    columns, is_link = [np.zeros((6 * count, 0))], []
    for compliances, link in ((links, True), (joints, False)):
        for i, C in enumerate(compliances):
            L = compliance_factor(C)
            if not link and robot.frames[i].pitch:
                L = motion_map(robot.frames[i]) @ L
            block = np.zeros((6 * count, L.shape[1]))
            block[6 * i : 6 * i + 6] = L
            columns.append(block)
            is_link += [link] * L.shape[1]
    return np.hstack(columns), np.array(is_link, dtype=bool)


def _cones(bounds: NDArray, scales: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return columns of clearances, cones, and whether the margin scales each."""
    rows, sizes, group, scaled = [], [], [], []
    count = 0
    for i, cone in np.argwhere((bounds > 0) & np.isfinite(bounds)):
        for row in CONES[cone]:
            rows.append(6 * i + row)
            sizes.append(bounds[i, cone])
            group.append(count)
            scaled.append(scales[i, cone])
        count += 1
    columns = np.zeros((6 * len(bounds), len(rows)))
    columns[rows, np.arange(len(rows))] = sizes
    return (
        columns,
        np.array(group, dtype=int),
        np.array(scaled, dtype=bool),
    )


def _free(bounds: NDArray, robot: Robot) -> NDArray:
    """Return a unit screw for each unbounded joint motion, as columns."""
    rows = [6 * i + r for i, cone in np.argwhere(np.isinf(bounds)) for r in CONES[cone]]
    columns = np.zeros((6 * len(bounds), len(rows)))
    columns[rows, np.arange(len(rows))] = 1.0
    for k, row in enumerate(rows):
        if row % 6 == 2 and (lead := robot.frames[row // 6].lead):
            columns[row + 3, k] = lead
    return columns


def in_reference_lengths(size: float) -> NDArray:
    """Return factors that divide translations by a reference length.

    Args:
        size: [m] reference length.

    Returns:
        (6,) factors: 1 for angles [-] and 1 / size for lengths [1/m].
    """
    return np.repeat([1.0, 1.0 / size], 3)


@dataclass(frozen=True, eq=False)
class Linearisation:
    """The assembly constraints at a posture.

    Attributes:
        posture: the robot's configuration.
        size: [m] reference length.
    """

    posture: Posture
    size: float

    __repr__, _repr_html_ = short_repr, html_table

    @cached_property
    def rows(self) -> NDArray:
        """Closure matrix, (6 closures, 6 n).

        Its product with the screws of all frames is zero if all loops are closed.  Its
        blocks are sign_kj M_j, with translations divided by :attr:`size`.
        """
        robot = self.posture.robot
        blocks = closure_signs(robot)[:, :, None, None] * self.posture.paths
        rows = np.swapaxes(blocks * in_reference_lengths(self.size)[:, None], 1, 2)
        return rows.reshape(6 * len(robot.closures), 6 * len(robot.frames))

    @cached_property
    def platform(self) -> NDArray:
        """Map from frame screws to the platform screw, (6, 6 n), eq. (8)."""
        robot = self.posture.robot
        on_path = robot.on_path[robot.index(robot.platform)]
        platform = np.swapaxes(self.posture.paths * on_path[:, None, None], 0, 1)
        return platform.reshape(6, 6 * len(robot.frames))

    @cached_property
    def misfit(self) -> NDArray:
        """Scaled closure error due to the geometric errors, (6 closures,)."""
        return self.rows @ self.posture.robot.errors.ravel()


def linearise(posture: Posture) -> Linearisation:
    """Return the assembly constraints (19)-(20) at a posture.

    Args:
        posture: the robot's configuration.

    Returns:
        The constraint matrix and the map to the platform screw.

    Raises:
        BadInput: the size of a geometric error exceeds 1e6 rad or m.
    """
    return Linearisation(posture, checked_size(posture.robot))


@lru_cache(maxsize=64)
def checked_size(robot: Robot) -> float:
    """Check the geometric errors of a robot, and return its reference length [m].

    Args:
        robot: any robot.

    Returns:
        The result of :func:`forcefit.assembly.kinematics.nominal.size_of`.

    Raises:
        BadInput: the size of a geometric error exceeds 1e6 rad or m.
    """
    too_large = ~(np.abs(robot.errors) <= LARGEST_LENGTH).all(axis=1)
    if too_large.any():
        frame = robot.frames[int(np.argmax(too_large))]
        raise BadInput(
            f"{robot.name}: frame {quoted(frame.name)}.geometric_error: found "
            f"{np.abs(frame.geometric_error).max():g}, expected numbers of size at "
            f"most {LARGEST_LENGTH:g} [rad, m]"
        )
    return size_of(robot)
