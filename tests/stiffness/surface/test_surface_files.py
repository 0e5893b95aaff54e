"""Tests of the readers of VTK, MSH and STEP files."""

import json
import subprocess
import sys

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.surface import surface_files
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.patches import find_patches
from forcefit.stiffness.surface.primitives import Cone, Plane
from forcefit.stiffness.surface.step_file import chosen_solids, read_step, sides
from forcefit.stiffness.surface.surface import read_surface
from forcefit.stiffness.surface.surface_files import step_solids
from tests.solids_for_tests import cylinder
from tests.stiffness.surface.test_obj_file import CORNERS, SIDES

TRIANGLES = [t for a, b, c, d in SIDES for t in ((a, b, c), (a, c, d))]
TETRAHEDRA = [(1, 2, 4, 6), (1, 4, 3, 7), (1, 4, 7, 6), (1, 6, 7, 5), (4, 8, 7, 6)]


def msh2(elements, kind):
    """Return the text of an MSH 2.2 file."""
    nodes = [f"{k} {x} {y} {z}" for k, (x, y, z) in enumerate(CORNERS, 1)]
    cells = [
        f"{k} {kind} 2 1 1 {' '.join(map(str, e))}" for k, e in enumerate(elements, 1)
    ]
    return "\n".join([
        "$MeshFormat", "2.2 0 8", "$EndMeshFormat",
        "$Nodes", str(len(nodes)), *nodes, "$EndNodes",
        "$Elements", str(len(cells)), *cells, "$EndElements", "",
    ])  # fmt: skip


def test_vtk_file_of_tetrahedra_and_their_surface_is_read(tmp_path):
    """The file contains tetrahedra, triangles and edges."""
    kinds = [(3, [(1, 2)]), (5, TRIANGLES), (10, TETRAHEDRA)]
    cells = [(kind, cell) for kind, some in kinds for cell in some]
    size = sum(len(cell) + 1 for _, cell in cells)
    path = tmp_path / "cube.vtk"
    path.write_text("\n".join([
        "# vtk DataFile Version 2.0", "cube", "ASCII", "DATASET UNSTRUCTURED_GRID",
        "POINTS 8 double", *(f"{x} {y} {z}" for x, y, z in CORNERS),
        f"CELLS {len(cells)} {size}",
        *(" ".join(map(str, [len(c), *(k - 1 for k in c)])) for _, c in cells),
        f"CELL_TYPES {len(cells)}", *(str(kind) for kind, _ in cells), "",
    ]))  # fmt: skip
    surface = read_surface(path)
    assert surface.volume == pytest.approx(1e-3, rel=1e-12)
    assert len(surface.triangles) == 12


@pytest.mark.parametrize(
    "content", [msh2(TRIANGLES, 2), msh2(TETRAHEDRA, 4), msh2(SIDES, 3)],
    ids=["triangles", "solid", "quads"],
)  # fmt: skip
def test_msh_file_of_a_cube_is_read(tmp_path, content, capfd):
    """The cube has 12 triangles and a volume of 1e-3 m^3."""
    path = tmp_path / "cube.msh"
    path.write_text(content)
    surface = read_surface(path)
    assert surface.volume == pytest.approx(1e-3, rel=1e-12)
    assert surface.area == pytest.approx(6e-2, rel=1e-12)
    assert len(surface.triangles) == 12
    assert surface.repairs == ()
    # results of `--json -` are printed on this stream
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize(("content", "message"), [
    ("no mesh at all", "not a readable MSH file"),
    (msh2(TRIANGLES, 2)[:300], "not a readable MSH file"),
    (msh2(TRIANGLES, 2).replace("2.2 0 8", "9.9 0 8"), "MSH 2.2 or 4.1"),
    (msh2([(1, 2)], 1), "contains neither triangles nor tetrahedra"),
    (msh2(TRIANGLES[:-1], 2), "the surface is open"),
])  # fmt: skip
def test_wrong_msh_file_is_rejected(tmp_path, content, message, capfd):
    path = tmp_path / "bad.msh"
    path.write_text(content)
    with pytest.raises(BadInput, match=message):
        read_surface(path)
    assert capfd.readouterr().out == ""


def test_step_file_is_rejected_without_gmsh(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "gmsh", None)
    path = tmp_path / "part.step"
    path.write_text("ISO-10303-21;")
    with pytest.raises(BadInput, match=r"install forcefit\[gmsh\], or export .* STL"):
        read_step(path, "")


@pytest.fixture
def gmsh():
    """Yield gmsh with a tube of diameters 40 and 30 mm and a length of 100 mm."""
    gmsh = pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    outer = gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 100, 20)
    inner = gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 100, 15)
    gmsh.model.occ.cut([(3, outer)], [(3, inner)])
    gmsh.model.occ.synchronize()
    yield gmsh
    if gmsh.isInitialized():
        gmsh.finalize()


def test_step_file_is_read_in_its_own_unit_and_its_cylinders_are_recognised(
    tmp_path, gmsh
):
    """The file is in millimetres. The volume of the facets is 0.3 % too small."""
    path = tmp_path / "tube.step"
    gmsh.write(str(path))
    gmsh.finalize()
    for unit in ("m", "mm"):
        surface = read_surface(path, unit)
        exact = np.pi * (0.02**2 - 0.015**2) * 0.1
        assert surface.volume == pytest.approx(exact, rel=4e-3)
    patches = find_patches(surface, *map(parse_interface, ("z=0", "z=0.1")))
    kinds = [type(shape) for shape in patches.shapes]
    assert kinds[:2] == [Plane, Plane]
    assert set(kinds[2:]) == {Cone}
    for shape in patches.shapes[2:]:
        assert min(abs(shape.radius - r) for r in (0.02, 0.015)) < 1e-9


SCRIPT = """
import sys
import gmsh
gmsh.initialize(interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
{}
gmsh.model.occ.synchronize()
gmsh.write(sys.argv[1])
"""


def write_step(path, *shapes):
    """Write a STEP file of several solids.

    Runs in a separate process, because the unit depends on files that were read before.
    """
    pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    script = SCRIPT.format("\n".join(f"gmsh.model.occ.add{one}" for one in shapes))
    command = [sys.executable, "-c", script, str(path)]
    subprocess.run(command, check=True, capture_output=True)
    return path


def test_one_of_several_solids_is_read_by_its_name(tmp_path, run):
    """The file contains a cylinder and a box."""
    shapes = "Cylinder(0, 0, 0, 0, 0, 100, 20)", "Box(50, 0, 0, 10, 20, 30)"
    path = write_step(tmp_path / "two.step", *shapes)
    words = r"found 2 solids \(.*\), expected the name"
    with pytest.raises(BadInput, match=words) as error:
        read_surface(path)
    names = str(error.value).partition("(")[2].partition(")")[0].split(", ")
    volumes = [read_surface(f"{path}#{name}").volume for name in names]
    exact = [np.pi * 0.02**2 * 0.1, 0.01 * 0.02 * 0.03]
    assert volumes == pytest.approx(exact, rel=4e-3)
    with pytest.raises(BadInput, match='no solid "screw"'):
        read_surface(f"{path}#screw")
    status, out, _ = run("stiffness", "fea", path, "--part", "list", "--json", "-")
    solids = json.loads(out)["solids"]
    assert status == 0
    assert [solid["name"] for solid in solids] == names
    assert [solid["volume"] for solid in solids] == pytest.approx(exact, rel=1e-6)


def test_touching_solids_are_united_and_separate_solids_are_rejected(tmp_path):
    """The file contains two boxes that touch and a separate box."""
    path = write_step(
        tmp_path / "three.step", "Box(0, 0, 0, 20, 30, 40)",
        "Box(5, 5, 40, 10, 10, 50)", "Box(100, 0, 0, 1, 1, 1)",
    )  # fmt: skip
    solids = step_solids(path)
    assert [s.volume for s in solids] == pytest.approx([24e-6, 5e-6, 1e-9], rel=1e-6)
    assert solids[1].low == pytest.approx((0.005, 0.005, 0.04), abs=1e-6)
    assert solids[1].high == pytest.approx((0.015, 0.015, 0.09), abs=1e-6)
    one, other, apart = (s.name for s in solids)
    united = read_surface(f"{path}#{one}+{other}")
    assert united.volume == pytest.approx(29e-6, rel=1e-9)
    separate = "solids form 2 separate bodies, expected one"
    for name, words in ((f"{one}+{apart}", separate), ("*", separate),
                        (f"{one}+screw", 'no solid "screw"')):  # fmt: skip
        with pytest.raises(BadInput, match=words):
            read_surface(f"{path}#{name}")


@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("dimension", [2, 3])
def test_files_written_by_gmsh_are_read(tmp_path, gmsh, version, binary, dimension):
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 24)
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", binary)
    gmsh.model.mesh.generate(dimension)
    path = tmp_path / "tube.msh"
    gmsh.write(str(path))
    surface = read_surface(path, "mm")
    exact = np.pi * (0.02**2 - 0.015**2) * 0.1
    assert surface.volume == pytest.approx(exact, rel=2e-2)


def test_damaged_step_file_is_rejected(tmp_path, gmsh):
    path = tmp_path / "part.step"
    path.write_text("rubbish")
    words = "not a readable STEP file|contains no triangles"
    with pytest.raises(BadInput, match=words):
        read_surface(path)


@pytest.mark.parametrize("kept", [0.3, 0.6, 0.9])
def test_file_that_crashes_its_reader_is_rejected(tmp_path, kept):
    """VTK crashes when it reads a truncated binary PLY file."""
    pyvista = pytest.importorskip("pyvista")
    path = tmp_path / "part.ply"
    pyvista.PolyData.from_regular_faces(*cylinder()).save(path)
    content = path.read_bytes()
    path.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(BadInput, match=r"part\.ply: not a readable PLY file"):
        read_surface(path)


def test_reader_is_stopped_at_its_time_limit(tmp_path, monkeypatch):
    """The process of the reader needs more than 1 ms."""
    path = tmp_path / "part.vtk"
    path.write_text("# vtk DataFile Version 3.0\n")
    monkeypatch.setattr(surface_files, "_TIME_LIMIT", 0.001)
    words = r"part\.vtk: the file was not read as VTK within 0\.001 s"
    with pytest.raises(BadInput, match=words):
        read_surface(path)


class Model:
    """Mock of a gmsh model with the faces of solids by tag."""

    def __init__(self, **faces):
        self.faces = faces
        self.tags = dict(enumerate(faces, 11))

    def getEntities(self, dimension):
        if dimension == 3:
            return [(3, tag) for tag in self.tags]
        return [(2, face) for one in self.faces.values() for face in one]

    def getEntityName(self, dimension, tag):
        name = self.tags[tag]
        return "" if name.startswith("_") else f"Shapes/{name.partition('__')[0]}"

    def getBoundary(self, solids, oriented):
        assert not oriented
        ((_, tag),) = solids
        return [(2, face) for face in self.faces[self.tags[tag]]]


def faces_of(model, path, solid):
    """Return the faces of a solid."""
    chosen = chosen_solids(model, path, solid)
    return list(sides(model, dict.fromkeys(chosen.values(), 0)))


def test_faces_of_a_named_solid_are_selected(tmp_path):
    path = tmp_path / "arm.step"
    assert faces_of(Model(arm=[1, 2]), path, "") == [1, 2]
    both = Model(arm=[1, 2], bolt=[3], bolt__2=[4, 5], _=[6])
    assert faces_of(both, path, "bolt") == [3]
    assert faces_of(both, path, "bolt-13") == [4, 5]
    assert faces_of(both, path, "solid14") == [6]
    with pytest.raises(BadInput, match=r"no solid .*bolz.*bolt"):
        faces_of(both, path, "bolz")
    several = r"found 4 solids \(arm, bolt, bolt-13, solid14\).*arm\.step#arm"
    with pytest.raises(BadInput, match=several):
        faces_of(both, path, "")
    crowd = Model(**{f"part{k}": [k] for k in range(25)})
    with pytest.raises(BadInput, match=r"found 25 solids .*part19\)"):
        faces_of(crowd, path, "")
