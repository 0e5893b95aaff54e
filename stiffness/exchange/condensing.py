"""Condensation of a full matrix onto two interfaces, each a node or a rigid face.

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
    """Read node positions from lines with number, x, y and z.

    Args:
        path: file with numbers separated by commas or blanks, in which lines that begin
            with ``*`` or ``#`` are ignored. In input files of Abaqus or CalculiX, the
            lines after ``*NODE`` are read; in those of Nastran, the ``GRID`` lines; and
            in named selections of Ansys Workbench, the lines below the heading, where
            decimal commas are accepted.
        unit: [m] unit of length in the file.

    Returns:
        (3,) [m] position of each node, by node number.

    Raises:
        BadInput: a line has a different form.
    """
    nodes: dict[int, NDArray] = {}
    text = read_text(path)
    head = _WORKBENCH.match(text)
    if head and abs(_LENGTHS.get(head[1], 0.0) - unit) > 1e-9 * unit:
        raise BadInput(
            f"{path}: found lengths in {head[1]}, but a different --unit; expected "
            "the same unit"
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
                "number of a further node and its x, y, z"
            )
        nodes[node] = unit * place
    if not nodes:
        raise BadInput(f"{path}: found no nodes")
    return nodes


def _node_lines(text: str) -> Iterator[tuple[int, list[str], str]]:
    """Yield number, words (node, x, y, z) and text of each line with a node."""
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
    """Yield Nastran's ``GRID`` lines, two for a node with wide fields."""
    lines = text.split("\n")
    for number, line in enumerate(lines, 1):
        if _GRID.match(line):
            head, fields = bulk_fields(line)
            if head.endswith("*") and number < len(lines):
                fields = fields[:4] + bulk_fields(lines[number])[1]
            node, system, *place = [*fields, "", ""]
            # coordinate systems other than the basic one are rejected
            yield number, [node, *([] if system.strip("0") else place)], line


def interface_rows(
    matrix: FileMatrix, asked: str, option: str, nodes: Mapping[int, NDArray] | None
) -> tuple[NDArray, NDArray, NDArray | None]:
    """Find the rows of an interface, and their motions for its unit screws.

    Args:
        matrix: matrix with the degrees of freedom of its rows.
        asked: number of a node, or an interface as in ``stiffness fea``.
        option: name of the option, for messages.
        nodes: (3,) [m] positions by number; None if unknown.

    Returns:
        (k,) rows; (k, 6) their motions for unit screws [R T] at the interface's point;
        and (3,) [m] this point, None if unknown.

    Raises:
        BadInput: the node does not exist, a node lacks some of its six degrees of
            freedom, or the interface has no nodes.
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
                f"{has or 'none'}, expected a node with 1 to 6"
                f"{named if whole else ''}, or an interface such as z=0 with --nodes"
            )
        return np.array(rows), np.eye(6), None if nodes is None else nodes.get(node)
    interface = parse_interface(asked, option)
    if nodes is None:
        raise BadInput(
            f"{option}: found an interface without positions of the nodes; add "
            "--nodes FILE"
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
            # u = t + w x arm
            motions.append(np.concatenate([np.cross(place - point, unit), unit]))
    return np.array(rows), np.array(motions), point


def _on(interface: Interface, places: NDArray) -> NDArray:
    """Return (n,) bool, True for positions on an interface."""
    size = float(np.ptp(places, axis=0).max(initial=0.0)) or 1.0
    near = interface.distance(places) < _ON * size
    if interface.kind == "disc":
        arm = places - interface.point
        near &= np.linalg.norm(arm, axis=1) < interface.radius + _ON * size
    return near


def condensed(
    matrix: FileMatrix, ends: tuple[tuple[NDArray, NDArray], tuple[NDArray, NDArray]]
) -> tuple[NDArray, NDArray]:
    """Condense a matrix onto two interfaces; other degrees of freedom are unloaded.

    Args:
        matrix: (n, n) stiffness matrix.
        ends: rows and motions of base and tip, from :func:`interface_rows`.

    Returns:
        (12, 12) matrix, base first, and (n, 12) motions of all rows for unit screws of
        the interfaces.

    Raises:
        BadInput: the interfaces share rows, or some degrees of freedom are not
            connected to them.
    """
    from forcefit.stiffness.fem.sparse_solver import solve

    n = matrix.matrix.shape[0]
    fields, free = np.zeros((n, 12)), np.ones(n, dtype=bool)
    for k, (rows, motions) in enumerate(ends):
        if not free[rows].all():
            raise BadInput(
                f"{matrix.file}: found degrees of freedom that base and tip "
                "share, expected interfaces without a common node"
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
                "stiffness; expected a body in one piece, whose nodes are all "
                "connected"
            )
        loads = -(K @ fields)[free]
        fields[free] = solve(triu(inner, format="csr"), loads)
        if not np.isfinite(fields).all():
            raise BadInput(
                f"{matrix.file}: found a singular stiffness between the "
                "interfaces; expected a body in one piece that connects them"
            )
    # computed from the energy of the fields, in which solution errors enter squared
    K12 = fields.T @ (K @ fields)
    return (K12 + K12.T) / 2, fields
