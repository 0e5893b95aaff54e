"""Exact elimination of free motions and springs from problem (22).

With the columns of :mod:`forcefit.assembly.linear.closure`, the assembly constraints
are

    A_q q + A_u u + A_y y = -misfit,      |u_k| <= 1 for each cone k.

First, the free motions q are eliminated by projection on the complement of the columns
of A_q.  Then the springs y are eliminated by separating the remaining equations into
those with springs and those without.  The unknowns of the reduced problem are the
clearances u alone,

    minimise  |G u + h|^2 / 2 - d.u      subject to  H u = k,  |u_k| <= 1,

where G u + h is the scaled deformation of the springs in addition to the deformation
under the loads alone.  Ranks are determined from the square roots of the springs'
compliances.  In a sum of compliances, for example 1 and 1e-8 rad/(N m), the
contribution of the stiff springs would be lost in round-off.

Sources:
    Golub, Van Loan, Matrix Computations, 4th ed., sections 5.4-5.5 (rank-revealing
    QR, complete orthogonal factorisation).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, svd

from forcefit.assembly.kinematics.ranks import (
    RANK,
    ROWS_RANK,
    noise_of,
    rank_of,
    rank_tolerance,
)
from forcefit.assembly.linear.closure import (
    Linearisation,
    VirtualJoints,
    in_reference_lengths,
)
from forcefit.assembly.linear.load import FrameLoads, loads_on_frames
from forcefit.results.display import html_table, numbers, short_repr
from forcefit.stiffness.screws import SCREW

# motions below this fraction of the largest joint motion are round-off
_STILL = 1e-6
_NAMED = 4  # largest number of joints in a message
# loads below this fraction of the largest load are round-off
_LOAD_ROUNDING = 1e-13


class FreeMotion(ValueError):
    """Raised if a load drives a motion that nothing resists."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """Reduced problem, with the data needed to recover the full solution.

    Attributes:
        linearisation: the assembly constraints.
        joints: the virtual joints, whose columns are eliminated or retained.
        G: (r, nu) [sqrt(2 J)] sensitivity of the scaled strains to the clearances.
        h: (r,) [sqrt(2 J)] scaled strains with zero clearances and no loads.
        d: (nu,) [J] work of the loads per unit of each clearance.
        H: (p, nu) matrix of the equations without springs.
        k: (p,) right-hand sides of these equations.
        inconsistent: [-] scaled closure error that no motion can compensate, or 0.
        frame_loads: loads on every small screw.
        load_multipliers: (6 closures,) multipliers that balance the loads on free
            motions.
        basis: (6 closures, m) orthonormal basis, orthogonal to all free motions.
        rigid: (m, p) combinations of the columns of ``basis`` that give the rows of H.
        elastic_inverse: (ny, m) pseudoinverse of the spring columns.
        spread: (ny, r) orthonormal map from the springs of the reduced problem to all
            springs.
        ranks: numbers of free, elastic, rigid and redundant equations.
    """

    linearisation: Linearisation
    joints: VirtualJoints
    G: NDArray
    h: NDArray
    d: NDArray
    H: NDArray
    k: NDArray
    inconsistent: float
    frame_loads: FrameLoads
    load_multipliers: NDArray
    basis: NDArray
    rigid: NDArray
    elastic_inverse: NDArray
    spread: NDArray
    ranks: dict[str, int]

    __repr__, _repr_html_ = short_repr, html_table

    def springs(self, u: NDArray) -> NDArray:
        """Return the scaled deformations of all springs, (ny,) [sqrt(2 J)]."""
        return self.spread @ (self.G @ u + self.h) + self.load_springs

    @property
    def load_springs(self) -> NDArray:
        """Scaled deformations due to the loads alone, (ny,) [sqrt(2 J)]."""
        return spring_deformations(
            self.linearisation, self.joints, self.frame_loads, self.load_multipliers
        )

    @property
    def energy_without_clearance(self) -> float:
        """Elastic energy [J] with every bounded clearance equal to zero."""
        bent, h = self.load_springs, self.h
        return float(h @ h + 2 * (self.spread @ h) @ bent + bent @ bent) / 2

    def motions(self, u: NDArray, y: NDArray) -> NDArray:
        """Return the free motions of minimum norm, (nq,)."""
        A = self.linearisation.rows
        moved = self.joints.cones @ u + self.joints.elastic @ y
        right = -self.linearisation.misfit - A @ moved
        return np.linalg.lstsq(A @ self.joints.free, right, rcond=RANK)[0]

    def multipliers(self, springs: NDArray, rigid_multipliers: NDArray) -> NDArray:
        """Return the scaled closure wrenches of minimum norm, (6 closures,)."""
        all_springs = self.spread @ springs
        inner = self.elastic_inverse.T @ all_springs + self.rigid @ rigid_multipliers
        return self.load_multipliers + self.basis @ inner


def reduce_problem(
    linearisation: Linearisation,
    joints: VirtualJoints,
    frame_loads: FrameLoads | None = None,
) -> Reduction:
    """Eliminate free motions and springs.

    Args:
        linearisation: the assembly constraints.
        joints: virtual joints that can move.
        frame_loads: loads on every small screw; None for no loads.

    Returns:
        The problem in the clearances.

    Raises:
        FreeMotion: a load does work on a motion that nothing resists.
    """
    if frame_loads is None:
        frame_loads = loads_on_frames(linearisation.posture)
    A = linearisation.rows
    tolerance = rank_tolerance(linearisation.posture.mismatch)
    Z = complement(A @ joints.free, tolerance)
    load_multipliers = _load_multipliers(linearisation, joints, frame_loads)
    A_u, A_y = Z.T @ A @ joints.cones, Z.T @ A @ joints.elastic
    d = joints.cones.T @ (A.T @ load_multipliers + frame_loads.joint)
    load_springs = spring_deformations(
        linearisation, joints, frame_loads, load_multipliers
    )
    right = -Z.T @ linearisation.misfit - A_y @ load_springs

    U, S, Vt = svd(A_y, full_matrices=True)
    rank = rank_of(S, tolerance, noise_of(A @ joints.elastic))
    elastic_rows, rigid_rows = U[:, :rank], U[:, rank:]  # rows with and without springs
    G = -(elastic_rows.T @ A_u) / S[:rank, None]
    h = elastic_rows.T @ right / S[:rank]
    H, k, rigid, inconsistent = _rigid_rows(
        rigid_rows, A_u, right, linearisation, tolerance,
        noise=noise_of(A @ joints.cones),
    )  # fmt: skip
    return Reduction(
        linearisation=linearisation,
        joints=joints,
        G=G,
        h=h,
        d=d,
        H=H,
        k=k,
        inconsistent=inconsistent,
        frame_loads=frame_loads,
        load_multipliers=load_multipliers,
        basis=Z,
        rigid=rigid,
        elastic_inverse=(Vt[:rank].T / S[:rank]) @ elastic_rows.T,
        spread=Vt[:rank].T,
        ranks={
            "free": A.shape[0] - Z.shape[1],
            "elastic": rank,
            "rigid": len(k),
            "redundant": Z.shape[1] - rank - len(k),
        },
    )


def complement(A: NDArray, tolerance: float) -> NDArray:
    """Return an orthonormal basis of the orthogonal complement of the columns of A.

    Args:
        A: (m, n) matrix.
        tolerance: relative size below which a column is treated as dependent.

    Returns:
        (m, m - rank) basis.
    """
    Q, R, _ = qr(A, pivoting=True)
    return Q[:, rank_of(np.abs(np.diag(R)), tolerance) :]


def spring_deformations(
    lin: Linearisation,
    joints: VirtualJoints,
    frame_loads: FrameLoads,
    multipliers: NDArray,
) -> NDArray:
    """Compute the spring deformations that are in equilibrium with the loads.

    Args:
        lin: the assembly constraints.
        joints: virtual joints with the springs.
        frame_loads: loads on every small screw.
        multipliers: (6 closures,) multipliers of the scaled closures.

    Returns:
        (ny,) [sqrt(2 J)] scaled deformations.
    """
    closing = lin.rows.T @ multipliers
    of_links = joints.elastic.T @ (closing + frame_loads.body)
    of_joints = joints.elastic.T @ (closing + frame_loads.joint)
    return np.where(joints.links, of_links, of_joints)


def _load_multipliers(
    lin: Linearisation, joints: VirtualJoints, frame_loads: FrameLoads
) -> NDArray:
    """Return the multipliers that balance the loads along every free motion."""
    A_q, drive = lin.rows @ joints.free, joints.free.T @ frame_loads.joint
    multipliers = np.linalg.lstsq(A_q.T, -drive, rcond=RANK)[0]
    # The component orthogonal to the rows of A_q is a free motion that the load drives.
    left = A_q.T @ multipliers + drive
    most = np.maximum(
        1e-8 * np.abs(drive).max(initial=1e-300),
        _load_rounding(lin, joints, frame_loads),
    )
    if (np.abs(left) > most).any():
        raise FreeMotion(
            "the load drives a motion that no joint or spring resists: "
            + _motion_text(lin, joints.free @ left)
        )
    return multipliers


def _load_rounding(
    lin: Linearisation, joints: VirtualJoints, frame_loads: FrameLoads
) -> NDArray:
    """Return the round-off in the work of the loads on each free motion."""
    # The factors scale screws; wrenches are divided by them.
    lengths = in_reference_lengths(lin.size)
    largest = np.abs(frame_loads.joint.reshape(-1, 6) / lengths).max(initial=0.0)
    sizes = np.tile(lengths, len(joints.free) // 6) @ np.abs(joints.free)
    return np.asarray(_LOAD_ROUNDING * largest * sizes)


def _motion_text(lin: Linearisation, screws: NDArray) -> str:
    """Describe a free motion by its joints and the unit screw of the platform."""
    robot = lin.posture.robot
    sizes = np.abs(screws.reshape(-1, 6) * in_reference_lengths(lin.size))
    moved = sizes.max(axis=1)
    joints = [
        f"{robot.frames[i].name} {SCREW[sizes[i].argmax()].lower()}"
        for i in np.argsort(-moved, kind="stable")
        if moved[i] > _STILL * moved.max()
    ]
    rest = f" and {len(joints) - _NAMED} more" if len(joints) > _NAMED else ""
    way = f"it moves {', '.join(joints[:_NAMED])}{rest}"
    platform = lin.platform @ screws
    turn, shift = np.linalg.norm(platform[:3]) * lin.size, np.linalg.norm(platform[3:])
    if max(turn, shift) <= _STILL * moved.max() * lin.size:
        return f"{way}; the platform does not move"
    unit = platform / (turn / lin.size if turn > _STILL * shift else shift)
    unit = np.where(np.abs(unit) > _STILL * np.abs(unit).max(), unit, 0.0)
    return f"{way}; the platform moves along {numbers(unit)} [rad, m]"


def _rigid_rows(
    rigid_rows: NDArray,
    A_u: NDArray,
    right: NDArray,
    lin: Linearisation,
    tolerance: float,
    noise: float,
) -> tuple[NDArray, NDArray, NDArray, float]:
    """Return independent equations without springs, and their residual."""
    rows, wanted = rigid_rows.T @ A_u, rigid_rows.T @ right
    U, S, _ = svd(rows, full_matrices=True)
    # Clearances are small, so the rank is determined relative to their size.
    rank = rank_of(S, ROWS_RANK, noise)
    errors = np.abs(lin.rows * lin.posture.robot.errors.ravel()).max(initial=0.0)
    unclosed = np.abs(U[:, rank:].T @ wanted).max(initial=0.0)
    # A load slightly deforms equations that are treated as rigid.
    bent = np.abs(right).max(initial=0.0)
    allowed = 1e-12 + 10 * tolerance * max(errors, bent)
    independent = U[:, :rank]
    return (
        independent.T @ rows,
        independent.T @ wanted,
        rigid_rows @ independent,
        float(unclosed) if unclosed > allowed else 0.0,
    )
