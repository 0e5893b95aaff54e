"""What rounding may leave open, and energies that cannot be told from zero."""

import numpy as np
import pytest

from assembly.linear.closure import in_reference_lengths, virtual_joints
from assembly.linear.rounding import (
    closure_rounding,
    differs_from_zero,
    drop_zeros,
    stiffness_spread,
)
from assembly.model.robot import Clearance
from assembly.solvers.cones import cone_starts
from tests.robots_for_tests import coaxial_beams

EPS = 2.0**-52


@pytest.mark.parametrize("size", [0.25, 1.0, 40.0])
def test_rounding_counts_all_that_a_closure_sums_up(size):
    """Errors, both axes of a tilt and of a radial play, an axial one: by hand."""
    errors = np.zeros((2, 6, 6))
    errors[0, 2] = [1e-3, -2e-3, 3e-3, 1e-4, 2e-4, -3e-4]
    play = Clearance(radial=1e-5, axial=2e-5, tilt=5e-4)
    joints = virtual_joints(coaxial_beams(np.zeros(6), clearance=play))
    clearances = 2 * 5e-4 + (2 * 1e-5 + 2e-5) / size
    expected = [6e-3 + 6e-4 / size + clearances, clearances]
    found = closure_rounding(errors, joints, size)
    assert found == pytest.approx(8 * EPS * np.array(expected), rel=1e-12, abs=0.0)


@pytest.mark.parametrize("size", [0.5, 1.0, 10.0])
def test_springs_are_compared_at_the_reference_length(size):
    """A link of k [N m/rad] and k [N/m]: k size^2 for shifts of the length."""
    joints = virtual_joints(coaxial_beams(np.zeros(6), stiffnesses=(1e6, 4e6)))
    # softest k or k size^2, stiffest four times the other
    expected = 4 * max(1.0, size**2) / min(1.0, size**2)
    assert stiffness_spread(joints, size) == pytest.approx(expected)


def test_no_springs_do_not_differ():
    joints = virtual_joints(coaxial_beams(np.zeros(6)), "rigid")
    assert stiffness_spread(joints, 1.0) == 0.0


def test_an_energy_differs_from_zero_beyond_gap_and_work_on_what_is_open():
    """0.4 J of gap and 0.1 of 3 + 4 N m: 1.1 J."""
    multipliers = np.array([[3.0, -4.0]] * 3)
    energies, open_ = np.array([1.0, 1.2, np.nan]), np.full(3, 0.1)
    found = differs_from_zero(energies, 0.4, multipliers, open_)
    assert found.tolist() == [False, True, True]


def test_what_is_zero_is_set_to_it_with_wrenches_that_are_rounding():
    """Under loads wrenches stay; a bound is not above its energy, nor raised to 0."""
    # 0.7 J of work on what is open; gaps 0, 0, 0.8, 0
    energy, bound = np.array([0.5, 2.0, 0.8, 0.5]), np.array([0.5, 2.0, 0.0, 0.5])
    bound[2] = -0.1
    multipliers = np.array([[3.0, -4.0]] * 4)
    loaded = np.array([False, False, False, True])
    drop_zeros(energy, bound, multipliers, np.full(4, 0.1), loaded)
    assert energy.tolist() == [0.0, 2.0, 0.0, 0.0]
    assert bound.tolist() == [0.0, 2.0, -0.1, 0.0]
    assert multipliers.any(axis=1).tolist() == [False, True, True, True]


def test_columns_of_cones_and_factors_of_screws():
    assert cone_starts(np.array([0, 0, 1, 2, 2, 2])).tolist() == [0, 2, 3, 6]
    assert cone_starts(np.zeros(0, dtype=int)).tolist() == [0]
    assert in_reference_lengths(4.0).tolist() == [1, 1, 1, 0.25, 0.25, 0.25]
