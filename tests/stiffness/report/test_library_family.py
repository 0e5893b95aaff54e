"""Tests of families of parts in libraries."""

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.link import LinkStiffness, inverted, scaled
from forcefit.stiffness.report.library import look_up, read_library
from forcefit.stiffness.report.library_build import build_library, read_spec
from forcefit.stiffness.report.library_surface import SurfaceLink
from tests.libraries_for_tests import exact

SPEC = """
library = "links"
[[family]]
name = "rod"
table = "rods.csv"
base = "z=0"
tip = "z={length}"
young = 6e10
poisson = 0.3
"""
LENGTHS = (0.2, 0.3, 0.4, 0.5, 0.6)


@pytest.fixture
def parts(tmp_path, monkeypatch):
    """Return a folder with the surfaces of five rods, whose stiffness is computed by
    beam theory."""
    asked = []

    def solve(link):
        asked.append(link)
        length, radius = link.sizes["length"], link.sizes["radius"]
        C = inverted(exact(length, radius, link.young))
        tip = np.array([0.0, 0.0, length])
        return LinkStiffness("closed form", C, tip=tip, base=np.zeros(3))

    monkeypatch.setattr(SurfaceLink, "solve", solve)
    rows = [f"rod{k}.stl,{length},0.02" for k, length in enumerate(LENGTHS)]
    for k in range(len(LENGTHS)):
        (tmp_path / f"rod{k}.stl").write_text(f"solid {k}")
    (tmp_path / "rods.csv").write_text("\n".join(["surface,length,radius", *rows]))
    (tmp_path / "spec.toml").write_text(SPEC)
    return tmp_path, asked


def test_each_row_of_a_family_table_becomes_an_entry_with_its_sizes(parts):
    folder, asked = parts
    files = build_library(read_spec(folder / "spec.toml"))
    assert [one.tip for one in asked] == [f"z={length!r}" for length in LENGTHS]
    assert files[0].stem == "rod-length0.2-radius0.02"
    entries = read_library(folder / "links")
    assert entries[2].parameters["length"] == 0.4
    build_library(read_spec(folder / "spec.toml"))
    assert len(asked) == len(LENGTHS)  # no entry is computed again


def test_build_recomputes_only_the_part_whose_file_changed(parts):
    folder, asked = parts
    build_library(read_spec(folder / "spec.toml"))
    (folder / "rod1.stl").write_text("solid changed")
    build_library(read_spec(folder / "spec.toml"))
    assert [one.surface.name for one in asked[len(LENGTHS) :]] == ["rod1.stl"]


@pytest.mark.parametrize("length", [0.25, 0.37, 0.55])
def test_estimated_interpolation_error_in_a_family_covers_the_true_error(parts, length):
    folder, _ = parts
    build_library(read_spec(folder / "spec.toml"))
    K, error = look_up(read_library(folder / "links"), {"length": length})
    truth = exact(length, 0.02)
    assert (np.abs(K - truth) <= error + 1e-9 * np.abs(truth).max()).all()
    assert np.abs(scaled(error, truth)).max() < 0.02


def test_estimated_error_covers_an_omitted_entry(parts):
    folder, _ = parts
    build_library(read_spec(folder / "spec.toml"))
    entries = read_library(folder / "links")
    for left in entries[1:-1]:  # entries between two others
        others = [one for one in entries if one is not left]
        K, error = look_up(others, {"length": left.parameters["length"]})
        gap = np.abs(scaled(K - left.stiffness, left.stiffness))
        assert gap.max() <= scaled(error, left.stiffness).max()


@pytest.mark.parametrize(("old", "new", "message"), [
    ("surface,length", "file,length", "rods.csv: line 1: found .*expected a header"),
    ("rod1.stl", "gone.stl", "rods.csv: line 3: found no file .*gone.stl"),
    ("0.3,0.02", "0.3", "rods.csv: line 3: found 2 cells, expected 3"),
    ("0.3,0.02", "thick,0.02", "line 3, length: found 'thick', expected a length"),
    ("0.3,0.02", "-0.3,0.02", "line 3, length: found '-0.3', expected a length"),
    ("0.3,0.02", "0.2,0.02", '"rod-length0.2-radius0.02" twice'),
])  # fmt: skip
def test_wrong_family_table_is_rejected(parts, old, new, message):
    folder, _ = parts
    table = folder / "rods.csv"
    table.write_text(table.read_text().replace(old, new, 1))
    with pytest.raises(BadInput, match=message) as error:
        read_spec(folder / "spec.toml")
    assert "\n" not in str(error.value)


def test_interface_that_names_an_unknown_size_is_rejected(parts):
    folder, _ = parts
    (folder / "spec.toml").write_text(SPEC.replace("{length}", "{height}"))
    with pytest.raises(BadInput, match="line 2: tip"):
        read_spec(folder / "spec.toml")


def test_library_of_several_families_requires_a_family_name(parts):
    folder, _ = parts
    second = SPEC.partition("[[family]]")[2].replace('"rod"', '"bar"')
    (folder / "spec.toml").write_text(SPEC + "[[family]]" + second)
    build_library(read_spec(folder / "spec.toml"))
    entries = read_library(folder / "links")
    with pytest.raises(BadInput, match="found the families bar, rod, expected"):
        look_up(entries, {"length": 0.3})
    with pytest.raises(BadInput, match='no family "rood"'):
        look_up(entries, {"length": 0.3}, "rood")
    K, _ = look_up(entries, {"length": 0.3}, "rod")
    assert np.abs(scaled(K - exact(0.3, 0.02), K)).max() < 1e-12
