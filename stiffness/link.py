"""Stiffness of a link and its estimated error."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.inputs.table import BadInput
from forcefit.results.display import Figures, html_table, numbers, short_repr

# relative round-off error of the eigenvalues of a 6 by 6 matrix
_ROUNDING = 6 * np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class LinkStiffness:
    """Stiffness of an elastic link between two interfaces.

    The base is clamped, and a wrench acts on the tip: ``screw = compliance @ wrench``.
    Screw and wrench refer to the point ``tip``.

    Attributes:
        method: computation method, such as ``"Timoshenko beam"``.
        compliance: (6, 6) [rad/(N m) .. m/N] compliance, symmetric and positive
            definite.
        tip: (3,) [m] reference point of screws and wrenches.
        base: (3,) [m] centre of the clamped interface.
        stiffness_error: (6, 6) [N m/rad .. N/m] estimated error of ``stiffness``; zero
            for beam theory.
        mesh: size and quality of the mesh; empty for beam theory.
        mass: [kg] mass of the link; 0 if no density was given.
        center_of_mass: (3,) [m] position of the centre of mass.
        inertia: (3, 3) [kg m^2] inertia about the centre of mass.
        stiffness: (6, 6) [N m/rad .. N/m] inverse of the compliance.
    """

    method: str
    compliance: NDArray
    tip: NDArray
    base: NDArray
    stiffness_error: NDArray = field(default_factory=lambda: np.zeros((6, 6)))
    mesh: Mapping[str, Any] = field(default_factory=dict)
    mass: float = 0.0
    center_of_mass: NDArray = field(default_factory=lambda: np.zeros(3))
    inertia: NDArray = field(default_factory=lambda: np.zeros((3, 3)))
    stiffness: NDArray = field(init=False)

    __repr__, _repr_html_, summary = short_repr, html_table, short_repr

    def _figures(self) -> Figures:
        """Return the values in the short description of a link."""
        K = np.diag(self.stiffness)
        error = self.relative_error_estimate
        figures = {
            "method": self.method,
            "tip": f"{numbers(self.tip)} m",
            "base": f"{numbers(self.base)} m",
            "diagonal of K": f"{numbers(K[:3])} N m/rad, {numbers(K[3:])} N/m",
            "largest relative error": f"{error:.2g}" if error else "closed form",
        }
        if self.mesh:
            figures["mesh"] = f"{self.mesh['elements']} elements"
        return figures | ({"mass": f"{self.mass:.5g} kg"} if self.mass > 0 else {})

    def __post_init__(self) -> None:
        shapes = {
            "compliance": (6, 6),
            "tip": (3,),
            "base": (3,),
            "stiffness_error": (6, 6),
            "center_of_mass": (3,),
            "inertia": (3, 3),
        }
        for name, shape in shapes.items():
            array = np.array(getattr(self, name), dtype=float)
            if array.shape != shape or not np.isfinite(array).all():
                raise BadInput(
                    f"link ({self.method}): {name} has shape {array.shape}, "
                    f"expected {shape} of finite numbers"
                )
            self._store(name, array)
        check_definite(f"link ({self.method}): compliance", self.compliance)
        self._store("compliance", (self.compliance + self.compliance.T) / 2)
        self._store("stiffness", inverted(self.compliance))
        object.__setattr__(self, "mesh", MappingProxyType(dict(self.mesh)))

    def _store(self, name: str, array: NDArray) -> None:
        """Store an array as a read-only attribute."""
        array.setflags(write=False)
        object.__setattr__(self, name, array)

    @property
    def relative_errors(self) -> NDArray:
        """Estimated error of each entry K_ij, divided by sqrt(K_ii K_jj), (6, 6)."""
        return np.abs(scaled(self.stiffness_error, self.stiffness))

    @property
    def relative_error_estimate(self) -> float:
        """Largest entry of :attr:`relative_errors`."""
        return float(self.relative_errors.max())


def scaled(matrix: ArrayLike, stiffness: ArrayLike) -> NDArray:
    """Divide the entries of a matrix by sqrt(K_ii K_jj).

    Args:
        matrix: (6, 6) stiffness, or difference between two stiffnesses.
        stiffness: (6, 6) stiffness K.

    Returns:
        (6, 6) [1] scaled matrix.
    """
    diagonal = np.sqrt(np.diag(np.asarray(stiffness, dtype=float)))
    return np.asarray(matrix, dtype=float) / np.outer(diagonal, diagonal)


def check_definite(who: str, matrix: NDArray) -> None:
    """Check that a matrix is symmetric and positive definite.

    Args:
        who: description of the matrix, for error messages.
        matrix: (6, 6) stiffness or compliance.

    Raises:
        BadInput: the matrix is not symmetric within a relative difference of 1e-6, or
            not positive definite.
    """
    if not np.all(np.diag(matrix) > 0):
        raise BadInput(f"{who} is not positive definite: a diagonal entry is <= 0")
    unit = scaled(matrix, matrix)
    row, column = np.unravel_index(np.argmax(np.abs(unit - unit.T)), unit.shape)
    if abs(unit[row, column] - unit[column, row]) > 1e-6:
        raise BadInput(
            f"{who} is not symmetric: [{row}, {column}] = {matrix[row, column]:.6e} "
            f"but [{column}, {row}] = {matrix[column, row]:.6e}"
        )
    smallest = np.linalg.eigvalsh((unit + unit.T) / 2)[0]
    if smallest <= _ROUNDING:
        raise BadInput(
            f"{who} is not positive definite: smallest eigenvalue of the scaled "
            f"matrix is {smallest:.1e}"
        )


def inverted(matrix: NDArray) -> NDArray:
    """Invert a stiffness or a compliance.

    Args:
        matrix: (6, 6) stiffness or compliance.

    Returns:
        (6, 6) inverse, which is exactly symmetric.
    """
    size = np.sqrt(np.diag(matrix))
    unit = np.linalg.inv(matrix / np.outer(size, size))
    return (unit + unit.T) / 2 / np.outer(size, size)


def turn_link(link: LinkStiffness, rotation: ArrayLike) -> LinkStiffness:
    """Express a link in rotated axes.

    Args:
        link: the link.
        rotation: (3, 3) rotation matrix whose columns are the old axes, expressed in
            the new axes.

    Returns:
        The link in the new axes.

    Raises:
        BadInput: the matrix is not a rotation.
    """
    R = np.asarray(rotation, dtype=float)
    proper = R.shape == (3, 3) and np.allclose(R @ R.T, np.eye(3), rtol=0, atol=1e-9)
    if not proper or np.linalg.det(R) < 0:
        raise BadInput(
            "turn_link: found a 3 by 3 matrix that is not a rotation, expected a "
            "rotation matrix"
        )
    A = np.kron(np.eye(2), R)
    return replace(
        link,
        compliance=A @ link.compliance @ A.T,
        stiffness_error=A @ link.stiffness_error @ A.T,
        tip=R @ link.tip,
        base=R @ link.base,
        center_of_mass=R @ link.center_of_mass,
        inertia=R @ link.inertia @ R.T,
    )
