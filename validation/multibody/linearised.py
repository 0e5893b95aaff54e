"""Compute the platform compliance by linearising the simulation model.

The residual forces in Exudyn are differentiated at the equilibrium, with constant loads
and constant reactions of joints and closures. The derivatives are computed for motions
that joints and closures permit. The finite differences are extrapolated to zero step.

Weak springs of stiffness k act on free motions so that the model can be solved.  Their
effect is removed by adding k X (1 - k B)^-1 X' to the compliance (Woodbury identity).
The matrices X and B are the responses of the platform and of the free joints to loads
on these joints.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from forcefit.stiffness.screws import rotation_vector
from forcefit.validation.multibody.extrapolation import steadiest, without_squares
from forcefit.validation.multibody.exudyn_model import Model
from forcefit.validation.multibody.exudyn_parts import Closure
from forcefit.validation.multibody.exudyn_reading import (
    closure_error,
    connector_wrench,
    idle_motions,
    pose,
)
from forcefit.validation.multibody.exudyn_solver import (
    raise_callback_error,
    static_settings,
)
from forcefit.validation.multibody.motion import turned
from forcefit.validation.multibody.open_robot import OpenTree

# Steps of the finite differences. The steps for models with contacts are smaller than
# the penetration and the smoothing width of a contact, which are a few nm.
_STEPS, _CONTACT_STEPS = (2e-4, 1e-4, 5e-5), (1e-8, 3e-9, 1e-9, 3e-10)
_GAP_STEP = 1e-5
_RANK = 1e-7  # relative tolerance for the rank of the derivatives of closure errors
# [-] If the relative stiffness of a free motion is below this value, only the weak
# spring resists the motion.
_ROLLS = 1e-4
# Number of final Newton steps, which reduce the rounding errors of closures.
_POLISH = 2


def linearised_compliance(
    model: Model, tree: OpenTree, platform: str
) -> tuple[NDArray, float, bool]:
    """Return the compliance of a model at its current equilibrium.

    Args:
        model: model in equilibrium.
        tree: parts of the model.
        platform: name of the platform's frame.

    Returns:
        Compliance for small motions at the platform's current origin, base axes, (6, 6)
        [rad/(N m) .. m/N]; the largest uncertainty of its entries divided by sqrt(C_ii
        C_jj); and whether the equilibrium is stable.

    Raises:
        OutOfTime: the model's deadline has passed.
    """
    system = model.mbs.systemData
    start = system.GetSystemState()
    model.hold_idle(0.0)
    for closure in tree.closures:
        _freeze(model, closure)
    try:
        return _compliance(model, partial(_motion, model, tree, platform), tree)
    except model.exu.ExudynError:
        raise_callback_error(model, "the residual is differentiated")
        raise
    finally:
        for closure in tree.closures:
            model.mbs.SetObjectParameter(closure.connector, _LAW, 0)
        system.SetSystemState(start)


_LAW = "springForceTorqueUserFunction"


def _freeze(model: Model, closure: Closure) -> None:
    """Replace the connector of a closed loop by a constant wrench.

    The connector acts half-way between the closed frame and its target position. The
    constant wrench acts at the closed frame.
    """
    wrench = connector_wrench(model, closure.connector)
    screw = wrench / model.regularisation.closing
    moment, force = wrench[:3] - np.cross(screw[3:] / 2, wrench[3:]), wrench[3:]
    kept = (np.stack([moment, force]) @ turned(screw[:3] / 2)).ravel().tolist()
    local = model.transform(closure.first.local @ closure.closed)
    model.mbs.SetMarkerParameter(closure.marker, "localHT", local)
    model.set_law(closure.connector, lambda screw: kept)


def _compliance(
    model: Model, motion: Callable[[NDArray, NDArray, float], NDArray], tree: OpenTree
) -> tuple[NDArray, float, bool]:
    """Return V Z (Z'KZ)^-1 Z'V' for the motions Z that joints and closures permit."""
    solver, settings = model.exu.MainSolverStatic(), static_settings(model, 2.0, 1)
    solver.InitializeSolver(model.mbs, settings)
    count = solver.GetODE2size()

    def forces(q: NDArray) -> NDArray:
        model.mbs.systemData.SetODE2Coordinates(q)
        solver.ComputeNewtonResidual(model.mbs, settings)
        return -np.array(solver.GetSystemResidual())[:count]

    def stiffness(q: NDArray, Z: NDArray, step: float) -> NDArray:
        ahead, back = ([forces(q + sign * step * z) for z in Z.T] for sign in (1, -1))
        return Z.T @ (np.array(ahead) - np.array(back)).T / (2 * step)

    # Models with contacts need smaller steps and no Newton steps.
    steps, polish = (_CONTACT_STEPS, 0) if tree.contacts else (_STEPS, _POLISH)
    q = np.array(model.mbs.systemData.GetODE2Coordinates())
    forces(q)
    solver.ComputeJacobianODE2RHS(
        model.mbs, scalarFactor_ODE2=-1, scalarFactor_ODE2_t=0, scalarFactor_ODE1=0
    )
    solver.ComputeJacobianAE(
        model.mbs, scalarFactor_ODE2=1.0, scalarFactor_ODE2_t=0.0,
        scalarFactor_ODE1=0.0, velocityLevel=False,
    )  # fmt: skip
    jacobian = np.array(solver.GetSystemJacobian())
    N = null_space(jacobian[count:, :count], rcond=1e-10)
    gaps = slice(0, 6 * len(tree.closures))
    if tree.closures:
        N = N @ null_space(
            motion(q, N, min(_GAP_STEP, 10 * steps[0]))[gaps], rcond=_RANK
        )
    K = N.T @ jacobian[:count, :count] @ N
    Z = N @ np.linalg.eigh((K + K.T) / 2)[1]
    K = _held(model, stiffness(q, Z, steps[-1]), motion(q, Z, steps[-1])[gaps.stop :])
    for _ in range(polish):
        q = q - Z @ _solve(K, Z.T @ forces(q))
    K = without_squares(steps, [stiffness(q, Z, step) for step in steps])
    V = without_squares(steps, [motion(q, Z, step)[gaps.stop :] for step in steps])
    compliances = [_by_modes(model, *pair) for pair in zip(K, V, strict=True)]
    size = np.sqrt(np.abs(np.diag(compliances[-1])))
    units = np.outer(size, size)
    C, change = steadiest(compliances, lambda change: float((change / units).max()))
    return C, float((change / units).max()), _is_stable(model, K[-1], V[-1])


def _is_stable(model: Model, K: NDArray, V: NDArray) -> bool:
    """Return whether the equilibrium is stable, given the uncertainty of K."""
    # The computed stiffness of free motions is a rounding error of either sign, so a
    # small stiffness is added.
    K = K + 1e3 * model.regularisation.idle * V[6:].T @ V[6:]
    size = 1.0 / np.sqrt(np.abs(np.diag(K)))
    scaled = (K + K.T) / 2 * np.outer(size, size)
    return bool(np.linalg.eigvalsh(scaled)[0] > -_RANK)


def _held(model: Model, K: NDArray, V: NDArray) -> NDArray:
    """Return the modal stiffness with the weak springs."""
    return K + model.regularisation.idle * V[6:].T @ V[6:]


def _by_modes(model: Model, K: NDArray, V: NDArray) -> NDArray:
    """Return the compliance from the modal stiffness without weak springs."""
    whole = V @ _solve(_held(model, K, V), V.T)
    k, coupled = model.regularisation.idle, whole[:6, 6:]
    held, ways = np.linalg.eigh(np.eye(len(whole) - 6) - k * whole[6:, 6:])
    # Motions that only weak springs resist, such as the rotation of a rod about its
    # axis, do not move the platform.
    ways, held = ways[:, held > _ROLLS], held[held > _ROLLS]
    ways = coupled @ ways / np.sqrt(held)
    return whole[:6, :6] + k * ways @ ways.T


def _solve(K: NDArray, right: NDArray) -> NDArray:
    """Solve K x = right for stiffnesses of very different magnitudes."""
    K = (K + K.T) / 2
    size = 1.0 / np.sqrt(np.abs(np.diag(K)))
    scaled = K * np.outer(size, size)
    return (size * np.linalg.solve(scaled, (size * right.T).T).T).T


def _motion(
    model: Model, tree: OpenTree, platform: str, q: NDArray, Z: NDArray, step: float
) -> NDArray:
    """Return the derivatives of closure errors, platform pose and free joints."""
    system, place = model.mbs.systemData, tree.before[platform]

    def read(q: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        system.SetODE2Coordinates(q)
        gaps = [closure_error(model, closure) for closure in tree.closures]
        return np.ravel(gaps), pose(model, place), idle_motions(model, tree.idle)

    rows = []
    for way in Z.T:
        gaps, ahead, idle = read(q + step * way)
        other, back, still = read(q - step * way)
        turn = rotation_vector(ahead[:3, :3] @ back[:3, :3].T)
        rows.append([*(gaps - other), *turn, *(ahead - back)[:3, 3], *(idle - still)])
    return np.array(rows).T / (2 * step)
