"""Tests of the reader of STL files."""

import re

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.surface.stl_file import read_stl
from tests.solids_for_tests import CUBE, CUBE_TRIANGLES

CORNERS = CUBE[CUBE_TRIANGLES]  # corners of each triangle, (12, 3, 3)


def text_of(corners):
    """Return a text STL file according to the specification of 3D Systems (1988)."""
    lines = ["solid cube"]
    for facet in corners:
        lines += [" facet normal 0 0 0", "  outer loop"]
        lines += ["   vertex " + " ".join(map(repr, map(float, p))) for p in facet]
        lines += ["  endloop", " endfacet"]
    return "\n".join([*lines, "endsolid cube", ""])


def binary_of(corners, head=b"cube", count=None):
    """Return a binary STL file."""
    count = len(corners) if count is None else count
    body = b"".join(
        bytes(12) + facet.astype("<f4").tobytes() + bytes(2) for facet in corners
    )
    return head.ljust(80) + count.to_bytes(4, "little") + body


TEXT, BINARY = text_of(CORNERS).encode(), binary_of(CORNERS)


def read(tmp_path, content):
    path = tmp_path / "cube.stl"
    path.write_bytes(content)
    points, triangles = read_stl(path)
    return points[triangles]


TEXTS = {
    "as described": TEXT, "capitals": TEXT.upper(),
    "CRLF": TEXT.replace(b"\n", b"\r\n"), "CR": TEXT.replace(b"\n", b"\r"),
    "one line": TEXT.replace(b"\n", b" "), "byte order mark": b"\xef\xbb\xbf" + TEXT,
    "no last line": TEXT[: TEXT.index(b"endsolid")],
    "last line cut": TEXT[: TEXT.index(b"endsolid") + 5],
    "last facet's end cut": TEXT[: TEXT.rindex(b"endfacet") + 4],
    "last loop open": TEXT[: TEXT.rindex(b"endloop")],
    "name of keywords": TEXT.replace(b"solid cube", b"solid vertex 1 2 3 facet"),
    "several solids": TEXT + b"solid more\nendsolid more",
}  # fmt: skip
BINARIES = {
    "as described": BINARY, "head of text": binary_of(CORNERS, head=b"solid cube"),
    "zeros behind": BINARY + bytes(37),
    "text behind": BINARY + b"written by a scanner, vertex and all",
    "no count": binary_of(CORNERS, count=0), "last tag cut": BINARY[:-2],
    "count of -1": binary_of(CORNERS, count=2**32 - 1),
}  # fmt: skip


@pytest.mark.parametrize("case", TEXTS)
def test_text_stl_file_is_read_without_rounding(tmp_path, case):
    """The coordinates are bit-identical."""
    np.testing.assert_array_equal(read(tmp_path, TEXTS[case]), CORNERS)


@pytest.mark.parametrize("case", BINARIES)
def test_binary_stl_file_is_read(tmp_path, case):
    """The format has single precision."""
    found = read(tmp_path, BINARIES[case])
    np.testing.assert_array_equal(found, CORNERS.astype("<f4"))


@pytest.mark.parametrize(("content", "message"), [
    (BINARY[:-60], "found 10 complete triangles, expected 12"),
    (b"no stl at all", "not a readable STL file"),
    (b"solid cube\nendsolid cube\n", "contains no triangles, or is not an STL file"),
    (TEXT[: TEXT.rindex(b"vertex")], "facet 12: found 2 vertices, expected 3; the"),
    (TEXT.replace(b"  endloop\n", b"vertex 1 1 1\n", 1), "facet 1: found 4 vertic"),
    (TEXT.replace(b" facet", b" faces", 1), "before the first facet: found 3"),
    (TEXT.replace(b"0.1", b"0,1", 1), 'facet 1: found "0,1", expected a coord'),
    (TEXT[: TEXT.rindex(b"\n", 0, TEXT.rindex(b"endloop")) - 4], "facet 12: the file"),
    (TEXT[: TEXT.rindex(b"vertex") + 6], "facet 12: the file is truncated"),
])  # fmt: skip
def test_damaged_stl_file_is_rejected_with_the_number_of_the_facet(
    tmp_path, content, message
):
    with pytest.raises(BadInput, match=re.escape(message).replace('"', "['\"]")) as no:
        read(tmp_path, content)
    assert "cube.stl" in str(no.value)


def test_damaged_stl_file_is_read_or_rejected_without_a_crash(tmp_path, rng):
    """Bytes are changed or removed in 500 files."""
    for number in range(500):
        content = bytearray(TEXT if number % 2 else BINARY)
        if number % 3:
            for place in rng.integers(0, len(content), 8):
                content[place] = rng.integers(256)
        else:
            first, last = np.sort(rng.integers(0, len(content), 2))
            del content[first:last]
        try:
            assert read(tmp_path, bytes(content)).shape[1:] == (3, 3)
        except BadInput:
            continue
