"""The public format of a made-up diagnosis, number by number."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from assembly.effects.registration import BASE
from assembly.model.function import Function
from tests.bar_for_tests import LONGER, TURNED, bar
from validation.diagnosis import results as module
from validation.diagnosis.candidates import CandidatePart
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.kept_aside import Errors, Rung
from validation.diagnosis.refit import Fit
from validation.diagnosis.scoring import FINITE
from validation.diagnosis.signatures import conditions_of
from validation.diagnosis.small_terms import GEOMETRY, SPRINGS, SmallTerm


def fit_of(hypotheses, values, covariance):
    conditions = conditions_of(bar())
    return Fit(
        tuple(hypotheses), np.array(values), np.array(covariance), np.zeros(1),
        conditions, np.zeros((1, len(values))),
    )  # fmt: skip


def test_an_effect_has_values_deviations_and_intervals_of_nine_in_ten():
    """1.645 standard deviations either way; what is not of the best set is not told."""
    finite = Hypothesis(FINITE, (), ())
    fit = fit_of([TURNED, LONGER, finite], [3e-4, -2e-4], np.diag([4e-10, 1e-10]))
    one = SimpleNamespace(
        campaign=bar(), fit=fit, best_by_score=("link_length", FINITE),
        probability={"link_length": 0.9},
    )  # fmt: skip
    length, motions = module.effects(one)
    assert (length["name"], length["where"]) == ("link_length", ["tip"])
    assert (length["probability"], motions["probability"]) == (0.9, 0.0)
    (number,) = length["parameters"]
    assert (number["name"], number["unit"]) == ("tip", "m")
    assert number["value"] == pytest.approx(-2e-4)
    assert number["std"] == pytest.approx(1e-5)
    interval = [-2e-4 - 1.645e-5, -2e-4 + 1.645e-5]
    assert number["interval_90"] == pytest.approx(interval)
    assert motions["parameters"] == []


class Behind:
    """Geometry of both frames and a spring of the first."""

    terms = (
        SmallTerm(GEOMETRY, np.array([0, 0, 1, 1]), np.array([2, 3, 0, 5]),
                  np.zeros((1, 4)), np.full(4, np.nan), -np.inf),
        SmallTerm(SPRINGS, np.zeros(2, int), np.array([1, 4]), np.zeros((1, 2)),
                  np.full(2, np.nan), 0.0),
    )  # fmt: skip
    scales = {GEOMETRY: (1e-4, 0.0), SPRINGS: (1e-7, 1e-9)}

    def values(self, residual):
        return [np.array([1.0, 2.0, 3.0, 4.0]), np.array([5.0, 6.0])]

    def deviations(self):
        return [np.array([0.1, 0.2, 0.3, 0.4]), np.array([0.5, 0.6])]

    def identified(self):
        return [np.array([0.5, 0.25, 0.03, 0.01]), np.array([0.9, 0.06])]


def test_small_unknowns_are_told_by_frame_and_one_by_one():
    """Frames of which hardly anything is known are left out; units by kind."""
    one = SimpleNamespace(behind=Behind(), fit=fit_of([], [], np.zeros((0, 0))),
                          campaign=bar())  # fmt: skip
    told = module.small(one, GEOMETRY)
    assert told["scale"] == {"rotation": 1e-4}
    assert told["unit"] == {"rotation": "rad", "translation": "m"}
    assert (told["unknowns"], told["identifiable"]) == (4, pytest.approx(0.79))
    assert told["frames"] == [{"frame": "drive", "identifiable": 0.75}]
    assert [
        (p["frame"], p["component"], p["value"], p["std"], p["identified"], p["unit"])
        for p in told["parameters"]
    ] == [
        ("drive", "rz", 1.0, 0.1, 0.5, "rad"), ("drive", "tx", 2.0, 0.2, 0.25, "m"),
        ("tip", "rx", 3.0, 0.3, 0.03, "rad"), ("tip", "tz", 4.0, 0.4, 0.01, "m"),
    ]  # fmt: skip
    springs = module.small(one, SPRINGS)
    units = [p["unit"] for p in springs["parameters"]]
    assert units == ["rad/(N m)", "m/N"]
    assert springs["frames"] == [
        {"frame": "drive", "identifiable": pytest.approx(0.96)}
    ]
    assert module.small(one, "nothing") is None


def test_steps_are_in_metres_or_where_none_was_read_in_radians():
    errors = Errors(1e-5, 2e-6, 3.0), Errors(float("nan"), 4e-6, 5.0)
    one = SimpleNamespace(
        ladder=[Rung(f"step {k}", k, e) for k, e in enumerate(errors)]
    )
    first, other = module.steps(one)
    assert (first["kept_aside_rms"], first["unit"]) == (1e-5, "m")
    assert (other["kept_aside_rms"], other["unit"]) == (4e-6, "rad")
    assert (first["kept_aside_rotation"], other["kept_aside_sigma"]) == (2e-6, 5.0)


def test_functions_are_told_with_the_errors_before_and_after_each(monkeypatch):
    """Two effects learned, of which the second is of two functions."""
    every = [
        Function(w, ("tx",), ("q.drive",), "powers", {"1": 2.0}, std={"1": 0.5})
        for w in ("drive", "tip", "reading")
    ]
    monkeypatch.setattr(module, "functions_of", lambda *given: [every[:1], every[1:]])
    ladder = [
        Rung(name, 0, Errors(float(k), 0.0, 0.0))
        for k, name in enumerate((
            "declared",
            "library effects",
            "learned effects",
            "learned effects",
        ))
    ]
    same = ((CandidatePart("tip", ("ty", "tz"), "time"),),)
    one = SimpleNamespace(
        ladder=ladder, campaign=None,
        model=SimpleNamespace(learned=[SimpleNamespace(equivalent=same),
                                       SimpleNamespace(equivalent=())]),
    )  # fmt: skip
    told = module.learned(one)
    assert [t["where"] for t in told] == ["drive", "tip", "reading"]
    assert [t["before"]["position"] for t in told] == [1.0, 2.0, 2.0]
    assert [t["after"]["position"] for t in told] == [2.0, 3.0, 3.0]
    assert told[0]["equivalent_places"] == [
        [{"where": "tip", "components": ["ty", "tz"], "variables": ["time"]}]
    ]
    assert told[1]["equivalent_places"] == []
    assert (told[0]["parameters"], told[0]["std"]) == ({"1": 2.0}, {"1": 0.5})
    assert told[0]["formula"] == "tx = 2 drive"


@pytest.mark.parametrize("sessions", [None, np.array([*"aaaaaaab"])])
@pytest.mark.parametrize("tool", [{}, {"tool.tx": 1e-3}])
def test_the_frame_found_is_saved_for_all_rows_or_session_by_session(sessions, tool):
    """The tool's part of a registration and other effects stay as they are."""
    campaign = replace(bar(), session=sessions, registration="unknown")
    base = np.arange(6.0)
    if sessions is not None:
        base = np.where((sessions == "a")[:, None], base, -base)
    conditions = replace(conditions_of(bar()), base=base)
    robot = campaign.robot
    declared = {
        "registration": {**tool, BASE[0]: 99.0},
        "encoder_offset": {"drive": 1.0},
    }
    robot = replace(
        robot, effects=declared, session_effects={"a": {"load_gain": {"factor": 1.1}}}
    )
    one = SimpleNamespace(
        fit=SimpleNamespace(effects={}), campaign=campaign,
        model=SimpleNamespace(conditions=conditions),
    )  # fmt: skip
    saved = module._registered(one, robot)
    found = dict(zip(BASE, np.arange(6.0).tolist(), strict=True))
    assert saved.effects["encoder_offset"] == {"drive": 1.0}
    if sessions is None:
        assert saved.effects["registration"] == {**tool, **found}
        assert saved.session_effects == robot.session_effects
        return
    assert saved.effects.get("registration", {}) == tool
    own = saved.session_effects
    assert own["a"] == {"load_gain": {"factor": 1.1}, "registration": found}
    assert own["b"] == {"registration": {k: -v for k, v in found.items()}}
