"""Condensation of a stiffness matrix onto two nodes or rigid faces.

Sources:
    Guyan (1965), Reduction of stiffness and mass matrices, AIAA Journal 3, 380.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import triu

from forcefit.inputs.errors import BadInput, describe
from forcefit.inputs.table import read_text
from forcefit.stiffness.exchange.matrix_file import FileMatrix
from forcefit.stiffness.exchange.nastran_files import bulk_fields
from forcefit.stiffness.exchange.real_numbers import real
from forcefit.stiffness.surface.interface import Interface, parse_interface

_GRID = re.compile(r"^GRID\*?[\s,]", re.M | re.I)
_NODE = re.compile(r"^\*NODE\s*(?:,.*)?$", re.M | re.I)
_WORKBENCH = re.compile(r"Node Number\tX Location \((\w+)\)")
_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "in": 0.0254}
# largest distance of nodes from their interface, relative to the size of the body
_ON = 1e-6


def read_nodes(path: Path | str, unit: float) -> dict[int, NDArray]:
    """Read node positions from a file.

    Args:
        path: file with node number, x, y and z in each line, separated by commas or
            blanks. Lines that begin with ``*`` or ``#`` are ignored. Input files of
            Abaqus, CalculiX or Nastran and named selections of Ansys Workbench are also
            accepted.
        unit: [m] unit of length in the file.

    Returns:
        Dictionary from node numbers to positions, (3,) [m].

    Raises:
        BadInput: a line is invalid.
    """
    nodes: dict[int, NDArray] = {}
    text = read_text(path)
    head = _WORKBENCH.match(text)
    if head and abs(_LENGTHS.get(head[1], 0.0) - unit) > 1e-9 * unit:
        raise BadInput(
            f"{path}: the lengths in the file are in {head[1]}, but --unit is "
            "different; expected the same unit"
        )
    for number, words, line in _node_lines(text):
        try:
            place = np.array([real(path, word) for word in words[1:4]])
            node = int(words[0])
        except (ValueError, BadInput):
            place, node = np.empty(0), 0
        if place.shape != (3,) or not np.isfinite(place).all() or node in nodes:
            raise BadInput(
                f"{path}: line {number}: found {describe(line.strip())}, expected the "
                "number of another node and its coordinates x, y, z"
            )
        nodes[node] = unit * place
    if not nodes:
        raise BadInput(f"{path}: found no nodes")
    return nodes


def _node_lines(text: str) -> Iterator[tuple[int, list[str], str]]:
    """Yield line number, words (node, x, y, z) and text for each node."""
    if _GRID.search(text):
        yield from _grids(text)
        return
    if _WORKBENCH.match(text):
        for number, line in enumerate(text.split("\n")[1:], 2):
            if line.strip():
                yield number, line.replace(",", ".").split(), line
        return
    deck = bool(_NODE.search(text))
    listed = not deck
    for number, line in enumerate(text.split("\n"), 1):
        words = re.split(r"[,\s]+", line.strip(" ,\t\r"))
        if deck and re.match(r"\*[^*]", words[0]):
            listed = bool(_NODE.match(line))
        if listed and words[0] and not words[0].startswith(("*", "#")):
            yield number, words, line


def _grids(text: str) -> Iterator[tuple[int, list[str], str]]:
    """Yield line number, words and text of Nastran's ``GRID`` entries."""
    lines = text.split("\n")
    for number, line in enumerate(lines, 1):
        if _GRID.match(line):
            head, fields = bulk_fields(line)
            if head.endswith("*") and number < len(lines):
                fields = fields[:4] + bulk_fields(lines[number])[1]
            node, system, *place = [*fields, "", ""]
            # no coordinates are yielded for other coordinate systems, so that they are
            # rejected
            yield number, [node, *([] if system.strip("0") else place)], line


def interface_rows(
    matrix: FileMatrix, asked: str, option: str, nodes: Mapping[int, NDArray] | None
) -> tuple[NDArray, NDArray, NDArray | None]:
    """Find the matrix rows of an interface and their displacements for unit screws.

    Args:
        matrix: matrix with the degrees of freedom of its rows.
        asked: node number, or text of an interface such as ``"z=0"``.
        option: name of the option, for error messages.
        nodes: positions by node number, each (3,) [m]; None if unknown.

    Returns:
        Rows, (k,); their displacements for unit screws, (k, 6); and the reference point
        of the screws, (3,) [m], or None if unknown.

    Raises:
        BadInput: the node does not exist or does not have six degrees of freedom, or
            there are no nodes on the interface.
    """
    row = {freedom: k for k, freedom in enumerate(matrix.freedoms)}
    if asked.strip().isdigit():
        node = int(asked)
        rows = [row.get((node, direction), -1) for direction in (4, 5, 6, 1, 2, 3)]
        if min(rows) < 0:
            has = sorted(d for n, d in matrix.freedoms if n == node)
            whole = sorted(n for n, d in matrix.freedoms if d == 4)
            more = ", ..." if len(whole) > 4 else ""
            named = f" (nodes with rotations: {', '.join(map(str, whole[:4]))}{more})"
            raise BadInput(
                f"{option}: node {node} of {matrix.file} has the degrees of freedom "
                f"{has or 'none'}, expected a node with the degrees of freedom 1 to "
                f"6{named if whole else ''}, or an interface such as z=0 with --nodes"
            )
        return np.array(rows), np.eye(6), None if nodes is None else nodes.get(node)
    interface = parse_interface(asked, option)
    if nodes is None:
        raise BadInput(
            f"{option}: found an interface, but no node positions; add --nodes FILE"
        )
    known = [node for node in nodes if (node, 1) in row]
    places = np.array([nodes[node] for node in known]).reshape(-1, 3)
    near = _on(interface, places)
    if near.sum() < 3:
        raise BadInput(
            f"{option}: found {int(near.sum())} nodes on {interface}, expected at "
            "least 3"
        )
    point = places[near].mean(axis=0)
    if interface.kind != "plane":
        point = interface.point
    rows, motions = [], []
    for node, place in zip(np.array(known)[near].tolist(), places[near], strict=True):
        for direction in (1, 2, 3):
            if (node, direction) not in row:
                raise BadInput(
                    f"{option}: node {node} has no degree of freedom {direction}, "
                    "expected the translations 1 to 3"
                )
            unit = np.eye(3)[direction - 1]
            rows.append(row[node, direction])
            # displacement t + w x arm for the screw (w, t)
            motions.append(np.concatenate([np.cross(place - point, unit), unit]))
    return np.array(rows), np.array(motions), point


def _on(interface: Interface, places: NDArray) -> NDArray:
    """Return whether each position is on an interface, (n,)."""
    size = float(np.ptp(places, axis=0).max(initial=0.0)) or 1.0
    near = interface.distance(places) < _ON * size
    if interface.kind == "disc":
        arm = places - interface.point
        near &= np.linalg.norm(arm, axis=1) < interface.radius + _ON * size
    return near


def condensed(
    matrix: FileMatrix, ends: tuple[tuple[NDArray, NDArray], tuple[NDArray, NDArray]]
) -> tuple[NDArray, NDArray]:
    """Condense a stiffness matrix onto two interfaces.

    Args:
        matrix: (n, n) stiffness matrix.
        ends: rows and displacements of base and tip, from :func:`interface_rows`.

    Returns:
        Condensed matrix, (12, 12), base before tip; and the displacements of all rows
        for unit screws of the interfaces, (n, 12).

    Raises:
        BadInput: the interfaces have common rows, or some nodes are not connected to
            them.
    """
    from forcefit.stiffness.fem.sparse_solver import solve

    n = matrix.matrix.shape[0]
    fields, free = np.zeros((n, 12)), np.ones(n, dtype=bool)
    for k, (rows, motions) in enumerate(ends):
        if not free[rows].all():
            raise BadInput(
                f"{matrix.file}: base and tip have common degrees of freedom; expected "
                "interfaces without a common node"
            )
        fields[rows, 6 * k : 6 * k + 6] = motions
        free[rows] = False
    K = matrix.matrix
    if free.any():
        inner = K[free][:, free]
        loose = inner.diagonal() <= 0
        if loose.any():
            node, direction = np.array(matrix.freedoms)[free][int(np.argmax(loose))]
            raise BadInput(
                f"{matrix.file}: degree of freedom {direction} of node {node} has no "
                "stiffness; expected a body whose nodes are all connected"
            )
        loads = -(K @ fields)[free]
        fields[free] = solve(triu(inner, format="csr"), loads)
        if not np.isfinite(fields).all():
            raise BadInput(
                f"{matrix.file}: the stiffness between the interfaces is singular; "
                "expected a body that connects them"
            )
    # K12 is computed from the strain energy, because the error of the energy is
    # quadratic in the error of the displacements
    K12 = fields.T @ (K @ fields)
    return (K12 + K12.T) / 2, fields
