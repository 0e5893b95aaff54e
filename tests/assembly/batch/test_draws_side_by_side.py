"""Draws side by side against points one by one, and against each other."""

import numpy as np
import pytest

from assembly.batch import one_posture
from assembly.batch.draws_side_by_side import Energies, least_energies
from assembly.batch.many_draws import prepare_energies
from assembly.kinematics.posture import home_posture
from assembly.linear.energy import minimise_energies
from assembly.robots import BUILT_IN
from tests.robots_for_tests import NUMBERS, irsbot2_with


def draws_of(name, size, rng):
    """A posture of a robot, prepared, and 60 draws, some without errors."""
    robot = BUILT_IN[name]()
    errors = size * rng.normal(size=(60, len(robot.frames), 6))
    if name == "irsbot2":  # its proximal loops are rigid and perfect
        errors[:, ~np.any(irsbot2_with(NUMBERS["cases"][0]).errors, axis=1)] = 0.0
    errors[::9] = 0.0
    return prepare_energies(home_posture(robot)), errors


@pytest.mark.parametrize("name", sorted(BUILT_IN))
@pytest.mark.parametrize("size", [1e-6, 1e-5, 1e-4, 1e-3])
def test_draws_have_the_energies_of_points(name, size, rng):
    """Each above the other's certified bound, which is 1e-8 below its own energy."""
    one, errors = draws_of(name, size, rng)
    draws, home = one.solve(errors), one.posture
    T = np.repeat(home.transforms[None], len(errors), axis=0)
    points = minimise_energies(home.robot, T, errors, home.mismatch)
    assert not draws.fallback.any()
    assert points.fallbacks() == {}
    rounding = 1e-8 * points.energy + 2e-12 * points.energy.max() + 1e-30
    assert np.all(draws.energy >= points.bound - rounding)
    assert np.all(points.energy >= draws.bound - rounding)
    assert np.all(draws.energy - draws.bound <= rounding)


@pytest.mark.parametrize("size", [1e-6, 1e-5, 1e-3])
def test_a_draw_does_not_depend_on_its_neighbours(size, rng, monkeypatch):
    """Other order, other neighbours, alone: not a bit changes."""
    given = []

    def note(reduced, h, out):
        given.append((reduced, h))
        least_energies(reduced, h, out)

    monkeypatch.setattr(one_posture, "least_energies", note)
    one, errors = draws_of("five_bar", size, rng)
    one.solve(errors)
    ((reduced, h),) = given

    def solve(h):
        nu, r = reduced.Gt.shape
        count = len(h)
        out = Energies(
            np.zeros((count, nu)), np.zeros((count, r)), np.zeros(count),
            np.zeros(count), np.zeros(count, dtype=np.int64),
        )  # fmt: skip
        least_energies(reduced, h, out)
        return out

    whole = solve(h)
    orders = [rng.permutation(len(h)) for _ in range(4)] + [[i] for i in range(12)]
    for order in orders:
        for rows, expected in zip(solve(h[order]), whole, strict=True):
            assert np.array_equal(rows, expected[order])
