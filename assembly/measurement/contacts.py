"""Contact springs in series with joints: load = coefficient |deflection|^exponent."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exact.exact import ExactAssembly
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.measurement.conditions import Conditions, ContactLaw
from forcefit.assembly.model.links import in_series, own_screw

ITERATIONS = 100  # largest number of Newton iterations
CONVERGED = 1e-11  # largest relative change of a deflection at convergence


def softened(
    posture: Posture, laws: tuple[ContactLaw, ...], compliances: NDArray
) -> Posture:
    """Return a posture whose joints include the secant compliance of each contact."""
    if not compliances.any():
        return posture
    frames = list(posture.robot.frames)
    for law, compliance in zip(laws, compliances, strict=True):
        i = posture.robot.index(law.frame)
        f = frames[i]
        K = in_series(f.joint_stiffness, f.own_axis, float(compliance))
        frames[i] = replace(f, joint_stiffness=K)
    return replace(posture, robot=replace(posture.robot, frames=tuple(frames)))


def secants(
    assembly: Assembly | ExactAssembly, laws: tuple[ContactLaw, ...]
) -> NDArray:
    """Return the secant compliance [rad/(N m), m/N] of each contact at its load."""
    robot = assembly.posture.robot
    compliances = []
    for law in laws:
        i = robot.index(law.frame)
        load = abs(wrenches_through(assembly)[i] @ own_screw(robot.frames[i]))
        compliances.append(_deflection(law, load) / load if load > 1e-300 else 0.0)
    return np.array(compliances)


def _deflection(law: ContactLaw, load: float) -> float:
    """Return the deflection [rad or m] of a contact under a load >= 0."""
    return float((load / law.coefficient) ** (1 / law.exponent))


def wrenches_through(assembly: Assembly | ExactAssembly) -> NDArray:
    """Return the wrenches through all joints in frame axes, (n, 6) [N m, N]."""
    return assembly.joint_wrenches


def contact_columns(conditions: Conditions) -> NDArray:
    """Return the unit screws of the deflections of s contact springs, (6n, s)."""
    columns = np.zeros((6 * len(conditions.robot.frames), len(conditions.laws)))
    for k, law in enumerate(conditions.laws):
        i = conditions.robot.index(law.frame)
        columns[6 * i : 6 * i + 6, k] = own_screw(conditions.robot.frames[i])
    return columns


def contact_deflections(
    laws: tuple[ContactLaw, ...], w: NDArray, A: NDArray
) -> tuple[NDArray, NDArray]:
    """Solve for the contact deflections d with c |d|^n sign(d) = w + A d.

    The matrix A is negative semidefinite, so the solution is unique.  Steps of Newton's
    method are halved until the gradient decreases.

    Returns:
        (R, s) deflections; and (R,) bool, True where the iteration converged.
    """
    c = np.array([law.coefficient for law in laws])
    n = np.array([law.exponent for law in laws])
    scale = np.abs(w).max(axis=1, keepdims=True) + 1e-300

    def gradient(d: NDArray) -> NDArray:
        own = c * np.abs(d) ** n * np.sign(d)
        return (own - w - np.einsum("rij,rj->ri", A, d)) / scale

    d = np.sign(w) * (np.abs(w) / c) ** (1 / n)
    residual = gradient(d)
    tiny = 1e-9 * np.abs(A).max(initial=0.0) + 1e-300
    for _ in range(ITERATIONS):
        norm = np.linalg.norm(residual, axis=1)
        if np.all(norm <= CONVERGED):
            break
        slope = c * n * np.abs(d) ** (n - 1) + tiny
        H = np.einsum("ri,ij->rij", slope, np.eye(len(c))) - A
        step = -np.linalg.solve(H, (residual * scale)[..., None])[..., 0]
        length = np.where(norm <= CONVERGED, 0.0, 1.0)
        for _ in range(30):
            trial = gradient(d + length[:, None] * step)
            worse = (np.linalg.norm(trial, axis=1) > norm) & (length > 0)
            if not worse.any():
                break
            length = np.where(worse, length / 2, length)
        d, residual = d + length[:, None] * step, trial
    return d, np.linalg.norm(residual, axis=1) <= 1e-8
