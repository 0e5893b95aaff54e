"""Test the selection of effects for a bar with analytical solutions."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.validation.diagnosis.select import select
from tests.bar_for_tests import BEAM, LENGTH, along, bar, columns_of

ROWS = 40
TIME = 60.0 * np.random.default_rng(0).permutation(ROWS)
CAMPAIGN = bar(link=BEAM, rows=ROWS, spread=6.0, time=TIME)
TURN = CAMPAIGN.coordinates[:, 0]
ACROSS = np.cross([0, 0, 1], along(CAMPAIGN))


@pytest.fixture(scope="module")
def columns():
    return columns_of(CAMPAIGN)


def turned(angle):
    """Return the readings (R, 6) of a bar for drive errors (R,)."""
    still = np.zeros((ROWS, 2))
    return np.hstack([still, angle[:, None], LENGTH * angle[:, None] * ACROSS])


def found(columns, readings, seed=0, *, noise=1.0):
    """Return the selected model for readings (R, 6) with noise.

    Three of four cells are fitted.
    """
    z = (readings / CAMPAIGN.sigma).ravel()
    z = z + noise * np.random.default_rng(seed).normal(size=len(z))
    cells = columns.row % 4 > 0
    return select(columns, z[cells], cells)


@pytest.mark.parametrize("noise", [0.5, 1.0, 2.0, 3.0])
def test_no_effect_is_selected_from_noise(columns, noise):
    selected = found(columns, np.zeros((ROWS, 6)), noise=noise)
    assert selected.hypotheses == selected.functions == ()
    assert max(selected.probability.values(), default=0.0) < 0.1
    assert selected.noise.tau == pytest.approx(noise, rel=0.2)


def test_length_error_of_a_bar_is_identified(columns):
    sigma = CAMPAIGN.sigma[0, 3]
    longer = np.hstack([np.zeros((ROWS, 3)), 8 * sigma * along(CAMPAIGN)])
    selected = found(columns, longer)
    assert [h.effect for h in selected.hypotheses] == ["link_length"]
    # The standard error from 30 fitted rows is sigma / sqrt(30).
    assert selected.values[0] == pytest.approx(8 * sigma, abs=4 * sigma / 30**0.5)


def test_order_of_a_gear_harmonic_is_identified(columns):
    sigma = CAMPAIGN.sigma[0, 3]
    selected = found(columns, turned(12 * sigma * np.sin(5 * TURN + 0.4)))
    assert selected.hypotheses == ()
    (one,) = selected.functions
    (part,) = one.candidate.parts
    assert (part.where, part.components, part.variable) == ("drive", ("rz",), "q.drive")
    assert one.candidate.shape.names == ("5.sine", "5.cosine")
    assert one.probability > 0.9


def test_growth_of_a_bar_is_identified_as_function_of_time(columns):
    sigma = CAMPAIGN.sigma[0, 3]
    grown = 12 * sigma * (TIME / TIME.max())[:, None] * along(CAMPAIGN)
    selected = found(columns, np.hstack([np.zeros((ROWS, 3)), grown]))
    assert selected.hypotheses == ()
    assert {f.candidate.parts[0].variable for f in selected.functions} == {"time"}
    assert selected.functions[0].candidate.parts[0].where != "reading"


def test_model_search_excludes_outliers(columns):
    sigma = CAMPAIGN.sigma[0, 3]
    readings = np.zeros((ROWS, 6))
    readings[[1, 10, 21], [3, 4, 3]] = 40 * sigma
    selected = found(columns, readings)
    assert selected.hypotheses == selected.functions == ()
    assert (selected.weights < 0.5).sum() == 3


def test_effects_visible_only_through_round_off_are_excluded():
    campaign = bar(link=BEAM, rows=ROWS, spread=0.0, time=TIME)
    measured = np.full((ROWS, 6), np.nan)
    measured[:, 3] = 0.0  # a drive rotation does not change this component
    campaign = replace(campaign, measured=measured)
    known = columns_of(campaign)
    assert (("drive", "rz", "screw"),) not in known.functions.places.names
    assert (("tip", "tx", "screw"),) in known.functions.places.names + [
        p for equal in known.functions.places.equal for p in equal
    ]


@pytest.mark.parametrize("size", [6.0, 25.0])
def test_no_function_is_selected_from_a_single_row(columns, size):
    readings = np.zeros((ROWS, 6))
    readings[17] = size * CAMPAIGN.sigma[17] * [1, -1, 1, 1, -1, 1]
    selected = found(columns, readings)
    assert selected.functions == ()
