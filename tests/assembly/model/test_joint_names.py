"""Joints with several degrees of freedom, identified by their names."""

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.files.step_file import read_steps
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.error_distributions import read_sources, tolerance_sources
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.report.platform_stiffness import stiffness_values
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.steps.bolted import loose_over_poses
from forcefit.assembly.sweeps.parameters import load_design
from forcefit.assembly.sweeps.robot_sweep import sweep
from forcefit.inputs.table import BadInput
from forcefit.stiffness.screws import SCREW


def ring(radius, height, degrees):
    """Return points [m] on a circle about z."""
    angles = np.radians(degrees)
    x, y = radius * np.cos(angles), radius * np.sin(angles)
    return np.column_stack([x, y, np.full(len(x), height)]).tolist()


FEET = ring(1.0, 0.0, [0, 50, 120, 170, 240, 290])
# [m] ball centres in the home pose, base axes
BALLS = ring(0.5, 1.0, [-25, 75, 95, 195, 215, 315])
AT = np.array([0.0, 0.0, 1.1])  # [m] origin of the platform


def hexapod(tmp_path, ball=""):
    """Return a 6-UPS hexapod; ``ball`` contains keys of its spherical joints."""
    text = 'format = 2\nname = "six"\nplatform = "plate"\n'
    text += f'platform_at = {AT.tolist()}\n[[body]]\nname = "plate"\n'
    for k, (foot, top) in enumerate(zip(FEET, BALLS, strict=True), 1):
        along = np.subtract(top, foot)
        across = np.cross(along, [0.0, 0.0, 1.0])
        text += f"""
[[leg]]
name = "leg{k}"
[[leg.body]]
name = "yoke"
[[leg.body]]
name = "rod"
[[leg.joint]]
name = "cross"
type = "universal"
between = ["base", "yoke"]
at = {foot}
axis = {across.tolist()}
axis2 = {np.cross(along, across).tolist()}
[[leg.joint]]
name = "drive"
type = "prismatic"
between = ["yoke", "rod"]
at = {foot}
axis = {along.tolist()}
actuated = true
drive_stiffness = 1e6
[[leg.joint]]
name = "ball"
type = "spherical"
between = ["rod", "plate"]
at = {top}
{ball}
"""
    file = tmp_path / "six.toml"
    file.write_text(text)
    return file


def legs():
    """Return the unit wrench [M F] of each leg at the platform origin, (6, 6)."""
    rows = []
    for foot, top in zip(FEET, BALLS, strict=True):
        u = np.subtract(top, foot)
        u /= np.linalg.norm(u)
        rows.append([*np.cross(np.subtract(top, AT), u), *u])
    return np.array(rows).T


def test_wrench_of_a_ball_joint_is_a_force_along_its_leg(tmp_path):
    """The forces follow from the equilibrium of the platform."""
    load = np.array([3.0, -5.0, 2.0, 40.0, -70.0, -500.0])
    forces = np.linalg.solve(legs(), load)  # axial forces of the platform on the legs
    names = [f"leg{k}.ball" for k in range(1, 7)]
    poses = tmp_path / "poses.csv"
    poses.write_text("pose.tx,pose.ty,pose.tz\n0,0,1.1\n")
    file = hexapod(tmp_path)
    found = sweep(file, poses=poses, load=load, assumption="none", wrench_of=names)
    assert list(found["frame"].values) == names
    wrenches = found["wrench"].values.reshape(6, 6)
    np.testing.assert_allclose(wrenches[:, :3], 0.0, atol=1e-9)
    frames = [read_robot(file).index(f"{name}.first") for name in names]
    axes = home_posture(read_robot(file)).transforms[frames, :3, :3]
    in_base = np.einsum("kij,kj->ki", axes, wrenches[:, 3:])
    np.testing.assert_allclose(in_base, legs()[3:].T * forces[:, None], atol=1e-9)


def test_errors_of_ball_joints_act_like_leg_length_errors(tmp_path):
    """The error of a ball along its leg equals the change of the leg length."""
    sigma = 2e-5  # [m]
    errors = tmp_path / "errors.toml"
    errors.write_text(
        '[[errors]]\nframes = ["ball"]\ndistribution = "normal"\n'
        f"deviation = [0, 0, 0, {sigma}, {sigma}, {sigma}]\n"
    )
    robot = read_robot(hexapod(tmp_path))
    sources = read_sources(errors, robot)
    assert sources.labels[:4] == (
        "leg1.ball.TX", "leg1.ball.TY", "leg1.ball.TZ", "leg2.ball.TX",
    )  # fmt: skip
    response = linear_response(home_posture(robot))
    n = len(robot.frames)
    slopes = sources.of_numbers(response.screws[:, -6 * n :].reshape(6, n, 6))
    J = np.linalg.inv(legs().T)  # platform screw per unit of each leg length
    np.testing.assert_allclose(
        sigma**2 * slopes @ slopes.T, sigma**2 * J @ J.T, rtol=0, atol=1e-18
    )


ONE = """format = 2
platform = "table"
platform_at = [0.1, 0, 0.5]
[[body]]
name = "table"
[[joint]]
name = "j"
type = "{kind}"
between = ["base", "table"]
at = [0.2, 0.1, 0]
axis = [0.2, 0.1, 1]
axis2 = [1, 0.3, 0.2]
{more}
"""
KINDS = ("spherical", "universal", "cylindrical", "planar")


def one_joint(tmp_path, kind, more=""):
    file = tmp_path / "one.toml"
    file.write_text(ONE.format(kind=kind, more=more))
    return file


@pytest.mark.parametrize("kind", KINDS)
def test_error_and_tolerance_of_a_joint_equal_values_in_the_file(tmp_path, kind):
    """The values are in the axes of the joint."""
    error = [1e-5, -2e-5, 3e-5, 4e-6, -5e-6, 6e-6]
    keys = f"geometric_error = {error}\ntolerance = {[abs(x) for x in error]}"
    declared = read_robot(one_joint(tmp_path, kind, keys))
    robot = read_robot(one_joint(tmp_path, kind))
    errors = tmp_path / "errors.toml"
    errors.write_text(
        f'[[errors]]\nframes = ["j"]\ndistribution = "normal"\ncentre = {error}\n'
        "deviation = [0, 0, 0, 0, 0, 0]\n"
    )
    sources = read_sources(errors, robot)
    np.testing.assert_array_equal(sources.errors(sources.centre), declared.errors)
    if kind != "universal":
        assert set(sources.labels) == {f"j.{component}" for component in SCREW}
    sources = tolerance_sources(robot, np.abs(error), ("j",))
    expected = [np.zeros(6) if f.tolerance is None else f.tolerance
                for f in declared.frames]  # fmt: skip
    np.testing.assert_array_equal(sources.errors(sources.scale), expected)


@pytest.mark.parametrize(("kind", "key", "more"), [
    ("spherical", "clearance.ball", "clearance = {{ ball = {} }}"),
    ("universal", "clearance.axial", "clearance = {{ radial = 1e-5, axial = {} }}"),
    ("cylindrical", "clearance.tilt", "clearance = {{ radial = 1e-5, tilt = {} }}"),
    ("planar", "geometric_error.rx", "geometric_error = [{}, 0, 0, 0, 0, 1e-5]"),
])  # fmt: skip
def test_changed_joint_value_acts_like_a_changed_file(tmp_path, kind, key, more):
    other = read_robot(one_joint(tmp_path, kind, more.format(3e-5)))
    design = load_design(one_joint(tmp_path, kind, more.format(1e-5)))
    changed = design.robot({f"j.{key}": 3e-5})
    assert changed.frames == other.frames


def test_compliance_report_contains_the_name_of_a_ball_joint(tmp_path):
    """The contributions of springs and drives to the compliance sum to one."""
    K = "joint_stiffness = [[0,0,0,0,0,0],[0,0,0,0,0,0],[0,0,0,0,0,0],"
    K += "[0,0,0,1e6,0,0],[0,0,0,0,1e6,0],[0,0,0,0,0,1e6]]"
    robot = read_robot(hexapod(tmp_path, K))
    platform = platform_stiffness(home_posture(robot))
    joints = stiffness_values(platform, AT)["shares"]["tz"]["joints"]
    assert sorted(joints) == sorted(
        f"leg{k}.{name}" for k in range(1, 7) for name in ("ball", "drive")
    )
    # Both springs of a leg have the same axial stiffness.
    assert sum(joints[f"leg{k}.ball"] for k in range(1, 7)) == pytest.approx(0.5)


def test_message_about_an_unknown_joint_suggests_a_name(tmp_path):
    file = hexapod(tmp_path)
    poses = tmp_path / "poses.csv"
    poses.write_text("pose.tz\n1.1\n")
    with pytest.raises(BadInput, match=r'no frame "leg1.bal"; did you mean'):
        sweep(file, poses=poses, assumption="none", wrench_of=["leg1.bal"])
    robot = read_robot(file)
    with pytest.raises(BadInput, match=r"a joint of leg1.ball.first, leg1.ball.second"):
        robot.index("leg1.ball")


def test_frames_at_different_points_do_not_form_a_joint(tmp_path):
    """Two hinges of a leg have the frame names of a joint."""
    file = tmp_path / "arm.toml"
    file.write_text(
        'name = "arm"\nplatform = "tip"\n'
        '[[frame]]\nname = "leg.first"\nparent = "base"\n'
        'joint = "revolute"\n[[frame]]\nname = "leg.second"\nparent = "leg.first"\n'
        'joint = "revolute"\ntranslation = [0.1, 0, 0]\n'
        '[[frame]]\nname = "tip"\nparent = "leg.second"\n'
    )
    assert read_robot(file).joints == {}


BORE = "clearance = { radial = 1e-5, length = 0.04, axial = 1e-5 }"


@pytest.mark.parametrize(("kind", "loose"), [
    ("universal", []), ("revolute", []), ("cylindrical", []), ("fixed", ['"j"']),
])  # fmt: skip
def test_fixed_joints_are_reported_as_loose(tmp_path, kind, loose):
    """The frames of a bore are not reported as joints."""
    key = BORE if kind != "cylindrical" else BORE.replace(", axial = 1e-5", "")
    robot = read_robot(one_joint(tmp_path, kind, key))
    (text,) = loose_over_poses(robot) or [""]
    assert [name for name in ('"j"', "bore") if name in text] == loose


def plan_of(tmp_path, text):
    file = tmp_path / "plan.toml"
    file.write_text(text)
    return read_steps(file, read_robot(hexapod(tmp_path)))


def test_assembly_plan_accepts_names_of_joints(tmp_path):
    """The plan contains the names of a closure and of a frame."""
    plan = plan_of(
        tmp_path,
        '[[step]]\njoin = ["plate", "leg2.ball"]\n'
        '[[step]]\nmeasure = "leg1.ball"\ncomponents = ["tz"]\n',
    )
    assert [step.part for step in plan.steps] == [
        ("leg2.ball.end", "plate"), "leg1.ball.first",
    ]  # fmt: skip
    with pytest.raises(BadInput, match="expected one of its frames leg1.ball.first, "):
        plan_of(tmp_path, '[[step]]\njoin = "leg1.ball"\n')
