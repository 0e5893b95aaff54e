"""One step of adaptive refinement: solve, estimate the error, mark, refine.

The error indicator (:mod:`forcefit.stiffness.fem.error_indicator`) is multiplied by an
effectivity index, which is the change of the stiffness in the last refinement divided
by the change of the indicator.

K_h is an upper bound on the exact stiffness K, and the estimate E bounds the
difference, so K lies between K_h - E and K_h. The midpoint of this interval is
returned, because its error is at most half of E on the same mesh.
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

# Effectivity index assumed on the first mesh, where it cannot be computed. Measured
# values range from 0.6 to 1.1 on the training parts of
# benchmarks/evidence/stiffness_random_parts.py.
DEFAULT_EFFECTIVITY = 2.0
SAFETY_FACTOR = 1.3


@dataclass(frozen=True, eq=False)
class Level:
    """Solution on one mesh.

    Attributes:
        solid: solid of straight tetrahedra.
        mesh: cubic elements, which are parts of the tetrahedra along singular edges.
        material: (t, 3) lambda [Pa], mu [Pa], density [kg/m^3] of each element.
        solution: condensed stiffness and fields.
        errors: (s, 6, 6) local error indicators: contribution of each tetrahedron of
            the solid to K_h - K, before multiplication by the effectivity index.
        geometry_errors: (s, 6, 6) local geometry errors of curved elements.
        volume_error: [1] relative difference of the volumes of elements and part.
    """

    solid: Solid
    mesh: Elements
    material: NDArray
    solution: Condensed
    errors: NDArray
    geometry_errors: NDArray
    volume_error: float = 0.0

    def totals(self) -> tuple[NDArray, NDArray, NDArray]:
        """Return the (6, 6) stiffness, its indicated error and its geometry error."""
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
    """Compute the stiffness, fields and local error indicators on one mesh.

    Args:
        solid: straight tetrahedra, of which those that would be inverted when curved,
            or that touch two singular edges, are bisected first.
        materials: materials; the first fills the link, later ones fill their regions.
        centers: (2, 3) [m] centres of base and tip.
        interface: kind of the interfaces, one of ``KINDS``.
        check: callback that receives the number of unknowns before the solution.

    Returns:
        The solution on cubic elements with a layer along the singular edges.

    Raises:
        BadInput: no material fills the link.
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
    # at singular edges s_3 is reliable, whereas tractions overestimate the error by a
    # factor of 2
    free = np.flatnonzero((mesh.patch > max(ENDS)) & ~singular[mesh.owner])
    residual = np.zeros_like(indicated)
    tractions = traction_errors(mesh, solution.fields, lam, mu, free)
    np.add.at(residual, mesh.owner[free], tractions)
    sizes = 1 / np.diag(solution.stiffness)
    # two indicators, inside and at the surface, estimate the same error; use the larger
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
    """Estimate the error of the stiffness on the last mesh.

    Args:
        history: totals of the :class:`Level` of each mesh, finest last.

    Returns:
        (6, 6) estimate of K_h minus the exact stiffness, without the geometry error,
        and the effectivity index of the worst motion. The index is the change of the
        stiffness in the last refinement divided by the change of the indicated error,
        times a safety factor.
    """
    K, indicated, _ = history[-1]
    factors = np.full(6, DEFAULT_EFFECTIVITY)
    if len(history) > 1:
        coarse, indicated_before, _ = history[-2]
        drop = np.diag(indicated_before - indicated)
        effectivity = np.full(6, DEFAULT_EFFECTIVITY)
        np.divide(np.diag(coarse - K), drop, out=effectivity, where=drop > 0)
        factors = SAFETY_FACTOR * np.clip(effectivity, 1.0, 2 * DEFAULT_EFFECTIVITY)
    # one index per motion, because errors in torsion and in bending occur at different
    # places
    root = np.sqrt(factors)
    estimate = np.outer(root, root) * indicated
    worst = int(np.argmax(np.diag(estimate) / np.diag(K)))
    return estimate, float(factors[worst])


def middle_stiffness(
    K_h: NDArray, E: NDArray, geometry: NDArray
) -> tuple[NDArray, NDArray]:
    """Return the midpoint of the interval that contains the exact stiffness.

    Args:
        K_h: (6, 6) stiffness of a mesh, an upper bound except for the geometry error.
        E: (6, 6) estimate of the error of K_h, positive semidefinite.
        geometry: (6, 6) indicated geometry error, of either sign.

    Returns:
        (6, 6) stiffness K_h - E / 2, and (6, 6) magnitude of its error. If less than
        half of K_h would remain for a motion, a smaller part of E is subtracted there.
    """
    largest = eigh(scaled(E, K_h), scaled(K_h, K_h), eigvals_only=True)[-1]
    part = 0.5 / max(1.0, largest)
    # geometry errors of opposite sign may cancel in K, but not in the estimate
    return K_h - part * E, (1 - part) * E + np.abs(geometry)


def refine_level(level: Level, growth: float) -> Solid:
    """Bisect the elements with the largest local error indicators.

    Args:
        level: the mesh to refine.
        growth: factor on the number of selected elements. A conforming mesh requires
            that neighbours are bisected too, so the total factor is about growth^2.

    Returns:
        The finer mesh.
    """
    shares = np.einsum(
        "tii,i->t",
        level.errors + np.abs(level.geometry_errors),
        1 / np.diag(level.solution.stiffness),
    )
    shares = np.maximum(shares, 1e-12 * shares.max())

    def halvings(limit: float) -> NDArray:
        # the error of an element decreases as h^4 to h^7, and thus by at least 2^1.5
        # per bisection
        return np.clip(np.round(np.log2(shares) / 1.5 - limit), 0, 6).astype(int)

    low, high = -200.0, 200.0
    for _ in range(50):
        middle = (low + high) / 2
        grown = (2.0 ** halvings(middle)).sum()
        low, high = (middle, high) if grown > growth * len(shares) else (low, middle)
    return refine(level.solid, halvings(high)).solid
