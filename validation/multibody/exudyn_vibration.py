"""Compute small vibrations of an Exudyn model about its equilibrium.

Exudyn linearises the model by forward differences and projects it onto the motions that
its joints allow.  Differences with two step sizes are combined such that their
first-order errors cancel.  Only bodies with a given mass or given moments of inertia
contribute to the mass matrix.  Degrees of freedom without inertia are condensed
statically.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.multibody.exudyn_model import Model
from forcefit.validation.multibody.exudyn_parts import Place

_SIX = (np.array([0, 1, 2, 1, 0, 0]), np.array([0, 1, 2, 2, 2, 1]))  # Exudyn's order
_STEP = 1e-5  # [-] step of the finite differences
_NOTHING = 1e-12  # inertias below this fraction of the largest inertia are set to 0


def set_masses(model: Model, bodies: list[tuple[Place, float, NDArray]]) -> None:
    """Replace the masses of the model's rigid bodies.

    Args:
        model: solved model.
        bodies: body frame at the centre of mass, mass [kg], and inertia tensor (3, 3)
            [kg m^2] about this centre in the axes of the body frame, for each body.
    """
    for item in range(model.mbs.systemData.NumberOfObjects()):
        if model.mbs.GetObject(item)["objectType"] == "RigidBody":
            _set_mass(model, item, [body for body in bodies if body[0].body == item])


def _set_mass(
    model: Model, body: int, parts: list[tuple[Place, float, NDArray]]
) -> None:
    """Set the mass, the centre of mass and the inertia tensor of a body."""
    mass, moment, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    for place, m, J in parts:
        c, R = place.local[:3, 3], place.local[:3, :3]
        mass, moment = mass + m, moment + m * c
        inertia += m * (c @ c * np.eye(3) - np.outer(c, c)) + R @ J @ R.T
    centre = moment / mass if mass else np.zeros(3)
    model.mbs.SetObjectParameter(body, "mass", mass)
    model.mbs.SetObjectParameter(body, "centerOfMass", centre)
    model.mbs.SetObjectParameter(body, "inertia", inertia[_SIX].tolist())


def natural_frequencies(model: Model) -> NDArray:
    """Return the natural frequencies of a model, lowest first, (k,) [Hz].

    Args:
        model: model in its equilibrium.

    Returns:
        One frequency for each degree of freedom with inertia.
    """
    (M, once), (_, twice) = (_linearised(model, step) for step in (_STEP, 2 * _STEP))
    K = 2 * once - twice
    M, K = (M + M.T) / 2, (K + K.T) / 2
    shift = 1e-6 * np.trace(K) / np.trace(M)
    values, vectors = np.linalg.eigh(K + shift * M)
    kept = values > 1e-15 * values.max()
    root = vectors[:, kept] / np.sqrt(values[kept])
    inverse = np.linalg.eigvalsh(root.T @ M @ root)[::-1]
    inverse = inverse[inverse > _NOTHING * inverse.max()]
    return np.sqrt(np.maximum(1.0 / inverse - shift, 0.0)) / (2 * np.pi)


def _linearised(model: Model, step: float) -> tuple[NDArray, NDArray]:
    """Return mass and stiffness matrices for the motions that the joints allow."""
    settings = model.exu.SimulationSettings()
    newton = settings.staticSolver.newton
    newton.numericalDifferentiation.relativeEpsilon = step
    M, K, *_ = model.mbs.ComputeLinearizedSystem(
        simulationSettings=settings, projectIntoConstraintNullspace=True
    )
    return M, K
