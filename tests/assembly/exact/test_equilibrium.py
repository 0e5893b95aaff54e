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
from tests.assembly.exact.test_exact import two_bars

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
