"""Derivatives of a solution with respect to every geometric error.

The minimum energy (22) equals the maximum of its dual ``-w.dl - ..`` over all balanced
wrenches w.  The derivative of the energy with respect to delta l is therefore minus the
wrench that the body transmits.

Wrenches and the platform screw are part of the solution. As long as the set of active
clearances does not change, their derivatives follow from the differentiated optimality
conditions:

    G^T (G u + h) + H^T eta + nu u = 0,   H u = k,   |u_c| = 1 where nu_c > 0,

so du is orthogonal to u_c in every active cone, and

    P (G^T G + nu) P du + P H^T deta = -P G^T dh,   H P du = dk

where P is the projector on these directions.  A single solve with the transposed
equations gives the derivatives with respect to any number of errors (adjoint method).
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.solvers.conic import GAP_WITHOUT_CLEARANCE
from forcefit.assembly.statistics.linear_response import LinearResponse

# forces below this fraction of the largest force on any clearance count as zero
_ACTIVE = 1e-7
# relative size below which a singular value counts as zero; clearances are assumed to
# stay fixed along the corresponding directions
_RANK = 1e-10


def energy_slopes(assembly: Assembly) -> NDArray:
    """Differentiate the minimum energy with respect to every geometric error.

    Args:
        assembly: the assembly at minimum energy. Under a load, the result is the
            derivative of the energy minus the work of the load.

    Returns:
        (n, 6) [J/rad, J/m] derivatives with respect to delta l of every frame, in frame
        axes. If rigid parts are overconstrained, the wrenches are not unique, and the
        derivatives for the smallest wrenches are returned.
    """
    return -assembly.wrenches


def solution_slopes(
    prepared: LinearResponse, draws: Assembly, by_wrench: NDArray, by_screw: NDArray,
    by_clearance: NDArray | None = None,
) -> NDArray:  # fmt: skip
    """Differentiate a function of wrenches and platform screw with respect to errors.

    Args:
        prepared: the prepared posture.
        draws: solutions of k draws, from :meth:`LinearResponse.solve`.
        by_wrench: (k, n, 6) derivatives of the function by the wrench of every body.
        by_screw: (k, 6) derivatives with respect to the platform's screw.
        by_clearance: (k, nu) derivatives with respect to the clearances, relative to
            their bounds.

    Returns:
        (k, n, 6) derivatives with respect to delta l of every frame, in frame axes. If
        a clearance is weakly active, one of the one-sided derivatives is returned.
        Undetermined clearances are assumed to stay fixed, and motion limits of passive
        joints are ignored.
    """
    A, nu, k = prepared.closures, prepared.starts[-1], len(draws.energy)
    closure_columns = A @ prepared.joints.cones
    H = prepared.redundant.T @ closure_columns
    forces = draws.multipliers @ closure_columns
    if prepared.loads is not None:
        forces += prepared.loads.joint @ prepared.joints.cones
    P, N = _active_clearances(prepared, draws, forces)
    size = nu + len(H)
    K = np.zeros((k, size, size))
    K[:, :nu, :nu] = P @ (prepared.G.T @ prepared.G + N) @ P
    K[:, nu:, :nu] = H @ P
    K[:, :nu, nu:] = P @ H.T
    by_multiplier = np.tensordot(by_wrench, prepared.wrench, axes=((1, 2), (0, 1)))
    by_spring = by_multiplier @ prepared.closing
    right = np.zeros((k, size))
    projected = by_spring @ prepared.G + by_screw @ prepared.screws[:, :nu]
    if by_clearance is not None:
        projected += by_clearance
    right[:, :nu] = np.einsum("kij,kj->ki", P, projected)
    right[:, nu:] = by_multiplier @ prepared.redundant
    x = np.einsum("kij,kj->ki", np.linalg.pinv(K, _RANK, hermitian=True), right)
    moved = np.einsum("kij,kj->ki", P, x[:, :nu])
    slopes = (by_spring - moved @ prepared.G.T) @ prepared.misfit
    slopes += by_screw @ prepared.screws[:, nu:] - x[:, nu:] @ prepared.infeasible
    return slopes.reshape(by_wrench.shape)


def _active_clearances(
    prepared: LinearResponse, draws: Assembly, forces: NDArray
) -> tuple[NDArray, NDArray]:
    """Return projectors (k, nu, nu) normal to active clearances, and multipliers."""
    k, nu = forces.shape
    P, N = np.tile(np.eye(nu), (k, 1, 1)), np.zeros((k, nu, nu))
    # inside an assembly zone the multipliers y are round-off: the energies y^2 / 2 are
    # far below the forces G y
    pressed = draws.energy > GAP_WITHOUT_CLEARANCE * np.abs(forces).sum(
        axis=1, initial=0.0
    )
    some = np.flatnonzero(pressed | (prepared.loads is not None))
    largest = np.abs(forces).max(axis=1, initial=0.0)
    for first, end in zip(prepared.starts[:-1], prepared.starts[1:], strict=True):
        own = forces[some, first:end]
        size = np.linalg.norm(own, axis=1)
        kept = size > _ACTIVE * largest[some]
        rows, unit = some[kept], own[kept] / size[kept, None]
        P[rows, first:end, first:end] -= unit[:, :, None] * unit[:, None, :]
        N[rows, first:end, first:end] = size[kept, None, None] * np.eye(end - first)
    return P, N
