"""Error messages for invalid links in robot files."""

import pytest

from tests.robot_files_for_tests import BEAM, LINK, assert_refused, mesh, rows

REFUSED_LINKS = {
    "an asymmetric link": (
        LINK, f"link = {{ stiffness = {rows({(3, 6): 0.1})} }}",
        'frame "coupler".link.stiffness: not symmetric: found [3, 6] = 1.000000e-01 '
        "but [6, 3] = 0.000000e+00, expected equal numbers"),
    "a link of nothing": (
        LINK, "link = {}",
        'frame "coupler".link: found no type of link, expected exactly one of "beam" | '
        '"stiffness" | "mesh" | "library"'),
    "a link of two kinds": (
        BEAM, f'{BEAM}, library = "x#y"',
        'frame "coupler".link: found "beam" and "library", expected exactly one of '
        '"beam" | "stiffness" | "mesh" | "library"'),
    "a misspelt kind of link": (
        BEAM, "beem = { radius = 0.04 }",
        'frame "coupler".link: unknown key "beem"; did you mean "beam"?'),
    "no Young's modulus": (
        "young = 6e10, ", "",
        'frame "coupler".link.young: missing; expected a finite number > 0 [Pa]'),
    "an incompressible link": (
        "poisson = 0.3", "poisson = 0.5",
        'frame "coupler".link.poisson: found 0.5, expected a finite number > -1 and < '
        "0.5 [-]"),
    "no section": (
        BEAM, "beam = {}",
        'frame "coupler".link.beam: found no section, expected one section: "radius" '
        '[, "inner_radius"] or "width", "height" or "area", "I_y", "I_z", "J", '
        '"shear_y", "shear_z"'),
    "two sections": (
        BEAM, "beam = { radius = 0.04, width = 0.1 }",
        'frame "coupler".link.beam: found "radius" and "width", expected one section'),
    "half a section": (
        BEAM, "beam = { width = 0.1, hight = 0.2 }",
        'frame "coupler".link.beam.height: missing; expected a finite number > 0 [m]; '
        'found "hight" instead'),
    "a tube with no wall": (
        "inner_radius = 0.03", "inner_radius = 0.04",
        'frame "coupler".link.beam.inner_radius: found 0.04, expected a finite number '
        ">= 0 and < 0.04 [m]"),
    "a radius below any machine": (
        BEAM, "beam = { radius = 1e-30 }",
        'frame "coupler".link.beam.radius: found 1e-30, expected at least 1e-12 [m]'),
    "another beam theory": (
        BEAM, 'beam = { radius = 0.04, theory = "timoschenko" }',
        "frame \"coupler\".link.beam.theory: found 'timoschenko', expected "
        '"timoshenko" | "euler"; did you mean "timoshenko"?'),
    "a length without an axis": (
        BEAM, "beam = { radius = 0.04, length = 0.5 }",
        'frame "coupler".link.beam.axis: missing; expected "length" and "axis", or '
        "neither"),
    "an axis of zero": (
        BEAM, "beam = { radius = 0.04, length = 1, axis = [0, 0, 0] }",
        'frame "coupler".link.beam.axis: found [0.0, 0.0, 0.0], expected a nonzero '
        "direction vector"),
    "up along the beam": (
        BEAM, "beam = { width = 0.1, height = 0.2, up = [-2, 0, 0] }",
        'frame "coupler".link.beam.up: up = '),
    "a beam between two origins that are one": (
        "mass = 1.2", f"[[frame]]\nname = 'x'\nparent = 'base'\n{LINK}",
        'frame "x".link: found a distance of 0 m from the parent; expected '
        'a translation, or a beam with "length" and "axis"'),
    "too many pieces": (
        "poisson = 0.3 }", "poisson = 0.3, pieces = 101 }",
        'frame "coupler".link.pieces: found 101, expected a finite number >= 1'),
    "half a piece": (
        "poisson = 0.3 }", "poisson = 0.3, pieces = 2.5 }",
        'frame "coupler".link.pieces: found 2.5, expected a whole number'),
    "an interface of another syntax": (
        BEAM, mesh(tip='"z=half"'),
        'frame "coupler".link.mesh.tip: found '),
    "a number for an interface": (
        BEAM, mesh(tip="0.5"),
        'frame "coupler".link.mesh.tip: found 0.5'),
    "no interface": (
        BEAM, 'mesh = { surface = "x.stl", base = "z=0" }',
        'frame "coupler".link.mesh.tip: missing; expected an interface such as '
        '"z=0.452"'),
    "a bore without an axis": (
        BEAM, mesh(tip="{ bore = { point = [0, 0, 0], radius = 0.1 } }"),
        'frame "coupler".link.mesh.tip.bore.axis: missing; expected 3 finite numbers'),
    "an interface with an unknown key": (
        BEAM,
        mesh(tip="{ plane = { point = [0, 0, 0], normal = [0, 0, 1] }, raduis = 1 }"),
        'frame "coupler".link.mesh.tip: unknown key "raduis"; did you mean "radius"?'),
    "a bore with an unknown key": (
        BEAM,
        mesh(tip="{ bore = { point = [0,0,0], axis = [0,1,0], radius = 1, h = 2 } }"),
        'frame "coupler".link.mesh.tip.bore: unknown key "h"; valid: axis, point, '
        "radius"),
    "a part of a mesh without a modulus": (
        BEAM, mesh() + ', parts = ["solid=end/poisson=0.3"]',
        "frame \"coupler\".link.parts: found 'solid=end/poisson=0.3', expected "),
    "parts of a mesh that are no list": (
        BEAM, mesh() + ', parts = "solid=end/young=1e9,poisson=0.3"',
        "frame \"coupler\".link.parts: found 'solid=end/young=1e9,poisson=0.3', "
        "expected a list such as "),
    "a mesh with an unknown key": (
        BEAM, mesh(more=", units = 1"),
        'frame "coupler".link.mesh: unknown key "units"; did you mean "unit"?'),
    "a stiffness beyond any machine": (
        LINK, f"link = {{ stiffness = {rows({(2, 2): 1e50})} }}",
        'frame "coupler".link.stiffness: found 1e+50 as term [2, 2], expected between '
        "1e-40 and 1e+40"),
    "a unit that is none": (
        BEAM, mesh(more=', unit = "mmm"'),
        "frame \"coupler\".link.mesh.unit: found 'mmm', expected \"m\" | "),
    "a mesh that knows up where the frame does not": (
        BEAM, mesh(more=", up = [1, 0, 0]"),
        'frame "coupler".up: missing; expected the "up" of the mesh and of the frame, '
        "or neither"),
    "up for a beam in the frame": (
        "mass = 1.2", "up = [0, 0, 1]",
        'frame "coupler".up: found "up" in a frame without a mesh link'),
    "a library without a key": (
        BEAM, 'library = "links.nc"',
        "frame \"coupler\".link.library: found 'links.nc', expected "
        '"path/to/library#key"'),
}  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "message"), REFUSED_LINKS.values(), ids=REFUSED_LINKS
)
def test_invalid_link_is_rejected(old, new, message, write_file):
    assert_refused(write_file, old, new, message)
