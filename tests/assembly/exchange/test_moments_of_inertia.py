"""Moments of inertia in URDF, SDF and MJCF, compared with MuJoCo and textbooks."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.exchange.sdf import read_sdf
from forcefit.assembly.exchange.urdf import read_urdf
from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.platform_stiffness.vibration import natural_modes
from forcefit.stiffness.screws import rotation_matrix

URDF = """<robot name="r"><link name="a"/><link name="b"><inertial>
<origin xyz="0.1 0.2 0.3" rpy="0.3 -0.4 1.2"/><mass value="2"/>
<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="-0.002" iyz="0.003"/>
</inertial></link><joint name="j" type="continuous"><parent link="a"/>
<child link="b"/><axis xyz="0 0 1"/></joint></robot>"""
J = np.array([[0.02, 0.001, -0.002], [0.001, 0.03, 0.003], [-0.002, 0.003, 0.04]])


def turned(roll, pitch, yaw):
    """Return the rotation about fixed x, then y, then z, (3, 3)."""
    x, y, z = np.eye(3)
    return (
        rotation_matrix(yaw * z)
        @ rotation_matrix(pitch * y)
        @ rotation_matrix(roll * x)
    )


def file_of(folder, text, name):
    path = folder / name
    path.write_text(text)
    return path


def test_urdf_inertia_is_in_axes_of_its_origin_element(tmp_path):
    """The inertia matrix in link axes is R J R^T."""
    R = turned(0.3, -0.4, 1.2)
    path = file_of(tmp_path, URDF, "r.urdf")
    np.testing.assert_allclose(read_urdf(path).bodies["b"].inertia, R @ J @ R.T)
    answer = convert(path, tmp_path / "r.toml")
    assert not any("moments" in line for line in answer.left_out)
    frame = read_robot(tmp_path / "r.toml").frame("b")
    assert frame.mass == 2.0
    np.testing.assert_allclose(frame.inertia, R @ J @ R.T, atol=1e-16)


def test_sdf_inertia_is_in_axes_of_its_pose_element(tmp_path):
    inertia = "".join(
        f"<{key}>{value}</{key}>"
        for key, value in (("ixx", 0.02), ("iyy", 0.03), ("izz", 0.04),
                           ("ixy", 0.001), ("ixz", -0.002), ("iyz", 0.003))
    )  # fmt: skip
    text = f"""<sdf version="1.9"><model name="m"><link name="a"><inertial>
        <pose>0 0 0 0.3 -0.4 1.2</pose><mass>2</mass><inertia>{inertia}</inertia>
        </inertial></link><link name="b"/><link name="c"><inertial><mass>2</mass>
        </inertial></link><joint name="j" type="revolute"><parent>a</parent>
        <child>b</child><axis><xyz>0 0 1</xyz></axis></joint><joint name="k"
        type="revolute"><parent>a</parent><child>c</child><axis><xyz>0 0 1</xyz></axis>
        </joint><joint name="w" type="fixed"><parent>world</parent><child>a</child>
        </joint></model></sdf>"""
    mechanism = read_sdf(file_of(tmp_path, text, "r.sdf"))
    R = turned(0.3, -0.4, 1.2)
    np.testing.assert_allclose(mechanism.bodies["a"].inertia, R @ J @ R.T)
    for name in "bc":
        np.testing.assert_array_equal(mechanism.bodies[name].inertia, np.eye(3))
    taken = " ".join(mechanism.taken)
    assert "no inertial: 1 kg and 1 kg m^2, the format's defaults: 1 (b)" in taken
    assert "no moments of inertia: 1 kg m^2, the format's default: 1 (c)" in taken


SHAPES = {  # textbook formulas of principal moments for a mass of 1 kg
    "<box><size>0.3 0.2 0.1</size></box>": np.array([0.05, 0.1, 0.13]) / 12,
    "<sphere><radius>0.1</radius></sphere>": np.full(3, 0.4 * 0.01),
    "<cylinder><radius>0.1</radius><length>0.3</length></cylinder>":
        np.array([0.01 / 4 + 0.09 / 12, 0.01 / 4 + 0.09 / 12, 0.01 / 2]),
    "<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>":
        np.array([0.13, 0.10, 0.05]) / 5,
    "<cone><radius>0.1</radius><length>0.4</length></cone>":
        np.array([0.15 * 0.01 + 3 / 80 * 0.16] * 2 + [0.3 * 0.01]),
}  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
def test_sdf_automatic_inertia_of_a_shape_equals_textbook_formula(shape, tmp_path):
    """The mass is 5 kg, and a rotation by 90 degrees about x exchanges y and z."""
    pose = f"<pose>0.2 0 0 {np.pi / 2} 0 0</pose>"
    text = f"""<sdf version="1.12"><model name="m"><link name="a"><inertial auto="true">
        <mass>5</mass></inertial><collision name="c">{pose}
        <geometry>{shape}</geometry></collision></link><link name="b"/>
        <joint name="j" type="revolute"><parent>a</parent><child>b</child>
        <axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""
    body = read_sdf(file_of(tmp_path, text, "r.sdf")).bodies["a"]
    expected = 5 * np.diag(SHAPES[shape][[0, 2, 1]])
    np.testing.assert_allclose(body.inertia, expected, atol=1e-15)


def test_impossible_moments_of_inertia_are_omitted_and_reported(tmp_path):
    text = URDF.replace('izz="0.04"', 'izz="0.4"')
    answer = convert(file_of(tmp_path, text, "r.urdf"), tmp_path / "r.toml")
    assert "physically impossible moments of inertia: 1 (b)" in answer.left_out
    frame = read_robot(tmp_path / "r.toml").frame("b")
    assert (frame.mass, frame.inertia.any()) == (2.0, False)


SPRINGS = """<mujoco><compiler angle="radian"/><worldbody>
<body name="e"><joint name="drive"/><geom size="0.1"/></body>
<body name="a" pos="0.1 0 0.2" euler="0.4 0.2 -0.3"><joint name="j" axis="1 2 3"
stiffness="300"/><inertial pos="0.1 0.05 0" mass="2" diaginertia="0.02 0.03 0.04"
euler="0.3 0.2 0.1"/>
<body name="b" pos="0.3 0.1 0" quat="1 0.2 0.3 0"><joint name="k" axis="0 1 0"
stiffness="200"/><inertial pos="0 0.1 0.1" mass="1.5"
fullinertia="0.02 0.03 0.04 0.001 -0.002 0.003"/>
<body name="c" pos="0 0.2 0.1"><joint name="s" type="slide" axis="0 1 1"
stiffness="5000"/><geom type="capsule" fromto="0 0 0 0.2 0.1 0" size="0.03"/>
<geom type="box" pos="0.1 0 0.1" euler="0.2 0.5 0" size="0.05 0.02 0.03"/>
<body name="d" pos="0.1 0 0"><joint name="l" axis="1 0 0" stiffness="20"/>
<geom type="cylinder" size="0.05 0.1" shellinertia="true" mass="0.3"/></body>
</body></body></body></worldbody><actuator><position joint="drive"/></actuator>
</mujoco>"""


def test_frequencies_of_imported_chain_agree_with_mujoco_mass_matrix(tmp_path):
    """The frequencies follow from MuJoCo's mass matrix and the joint springs."""
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    path = file_of(tmp_path, SPRINGS, "r.xml")
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    for row, unit in zip(M, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    K = np.diag(model.jnt_stiffness[1:])  # without the first joint, which is driven
    squares = np.linalg.eigvals(np.linalg.solve(M[1:, 1:], K))
    expected = np.sort(np.sqrt(squares)) / (2 * np.pi)
    found = natural_modes(home_posture(load_robot(path))).frequencies
    np.testing.assert_allclose(found, expected, rtol=1e-10)


@pytest.mark.parametrize("ending", ["xml", "urdf"])
def test_frequencies_are_equal_after_export_and_import(ending, tmp_path):
    """The natural frequencies of the arm are equal before and after the export."""
    robot, rng = load_robot("arm6"), np.random.default_rng(5)
    frames = []
    for f in robot.frames:
        arm = rng.normal(size=3)
        moments = (arm @ arm + 0.1) * np.eye(3) - np.outer(arm, arm)
        frames.append(replace(f, mass=rng.uniform(1, 3), inertia=moments, link=None,
                              centre_of_mass=rng.normal(size=3)))  # fmt: skip
    stiff = {f.name: np.diag([np.inf] * 2 + [5e4] + [np.inf] * 3)
             for f in frames if f.joint == "revolute"}  # fmt: skip
    frames = tuple(replace(f, joint_stiffness=stiff.get(f.name)) for f in frames)
    robot = replace(robot, frames=frames)
    path = tmp_path / f"r.{ending}"
    robot_file = tmp_path / "arm.toml"
    write_robot(robot, robot_file)
    answer = convert(robot_file, path)
    assert all(told.agrees for told in answer.comparisons)
    back = load_robot(path)
    back = replace(back, frames=tuple(
        replace(f, joint_stiffness=stiff.get(f.name)) for f in back.frames
    ))  # fmt: skip
    ours, theirs = (natural_modes(home_posture(r)).frequencies for r in (robot, back))
    np.testing.assert_allclose(theirs, ours, rtol=1e-8)
