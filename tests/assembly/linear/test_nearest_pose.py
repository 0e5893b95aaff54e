"""Pose nearest to nominal, for robots whose pose is not unique."""

import json
import warnings
from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.nearest_pose import nearest_pose
from forcefit.assembly.linear.reference.as_printed import energy_as_printed
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import predict, with_rest_positions
from forcefit.assembly.model.clearance import CONES, clearance_bounds
from forcefit.assembly.model.links import joint_compliances, link_compliances
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from forcefit.assembly.robots import load_robot
from tests.campaigns_for_tests import write_campaign
from tests.robots_for_tests import coaxial_beams

POINT = np.array([0.03, -0.05, 0.02])  # [m] reference point in platform axes
UNIT = 1e-4  # [rad, m] unit of the screws in cvxpy


def erring(name, seed, turn=2e-4, shift=2e-5, pose=None):
    """Return a posture of a built-in robot with small errors at all frames."""
    robot, rng = load_robot(name), np.random.default_rng(seed)
    size = np.array([turn] * 3 + [shift] * 3)
    errors = rng.uniform(-1, 1, (len(robot.frames), 6)) * size
    return place_robot(robot.with_errors(errors), pose)


def arm_of(posture):
    """Return the vector from the platform's origin to the reference point [m]."""
    return posture.platform[:3, :3] @ POINT


def at_point(answer, posture):
    """Return the platform screw at the reference point, (6,) [rad, m]."""
    turn, move = np.split(answer.platform_screw, 2)
    return np.concatenate([turn, move + np.cross(turn, arm_of(posture))])


def nearest_by_cvxpy(posture, point, load=None):
    """Return the pose nearest to nominal, computed by cvxpy, (6,) [rad, m].

    Without a load, the springs are undeformed.  Under a load, the energy minus the work
    is minimal to a relative accuracy of 1e-9.
    """
    robot, count = posture.robot, len(posture.robot.frames)
    c, e, b = (cp.Variable((count, 6)) for _ in range(3))
    x = cp.Variable(6)
    limits = []
    for j, row in enumerate(clearance_bounds(robot) / UNIT):
        for k, rows in enumerate(CONES):
            part = cp.hstack([c[j, r] for r in rows])
            if row[k] == 0:
                limits.append(part == 0)
            elif np.isfinite(row[k]):
                limits.append(cp.norm(part) <= float(row[k]))
    if load is None:
        limits += [e == 0, b == 0]
    else:
        energy, screw = energy_as_printed(posture, load)
        terms, least = [], energy - load @ screw
        for screws, compliances in ((e, link_compliances), (b, joint_compliances)):
            for j, C in enumerate(compliances(robot)):
                soft = np.flatnonzero(np.diag(C) > 0)
                hard = np.setdiff1d(np.arange(6), soft)
                limits += [screws[j, hard] == 0] if len(hard) else []
                if len(soft):
                    root = np.linalg.cholesky(np.linalg.inv(C[np.ix_(soft, soft)]))
                    size = UNIT / np.sqrt(2 * abs(least))
                    terms.append(cp.sum_squares(root.T @ screws[j, soft] * size))
        work = load @ x * (UNIT / abs(least))
        limits.append(sum(terms) - work <= np.sign(least) + 1e-9)
    total = robot.errors / UNIT + c + e + b

    def end(name):
        path = np.flatnonzero(robot.on_path[robot.index(name)])
        return sum(posture.paths[j] @ total[j] for j in path)

    limits += [end(a) == end(b) for a, b in robot.closures]
    limits.append(x == end(robot.platform))
    arm = posture.platform[:3, :3] @ point
    turn, move = x[:3], x[3:]
    deviation = cp.hstack([  # rotation, translation + rotation x arm
        turn,
        move[0] + turn[1] * arm[2] - turn[2] * arm[1],
        move[1] + turn[2] * arm[0] - turn[0] * arm[2],
        move[2] + turn[0] * arm[1] - turn[1] * arm[0],
    ])  # fmt: skip
    problem = cp.Problem(cp.Minimize(cp.norm(deviation)), limits)
    with warnings.catch_warnings():
        # The status contains the same information.
        warnings.simplefilter("ignore", UserWarning)
        problem.solve(solver=cp.CLARABEL)
    if problem.status != cp.OPTIMAL:
        # The feasible set is only 1e-9 wide, so convergence depends on the processor.
        pytest.skip(f"cvxpy found no certain optimum: {problem.status}")
    assert problem.status == "optimal"
    return deviation.value * UNIT


@pytest.mark.parametrize("name", ["five_bar", "delta", "hexapod", "four_bar"])
@pytest.mark.parametrize("seed", [0, 1])
def test_nearest_pose_in_the_assembly_zone_agrees_with_cvxpy(name, seed):
    posture = erring(name, seed)
    here = as_declared(posture, point=POINT)
    found = predict(here)
    assert found.undetermined.tolist() == [True]
    answer = solve_assembly(posture)
    near, free = nearest_pose(answer, arm_of(posture))
    assert answer.energy < 1e-15
    assert free
    expected = nearest_by_cvxpy(posture, POINT)
    reached = at_point(near, posture)
    size = np.linalg.norm(expected)
    assert np.linalg.norm(reached) == pytest.approx(size, rel=1e-5, abs=1e-10)
    assert reached == pytest.approx(expected, abs=1e-7)
    # The device measures finite rotations, which differ by theta^2 / 2 times 0.2 m.
    assert found.deviation[0] == pytest.approx(reached, abs=1e-7)
    assert np.linalg.norm(at_point(answer, posture)) > 1.5 * size


@pytest.mark.parametrize(("name", "margin"), [("five_bar", 0.0), ("orthoglide", 0.02)])
def test_nearest_pose_has_minimum_energy(name, margin):
    posture = erring(name, 3)
    load = np.array([0, 0, 0, 0, -20.0, 0])
    here = as_declared(posture, load, point=POINT)
    answer = solve_assembly(posture, here.load_at_origin()[0])
    found = predict(here)
    assert found.undetermined.tolist() == [True]
    near, _ = nearest_pose(answer, arm_of(posture))
    assert near.energy == pytest.approx(answer.energy, rel=1e-12)
    assert near.duality_gap() <= answer.duality_gap() + 1e-9 * answer.energy
    assert near.closure_residual() < 1e-9
    assert near.clearance_excess() < 1e-9
    expected = nearest_by_cvxpy(posture, POINT, here.load_at_origin()[0])
    size = np.linalg.norm(expected)
    # The energy tolerance of 1e-9 corresponds to a deflection error of 5e-5.
    assert np.linalg.norm(at_point(near, posture)) == pytest.approx(size, rel=1e-4)
    assert found.deviation[0] == pytest.approx(expected, abs=2e-3 * size)
    assert np.linalg.norm(at_point(answer, posture)) > (1 + margin) * size


@pytest.mark.parametrize("clearance", [2e-5, 8e-5])
def test_deviation_on_two_pins_equals_error_minus_clearance(
    clearance,
):
    """Two rigid chains with errors of 0.1 mm carry a platform on pins.

    The deviation of the nearest pose is 0.1 mm minus the clearance of the pins.
    """
    pin = Clearance(radial=clearance, spin=0.0)
    frames = (
        Frame("one", geometric_error=[0, 0, 0, 1e-4, 0, 0], joint="revolute",
              clearance=pin),
        Frame("end", "one"),
        Frame("two", geometric_error=[0, 0, 0, 1e-4, 0, 0], joint="revolute",
              clearance=pin),
        Frame("meets", "two"),
    )  # fmt: skip
    posture = home_posture(Robot("pins", "end", frames, (("end", "meets"),)))
    found = predict(as_declared(posture))
    assert found.undetermined.tolist() == [True]
    expected = [0, 0, 0, 1e-4 - clearance, 0, 0]
    assert found.deviation[0] == pytest.approx(expected, abs=1e-10)


def test_unique_pose_is_not_reported_as_undetermined():
    """The robot has no clearance, or a load moves each joint to its limit."""
    tight = home_posture(coaxial_beams(np.array([0, 0, 0, 1e-4, 0, 0])))
    assert predict(as_declared(tight)).undetermined.tolist() == [False]
    pin = Clearance(radial=2e-5, axial=2e-5, tilt=1e-4, spin=1e-4)
    slack = Clearance(radial=1, axial=1, tilt=1, spin=1)
    frames = (
        Frame("one", joint="revolute", clearance=pin, actuated=True),
        Frame("end", "one"),
        Frame("slack", joint="fixed", clearance=slack),
        Frame("end2", "slack"),
    )
    load = np.array([3.0, 4.0, 3.0, 3.0, 4.0, 5.0])
    pushed = [0.6e-4, 0.8e-4, 1e-4, 1.2e-5, 1.6e-5, 2e-5]
    for robot in (
        Robot("open", "end", frames[:2]),
        Robot("closed", "end", frames, (("end", "end2"),)),
    ):
        found = predict(as_declared(home_posture(robot), load))
        assert found.undetermined.tolist() == [False], robot.name
        assert found.deviation[0] == pytest.approx(pushed, abs=1e-10)


def test_prediction_with_stored_rest_positions_does_not_change():
    here = as_declared(erring("five_bar", 5), point=POINT)
    found, held = predict(here), predict(with_rest_positions(here))
    assert held.deviation == pytest.approx(found.deviation, abs=1e-9)


def test_exact_prediction_starts_from_the_nearest_pose():
    """With errors of 20 um, the linear and exact poses differ by less than 0.2 um."""
    here = as_declared(erring("five_bar", 0), point=POINT)
    found = predict(replace(here, exact=True))
    assert found.undetermined.tolist() == [True]
    assert found.deviation == pytest.approx(predict(here).deviation, abs=2e-7)


PLAYING = """
platform = "end"
closure = [{ frames = ["end", "meets"] }]
frame = [
    { name = "drive", parent = "base", joint = "prismatic", actuated = true, clearance = { radial = 2e-5, axial = 2e-5 } },
    { name = "end", parent = "drive", translation = [0.3, 0, 0] },
    { name = "guide", parent = "base", joint = "prismatic", clearance = { radial = 2e-5 } },
    { name = "meets", parent = "guide", translation = [0.3, 0, 0] },
]
"""  # noqa: E501


@pytest.fixture(scope="module")
def with_clearance(tmp_path_factory):
    """Return a campaign with 24 noisy readings of a slide with clearance."""
    rng = np.random.default_rng(1)
    rows = [
        ",".join([f"r{k}", str(0.02 * (k % 8)), *map(str, rng.normal(0, 5e-6, 3))])
        for k in range(24)
    ]
    folder = tmp_path_factory.mktemp("loose") / "campaign"
    head = "id,q.drive,meas.tx,meas.ty,meas.tz"
    return write_campaign(folder, head, rows, robot=PLAYING)


@pytest.mark.parametrize("command", ["inspect", "diagnose"])
def test_commands_report_measurements_with_undetermined_pose(
    command, with_clearance, tmp_path, run
):
    target = tmp_path / "found.json"
    status, said, err = run("validation", command, with_clearance, "--json", target)
    assert status == 0, err
    assert "clearances leave the pose undetermined in 24 of 24 rows" in said
    assert "in a closed chain the pose nearest to nominal" in said
    assert json.loads(target.read_text())["open"] == [f"r{k}" for k in range(24)]


def test_nearest_pose_respects_the_motion_limit_of_a_joint():
    """A pin with an error of 1.5e-3 rad rotates by at most 1e-3 rad.

    The smallest deviation is therefore 5e-4 rad.
    """
    robot = Robot("pin", "end", (
        Frame("pin", joint="revolute", clearance=Clearance(spin=1e-3),
              geometric_error=[0, 0, 1.5e-3, 0, 0, 0]),
        Frame("end", "pin", [1.0, 0, 0]),
        Frame("stop", clearance=Clearance(spin=2e-3)),
        Frame("at_end", "stop", [1.0, 0, 0]),
    ), (("end", "at_end"),))  # fmt: skip
    found, free = nearest_pose(solve_assembly(home_posture(robot)))
    assert free
    assert found.platform_screw[2] == pytest.approx(5e-4, rel=1e-3)
    assert found.clearance_excess() < 1e-7
