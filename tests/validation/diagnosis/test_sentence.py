"""Test the text about learned functions and error rates."""

from dataclasses import replace

import pytest

from forcefit.assembly.model.function import Function
from forcefit.validation.diagnosis.calibration import Calibration
from forcefit.validation.diagnosis.sentence import calibration_text, formula

PRODUCT = {"0.0": 1.0, "1.0": 2.0, "0.1": 3.0, "2.1": -4.0}


@pytest.mark.parametrize(
    ("form", "parameters", "expected"),
    [
        ("powers", {"0": 1e-3, "1": 2e-3, "3": -4e-3},
         "rz = 0.001 + 0.002 drive + -0.004 drive^3"),
        ("waves", {"1.sine": 2e-5, "2.cosine": 3e-5},
         "rz = 2e-05 sin(1 drive) + 3e-05 cos(2 drive)"),
        ("waves", {"0.cosine": 1e-3, "2.sine": 3e-5},
         "rz = 0.001 + 3e-05 sin(2 drive)"),
        ("waves", {"1.sine": 2e-5, "period": 0.01},
         "rz = 2e-05 sin(2 pi 1 drive/0.01)"),
        ("knee", {"below": 2e-5, "above": 1e-6, "at": 4.0},
         "rz = 2e-05 drive up to 4 + 1e-06 drive beyond 4"),
        ("knee", {"size": 8e-5, "at": 0.01}, "rz = 8e-05 drive's sign from 0.01"),
        ("step", {"size": 2.0, "at": 0.5}, "rz = 2 step.size(drive)"),
        ("powers", PRODUCT, "rz = 1 + 2 drive + 3 bed + -4 drive^2 bed"),
        ("powers", {"rz.1": 2e-3, "tx.1": 3e-3},
         "rz = 0.002 drive; tx = 0.003 drive (times the wrench there)"),
    ],
)  # fmt: skip
def test_formula_equals_expected_text_for_each_form(form, parameters, expected):
    components = ("rz", "tx") if "tx.1" in parameters else ("rz",)
    variables = ("q.drive", "cov.bed") if parameters is PRODUCT else ("q.drive",)
    kind = "compliance" if "tx.1" in parameters else "screw"
    function = Function("drive", components, variables, form, parameters, kind)
    assert formula(function) == expected


def test_calibration_text_contains_counts_and_percentages():
    tally = Calibration(
        20, {"none_needed": 19, "explained": 1}, {"explained": 18, "ambiguous": 2},
        0.85, 0.025,
    )  # fmt: skip
    assert calibration_text(tally) == (
        "verdicts on 20 simulated campaigns of each kind: with noise alone explained "
        "1, none_needed 19; with the identified effects ambiguous 2, explained 18; "
        "85 % with the correct effects; false claims 2.5 %"
    )
    unnamed = calibration_text(replace(tally, right=float("nan")))
    assert "correct effects" not in unnamed
