"""Tests of library entries for parts given by surfaces."""

import csv
import hashlib
import io
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from forcefit.commands.stiffness import app
from forcefit.inputs.table import BadInput
from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.sections import rectangular_section
from forcefit.stiffness.link import LinkStiffness, inverted, scaled
from forcefit.stiffness.report.export import library_csv
from forcefit.stiffness.report.library import look_up, read_compliance, read_entry
from forcefit.stiffness.report.library_build import build_library, read_spec
from forcefit.stiffness.report.library_surface import SurfaceLink
from forcefit.stiffness.surface.beam_surfaces import shape_surface
from tests.libraries_for_tests import SPEC, exact

LINKS = """
library = "links"
accuracy = 0.01
[[link]]
name = "bar"
surface = "bar.stl"
unit = "mm"
base = "z=0"
tip = "z=0.08"
young = 6e10
poisson = 0.3
density = 2700
"""


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """Return a folder for meshes, so that each mesh is created only once."""
    return tmp_path_factory.mktemp("meshes")


@pytest.fixture
def bar_stl(tmp_path, monkeypatch, cache):
    """Write the surface of a square bar of 20 x 20 x 80 mm to a file."""
    pyvista = pytest.importorskip("pyvista")
    monkeypatch.setenv("FORCEFIT_CACHE", str(cache))
    bar = shape_surface("rectangle", {"length": 0.08, "width": 0.02, "height": 0.02})
    path = tmp_path / "bar.stl"
    pyvista.PolyData.from_regular_faces(1000 * bar.points, bar.triangles).save(path)
    return path


@pytest.mark.slow
def test_surface_entry_has_the_digest_of_its_file_and_an_error_estimate(
    bar_stl, tmp_path
):
    """The bar with L / r = 7 is stiffer than its beam by less than 10 %."""
    spec = tmp_path / "spec.toml"
    spec.write_text(LINKS)
    command = ["library", str(spec), "--json", "-"]
    result = CliRunner().invoke(app, command, catch_exceptions=False)
    assert json.loads(result.stdout)["keys"] == ["bar"]
    entry = read_entry(tmp_path / "links", "bar")
    digest = hashlib.sha256(bar_stl.read_bytes()).hexdigest()
    assert entry.about["request"]["surface_digest"] == digest
    assert 0 < entry.about["relative_error_estimate"] <= 0.01
    assert entry.about["mass"] == pytest.approx(2700 * 0.02**2 * 0.08, rel=1e-6)
    section = rectangular_section(0.02, 0.02, 0.3)
    beam = inverted(beam_compliance(0.08, section, 6e10, 0.3, axis=[0, 0, 1]))
    ratio = np.diag(entry.stiffness) / np.diag(beam)
    assert (ratio > 1).all()
    assert (ratio < 1.1).all()
    compliance = read_compliance(tmp_path / "links", "bar")
    assert np.abs(scaled(inverted(compliance) - entry.stiffness, beam)).max() < 1e-12
    row = next(csv.DictReader(io.StringIO(library_csv([entry]))))
    assert (row["key"], float(row["young"])) == ("bar", 6e10)
    with pytest.raises(BadInput, match="only single parts, expected"):
        look_up([entry], {"young": 6e10})


def test_surface_entry_is_rebuilt_only_if_its_input_changed(
    bar_stl, tmp_path, monkeypatch
):
    made = []

    def solve(link):
        made.append(link.young)
        C = inverted(exact(0.2, 0.01, link.young))
        return LinkStiffness("made up", C, tip=np.array([0, 0, 0.2]), base=np.zeros(3))

    monkeypatch.setattr(SurfaceLink, "solve", solve)
    spec = tmp_path / "spec.toml"

    def build(text=LINKS):
        spec.write_text(text)
        (file,) = build_library(read_spec(spec))
        return file

    file = build()
    before = file.read_bytes()
    assert build().read_bytes() == before
    assert len(made) == 1
    build(LINKS.replace("6e10", "7e10"))
    assert made == [6e10, 7e10]
    bar_stl.write_bytes(bar_stl.read_bytes()[:-1] + b"\1")
    build(LINKS.replace("6e10", "7e10"))
    file.write_text("{")
    build(LINKS.replace("6e10", "7e10"))
    assert made == [6e10, 7e10, 7e10, 7e10]
    both = LINKS.replace("accuracy = 0.01", 'shape = "round"\nmethod = "beam"')
    spec.write_text(both + SPEC[SPEC.index("[grid]") :])
    names = [file.stem for file in build_library(read_spec(spec))]
    assert len(names) == 3
    assert names[-1] == "bar"


@pytest.mark.parametrize(("change", "message"), [
    (('name = "bar"', 'name = "../bar"'),
     "link[1].name: found '../bar', expected letters, digits"),
    (("bar.stl", "rab.stl"), "link[1].surface: found no file "),
    (('"z=0"', '"z=o"'), "link[1].base: found "),
    (('tip = "z=0.08"', ""), "link[1].tip: missing"),
    (("young = 6e10", "young = -1"), "link[1].young: found -1"),
    (("poisson = 0.3", "poisson = 0.5"), "link[1].poisson: found 0.5"),
    (('"mm"', '"mmm"'), "link[1].unit: found 'mmm'"),
    (("density", "densty"), 'unknown key "densty"; did you mean "density"?'),
    (("[[link]]", "[link]"), "expected tables [[link]]"),
    (("density = 2700", LINKS[LINKS.index("[[link]]") :]), 'found "bar" twice'),
    (("accuracy = 0.01", 'shape = "round"'), "grid"),
])  # fmt: skip
def test_wrong_surface_table_of_a_build_file_is_rejected(
    bar_stl, tmp_path, change, message
):
    path = tmp_path / "spec.toml"
    path.write_text(LINKS.replace(*change))
    with pytest.raises(BadInput) as caught:
        read_spec(path)
    assert message in str(caught.value)


def test_surface_without_a_given_interface_is_rejected(bar_stl, tmp_path):
    spec = tmp_path / "spec.toml"
    spec.write_text(LINKS.replace("z=0.08", "z=0.09"))
    with pytest.raises(BadInput, match='link "bar": .*tip'):
        build_library(read_spec(spec))
    assert not (tmp_path / "links").exists()


def test_step_file_becomes_a_library_entry(tmp_path, monkeypatch, cache):
    """The part is a block in millimetres."""
    gmsh = pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    monkeypatch.setenv("FORCEFIT_CACHE", str(cache))
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addBox(-10, -10, 0, 20, 20, 80)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "bar.step"))
    finally:
        gmsh.finalize()
    spec = tmp_path / "spec.toml"
    spec.write_text(LINKS.replace("bar.stl", "bar.step"))
    (file,) = build_library(read_spec(spec))
    entry = read_entry(file.parent, "bar")
    assert entry.about["surface"] == "bar.step"
    assert entry.about["mass"] == pytest.approx(2700 * 0.02**2 * 0.08, rel=1e-6)
