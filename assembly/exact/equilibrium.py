"""Force residual, stability and contacts of an equilibrium.

They are computed from the expansion at the equilibrium, see
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

_ANGLE_ROUNDING = 1e-5  # [-] round-off in an angle, relative to a residual of 1e-9


def imbalance(local: Expansion) -> float:
    """Return the relative force residual at a placement.

    Args:
        local: expansion at the placement.

    Returns:
        [-] largest generalised force residual of all unknowns.  It is divided by the
        sum of the absolute forces on the unknown, or by the force that a loop-closure
        residual of 1e-9 causes if that force is larger.
    """
    at, A, model = local.placement, local.placement.rows, local.placement.model
    unbalanced = local.gradient - A.T @ local.multipliers
    wrench = float(np.linalg.norm(local.multipliers)) + local.small_wrench
    loads = load_magnitudes(at, local.loads)
    acting = np.linalg.norm(A, axis=0) * wrench + np.abs(local.gradient) + loads
    # in an open chain, the forces on unloaded bodies are round-off
    unit = np.sqrt(np.diag(model.metric))
    acting = np.maximum(acting, local.small_wrench * unit)
    # a contact force is normal to the boundary of its cone
    u, group = at.x[model.bounded], model.joints.group
    force = cone_multipliers(u, unbalanced[model.bounded], group)
    unbalanced[model.bounded] += force[group] * u
    complementarity = np.zeros(len(unbalanced))
    complementarity[model.bounded] = (force * (1.0 - cone_sizes(u, group)))[group]
    worst = np.maximum(np.abs(unbalanced), np.abs(complementarity))
    return float(np.max(worst / acting, initial=0.0))


def least_curvature(local: Expansion) -> float:
    """Return the smallest curvature of the potential, a measure of stability.

    Args:
        local: expansion at the equilibrium.

    Returns:
        [J/rad^2] smallest second derivative of the potential along the admissible
        motions, with translations in reference lengths.  It is positive at a strict
        minimum, and inf if no motion is possible.
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

    Admissible motions keep all loops closed and all contacts in contact.

    Args:
        local: expansion at the equilibrium.
        hold_touching: whether joints that touch their bound without a force also remain
            in contact.

    Returns:
        (N, k) basis of the admissible motions, and (k, k) [J] second derivative of the
        potential in this basis.
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
    """Return the eigenvalues and eigenmodes of the second derivative.

    Args:
        D: (N, k) basis of motions.
        H: (k, k) [J] second derivative of the potential in this basis.
        units: (N,) scale of the unknowns.  The scaled modes are orthonormal.

    Returns:
        (k,) [J] eigenvalues in ascending order, and (N, k) modes.
    """
    Q, R = np.linalg.qr(D / units[:, None])
    back = np.linalg.inv(R)
    H = back.T @ H @ back
    values, turned = np.linalg.eigh((H + H.T) / 2)
    return values, units[:, None] * (Q @ turned)


def active_clearances(local: Expansion) -> tuple[NDArray, NDArray]:
    """Return the clearances with a contact force at an equilibrium.

    Args:
        local: expansion at the equilibrium.

    Returns:
        (cones,) bool, True for clearances with a contact force, and (cones,) [J]
        product of contact force and clearance.
    """
    at, model = local.placement, local.placement.model
    u, group = at.x[model.bounded], model.joints.group
    gradient = local.gradient - at.rows.T @ local.multipliers
    force = cone_multipliers(u, gradient[model.bounded], group)
    bound = np.sqrt(np.bincount(group, weights=np.diag(model.metric)[model.bounded]))
    rounding = _ANGLE_ROUNDING * local.small_wrench * bound
    return force > np.maximum(1e-9 * force.max(initial=0.0), rounding), force
