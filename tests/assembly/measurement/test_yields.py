"""Slopes of places that give by laws of their own, by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from assembly.kinematics.posture import home_posture
from assembly.measurement.conditions import Yield, as_declared
from assembly.measurement.yields import Yields, settle_yields, with_springs
from assembly.model.robot import Frame, Robot
from assembly.solvers.conic import SolverFailed


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


def test_springs_that_give_without_end_are_told():
    """d = C (w + A d) with C A = 1: any load moves them ever farther."""
    one = linear_springs(np.eye(2), 1)
    with pytest.raises(SolverFailed, match="springs that give without end"):
        one.correction(np.ones((1, 2)), np.zeros((1, 2)), np.eye(2)[None])


def settled_by(law, unit=1.0):
    """Deflection of a place under 3 - 2 d in a unit, and how often it is asked."""
    robot = Robot("post", "top", (Frame("foot"), Frame("top", "foot", [0, 0, 1.0])))
    one = Yield(
        "foot", 1, (("foot", 1),), np.zeros((1, 1)), lambda x, w: unit * law(w[:, 0])
    )
    here = replace(as_declared(home_posture(robot), np.zeros(6)), yields=(one,))
    asked = []

    def solve(held):
        assert held.yields == ()
        give = held.errors[0, 0, 1]
        asked.append(give)
        wrenches = np.zeros((1, 12))
        wrenches[0, 1] = 3.0 - 2.0 * give / unit
        return give, wrenches

    return settle_yields(
        here, solve, lambda yields: np.full((1, 1, 1), -2.0 / unit)
    ), asked


@pytest.mark.parametrize("power", [1.0, 1.5, 3.0])
@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1.0, 1e3])
def test_a_place_gives_by_its_law_under_what_is_left(power, unit):
    """d = (3 - 2 d)^p / 10, by bisection; Newton's method takes a few steps."""
    give, asked = settled_by(lambda w: np.sign(w) * np.abs(w) ** power / 10, unit)
    expected = brentq(lambda d: d - (3.0 - 2.0 * d) ** power / 10, 0.0, 1.5, xtol=1e-15)
    assert give / unit == pytest.approx(expected, rel=1e-9)
    assert len(asked) <= 9


@pytest.mark.parametrize("force", [1e-6, 1e-3, 1.0, 1e4])
def test_the_slope_of_a_cube_is_three_squares_at_any_load(force):
    robot = Robot("post", "top", (Frame("foot"), Frame("top", "foot", [0, 0, 1.0])))
    one = Yield("foot", 1, (("top", 5),), np.zeros((3, 1)), lambda x, w: w[:, 0] ** 3)
    here = as_declared(home_posture(robot), np.zeros(6)).take(np.zeros(3, int))
    w = force * np.array([[1.0], [-0.5], [0.1]])
    slope = Yields(replace(here, yields=(one,))).slope(w)[:, :, 0]
    assert slope == pytest.approx(3 * w**2, rel=1e-5)


def test_laws_that_never_settle_are_told():
    """It gives as soon as it is loaded, and then it is not: forty steps, no answer."""
    with pytest.raises(SolverFailed, match="do not settle in 40 steps"):
        settled_by(lambda w: np.where(w > 0, 2.0, 0.0))


@pytest.mark.parametrize("compliance", [-1e-4, 0.0, 3e-4])
def test_springs_are_put_into_their_joint_and_other_laws_stay(compliance):
    """In series with what is declared; one that is not positive is no spring."""
    K = np.diag([np.inf, 1e4] + [np.inf] * 4)
    robot = Robot("post", "top", (
        Frame("foot", joint_stiffness=K), Frame("top", "foot", [0, 0, 1.0]),
    ))  # fmt: skip
    given = np.array([[7.0], [compliance]])
    spring = Yield(
        "foot", 1, (("foot", 1),), given, lambda x, w: x[:, 0] * w[:, 0], True
    )
    bends = replace(spring, linear=False)
    here = as_declared(home_posture(robot), np.zeros(6)).take(np.zeros(2, int))
    one = with_springs(replace(here, yields=(bends, spring)), 1)
    assert len(one) == 1
    frame, (first, *rest) = one.robot.frames[0], one.yields
    assert first.law is bends.law
    assert not first.linear
    assert len(rest) == (compliance <= 0)
    series = 1e-4 + max(compliance, 0.0)
    assert frame.joint_stiffness[1, 1] == pytest.approx(1 / series)
