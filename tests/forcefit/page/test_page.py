"""Tests of report pages: numbers, escaping and embedded resources."""

import math
import re

import numpy as np
import pytest

from forcefit.inputs.errors import BadInput
from forcefit.page.charts import Axis, Layer, bars, chart, matrix, value_map
from forcefit.page.page import Page, Provenance, Tile, page, results_in, section
from forcefit.page.tables import Column, Value, table
from forcefit.results.units import shown_in
from tests.pages_for_tests import parse

ODD = "</script><b>&\"' $x$ \\u003c"
SIZE = 5_000_000  # [byte] maximum size of a page


def written(*body, **changes):
    content = {
        "title": ODD, "verdict": ODD, "good": True, "about": ODD, "body": body,
        "tiles": [Tile(ODD, [ODD, Value(7.943e-4, "m", 3)])], "assumed": [ODD],
        "provenance": Provenance(ODD), "results": {ODD: [ODD, 1.5, math.nan]},
    }  # fmt: skip
    return page(Page(**{**content, **changes}))


@pytest.mark.parametrize(("value", "unit", "text"), [
    (7.943e-4, "m", "0.7943 mm"),
    (7.943e-5, "m", "79.43 µm"),
    (-0.013, "rad", "-13 mrad"),
    (math.pi / 2, "rad", "90 deg"),
    (2.5e-5, "rad", "25 µrad"),
    (0.0, "m", "0 mm"),
    (1.926, "J", "1.926 J"),
    (3.874e3, "N", "3874 N"),
    (2.1e11, "Pa", "210 GPa"),
    (2.5e8, "N/m", "250 N/µm"),
    (math.inf, "m", "unbounded"),
    (math.nan, "m", "none"),
    (0.25, "", "0.25"),
    (3.0, "m/s^2", "3 m/s^2"),
])  # fmt: skip
def test_page_shows_numbers_in_display_units(value, unit, text):
    (cell,) = parse(table(["a"], [[Value(value, unit)]])).tables[0][1]
    assert cell.text == text
    assert cell.value == pytest.approx(value, nan_ok=True)


def test_unit_factor_converts_si_to_the_shown_unit():
    for unit, size in (("m", 1.0), ("m", 1e-6), ("rad", 1e-3), ("Pa", 1e6), ("N", 1.0)):
        shown = shown_in(unit, size)
        assert shown.unit == unit
        ratio = {"mm": 1e3, "µm": 1e6, "mrad": 1e3, "MPa": 1e-6, "N": 1.0}
        assert shown.factor == ratio[shown.shown]


def test_table_cell_preserves_all_digits():
    value = 0.1 + 0.2  # 0.30000000000000004
    rows = [["a", value], ["b", 2.0]]
    head, first, _ = parse(table(["", Column("shift", "m")], rows)).tables[0]
    assert [cell.text for cell in head] == ["", "shift [mm]"]
    assert head[1].si == "shift [m]"
    assert (first[1].text, first[1].value, first[1].si) == ("300", value, "0.3")


def test_names_on_a_page_are_escaped_in_html_and_json():
    trace = {"type": "scatter", "x": [0.0], "y": [1.0], "name": ODD}
    named = bars({ODD: 1.0}, Axis(ODD, "m"), ODD)
    drawn = chart([trace], Axis(ODD), Axis(ODD), ODD)
    text = written(section(ODD, table([ODD], [[ODD]], ODD)), named, drawn)
    assert "<b>" not in text
    seen = parse(text)
    assert seen.results == {ODD: [ODD, 1.5, None]}
    assert seen.tables[0][1][0].text == ODD
    assert seen.figures[1]["traces"][0]["name"] == ODD
    assert "<" not in seen.figures[0]["traces"][0]["y"][0]  # plotly interprets tags
    assert results_in(text, "x") == seen.results


def test_contents_list_links_to_every_section_of_the_page():
    text = written(section("First: part", ""), section("2nd part", ""))
    contents = re.search(r"<nav aria-label=Contents>(.*?)</nav>", text).group(1)
    links = dict(re.findall(r'<a href="#([^"]+)">([^<]+)</a>', contents))
    assert list(links.values()) == [
        "First: part", "2nd part", "Assumptions", "Provenance",
    ]  # fmt: skip
    assert [text.count(f'id="{name}"') for name in links] == [1, 1, 1, 1]


def test_report_page_is_small_and_needs_no_network():
    text = written(bars({"a": 1.0}, Axis("x"), ""))
    assert parse(text).fetched == []
    assert "@import" not in text
    assert "url(" not in text
    assert 700_000 < len(text) < SIZE  # with plotly.js
    assert len(written()) < 50_000  # without figures, plotly.js is not embedded
    assert written() == written()


def test_map_contains_every_number_in_si_units():
    values = np.array([[1e-4, 2e-4, np.nan], [4e-4, 5e-4, 6e-4]])
    axes = [(Axis("tx", "m"), np.array([0.0, 0.1])), (Axis("tz", "m"), np.arange(3.0))]
    layers = [Layer("shift", "shift", "m", values)]
    states = np.full((2, 3), "ok")
    (spec,) = parse(value_map(axes, layers, states, "")).figures
    held = np.array(spec["layers"][0]["values"], dtype=float)
    np.testing.assert_array_equal(held, values)
    assert (spec["layers"][0]["shown"], spec["layers"][0]["factor"]) == ("mm", 1e3)
    assert spec["axes"]["x"]["values"] == [0.0, 0.1]


def test_constant_quantity_is_written_as_text():
    """Rounding errors of a constant would otherwise appear as a pattern."""
    axes = [(Axis("tx", "m"), np.arange(3.0))]
    flat = Layer("energy", "energy", "J", np.full(3, 2.0) * (1 + 1e-16 * np.arange(3)))
    none = Layer("margin", "margin", "", np.full(3, np.inf))
    text = value_map(axes, [flat, none], np.full(3, "ok"), "")
    assert parse(text).figures == []
    assert "energy is the same everywhere" in text
    assert parse(text).numbers[0].text == "2 J"
    some = Layer("shift", "shift", "m", np.arange(3.0))
    (spec,) = parse(value_map(axes, [flat, some], np.full(3, "ok"), "")).figures
    assert [layer["drawn"] for layer in spec["layers"]] == [False, True]


def test_signed_matrix_has_a_symmetric_colour_scale():
    (spec,) = parse(matrix([[1.0, -3.0], [0.5, 2.0]], "ab", "t", "c", True)).figures
    (trace,) = spec["traces"]
    assert (trace["zmin"], trace["zmax"]) == (-3.0, 3.0)


def test_page_states_the_command_and_digests_of_its_input_files(tmp_path):
    read = tmp_path / "robot.toml"
    read.write_bytes(b"abc")
    gone = tmp_path / "gone.toml"
    provenance = Provenance("forcefit study x.toml", [read, gone])
    rows = {
        r[0].text: r[1].text for r in parse(written(provenance=provenance)).tables[0]
    }
    assert rows["command"] == "forcefit study x.toml"
    # test vector "abc" of FIPS 180-2
    assert rows["SHA-256 of robot.toml"] == (
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    )
    assert rows["SHA-256 of gone.toml"].startswith("can no longer be read")
    assert {"forcefit", "Python", "numpy", "clarabel"} <= set(rows)


@pytest.mark.parametrize(("text", "message"), [
    ("<!doctype html><p>", "x: found an HTML page without forcefit results"),
    ("hello", "neither HTML nor JSON, expected a forcefit report or JSON"),
    ("[" * 100_000, "x: found text that is neither HTML nor JSON, expected"),
    ("[1]", "x: found a JSON list or value, expected a JSON object"),
])  # fmt: skip
def test_page_without_results_is_rejected(text, message):
    with pytest.raises(BadInput, match=message):
        results_in(text, "x")
