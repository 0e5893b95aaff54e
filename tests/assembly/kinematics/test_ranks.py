"""Ranks at their thresholds, and the rounding that they allow for."""

import numpy as np
import pytest

from assembly.kinematics.ranks import noise_of, rank_of, rank_tolerance


@pytest.mark.parametrize(("tolerance", "noise", "rank"), [
    (0.0, 0.0, 3), (0.6e-9, 0.0, 2), (0.4e-3, 0.0, 2), (0.6e-3, 0.0, 1),
    (0.0, 1e-4, 2), (0.0, 3.0, 0), (0.6e-3, 1e-4, 1), (0.6e-9, 1e-2, 1),
])  # fmt: skip
def test_a_value_counts_above_its_share_of_the_largest_and_above_noise(
    tolerance, noise, rank
):
    assert rank_of(np.array([2.0, 1e-3, 1e-9]), tolerance, noise) == rank


def test_nothing_and_zeros_have_no_rank():
    assert rank_of(np.zeros(0), 1e-9) == 0
    assert rank_of(np.zeros(2), 1e-9) == 0


def test_noise_is_relative_to_the_largest_entry():
    """In any unit, 1e-12 of it; nothing leaves none."""
    A = np.array([[3.0, -4.0], [0.0, 1.0]])
    assert noise_of(A) == pytest.approx(4e-12, rel=1e-9, abs=0.0)
    assert noise_of(1e-9 * A) == pytest.approx(4e-21, rel=1e-9, abs=0.0)
    assert noise_of(np.zeros((3, 0))) == 0.0


def test_open_closures_widen_a_threshold():
    """By 30 times what the file's rounding leaves open."""
    assert rank_tolerance(0.0) == 1e-10
    assert rank_tolerance(1e-7) == pytest.approx(3e-6, rel=1e-4)
    assert rank_tolerance(1e-7, 2.0) - 2.0 == pytest.approx(3e-6, rel=1e-4)
