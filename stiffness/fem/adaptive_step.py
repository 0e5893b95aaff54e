"""One step of adaptive mesh refinement.

The error estimate is the error indicator of
:mod:`forcefit.stiffness.fem.error_indicator` times an effectivity index. This index is
the change of the stiffness in the last refinement divided by the change of the
indicator.

The stiffness K_h on a mesh is an upper bound on the exact stiffness K. If E is an upper
bound on the error, K is between K_h - E and K_h. The result is the midpoint of this
interval, whose error is at most E / 2.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from forcefit.stiffness.fem.condensation import Condensed, condense
from forcefit.stiffness.fem.elements import ORDER, Elements, isoparametric
from forcefit.stiffness.fem.error_indicator import (
    error_matrices,
    geometry_errors,
    material_errors,
    traction_errors,
)
from forcefit.stiffness.fem.material import (
    Material,
    material_at,
    material_of_elements,
    regions_of,
)
from forcefit.stiffness.fem.quality import volume_error
from forcefit.stiffness.link import scaled
from forcefit.stiffness.mesh.curved_elements import refine_inverted
from forcefit.stiffness.mesh.edge_grading import (
    ENDS,
    graded_edges,
    layered,
    split_joining_edges,
)
from forcefit.stiffness.mesh.improve import fitted
from forcefit.stiffness.mesh.refine import refine
from forcefit.stiffness.mesh.regions import is_jagged
from forcefit.stiffness.mesh.solid import Solid

# Effectivity index on the first mesh, where it cannot be computed. Computed indices
# range from 0.6 to 1.1 for the training parts of
# benchmarks/evidence/stiffness_random_parts.py.
DEFAULT_EFFECTIVITY = 2.0
SAFETY_FACTOR = 1.3


@dataclass(frozen=True, eq=False)
class Level:
    """Solution on a mesh.

    Attributes:
        solid: straight tetrahedra.
        mesh: cubic elements. Tetrahedra at singular edges are divided into several
            elements.
        material: (t, 3) lambda [Pa], mu [Pa], density [kg/m^3] of each element.
        solution: condensed stiffness and fields.
        errors: (s, 6, 6) error indicator of each tetrahedron: its contribution to K_h -
            K, without the effectivity index.
        geometry_errors: (s, 6, 6) error of each tetrahedron due to its approximate
            geometry.
        volume_error: [1] relative difference between the volumes of mesh and part.
    """

    solid: Solid
    mesh: Elements
    material: NDArray
    solution: Condensed
    errors: NDArray
    geometry_errors: NDArray
    volume_error: float = 0.0

    def totals(self) -> tuple[NDArray, NDArray, NDArray]:
        """Return the stiffness and the total errors of a mesh, each (6, 6)."""
        return (
            self.solution.stiffness,
            self.errors.sum(axis=0),
            self.geometry_errors.sum(axis=0),
        )


def solve_level(
    solid: Solid,
    materials: Sequence[Material],
    centers: NDArray,
    interface: str,
    check: Callable[[int], None] | None = None,
) -> Level:
    """Compute the stiffness and the error indicators on a mesh.

    Args:
        solid: straight tetrahedra. Tetrahedra that would be inverted when curved, or
            that touch two singular edges, are bisected first.
        materials: materials of the link. The first material is used outside the regions
            of the other materials.
        centers: (2, 3) [m] centres of the base and the tip interface.
        interface: kind of the interfaces, one of ``KINDS``.
        check: callback that is called with the number of unknowns before the solution.

    Returns:
        The solution.

    Raises:
        BadInput: no material is given for the whole link.
    """
    regions = regions_of(materials)
    finer = split_joining_edges(refine_inverted(solid, ORDER), ENDS, regions)
    solid = fitted(finer)
    parts = layered(solid, ENDS, regions=regions)
    mesh = isoparametric(solid, ORDER, parts)
    if check is not None:
        check(3 * len(mesh.nodes))
    region = None if solid.region is None else solid.region[parts.parent]
    material = material_of_elements(mesh, materials, region)
    lam, mu = material[:, 0], material[:, 1]
    solution = condense(mesh, lam, mu, centers, interface)
    on_edge = np.zeros(len(mesh.nodes), dtype=bool)
    on_edge[graded_edges(solid, ENDS, regions)] = True
    singular = on_edge[mesh.cells[:, :4]].any(axis=1)
    indicated = error_matrices(
        mesh, solution.fields, lam, mu, singular, solution.stiffness
    )
    # residual surface tractions overestimate the error by a factor of 2 at singular
    # edges, so they are not used there
    free = np.flatnonzero((mesh.patch > max(ENDS)) & ~singular[mesh.owner])
    residual = np.zeros_like(indicated)
    tractions = traction_errors(mesh, solution.fields, lam, mu, free)
    np.add.at(residual, mesh.owner[free], tractions)
    sizes = 1 / np.diag(solution.stiffness)
    # both indicators estimate the same error, so the larger one is used
    larger = np.einsum("tii,i->t", residual - indicated, sizes) > 0
    indicated[larger] = residual[larger]
    errors, geometry = np.zeros((2, len(solid.cells), 6, 6))
    np.add.at(errors, parts.parent, indicated)
    by_face = geometry_errors(
        mesh, solid.shapes, solution.fields, lam, mu, solid.surface
    )
    np.add.at(geometry, parts.parent[mesh.owner], by_face)
    if is_jagged(solid, regions):
        jagged = material_errors(
            mesh, solution.fields, lam, mu, lambda p: material_at(p, materials)[:, 1]
        )
        np.add.at(geometry, parts.parent, jagged)
    off = volume_error(solid, mesh)
    return Level(solid, mesh, material, solution, errors, geometry, off)


def estimated_error(
    history: Sequence[tuple[NDArray, NDArray, NDArray]],
) -> tuple[NDArray, float]:
    """Estimate the error of the stiffness on the finest mesh.

    Args:
        history: stiffness, error indicator and geometry error of each mesh, from coarse
            to fine, as returned by :func:`totals`.

    Returns:
        Estimate of K_h - K without the geometry error, (6, 6), and the largest
        effectivity index, including a safety factor.
    """
    K, indicated, _ = history[-1]
    factors = np.full(6, DEFAULT_EFFECTIVITY)
    if len(history) > 1:
        coarse, indicated_before, _ = history[-2]
        drop = np.diag(indicated_before - indicated)
        effectivity = np.full(6, DEFAULT_EFFECTIVITY)
        np.divide(np.diag(coarse - K), drop, out=effectivity, where=drop > 0)
        factors = SAFETY_FACTOR * np.clip(effectivity, 1.0, 2 * DEFAULT_EFFECTIVITY)
    # each tip motion has its own effectivity index, because bending and torsion have
    # different errors
    root = np.sqrt(factors)
    estimate = np.outer(root, root) * indicated
    worst = int(np.argmax(np.diag(estimate) / np.diag(K)))
    return estimate, float(factors[worst])


def middle_stiffness(
    K_h: NDArray, E: NDArray, geometry: NDArray
) -> tuple[NDArray, NDArray]:
    """Return the midpoint between upper and lower bound on the exact stiffness.

    Args:
        K_h: (6, 6) stiffness on a mesh, which is the upper bound.
        E: (6, 6) estimated error of K_h, positive semidefinite.
        geometry: (6, 6) estimated error due to the approximate geometry, of either
            sign.

    Returns:
        Stiffness K_h - E / 2, (6, 6), and the magnitude of its error, (6, 6). For a
        motion with a large error, less is subtracted, so that at least half of K_h
        remains.
    """
    largest = eigh(scaled(E, K_h), scaled(K_h, K_h), eigvals_only=True)[-1]
    part = 0.5 / max(1.0, largest)
    # the geometry error may be positive or negative, so its magnitude is added
    return K_h - part * E, (1 - part) * E + np.abs(geometry)


def refine_level(level: Level, growth: float) -> Solid:
    """Bisect the elements with the largest error indicators.

    Args:
        level: the mesh to refine.
        growth: factor by which the bisection of selected elements increases the number
            of elements. Their neighbours are bisected too, so that the mesh is
            conforming, and the total factor is about growth^2.

    Returns:
        The refined mesh.
    """
    shares = np.einsum(
        "tii,i->t",
        level.errors + np.abs(level.geometry_errors),
        1 / np.diag(level.solution.stiffness),
    )
    shares = np.maximum(shares, 1e-12 * shares.max())

    def halvings(limit: float) -> NDArray:
        # A bisection reduces the error of an element by at least a factor of 2^1.5. The
        # error of elements of size h is proportional to a power of h between 4 and 7.
        return np.clip(np.round(np.log2(shares) / 1.5 - limit), 0, 6).astype(int)

    low, high = -200.0, 200.0
    for _ in range(50):
        middle = (low + high) / 2
        grown = (2.0 ** halvings(middle)).sum()
        low, high = (middle, high) if grown > growth * len(shares) else (low, middle)
    return refine(level.solid, halvings(high)).solid
