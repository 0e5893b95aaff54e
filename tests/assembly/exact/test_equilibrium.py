"""Conditions of an equilibrium, and their residuals elsewhere: closed forms."""

import numpy as np
import pytest

from forcefit.assembly.exact.dead_load import dead_loads
from forcefit.assembly.exact.descent import expand
from forcefit.assembly.exact.equilibrium import (
    active_clearances,
    imbalance,
    least_curvature,
    tangent_space,
)
from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.exact.finite_robot import FiniteRobot
from forcefit.assembly.exact.placement import place
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.closure import virtual_joints
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from tests.assembly.exact.test_exact import only, pendulum, two_bars

C = 2e-3  # [m] of clearances


def at(posture, x, load):
    """The problem of an open chain, expanded where its unknowns are given."""
    model = FiniteRobot(posture, virtual_joints(posture.robot))
    x = np.array(x, dtype=float)
    assert len(x) == len(model.frame)
    return expand(place(model, x), dead_loads(posture, load), np.zeros(0))


def pin(**clearance):
    """A frame with a clearance and no stiffness, the tip of the robot."""
    frames = Frame("pin", clearance=Clearance(**clearance)), Frame("tip", "pin")
    return home_posture(Robot("pin", "tip", frames))


def two_slides(link=None):
    """Clearances of C along z, then along x; perhaps on a spring."""
    quarter = [0, np.pi / 2, 0]
    return home_posture(Robot("slides", "tip", (
        Frame("near", clearance=Clearance(axial=C), link=link),
        Frame("far", "near", rotation=quarter, clearance=Clearance(axial=C)),
        Frame("tip", "far"),
    )))  # fmt: skip


@pytest.mark.parametrize("share", [0.0, 0.5, 0.9, 1.0, 2.0])
def test_imbalance_of_a_spring_is_its_relative_unbalanced_moment(share):
    """|y - w| of |y - w| + w for a moment w = m / sqrt(k) of the scaled unknown y."""
    k, m = 10.0, 3.0
    y = share * m / np.sqrt(k)
    local = at(pendulum(k, 0.5), [y], [0, 0, m, 0, 0, 0])
    expected = abs(share - 1) / (abs(share - 1) + 1)
    assert imbalance(local) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("size", "small"), [(1.0, 0.0), (1e-10, 1e-9)])
def test_imbalance_of_two_closed_springs_is_their_mean_unbalanced_force(size, small):
    """Springs of 1 N/m, stretched by 3 and -1 m: the closure carries 2 N, 1 N remains.

    The imbalance is relative to both forces and to the force of 1e-9 m.
    """
    spring = only(3, 1.0)
    posture = home_posture(Robot("pair", "one", (
        Frame("a", joint_stiffness=spring), Frame("one", "a"),
        Frame("b", joint_stiffness=spring), Frame("two", "b"),
    ), (("one", "two"),)))  # fmt: skip
    model = FiniteRobot(posture, virtual_joints(posture.robot))
    there = place(model, size * np.array([3.0, -1.0]))
    local = expand(there, dead_loads(posture), np.zeros(6))
    assert np.linalg.norm(local.multipliers) == pytest.approx(2 * size, rel=1e-6, abs=0)
    expected = size / (2 * size + small + size)
    assert imbalance(local) == pytest.approx(expected, rel=1e-6)
    # in balance where they pull alike
    there = place(model, size * np.array([2.0, -2.0]))
    assert imbalance(expand(there, dead_loads(posture), np.zeros(6))) < 1e-9


@pytest.mark.parametrize(
    ("at_share", "force", "expected"),
    [
        (0.0, 5.0, 0.5),  # within its bounds nothing holds it
        (1.0, 5.0, 0.0),  # pressed against its bound
        (-1.0, -5.0, 0.0),
        (1.0, -5.0, 0.5),  # a bound does not pull
        (-1.0, 5.0, 0.5),
        (0.3, 0.0, 0.0),
    ],
)
def test_imbalance_of_a_clearance_is_the_force_that_no_bound_carries(
    at_share, force, expected
):
    local = at(pin(axial=C), [at_share], [0, 0, 0, 0, 0, force])
    assert imbalance(local) == pytest.approx(expected, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("F", [1.0, 300.0])
def test_pressed_pin_has_the_curvature_of_a_pendulum_of_clearance_length(F):
    """-F c cos a: F c^2 / c per squared length along the rim, and nothing normal."""
    local = at(pin(radial=C), [0.6, 0.8], [0, 0, 0, 0.6 * F, 0.8 * F, 0])
    active, force = active_clearances(local)
    assert active.tolist() == [True]
    assert force == pytest.approx([F * C], rel=1e-12)
    D, H = tangent_space(local)
    assert D.shape == (2, 1)
    assert D[:, 0] @ [0.6, 0.8] == pytest.approx(0.0, abs=1e-12)
    assert H[0, 0] / (D[:, 0] @ D[:, 0]) == pytest.approx(F * C, rel=1e-12)
    assert least_curvature(local) == pytest.approx(F / C, rel=1e-12)
    # pulled off the rim it is free, and falls
    away = at(pin(radial=C), [0.6, 0.8], [0, 0, 0, -0.6 * F, -0.8 * F, 0])
    assert active_clearances(away)[0].tolist() == [False]
    assert active_clearances(away)[1].tolist() == [0.0]


def test_fully_pressed_clearances_leave_no_tangent_space():
    local = at(two_slides(), [1.0, 1.0], [0, 0, 0, 4.0, 0, 3.0])
    assert active_clearances(local)[1] == pytest.approx([3 * C, 4 * C], rel=1e-12)
    assert tangent_space(local)[0].shape == (2, 0)
    assert least_curvature(local) == np.inf


def test_contact_force_equals_the_energy_slope_by_the_clearance():
    """In a closed chain, force times clearance is -c dE/dc, by central differences."""
    clearance, step = 5e-3, 1e-6
    low, here, high = (
        solve_exact(two_bars(0.06, Clearance(radial=c)))
        for c in (clearance - step, clearance, clearance + step)
    )
    active, force = active_clearances(here.expansion)
    assert active.tolist() == [True]
    saved = (low.energy - high.energy) / (2 * step)
    assert force == pytest.approx([clearance * saved], rel=1e-6)
