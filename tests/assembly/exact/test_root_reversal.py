"""Tests with the base and the platform of a robot exchanged."""

from dataclasses import dataclass

import numpy as np
import pytest

from forcefit import Clearance, Frame, MatrixLink, Robot, solve_assembly, solve_exact
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.stiffness.screws import (
    rotation_matrix,
    rotation_vector,
    screw_map,
    transform,
)


@dataclass
class Body:
    """Body between two joints.

    Attributes:
        T: transform from its start to its end.
        error: geometric error at its end.
        K: stiffness at its end.
        joint: arguments of the joint at its end.
    """

    T: np.ndarray
    error: np.ndarray
    K: np.ndarray
    joint: dict

    def reversed(self, joint):
        """Return the body with start and end exchanged."""
        back = screw_map(self.T[:3, 3], self.T[:3, :3])
        C = back @ np.linalg.inv(self.K) @ back.T
        C = (C + C.T) / 2
        return Body(np.linalg.inv(self.T), -back @ self.error, np.linalg.inv(C), joint)


def random_legs(rng):
    """Return two legs with three bodies each, and the pose of the platform."""
    legs, platform = [], transform([0.4, 0.1, 0.3], rotation_matrix([0.3, -0.2, 0.5]))
    for _ in range(2):
        leg, here = [], np.eye(4)
        for _ in range(2):
            shift, turn = rng.uniform(-0.3, 0.3, 3), rng.normal(size=3)
            T = transform(shift, rotation_matrix(turn))
            here = here @ T
            leg.append((T, rng.choice(["pin", "hinge", "clearance"])))
        leg.append((np.linalg.inv(here) @ platform, None))
        legs.append([body(rng, T, kind) for T, kind in leg])
    return legs, platform


def body(rng, T, kind):
    A = rng.normal(size=(6, 6)) * np.repeat([1.0, 0.2], 3)
    K = 1e5 * (A.T @ A + 0.1 * np.diag(np.repeat([1.0, 0.04], 3)))
    clearance = Clearance(radial=2e-5, axial=1e-5, tilt=1e-4, spin=5e-5)
    joint = {
        None: {},
        "pin": {"joint": "revolute", "clearance": Clearance(radial=2e-5, tilt=1e-4)},
        "hinge": {"joint": "revolute", "joint_stiffness": np.diag(
            [1e4, 2e4, 3.0, 1e7, 1e7, 2e7])},
        "clearance": {"clearance": clearance},
    }[kind]  # fmt: skip
    return Body(T, rng.normal(size=6) * np.repeat([1e-3, 2e-4], 3), K, joint)


def robot_of(legs):
    """Return the robot with these legs.  The end of the first leg is the platform."""
    frames, ends = [], []
    for name, leg in zip("ab", legs, strict=True):
        above = "base"
        for i, one in enumerate(leg):
            frames.append(Frame(
                f"{name}{i}", above, one.T[:3, 3], rotation_vector(one.T[:3, :3]),
                geometric_error=one.error, link=MatrixLink(one.K), **one.joint,
            ))  # fmt: skip
            above = frames[-1].name
        ends.append(above)
    return Robot("two_legs", ends[0], tuple(frames), (tuple(ends),))


def from_the_platform(legs):
    """Return the legs with base and platform exchanged."""
    turned = []
    for leg in legs:
        joints = [{}, *(one.joint for one in leg)]
        turned.append([leg[k].reversed(joints[k]) for k in reversed(range(len(leg)))])
    return turned


@pytest.mark.parametrize("seed", range(6))
def test_solution_does_not_depend_on_choice_of_base(seed):
    legs, platform = random_legs(np.random.default_rng(seed))
    one = solve_assembly(home_posture(robot_of(legs)))
    other = solve_assembly(home_posture(robot_of(from_the_platform(legs))))
    assert one.energy > 1e-6
    assert other.energy == pytest.approx(one.energy, rel=1e-8)
    plain = one.energy_without_clearance
    assert other.energy_without_clearance == pytest.approx(plain, rel=1e-9)
    # the base moves relative to the platform by the inverse motion
    R, p = platform[:3, :3], platform[:3, 3]
    expected = -screw_map(R.T @ p, R.T) @ one.platform_screw
    size = np.abs(expected).reshape(2, 3).max(axis=1).repeat(3)
    assert np.all(np.abs(other.platform_screw - expected) < 1e-5 * size)
    # in the reversed leg, the wrench acts at the opposite end of each body
    for name in "ab":
        for k, this in enumerate(legs["ab".index(name)]):
            here = one.wrenches[one.posture.robot.index(f"{name}{k}")]
            there = other.wrenches[other.posture.robot.index(f"{name}{2 - k}")]
            back, tol = screw_map(this.T[:3, 3], this.T[:3, :3]), np.abs(here).max()
            assert back.T @ there == pytest.approx(-here, rel=1e-4, abs=1e-4 * tol)


@pytest.mark.parametrize("seed", range(3))
def test_exact_energy_with_exchanged_base_differs_by_second_order(seed):
    """Errors before and after a rotation differ by second-order terms."""
    legs, _ = random_legs(np.random.default_rng(seed))
    off = []
    for s in (1.0, 0.5):
        for one in (*legs[0], *legs[1]):
            one.error = one.error * s
            one.joint.pop("clearance", None)
        here, there = (solve_exact(home_posture(robot_of(these))).energy
                       for these in (legs, from_the_platform(legs)))  # fmt: skip
        off.append(abs(there / here - 1))
    assert off[0] < 0.05
    assert off[1] < 0.7 * off[0] + 1e-9
