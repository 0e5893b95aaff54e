"""Reproduce the published solid model of the Princeton beam.

``python -m benchmarks.evidence.princeton_bricks`` takes two minutes.  If angles are
given, for example ``90 75``, large deflections at these angles are also computed, which
takes ten minutes each.

The published solid model has 500 x 12 x 4 bricks in Ansys.  Bricks with eight nodes and
the B-bar method are too stiff in bending, because only four bricks are used across the
thickness.  The program prints their excess stiffness relative to refined bricks with
incompatible modes.  It also prints the differences between the published deflections, a
beam of 8 elements with the same excess stiffness, and these bricks.

Sources:
    Hughes (1980), Generalization of selective integration procedures (B-bar); Wilson,
    Taylor, Doherty, Ghaboussi (1973), Incompatible displacement models.
"""

import sys
from dataclasses import asdict, dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from benchmarks.evidence.princeton_solids import (
    ANGLES,
    HEIGHT,
    LENGTH,
    NU,
    PUBLISHED,
    WIDTH,
    E,
    in_pieces,
    off,
    root_link,
)
from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.robot import BeamLink, Frame, MatrixLink
from forcefit.stiffness.beam.sections import declared_section

COUNTS = (500, 12, 4)  # numbers of bricks of the published solid model
_COARSE = ((120, 2, 1), (250, 6, 2))  # numbers of bricks for the initial guesses
_CORNERS = np.array(list(product((-1, 1), repeat=3)))
_POINTS = _CORNERS / np.sqrt(3)
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
_SHEAR, _BULK = E / 2 / (1 + NU), E / 3 / (1 - 2 * NU)
_STEPS, _ITERATIONS = 6, 60


@dataclass(frozen=True, eq=False)
class Bricks:
    """Box of equal bricks with eight nodes, clamped at x = 0.

    Attributes:
        counts: numbers of bricks along length, height and width.
        elements: (e, 8) nodes of the bricks.
        gradients: (8, 8, 3) [1/m] gradients of the shape functions at each Gauss point.
        modes: (8, 3, 3) [1/m] gradients of the incompatible modes, one along each axis.
        weight: [m^3] weight of a Gauss point.
        places: (nodes, 3) [m] positions of the nodes.
        share: (nodes,) fraction of a uniform force on the last face that acts on each
            node.
    """

    counts: tuple[int, int, int]
    elements: NDArray
    gradients: NDArray
    modes: NDArray
    weight: float
    places: NDArray
    share: NDArray


def bricks(counts: tuple[int, int, int]) -> Bricks:
    """Return a box with given numbers of bricks."""
    sides = np.array([LENGTH, HEIGHT, WIDTH]) / counts
    nodes = [n + 1 for n in counts]
    number = np.arange(np.prod(nodes)).reshape(nodes)
    ends = [[slice(0, -1), slice(1, None)]] * 3
    elements = np.stack([number[cell].ravel() for cell in product(*ends)], axis=1)
    factors = 1 + _CORNERS * _POINTS[:, None]
    others = np.stack([factors[..., [1, 2]], factors[..., [0, 2]],
                       factors[..., [0, 1]]]).prod(axis=-1)  # fmt: skip
    gradients = np.moveaxis(others, 0, -1) * _CORNERS / 4 / sides
    modes = np.zeros((8, 3, 3))
    modes[:, range(3), range(3)] = -4 * _POINTS / sides
    axes = [np.linspace(0, 1, n) for n in nodes]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    ends_count = [np.where((a == 0) | (a == 1), 0.5, 1.0) for a in axes[1:]]
    share = np.zeros(nodes)
    share[-1] = np.outer(*ends_count) / counts[1] / counts[2]
    places = (places - [0, 0.5, 0.5]) * [LENGTH, HEIGHT, WIDTH]
    return Bricks(
        counts,
        elements,
        gradients,
        modes,
        float(np.prod(sides)) / 8,
        places,
        share.ravel(),
    )


def strains(F: NDArray, gradients: NDArray) -> NDArray:
    """Return the Green strains with engineering shear strains, (e, 6, 3 m)."""
    rows = [
        np.einsum("n,ek->enk", gradients[:, j], F[:, :, i])
        + (0 if i == j else np.einsum("n,ek->enk", gradients[:, i], F[:, :, j]))
        for i, j in _PAIRS
    ]
    return np.stack(rows, axis=1).reshape(len(F), 6, -1)


def equations(box: Bricks, u: NDArray, exact: bool = False) -> tuple[NDArray, NDArray]:
    """Return the nodal forces of each brick (e, 24), and their derivatives.

    Args:
        box: the bricks.
        u: (nodes, 3) [m] displacements.
        exact: whether to use incompatible modes instead of B-bar, for a box without
            deformation.

    Returns:
        Forces (e, 24) and derivatives (e, 24, 24), in the order of the nodes.
    """
    moved = u[box.elements]
    F = [np.eye(3) + np.einsum("eni,nj->eij", moved, g) for g in box.gradients]
    green = [(np.swapaxes(f, 1, 2) @ f - np.eye(3)) / 2 for f in F]
    dilatation = sum(np.trace(e, axis1=1, axis2=2) for e in green) / 8
    count = len(moved)
    forces, K = np.zeros((count, 24)), np.zeros((count, 24, 24))
    mean, mixed, own = np.zeros((count, 24)), 0.0, 0.0
    for f, e, g, mode in zip(F, green, box.gradients, box.modes, strict=True):
        B = strains(f, g)
        trace = B[:, :3].sum(axis=1)
        mean += trace / 8
        spherical = np.trace(e, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
        S = 2 * _SHEAR * (e - spherical)
        S = S + _BULK * dilatation[:, None, None] * np.eye(3)
        stress = np.stack([S[:, i, j] for i, j in _PAIRS], axis=1)
        forces += box.weight * np.einsum("er,erm->em", stress, B)
        DB = deviatoric(B)
        K += box.weight * np.swapaxes(B, 1, 2) @ DB
        bent = box.weight * np.einsum("ni,eij,mj->enm", g, S, g, optimize=True)
        for k in range(3):
            K[:, k::3, k::3] += bent
        if exact:
            G = strains(f, mode)
            both = G[:, :3].sum(axis=1)
            K += box.weight * _BULK * trace[:, :, None] * trace[:, None]
            DG = deviatoric(G)
            DG[:, :3] += _BULK * both[:, None]
            mixed = mixed + box.weight * np.swapaxes(B, 1, 2) @ DG
            own = own + box.weight * np.swapaxes(G, 1, 2) @ DG
    if exact:
        return forces, K - mixed @ np.linalg.solve(own, np.swapaxes(mixed, 1, 2))
    K += 8 * box.weight * _BULK * mean[:, :, None] * mean[:, None]
    return forces, K


def deviatoric(B: NDArray) -> NDArray:
    """Return the deviatoric stresses for given strains, (e, 6, k) [N/m^2]."""
    out = _SHEAR * B
    out[:, :3] *= 2
    out[:, :3] -= 2 * _SHEAR / 3 * B[:, :3].sum(axis=1, keepdims=True)
    return out


def solved(box: Bricks, K: NDArray, right: NDArray) -> NDArray:
    """Return the displacements under forces with a clamped end, (nodes, 3, k)."""
    dofs = (3 * box.elements[:, :, None] + np.arange(3)).reshape(len(K), 24)
    rows, columns = np.repeat(dofs, 24, axis=1).ravel(), np.tile(dofs, 24).ravel()
    size = 3 * len(box.places)
    free = np.arange(3 * (box.counts[1] + 1) * (box.counts[2] + 1), size)
    matrix = csc_matrix((K.ravel(), (rows, columns)), shape=(size, size))[free][:, free]
    # the bandwidth is small, because nodes are numbered along the bar
    factors = splu(
        matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )  # fmt: skip
    u = np.zeros((size, right.shape[-1]))
    u[free] = factors.solve(right.reshape(size, -1)[free])
    return u.reshape(right.shape)


def compliances(counts: tuple[int, int, int], exact: bool) -> NDArray:
    """Return the compliances in bending (two planes) and in torsion."""
    box = bricks(counts)
    y, z = box.places[:, 1], box.places[:, 2]
    loads = np.zeros((len(y), 3, 3))
    loads[:, 1, 0] = loads[:, 2, 1] = box.share
    loads[:, 1, 2], loads[:, 2, 2] = -box.share * z, box.share * y
    loads[:, :, 2] /= box.share @ (y**2 + z**2)
    K = equations(box, np.zeros((len(y), 3)), exact)[1]
    return np.einsum("nik,nik->k", loads, solved(box, K, loads))


def bent(box: Bricks, force: NDArray, u: NDArray, tolerance: float) -> NDArray:
    """Return the displacements under a dead load on the end face, (nodes, 3) [m]."""
    for _ in range(_ITERATIONS):
        forces, K = equations(box, u)
        inner = np.zeros((len(box.places), 3))
        np.add.at(inner, box.elements, forces.reshape(-1, 8, 3))
        open_forces = np.outer(box.share, force) - inner
        change = solved(box, K, open_forces[..., None])[..., 0]
        u = u + change
        if np.abs(change).max() < tolerance * LENGTH:
            return u
    raise RuntimeError(f"found no equilibrium under {force} N")


def refined(box: Bricks, u: NDArray, finer: Bricks) -> NDArray:
    """Return the displacements of a box interpolated at the nodes of a finer box."""
    axes = [np.unique(box.places[:, k].round(12)) for k in range(3)]
    grid = u.reshape(*(n + 1 for n in box.counts), 3)
    places = finer.places.round(12)
    return RegularGridInterpolator(axes, grid)(places)


def bent_rows(angle: float) -> dict[float, NDArray]:
    """Return the end face displacements along height and width by force, (2,) [m]."""
    coarse, middle, fine = (bricks(counts) for counts in (*_COARSE, COUNTS))
    u, before, rows = np.zeros((len(coarse.places), 3)), 0.0, {}
    axis = np.array([0.0, np.cos(angle), np.sin(angle)])
    for size in PUBLISHED:
        for share in np.arange(1, _STEPS + 1) / _STEPS:
            u = bent(coarse, (before + share * (size - before)) * axis, u, 1e-5)
        before = size
        shape = bent(middle, size * axis, refined(coarse, u, middle), 1e-5)
        shape = bent(fine, size * axis, refined(middle, shape, fine), 1e-7)
        rows[size] = fine.share @ shape[:, 1:]
    return rows


def stiffer_beam(factors: NDArray) -> tuple[BeamLink, MatrixLink]:
    """Return the links of a beam with increased stiffness."""
    section = declared_section({"width": WIDTH, "height": HEIGHT}, NU)
    along, across, twist = factors
    strong, weak = max(section.I_y, section.I_z), min(section.I_y, section.I_z)
    changed = replace(section, J=section.J * twist, **{
        name: {strong: along, weak: across}[getattr(section, name)]
        * getattr(section, name) for name in ("I_y", "I_z")
    })  # fmt: skip
    link = BeamLink(asdict(changed), E, NU, up=(0, 1, 0))
    plain = BeamLink(asdict(section), E, NU, up=(0, 1, 0))
    stiff, soft = (
        link_compliance(Frame("tip", translation=[LENGTH / 8, 0, 0], link=one))
        for one in (link, plain)
    )
    root = np.linalg.inv(root_link().stiffness)
    return link, MatrixLink(np.linalg.inv(stiff - (soft - root)))


def main() -> None:
    """Print the excess stiffness and both tables."""
    coarse, fine = (compliances(c, exact=True) for c in (COUNTS, (250, 24, 8)))
    right = fine + (fine - coarse) / 3
    factors = right / compliances(COUNTS, exact=False)
    print("excess stiffness", ", ".join(f"{100 * (f - 1):.2f} %" for f in factors),
          "along the height, along the width, in torsion")  # fmt: skip
    print("difference of the published solids [%] along the height and the width")
    print("    F  beta  beam of equal stiffness")
    link, root = stiffer_beam(factors)
    published = {
        (size, degrees): np.array([row[k] for row in rows[1]])
        for size, rows in PUBLISHED.items() for k, degrees in enumerate(ANGLES)
    }  # fmt: skip
    for (size, degrees), row in published.items():
        ours = in_pieces(size, np.radians(degrees), root, link)
        print(f"{size:7.3f}{degrees:4d}{off(row, ours)}", flush=True)
    for degrees in map(int, sys.argv[1:]):
        for size, rows in bent_rows(np.radians(degrees)).items():
            away = off(published[size, degrees], rows)
            print(f"{size:7.3f}{degrees:4d}{away} from these bricks", flush=True)


if __name__ == "__main__":
    main()
