"""Draws side by side in C++ against numba's kernel, and against each other."""

import numpy as np
import pytest

from assembly.batch import one_posture
from assembly.batch.compiled_draws import Energies
from assembly.batch.draws_side_by_side import least_energies_side_by_side
from assembly.batch.many_draws import prepare_energies
from assembly.kinematics.posture import home_posture
from assembly.robots import BUILT_IN
from forcefit.native.libraries import by_numba
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
def test_draws_have_numbas_energies(name, size, rng):
    one, errors = draws_of(name, size, rng)
    lanes = one.solve(errors)
    with by_numba():
        numba = one.solve(errors)
    assert not (lanes.fallback | numba.fallback).any()
    assert np.array_equal(lanes.energy == 0.0, numba.energy == 0.0)
    # each above the other's certified bound, which is 1e-8 below its own energy
    rounding = 1e-8 * numba.energy + 2e-12 * numba.energy.max() + 1e-30
    assert np.all(lanes.energy >= numba.bound - rounding)
    assert np.all(numba.energy >= lanes.bound - rounding)
    assert np.all(lanes.energy - lanes.bound <= rounding)


@pytest.mark.parametrize("size", [1e-6, 1e-5, 1e-3])
def test_a_draw_does_not_depend_on_its_neighbours(size, rng, monkeypatch):
    """Other order, other neighbours, alone: not a bit changes."""
    given = []

    def note(reduced, h, out):
        given.append((reduced, h))
        return least_energies_side_by_side(reduced, h, out)

    monkeypatch.setattr(one_posture, "least_energies_side_by_side", note)
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
        assert least_energies_side_by_side(reduced, h, out)
        return out

    whole = solve(h)
    orders = [rng.permutation(len(h)) for _ in range(4)] + [[i] for i in range(12)]
    for order in orders:
        for rows, expected in zip(solve(h[order]), whole, strict=True):
            assert np.array_equal(rows, expected[order])
