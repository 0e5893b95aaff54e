"""Tests of joints that are bolted at one pose.

The robot is a four-bar mechanism on a stand with slotted holes, and one of its pins is
tilted.
"""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest

from forcefit import BadInput, bolt_joints, load_robot, sweep, worst_pose, write_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.error_distributions import read_sources, tolerance_sources
from forcefit.assembly.model.links import link_compliances
from forcefit.assembly.model.robot import Clearance, Frame, LockedAt, Robot
from forcefit.assembly.statistics.allocation import allocate
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.responses import respond
from forcefit.assembly.statistics.tolerance_file import read_plan
from forcefit.stiffness.screws import rotation_matrix
from tests.assembly.steps.robots_for_steps import spring

STEEL = "link = { beam = { radius = 0.02 }, young = 2.1e11, poisson = 0.3 }"
PIN = "clearance = { radial = 1e-5, axial = 1e-5, tilt = 1e-4 }"
PIVOT = 'joint = "revolute", joint_stiffness = [1e5, 1e5, 0, 1e8, 1e8, 1e8]'
FOUR_BAR = f"""
name = "bolted_four_bar"
platform = "coupler"
closure = [{{ frames = ["coupler", "end"] }}]
frame = [
    {{ name = "crank", parent = "base", joint = "revolute", actuated = true, position = 1.2, joint_stiffness = [1e5, 1e5, 1e5, 1e8, 1e8, 1e8] }},
    {{ name = "pin1", parent = "crank", translation = [0.2, 0, 0], position = -0.6752308876405433, {PIN}, {PIVOT}, {STEEL} }},
    {{ name = "coupler", parent = "pin1", translation = [0.5, 0, 0], {STEEL} }},
    {{ name = "stand", parent = "base", translation = [0.6, 0.1, 0], clearance = {{ radial = 1e-3, axial = 1e-3, tilt = 1e-2, spin = 1e-2 }} }},
    {{ name = "pivot", parent = "stand", position = 1.8451052827279508, {PIVOT} }},
    {{ name = "pin2", parent = "pivot", translation = [0.35, 0, 0], position = -1.3203361703684942, geometric_error = [5e-3, 0, 0, 0, 0, 0], {PIN}, {PIVOT}, {STEEL} }},
    {{ name = "end", parent = "pin2" }},
]
"""  # noqa: E501
ANGLES = (0.4, 0.8, 1.2, 1.6, 2.0)


def four_bar(tmp_path, locked_at="", frame="stand"):
    path, head = tmp_path / "four_bar.toml", f'{{ name = "{frame}", '
    key = f"locked_at = {locked_at}, " if locked_at else ""
    path.write_text(FOUR_BAR.replace(head, head + key))
    return path


def at_angle(angle):
    return f"{{ joints = {{ crank = {angle} }} }}"


def energy_by_cvxpy(robot, posture, errors, locked=None):
    """Return the minimum energy, computed by cvxpy.

    With ``locked``, the motion of the stand within its clearance is given.
    """
    at = {"base": np.eye(4)}
    carried, signs = {}, {}
    for frame, q in zip(robot.frames, posture.coordinates, strict=True):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = rotation_matrix(frame.rotation), frame.translation
        own = at[frame.parent] @ T
        carried[frame.name] = own
        turned = np.eye(4)
        if frame.joint == "revolute":
            turned[:3, :3] = rotation_matrix([0, 0, q])
        at[frame.name] = own @ turned
        signs[frame.name] = -1 if frame.name in ("stand", "pivot", "pin2", "end") else 1
    total, energy, cones = 0, 0, []
    links = link_compliances(robot)
    for i, frame in enumerate(robot.frames):
        T = carried[frame.name]
        p = T[:3, 3]
        cross = np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])
        A = np.zeros((6, 6))
        A[:3, :3] = A[3:, 3:] = T[:3, :3]
        A[3:, :3] = cross @ T[:3, :3]
        moved = errors[i].copy()
        if frame.link is not None:
            y = cp.Variable(6)
            moved = moved + np.linalg.cholesky(links[i]) @ y
            energy += cp.sum_squares(y) / 2
        if frame.joint_stiffness is not None:
            K = np.diag(frame.joint_stiffness)
            roots = np.zeros(6)
            roots[K > 0] = 1 / np.sqrt(K[K > 0])
            y = cp.Variable(6)
            moved = moved + np.diag(roots) @ y
            energy += cp.sum_squares(y) / 2
        if frame.joint == "revolute" and not frame.actuated:
            moved = moved + np.eye(6)[:, 2:3] @ cp.Variable(1)
        bound = frame.clearance or (frame.locked_at and frame.locked_at.clearance)
        if frame.name == "stand" and locked is not None:
            moved = moved + locked
        elif bound is not None:
            u = cp.Variable(6)
            sizes = [(slice(0, 2), bound.tilt), (slice(3, 5), bound.radial)]
            sizes += [(slice(5, 6), bound.axial)]
            sizes += [(slice(2, 3), bound.spin)] if bound.spin else []
            for rows, size in sizes:
                cones.append(cp.norm(u[rows] / size) <= 1)
            if not bound.spin:
                cones.append(u[2] == 0)
            moved = moved + u
        total = total + signs[frame.name] * (A @ moved)
    scale = 1e3  # improves the scaling of the cone program
    problem = cp.Problem(cp.Minimize(scale * energy), [total * scale == 0, *cones])
    problem.solve(solver=cp.CLARABEL)
    return problem.value / scale


@pytest.mark.parametrize("angle", [0.4, 1.2, 2.0])
def test_energy_of_bolted_robot_agrees_with_cvxpy(tmp_path, angle):
    """Energies at the pose of bolting and at other poses are compared."""
    robot = load_robot(four_bar(tmp_path, at_angle(angle)))
    errors, screw = robot.declared_errors, robot.frame("stand").locked_at.screw
    assert errors[robot.index("pin2"), 0] == 5e-3
    there = place_robot(robot, joints={"crank": angle})
    least = energy_by_cvxpy(robot, there, errors)
    assert solve_assembly(there).energy == pytest.approx(least, abs=2e-6)
    given = energy_by_cvxpy(robot, there, errors, screw)
    assert given == pytest.approx(least, abs=2e-6)
    for other in ANGLES:
        posture = place_robot(robot, joints={"crank": other})
        expected = energy_by_cvxpy(robot, posture, errors, screw)
        assert solve_assembly(posture).energy == pytest.approx(expected, abs=2e-6)


def test_statistics_bolt_each_random_machine(tmp_path):
    robot = load_robot(four_bar(tmp_path, at_angle(0.4)))
    sources = tolerance_sources(robot, np.array([1e-3] * 3 + [1e-4] * 3), ("pin2",))
    posture = place_robot(robot, joints={"crank": 2.0})
    experiment = Experiment(posture, sources, 7, "least", margins=False, stress=False)
    rows = experiment.solve(0, 6)
    errors = sources.errors(sources.draw(0, 6, 7))
    for row, own in zip(rows, errors, strict=True):
        machine = bolt_joints(robot.with_errors(own))
        alone = solve_assembly(replace(posture, robot=machine)).energy
        assert row["energy"] == pytest.approx(alone, rel=1e-6, abs=1e-12)
        assert np.any(machine.frame("stand").locked_at.screw)


def test_sweep_bolts_each_random_machine(tmp_path):
    path = four_bar(tmp_path, at_angle(0.4))
    errors = tmp_path / "errors.toml"
    errors.write_text('[[errors]]\nframes = ["pin2"]\nmost = [5e-3, 0, 0, 0, 0, 0]\n')
    data = sweep(
        path, grid="q.crank=0.8:2.0:0.4", errors=errors, draws=5, assumption="none"
    )
    robot = load_robot(path)
    sources = read_sources(errors, robot)
    for i, own in enumerate(sources.errors(sources.draw(0, 5, 1))):
        machine = bolt_joints(robot.with_errors(own))
        postures = [place_robot(machine, joints={"crank": a}) for a in ANGLES[1:]]
        alone = [solve_assembly(posture).energy for posture in postures]
        energies = np.asarray(data["energy"].isel(draw=i)).ravel()
        assert energies == pytest.approx(alone, rel=1e-6, abs=1e-12)


def test_bolted_joint_is_unchanged_after_writing_and_reading(tmp_path):
    robot = load_robot(four_bar(tmp_path, at_angle(0.4)))
    write_robot(robot, tmp_path / "again.toml")
    again = load_robot(tmp_path / "again.toml")
    assert again.errors == pytest.approx(robot.errors, abs=1e-15)
    bolt = again.frame("stand").locked_at
    assert bolt.joints == {"crank": 0.4}
    assert bolt.clearance == robot.frame("stand").locked_at.clearance


@pytest.mark.parametrize(("key", "text"), [
    ('"here"', 'expected "home", {'),
    ("{ joints = { crnak = 1.0 } }", "crnak"),
    ("{ joints = {} }", "found no coordinate"),
    ("{ pose = { tx = 5.0 } }", "locked_at"),
])  # fmt: skip
def test_invalid_key_locked_at_is_rejected(tmp_path, key, text):
    with pytest.raises(BadInput) as caught:
        load_robot(four_bar(tmp_path, key))
    assert text in str(caught.value)
    assert "locked_at" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bolted_joint_without_clearance_is_rejected(tmp_path):
    with pytest.raises(BadInput, match="a fixed joint without clearance"):
        load_robot(four_bar(tmp_path, '"home"', "end"))


def slot_on_a_spring(gap, stiffness):
    """Return a platform on a rigid leg and on a spring with a bolted slot."""
    bolt = LockedAt(Clearance(axial=gap))
    frames = (
        Frame("guide", "base", joint="prismatic"),
        Frame("platform", "guide"),
        Frame("rigid", "base"),
        Frame("slot", "base", link=spring(stiffness, 5), locked_at=bolt),
        Frame("end", "slot"),
    )
    closures = (("platform", "rigid"), ("platform", "end"))
    return Robot("slot on a spring", "platform", frames, closures)


PLAN = """
yield = 1
draws = 8
limits = { energy = 0.8e-3 }
tolerance = [
    { frames = ["slot"], components = ["TZ"], cost = 4 },
    { frames = ["rigid"], components = ["TZ"], cost = 1 },
]
"""


def test_allocated_tolerances_of_bolted_robot_equal_closed_form(tmp_path):
    """The cost 4/a + 1/b is minimal at a = 2 C / 3 and b = C / 3 for a + b <= C.

    The slot compensates 50 um, and the energy limit allows a deflection of 40 um, so C
    is 90 um.
    """
    robot = slot_on_a_spring(50e-6, 1e6)
    path = tmp_path / "plan.toml"
    path.write_text(PLAN)
    found = allocate([home_posture(robot)], read_plan(path, robot), fresh=0)
    assert found.tolerances == pytest.approx([60e-6, 30e-6], rel=2e-3)
    assert found.worst["energy"][0] <= 0.8e-3 * (1 + 1e-3)
    assert np.isnan(found.price_bound)


@pytest.mark.parametrize("key", ["energy", "rotation", "translation"])
def test_derivatives_for_bolted_robot_equal_finite_differences(tmp_path, key):
    """The pose is not the pose at which the joint is bolted.

    Pose errors have an accuracy of 1e-9 rad or m, which determines the tolerance.
    """
    robot = load_robot(four_bar(tmp_path, at_angle(0.4)))
    response = linear_response(place_robot(robot, joints={"crank": 1.6}))
    widths = np.array([1e-3, 0, 0, 1e-3, 0, 0])
    sources = tolerance_sources(robot, widths, ("pin1", "pin2", "stand"))
    values = 2e-3 * np.array([[1, -0.4, 0.8, 0.3, 0.1, -0.7], [2, 1, -1, 0, 0.5, 0.2]])
    _, slopes = respond(response, sources, values, key)
    step = 2e-7 if key == "energy" else 2e-6
    for j, change in enumerate(step * np.eye(values.shape[1])):
        high, low = (respond(response, sources, values + sign * change, key)[0]
                     for sign in (1, -1))  # fmt: skip
        tolerance = (1e-6 if key == "energy" else 1e-3) * np.abs(slopes).max()
        assert slopes[:, j] == pytest.approx((high - low) / (2 * step), abs=tolerance)


DRAWN = """
format = 2
platform = "tool"
platform_at = [0.2, 0, 0]
body = [{ name = "stand" }, { name = "tool" }]
joint = [
    { name = "slot", type = "fixed", between = ["base", "stand"], at = [0, 0, 0], clearance = { radial = 1e-3 }, locked_at = "home" },
    { name = "pivot", type = "revolute", between = ["stand", "tool"], at = [0.1, 0, 0], axis = [0, 0, 1], actuated = true },
]
"""  # noqa: E501


def test_only_fixed_joints_in_format_2_can_be_bolted(write_file):
    frame = load_robot(write_file(DRAWN)).frame("slot")
    assert frame.clearance is None
    assert frame.locked_at.clearance.radial == 1e-3
    with pytest.raises(BadInput, match="found a joint that moves"):
        load_robot(write_file(DRAWN.replace("actuated = true", 'locked_at = "home"')))


def test_sweep_reports_loose_fixed_joint(tmp_path, run):
    words = ("--grid", "q.crank=0.4", "--assumption", "none", "-o", tmp_path / "a.nc")
    _, _, loose = run("assembly", "sweep", four_bar(tmp_path), *words)
    assert 'note: bolted_four_bar: the clearance of the fixed joint "stand"' in loose
    path = four_bar(tmp_path, at_angle(0.4))
    _, _, bolted = run("assembly", "sweep", path, *words[:-1], tmp_path / "b.nc")
    assert "fixed joint" not in bolted


def test_solve_reports_position_of_bolted_joint(tmp_path, run):
    path = four_bar(tmp_path, at_angle(0.4))
    status, out, _ = run("assembly", "solve", path, "--joint", "crank=2.0")
    assert status == 0
    assert out.count('joint "stand" is bolted at') == 1


def test_conversion_to_format_2_preserves_bolted_joints(tmp_path, run):
    path, drawn = four_bar(tmp_path, at_angle(0.4)), tmp_path / "bodies.toml"
    status, _, err = run("convert", path, "--format", "2", "-o", drawn)
    assert status == 0, err
    energies = [
        solve_assembly(place_robot(load_robot(p), joints={"crank": 2.0})).energy
        for p in (path, drawn)
    ]
    assert energies[1] == pytest.approx(energies[0], rel=1e-6)


def test_conversion_of_joint_bolted_at_rotated_platform_is_rejected(tmp_path, run):
    path = four_bar(tmp_path, "{ pose = { rz = 0.5 } }")
    drawn = tmp_path / "bodies.toml"
    status, _, err = run("convert", path, "--format", "2", "-o", drawn)
    assert status == 2
    assert "locked_at: found a rotation of the platform" in err
    assert not drawn.exists()


def test_worst_case_of_bolted_robot_is_rejected(tmp_path):
    robot = load_robot(four_bar(tmp_path, at_angle(0.4)))
    sources = tolerance_sources(robot, np.full(6, 1e-4), ("pin2",))
    prepared = linear_response(place_robot(robot, joints={"crank": 2.0}))
    with pytest.raises(BadInput, match="bolted at a pose"):
        worst_pose(prepared, sources, "translation")
