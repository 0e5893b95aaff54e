r"""A posteriori error indicator for the stiffness on a mesh.

The error of the stiffness is the energy of the discretisation error. The stresses in a
cubic element are the sum of a constant part, a linear part with energy s_2, and a
quadratic part with energy s_3. Assume that the error e_p of elements of degree p is
proportional to p^-b. The exponent b follows from s_3 / s_2 = (e_2 - e_3) / (e_1 - e_2).
The error is then s_3 times the ratio e_3 / (e_2 - e_3), which is nearly zero in a
smooth field. At a singular edge, this ratio is set to 1.2.

At the free edge of a twisted plate, the stresses change direction within a boundary
layer, whose width is a third of the wall thickness. Elements much wider than the wall
do not resolve this layer. The error is then underestimated, but residual tractions t
act on the free surface. A stress field that balances them decays with depth x as
exp(-pi x / l), where l is the smallest height of the face. Its energy is the integral
of t^2 / (2 mu) l / pi over the surface. The indicator is the larger of these two
estimates.

The error due to the approximate geometry is estimated by :func:`geometry_errors`.

Sources:
    Mavriplis (1990) for the estimate from the decay of coefficients; Schwab (1998), p-
    and hp-Finite Element Methods, for the rate p^-b; Friedrichs & Dressler (1961) for
    the boundary layer of a plate.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.fem.elements import Elements, gradients_on_faces, integration
from forcefit.stiffness.surface.primitives import Plane, Shape
from forcefit.stiffness.surface.true_surface import TrueSurface

VOIGT = np.array([[0, 0], [1, 1], [2, 2], [1, 2], [0, 2], [0, 1]])
_SAME_MODULUS = 1e-6  # relative difference below which moduli are treated as equal
_CHUNK = 1024  # number of faces in a batch
# At a singular edge, the error of a cubic element is this factor times the energy of
# its quadratic stresses. The factor was calibrated on the links in meshes/.
_SINGULAR_SHARE = 1.2
# Error of a cubic element divided by the energy of its quadratic stresses, as a
# function of the energy ratio of quadratic to linear stresses. The table covers
# exponents b from 0.1 to 40.
_RATES = np.geomspace(40.0, 0.1, 400)
_DECAY = (2**-_RATES - 3**-_RATES) / (1 - 2**-_RATES)
_REMAINDER = np.minimum(3**-_RATES / (2**-_RATES - 3**-_RATES), 3.0)


def error_matrices(
    mesh: Elements,
    fields: NDArray,
    lam: NDArray,
    mu: NDArray,
    singular: NDArray,
    stiffness: NDArray,
) -> NDArray:
    """Estimate the contribution of each element to the error of the stiffness.

    Args:
        mesh: cubic elements.
        fields: (n, 3, k) [m] displacement fields of the load cases.
        lam: (t,) [Pa] Lame's first constant of each element.
        mu: (t,) [Pa] shear modulus of each element.
        singular: (t,) bool, True for an element that touches a singular edge.
        stiffness: (k, k) stiffness matrix of the load cases.

    Returns:
        Contribution of each element, (t, k, k), in the unit of the stiffness. Their sum
        is an estimate of K_h - K.
    """
    errors = np.zeros((len(mesh.cells), *stiffness.shape))
    for part, L, weights, _, G, w in integration(mesh):
        linear = L @ np.linalg.solve(L.T @ (weights[:, None] * L), L.T * weights)
        mean = np.broadcast_to(weights / weights.sum(), linear.shape)
        stress = _energy_roots(G, fields[mesh.cells[part]], lam[part], mu[part])
        s_3, s_2 = (
            _energy_products(
                np.einsum("pq,cqkx->cpkx", projection, stress, optimize=True), w
            )
            for projection in (np.eye(len(L)) - linear, linear - mean)
        )
        each_3, each_2 = (
            np.einsum("tii,i->t", s, 1 / np.diag(stiffness)) for s in (s_3, s_2)
        )
        ratio = each_3 / np.maximum(each_2, 1e-300)
        remainder = np.interp(ratio, _DECAY, _REMAINDER)
        remainder = np.where(singular[part], _SINGULAR_SHARE, remainder)
        errors[part] = remainder[:, None, None] * s_3
    return errors


def traction_errors(
    mesh: Elements, fields: NDArray, lam: NDArray, mu: NDArray, free: NDArray
) -> NDArray:
    """Compute the energies of stress fields that balance residual surface tractions.

    Args:
        mesh: the elements.
        fields: (n, 3, k) [m] displacement fields of the load cases.
        lam: (t,) [Pa] Lame's first constant of each element.
        mu: (t,) [Pa] shear modulus of each element.
        free: (f,) indices of the boundary faces without a load.

    Returns:
        Energies, (f, k, k), in the unit of the stiffness.
    """
    cases = fields.shape[2]
    errors = np.zeros((len(free), cases, cases))
    for first in range(0, len(free), _CHUNK):
        some = free[first : first + _CHUNK]
        _, normal, area, G = gradients_on_faces(mesh, some)
        cells = mesh.owner[some]
        slope = np.einsum("fqmx,fmik->fqkix", G, fields[mesh.cells[cells]])
        t = np.einsum("fqkix,fqx->fqki", slope + slope.swapaxes(3, 4), normal)
        t *= mu[cells][:, None, None, None]
        trace = np.trace(slope, axis1=3, axis2=4) * lam[cells][:, None, None]
        t += trace[..., None] * normal[:, :, None]
        depth = _smallest_height(mesh, some) / np.pi / (2 * mu[cells])
        weighted = t * (area * depth[:, None])[..., None, None]
        errors[first : first + len(some)] = np.einsum("fqki,fqli->fkl", weighted, t)
    return errors


def _smallest_height(mesh: Elements, faces: NDArray) -> NDArray:
    """Return the smallest height of each face and its element, (f,) [m]."""
    a, b, c = np.moveaxis(mesh.nodes[mesh.faces[faces, :3]], 1, 0)
    across = np.cross(b - a, c - a)
    twice = np.linalg.norm(across, axis=1)
    longest = np.max([np.linalg.norm(e, axis=1) for e in (b - a, c - b, a - c)], axis=0)
    corners = mesh.nodes[mesh.cells[mesh.owner[faces], :4]]
    edges = corners[:, 1:] - corners[:, :1]
    depth = np.abs(np.linalg.det(edges)) / twice
    return np.minimum(twice / longest, depth)


def geometry_errors(
    mesh: Elements,
    shapes: Sequence[Shape | None],
    fields: NDArray,
    lam: NDArray,
    mu: NDArray,
    surface: TrueSurface | None = None,
) -> NDArray:
    """Estimate the error of the stiffness due to the approximate geometry.

    Args:
        mesh: the elements.
        shapes: exact shapes of the patches.
        fields: (n, 3, k) [m] displacement fields of the load cases.
        lam: (t,) [Pa] Lame's first constant of each element.
        mu: (t,) [Pa] shear modulus of each element.
        surface: exact surface of the part, with which faces near a smooth border
            between two patches are compared. If None, each face is compared with the
            shape of its patch.

    Returns:
        Contribution of each boundary face, (f, k, k), in the unit of the stiffness. To
        first order, it is the integral of the energy density times the distance from
        the exact shape.

    Sources:
        Hadamard (1908) for the derivative of the energy with respect to a surface
        displacement.
    """
    cases = fields.shape[2]
    errors = np.zeros((len(mesh.faces), cases, cases))
    for number in np.unique(mesh.patch):
        shape, across = shapes[number], surface is not None and surface.tangent[number]
        on = mesh.patch == number
        faces = np.flatnonzero(on if across else on & mesh.curved[mesh.owner])
        if shape is None or (isinstance(shape, Plane) and not across):
            continue
        for first in range(0, len(faces), _CHUNK):
            some = faces[first : first + _CHUNK]
            places, normal, area, G = gradients_on_faces(mesh, some)
            flat = places.reshape(-1, 3), normal.reshape(-1, 3)
            if across and surface is not None:
                gap = surface.outside(*flat).reshape(area.shape)
            else:
                away, slope = shape.signed(flat[0])
                facing = np.einsum("nx,nx->n", flat[1], slope)
                gap = (away * np.sign(facing)).reshape(area.shape)
            cells = mesh.owner[some]
            roots = _energy_roots(G, fields[mesh.cells[cells]], lam[cells], mu[cells])
            weighted = (roots * (area * gap)[..., None, None]).swapaxes(1, 2)
            rows = (len(some), cases, -1)
            errors[some] = weighted.reshape(rows) @ roots.swapaxes(1, 2).reshape(
                rows
            ).swapaxes(1, 2)
    return errors


def material_errors(
    mesh: Elements,
    fields: NDArray,
    lam: NDArray,
    mu: NDArray,
    shear_at: Callable[[NDArray], NDArray],
) -> NDArray:
    """Estimate the error of the stiffness due to elements that contain two materials.

    Args:
        mesh: the elements.
        fields: (n, 3, k) [m] displacement fields of the load cases.
        lam: (t,) [Pa] Lame's first constant of each element.
        mu: (t,) [Pa] shear modulus of each element.
        shear_at: function that returns the shear modulus, (n,) [Pa], at points, (n, 3)
            [m].

    Returns:
        Contribution of each element, (t, k, k), in the unit of the stiffness. It is the
        energy in the volume of the second material times the ratio of the moduli, and
        is positive if the element is too stiff.
    """
    cases = fields.shape[2]
    errors = np.zeros((len(mesh.cells), cases, cases))
    for part, _, _, N, G, w in integration(mesh):
        places = np.einsum("qa,tax->tqx", N, mesh.nodes[mesh.cells[part]])
        own = mu[part][:, None]
        true = shear_at(places.reshape(-1, 3)).reshape(w.shape)
        # tractions are continuous at the border of the materials, so the more compliant
        # material has the larger energy density
        ratio = np.maximum(own / true, true / own)
        sign = np.where(own > true, 1.0, -1.0) * (np.abs(ratio - 1) > _SAME_MODULUS)
        some = np.flatnonzero(sign.any(axis=1))
        roots = _energy_roots(
            G[some], fields[mesh.cells[part[some]]], lam[part[some]], mu[part[some]]
        )
        weight = (sign * ratio * w)[some]
        weighted = roots * weight[:, :, None, None]
        errors[part[some]] = np.einsum("cqkx,cqlx->ckl", weighted, roots, optimize=True)
    return errors


def _energy_roots(G: NDArray, u: NDArray, lam: NDArray, mu: NDArray) -> NDArray:
    """Return seven numbers whose squares add up to the energy density, (c, q, k, 7)."""
    count, points, nodes, _ = G.shape
    cases = u.shape[3]
    slope = u.transpose(0, 3, 2, 1).reshape(count, 1, 3 * cases, nodes) @ G
    slope = slope.reshape(count, points, cases, 3, 3)
    strain = (slope + slope.swapaxes(3, 4)) / 2
    trace = np.trace(strain, axis1=3, axis2=4)
    strain[..., range(3), range(3)] -= trace[..., None] / 3
    i, j = VOIGT.T
    six = strain[..., i, j] * np.sqrt([1, 1, 1, 2, 2, 2])
    six *= np.sqrt(2 * mu)[:, None, None, None]
    bulk = np.sqrt(lam + 2 / 3 * mu)[:, None, None]
    return np.concatenate([six, (bulk * trace)[..., None]], axis=3)


def _energy_products(roots: NDArray, w: NDArray) -> NDArray:
    """Integrate the energy density of pairs of load cases, (c, k, k)."""
    count, _, cases, _ = roots.shape
    flat = (
        (roots * np.sqrt(w)[:, :, None, None]).swapaxes(1, 2).reshape(count, cases, -1)
    )
    return np.asarray(flat @ flat.swapaxes(1, 2))
