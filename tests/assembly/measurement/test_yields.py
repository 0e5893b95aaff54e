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
