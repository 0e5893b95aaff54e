"""Test the terminal text of a diagnosis."""

from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.validation.diagnosis import text as module
from forcefit.validation.diagnosis.next_measurement import load_text

NONE = float("nan")


def errors(position, rotation, normalised):
    return {"position": position, "rotation": rotation, "normalised": normalised}


def step(term, unknowns, rms, sigma):
    return {"term": term, "unknowns": unknowns, "kept_aside_rms": rms, "unit": "m",
            "kept_aside_sigma": sigma}  # fmt: skip


def made(**changes):
    """Return the plain values of a diagnosis without identified effects."""
    return {
        "campaign": "arm", "verdict": "none_needed", "sentence": "Enough.",
        "effects": [], "geometry": None, "springs": None, "learned": [],
        "alternatives": [
            {"names": ["drift"], "probability": 0.75},
            {"names": [], "probability": 0.25},
        ],
        "held_out": {"ids": ["m2", "m3"], "words": "2 rows, drawn once"},
        "error": {
            "before": errors(3e-5, 2e-6, 7.0), "after": errors(1e-5, NONE, 1.5),
            "saved": errors(8e-6, 3e-6, 1.0),
            "noise": {"position": 5e-6, "rotation": 1e-6},
            "with_outliers": {"before": errors(2e-5, 1e-6, 8.0),
                              "after": errors(9e-6, 1e-6, 2.25)},
        },
        "noise_scale": {"findings": [], "normalised": 1.2}, "noise_in_time": None,
        "needed": "", "not_measured": [], "outliers": [], "open": [],
        "ladder": [step("declared", 0, 3e-5, 7.0), step("geometry", 4.6, 1e-5, 1.5)],
        "structure": [], "next_measurement": None, "remarks": [],
    } | changes  # fmt: skip


@pytest.fixture
def shown(monkeypatch):
    """Return a function that formats given plain values as lines of text."""

    def lines(**changes):
        monkeypatch.setattr(module, "table", lambda diagnosis, tally: made(**changes))
        rows = [name in changes.get("open", []) for name in ("m0", "m1", "m2", "m3")]
        return module.text(SimpleNamespace(open=np.array(rows))).splitlines()

    return lines


def test_diagnosis_text_omits_absent_sections(shown):
    """It contains the header, the sets of effects, the errors and the models."""
    said = shown()
    assert said[:2] == ["arm: none_needed", "Enough."]
    at = said.index("sets of effects, by probability:")
    assert said[at + 1 : at + 3] == ["   0.750  drift", "   0.250  none"]
    assert said[at + 4] == (
        "errors on 2 rows, drawn once; errors of the saved robot on all rows"
    )
    assert [line.split() for line in said[at + 5 : at + 9]] == [
        ["before", "after", "noise", "saved"],
        ["position", "[m]", "3e-05", "1e-05", "5e-06", "8e-06"],
        ["rotation", "[rad]", "2e-06", "-", "1e-06", "3e-06"],
        # Noise that is common to the points of a row is not included in sigma.
        ["normalised", "[sigma]", "7", "1.5", "1.2", "1"],
    ]
    assert [line.split() for line in said[at + 10 :]] == [
        ["model", "unknowns", "m", "sigma", "reduction"],
        ["declared", "0", "3e-05", "7"],
        ["geometry", "5", "1e-05", "1.5", "2e-05"],
    ]


def test_errors_with_outliers_require_held_out_outliers(shown):
    """If an outlier is among the fitted rows, only its name is printed."""
    fitted = shown(outliers=["m1"])
    assert "excluded as outliers: m1" in fitted
    assert not any(line.startswith("with outliers") for line in fitted)
    aside = shown(outliers=["m1", "m3"])
    assert "excluded as outliers: m1, m3" in aside
    (more,) = [line for line in aside if line.startswith("with outliers")]
    assert more.split() == ["with", "outliers", "8", "2.25", "1.2"]


def test_text_contains_residual_trends_and_the_next_measurement(shown):
    following = {
        "why": "a and b differ", "configuration": {"q.one": 0.5},
        "load": [0.0, 0, 0, 10.0, 0, 0], "covariates": {"temperature": 5.0},
    }  # fmt: skip
    said = shown(
        structure=[{"against": "cov.bed", "share": 0.42}], next_measurement=following,
        remarks=["odd"], open=["m0"],
    )  # fmt: skip
    assert "odd" in said
    assert any("undetermined in 1 of 4 rows" in line for line in said)
    assert "residual varies with cov.bed: 42 %" in said
    assert said[-2:] == [
        "measure next: q.one=0.5; load fx=10, temperature 5",
        "  a and b differ",
    ]
    assert load_text((0.0,) * 6) == "none"


def test_text_contains_values_of_effects_and_functions(shown):
    """Long formulas are truncated at 160 characters."""
    number = {"name": "one", "value": 2e-5, "std": 1e-6, "unit": "rad"}
    effect = {"name": "encoder_offset", "probability": 0.98, "parameters": [number]}
    function = {
        "label": "tool tx, ty of q.one",
        "formula": "x" * 200, "equivalent_places": [[], []],
        "parts_of_range": {"variable": "q.j1", "without": 5.0, "after": 1.25},
    }  # fmt: skip
    geometry = {"name": "geometric_errors", "combinations": 2.0, "parameters": []}
    said = shown(effects=[effect, geometry], learned=[function])[3:9]
    assert [line.split() for line in said[:2]] == [
        ["encoder_offset", "(probability", "0.980)"],
        ["one", "2e-05", "+-", "1e-06", "rad"],
    ]
    assert said[2:] == [
        "learned: tool tx, ty of q.one",
        f"  {'x' * 157}...",
        "  extrapolation error over the range of q.j1: 1.25 sigma, "
        "without the function 5 sigma",
        "  2 equivalent other locations",
    ]
