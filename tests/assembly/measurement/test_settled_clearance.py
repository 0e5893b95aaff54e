"""Positions of loaded joints within their clearances."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, together
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.settled_clearance import (
    fractions,
    with_clearances_at_rest,
    with_clearances_taken_up,
)
from forcefit.assembly.model.robot import Clearance, Frame, Robot

RADIAL, AXIAL = 1e-5, 3e-5


def at_home(robot, load, **given):
    """Return the conditions of one measurement."""
    postures = together([home_posture(robot)])
    return as_declared(postures, np.array([load], dtype=float), **given)


def pin(**clearance):
    """Return a rotated passive pin with an arm along its x axis."""
    return Robot("pin", "tip", (
        Frame("pin", joint="revolute", rotation=[0.7, 0, 0],
              clearance=Clearance(**clearance)),
        Frame("tip", "pin", [1.0, 0, 0]),
    ))  # fmt: skip


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e6])
def test_load_moves_a_joint_to_its_clearance_bound(unit):
    """A pin moves radially by its clearance, but not axially."""
    conditions = at_home(pin(radial=RADIAL), unit * np.array([0, 0, 0, 2.0, 0, 0]))
    settled, undetermined = with_clearances_taken_up(conditions)
    expected = np.zeros((1, 2, 6))
    expected[0, 0, 3] = RADIAL
    assert settled.errors == pytest.approx(expected, abs=1e-18)
    # The joint motion is not an undetermined clearance.
    assert undetermined.tolist() == [False]


def test_load_moves_a_ball_joint_by_its_clearance():
    """The pin is rotated by 0.7 rad about x."""
    load = np.array([0, 0, 0, 2.0, 1.0, -2.0])
    settled, undetermined = with_clearances_taken_up(at_home(pin(ball=RADIAL), load))
    c, s = np.cos(0.7), np.sin(0.7)
    force = np.array([[1, 0, 0], [0, c, s], [0, -s, c]]) @ load[3:]
    expected = RADIAL * force / 3
    np.testing.assert_allclose(settled.errors[0, 0, 3:], expected, rtol=1e-9)
    assert undetermined.tolist() == [False]


def test_joint_without_load_is_centred_in_its_clearance():
    conditions = at_home(pin(radial=RADIAL, axial=AXIAL), [0, 0, 0, 2.0, 0, 0])
    settled, undetermined = with_clearances_taken_up(conditions)
    assert undetermined.tolist() == [True]
    assert settled.errors[0, 0, 5] == 0.0
    assert settled.errors[0, 0, 3] == pytest.approx(RADIAL)


def test_measured_point_rotates_with_the_platform():
    """The platform axes are rotated by 0.7 rad about x."""
    point = np.array([0.1, 0.2, -0.3])
    conditions = at_home(pin(), np.zeros(6), point=point)
    c, s = np.cos(0.7), np.sin(0.7)
    expected = [1.0 + 0.1, 0.2 * c + 0.3 * s, 0.2 * s - 0.3 * c]
    assert conditions.measured_points[0] == pytest.approx(expected)
    assert conditions.measured_arms[0] == pytest.approx(np.array(expected) - [1, 0, 0])


def test_rest_position_is_a_fraction_of_the_clearance():
    """The spin of a pin is not a clearance."""
    robot = Robot("two", "tip", (
        Frame("fixed", clearance=Clearance(1e-5, 2e-5, 3e-4, 4e-4)),
        Frame("pin", "fixed", joint="revolute",
              clearance=Clearance(radial=5e-5, spin=0.3)),
        Frame("rail", "pin", joint="prismatic",
              clearance=Clearance(radial=7e-5, axial=0.2)),
        Frame("tip", "rail"),
    ))  # fmt: skip
    fixed = robot.frames[0].clearance
    bounds = np.zeros((4, 6))
    bounds[0] = np.repeat(
        [fixed.tilt, fixed.spin, fixed.radial, fixed.axial], [2, 1, 2, 1]
    )
    bounds[1, 3:5], bounds[2, 3:5] = 5e-5, 7e-5
    rng = np.random.default_rng(2)
    rest, errors = rng.uniform(-1, 1, (1, 4, 6)), rng.normal(size=(1, 4, 6))
    given = replace(at_home(robot, np.zeros(6)), rest=rest, errors=errors)
    held = with_clearances_at_rest(given)
    assert held.rest is None
    assert held.errors - errors == pytest.approx(rest * bounds, rel=1e-9)
    own = [(f.clearance.spin, f.clearance.axial) if f.clearance else None
           for f in held.robot.frames]  # fmt: skip
    assert own == [(None, None), (0.3, None), (None, 0.2), None]
    assert not any(f.clearance and f.clearance.radial for f in held.robot.frames)
    shares = fractions(robot, rest[0] * bounds)
    assert shares == pytest.approx(np.where(bounds > 0, rest[0], 0.0), rel=1e-9)
    assert not fractions(robot, np.ones((4, 6)))[bounds == 0].any()
    with pytest.raises(ValueError, match="conditions.rest: missing"):
        with_clearances_at_rest(replace(given, rest=None))
