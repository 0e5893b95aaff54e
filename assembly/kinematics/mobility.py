"""Mobility and redundant constraints of the nominal robot.

:func:`mobility` counts the degrees of freedom at one posture.  :func:`platform_screws`
returns the free motions of the platform at this posture. :func:`mobility_near` counts
the degrees of freedom at nearby postures.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.ball_joints import with_balls
from forcefit.assembly.kinematics.closure_rates import closure_signs
from forcefit.assembly.kinematics.near_postures import near_postures
from forcefit.assembly.kinematics.nominal import mobile, motion_screws, size_of
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.kinematics.ranks import MISMATCH_FACTOR, rank_of
from forcefit.assembly.model.contact_closures import contact_closures
from forcefit.results.display import html_table

# Relative size below which singular values are treated as zero. Files are rounded to 6
# digits, and singular postures have errors of sqrt(1e-10).
ZERO = 1e-5
# [rad, reference lengths] smallest platform motion for unit joint rates that is not
# treated as round-off
_PLATFORM_RANK = 1e-6
_ERROR = 10.0  # the assumed error of free motions is this factor divided by ``gap``
_NOISE = 1e-14  # relative round-off error of singular values
_DISTANCE = 0.05  # [rad or reference lengths] distance to nearby postures
_NEIGHBOURS = 16  # largest number of nearby postures
_AGREEING = 3  # number of nearby postures that must have equal mobility
_EXACT = 1e-12  # [rad, m] closure error that is only round-off
_LEAST = 1e-8  # threshold of singular values for closure errors below _EXACT
_CLOSED = 1e-6  # [rad, m] largest closure error of a nearby posture
_BACK = 0.1  # fraction of _DISTANCE; smaller motions are ignored


@dataclass(frozen=True)
class Mobility:
    """Degrees of freedom at one posture of a rigid robot without clearance.

    Attributes:
        freedoms: number of independent joint motions that preserve all closures, with
            the drives free.
        platform_freedoms: number of independent motions of the platform.
        freedoms_drives_locked: number of independent joint motions that preserve all
            closures, with the drives locked.
        platform_freedoms_drives_locked: number of independent motions of the platform,
            with the drives locked.
        redundant_constraints: number of constraints of all joints with drives locked,
            minus their rank.  It equals the number of independent internal loads of the
            rigid robot.
        drives: number of actuated joints.
        locked_freedoms: equal to ``freedoms_drives_locked``.
        overconstraint: number of closure equations minus their rank, with the drives
            free.
        smallest_singular_value: [-] smallest nonzero singular value of the constraint
            matrix, with lengths divided by the size of the robot.  A value near zero
            indicates a nearby singularity.
        local_freedoms: number of motions of the legs alone, ``freedoms`` minus
            ``platform_freedoms``.
        actuation_redundancy: number of drives minus the degrees of freedom that they
            lock.
        singular_value_gap: [-] ratio of the smallest nonzero singular value to the
            largest value that is treated as zero, or to round-off.  The smaller of the
            ratios with drives free and locked is given.  If it is below about 100, the
            counts are uncertain.
    """

    freedoms: int
    platform_freedoms: int
    freedoms_drives_locked: int
    platform_freedoms_drives_locked: int
    redundant_constraints: int
    drives: int
    locked_freedoms: int
    overconstraint: int
    smallest_singular_value: float
    local_freedoms: int
    actuation_redundancy: int
    singular_value_gap: float

    _repr_html_ = html_table


@dataclass(frozen=True)
class NearMobility:
    """Mobility at postures close to a given posture.

    Attributes:
        freedoms: smallest number of degrees of freedom at these postures; 0 if the
            given posture has only infinitesimal motions.
        there: mobility at a nearby posture with this number of degrees of freedom, or
            None.
    """

    freedoms: int
    there: Mobility | None


def mobility(posture: Posture, tolerance: float = ZERO) -> Mobility:
    """Return the mobility and redundant constraints at a posture.

    Args:
        posture: the robot's configuration.
        tolerance: relative size below which a singular value is treated as zero.  The
            smallest value is 30 times the nominal closure error.

    Returns:
        The degrees of freedom and redundant constraints.

    Sources:
        Zlatanov, Bonev, Gosselin (2002), Constraint singularities of parallel
        mechanisms: degrees of freedom as the null space of the joint screws.
    """
    A, P = _rates(posture)
    moves = mobile(posture.robot)
    driven = np.array([f.actuated for f in posture.robot.frames])
    passive = moves & ~driven
    tolerance = _tolerance(posture, tolerance)
    free = _motions(A[:, moves], P[:, moves], tolerance)
    locked = _motions(A[:, passive], P[:, passive], 0.0, tolerance * free.largest)
    freedoms, held = len(free.joints), len(locked.joints)
    drives, rank = int(driven.sum()), int(moves.sum()) - freedoms
    return Mobility(
        freedoms=freedoms,
        platform_freedoms=free.independent,
        freedoms_drives_locked=held,
        platform_freedoms_drives_locked=locked.independent,
        redundant_constraints=len(A) - int(passive.sum()) + held,
        drives=drives,
        locked_freedoms=held,
        overconstraint=len(A) - rank,
        smallest_singular_value=float(free.values[rank - 1]) if rank else 0.0,
        local_freedoms=freedoms - free.independent,
        actuation_redundancy=drives - freedoms + held,
        singular_value_gap=min(free.gap, locked.gap),
    )


def platform_screws(posture: Posture) -> tuple[NDArray, float]:
    """Return independent motions of the platform with the drives free.

    Args:
        posture: the robot's configuration.

    Returns:
        (k, 6) [rad, m] screws of the k ``platform_freedoms`` at the platform's origin,
        base axes. They are orthonormal if lengths are in reference lengths. The second
        result is their error [rad, reference lengths].
    """
    A, P = _rates(posture)
    moves = mobile(posture.robot)
    found = _motions(A[:, moves], P[:, moves], _tolerance(posture))
    U = np.linalg.svd(found.platform, full_matrices=False)[0]
    size = size_of(posture.robot)
    screws = U[:, : found.independent].T * ([1.0] * 3 + [size] * 3)
    return screws, found.error


def mobility_near(posture: Posture, here: Mobility) -> NearMobility:
    """Return the mobility at nearby postures, which can be lower.

    Args:
        posture: the robot's configuration.
        here: mobility at this posture.

    Returns:
        The smallest number of degrees of freedom, and the mobility at a posture with
        this number.
    """
    robot, q = posture.robot, posture.coordinates
    if here.freedoms == 0 or _certainly_least(here):
        return NearMobility(here.freedoms, here)
    scale = np.where([f.joint == "prismatic" for f in robot.frames], size_of(robot), 1)
    found: list[Mobility] = []
    agreeing: Counter[tuple[int, int]] = Counter()
    returned = 0
    for track in near_postures(robot, q, posture.transforms, _DISTANCE, _NEIGHBOURS):
        to, open_by = track.coordinates[0], float(track.mismatch[0])
        if np.linalg.norm((to - q) / scale) < _BACK * _DISTANCE:
            returned += 1
        elif open_by < _CLOSED:
            # Near a singularity, singular values can be quadratic in the distance.
            zero = _LEAST if open_by < _EXACT else ZERO
            near = mobility(Posture(robot, to, track.transforms[0], open_by), zero)
            found.append(near)
            if _certainly_least(near):
                break
            if open_by < _EXACT:
                agreeing[near.freedoms, near.freedoms_drives_locked] += 1
        if _AGREEING in {returned, *agreeing.values()}:
            break
    if not found:
        # Without a nearby posture, no smaller mobility is known.
        return NearMobility(0 if returned == _AGREEING else here.freedoms, None)
    least = min(found, key=lambda m: (m.freedoms, m.freedoms_drives_locked))
    return NearMobility(min(least.freedoms, here.freedoms), least)


def _certainly_least(here: Mobility) -> bool:
    """Return whether the closures exclude a lower mobility at other postures."""
    return here.overconstraint == 0 and here.freedoms_drives_locked == 0


def _tolerance(posture: Posture, least: float = ZERO) -> float:
    """Return the relative size below which singular values are treated as zero."""
    return max(least, MISMATCH_FACTOR * float(posture.mismatch))


def _rates(posture: Posture) -> tuple[NDArray, NDArray]:
    """Return velocities of closures and platform for unit joint rates.

    Lengths, including the unit rate of a prismatic joint, are in reference lengths.

    Returns:
        (6 closures, n) velocities of closures at the base's origin, without the free
        directions of contacts; (6, n) velocities of the platform at its origin.
    """
    robot = posture.robot
    size, i = size_of(robot), robot.index(robot.platform)
    T = posture.transforms
    screws = with_balls(robot, T, motion_screws(robot, T))
    screws[[frame.joint == "prismatic" for frame in robot.frames]] *= size
    scale = np.array([1.0] * 3 + [size] * 3)
    signs = closure_signs(robot)[~contact_closures(robot)]
    blocks = signs[:, :, None] * (screws / scale)
    A = np.swapaxes(blocks, 1, 2).reshape(6 * len(signs), len(robot.frames))
    screws[:, 3:] += np.cross(screws[:, :3], T[i, :3, 3])
    return A, (screws / scale * robot.on_path[i][:, None]).T


@dataclass(frozen=True, eq=False)
class _Motions:
    """Joint motions that preserve the closures, and the resulting platform motions.

    Attributes:
        values: singular values of the closures, the largest first.
        joints: (k, joints) orthonormal joint rates.
        platform: (6, k) platform motions, with lengths in reference lengths.
    """

    values: NDArray
    joints: NDArray
    platform: NDArray

    @property
    def largest(self) -> float:
        """Largest singular value; 0 without closures."""
        return float(self.values.max(initial=0.0))

    @property
    def independent(self) -> int:
        """Number of independent motions of the platform."""
        moved = np.linalg.svd(self.platform, compute_uv=False)
        return int(np.sum(moved > self.error))

    @property
    def error(self) -> float:
        """Size [rad, reference lengths] below which platform motions are zero."""
        return max(_PLATFORM_RANK, _ERROR / self.gap)

    @property
    def gap(self) -> float:
        """Ratio of the smallest nonzero singular value to the next smaller value."""
        rank = self.joints.shape[1] - len(self.joints)
        if not rank:
            return np.inf
        dropped = self.values[rank : rank + 1]
        noise = _NOISE * float(self.values[0])
        return float(self.values[rank - 1] / max(noise, *dropped, 1e-300))


def _motions(A: NDArray, P: NDArray, tolerance: float, least: float = 0.0) -> _Motions:
    """Return the joint motions that preserve the closures, and the platform motions.

    Args:
        A: (6 closures, joints) velocities of closures for unit joint rates.
        P: (6, joints) velocities of the platform for unit joint rates.
        tolerance: relative size below which a singular value of A is treated as zero.
        least: absolute size below which a singular value is treated as zero.

    Returns:
        The motions with the singular values of A.
    """
    _, values, V = np.linalg.svd(A)
    free = V[rank_of(values, tolerance, least) :]
    return _Motions(values, free, P @ free.T)
