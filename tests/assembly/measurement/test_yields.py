"""Slopes of places that give by laws of their own, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.measurement.conditions import Yield, as_declared
from assembly.measurement.yields import Yields
from assembly.model.robot import Frame, Robot


def test_slopes_are_those_of_the_laws_by_each_wrench_they_read(rng):
    """a u^2 and b u v of two wrenches: 2 a u, and b v with b u; each read once."""
    robot = Robot("post", "top", (Frame("foot"), Frame("top", "foot", [0, 0, 1.0])))
    given = rng.uniform(1, 2, (4, 2))
    first, second = ("foot", 1), ("top", 5)
    yields = (
        Yield("foot", 1, (first,), given[:, :1], lambda c, w: c[:, 0] * w[:, 0] ** 2),
        Yield("top", 2, (second, first), given[:, 1:],
              lambda c, w: c[:, 0] * w[:, 0] * w[:, 1]),
    )  # fmt: skip
    posture = home_posture(robot)
    here = as_declared(posture, np.zeros(6))
    here = replace(here.take(np.zeros(4, int)), yields=yields)
    one = Yields(here)
    assert [int(k) for k in np.flatnonzero(one.places.sum(axis=1))] == [1, 8]
    assert [int(np.flatnonzero(column)[0]) for column in one.read.T] == [1, 11]
    w = rng.uniform(-5, 5, (4, 2))
    u, v = w.T
    expected = np.zeros((4, 2, 2))
    expected[:, 0, 0] = 2 * given[:, 0] * u
    expected[:, 1, 0], expected[:, 1, 1] = given[:, 1] * v, given[:, 1] * u
    assert one.slope(w) == pytest.approx(expected, rel=1e-5, abs=1e-6)
    assert one.deflections(w)[:, 1] == pytest.approx(given[:, 1] * u * v)


def linear_springs(C, rows):
    """Two places on a post that give by C times the two wrenches they read."""
    robot = Robot("post", "top", (Frame("foot"), Frame("top", "foot", [0, 0, 1.0])))
    read = ("foot", 1), ("top", 5)
    yields = tuple(
        Yield(frame, component, read, np.tile(row, (rows, 1)),
              lambda c, w: (c * w).sum(axis=1))
        for (frame, component), row in zip((("foot", 1), ("top", 2)), C, strict=True)
    )  # fmt: skip
    here = as_declared(home_posture(robot), np.zeros(6))
    return Yields(replace(here.take(np.zeros(rows, int)), yields=yields))


@pytest.mark.parametrize("force", [1e-12, 1e-6, 1.0, 1e6])
def test_springs_are_settled_in_one_step_and_then_left(rng, force):
    """d = C (w + A d), in any unit of force: d = (1 - C A)^-1 C w."""
    rows, C = 3, rng.uniform(0.5, 2, (2, 2)) * 1e-4
    A = -rng.uniform(1, 2, (rows, 2, 2)) * 2e3
    w = rng.uniform(-5, 5, (rows, 2))
    settled = np.array([
        np.linalg.solve(np.eye(2) - C @ a, C @ v) for a, v in zip(A, w, strict=True)
    ])
    one = linear_springs(C / force, rows)
    for give in (np.zeros((rows, 2)), 0.3 * settled, 2 * settled):
        through = force * (w + np.einsum("rij,rj->ri", A, give))
        step = one.correction(give, through, force * A)
        # slopes by differences
        assert give + step == pytest.approx(settled, rel=1e-5)
    through = force * (w + np.einsum("rij,rj->ri", A, settled))
    assert not one.correction(settled, through, force * A).any()
    # rows that are settled stay where they are beside others
    mixed = settled.copy()
    mixed[1] *= 1.1
    through = force * (w + np.einsum("rij,rj->ri", A, mixed))
    step = one.correction(mixed, through, force * A)
    assert step.any(axis=1).tolist() == [False, True, False]
