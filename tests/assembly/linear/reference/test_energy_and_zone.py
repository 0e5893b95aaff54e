"""Bounds of passive joints' own motion in the solver that is asked last."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear.closure import linearise, virtual_joints
from assembly.linear.energy import solve_assembly
from assembly.linear.reference.reduction import FreeMotion
from assembly.linear.reference.zone import margin_with
from assembly.linear.zone import zone_margin
from assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from tests.robots_for_tests import random_robot

L, K = 1e-3, 2e4  # [rad] of the pin's turn at most, [N m/rad] of the stop


def pin_against(stop, limit=L, error=0.0):
    """A pin about z, its platform off by an error [rad], closed against a stop."""
    own = None if limit is None else Clearance(spin=limit)
    return Robot("pin", "end", (
        Frame("pin", joint="revolute", clearance=own,
              geometric_error=[0, 0, error, 0, 0, 0]),
        Frame("end", "pin", [1.0, 0, 0]),
        stop, Frame("at_end", "stop", [1.0, 0, 0]),
    ), (("end", "at_end"),))  # fmt: skip


SPRING = Frame("stop", link=MatrixLink(K * np.eye(6)))


def test_a_motion_is_free_up_to_its_bound_only():
    """It takes up an error of 0.9 L; of 1.5 L half an L is left to the spring."""
    at = home_posture(pin_against(SPRING, error=0.9 * L))
    assert solve_assembly(at, method="reference").energy == 0.0
    held = solve_assembly(
        home_posture(pin_against(SPRING, error=1.5 * L)), method="reference"
    )
    assert held.energy == pytest.approx(K * (0.5 * L) ** 2 / 2, rel=1e-6)
    free = home_posture(pin_against(SPRING, limit=None, error=1.5 * L))
    assert solve_assembly(free, method="reference").energy == 0.0


def test_a_load_drives_a_joint_to_its_bound_or_without_end():
    """An open chain: a pin, pulled about z."""
    frames = pin_against(SPRING).frames[:2]
    load = np.array([0, 0, 2.0, 0, 0, 0])
    held = solve_assembly(
        home_posture(Robot("pin", "end", frames)), load, method="reference"
    )
    assert held.platform_screw[2] == pytest.approx(L, rel=1e-6)
    loose = (replace(frames[0], clearance=None), frames[1])
    with pytest.raises(FreeMotion):
        solve_assembly(
            home_posture(Robot("pin", "end", loose)), load, method="reference"
        )


def test_a_margin_counts_what_a_bounded_motion_leaves():
    """An error of 1.5 L: the play about z has to take L / 2 of it."""
    play = 2e-4
    stop = Frame("stop", clearance=Clearance(spin=play))
    at = home_posture(pin_against(stop, error=1.5 * L))
    zone = zone_margin(at, "rigid", method="reference")
    assert zone.margin == pytest.approx(0.5 * L / play, rel=1e-6)
    assert zone.bound == pytest.approx(zone.margin, rel=1e-6)
    at = home_posture(pin_against(stop, error=0.9 * L))
    none = zone_margin(at, "rigid", method="reference")
    assert (none.margin, none.bound) == (0.0, 0.0)


def test_the_screws_of_a_margin_close_the_robot():
    """Clearances and free motions together; where no factor helps there are none."""
    closed = 0
    for seed in range(8):
        robot = random_robot(np.random.default_rng(seed), 2, link_share=0.0)
        lin = linearise(home_posture(robot))
        margin, _, screws = margin_with(lin, virtual_joints(robot, springs=False))
        assert screws.shape == (len(robot.frames), 6)
        if margin == np.inf:
            assert not screws.any()
            continue
        left = lin.rows @ screws.ravel() + lin.misfit
        assert np.abs(left).max() < 1e-7 * np.abs(lin.misfit).max()
        closed += margin > 0.0
    assert closed
