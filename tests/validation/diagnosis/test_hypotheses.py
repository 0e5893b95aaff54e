"""Test the list of hypotheses for a campaign."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.validation.diagnosis.hypotheses import hypotheses
from forcefit.validation.diagnosis.signatures import conditions_of
from tests.bar_for_tests import BEAM, bar

TIME = 60.0 * np.arange(8)


def named(conditions, loads=()):
    """Return for each effect the names of the unknowns in each slot."""
    found: dict[str, list] = {}
    for one in hypotheses(conditions, loads):
        own = [slot.names for slot in one.slots]
        found.setdefault(one.effect, []).append(own)
    return found


@pytest.mark.parametrize(("covariate", "effect", "values", "told"), [
    ("temperature", "thermal_expansion", np.linspace(0, 4, 8), True),
    ("temperature", "thermal_expansion", np.full(8, 3.0), True),
    ("temperature", "thermal_expansion", np.zeros(8), False),
    ("temperature", "thermal_expansion", np.full(8, np.nan), False),
    ("temperature", "thermal_expansion", np.append(np.ones(7), np.nan), False),
    ("time", "drift", TIME, True), ("time", "drift", np.full(8, 60.0), False),
    ("time", "drift", np.zeros(8), False),
])  # fmt: skip
def test_effect_requires_a_complete_and_nonzero_covariate(
    covariate, effect, values, told
):
    """A drift also requires different times."""
    conditions = conditions_of(bar(link=BEAM))
    given = replace(conditions, **{covariate: values})
    assert (effect in named(given)) is told
    others = set(named(given)) ^ set(named(conditions))
    assert others == ({effect} if told else set())


def test_load_offsets_are_tested_only_in_recorded_directions():
    """The factor and the offsets are tested together and separately."""
    found = named(conditions_of(bar(link=BEAM)), ["fy", "mz"])["load_gain"]
    assert found == [
        [("factor",), ("offset.mz",), ("offset.fy",)], [("factor",)],
        [("offset.mz",), ("offset.fy",)],
    ]  # fmt: skip
    assert named(conditions_of(bar(link=BEAM)))["load_gain"] == [[("factor",)]]
