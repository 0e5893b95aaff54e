"""Deflection laws, compared with bisection."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.measurement.conditions import Yield, as_declared
from forcefit.assembly.measurement.yields import Yields, settle_yields, with_springs
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.solvers.conic import SolverFailed

POST = Robot("post", "top", (Frame("foot"), Frame("top", "foot", [0, 0, 1.0])))


def settled_by(law, unit=1.0):
    """Return the deflection d under the wrench 3 - 2 d."""
    one = Yield(
        "foot", 1, (("foot", 1),), np.zeros((1, 1)), lambda x, w: unit * law(w[:, 0])
    )
    here = replace(as_declared(home_posture(POST), np.zeros(6)), yields=(one,))

    def solve(held):
        assert held.yields == ()
        give = held.errors[0, 0, 1]
        wrenches = np.zeros((1, 12))
        wrenches[0, 1] = 3.0 - 2.0 * give / unit
        return give, wrenches

    return settle_yields(here, solve, lambda _: np.full((1, 1, 1), -2.0 / unit))


@pytest.mark.parametrize("power", [1.0, 1.5, 3.0])
@pytest.mark.parametrize("unit", [1e-9, 1e-6, 1.0, 1e3])
def test_deflection_by_a_power_law_equals_bisection(power, unit):
    """The deflection d satisfies d = (3 - 2 d)^p / 10."""
    give = settled_by(lambda w: np.sign(w) * np.abs(w) ** power / 10, unit)
    expected = brentq(lambda d: d - (3.0 - 2.0 * d) ** power / 10, 0.0, 1.5, xtol=1e-15)
    assert give / unit == pytest.approx(expected, rel=1e-9)


def test_law_with_unbounded_deflection_is_rejected():
    """The equation d = w + d has no solution."""
    one = Yield("foot", 1, (("foot", 1),), np.zeros((1, 1)), lambda x, w: w[:, 0])
    here = replace(as_declared(home_posture(POST), np.zeros(6)), yields=(one,))
    with pytest.raises(SolverFailed, match="has no finite equilibrium"):
        Yields(here).correction(np.ones((1, 1)), np.zeros((1, 1)), np.ones((1, 1, 1)))


def test_law_without_equilibrium_is_rejected():
    """The deflection grows until the load vanishes."""
    with pytest.raises(SolverFailed, match="do not converge in 40 steps"):
        settled_by(lambda w: np.where(w > 0, 2.0, 0.0))


@pytest.mark.parametrize("compliance", [-1e-4, 0.0, 3e-4])
def test_linear_laws_become_joint_springs(compliance):
    """The springs are in series with the joint spring of the robot."""
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
