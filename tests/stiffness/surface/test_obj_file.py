"""Tests of the reader of OBJ files."""

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.surface.obj_file import read_obj
from forcefit.stiffness.surface.surface import read_surface

CORNERS = [(x, y, z) for z in (0, 0.1) for y in (0, 0.1) for x in (0, 0.1)]
SIDES = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3),
         (2, 4, 8, 6)]  # fmt: skip
POINTS = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)


def cube(corner="{k}", line="f {corners}\n"):
    """Return an OBJ file of a cube, with corners of faces in the given format."""
    faces = [" ".join(corner.format(k=k, n=k - 9) for k in side) for side in SIDES]
    return POINTS + "".join(line.format(corners=corners) for corners in faces)


CUBES = {
    "plain": cube(), "absent texture": cube("{k}/{k}"), "double slash": cube("{k}//"),
    "slash": cube("{k}/"), "absent normals": cube("{k}//{k}"),
    "absent both": cube("{k}/7/99"), "from the end": cube("{n}"),
    "continued": cube().replace("f ", "f \\\n"), "CRLF": cube().replace("\n", "\r\n"),
    "comments":
        "# made by hand\nmtllib none.mtl\n" + cube(line="s 1\nf {corners} # f\n"),
    "capitals": cube().replace("v ", "V ").replace("f ", "F "),
    "no last line end": cube()[:-1],
}  # fmt: skip


@pytest.mark.parametrize("case", CUBES)
def test_obj_corners_in_every_notation_describe_the_same_cube(tmp_path, case):
    path = tmp_path / "cube.obj"
    path.write_bytes(CUBES[case].encode())
    points, faces = read_obj(path)
    np.testing.assert_array_equal(points, CORNERS)
    assert faces == [[k - 1 for k in side] for side in SIDES]


def test_concave_polygon_is_divided_into_triangles(tmp_path):
    """The faces of the L-shaped part have an area of 0.0064 m^2, and its thickness is
    0.02 m."""
    outline = [(0, 0), (0.1, 0), (0.1, 0.04), (0.04, 0.04), (0.04, 0.1), (0, 0.1)]
    lines = [f"v {x} {y} {z}" for z in (0, 0.02) for x, y in outline]
    lines += ["f 6 5 4 3 2 1", "f 7 8 9 10 11 12"]
    for k in range(1, 7):
        lines.append(f"f {k} {k % 6 + 1} {k % 6 + 7} {k + 6}")
    path = tmp_path / "angle.obj"
    path.write_text("\n".join(lines))
    assert read_surface(path).volume == pytest.approx(1.28e-4, rel=1e-12)


@pytest.mark.parametrize(("line", "message"), [
    ("f 1 2 9", r"cube.obj:9: found point 9 in a face, expected points 1 to 8"),
    ("f 1 2 0", r"cube.obj:9: found point 0 in a face, expected points 1 to 8"),
    ("f -9 2 3", r"cube.obj:9: found point 0 in a face, expected points 1 to 8"),
    ("f 1 2", r"cube.obj:9: found a face of 2 points"),
    ("f 1 2 x", r"cube.obj:9: found 'f 1 2 x', expected f with numbers"),
    ("v 1 2", r"cube.obj:9: found 'v 1 2', expected v X Y Z"),
    ("v 1 2 z", r"cube.obj:9: found 'v 1 2 z', expected v X Y Z"),
    ("f 1 2 400000000", r"found point 400000000 in a face, expected points 1 to 8"),
    ("", "contains no triangles, or is not OBJ"),
])  # fmt: skip
def test_wrong_obj_line_is_rejected_with_its_number(tmp_path, line, message):
    path = tmp_path / "cube.obj"
    path.write_text(POINTS + line + "\n")
    with pytest.raises(BadInput, match=message):
        read_surface(path)
