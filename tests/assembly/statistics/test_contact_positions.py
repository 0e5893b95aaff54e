"""Farthest positions in discs and intervals, where they are known."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.error_distributions import draw_generator
from forcefit.assembly.statistics.clearance_positions import position_clearances
from forcefit.assembly.statistics.contact_positions import move_to_contact
from forcefit.assembly.statistics.linear_response import linear_response
from tests.tolerances_for_tests import ARM, arm


def moved(directions, starts, rows=(), free=None, positions=None):
    """The farthest positions along some directions, from the middle by default."""
    directions, starts = np.array(directions, dtype=float), np.array(starts)
    nu = starts[-1]
    free = np.ones(nu, dtype=bool) if free is None else np.array(free)
    positions = np.zeros(directions.shape) if positions is None else positions
    rows = np.array(rows, dtype=float).reshape(-1, nu)
    return move_to_contact(rows, starts, free, np.array(positions), directions)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_farthest_positions_in_discs_and_intervals_equal_closed_forms(size, rng):
    """A linear function is largest at d / |d| of a disc, at the sign of an interval."""
    directions = rng.normal(size=(6, 3)) + 0.1
    expected = np.column_stack([
        directions[:, :2] / np.linalg.norm(directions[:, :2], axis=1)[:, None],
        np.sign(directions[:, 2]),
    ])
    found = moved(size * directions, [0, 2, 3])
    np.testing.assert_allclose(found, expected, atol=1e-4)


@pytest.mark.parametrize("length", [0.05, 0.4, 5.0])
def test_contact_length_weighs_moments_against_forces(length):
    """A pin with tilt t, and the platform on an arm L along x across its axis z.

    The moments at the pin are M_x and M_y - L F_z, of deviations 1 and
    s = sqrt(1 + (L / length)^2).  Their direction is that of the tilt, so the platform
    moves along z by L t |cos|, whose median is L t s / sqrt(1 + s^2).
    """
    tilt = 2e-3
    prepared = linear_response(home_posture(arm(tilt=tilt)))
    draws = prepared.solve(np.zeros((4000, 2, 6)))
    rngs = [draw_generator(3, i, 9) for i in range(4000)]
    screws, _ = position_clearances(prepared, draws, "contact", rngs, length)
    s = np.hypot(1.0, ARM / length)
    expected = ARM * tilt * s / np.hypot(1.0, s)
    assert np.median(np.abs(screws[:, 5])) == pytest.approx(expected, rel=0.03)
