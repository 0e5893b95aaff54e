"""Reader of Wavefront OBJ files.

Only points and faces are read. Texture coordinates, normals, groups and materials are
ignored.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput, describe


def read_obj(path: Path) -> tuple[NDArray, list[list[int]]]:
    """Read the points and the faces of an OBJ file.

    Args:
        path: path of an existing file.

    Returns:
        Points in the unit of the file, (n, 3), and the corner indices of each face.

    Raises:
        BadInput: a line is invalid, or a face has an unknown corner.
    """
    points: list[list[float]] = []
    faces: list[list[int]] = []
    lines: list[int] = []
    for number, (kind, *words) in _statements(path):
        try:
            if kind.lower() == "v":
                points.append([float(words[k]) for k in range(3)])
            elif kind.lower() in {"f", "fo"}:
                faces.append([_corner(word, len(points)) for word in words])
                lines.append(number)
        except (ValueError, IndexError):
            what = "v X Y Z" if kind.lower() == "v" else "f with numbers of points"
            raise BadInput(
                f"{path}:{number}: found {describe(' '.join([kind, *words]))}, "
                f"expected {what}"
            ) from None
    for face, number in zip(faces, lines, strict=True):
        wrong = [k for k in face if not 0 <= k < len(points)]
        if wrong:
            raise BadInput(
                f"{path}:{number}: found point {wrong[0] + 1} in a face, expected "
                f"points 1 to {len(points)}"
            )
        if len(face) < 3:
            raise BadInput(
                f"{path}:{number}: found a face of {len(face)} points, expected at "
                "least 3"
            )
    return np.array(points, dtype=float).reshape(-1, 3), faces


def _statements(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the words of each line."""
    text = path.read_bytes().removeprefix(b"\xef\xbb\xbf").decode("latin-1")
    words: list[str] = []
    for number, line in enumerate(text.split("\n"), 1):
        told = line.partition("#")[0].rstrip()
        words += told.removesuffix("\\").split()
        if words and not told.endswith("\\"):
            yield number, words
            words = []


def _corner(word: str, points: int) -> int:
    """Return the index of a point from its number in a face."""
    index = int(word.partition("/")[0])
    return index - 1 if index >= 0 else points + index
