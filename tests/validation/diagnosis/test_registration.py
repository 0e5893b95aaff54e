"""Where a device stands, from positions or rotations of some rows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly.effects.registration import BASE
from forcefit.inputs.table import BadInput
from tests.bar_for_tests import LENGTH, along, bar
from validation.diagnosis.registration import (
    coarse_frame,
    register,
)
from validation.diagnosis.signatures import conditions_of

TURN, SHIFT = [0.3, -0.2, 0.5], [1.0, 0.5, -2.0]


def seen_by(turn, shift):
    """(8, 6) what a device reads of a bar that is as declared."""
    p, R = LENGTH * along(bar()), Rotation.from_rotvec(turn)
    return np.hstack([np.tile(turn, (8, 1)), R.apply(p) + shift - p])


def test_without_a_position_the_shift_is_zero():
    seen = seen_by(TURN, SHIFT)
    seen[:, 3:] = np.nan
    campaign = bar(measured=seen)
    guess = coarse_frame(campaign, conditions_of(campaign))
    assert list(guess) == list(BASE)
    assert list(guess.values()) == pytest.approx([*TURN, 0, 0, 0], abs=1e-9)


@pytest.mark.parametrize("cell", range(6))
def test_rows_that_lack_a_cell_do_not_take_part(cell):
    """What they have of that kind is wrong, and so is a row without a model."""
    seen = seen_by(TURN, SHIFT)
    kind = slice(0, 3) if cell < 3 else slice(3, 6)
    seen[2, kind] += 0.3
    seen[2, cell] = np.nan
    campaign = bar(measured=seen)
    conditions = conditions_of(campaign)
    guess = coarse_frame(campaign, conditions)
    assert list(guess.values()) == pytest.approx([*TURN, *SHIFT], abs=1e-9)
    seen[2] = 0.5
    lost = np.zeros((8, 6))
    lost[2, cell] = np.nan
    guess = coarse_frame(bar(measured=seen), replace(conditions, second_order=lost))
    assert list(guess.values()) == pytest.approx([*TURN, *SHIFT], abs=1e-9)


def test_rotations_of_a_machine_that_turns_are_seen_turned():
    """R = D M: the device's rotation is left when the model's is taken off the right;
    of several that differ, the mean."""
    model = np.array([0.02, -0.03, 0.04])
    own = Rotation.from_rotvec(model)
    spread = Rotation.from_rotvec(np.outer([-1, 1] * 4, [0, 2e-3, 1e-3]))
    seen = np.full((8, 6), np.nan)
    seen[:, :3] = (Rotation.from_rotvec(TURN) * spread * own).as_rotvec()
    campaign = bar(measured=seen)
    turned = np.tile([*model, 0, 0, 0], (8, 1))
    conditions = replace(conditions_of(campaign), second_order=turned)
    guess = coarse_frame(campaign, conditions)
    assert list(guess.values())[:3] == pytest.approx(TURN, abs=1e-9)


@pytest.mark.parametrize("points", [2, 3, 4])
def test_three_points_off_one_line_are_enough(points):
    seen = seen_by(TURN, SHIFT)
    seen[:, :3], seen[points:] = np.nan, np.nan
    campaign = bar(measured=seen)
    if points < 3:
        with pytest.raises(BadInput, match="nor 3 measured points off one line"):
            coarse_frame(campaign, conditions_of(campaign))
        return
    guess = coarse_frame(campaign, conditions_of(campaign))
    assert list(guess.values()) == pytest.approx([*TURN, *SHIFT], abs=1e-8)


@pytest.mark.parametrize("known", ["campaign", "conditions"])
def test_without_sessions_of_both_one_device_is_that_of_all_rows(known):
    """Half the rows are seen from elsewhere: a compromise, the same in all."""
    seen, sessions = seen_by(TURN, SHIFT), np.array(["a", "b"] * 4)
    campaign = bar(measured=seen)
    conditions = conditions_of(campaign)
    if known == "campaign":
        campaign = replace(campaign, session=sessions)
    else:
        conditions = replace(conditions, session=sessions)
    found = register(campaign, conditions)
    assert found.base == pytest.approx([*TURN, *SHIFT], abs=1e-9)
