"""Test the choice of the held-out rows."""

import numpy as np
import pytest

from forcefit.validation.diagnosis.holdout import hold_out
from tests.campaigns_for_tests import campaign_of


def held_in(campaign):
    """Return the held-out rows of each fold."""
    return [np.flatnonzero(fold).tolist() for fold in hold_out(campaign).folds]


@pytest.mark.parametrize(("configurations", "how", "judge"), [
    (60, "split", 15), (80, "split", 20), (240, "split", 60), (1000, "split", 100),
    (59, "folds", 59), (9, "folds", 9),
])  # fmt: skip
def test_whole_configurations_are_held_out(configurations, how, judge):
    """One quarter is held out, and a smaller fraction of many configurations.

    Few configurations are all held out in folds.
    """
    repeat = np.random.default_rng(0).permutation(np.repeat(range(configurations), 2))
    campaign = campaign_of(np.ones((len(repeat), 6)), repeat=repeat)
    held = hold_out(campaign)
    assert (held.how, len(held.folds)) == (how, 1 if how == "split" else 5)
    judging = [set(repeat[fold]) for fold in held.folds]
    assert sum(len(names) for names in judging) == judge
    for fold, names in zip(held.folds, judging, strict=True):
        assert not names & set(repeat[~fold])
    assert len(set.union(*judging)) == judge
    again = hold_out(campaign)
    assert all(map(np.array_equal, again.folds, held.folds))


def test_time_spans_are_held_out_if_there_are_few_configurations():
    """Each of 16 time spans contains three rows and is held out in one fold."""
    order = np.random.default_rng(0).permutation(48)
    campaign = campaign_of(
        np.ones((48, 6)), repeat=np.arange(48) % 3, time=60.0 * order
    )
    held = hold_out(campaign)
    assert "5 folds over 16 spans of time" in held.words
    spans = [np.unique(order[fold] // 3, return_counts=True) for fold in held.folds]
    assert np.array_equal(np.sort(np.concatenate([s for s, _ in spans])), np.arange(16))
    assert all((counts == 3).all() for _, counts in spans)


@pytest.mark.parametrize(("rows", "folds"), [(1, 1), (2, 2), (3, 3), (7, 5)])
def test_small_campaign_holds_out_every_row_once(rows, folds):
    campaign = campaign_of(np.ones((rows, 6)), time=60.0 * np.arange(rows))
    parts = held_in(campaign)
    assert len(parts) == folds
    assert sorted(sum(parts, [])) == list(range(rows))
    assert (hold_out(campaign).how == "none") == (rows == 1)
