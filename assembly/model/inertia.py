"""Moments of inertia of rigid bodies: validation, conversion and addition."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

# mass [kg], centre (3,) [m] and moments of inertia (3, 3) [kg m^2] about that centre
MassProperties = tuple[float, NDArray, NDArray]

# [-] tolerance for rounded moments in files, relative to the largest moment
_ROUNDING = 1e-6
_SIX = (np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2]))


def inertia_matrix(six: ArrayLike) -> NDArray:
    """Return the symmetric inertia matrix (3, 3) for six moments of inertia."""
    J = np.zeros((3, 3))
    J[_SIX] = six
    J[_SIX[::-1]] = six
    return J


def six_moments(J: NDArray) -> list[float]:
    """Return the moments Ixx, Iyy, Izz, Ixy, Ixz, Iyz of an inertia matrix."""
    return [float(value) for value in J[_SIX]]


def inertia_fault(J: NDArray) -> str:
    """Check that moments of inertia are physically possible.

    Args:
        J: moments of inertia (3, 3) [kg m^2].

    Returns:
        Message with the values found and expected, or an empty string if the moments
        are valid.
    """
    if not np.abs(J - J.T).max() <= _ROUNDING * np.abs(J).max():
        return "found a matrix that is not symmetric, expected a symmetric matrix"
    least, middle, most = np.linalg.eigvalsh(J)
    rounding = _ROUNDING * max(most, 0.0)
    if least < -rounding or most > least + middle + rounding:
        return (
            f"found principal moments {least:.4g}, {middle:.4g}, {most:.4g}; expected "
            "nonnegative moments, none of which exceeds the sum of the other two"
        )
    return ""


def point_inertia(mass: float, arm: NDArray) -> NDArray:
    """Return the inertia matrix [kg m^2] of a point mass [kg] at ``arm`` [m]."""
    return np.asarray(mass * (arm @ arm * np.eye(3) - np.outer(arm, arm)))


def joined_bodies(parts: Sequence[MassProperties]) -> MassProperties:
    """Combine the mass properties of bodies that form one rigid body.

    Args:
        parts: mass, centre and moments of inertia of each body, in common axes.

    Returns:
        Mass, centre and moments of inertia of the rigid body, from the parallel axis
        theorem.  If the mass is zero, the centre is the origin.
    """
    masses, centres = [mass for mass, _, _ in parts], [at for _, at, _ in parts]
    total, centre, J = float(sum(masses)), np.zeros(3), np.zeros((3, 3))
    if total:
        centre = np.asarray(np.average(centres, axis=0, weights=masses))
    for mass, at, own in parts:
        J += own + point_inertia(mass, at - centre)
    return total, centre, J
