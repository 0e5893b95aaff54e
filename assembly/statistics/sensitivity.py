"""Derivatives of a minimum-energy solution with respect to geometric errors.

By duality, the derivative of the minimum energy (22) with respect to the error delta l
of a frame is -w, where w is the wrench through its body.

The derivatives of wrenches and platform screw are obtained by differentiating the
optimality conditions for constant active clearances:

    G^T (G u + h) + H^T eta + nu u = 0,   H u = k,   |u_c| = 1 where nu_c > 0,

so du is orthogonal to u_c in every active cone, and

    P (G^T G + nu) P du + P H^T deta = -P G^T dh,   H P du = dk

where P is the projector on the directions orthogonal to these u_c. By the adjoint
method, the transposed equations are solved once for the derivatives with respect to all
errors.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.solvers.conic import GAP_WITHOUT_CLEARANCE
from forcefit.assembly.statistics.linear_response import LinearResponse

# contact forces below this fraction of the largest contact force are treated as zero
_ACTIVE = 1e-7
# singular values below this fraction of the largest one are treated as zero
_RANK = 1e-10


def energy_slopes(assembly: Assembly) -> NDArray:
    """Differentiate the minimum energy with respect to geometric errors.

    Args:
        assembly: the assembly at minimum energy. Under a load, the energy minus the
            work of the load is differentiated.

    Returns:
        Derivatives with respect to delta l, (n, 6) [J/rad, J/m], in frame axes. For
        overconstrained rigid bodies, wrenches are not unique, and the smallest ones are
        used.
    """
    return -assembly.wrenches


def solution_slopes(
    prepared: LinearResponse, draws: Assembly, by_wrench: NDArray, by_screw: NDArray,
    by_clearance: NDArray | None = None,
) -> NDArray:  # fmt: skip
    """Differentiate a function of wrenches and platform screw by geometric errors.

    Args:
        prepared: linear response of the posture.
        draws: solutions for k draws, from :meth:`LinearResponse.solve`.
        by_wrench: (k, n, 6) derivatives of the function with respect to the wrenches.
        by_screw: (k, 6) derivatives with respect to the platform screw.
        by_clearance: (k, nu) derivatives with respect to the clearance motions, which
            are relative to their bounds.

    Returns:
        Derivatives with respect to delta l, (k, n, 6), in frame axes. At a contact
        with zero force, the derivative is one-sided. Joint positions that minimum
        energy does not determine are assumed to be constant. Motion limits of passive
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
    """Return the projectors P and the multipliers nu, each (k, nu, nu)."""
    k, nu = forces.shape
    P, N = np.tile(np.eye(nu), (k, 1, 1)), np.zeros((k, nu, nu))
    # Inside an assembly zone, contact forces are round-off, so no clearance is active.
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
