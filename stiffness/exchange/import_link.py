"""Import of a link from the stiffness matrix of another program."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput, nearest, quoted
from forcefit.stiffness.exchange.condensing import condensed, interface_rows, read_nodes
from forcefit.stiffness.exchange.matrix_file import FileMatrix, read_matrix
from forcefit.stiffness.exchange.two_interfaces import (
    link_of_both_ends,
    mass_of_both_ends,
)
from forcefit.stiffness.link import LinkStiffness, check_definite, inverted

LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "inch": 0.0254}
ORDERS = ("translations-first", "rotations-first")


def import_link(
    path: Path | str,
    *,
    mass: Path | str | None = None,
    nodes: Path | str | None = None,
    base: str = "1",
    tip: str = "2",
    unit: str = "m",
    order: str = ORDERS[0],
) -> LinkStiffness:
    """Import a link from a file with its stiffness matrix.

    Args:
        path: file with the stiffness matrix, in a format of
            :mod:`forcefit.stiffness.exchange.matrix_file`.
        mass: file with the mass matrix for the same degrees of freedom, or None.
        nodes: file with node positions, which is required if an interface has several
            nodes. If the matrix file does not name its rows, they are in the order of
            these nodes.
        base: clamped node, or clamped interface such as ``"z=0"`` [m].
        tip: loaded node or interface.
        unit: unit of length in all files. Forces are in N, and rotations in rad.
        order: order of the six degrees of freedom of a node in files that do not name
            them.

    Returns:
        The link, in the axes of the file.

    Raises:
        BadInput: a file is invalid, or the matrix is not the stiffness of a free
            elastic body.
    """
    for option, value, valid in (("--unit", unit, LENGTHS), ("--order", order, ORDERS)):
        if value not in valid:
            raise BadInput(f"{option}: found {quoted(value)}{nearest(value, valid)}")
    length = LENGTHS[unit]
    places = None if nodes is None else read_nodes(nodes, length)
    numbers = None if places is None else list(places)
    matrix = read_matrix(path, nodes=numbers)
    matrix = in_metres(reordered(matrix, order), length)
    node = matrix.freedoms[0][0]
    if set(matrix.freedoms) == {(node, direction) for direction in range(1, 7)}:
        if mass is not None:
            raise BadInput(
                "--mass: the stiffness matrix has only 6 rows; expected the full "
                "stiffness matrix of a body, or no --mass"
            )
        rows = interface_rows(matrix, str(node), "--tip", None)[0]
        K = matrix.matrix.toarray()[np.ix_(rows, rows)]
        check_definite(f"{path}: stiffness", K)
        at = (places or {}).get(node, np.zeros(3))
        return LinkStiffness(
            f"imported from {Path(path).name}", inverted(K), tip=at, base=at
        )
    ends = _ends(matrix, base, tip, places)
    K12, fields = condensed(matrix, (ends[0][:2], ends[1][:2]))
    points = [end[2] for end in ends]
    known = points if all(point is not None for point in points) else [None, None]
    who = f"imported from {Path(path).name}"
    link = link_of_both_ends(K12, who, known[0], known[1])
    if mass is None:
        return link
    heavy = in_metres(
        reordered(read_matrix(mass, "mass", numbers, path), order), length
    )
    row = {freedom: k for k, freedom in enumerate(matrix.freedoms)}
    strange = [freedom for freedom in heavy.freedoms if freedom not in row]
    if strange or len(heavy.freedoms) < len(row) and not heavy.named:
        raise BadInput(
            f"{mass}: the nodes and directions differ from those in {path}; expected "
            "the same in both files"
        )
    # a mass matrix with named rows has no rows for degrees of freedom without mass
    moved = fields[[row[freedom] for freedom in heavy.freedoms]]
    M12 = moved.T @ (heavy.matrix @ moved)
    kilograms, centre, inertia = mass_of_both_ends(M12, link.base - link.tip)
    return replace(
        link, mass=kilograms, center_of_mass=link.tip + centre, inertia=inertia
    )


def _ends(
    matrix: FileMatrix, base: str, tip: str, places: Mapping[int, NDArray] | None
) -> list[tuple[NDArray, NDArray, NDArray | None]]:
    """Find the rows, the displacements and the reference points of base and tip."""
    return [
        interface_rows(matrix, asked, option, places)
        for asked, option in ((base, "--base"), (tip, "--tip"))
    ]


def reordered(matrix: FileMatrix, order: str) -> FileMatrix:
    """Reorder the degrees of freedom of a matrix."""
    if matrix.named or order == ORDERS[0]:
        return matrix
    freedoms = tuple((node, (d + 2) % 6 + 1) for node, d in matrix.freedoms)
    return replace(matrix, freedoms=freedoms)


def in_metres(matrix: FileMatrix, length: float) -> FileMatrix:
    """Convert a matrix to SI units.

    Args:
        matrix: matrix with forces in N, rotations in rad and translations in multiples
            of ``length``.
        length: [m] unit of length of the matrix.

    Returns:
        The matrix in SI units.
    """
    turns = np.array([direction > 3 for _, direction in matrix.freedoms])
    scale = np.where(turns, 1.0, 1.0 / length)
    scaled = matrix.matrix.multiply(scale[:, None]).multiply(scale[None, :]) * length
    return replace(matrix, matrix=scaled.tocsr())
