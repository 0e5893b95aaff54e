r"""Distance of a posture from each kind of singularity, and the singular motions.

The drives and the platform of the rigid robot have a space of possible rates (q_a, t).
An orthonormal basis of this space satisfies Q_a^T Q_a + Q_t^T Q_t = 1.  The matrices
Q_a and Q_t have singular values cos(a_i) and sin(a_i), and the map from the drives to
the platform has the singular values tan(a_i).

======== ==================== ==================================================
code     zero means           kind of Gosselin and Angeles
======== ==================== ==================================================
serial   a drive moves, the   1st (type 1): the platform loses a DOF
         platform does not
parallel the platform moves,  2nd (type 2): the locked robot gains a DOF
         no drive does
closure  a closure transmits  constraint: the robot gains a DOF, or changes
         no wrench            its assembly mode
======== ==================== ==================================================

Lengths are divided by the length of the robot's longest body; angles are in radians.

Sources:
    Gosselin, Angeles (1990), Singularity analysis of closed-loop kinematic chains.
    Zlatanov, Bonev, Gosselin (2002), Constraint singularities of parallel mechanisms.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.closure_rates import SINGULAR, closure_matrices
from forcefit.assembly.kinematics.nominal import Target, follow, mobile, size_of
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.kinematics.ranks import rank_of
from forcefit.assembly.model.robot import Robot
from forcefit.results.display import html_table, largest_row, short_repr
from forcefit.stiffness.screws import SCREW

KINDS = ("serial", "parallel", "closure")
_RANK = 1e-9  # relative size below which a singular value is treated as zero
# [rad or reference lengths] displacements of the drives at which ranks are computed
_PERTURBATIONS = (0.0, 0.013, -0.021)


@dataclass(frozen=True, eq=False)
class Singularities:
    """Distances of k postures from the three kinds of singularity.

    Attributes:
        serial: (k,) sine of the smallest angle a_i, 0 at a serial singularity.
        parallel: (k,) cosine of the largest angle a_i, 0 at a parallel singularity.
        closure: (k,) smallest singular value of the closures, without values that are
            zero at every posture.
        serial_joints: (k, n) joint rates of the motion at the serial singularity.
        parallel_joints: (k, n) joint rates of the motion at the parallel singularity.
        parallel_screws: (k, 6) platform motion at the parallel singularity.
        closure_joints: (k, n) joint rates with the smallest closure velocity.
    """

    serial: NDArray
    parallel: NDArray
    closure: NDArray
    serial_joints: NDArray
    parallel_joints: NDArray
    parallel_screws: NDArray
    closure_joints: NDArray

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def condition(self) -> NDArray:
        """Condition number of the map from drives to platform, tan(a_max) / tan(a_min).

        It is defined for robots with as many drives as degrees of freedom, and NaN
        without drives.
        """
        least, most = self.serial, self.parallel
        rest = np.sqrt((1 - least**2).clip(0.0) * (1 - most**2).clip(0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            return rest / (least * most)

    def names(self, robot: Robot, near: float) -> list[str]:
        """Describe the singularities near each posture.

        Args:
            robot: the same robot.
            near: distance below which a singularity is described.

        Returns:
            Texts such as ``"parallel: left.elbow, platform TY"``; empty if no
            singularity is near.
        """
        passive = np.array([f.passive for f in robot.frames])
        moving = {
            "serial": self.serial_joints * ~passive,
            "parallel": self.parallel_joints * passive,
            "closure": self.closure_joints,
        }
        texts = []
        for i in range(len(self.serial)):
            near_kinds = []
            for kind in KINDS:
                if getattr(self, kind)[i] < near:
                    joint = largest_row(np.abs(moving[kind][i]))
                    text = f"{kind}: {robot.frames[joint].name}"
                    if kind == "parallel":
                        component = largest_row(np.abs(self.parallel_screws[i]))
                        text += f", platform {SCREW[component]}"
                    near_kinds.append(text)
            texts.append("; ".join(near_kinds))
        return texts


def find_singularities(robot: Robot, transforms: NDArray) -> Singularities:
    """Return the distances of many postures from singularities.

    Args:
        robot: robot of n frames.
        transforms: (k, n, 4, 4) frames seen from the base.

    Returns:
        The distances in the order of the postures.  The distance is 1 for kinds of
        singularity that the robot cannot have.
    """
    return _measure(robot, transforms, _generic_ranks(robot))


@dataclass(frozen=True)
class _Ranks:
    """Ranks of closures, joint motions and platform motions at regular postures."""

    closures: int
    motions: int
    platform: int


@lru_cache(maxsize=16)
def _generic_ranks(robot: Robot) -> _Ranks:
    """Return the largest ranks at home and for perturbed drives."""
    home = home_posture(robot)
    driven = np.array([f.actuated for f in robot.frames])
    unit = np.array([
        size_of(robot) if f.joint == "prismatic" else 1.0 for f in robot.frames
    ])
    # The drives move by different amounts, because postures can remain singular for
    # equal amounts.
    spread = 1.0 + 0.37 * np.arange(len(robot.frames)) % 1.0
    goals = np.where(
        driven, home.coordinates + np.outer(_PERTURBATIONS, unit * spread), np.nan
    )
    track = follow(robot, home.coordinates, Target(coordinates=goals))
    A, B, P = closure_matrices(robot, track.transforms[track.reached])
    rank = max(map(_rank, A))
    N = _null_space(A, rank)[0]
    motions = max(map(_rank, N @ B))
    return _Ranks(rank, motions, max(map(_rank, N @ P)))


def _rank(A: NDArray, least: float = _RANK) -> int:
    """Return the number of singular values above a relative size."""
    return rank_of(np.linalg.svd(A, compute_uv=False), least, noise=least)


def _null_space(A: NDArray, rank: int) -> tuple[NDArray, NDArray, NDArray]:
    """Return the null space, the smallest nonzero singular value and its vector."""
    if not rank:
        return np.broadcast_to(np.eye(A.shape[2]), (len(A), *A.shape[2:] * 2)), *(
            np.ones(len(A)), np.zeros((len(A), A.shape[2]))
        )  # fmt: skip
    _, values, Vt = np.linalg.svd(A)
    return Vt[:, rank:], values[:, rank - 1], Vt[:, rank - 1]


def _measure(robot: Robot, T: NDArray, ranks: _Ranks) -> Singularities:
    """Return the distances from singularities for given ranks."""
    A, B, _ = closure_matrices(robot, T)
    N, closure, resisting = _null_space(A, ranks.closures)
    measured = _drives_and_platform(N, B, ranks)
    closure = np.where(closure > SINGULAR, closure, 0.0)
    for i in np.flatnonzero(closure == 0.0).tolist():
        # At this posture, the closures permit more motions than at other postures.
        here = slice(i, i + 1)
        more, _, _ = _null_space(A[here], _rank(A[i], SINGULAR))
        own = _ranks_there(more[0] @ B[i], ranks)
        for values, value in zip(
            measured, _drives_and_platform(more, B[here], own), strict=True
        ):
            values[here] = value
    serial, parallel, serial_rates, parallel_rates, screws = measured
    moves = mobile(robot)

    def all_joints(part: NDArray) -> NDArray:
        full = np.zeros((len(T), len(robot.frames)))
        full[:, moves] = part
        return full

    return Singularities(
        serial=serial,
        parallel=parallel,
        closure=closure,
        serial_joints=all_joints(serial_rates),
        parallel_joints=all_joints(parallel_rates),
        parallel_screws=screws,
        closure_joints=all_joints(resisting),
    )


def _ranks_there(moved: NDArray, generic: _Ranks) -> _Ranks:
    """Return the ranks at a posture where the closures permit additional motions."""
    motions = _rank(moved, SINGULAR)
    # Motions that do not move the platform at any posture are not serial singularities.
    always = generic.motions - generic.platform
    return _Ranks(generic.closures, motions, min(motions - always, 6))


def _drives_and_platform(
    N: NDArray, B: NDArray, ranks: _Ranks
) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray]:
    """Return serial and parallel distances, joint rates, and a platform screw."""
    drives = B.shape[2] - 6
    W, t, Q = np.linalg.svd(N @ B, full_matrices=False)
    Q = Q[:, : ranks.motions]
    # joint rates for each basis vector of drive and platform rates (rows of Q)
    rates = np.swapaxes(W[:, :, : ranks.motions], 1, 2) @ N
    rates = rates / np.maximum(t[:, : ranks.motions, None], 1e-300)
    serial, still_platform = _least(Q[..., drives:], ranks.platform)
    parallel, still_drives = _least(Q[..., :drives], ranks.motions)
    return (
        serial,
        parallel,
        (still_platform[:, None] @ rates)[:, 0],
        (still_drives[:, None] @ rates)[:, 0],
        (still_drives[:, None] @ Q[..., drives:])[:, 0],
    )


def _least(half: NDArray, rank: int) -> tuple[NDArray, NDArray]:
    """Return the singular value with index ``rank`` and its left singular vector."""
    if not rank:
        return np.ones(len(half)), np.zeros(half.shape[:2])
    U, values, _ = np.linalg.svd(half, full_matrices=True)
    full = np.zeros((len(half), half.shape[1]))
    full[:, : values.shape[1]] = values
    return full[:, rank - 1], U[:, :, rank - 1]
