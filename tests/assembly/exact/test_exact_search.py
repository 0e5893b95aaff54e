"""Where the search for an equilibrium begins, what steps are given, where it ends."""

from dataclasses import replace

import numpy as np
import pytest

import assembly.exact.exact as exact
from assembly.exact.descent import NotConverged, Step
from assembly.exact.exact import solve_exact
from assembly.exact.finite_robot import CLEARANCE
from assembly.exact.placement import place
from assembly.kinematics.posture import home_posture
from assembly.model.robot import Frame, Robot
from assembly.robots.hexapod import hexapod
from tests.assembly.exact.test_exact import pendulum
from tests.assembly.kinematics.test_open_closures import parallelograms
from tests.robots_for_tests import random_robot

K, MOMENT = 10.0, 4.0  # [N m/rad], [N m]
BALANCED = MOMENT / np.sqrt(K)  # scaled unknown, of the energy 0.8 J and work 1.6 J
SCALE = MOMENT**2 / K  # [J] the larger of the two
FAR, STILL = 1e-6, 0.5e-9  # [rad] lengths of steps


@pytest.fixture
def ends(monkeypatch):
    """A loaded pendulum, and steps that end at given angles, one after another.

    Each is a share of the balanced angle, a decrement, a length and a damping; the
    last is repeated.  Returns the answer and whether each step was called near.
    """

    def run(*steps):
        called = []

        def advance(local, penalty, damping, near, method):
            share, decrement, length, after = steps[min(len(called), len(steps) - 1)]
            called.append((damping, near))
            there = place(local.placement.model, np.array([share * BALANCED]))
            return Step(there, decrement, decrement, length, np.zeros(0), after)

        monkeypatch.setattr(exact, "advance", advance)
        load = [0, 0, MOMENT, 0, 0, 0]
        try:
            return solve_exact(pendulum(K, 0.5), load).iterations, called
        except NotConverged as problem:
            return str(problem), called

    return run


REST = (1.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("step", "count"),
    [
        ((1.0, SCALE, STILL, 0.0), 1),  # short and not damped
        ((1.0, SCALE, STILL, 1.0), 2),  # short because it is damped
        ((1.0, SCALE, 2e-9, 0.0), 2),  # not so short
        ((1.0, 0.9e-14 * SCALE, FAR, 0.0), 1),  # nothing is left to gain
        ((1.0, 0.9e-14 * SCALE, FAR, 1.0), 1),
        ((1.0, -0.9e-14 * SCALE, FAR, 0.0), 1),
        ((1.0, 1.1e-14 * SCALE, FAR, 0.0), 2),
        ((1.0, -1.1e-14 * SCALE, FAR, 0.0), 2),
        ((1.0 + 1e-6, SCALE, STILL, 0.0), 2),  # not in balance
        ((1.0 + 1e-8, SCALE, STILL, 0.0), 1),  # to 1e-7 it is
    ],
)
def test_the_search_ends_where_it_is_still_and_in_balance(ends, step, count):
    assert ends(step, REST)[0] == count


def test_after_a_hundred_steps_balance_alone_is_enough(ends):
    assert ends((1.0, SCALE, FAR, 0.0))[0] == 101


def test_after_160_steps_it_is_said_how_far_it_is(ends):
    """Out of balance by 1 % of the moment, of 1.99 of it: spring, load and the rest."""
    message, called = ends((0.99, SCALE, FAR, 0.0))
    assert len(called) == 160
    assert message == (
        "exact equilibrium of bar under [0 0 4 0 0 0] N m, N: after 160 steps closures "
        "are open by 0 and forces out of balance by 0.0099, relative"
    )


@pytest.mark.parametrize(("part", "near"), [(0.9e-2, True), (1.1e-2, False)])
def test_newtons_method_is_tried_where_a_hundredth_is_left_to_gain(ends, part, near):
    """And the damping is that which the last step asks for."""
    _, called = ends((1.0, part * SCALE, FAR, 7.0), (1.0, SCALE, FAR, 0.0), REST)
    assert called == [(0.0, False), (7.0, near), (0.0, False)]


def calls_of(monkeypatch, posture, load=None):
    """The expansions and penalties of all steps, and the answer."""
    called, advance = [], exact.advance

    def watched(local, penalty, damping, near, method):
        called.append((local, penalty))
        return advance(local, penalty, damping, near, method)

    monkeypatch.setattr(exact, "advance", watched)
    return called, solve_exact(posture, load)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_penalty_is_twice_the_largest_wrench_of_all_closures_so_far(
    monkeypatch, seed
):
    posture = home_posture(random_robot(np.random.default_rng(seed), legs=3))
    called, answer = calls_of(monkeypatch, posture)
    sizes = [np.linalg.norm(local.multipliers) for local, _ in called]
    expected = 2 * np.maximum.accumulate(sizes)
    assert [penalty for _, penalty in called] == pytest.approx(expected, rel=1e-12)
    assert answer.iterations == len(called)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_search_begins_where_the_linear_model_ends(monkeypatch, seed):
    """Springs, plays and free motions."""
    robot = random_robot(np.random.default_rng(seed), legs=3)
    called, answer = calls_of(monkeypatch, home_posture(robot))
    first, linear = called[0][0].placement, answer.linear
    model = first.model
    assert first.x[model.springs] == pytest.approx(linear.elastic, rel=1e-12)
    screws = first.screws[CLEARANCE].copy()
    axes = [frame.own_axis for frame in robot.frames]
    screws[np.arange(len(axes)), axes] += first.own
    size = np.abs(linear.clearance_screws).max()
    assert screws == pytest.approx(linear.clearance_screws, abs=1e-6 * size)


def test_a_linear_turn_of_more_than_a_radian_begins_at_one(monkeypatch):
    posture = pendulum(K, 0.5)
    for moment, turn in ((30.0, 1.0), (5.0, 0.5)):
        called, _ = calls_of(monkeypatch, posture, [0, 0, moment, 0, 0, 0])
        assert called[0][0].placement.screws[2, 0, 2] == pytest.approx(turn, rel=1e-12)
        monkeypatch.undo()


def test_nothing_to_do_is_done_at_once():
    """A hexapod without errors: no step but the one that says so."""
    robot = hexapod()
    still = robot.with_errors(0 * robot.errors)
    answer = solve_exact(home_posture(still))
    assert answer.iterations == 1
    assert answer.energy == 0.0
    assert np.abs(answer.platform_screw).max() < 1e-12


def on_springs(joint_stiffness, *frames):
    """The first frame on springs, others behind it."""
    first = Frame("first", joint_stiffness=np.diag(joint_stiffness))
    rest = [replace(f, parent=p) for f, p in zip(
        frames, ["first", *(f.name for f in frames)], strict=False
    )]  # fmt: skip
    return home_posture(Robot("row", [first, *rest][-1].name, (first, *rest)))


def test_turns_count_by_their_size_and_each_joints_by_itself(monkeypatch):
    """Two of 0.9 rad in a row are no longer; about two axes of one joint they are."""
    free, hinge = [np.inf] * 3, [np.inf, np.inf, K, *[np.inf] * 3]
    row = on_springs(hinge, Frame("tip", joint_stiffness=np.diag(hinge)), Frame("end"))
    one = on_springs([K, K, np.inf, *free], Frame("end"))
    slide = on_springs([*free, 50.0, np.inf, np.inf], Frame("end"))
    for posture, load, expected in (
        (row, [0, 0, 9.0, 0, 0, 0], [0, 0, 0.9, 0, 0, 0]),
        (one, [9.0, 9.0, 0, 0, 0, 0], [0.5**0.5, 0.5**0.5, 0, 0, 0, 0]),
        (slide, [0, 0, 0, 150.0, 0, 0], [0, 0, 0, 3.0, 0, 0]),  # metres are no turns
    ):
        called = []

        def stop(local, *_, called=called):
            called.append(local.placement)
            raise NotConverged("first", "guess")

        monkeypatch.setattr(exact, "advance", stop)
        with pytest.raises(NotConverged, match="first: guess"):
            solve_exact(posture, load)
        assert called[0].screws[2, 0] == pytest.approx(expected, abs=1e-12)


def test_what_rounded_files_leave_open_is_no_gap():
    """Cranks of six digits, open by up to 1e-6 m, are as closed as they can be."""
    posture = home_posture(parallelograms(digits=6))
    assert posture.mismatch > 1e-9
    answer = solve_exact(posture)
    assert answer.iterations <= 2
    assert answer.energy == 0.0
