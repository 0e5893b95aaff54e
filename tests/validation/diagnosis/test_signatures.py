"""Conditions of a campaign and tangents of its effects, on a bar known by hand."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.measurement.predict import predict
from assembly.model.function import Function
from forcefit.inputs.table import BadInput
from tests.bar_for_tests import BEAM, LONGER, TURNED, bar, fit_of
from tests.planar_arm_for_tests import SIGMA
from validation.diagnosis import derivatives
from validation.diagnosis import signatures as module
from validation.diagnosis.derivatives import Derivatives
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.signatures import (
    Tangents,
    conditions_of,
    loaded_components,
    whiten,
)
from validation.diagnosis.trace import FINITE


def test_the_weight_has_the_direction_that_covariates_say():
    """Zero where they do not."""
    along = {"gravity.x": np.arange(8.0), "gravity.z": np.full(8, -9.81)}
    here = conditions_of(bar(**along))
    expected = np.column_stack([np.arange(8.0), np.zeros(8), np.full(8, -9.81)])
    assert here.gravity.tolist() == expected.tolist()
    assert not conditions_of(bar()).gravity.any()


@pytest.mark.parametrize("name", ["bed", "approach"])
@pytest.mark.parametrize("given", [True, False])
def test_a_function_of_a_covariate_needs_its_column(name, given):
    """But for the side from which one comes, which rows before may tell."""
    function = (
        Function("reading", ("tx",), ("q.drive",), "reversal", {"0": 1e-6})
        if name == "approach"
        else Function("reading", ("tx",), (f"cov.{name}",), "powers", {"1": 1e-6})
    )
    campaign = bar(**({name: np.ones(8)} if given else {}))
    robot = replace(campaign.robot, functions=(function,))
    campaign = replace(campaign, robot=robot)
    if given or name == "approach":
        assert len(conditions_of(campaign)) == 8
    else:
        with pytest.raises(BadInput, match=f"expected a column cov.{name}"):
            conditions_of(campaign)


def test_components_of_the_load_that_act_anywhere_are_named():
    loads = np.zeros((8, 6))
    loads[3, 4], loads[:, 2] = -2.0, 1.0
    assert loaded_components(replace(bar(), loads=loads)) == ["mz", "fy"]


def test_the_residual_is_the_reading_less_what_is_declared():
    """A bar declared 0.1 mm longer, read 0.3 mm longer; some cells not measured."""
    plain = bar()
    errors = np.zeros((2, 6))
    errors[1, 3] = 1e-4
    seen = fit_of(plain, 3e-4)
    seen[2:4, 1] = np.nan
    robot = plain.robot.with_errors(errors)
    campaign = replace(plain, robot=robot, measured=seen)
    tangents = Tangents(campaign, Derivatives(conditions_of(campaign)))
    expected = (fit_of(plain, 2e-4) / SIGMA)[np.isfinite(seen)]
    found = whiten(campaign, campaign.measured) - tangents.declared
    assert found == pytest.approx(expected, abs=1e-9)
    assert len(tangents.declared) == 46


@pytest.mark.parametrize("size", [0.3, 1.01])
def test_an_unknown_that_does_not_show_at_its_own_size_has_no_column(size):
    """Of 0.001 sigma in all readings together."""
    slot = LONGER.slots[0]
    column = np.full(4, 0.5) / slot.unknown.scale * 1e-3 * size
    found = module._seen(column, slot)
    assert found.any() == (size > 1)


@pytest.mark.parametrize("size", [0.1, 0.25, 0.3, 1.0])
def test_an_effect_without_unknowns_is_looked_at_where_loads_are_large(
    monkeypatch, size
):
    """Rows loaded most say whether the squares of all exceed two.

    Of 40 rows four are loaded, and of those each reading changes by ``size`` sigma.
    """
    rows = 40
    loads = np.zeros((rows, 6))
    loads[[3, 9, 20, 30], 4] = 10.0
    campaign = replace(bar(rows=rows), loads=loads)
    tangents = Tangents(campaign, Derivatives(conditions_of(campaign)))
    finite = Hypothesis(FINITE, (), ())
    seen = []

    def apply(conditions, effects):
        return replace(conditions, exact=True)

    class Read:
        def __init__(self, conditions):
            loaded = conditions.load.any(axis=1)[:, None]
            seen.append(int(loaded.sum()))
            self.deviation = SIGMA * loaded * (1 + size * conditions.exact)

    monkeypatch.setattr(module, "apply_effects", apply)
    monkeypatch.setattr(module, "predict", Read)
    declared = Read(tangents.derivatives.conditions)
    tangents.derivatives.declared = declared.deviation
    invisible = tangents._invisible(finite)
    assert seen[-1] == 4
    # of the rows looked at, those of largest load and of largest rotation, the same
    assert invisible == (size**2 * 240 < 2.0)


def test_an_effect_without_an_answer_is_invisible(monkeypatch):
    campaign = bar([0, 0, 0, 0, 5.0, 0])
    tangents = Tangents(campaign, Derivatives(conditions_of(campaign)))
    finite = Hypothesis(FINITE, (), ())

    def unanswered(conditions, effects):
        return replace(conditions, reading=np.full((len(conditions), 6), np.nan))

    monkeypatch.setattr(module, "apply_effects", unanswered)
    assert tangents._invisible(finite)
    found = tangents.at_start(finite)
    assert found.columns.shape == (48, 0)
    assert not found.offset.any()


def test_a_visible_effect_without_unknowns_is_an_offset():
    """Of a soft drive that turns far, finite motions say much."""
    spring = np.diag([np.inf, np.inf, 2e3, np.inf, np.inf, np.inf])
    campaign = bar([0, 0, 0, 0, 150.0, 0], spring=spring)
    tangents = Tangents(campaign, Derivatives(conditions_of(campaign)))
    found = tangents.at_start(Hypothesis(FINITE, (), ()))
    exact = predict(replace(tangents.derivatives.conditions, exact=True)).deviation
    assert found.offset == pytest.approx(whiten(campaign, exact) - tangents.declared)
    assert found.columns.shape == (48, 0)


@pytest.mark.parametrize("rest", [None, "held"])
@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("effect", ["joint_clearance", "encoder_offset"])
def test_clearances_of_an_effect_are_taken_up_in_the_linear_model(
    monkeypatch, rest, exact, effect
):
    """Where they are not held already."""
    campaign = bar(link=BEAM)
    tangents = Tangents(campaign, Derivatives(conditions_of(campaign)))
    settled = []

    def settle(conditions):
        settled.append(conditions)
        return conditions, None

    held = None if rest is None else np.zeros((8, 2, 6))
    plain = tangents.derivatives.conditions
    changed = replace(plain, rest=held, exact=exact)
    monkeypatch.setattr(
        derivatives, "apply_effects", lambda conditions, effects: changed
    )
    monkeypatch.setattr(derivatives, "with_clearances_taken_up", settle)
    monkeypatch.setattr(derivatives, "predict", lambda conditions: predict(plain))
    assert len(tangents.model({effect: {}})) == 48
    taken_up = effect == "joint_clearance" and rest is None and not exact
    assert len(settled) == taken_up


def test_columns_are_taken_once(monkeypatch):
    """And again for another effect."""
    campaign = bar(link=BEAM)
    tangents = Tangents(campaign, Derivatives(conditions_of(campaign)))
    model, asked = tangents.derivatives.model, []

    def watched(effects):
        asked.append(tuple(effects))
        return model(effects)

    tangents.derivatives.model = watched
    first, again = tangents.at_start(LONGER), tangents.at_start(LONGER)
    assert asked == [("link_length",)]
    assert first.columns.tolist() == again.columns.tolist()
    tangents.at_start(TURNED)
    assert len(asked) == 2
