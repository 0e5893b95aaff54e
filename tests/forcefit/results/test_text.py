"""Values and tables as text: units, rounding, and missing numbers."""

import math

import pytest

from forcefit.results.quantities import LABELS, QUANTITIES, number
from forcefit.results.text import (
    in_unit,
    lines_of,
    readings_text,
    value_text,
)
from forcefit.results.units import FACTORS

SI = {"mm": "m", "um": "m", "mrad": "rad", "urad": "rad", "MPa": "Pa", "%": "1"}


@pytest.mark.parametrize("name", QUANTITIES)
def test_display_unit_is_a_multiple_of_the_si_unit(name):
    known = QUANTITIES[name]
    for shown, unit in zip(
        known.display_unit.split(", "), known.unit.split(", "), strict=True
    ):
        assert shown == unit or (SI[shown] == unit and shown in FACTORS)
    assert known.kind == "number" or known.unit == "1"


@pytest.mark.parametrize(("name", "value", "expected"), [
    ("energy", 2.820441e-05, "2.82044e-05 J"),
    ("platform_screw", [1e-3, 0, 0, 0, 2.5e-3, 0], "[1 0 0] mrad, [0 2.5 0] mm"),
    ("load", [0, 0, 1, 0, 0, -50], "[0 0 1] N m, [0 0 -50] N"),
    ("rotation_error", (1.5e-3, 1.25e-2), "1.5 to 12.5 mrad"),
    ("stress", 2.5e8, "250 MPa"),
    ("margin", 0.25, "0.25"),
    ("margin", math.inf, "without bound"),
    ("margin", None, "none"),
    ("energy", math.nan, "none"),
    ("energy", 1e-12, "1e-12 J"),
    ("passed", False, "no"),
    ("verdict", "explained", "explained"),
    ("names", [], "none"),
    ("names", ["a", "b"], "a, b"),
    ("pose", {"tx": 0.1, "tz": -0.5}, "[0.1 -0.5] m"),
    ("pose", {"tx": 0.1, "rz": 0.2}, "[0.2] rad, [0.1] m"),
])  # fmt: skip
def test_value_text_uses_the_display_unit(name, value, expected):
    assert value_text(name, value) == expected


def test_reading_errors_are_written_in_display_units():
    assert in_unit(1.23456e-5, "um") == "12.35 um"
    assert in_unit(0.5, "") == "0.5"
    assert value_text(number("length", "m"), 0.125) == "0.125 m"
    sizes = {"position": 1.2e-5, "rotation": math.nan, "normalised": 1.1}
    assert readings_text(sizes) == "12 um, 1.1 sigma"
    assert readings_text({"position": None}) == "unknown"


def test_result_lines_omit_absent_quantities():
    results = {"status": "ok", "energy": 1.0, "zone": {"margin": None}}
    assert lines_of(results, "status zone.margin zone.margin_free energy load") == {
        "zone margin, compliant joints rigid": "none", "assembly energy": "1 J",
    }  # fmt: skip
    failed = {"status": "free motion", "reason": "it turns"}
    assert lines_of(failed, "status reason") == {
        "status": "free motion", "reason": "it turns"
    }  # fmt: skip


def test_dimension_labels_equal_screw_and_wrench_labels():
    from forcefit.stiffness.screws import SCREW, WRENCH

    assert LABELS["screw"] == SCREW
    assert LABELS["wrench_component"] == WRENCH
