"""One mesh's answer: a link's stiffness, how wrong it is, and where to refine.

What the elements indicate (:mod:`stiffness.fem.error_indicator`) is scaled by what the
last refinement did to the stiffness, compared with what it did to the indication.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stiffness.fem.condensation import Condensed, condense
from stiffness.fem.elements import ORDER, Elements, isoparametric
from stiffness.fem.error_indicator import error_matrices, shape_errors, traction_errors
from stiffness.fem.material import Material, material_of_elements
from stiffness.mesh.curved_elements import without_folds
from stiffness.mesh.edge_grading import ENDS, layered, singular_edges, without_chords
from stiffness.mesh.mesh import Solid
from stiffness.mesh.refine import refine

# true over indicated error of a first mesh was 0.6 to 1.1 on the training parts of
# benchmarks/stiffness_random_parts.py
_BLIND = 2.0
_SAFETY = 1.3


@dataclass(frozen=True, eq=False)
class Level:
    """One mesh's answer.

    Attributes:
        solid: straight tetrahedra.
        mesh: cubic elements, parts of the tetrahedra along singular edges.
        material: (t, 3) lambda [Pa], mu [Pa], density [kg/m^3] of each element.
        solution: condensed stiffness and fields.
        errors: (s, 6, 6) each of the solid's tetrahedra's estimated share of K_h - K,
            before it is compared with another mesh's.
        shape_errors: (s, 6, 6) the same for what the elements leave of the shapes.
    """

    solid: Solid
    mesh: Elements
    material: NDArray
    solution: Condensed
    errors: NDArray
    shape_errors: NDArray

    def totals(self) -> tuple[NDArray, NDArray, NDArray]:
        """(6, 6) the stiffness, its indicated error and that of the shapes."""
        return (
            self.solution.stiffness,
            self.errors.sum(axis=0),
            self.shape_errors.sum(axis=0),
        )


def solve_level(
    solid: Solid, materials: Sequence[Material], centers: NDArray, interface: str
) -> Level:
    """Stiffness, fields and error shares of one mesh.

    Args:
        solid: straight tetrahedra; those that would fold when bent, or that touch two
            singular edges, are halved first.
        materials: the first fills the link, later ones where they say.
        centers: (2, 3) [m] of base and tip.
        interface: one of ``KINDS``.

    Returns:
        The answer, on cubic elements with a layer along the singular edges.

    Raises:
        BadInput: no material fills the link.
    """
    solid = without_chords(without_folds(solid, ORDER), ENDS)
    parts = layered(solid, ENDS)
    mesh = isoparametric(solid, ORDER, parts)
    material = material_of_elements(mesh, materials)
    lam, mu = material[:, 0], material[:, 1]
    solution = condense(mesh, lam, mu, centers, interface)
    on_edge = np.zeros(len(mesh.nodes), dtype=bool)
    on_edge[singular_edges(solid, ENDS)] = True
    singular = on_edge[mesh.cells[:, :4]].any(axis=1)
    each = error_matrices(mesh, solution.fields, lam, mu, singular, solution.stiffness)
    # at singular edges s_3 is known to do; tractions there say twice as much
    free = np.flatnonzero((mesh.patch > max(ENDS)) & ~singular[mesh.owner])
    left = np.zeros_like(each)
    tractions = traction_errors(mesh, solution.fields, lam, mu, free)
    np.add.at(left, mesh.owner[free], tractions)
    sizes = 1 / np.diag(solution.stiffness)
    # the same error seen from inside and from the surface: the larger one, not both
    larger = np.einsum("tii,i->t", left - each, sizes) > 0
    each[larger] = left[larger]
    errors, shape = np.zeros((2, len(solid.cells), 6, 6))
    np.add.at(errors, parts.parent, each)
    off = shape_errors(mesh, solid.shapes, solution.fields, lam, mu)
    np.add.at(shape, parts.parent[mesh.owner], off)
    return Level(solid, mesh, material, solution, errors, shape)


def estimated_error(
    history: Sequence[tuple[NDArray, NDArray, NDArray]],
) -> tuple[NDArray, float]:
    """Error of the last stiffness: what the elements indicate, scaled.

    Args:
        history: of each mesh, finest last, the totals of its :class:`Level`.

    Returns:
        (6, 6) estimate of the exact stiffness minus the last one, and the factor on
        the indicated error that it uses: what the last refinement did to the stiffness
        over what it did to the indicated error, and some more.
    """
    K, indicated, shape = history[-1]
    factors = np.full(6, _BLIND)
    if len(history) > 1:
        coarse, indicated_then, _ = history[-2]
        fell = np.diag(indicated_then - indicated)
        sank = np.diag(coarse - K)
        proved = np.divide(sank, fell, out=np.full(6, _BLIND), where=fell > 0)
        factors = _SAFETY * np.clip(proved, 1.0, 2 * _BLIND)
    # each motion has its own: a twist and a bend err in different places
    root = np.sqrt(factors)
    told = np.outer(root, root) * indicated
    worst = int(np.argmax(np.diag(told) / np.diag(K)))
    # what leaves the shapes outward and inward may cancel in K, not in the estimate
    return -told - np.abs(shape), float(factors[worst])


def finer(level: Level, growth: float) -> Solid:
    """Halve the elements with the largest shares of the error.

    Args:
        level: the mesh to refine.
        growth: of the count of elements, before neighbours are halved too (with them
            it is about its square).

    Returns:
        The finer mesh.
    """
    shares = np.einsum(
        "tii,i->t",
        level.errors + np.abs(level.shape_errors),
        1 / np.diag(level.solution.stiffness),
    )
    shares = np.maximum(shares, 1e-12 * shares.max())

    def halvings(limit: float) -> NDArray:
        # an element's share falls with h^4 to h^7: 1.5 halvings for each factor e^..
        return np.clip(np.round(np.log2(shares) / 1.5 - limit), 0, 6).astype(int)

    low, high = -200.0, 200.0
    for _ in range(50):
        middle = (low + high) / 2
        grown = (2.0 ** halvings(middle)).sum()
        low, high = (middle, high) if grown > growth * len(shares) else (low, middle)
    return refine(level.solid, halvings(high)).solid
