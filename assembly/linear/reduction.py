"""Problem (22) made small: free motions and springs eliminated exactly.

With the columns of :mod:`assembly.linear.closure` the assembly constraints read

    A_q q + A_u u + A_y y = -misfit,      |u_k| <= 1 for each cone k.

Free motions q are projected out (rows orthogonal to A_q), then the springs y: the
remaining rows split into those some spring can take up and those none can.  Left over
is a problem in the clearances alone,

    minimise  |G u + h|^2 / 2 - d.u      subject to  H u = k,  |u_k| <= 1,

where G u + h is the springs' scaled deformation beyond the load's.  Springs enter by
the square roots of their compliances, and ranks are decided on those: summing the
compliances themselves, 1 and 1e-8 rad/(N m), would lose the stiff ones.

Sources:
    Golub, Van Loan, Matrix Computations, 4th ed., sections 5.4-5.5 (rank-revealing
    QR, complete orthogonal factorisation).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, svd

from assembly.linear.closure import Linearisation, VirtualJoints
from assembly.linear.load import Forces, forces_on
from forcefit.inputs.display import html_table, short_repr

_RANK = 1e-10  # relative size below which a singular value counts as zero
# what a projection leaves of columns that it removes whole is rounding of their size
NOISE = 1e-12


class FreeMotion(ValueError):
    """The load drives a motion that nothing resists: there is no equilibrium."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """The small problem, and the way back to the large one.

    Attributes:
        linearisation: the assembly constraints.
        joints: the columns eliminated and kept.
        G: (r, nu) [sqrt(2 J)] springs' answer to the clearances.
        h: (r,) [sqrt(2 J)] springs' deformation without clearances and load.
        d: (nu,) [J] work of the load along the clearances.
        H: (p, nu) rows that no spring can take up.
        k: (p,) their right sides.
        inconsistent: [-] scaled misfit that nothing at all can take up; 0 if none.
        forces: of the loads on every small screw.
        preload: (6 closures,) multipliers by which the loads pass free motions.
        basis: (6 closures, m) orthonormal, orthogonal to all free motions.
        rigid: (m, p) rows of ``basis`` combined into those of H.
        elastic_inverse: (ny, m) pseudoinverse of the springs' columns.
        spread: (ny, r) orthonormal, from the small problem's springs to all of them.
        ranks: what was decided: free, elastic, rigid, redundant rows.
    """

    linearisation: Linearisation
    joints: VirtualJoints
    G: NDArray
    h: NDArray
    d: NDArray
    H: NDArray
    k: NDArray
    inconsistent: float
    forces: Forces
    preload: NDArray
    basis: NDArray
    rigid: NDArray
    elastic_inverse: NDArray
    spread: NDArray
    ranks: dict[str, int]

    __repr__, _repr_html_ = short_repr, html_table

    def springs(self, u: NDArray) -> NDArray:
        """(ny,) [sqrt(2 J)] all springs' scaled deformation at given clearances."""
        return self.spread @ (self.G @ u + self.h) + self.load_springs

    @property
    def load_springs(self) -> NDArray:
        """(ny,) [sqrt(2 J)] the deformation the loads alone would cause."""
        return spring_pull(self.linearisation, self.joints, self.forces, self.preload)

    @property
    def energy_without_play(self) -> float:
        """[J] what closing would cost if every bounded clearance stayed at zero."""
        return float(self.h @ self.h) / 2

    def motions(self, u: NDArray, y: NDArray) -> NDArray:
        """(nq,) free motions of least size that go with clearances and springs."""
        A = self.linearisation.rows
        moved = self.joints.cones @ u + self.joints.elastic @ y
        right = -self.linearisation.misfit - A @ moved
        return np.linalg.lstsq(A @ self.joints.free, right, rcond=_RANK)[0]

    def multipliers(self, springs: NDArray, rigid_multipliers: NDArray) -> NDArray:
        """(6 closures,) scaled closure wrenches, the least where not unique."""
        own = self.spread @ springs
        inner = self.elastic_inverse.T @ own + self.rigid @ rigid_multipliers
        return self.preload + self.basis @ inner


def reduce_problem(
    linearisation: Linearisation, joints: VirtualJoints, forces: Forces | None = None
) -> Reduction:
    """Eliminate free motions and springs.

    Args:
        linearisation: the assembly constraints.
        joints: what may move.
        forces: of the loads on every small screw; none if absent.

    Returns:
        The problem in the clearances.

    Raises:
        FreeMotion: a load works along a motion that nothing resists.
    """
    if forces is None:
        forces = forces_on(linearisation.posture)
    A = linearisation.rows
    tolerance = _RANK + 30.0 * linearisation.posture.mismatch
    Z = complement(A @ joints.free, tolerance)
    preload = _preload(A @ joints.free, joints.free.T @ forces.joint)
    A_u, A_y = Z.T @ A @ joints.cones, Z.T @ A @ joints.elastic
    d = joints.cones.T @ (A.T @ preload + forces.joint)
    sag = spring_pull(linearisation, joints, forces, preload)
    right = -Z.T @ linearisation.misfit - A_y @ sag

    U, S, Vt = svd(A_y, full_matrices=True)
    noise = NOISE * np.abs(A @ joints.elastic).max(initial=0.0)
    rank = int(np.sum(S > max(noise, tolerance * S.max(initial=0.0))))
    grip, loose = U[:, :rank], U[:, rank:]
    G = -(grip.T @ A_u) / S[:rank, None]
    h = grip.T @ right / S[:rank]
    H, k, rigid, inconsistent = _rigid_rows(
        loose, A_u, right, linearisation, tolerance,
        noise=NOISE * np.abs(A @ joints.cones).max(initial=0.0),
    )  # fmt: skip
    return Reduction(
        linearisation, joints, G, h, d, H, k, inconsistent,
        forces, preload, Z, rigid,
        elastic_inverse=(Vt[:rank].T / S[:rank]) @ grip.T,
        spread=Vt[:rank].T,
        ranks={
            "free": A.shape[0] - Z.shape[1], "elastic": rank, "rigid": len(k),
            "redundant": Z.shape[1] - rank - len(k),
        },
    )  # fmt: skip


def complement(A: NDArray, tolerance: float) -> NDArray:
    """Orthonormal basis of what is orthogonal to the columns of A.

    Args:
        A: (m, n).
        tolerance: relative size below which a column adds nothing new.

    Returns:
        (m, m - rank).
    """
    Q, R, _ = qr(A, pivoting=True)
    size = np.abs(np.diag(R))
    rank = int(np.sum(size > tolerance * size.max(initial=0.0)))
    return Q[:, rank:]


def spring_pull(
    lin: Linearisation, joints: VirtualJoints, forces: Forces, multipliers: NDArray
) -> NDArray:
    """How closures and loads pull the springs.

    Args:
        lin: the assembly constraints.
        joints: whose springs are asked about.
        forces: of the loads.
        multipliers: (6 closures,) of the scaled closures.

    Returns:
        (ny,) [sqrt(2 J)]: the springs' scaled deformations in balance with them.
    """
    closing = lin.rows.T @ multipliers
    body = joints.elastic.T @ (closing + forces.body)
    return np.where(joints.links, body, joints.elastic.T @ (closing + forces.joint))


def _preload(A_q: NDArray, drive: NDArray) -> NDArray:
    """Multipliers that balance the loads along every free motion."""
    found = np.linalg.lstsq(A_q.T, -drive, rcond=_RANK)[0]
    left = np.abs(A_q.T @ found + drive).max(initial=0.0)
    if left > 1e-8 * np.abs(drive).max(initial=1e-300):
        raise FreeMotion("the load drives a motion that no joint or spring resists")
    return found


def _rigid_rows(
    loose: NDArray,
    A_u: NDArray,
    right: NDArray,
    lin: Linearisation,
    tolerance: float,
    noise: float,
) -> tuple[NDArray, NDArray, NDArray, float]:
    """Independent rows that only clearances can satisfy, and what nothing satisfies."""
    rows, wanted = loose.T @ A_u, loose.T @ right
    U, S, _ = svd(rows, full_matrices=True)
    # clearances are small: their columns count against their own size
    rank = int(np.sum(S > max(noise, 1e-9 * S.max(initial=0.0)))) if A_u.size else 0
    errors = np.abs(lin.rows * lin.posture.robot.errors.ravel()).max(initial=0.0)
    left = np.abs(U[:, rank:].T @ wanted).max(initial=0.0)
    allowed = 1e-12 + 10 * tolerance * errors
    keep = U[:, :rank]
    return (
        keep.T @ rows,
        keep.T @ wanted,
        loose @ keep,
        float(left) if left > allowed else 0.0,
    )
