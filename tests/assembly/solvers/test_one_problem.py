"""One cone programme, and one farthest screw, in C++: certificates and numba."""

import numpy as np
import pytest

from assembly.linear.reach import ReachableSet
from assembly.solvers.conic import cone_sizes, minimise_energy
from forcefit.native.libraries import by_numba


def random_cones(rng, widest):
    """(nu,) cone of each column, of one to so many columns each."""
    sizes = rng.integers(1, widest + 1, size=rng.integers(2, 9))
    return np.repeat(np.arange(len(sizes)), sizes)


def inside(rng, group):
    """A point within all unit cones."""
    u = rng.normal(size=len(group))
    return u / cone_sizes(u, group)[group] * rng.uniform(0, 0.9, group.max() + 1)[group]


@pytest.mark.parametrize("widest", [1, 2, 3, 20])
@pytest.mark.parametrize("springs", [0, 5])
def test_least_energies_prove_themselves_and_numbas(rng, widest, springs):
    """Neither's certified bound is above the other's value."""
    for _ in range(12):
        group = random_cones(rng, widest)
        p = rng.integers(0, max(1, min(4, len(group) - 2)))
        H = rng.normal(size=(p, len(group)))
        given = (
            rng.normal(size=(springs, len(group))), 3 * rng.normal(size=springs),
            rng.normal(size=len(group)), H, H @ inside(rng, group), group,
        )  # fmt: skip
        one = minimise_energy(*given)
        with by_numba():
            other = minimise_energy(*given)
        answers = one, other
        # what is left open of the rows works at their multipliers
        open_ = max(
            np.abs(H @ a.clearances - given[4]).max(initial=0.0) for a in answers
        )
        rows = open_ * (1 + max(np.abs(a.rigid_multipliers).sum() for a in answers))
        assert open_ < 1e-8
        for least in answers:
            assert cone_sizes(least.clearances, group).max() <= 1 + 1e-12
            assert least.gap <= 1e-8 * abs(least.value) + rows + 1e-12
        assert one.bound <= other.value + rows + 1e-12
        assert other.bound <= one.value + rows + 1e-12


def test_the_farthest_point_of_a_ball_and_of_an_interval():
    """|c + r v| with |v| <= 1 is |c| + r; of a ball of three and one more column."""
    centre = np.array([0.0, 0.0, 0.0, 3e-3, 0.0, 4e-3])
    X = np.zeros((6, 4))
    X[3:, :3], X[0, 3] = 2e-3 * np.eye(3), 5e-3
    body = ReachableSet(
        centre, X, np.zeros((0, 4)), np.zeros(4), np.array([0, 0, 0, 1])
    )
    (low, high), screw, _ = body.farthest(3, 1e-9)
    assert low <= 7e-3 + 1e-15
    assert high >= 7e-3 - 1e-15
    assert high - low <= 1e-9
    assert screw[3:] == pytest.approx(1.4 * centre[3:], abs=1e-6)
    (low, high), screw, _ = body.farthest(0, 1e-9)
    assert (low, high) == pytest.approx((5e-3, 5e-3), abs=1e-9)


def test_farthest_screws_are_numbas(rng):
    """With rows, and with a cone of many columns, as springs within a budget are."""
    for widest in (2, 12):
        for _ in range(8):
            group = random_cones(rng, widest)
            p = rng.integers(0, max(1, min(4, len(group) - 2)))
            rows = np.linalg.qr(rng.normal(size=(len(group), p)))[0].T
            start = inside(rng, group)
            X = 1e-3 * rng.normal(size=(6, len(group)))
            body = ReachableSet(1e-3 * rng.normal(size=6), X, rows, start, group)
            for half in (0, 3):
                one = body.farthest(half, 1e-7)
                with by_numba():
                    other = body.farthest(half, 1e-7)
                (low, high), screw, _ = one
                assert high - low <= 1e-7
                assert low <= other[0][1] + 1e-15
                assert other[0][0] <= high + 1e-15
                size = np.linalg.norm(screw[half : half + 3])
                assert size == pytest.approx(low, rel=1e-12)
