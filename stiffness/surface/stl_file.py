"""Reader of text and binary STL files.

The reader accepts keywords in capitals, an incomplete last line, bytes after the last
triangle, and a placeholder for the number of triangles.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput, describe

_HEAD = 84  # number of bytes before the triangles of a binary file
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("tag", "<u2")])
# placeholders that programs write if the number of triangles is unknown
_UNKNOWN_COUNTS = (0, 2**32 - 1)
# the name of a solid ends at its first facet or at the end of the line
_NAME = re.compile(rb"(?im)^[ \t]*(?:end)?solid\b.*?(?=\bfacet\s+normal\b|\r|\n|\Z)")


def read_stl(path: Path) -> tuple[NDArray, NDArray]:
    """Read the triangles of an STL file.

    Args:
        path: path of an existing file.

    Returns:
        Points in the unit of the file, (3 m, 3), and their indices for each triangle,
        (m, 3).

    Raises:
        BadInput: the file is not an STL file or is truncated.
    """
    content = path.read_bytes()
    corners = _text(path, content) if _is_text(content) else _binary(path, content)
    if len(corners) == 0:
        raise BadInput(f"{path}: the file contains no triangles, or is not an STL file")
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def _count(content: bytes) -> int:
    """Return the number of triangles in the header of a binary file."""
    return int.from_bytes(content[_HEAD - 4 : _HEAD], "little")


def _is_text(content: bytes) -> bool:
    """Return whether a file is a text file."""
    size = _HEAD + _TRIANGLE.itemsize * _count(content)
    if len(content) >= _HEAD and len(content) == size:
        return False
    start = content[:1000].removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    return start.startswith((b"solid", b"facet")) and b"\0" not in content


def _binary(path: Path, content: bytes) -> NDArray:
    """Return the corners of the triangles in a binary file, (m, 3, 3)."""
    stated, size = _count(content), _TRIANGLE.itemsize
    body = content[_HEAD:]
    if len(content) < _HEAD:
        raise BadInput(f"{path}: not a readable STL file")
    if stated in _UNKNOWN_COUNTS:
        stated = len(body) // size
    if len(body) < size * stated - 2:  # the last two bytes of a triangle are not used
        raise BadInput(
            f"{path}: found {len(body) // size} complete triangles, expected {stated} "
            "as in the header; the file is truncated, or is not an STL file"
        )
    body = body[: size * stated].ljust(size * stated, b"\0")
    return np.frombuffer(body, dtype=_TRIANGLE)["corners"].astype(float)


def _text(path: Path, content: bytes) -> NDArray:
    """Return the corners of the triangles in a text file, (m, 3, 3)."""
    words = _NAME.sub(b" ", content.removeprefix(b"\xef\xbb\xbf")).lower().split()
    found = np.array(words, dtype=object)  # an array of str would need more memory
    facets = np.flatnonzero(found == b"facet")
    vertices = np.flatnonzero(found == b"vertex")
    owner = np.searchsorted(facets, vertices)  # 0 for a vertex before the first facet
    corners = np.bincount(owner, minlength=len(facets) + 1)
    wrong = np.flatnonzero(corners[1:] != 3)
    if corners[0] or len(wrong):
        place = f"facet {wrong[0] + 1}" if len(wrong) else "before the first facet"
        many = corners[wrong[0] + 1] if len(wrong) else corners[0]
        ends = len(wrong) and wrong[0] + 1 == len(facets)
        end = "; the file is truncated there" if ends and many < 3 else ""
        raise BadInput(f"{path}: {place}: found {many} vertices, expected 3{end}")
    if len(vertices) and vertices[-1] + 3 >= len(found):
        raise BadInput(f"{path}: facet {len(facets)}: the file is truncated there")
    numbers = found[vertices[:, None] + [1, 2, 3]]
    points = np.empty(numbers.shape)
    for row, three in enumerate(numbers):
        for k, word in enumerate(three):
            try:
                points[row, k] = float(word)
            except ValueError:
                text = describe(word.decode(errors="replace"))
                raise BadInput(
                    f"{path}: facet {row // 3 + 1}: found {text}, expected a coordinate"
                ) from None
    return points.reshape(-1, 3, 3)
