"""Small vibrations of an Exudyn model about its equilibrium.

Exudyn linearises the model and projects it onto the motions that its joints allow. Only
bodies with a given mass have inertia, so the mass matrix is singular: degrees of
freedom without inertia are condensed instead of having an infinite frequency.
"""

import numpy as np
from numpy.typing import NDArray

from validation.multibody.exudyn_model import Model
from validation.multibody.exudyn_parts import Place

# Exudyn's order of the six entries of an inertia tensor
_SIX = (np.array([0, 1, 2, 1, 0, 0]), np.array([0, 1, 2, 2, 2, 1]))
_NOTHING = 1e-12  # relative to the largest inertia: smaller ones count as zero


def set_masses(model: Model, bodies: list[tuple[Place, float]]) -> None:
    """Set point masses of the model's rigid bodies instead of their initial masses.

    Args:
        model: model in equilibrium.
        bodies: place of each mass, and the mass [kg].
    """
    for item in range(model.mbs.systemData.NumberOfObjects()):
        if model.mbs.GetObject(item)["objectType"] == "RigidBody":
            _set_mass(model, item, [(p, m) for p, m in bodies if m and p.body == item])


def _set_mass(model: Model, body: int, points: list[tuple[Place, float]]) -> None:
    """Set mass, centre and inertia about the reference point of one body."""
    mass = sum(m for _, m in points)
    centres = np.array([p.local[:3, 3] for p, _ in points]).reshape(-1, 3)
    masses = np.array([m for _, m in points])
    inertia = np.zeros((3, 3))
    for m, c in zip(masses, centres, strict=True):
        inertia += m * (c @ c * np.eye(3) - np.outer(c, c))
    centre = masses @ centres / mass if mass else np.zeros(3)
    model.mbs.SetObjectParameter(body, "mass", mass)
    model.mbs.SetObjectParameter(body, "centerOfMass", centre)
    model.mbs.SetObjectParameter(body, "inertia", inertia[_SIX].tolist())


def natural_frequencies(model: Model) -> NDArray:
    """Return the (k,) [Hz] natural frequencies of a solved model, lowest first.

    Args:
        model: model in its equilibrium.

    Returns:
        One frequency for each inertia.
    """
    M, K, *_ = model.mbs.ComputeLinearizedSystem(projectIntoConstraintNullspace=True)
    M, K = (M + M.T) / 2, (K + K.T) / 2
    shift = 1e-6 * np.trace(K) / np.trace(M)
    values, vectors = np.linalg.eigh(K + shift * M)
    kept = values > 1e-15 * values.max()
    root = vectors[:, kept] / np.sqrt(values[kept])
    inverse = np.linalg.eigvalsh(root.T @ M @ root)[::-1]
    inverse = inverse[inverse > _NOTHING * inverse.max()]
    return np.sqrt(np.maximum(1.0 / inverse - shift, 0.0)) / (2 * np.pi)
