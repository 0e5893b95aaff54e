r"""Compute the error in platform stiffness caused by modelling links as beams.

Four models of a robot are compared at many postures, without clearances and geometric
errors:

==============  ==================================================================
model           stiffness of the links
==============  ==================================================================
beams           virtual joints with the K_E that the robot declares
meshed          virtual joints with K_E by finite elements and rigid ends
solids          finite elements with two movable ends, without virtual joints
spread          virtual joints with K_E of the same mesh and distributed wrenches
==============  ==================================================================

The models ``meshed`` and ``solids`` must agree up to round-off, because static
condensation is exact for rigid ends.  The platform stiffness with real interfaces is
between the stiffness of ``meshed`` and of ``spread``. Two models are compared by the
largest relative difference of their compliances over all wrenches. This value does not
depend on the reference point or on a reference length.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.closure import virtual_joints
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.robot import BeamLink, MatrixLink, Robot
from forcefit.assembly.platform_stiffness.linear_tangent import without_clearance
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.stiffness.screws import screw_map
from forcefit.validation.assumptions.solid_links import SolidLink, solid_links

# [-] Fraction of the largest singular value below which a singular value is set to 0.
_RANK = 1e-9


class NoSolids(Exception):
    """Exception raised if no link of the robot has a shape that can be meshed."""


@dataclass(frozen=True, eq=False)
class PlatformCosts:
    """Relative errors of the platform's compliance at k poses.

    Values are NaN at poses where the platform has an unresisted motion.

    Attributes:
        beams: (k,) [-] difference between the models ``beams`` and ``solids``.
        meshed: (k,) [-] difference between the models ``meshed`` and ``solids``.
        ends: (k,) [-] difference between the models ``meshed`` and ``spread``.
        by_link: mapping from link to the difference (k,) [-] caused by modelling only
            this link as a beam.  The link with the largest difference is first.
        left: names of the links without a known shape, for which all models use the
            declared stiffness.
        mesh_error: [-] estimated largest error of the entries of a solid's K_E, divided
            by sqrt(K_ii K_jj).
    """

    beams: NDArray
    meshed: NDArray
    ends: NDArray
    by_link: Mapping[str, NDArray]
    left: tuple[str, ...]
    mesh_error: float


def platform_costs(postures: Sequence[Posture]) -> PlatformCosts:
    """Compare the platform stiffness for links modelled as beams and as solids.

    Args:
        postures: one or more configurations of a robot.

    Returns:
        The relative errors at each pose.

    Raises:
        BadInput: a link cannot be meshed.
        FreeMotion: the platform has an unresisted motion at every pose.
        NoSolids: no link has a shape that can be meshed.
    """
    robot, declared = postures[0].robot, _compliances(postures, {})
    known = np.isfinite(declared).all(axis=(1, 2))
    if not known.any():
        raise FreeMotion(without_clearance(postures[0]).free_text)
    solids = solid_links(robot)
    if not solids:
        raise NoSolids("no link has a shape that can be meshed")
    meshed = {name: solid.condensed for name, solid in solids.items()}
    true = np.full_like(declared, np.nan)
    for i in np.flatnonzero(known).tolist():
        true[i] = solid_compliance(postures[i], solids)
    by_link = {
        name: _differences(
            _compliances(postures, {k: K for k, K in meshed.items() if k != name}), true
        )
        for name in solids
        if isinstance(robot.frame(name).link, BeamLink)
    }
    condensed = _compliances(postures, meshed)
    spread = _compliances(postures, {name: s.spread for name, s in solids.items()})
    return PlatformCosts(
        _differences(declared, true), _differences(condensed, true),
        _differences(condensed, spread),
        dict(sorted(by_link.items(), key=lambda item: -np.nanmax(item[1]))),
        tuple(f.name for f in robot.frames if f.link and f.name not in solids),
        max(solid.error for solid in solids.values()),
    )  # fmt: skip


def _compliances(
    postures: Sequence[Posture], stiffness: Mapping[str, NDArray]
) -> NDArray:
    """Return the platform compliances for given K_E of links, (k, 6, 6)."""
    links = {name: MatrixLink(K) for name, K in stiffness.items()}
    robot = postures[0].robot.with_links({**links})
    linked = [replace(posture, robot=robot) for posture in postures]
    return platform_stiffness(linked).compliance


def _differences(C: NDArray, other: NDArray) -> NDArray:
    """Return the largest relative difference at each pose, (k,); NaN if unknown."""
    known = np.isfinite(C).all(axis=(1, 2)) & np.isfinite(other).all(axis=(1, 2))
    values = np.full(len(C), np.nan)
    for i in np.flatnonzero(known):
        values[i] = difference(C[i], other[i])
    return values


def difference(C: NDArray, other: NDArray) -> float:
    """Return the largest relative difference between two compliances.

    Args:
        C: (6, 6) compliance, symmetric and positive semidefinite.
        other: (6, 6) reference compliance.

    Returns:
        The maximum of abs(w.C w / w.C_other w - 1) over all wrenches w [-].
    """
    size = np.sqrt(np.diag(other))
    size = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(other / np.outer(size, size))
    kept = values > _RANK * values.max()
    way = vectors[:, kept] / np.sqrt(values[kept])
    ratio = way.T @ (C / np.outer(size, size)) @ way
    return float(np.abs(np.linalg.eigvalsh(ratio) - 1.0).max(initial=0.0))


def solid_compliance(posture: Posture, solids: Mapping[str, SolidLink]) -> NDArray:
    """Return the platform compliance with solid links, by the displacement method.

    The unknowns are the displacement of each link's tip relative to its base, the
    deformations of joint springs, and the motions of free joints.

    Args:
        posture: the robot's configuration.  Its clearances are ignored.
        solids: mapping from frame to solid.  Other links are springs with stiffness
            K_E.

    Returns:
        Compliance at the platform's origin in base axes, (6, 6) [rad/(N m) .. m/N].
    """
    robot, T = posture.robot, posture.transforms
    joints, count = virtual_joints(robot), len(robot.frames)
    origin = posture.platform[:3, 3]
    to_origin = screw_map(T[:, :3, 3] - origin, T[:, :3, :3])
    rows = [robot.index(name) for name in solids]
    other = np.ones(joints.elastic.shape[1], dtype=bool)
    owner = np.abs(joints.elastic).argmax(axis=0) // 6
    other[joints.links & np.isin(owner, rows)] = False
    # The columns belong to other springs, to free joints and to the ends of solids, in
    # this order.
    columns = np.hstack([joints.elastic[:, other], joints.free])
    steps = columns.reshape(count, 6, columns.shape[1])
    first = steps.shape[2]
    steps = np.concatenate([steps, np.zeros((count, 6, 6 * len(rows)))], axis=2)
    for k, i in enumerate(rows):
        steps[i, :, first + 6 * k : first + 6 * k + 6] = np.eye(6)
    steps = to_origin @ steps
    ends, bases = np.zeros_like(steps), np.zeros_like(steps)
    for i, parent in enumerate(robot.parents):
        if parent >= 0:
            bases[i] = ends[parent]
        ends[i] = bases[i] + steps[i]
    K = np.zeros((steps.shape[2],) * 2)
    springs = int(other.sum())
    K[:springs, :springs] = np.eye(springs)
    for i, solid in zip(rows, solids.values(), strict=True):
        # In the chain, the joint of the frame comes after the tip of the solid.
        own = steps[i].copy()
        own[:, :first] = 0.0
        turn = T[i, :3, :3] @ solid.turn
        tip = T[i, :3, 3] - origin
        both = np.vstack([
            np.linalg.inv(screw_map(place, turn)) @ motion
            for place, motion in (
                (tip - turn @ solid.span, bases[i]), (tip, bases[i] + own)
            )
        ])  # fmt: skip
        K += both.T @ solid.ends @ both
    return _loaded(K, _closed(robot, ends), ends[robot.index(robot.platform)])


def _closed(robot: Robot, ends: NDArray) -> NDArray:
    """Return an orthonormal basis of the motions that do not open the loops."""
    pairs = [
        ends[robot.index(one)] - ends[robot.index(two)] for one, two in robot.closures
    ]
    if not pairs:
        return np.eye(ends.shape[2])
    rows = np.vstack(pairs)
    size = np.linalg.norm(rows, axis=0)
    size[size == 0.0] = 1.0
    _, S, Vt = np.linalg.svd(rows / size)
    rank = int(np.sum(S > _RANK * S.max(initial=0.0)))
    return Vt[rank:].T / size[:, None]


def _loaded(K: NDArray, basis: NDArray, platform: NDArray) -> NDArray:
    """Return the platform compliance (6, 6) without unresisted motions."""
    H, moved = basis.T @ K @ basis, platform @ basis
    size = np.sqrt(np.diag(H))
    size[size == 0.0] = 1.0
    values, vectors = np.linalg.eigh(H / np.outer(size, size))
    kept = values > 1e-13 * values.max()
    root = (moved / size) @ vectors[:, kept] / np.sqrt(values[kept])
    return root @ root.T
