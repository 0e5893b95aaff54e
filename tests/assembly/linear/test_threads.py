"""Helical joints in chains, loops and all solvers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from forcefit import Clearance, Frame, Robot, solve_assembly, solve_exact, zone_margin
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.reference.as_printed import (
    energy_as_printed,
    margin_as_printed,
)
from tests.robots_for_tests import random_robot

METHODS = ["compiled", "reference"]


def test_pose_of_a_chain_is_the_product_of_matrix_exponentials(rng):
    """The twists in the home pose are [w; p x w + h w] at the base origin."""
    frames, twists, parent = [], [], "base"
    for k, pitch in enumerate([0.3, -0.2, 0.0, 0.7]):
        kind = "helical" if pitch else "revolute"
        frames.append(Frame(f"j{k}", parent, rng.normal(size=3), rng.normal(size=3),
                            joint=kind, pitch=pitch, actuated=True))  # fmt: skip
        parent = f"j{k}"
    robot = Robot("chain", "tip", (*frames, Frame("tip", parent, [0.1, 0.2, 0.3])))
    home, q = home_posture(robot), rng.uniform(-3, 3, 4)
    for frame, T in zip(frames, home.transforms, strict=False):
        w, p = T[:3, 2], T[:3, 3]
        v = np.cross(p, w) + frame.pitch / (2 * np.pi) * w
        W = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        twists.append(np.block([[W, v[:, None]], [np.zeros((1, 4))]]))
    expected = np.linalg.multi_dot([
        expm(t * a) for t, a in zip(twists, q, strict=True)
    ])
    found = place_robot(
        robot, joints={f.name: a for f, a in zip(frames, q, strict=True)}
    )
    assert np.abs(found.platform - expected @ home.platform).max() < 1e-13


def held_nut(turned, shifted, k=None):
    """Return a nut with an axial clearance of 25 um and an error of its seat."""
    K = None if k is None else np.diag([np.inf, np.inf, 0, np.inf, np.inf, k])
    thread = Frame(
        "thread", joint="helical", pitch=0.004, joint_stiffness=K,
        clearance=Clearance(axial=25e-6),
    )  # fmt: skip
    seat = Frame("seat", geometric_error=[0, 0, turned, 0, 0, shifted])
    frames = (thread, Frame("nut", "thread"), seat)
    return home_posture(Robot("held", "nut", frames, (("nut", "seat"),)))


@pytest.mark.parametrize(("turned", "shifted"), [(0.05, 1e-5), (-0.1, 2e-5), (0, 3e-5)])
def test_margin_of_a_nut_equals_its_offset_divided_by_clearance(turned, shifted):
    """The margin is |TZ - h RZ| / b for an error (RZ, TZ) and a clearance b."""
    at = held_nut(turned, shifted)
    expected = abs(shifted - 0.004 / (2 * np.pi) * turned) / 25e-6
    for method in METHODS:
        assert zone_margin(at, method=method).margin == pytest.approx(
            expected, rel=1e-8
        )
    assert margin_as_printed(at) == pytest.approx(expected, rel=1e-6)


def test_energy_of_a_nut_equals_the_closed_form():
    """The energy is k (|TZ - h RZ| - b)^2 / 2."""
    at = held_nut(-0.1, 2e-5, 1e7)
    over = 2e-5 + 0.1 * 0.004 / (2 * np.pi) - 25e-6
    for method in METHODS:
        found = solve_assembly(at, method=method)
        assert found.energy == pytest.approx(1e7 * over**2 / 2, rel=1e-9)
        assert found.clearance_excess() < 1e-9
    assert energy_as_printed(at)[0] == pytest.approx(1e7 * over**2 / 2, rel=1e-6)
    exact = solve_exact(at)
    assert exact.energy == pytest.approx(1e7 * over**2 / 2, rel=1e-8)
    assert exact.clearance_excess() < 1e-9


def random_threads(seed):
    """Return a robot of three legs with random helical joints."""
    rng, frames = np.random.default_rng(seed), []
    robot = random_robot(rng, legs=3, joints=4, link_share=1.0)
    for f in robot.frames:
        if f.joint == "revolute":
            play = f.clearance and replace(f.clearance, spin=None)
            pitch = rng.uniform(-0.5, 0.5)
            f = replace(f, joint="helical", pitch=pitch, clearance=play)
        frames.append(f)
    assert sum(bool(f.pitch) for f in frames) >= 2
    return replace(robot, frames=tuple(frames))


@pytest.mark.parametrize("seed", range(6))
def test_three_solvers_agree_on_random_helical_joints(seed):
    at = home_posture(random_threads(seed))
    found, expected = (solve_assembly(at, method=method) for method in METHODS)
    assert found.energy == pytest.approx(expected.energy, rel=1e-7, abs=1e-12)
    energy, _ = energy_as_printed(at)
    assert energy == pytest.approx(expected.energy, rel=1e-4, abs=1e-9)
    assert found.clearance_excess() < 1e-6
    margins = [zone_margin(at, method=method).margin for method in METHODS]
    assert margins[0] == pytest.approx(margins[1], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_difference_to_exact_solution_is_quadratic_in_errors(seed):
    """Halving the errors divides the difference by 4, up to third-order terms."""
    robot = random_threads(seed)
    tight = replace(
        robot, frames=tuple(replace(f, clearance=None) for f in robot.frames)
    )
    gap = []
    for scale in (0.02, 0.01):
        at = home_posture(tight.with_errors(scale * tight.errors))
        exact, linear = solve_exact(at), solve_assembly(at)
        gap.append(np.abs(exact.platform_screw - linear.platform_screw).max())
    assert gap[0] / gap[1] == pytest.approx(4.0, rel=1e-3)
    assert gap[0] > 1e-8
