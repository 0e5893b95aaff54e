"""Tests of libraries of links."""

import csv
import io
import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.beam.curve import curve_compliance
from forcefit.stiffness.link import inverted, scaled
from forcefit.stiffness.report import library_build
from forcefit.stiffness.report.export import stiffness_for, translations_first
from forcefit.stiffness.report.library import (
    look_up,
    read_compliance,
    read_entry,
    read_library,
)
from forcefit.stiffness.report.library_build import (
    Spec,
    build_library,
    entry_key,
    read_spec,
)
from forcefit.stiffness.surface.beam_surfaces import SHAPES, shape_beam
from tests.libraries_for_tests import GRID, MATERIAL, SPEC, exact

EXAMPLE = Path(__file__).parents[3] / "examples" / "link_library.toml"


@pytest.fixture
def spec(tmp_path):
    return Spec(tmp_path / "links", "round", "beam", GRID | MATERIAL)


def test_library_entry_has_the_stiffness_of_its_parameters(spec):
    files = build_library(spec)
    assert len(files) == 9
    key = "round-beam-length0.3-radius0.02-young6e+10-poisson0.3"
    entry = read_entry(spec.folder, key)
    gap = scaled(entry.stiffness - exact(0.3, 0.02), entry.stiffness)
    assert np.abs(gap).max() < 1e-9
    C = read_compliance(spec.folder, key)
    np.testing.assert_allclose(C, np.linalg.inv(entry.stiffness), rtol=1e-9, atol=1e-20)
    assert entry.parameters["radius"] == 0.02
    assert entry.about["program"].startswith("forcefit")
    assert entry.about["date"].endswith("+00:00")


def test_interrupted_library_build_continues_with_the_missing_entries(
    spec, monkeypatch
):
    made = []
    whole = library_build._make_entry

    def stops_after_four(spec, point):
        if len(made) == 4:
            raise KeyboardInterrupt
        made.append(point)
        whole(spec, point)

    monkeypatch.setattr(library_build, "_make_entry", stops_after_four)
    with pytest.raises(KeyboardInterrupt):
        build_library(spec)
    assert len(read_library(spec.folder)) == 4
    seen = []
    monkeypatch.setattr(
        library_build, "_make_entry", lambda s, p: (seen.append(p), whole(s, p))
    )
    build_library(spec)
    assert len(seen) == 5
    assert len(read_library(spec.folder)) == 9


def test_two_processes_build_all_library_entries(spec):
    told = []
    build_library(spec, workers=2, update=lambda *step: told.append(step))
    assert (told[0], told[-1]) == ((0, 9), (9, 9))
    assert len(read_library(spec.folder)) == 9


def test_estimated_error_between_grid_points_covers_the_true_error(spec, rng):
    """A grid with three points in each direction results in an error of 2 %."""
    build_library(spec)
    entries = read_library(spec.folder)
    for _ in range(20):
        length, radius = rng.uniform(0.2, 0.45), rng.uniform(0.01, 0.04)
        wanted = {"length": length, "radius": radius, "young": 6e10, "poisson": 0.3}
        K, error = look_up(entries, wanted)
        truth = exact(length, radius)
        gap = np.abs(scaled(K - truth, truth)).max()
        assert gap <= scaled(error, K).max() + 1e-9
        assert gap < 0.02


@pytest.mark.parametrize(("change", "message"), [
    ({"radius": 0.05}, "radius = 0.05 is outside the grid, expected 0.01 .. 0.04"),
    ({"radios": 0.02}, 'unknown parameter "radios"; did you mean "radius"?'),
    ({"radius": None}, "radius: missing; expected a value"),
])  # fmt: skip
def test_look_up_outside_the_grid_or_with_other_parameters_is_rejected(
    spec, change, message
):
    build_library(spec)
    wanted = {"length": 0.3, "radius": 0.02, "young": 6e10, "poisson": 0.3} | change
    wanted = {k: v for k, v in wanted.items() if v is not None}
    with pytest.raises(BadInput) as caught:
        look_up(read_library(spec.folder), wanted)
    assert message in str(caught.value)


def test_grid_with_a_missing_entry_is_rejected(spec):
    files = build_library(spec)
    files[0].unlink()
    wanted = {"length": 0.3, "radius": 0.02, "young": 6e10, "poisson": 0.3}
    with pytest.raises(BadInput, match="grid of parameters is incomplete"):
        look_up(read_library(spec.folder), wanted)


def test_entry_with_other_parameters_is_rejected(spec):
    """A parameter was renamed, or the folder contains entries of two libraries."""
    build_library(spec)
    *others, last = read_library(spec.folder)
    renamed = {"*" if k == "young" else k: v for k, v in last.parameters.items()}
    mixed = [*others, replace(last, parameters=renamed)]
    with pytest.raises(BadInput) as caught:
        look_up(mixed, {"length": 0.2})
    assert f"{last.key} has the parameters length, radius, *," in str(caught.value)


def changed(change):
    """Return the changed text of an entry."""

    def text(whole):
        content = json.loads(whole)
        change(content)
        return json.dumps(content)

    return text


FORCES_FIRST = ["FX", "FY", "FZ", "MX", "MY", "MZ"]


@pytest.mark.parametrize(("text", "message"), [
    (lambda _: "rubbish", "damaged entry"),
    (lambda _: "[]", "damaged entry"),
    (lambda _: "[" * 100_000, "damaged entry"),
    (lambda _: "{}", 'entry of a library; expected the format "forcefit link 1"'),
    (lambda _: '{"format": "forcefit link 1"}', "damaged entry (KeyError)"),
    (changed(lambda entry: entry.update(wrench=FORCES_FIRST)),
     "the components in another order, expected RX"),
    (changed(lambda entry: entry["stiffness"][0].__setitem__(0, -1.0)),
     "not positive definite"),
])  # fmt: skip
def test_wrong_entry_is_rejected(spec, text, message):
    (file, *_) = build_library(spec)
    file.write_text(text(file.read_text()))
    with pytest.raises(BadInput) as caught:
        read_entry(spec.folder, file.stem)
    assert message in str(caught.value)


def test_missing_entry_or_library_is_rejected(spec, tmp_path):
    build_library(spec)
    with pytest.raises(BadInput, match='no entry "round-beam"'):
        read_entry(spec.folder, "round-beam")
    with pytest.raises(BadInput, match="no entry"):
        read_entry(spec.folder, "../links/x")
    with pytest.raises(BadInput, match="found no library"):
        read_entry(tmp_path / "absent", "x")


@pytest.mark.parametrize(("change", "message"), [
    (("round", "rond"), 'unknown "rond"; did you mean "round"?'),
    (("radius", "radios"), 'unknown length "radios"'),
    (("0.01", "-0.01"), "radius: found -0.01, expected a length > 0"),
    (("0.01", '"a"'), "expected a finite number, or a list"),
    (("[0.2, 0.3]", "[0.2, 0.2]"), "found a value twice"),
    (("young = 6e10", ""), "young: missing"),
    (('"beam"', '"bem"'), '"beam"'),
    (('shape = "round"', 'shape = "tube"'), "inner_radius: missing"),
    (('method = "beam"', 'method = "beam"\nfoo = 1'), 'unknown key "foo"'),
])  # fmt: skip
def test_wrong_build_file_is_rejected(tmp_path, change, message):
    path = tmp_path / "spec.toml"
    path.write_text(SPEC.replace(*change))
    with pytest.raises(BadInput) as caught:
        read_spec(path)
    assert message in str(caught.value)


def test_library_commands_build_entries_and_read_them(run, tmp_path):
    spec = tmp_path / "spec.toml"
    spec.write_text(EXAMPLE.read_text())
    _, out, _ = run("stiffness", "library", spec, "--json", "-")
    keys = json.loads(out)["keys"]
    assert len(keys) == 16
    read = partial(run, "stiffness", "library", tmp_path / "link_library")
    assert read()[1].count("\n") == 16
    at = "length=0.37,radius=0.02,young=6e10,poisson=0.3"
    table = json.loads(read("--at", at, "--json", "-")[1])
    truth = exact(0.37, 0.02)
    gap = np.abs(scaled(np.array(table["stiffness"]) - truth, truth)).max()
    assert gap < table["relative_error_estimate"] < 0.02
    rows = list(csv.DictReader(io.StringIO(read("--to", "csv")[1])))
    assert len(rows) == 16
    row = next(r for r in rows if r["length"] == "0.45" and r["radius"] == "0.04")
    assert float(row["K_RX_RX"]) == pytest.approx(exact(0.45, 0.04)[0, 0], rel=1e-9)
    assert read("--to", "mapdl", "--key", keys[0])[1].count("RMORE") == 12
    for words, message in ((["--to", "adams"], "--key: missing"),
                           (["--at", "length"], "expected NAME=NUMBER")):  # fmt: skip
        status, _, err = read(*words)
        assert (status, message in err) == (2, True)


def test_exported_stiffness_has_translations_before_rotations():
    K = exact(0.3, 0.02)
    swapped = translations_first(K)
    assert swapped[0, 0] == K[3, 3]
    assert swapped[4, 0] == K[1, 3]
    written = {}
    exec(stiffness_for("exudyn", K), {}, written)
    np.testing.assert_allclose(written["stiffness"], swapped, rtol=1e-12, atol=1e-3)
    lines = stiffness_for("mapdl", K).splitlines()[1:]
    numbers = [float(v) for line in lines for v in line.split(",")[-6:]]
    assert len(numbers) == 78
    # the last entry of the lower triangle of [[K, -K], [-K, K]] is K[5, 5]
    assert numbers[-1] == pytest.approx(swapped[5, 5])
    assert numbers[0] == pytest.approx(swapped[0, 0])
    with pytest.raises(BadInput, match='did you mean "adams"'):
        stiffness_for("adam", K)


@pytest.mark.slow
def test_library_of_finite_elements_has_stiffness_and_mass_of_the_bar(tmp_path):
    grid = {"length": (0.2,), "radius": (0.03,), "young": (6e10,), "poisson": (0.3,)}
    grid["density"] = (2700.0,)
    spec = Spec(tmp_path / "links", "round", "fea", grid)
    (file,) = build_library(spec)
    entry = read_entry(spec.folder, file.stem)
    ratio = entry.stiffness[2, 2] / exact(0.2, 0.03)[2, 2]
    assert ratio == pytest.approx(1, abs=1e-5)
    assert entry.about["mass"] == pytest.approx(2700 * np.pi * 0.03**2 * 0.2, rel=1e-5)
    assert len(entry.about["geometry"]) == 64


SHIPPED = EXAMPLE.parent / "stiffness_library"
# Stiffnesses RX, RZ, TX and TZ of links between the entries of the distributed library,
# computed with an error of 1e-6 by benchmarks/evidence/stiffness_round_references.py
BETWEEN = {
    ("round", 0.25): (137442.8, 26455.52, 6526643.0, 355428100.0),
    ("round", 0.37): (94455.39, 17875.35, 2061490.0, 239366500.0),
    ("tube", 0.25): (60592.8, 12645.57, 2796218.0, 98155280.0),
    ("tube", 0.37): (43336.49, 8544.305, 933078.5, 66207970.0),
    ("cone", 0.25): (86712.04, 28632.81, 9460910.0, 399129400.0),
    ("cone", 0.37): (59765.09, 19370.76, 3017814.0, 269134000.0),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_distributed_library_contains_all_entries_of_its_build_file(shape):
    """The keys are compared with those that a build would create."""
    spec = read_spec(SHIPPED / f"{shape}.toml")
    assert (spec.shape, spec.method) == (shape, "fea")
    entries = read_library(SHIPPED / shape)
    assert {e.key for e in entries} == {entry_key(spec, p) for p in spec.points()}
    for entry in entries:
        assert entry.about["mesh"]["reached"]
        assert entry.about["relative_error_estimate"] <= spec.accuracy
        assert len(entry.about["geometry"]) == 64


@pytest.mark.parametrize(("shape", "length"), BETWEEN)
def test_estimated_interpolation_error_covers_the_true_error(shape, length):
    K, error = look_up(read_library(SHIPPED / shape), {"length": length})
    i = [0, 2, 3, 5]
    exact = np.array(BETWEEN[shape, length])
    gap = np.abs(np.diag(K)[i] - exact)
    assert (gap <= np.diag(error)[i]).all()
    assert (gap < 0.01 * exact).all()


@pytest.mark.parametrize("shape", ["rectangle", "box"])
def test_distributed_square_links_are_slightly_stiffer_than_beams(shape):
    """Rigid ends increase the bending stiffness by at most 0.3 b / L. Only a box in
    torsion is more compliant than its beam.
    """
    K, _ = look_up(read_library(SHIPPED / shape), {"length": 0.37})
    lengths = read_spec(SHIPPED / f"{shape}.toml").grid
    lengths = {k: lengths[k][0] for k in SHAPES[shape]} | {"length": 0.37}
    beam = inverted(curve_compliance(shape_beam(shape, lengths, 0.33), 7e10, 0.33))
    ratio = np.diag(K) / np.diag(beam)
    assert ((ratio[[0, 1, 3, 4, 5]] > 1) & (ratio[[0, 1, 3, 4, 5]] < 1.05)).all()
    assert 1 < ratio[2] < 1.06
