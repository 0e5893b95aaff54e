"""Newton's method with known pressed cones: closed forms and optimality."""

import numpy as np
import pytest

from forcefit.assembly.solvers.pressed_cones import refine

NONE = np.zeros((0, 2))


@pytest.mark.parametrize("off", [0.0, 1e-3, 1e-2])
def test_pressed_disc_moves_to_the_point_nearest_to_the_target(off):
    """The least |u - a| with |u| <= 1 is at a / |a|, pressed by |a| - 1 = 12."""
    a = np.array([5.0, 12.0])
    guess = (1.0 - off) * np.array([np.cos(1.17 + off), np.sin(1.17 + off)])
    problem = (np.eye(2), -a, np.zeros(2), NONE, np.zeros(0), np.zeros(2, np.int64))
    u, y, n = next(refine(problem, guess, np.zeros(0)))
    assert u == pytest.approx(a / 13, abs=1e-9)
    assert y == pytest.approx(a / 13 - a, abs=1e-8)
    assert len(n) == 0


def test_problem_without_pressed_cones_solves_the_linear_equations():
    """Least |u|^2 / 2 on u_1 + u_2 = 1 / 2: a quarter each, multiplier a quarter."""
    H, k = np.array([[1.0, 1.0]]), np.array([0.5])
    problem = (np.eye(2), np.zeros(2), np.zeros(2), H, k, np.array([0, 1]))
    u, y, n = next(refine(problem, np.array([0.26, 0.24]), np.array([0.249])))
    assert u == pytest.approx([0.25, 0.25], abs=1e-14)
    assert y == pytest.approx(u, abs=1e-14)
    assert n == pytest.approx([0.25], abs=1e-14)


def test_pressed_interval_ends_at_its_bound_and_the_row_moves_the_other():
    """Work 3 u_1 + u_2 on u_1 + u_2 = 1 / 2 within +-1: the corner (1, -1 / 2)."""
    H, k = np.array([[1.0, 1.0]]), np.array([0.5])
    problem = (NONE, np.zeros(0), np.array([3.0, 1.0]), H, k, np.array([0, 1]))
    u, y, n = next(refine(problem, np.array([0.999, -0.498]), np.array([-1.01])))
    assert u == pytest.approx([1.0, -0.5], abs=1e-12)
    assert len(y) == 0
    assert n == pytest.approx([-1.0], abs=1e-9)
