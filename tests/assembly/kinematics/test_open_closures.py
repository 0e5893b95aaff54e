"""Nominal closures that do not quite close."""

import math

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture, place_robot
from assembly.model.robot import Frame, Robot
from forcefit.inputs.table import BadInput


def frame(name, parent="base", at=(0, 0, 0), **more):
    return Frame(name, parent, np.array(at, float), np.zeros(3), **more)


def parallelograms(digits, error=0.0):
    """Three equal cranks on one coupler: overconstrained, numbers rounded."""
    q = 0.7
    height = round(math.sqrt(0.05), digits) + error
    shifts = [(0.0, 0.0), (0.5, 0.0), (round(1 / 3, digits), height)]
    frames, closures = [], []
    for i, (x, y) in enumerate(shifts):
        frames += [
            frame(f"crank{i}", at=(x, y, 0), joint="revolute", position=q,
                  actuated=i == 0),
            frame(f"pin{i}", f"crank{i}", (0.3, 0, 0), joint="revolute", position=-q),
            frame(f"tip{i}", f"pin{i}", (-(1 / 3 if i == 2 else x),
                  -(math.sqrt(0.05) if i == 2 else y), 0)),
        ]  # fmt: skip
        if i:
            closures.append((f"tip{i}", "tip0"))
    return Robot("cranks", "tip0", tuple(frames), tuple(closures))


def test_what_six_digits_leave_open_is_accepted_and_reported():
    """Rounding leaves up to 5e-7 m per number; below 1e-6 it is dropped."""
    posture = home_posture(parallelograms(digits=6))
    assert 1e-9 < posture.mismatch < 1e-6
    assert home_posture(parallelograms(digits=15)).mismatch < 1e-12
    moved = place_robot(parallelograms(digits=6), joints={"crank0": 0.9})
    assert moved.mismatch < 1e-6


def test_what_is_open_by_more_than_a_micrometre_is_refused_by_name():
    with pytest.raises(BadInput, match=r'closure\[2\] \("tip2", "tip0"\)') as caught:
        home_posture(parallelograms(digits=15, error=1e-4))
    assert "expected < 1e-06" in str(caught.value)
