r"""Estimated error of the peak stress in a meshed link.

The stress at a node is the mean of the stresses in the adjacent elements. The estimated
error is the root mean square of the largest deviations from this mean, times a safety
factor. It is computed at the nodes of the elements around the peak and at all nodes
whose stress is nearly equal to the peak. Nodes where the mesh deviates from the surface
of the part are excluded. If the stress at an excluded node is larger than the peak, the
difference is added to the error. At a singularity, the error is infinite.

Sources:
    Zienkiewicz & Zhu (1987), A simple error estimator, for the comparison of element
    stresses with averaged stresses.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.stiffness.fem.elements import node_gradients
from forcefit.stiffness.fem.error_indicator import VOIGT
from forcefit.stiffness.mesh.edge_grading import singular_edges
from forcefit.stiffness.mesh.regions import edges_between
from forcefit.stiffness.surface.facets import Facets

if TYPE_CHECKING:
    from forcefit.stiffness.fem.adaptive_step import Level

# Largest ratio of the error of a peak stress to the deviations of element stresses from
# their mean at the peak. It was computed for nine shouldered bars in tension, torsion
# and bending. The median is 0.3.
SAFETY_FACTOR = 1.6
# cosine of the largest angle between the normals at a smooth edge
_SMOOTH = np.cos(np.radians(5.0))
# largest accepted distance of a node from the exact shape, relative to the face size;
# for cubic faces on a fillet, the ratio is 1e-4
_OFF = 5e-3
ZONE = 0.9  # fraction of the peak above which a stress is nearly equal to it


def von_mises(stress: ArrayLike) -> NDArray:
    """Compute the von Mises stress.

    Args:
        stress: (..., 6) [Pa] components xx yy zz yz xz xy.

    Returns:
        (...) [Pa] von Mises stress.
    """
    s = np.asarray(stress, dtype=float)
    x, y, z, yz, xz, xy = np.moveaxis(s, -1, 0)
    normal = (x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2
    return np.sqrt(normal / 2 + 3 * (yz**2 + xz**2 + xy**2))


def element_stresses(level: "Level", members: NDArray, motion: NDArray) -> NDArray:
    """Compute the stresses in elements at their nodes.

    Args:
        level: a solved mesh.
        members: (c,) indices of the elements.
        motion: (6,) or (6, k) [rad, m] screws of the tip. With own weight, the shape is
            (9,) or (9, k), and the last three components are gravity [m/s^2].

    Returns:
        (c, m, k, 6) [Pa] stresses xx yy zz yz xz xy at the m nodes of each element.
    """
    mesh = level.mesh
    fields = level.solution.fields @ np.reshape(motion, (len(motion), -1))
    parts = [np.empty((0, mesh.cells.shape[1], fields.shape[2], 6))]
    for part, G in node_gradients(mesh, members):
        slope = np.einsum(
            "cqax,caik->cqkix", G, fields[mesh.cells[part]], optimize=True
        )
        lam, mu, _ = level.material[part].T[:, :, None, None]
        pressure = lam * np.trace(slope, axis1=-2, axis2=-1)
        parts.append(np.stack(
            [
                mu * (slope[..., i, j] + slope[..., j, i]) + (i == j) * pressure
                for i, j in VOIGT
            ],
            axis=-1,
        ))  # fmt: skip
    return np.concatenate(parts)


def nodes_by_material(level: "Level") -> tuple[NDArray, NDArray]:
    """Number nodes separately for each material.

    Args:
        level: a solved mesh of n nodes.

    Returns:
        New node numbers of each element, (t, k), and the original number of each new
        node, (m,). A node between two materials has two new numbers, because stresses
        are discontinuous there.
    """
    cells, constants = level.mesh.cells, level.material[:, :2]
    kind = np.unique(constants, axis=0, return_inverse=True)[1].reshape(-1)
    kinds = int(kind.max()) + 1
    if kinds == 1:
        return cells, np.arange(len(level.mesh.nodes))
    code, index = np.unique(cells * kinds + kind[:, None], return_inverse=True)
    return index.reshape(cells.shape), code // kinds


def estimated_error(
    level: "Level", motion: NDArray, node: int, zone: NDArray, left_out: NDArray
) -> float:
    """Estimate the error of a peak stress.

    Args:
        level: a solved mesh. Its nodes are numbered by :func:`nodes_by_material`.
        motion: (6,) [rad, m] screw of the tip.
        node: number of the node with the peak.
        zone: (n,) bool, True for nodes whose stress is nearly equal to the peak.
        left_out: (n,) bool, True for nodes where the mesh deviates from the surface.

    Returns:
        [Pa] estimated error.
    """
    mean, largest = _means_and_deviations(level, motion)
    cells, _ = nodes_by_material(level)
    near = np.unique(cells[(cells == node).any(axis=1)])
    squares = [np.mean(largest[part] ** 2) for part in (near, zone)]
    beyond = von_mises(mean[left_out]).max(initial=0.0) - von_mises(mean[node])
    return float(SAFETY_FACTOR * np.sqrt(sum(squares)) + max(beyond, 0.0))


def _means_and_deviations(level: "Level", motion: NDArray) -> tuple[NDArray, NDArray]:
    """Compute mean nodal stresses, (n, 6) [Pa], and largest deviations, (n,) [Pa]."""
    cells, nodes = nodes_by_material(level)
    count = len(nodes)
    total, largest = np.zeros((count, 6)), np.zeros(count)
    stress = element_stresses(level, np.arange(len(cells)), motion)[:, :, 0]
    np.add.at(total, cells, stress)
    number = np.bincount(cells.ravel(), minlength=count)
    mean = total / np.maximum(number, 1)[:, None]
    np.maximum.at(largest, cells, von_mises(stress - mean[cells]))
    return mean, largest


def on_inner_edges(level: "Level") -> NDArray:
    """Find the nodes of elements at re-entrant edges or between materials.

    Args:
        level: a solved mesh of n nodes.

    Returns:
        (n,) bool, True if an adjacent element touches a re-entrant edge without a
        fillet or a boundary edge between two materials.
    """
    edges, cells = singular_edges(level.solid, ()), level.mesh.cells
    on = np.zeros(len(level.mesh.nodes), dtype=bool)
    if len(edges):
        # the exact shapes are compared, because coarse faces on a fillet form sharp
        # edges
        on[edges[_meet_at_an_angle(level, edges)]] = True
    if level.solid.region is not None:
        on[edges_between(level.solid, level.solid.region)] = True
    on[cells[on[cells[:, :4]].any(axis=1)]] = True
    return on


def _meet_at_an_angle(level: "Level", edges: NDArray) -> NDArray:
    """Return whether the two shapes at each edge form a sharp edge, (e,)."""
    solid = level.solid
    count = np.int64(len(solid.points))
    pairs = np.sort(solid.faces[:, [[0, 1], [1, 2], [0, 2]]], axis=2)
    code = (pairs[..., 0] * count + pairs[..., 1]).ravel()
    order = np.argsort(code, kind="stable")
    own = np.sort(edges, axis=1)
    first = np.searchsorted(code[order], own[:, 0] * count + own[:, 1])
    middle = solid.points[edges].mean(axis=1)
    normals = np.zeros((2, len(edges), 3))
    for side in (0, 1):
        patch = solid.patch[order[first + side] // 3]
        for number in np.unique(patch):
            here, shape = patch == number, solid.shapes[number]
            if shape is not None:
                normals[side, here] = shape.signed(middle[here])[1]
    return np.abs(np.einsum("ei,ei->e", *normals)) < _SMOOTH


def off_shapes(level: "Level") -> NDArray:
    """Find the nodes where the mesh deviates from the surface of the part.

    Args:
        level: a solved mesh of n nodes.

    Returns:
        (n,) bool, True for nodes of elements, and of their neighbours, with a node
        whose distance from the exact shape exceeds 0.5 % of the face size.
    """
    mesh = level.mesh
    off = np.zeros(len(mesh.nodes), dtype=bool)
    for number, shape in enumerate(level.solid.shapes):
        faces = mesh.faces[mesh.patch == number]
        if shape is None or isinstance(shape, Facets) or not len(faces):
            continue
        places = mesh.nodes[faces]
        size = np.linalg.norm(np.ptp(places[:, :3], axis=1), axis=1)
        away = np.abs(shape.signed(places.reshape(-1, 3))[0]).reshape(faces.shape)
        off[faces[away > _OFF * size[:, None]]] = True
    for _ in range(2):
        off[mesh.cells[off[mesh.cells].any(axis=1)]] = True
    return off


def on_facets(level: "Level") -> NDArray:
    """Find the nodes on surfaces whose shape was not recognised.

    Args:
        level: a solved mesh of n nodes.

    Returns:
        (n,) bool, True for nodes on these surfaces.
    """
    mesh, shapes = level.mesh, level.solid.shapes
    lifted = np.array([isinstance(shape, Facets) for shape in shapes], dtype=bool)
    on = np.zeros(len(mesh.nodes), dtype=bool)
    on[mesh.faces[lifted[mesh.patch]]] = True
    return on
