"""Properties of an equilibrium: imbalance, stability, active clearances.

All properties are computed from the expansion at the equilibrium, see
:func:`forcefit.assembly.exact.descent.expand`.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from forcefit.assembly.exact.contact_qp import (
    AT_BOUNDARY,
    boundary_normals,
    cone_multipliers,
)
from forcefit.assembly.exact.dead_load import load_magnitudes
from forcefit.assembly.exact.descent import Expansion
from forcefit.assembly.solvers.cones import cone_sizes

# [-] round-off in an angle, relative to the residual that counts as small
_ANGLE_ROUNDING = 1e-5


def imbalance(local: Expansion) -> float:
    """Return the relative imbalance of forces at a placement.

    Args:
        local: expansion at the placement.

    Returns:
        [-] largest unbalanced generalised force on any unknown.  Each force is divided
        by the sum of the forces on that unknown, or by the forces due to a residual of
        1e-9 in the closures or the unknown, whichever is larger.
    """
    at, A, model = local.placement, local.placement.rows, local.placement.model
    unbalanced = local.gradient - A.T @ local.multipliers
    wrench = float(np.linalg.norm(local.multipliers)) + local.small_wrench
    loads = load_magnitudes(at, local.loads)
    acting = np.linalg.norm(A, axis=0) * wrench + np.abs(local.gradient) + loads
    # in an open chain, the forces on unloaded parts are only round-off
    unit = np.sqrt(np.diag(model.metric))
    acting = np.maximum(acting, local.small_wrench * unit)
    # a clearance inside its cone carries no force; at the boundary, its force is normal
    # to the boundary
    u, group = at.x[model.bounded], model.joints.group
    force = cone_multipliers(u, unbalanced[model.bounded], group)
    unbalanced[model.bounded] += force[group] * u
    complementarity = np.zeros(len(unbalanced))
    complementarity[model.bounded] = (force * (1.0 - cone_sizes(u, group)))[group]
    worst = np.maximum(np.abs(unbalanced), np.abs(complementarity))
    return float(np.max(worst / acting, initial=0.0))


def least_curvature(local: Expansion) -> float:
    """Return the smallest curvature of the potential, as a measure of stability.

    Args:
        local: expansion at the equilibrium.

    Returns:
        [J/rad^2] smallest second derivative of the potential along motions that
        preserve closures and active constraints, per squared rad and reference length
        of all screws.  It is positive at a strict minimum, and inf if no motion is
        possible.
    """
    D, H = tangent_space(local)
    if not D.shape[1]:
        return np.inf
    metric = D.T @ local.placement.model.metric @ D
    return float(eigh(H, metric, eigvals_only=True)[0])


def tangent_space(
    local: Expansion, hold_touching: bool = False
) -> tuple[NDArray, NDArray]:
    """Return the admissible motions at an equilibrium and their curvature.

    Args:
        local: expansion at the equilibrium.
        hold_touching: whether to also fix clearances that touch their bound without a
            force.

    Returns:
        (N, k) basis of the motions that preserve closures and active clearances, and
        (k, k) [J] second derivative of the potential in this basis.
    """
    at, model = local.placement, local.placement.model
    u, group = at.x[model.bounded], model.joints.group
    active, force = active_clearances(local)
    if hold_touching:
        active = active | (cone_sizes(u, group) >= 1.0 - AT_BOUNDARY)
    B, nu = local.basis, len(group)
    C = np.hstack([boundary_normals(u, active, group), local.rigid_rows.T])
    C = np.vstack([C, np.zeros((B.shape[1] - nu, C.shape[1]))])
    D = B @ np.linalg.qr(C, mode="complete")[0][:, np.linalg.matrix_rank(C) :]
    H = local.hessian.copy()
    H[~local.unbounded, ~local.unbounded] += force[group]
    return D, D.T @ H @ D


def curvature_modes(D: NDArray, H: NDArray, units: NDArray) -> tuple[NDArray, NDArray]:
    """Return the eigenmodes, which diagonalise the second derivative.

    Args:
        D: (N, k) basis of motions.
        H: (k, k) [J] second derivative of the potential in this basis.
        units: (N,) scale of the unknowns in which the modes are orthonormal.

    Returns:
        (k,) [J] second derivatives, smallest first, and (N, k) motions.
    """
    Q, R = np.linalg.qr(D / units[:, None])
    back = np.linalg.inv(R)
    H = back.T @ H @ back
    values, turned = np.linalg.eigh((H + H.T) / 2)
    return values, units[:, None] * (Q @ turned)


def active_clearances(local: Expansion) -> tuple[NDArray, NDArray]:
    """Return the clearances that carry a force at an equilibrium.

    Args:
        local: expansion at the equilibrium.

    Returns:
        (cones,) bool, and (cones,) [J] products of the force on each bound and the
        bound.
    """
    at, model = local.placement, local.placement.model
    u, group = at.x[model.bounded], model.joints.group
    gradient = local.gradient - at.rows.T @ local.multipliers
    force = cone_multipliers(u, gradient[model.bounded], group)
    bound = np.sqrt(np.bincount(group, weights=np.diag(model.metric)[model.bounded]))
    rounding = _ANGLE_ROUNDING * local.small_wrench * bound
    return force > np.maximum(1e-9 * force.max(initial=0.0), rounding), force
