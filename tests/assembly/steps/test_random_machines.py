"""Comparison of random machines with a dense stiffness model.

The unknowns of the dense model are the displacements of all leg ends.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Frame, MatrixLink, Robot
from forcefit.assembly.steps.plan import Fix, Join, Plan, Preload, Release
from forcefit.assembly.steps.run import assemble_in_steps
from forcefit.stiffness.screws import SCREW

LEGS = 4
SIZES = np.repeat([1e-2, 1e-3], 3)


def machine(rng):
    """Return a random robot, the stiffness and the error of each leg, and a rotation.

    A leg consists of two elastic links with errors.  Stiffness and error refer to the
    platform, whose rotation is returned.
    """
    turn = Rotation.from_rotvec(rng.normal(size=3))
    place, frames, legs = rng.normal(size=3), [], []
    for i in range(LEGS):
        middle, at = Rotation.from_rotvec(rng.normal(size=3)), rng.normal(size=3)
        rotations = [middle, middle.inv() * turn]
        shifts = [at, middle.inv().apply(place - at)]
        names = [f"leg{i}", "platform" if i == 0 else f"end{i}"]
        C, error = np.zeros((6, 6)), np.zeros(6)
        for k, name in enumerate(names):
            root = rng.normal(size=(6, 6)) / SIZES
            K, own = root.T @ root, rng.normal(size=6) * 1e-5
            arm = turn.inv().apply((place - at) * (k == 0))
            back = (turn.inv() * middle if k == 0 else Rotation.identity()).as_matrix()
            A = np.zeros((6, 6))
            A[:3, :3] = A[3:, 3:] = back
            A[3:, :3] = -np.cross(arm, back, axisb=0, axisc=0)
            C, error = C + A @ np.linalg.inv(K) @ A.T, error + A @ own
            parent, rotation = "base" if k == 0 else names[0], rotations[k].as_rotvec()
            frames.append(Frame(name, parent, translation=shifts[k], rotation=rotation,
                                geometric_error=own, link=MatrixLink(K)))  # fmt: skip
        legs.append((np.linalg.inv(C), error))
    closures = tuple(("platform", f"end{i}") for i in range(1, LEGS))
    return Robot("random", "platform", tuple(frames), closures), legs, turn


def least_energy(legs, held, springs, load, count=6 * LEGS):
    """Return the displacements of all leg ends, constraint wrenches, and the energy."""
    K, f, constant = np.zeros((count, count)), np.zeros(count), 0.0
    for i, (own, error) in enumerate(legs):
        here = slice(6 * i, 6 * i + 6)
        K[here, here] += own
        f[here] += own @ error
        constant += error @ own @ error / 2
    for row, value, k in springs:
        K += k * np.outer(row, row)
        f += k * value * row
        constant += k * value**2 / 2
    f[:6] += load
    G = np.array([row for row, _ in held]).reshape(-1, count)
    g = np.array([value for _, value in held])
    K_inv = np.linalg.inv(K)
    free = K_inv @ f
    wrench = np.linalg.solve(G @ K_inv @ G.T, g - G @ free) if len(G) else np.zeros(0)
    x = free + K_inv @ G.T @ wrench
    return x, wrench, x @ K @ x / 2 - x @ f + x[:6] @ load + constant


def opening(i):
    """Return the matrix of the platform screw minus the screw of the end of leg i."""
    rows = np.zeros((6, 6 * LEGS))
    rows[:, :6], rows[:, 6 * i : 6 * i + 6] = np.eye(6), -np.eye(6)
    return rows


@pytest.mark.parametrize("seed", range(6))
def test_energies_of_random_machine_agree_with_dense_model(seed):
    """The plan contains a fixture with a spring, a slot, a load and releases."""
    rng = np.random.default_rng(seed)
    robot, legs, turn = machine(rng)
    locked = [int(c) for c in np.sort(rng.choice(6, 3, replace=False))]
    wrench = rng.normal(size=6) * [2, 2, 2, 30, 30, 30]
    plan = Plan((
        Fix("fix", "platform", {"TX": 2e-5, "RZ": 1e-4}, {"TX": 1e6}),
        Join("1", robot.closures[0]),
        Preload("load", "platform", wrench),
        Join("2", robot.closures[1], tuple(SCREW[c] for c in locked)),
        Release("off", ("fix",)),
        Join("3", robot.closures[2]),
        Release("away", ("load",)),
    ))  # fmt: skip
    results = assemble_in_steps(plan, home_posture(robot))
    # the load is transformed from base axes to platform axes
    own = np.concatenate([turn.inv().apply(part) for part in (wrench[:3], wrench[3:])])
    e = np.eye(6 * LEGS)
    fixed, springs = [(e[2], 1e-4)], [(e[3], 2e-5, 1e6)]
    first = [(row, 0.0) for row in opening(1)]
    third = [(row, 0.0) for row in opening(3)]
    none = 0 * own
    expected = [
        least_energy(legs, fixed, springs, none),
        least_energy(legs, fixed + first, springs, none),
        least_energy(legs, fixed + first, springs, own),
    ]
    at = np.where(np.isin(range(6), locked), opening(2) @ expected[-1][0], 0.0)
    second = list(zip(opening(2), at, strict=True))
    expected += [
        least_energy(legs, fixed + first + second, springs, own),
        least_energy(legs, first + second, [], own),
        least_energy(legs, first + second + third, [], own),
        least_energy(legs, first + second + third, [], none),
    ]
    energies = [result.energy[0] for result in results]
    assert energies == pytest.approx([found[2] for found in expected], rel=1e-8)
    last = results[-1].wrenches
    assert np.concatenate([last[name][0] for name in "123"]) == pytest.approx(
        expected[-1][1], rel=1e-7, abs=1e-7 * np.abs(expected[-1][1]).max()
    )
    screw = results[-1].platform_screw[0].reshape(2, 3)
    assert turn.inv().apply(screw).ravel() == pytest.approx(
        expected[-1][0][:6], rel=1e-7, abs=1e-12
    )
