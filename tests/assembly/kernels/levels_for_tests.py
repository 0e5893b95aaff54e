"""Print a digest of each kind of compiled result.

This program is run by test_choice.py and by .ci/clang.  It does not import other tests.
"""

import hashlib
from dataclasses import is_dataclass

import numpy as np

from forcefit.assembly.kernels.choice import kernels
from forcefit.assembly.kinematics.posture import (
    home_posture,
    place_many,
    place_many_joints,
    together,
)
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import load_robot
from forcefit.assembly.solvers.conic import minimise_energy
from forcefit.assembly.statistics.clearance_positions import position_clearances
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.posture_margins import prepare_margins

LOAD = [5.0, -3.0, 8.0, 60.0, 20.0, -90.0]


def digest(answer):
    """Return a digest of all floating-point numbers of a result."""
    found = hashlib.sha256()

    def take(one):
        if isinstance(one, np.ndarray) and one.dtype == float:
            found.update(one.tobytes())
        elif isinstance(one, float):
            found.update(np.float64(one).tobytes())
        elif isinstance(one, tuple | list):
            list(map(take, one))
        elif is_dataclass(one):
            take([getattr(one, name) for name in one.__dataclass_fields__])

    take(answer)
    assert found.digest() != hashlib.sha256().digest()
    return found.hexdigest()


def answers():
    """Yield names and results of problems with more points than lanes."""
    rng = np.random.default_rng(5)
    for name, k in (("five_bar", 11), ("hexapod", 9)):
        robot = load_robot(name)
        home = home_posture(robot)
        pose = np.array([*home.pose().values()]) + [*[0.02] * 3, *[0.0] * 3]
        poses = pose * rng.uniform(0.95, 1.05, (k, 1))
        if name == "five_bar":
            poses[:, 2:] = np.nan
        placed = [one for one in place_many(robot, poses)[0] if one is not None]
        yield f"{name} placed", [one.transforms for one in placed]
        at = together([*placed, *[home] * (k - len(placed))])
        errors = 1e-4 * rng.normal(size=(k, len(robot.frames), 6))
        yield f"{name} (22)", solve_assembly(at, errors=errors)
        yield f"{name} (22) of one", solve_assembly(at[:1], errors=errors[:1])
        yield f"{name} loaded", solve_assembly([home] * k, LOAD, errors=errors)
        yield f"{name} (21)", zone_margin(at, "free", errors)
        three = solve_assembly(at[:3], errors=errors[:3])
        yield f"{name} (27)", bound_pose_error(three)
        yield f"{name} K_C", platform_stiffness(at)
        one = linear_response(home)
        draws = one.solve(errors)
        yield f"{name} draws", draws
        yield f"{name} draws (21)", prepare_margins(home).solve(errors)
        for model in ("uniform", "contact"):
            rngs = [np.random.default_rng(i) for i in range(k)]
            moved = position_clearances(one, draws, model, rngs)
            yield f"{name} {model}", moved
    link = MatrixLink(1e6 * np.eye(6))
    play = Clearance(radial=1e-5, axial=1e-4)
    slider = Robot("slider", "end", (
        Frame("link", translation=[0, 0, 0.5], link=link),
        Frame("slide", "link", joint="prismatic", clearance=play),
        Frame("end", "slide"), Frame("wall", translation=[0, 0, 0.5], link=link),
    ), (("end", "wall"),))  # fmt: skip
    errors = 1e-4 * rng.normal(size=(11, 4, 6))
    yield "slider within its bound", solve_assembly(home_posture(slider), errors=errors)
    springs = np.diag([2e4, 2e4, 0, 1e8, 1e8, 5e7])
    lift = Robot("lift", "table", (
        Frame("screw", joint="revolute", actuated=True),
        Frame("nut", "screw", [0, 0, 0.4], joint="helical", pitch=0.005,
              clearance=play, joint_stiffness=springs),
        Frame("table", "nut", [0.2, 0, 0], link=link),
        Frame("column", translation=[0.2, 0, 0.4], joint="prismatic"),
        Frame("collar", "column"),
    ), (("table", "collar"),))  # fmt: skip
    turns = np.full((11, 5), np.nan)
    turns[:, 0] = rng.uniform(-40, 40, 11)
    lifted = [one for one in place_many_joints(lift, turns)[0] if one is not None]
    yield "lift placed", [one.transforms for one in lifted]
    errors = 1e-4 * rng.normal(size=(11, 5, 6))
    yield "lift loaded", solve_assembly(lifted, LOAD, errors=errors)
    yield "lift (21)", zone_margin(lifted, errors=errors)
    group = np.repeat(np.arange(4), [1, 2, 3, 4])
    H = rng.normal(size=(2, 10))
    given = rng.normal(size=(5, 10)), 3 * rng.normal(size=5), rng.normal(size=10)
    yield "cones", minimise_energy(*given, H, H @ (0.1 * rng.normal(size=10)), group)


if __name__ == "__main__":
    print(kernels.__name__.rpartition(".")[2], kernels.lanes, sep="\t")
    for name, answer in answers():
        print(name, digest(answer), sep="\t")
