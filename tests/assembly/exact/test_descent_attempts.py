"""Which of several steps is taken, and how the next ones are damped."""

import numpy as np
import pytest

import assembly.exact.descent as descent
from assembly.exact.dead_load import dead_loads
from assembly.exact.descent import Step, advance, expand
from assembly.exact.finite_robot import FiniteRobot
from assembly.exact.placement import place
from assembly.kinematics.posture import home_posture
from assembly.linear.closure import virtual_joints
from assembly.model.robot import Frame, Robot
from tests.assembly.exact.test_exact import only, pendulum

K = 2.0  # [N m/rad]
LEAST = 1e-9 * K  # [N m] wrench that counts as small, where nothing else acts


@pytest.fixture
def tried(monkeypatch):
    """A pendulum from a scaled angle, and steps that are offered one after another.

    Each a new angle, what it is said to gain and its length; called with the angle, the
    steps, and what ``advance`` has beside; returns the step taken and what was asked.
    """

    def run(y, steps, load=None, penalty=1.0, damping=0.0, near=False, posture=None):
        posture, asked = posture or pendulum(K, 0.5), []
        model = FiniteRobot(posture, virtual_joints(posture.robot))
        at = place(model, np.atleast_1d(y))
        local = expand(at, dead_loads(posture, load), np.zeros(len(at.residual)))

        def solve(_, damping, newton, method):
            asked.append((damping, newton))
            if steps[len(asked) - 1] is None:
                return None
            new, gain, length = steps[len(asked) - 1]
            there = place(model, np.atleast_1d(new))
            return Step(there, gain, gain, length, np.zeros(0), damping)

        monkeypatch.setattr(descent, "_solve", solve)
        return advance(local, penalty, damping, near), asked

    return run


def ended(step):
    return float(step.placement.x[0])


def test_a_step_that_raises_the_potential_is_refused_and_damped(tried):
    """1e-8 of the least wrench, then eight times as much each time, over 1e-9 of it."""
    refused = (1.1, 0.1, 0.1)
    step, asked = tried(1.0, [refused, refused, None, refused, (0.5, 0.375, 0.5)])
    assert ended(step) == 0.5
    powers = np.array([0.0, 1.0, 8.0, 64.0, 512.0])
    assert [d for d, _ in asked] == pytest.approx(
        1e-8 * LEAST * (powers + 0.1), rel=1e-12, abs=0
    )
    assert step.damping == pytest.approx(51.2e-8 * LEAST, rel=1e-12, abs=0)


def test_a_refused_newton_step_is_followed_by_the_conic_one_undamped(tried):
    refused = (1.1, 0.1, 0.1)
    step, asked = tried(1.0, [refused] * 3 + [(0.5, 0.375, 0.5)], near=True)
    assert ended(step) == 0.5
    assert [newton for _, newton in asked] == [True, False, True, True]
    assert [d for d, _ in asked] == pytest.approx(
        1e-8 * LEAST * np.array([0.1, 0.1, 1.1, 8.1]), rel=1e-12, abs=0
    )
    # where there is none at all, more damping is needed at once
    _, asked = tried(1.0, [None, (0.5, 0.375, 0.5)], near=True)
    assert asked[1][0] == pytest.approx(1.1e-8 * LEAST, rel=1e-12, abs=0)


def test_a_step_of_more_than_a_radian_is_refused_however_good(tried):
    step, asked = tried(1.0, [(0.0, 0.5, 1.01), (0.5, 0.375, 0.99)])
    assert ended(step) == 0.5
    assert len(asked) == 2


@pytest.mark.parametrize(
    ("share", "taken", "damping"),
    [(0.9e-4, False, None), (1.1e-4, True, 1e4), (0.4, True, 1e4), (0.6, True, 1e3)],
)
def test_a_step_must_gain_part_of_what_it_foretells(tried, share, taken, damping):
    """A ten-thousandth to be taken, half to be damped less next time."""
    drop = 0.1
    offered = (np.sqrt(1.0 - 2 * drop), drop / share, 0.5)
    last = (0.0, 0.5, 0.5)
    step, asked = tried(1.0, [offered, last], damping=1e4)
    assert len(asked) == (1 if taken else 2)
    if taken:
        assert step.damping == pytest.approx(damping, rel=1e-12)


@pytest.mark.parametrize(("rise", "taken"), [(0.9, True), (1.1, False)])
def test_what_rounding_raises_is_taken(tried, rise, taken):
    """1e-13 of the energy and of the potential, both 1/2 J."""
    noise = 1e-13
    noise += 1e-14  # of the penalty of 1 N m
    offered = (np.sqrt(1.0 + 2 * rise * noise), 0.0, 0.1)
    step, asked = tried(1.0, [offered, (0.5, 0.375, 0.5)], damping=1e4)
    assert len(asked) == (1 if taken else 2)
    if taken:  # what is lost in rounding is good
        assert step.damping == pytest.approx(1e3, rel=1e-12)


@pytest.mark.parametrize(("share", "damping"), [(0.4, 1e4), (0.6, 1e3)])
def test_closing_counts_by_the_penalty_in_what_is_gained_and_foretold(
    tried, share, damping
):
    """Two springs of 1 N/m, open by 0.04 m at 2 N: from 0.0805 J to 0.0001 J."""
    spring = only(3, 1.0)
    posture = home_posture(Robot("pair", "one", (
        Frame("a", joint_stiffness=spring), Frame("one", "a"),
        Frame("b", joint_stiffness=spring), Frame("two", "b"),
    ), (("one", "two"),)))  # fmt: skip
    gain = 0.0804 / share - 0.08
    step, asked = tried(
        [0.03, -0.01], [([0.01, 0.01], gain, 0.1)], penalty=2.0, damping=1e4,
        posture=posture,
    )  # fmt: skip
    assert len(asked) == 1
    assert step.damping == pytest.approx(damping, rel=1e-12)


@pytest.mark.parametrize("penalty", [1.0, 50.0])
@pytest.mark.parametrize(("rise", "taken"), [(0.9, True), (1.1, False)])
def test_rounding_of_what_acts_is_taken_too(tried, rise, taken, penalty):
    """Of a moment of 100 N m at rest: 1e-14 of it and of the penalty."""
    moment = 100.0
    back = -rise * 1e-14 * (penalty + moment) * np.sqrt(K) / moment
    better = (moment / np.sqrt(K) / 1e3, 1e-2, 0.1)
    load = [0, 0, moment, 0, 0, 0]
    _, asked = tried(0.0, [(back, 0.0, 0.1), better], load, penalty)
    assert len(asked) == (1 if taken else 2)


def test_damping_ends_below_a_billionth_of_what_acts(tried):
    """Of a moment of 20 N m: 2e-8 J/rad^2; from ten times as much it is no more."""
    load, good = [0, 0, 20.0, 0, 0, 0], (1.0, 1.0, 0.5)
    for damping, after in ((3e-7, 3e-8), (1.9e-7, 0.0)):
        step, _ = tried(0.0, [good], load, damping=damping)
        assert step.damping == pytest.approx(after, rel=1e-9, abs=0)
