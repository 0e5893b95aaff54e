"""Learned functions and verdicts as readable text."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.assembly.model.function import Function
from forcefit.validation.diagnosis import sentence as module
from forcefit.validation.diagnosis.calibration import Calibration
from forcefit.validation.diagnosis.holdout import HeldOut
from forcefit.validation.diagnosis.lack_of_fit import Trend
from forcefit.validation.diagnosis.sentence import (
    calibration_text,
    formula,
    open_text,
    sentence,
)


def test_formula_of_a_product_names_both_variables():
    numbers = {"0.0": 1.0, "1.0": 2.0, "0.1": 3.0, "2.1": -4.0}
    function = Function("drive", ("rz",), ("q.drive", "cov.bed"), "powers", numbers)
    assert formula(function) == "rz = 1 + 2 drive + 3 bed + -4 drive^2 bed"


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
    ],
)  # fmt: skip
def test_formula_has_each_coefficient_before_its_factor(form, parameters, expected):
    function = Function("drive", ("rz",), ("q.drive",), form, parameters)
    assert formula(function) == expected


def test_calibration_text_states_counts_and_shares():
    tally = Calibration(
        20, {"none_needed": 19, "explained": 1}, {"explained": 18, "ambiguous": 2},
        0.85, 0.025,
    )  # fmt: skip
    assert calibration_text(tally) == (
        "simulated on this design, 20 campaigns each: with noise alone explained 1, "
        "none_needed 19; with the effects found ambiguous 2, explained 18; "
        "85 % named the effects; false claims 2.5 %"
    )
    unnamed = calibration_text(replace(tally, right=float("nan")))
    assert "named the" not in unnamed


def test_formula_of_a_compliance_states_the_factor_of_the_wrench():
    function = Function(
        "drive", ("rz", "tx"), ("q.drive",), "powers",
        {"rz.1": 2e-3, "tx.1": 3e-3}, "compliance",
    )  # fmt: skip
    expected = "rz = 0.002 drive; tx = 0.003 drive (times the wrench there)"
    assert formula(function) == expected


SAID = [
    ({"verdict": "none_needed"}, "distinguish the residual from noise (7.00 sigma"),
    ({"verdict": "explained"}, "lacks a and b and springs; on held-out rows the"),
    ({"verdict": "learned"}, "lacks a and b and t0 and t1 and t2 and t3 (with"),
    ({"verdict": "ambiguous"}, "these effects: a or nothing or a + b or c; on held"),
    ({"verdict": "outside_library"}, "sigma, which varies with x0, x1, x2; on held"),
    ({"verdict": "outside_library", "trends": ()}, "rows, 2.50 sigma; on held"),
    ({"verdict": "not_enough_rows"}, "distinguish a cause from chance; on held"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "expected"), SAID)
def test_verdict_sentence_states_the_supporting_findings(
    monkeypatch, changes, expected
):
    """At most six names, four sets and three trends."""
    monkeypatch.setattr(module, "titles", lambda one: [f"t{k}" for k in range(6)])
    sets = ("a",), (), ("a", "b"), ("c",), ("d",)
    one = SimpleNamespace(**{
        "before": SimpleNamespace(normalised=7.0),
        "noise": SimpleNamespace(normalised=1.0),
        "after": SimpleNamespace(normalised=1.5), "lack": SimpleNamespace(rms=2.5),
        "claimed": ("a", "b"), "alternatives": tuple((names, 0.2) for names in sets),
        "fit": SimpleNamespace(
            unknowns=SimpleNamespace(small=(SimpleNamespace(name="springs"),))
        ),
        "held": HeldOut("split", (np.array([False, True]),), ""), "uncertainty": 0.25,
        "setup": (),
        "trends": tuple(Trend(f"x{k}", 0.1, 0.0) for k in range(5)),
    } | changes)  # fmt: skip
    assert expected in sentence(one)
    one.held = HeldOut("none", (np.ones(2, bool),), "")
    assert "on the fitted rows (too few to hold any out)" in sentence(one)


def test_text_states_the_number_of_rows_with_a_free_motion():
    assert "undetermined in 2 of 3 rows" in open_text(np.array([True, False, True]))
