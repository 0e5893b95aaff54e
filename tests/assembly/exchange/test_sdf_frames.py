"""Frames, nested models, old versions and default masses in SDF files."""

import numpy as np
import pytest

from forcefit.assembly.exchange.mechanism import WORLD, body_poses
from forcefit.assembly.exchange.sdf import read_sdf

ARM = """<link name="base"/><joint name="fix" type="fixed"><parent>world</parent>
<child>base</child></joint>"""


def model(folder, text, version="1.9", attributes=""):
    path = folder / "robot.sdf"
    path.write_text(
        f'<sdf version="{version}"><model name="m" {attributes}>{text}</model></sdf>'
    )
    return read_sdf(path)


def joint(name, parent, child, inside="", kind="revolute"):
    return f"""<joint name="{name}" type="{kind}"><parent>{parent}</parent>
        <child>{child}</child>{inside}</joint>"""


def axis_in_world(mechanism, name):
    """Return the direction of a joint axis in world axes in the home pose."""
    one = next(joint for joint in mechanism.joints if joint.name == name)
    poses = body_poses(mechanism, mechanism.home)
    return (poses[one.parent] @ one.placement)[:3, :3] @ one.axis


TILTED = '<link name="arm"><pose>0.3 0 0 0 1.5707963267948966 0</pose></link>'
Z_UP = "<axis><xyz>0 0 1</xyz>{}</axis>"


@pytest.mark.parametrize(
    ("version", "inside", "expected"),
    [
        # the link is rotated by 90 degrees about y, which maps z to x
        ("1.4", Z_UP.format(""), [0, 0, 1]),
        ("1.4", Z_UP.format(
            "<use_parent_model_frame>0</use_parent_model_frame>"), [1, 0, 0]),
        ("1.5", Z_UP.format(""), [1, 0, 0]),
        ("1.6", Z_UP.format(
            "<use_parent_model_frame>true</use_parent_model_frame>"), [0, 0, 1]),
        ("1.9", '<axis><xyz expressed_in="__model__">0 0 1</xyz></axis>', [0, 0, 1]),
        ("1.9", '<axis><xyz expressed_in="">0 0 1</xyz></axis>', [1, 0, 0]),
        # versions 1.10 and 1.12 are later than 1.4
        ("1.10", Z_UP.format(""), [1, 0, 0]),
        ("1.12", Z_UP.format(""), [1, 0, 0]),
    ],
)  # fmt: skip
def test_frame_of_a_joint_axis_depends_on_sdf_version(
    version, inside, expected, tmp_path
):
    text = ARM + TILTED + joint("turn", "base", "arm", inside)
    found = axis_in_world(model(tmp_path, text, version), "turn")
    assert found == pytest.approx(expected, abs=1e-15)


def test_poses_in_nested_sdf_models_equal_hand_calculation(tmp_path):
    """The outer model is at (1, 2, 3), rotated by 90 degrees about z.

    The nested model is placed by its frame "grip", which is 0.5 m above its origin, at
    a frame 1 m from the origin of the outer model.
    """
    text = """<pose degrees="true">1 2 3 0 0 90</pose>
        <frame name="shelf"><pose>1 0 0 0 0 0</pose></frame><link name="base"/>
        <model name="hand" placement_frame="grip"><pose relative_to="shelf"/>
        <frame name="grip"><pose>0 0 0.5 0 0 0</pose></frame>
        <link name="palm"><pose relative_to="">0.2 0 0 0 0 0</pose></link>
        <link name="tip"><pose relative_to="grip"/></link>
        <joint name="finger" type="prismatic"><parent>palm</parent><child>tip</child>
        <axis><xyz expressed_in="__model__">1 0 0</xyz></axis></joint></model>"""
    text += joint("wrist", "shelf", "hand::grip", Z_UP.format(""))
    mechanism = model(tmp_path, text)
    poses = body_poses(mechanism, mechanism.home)
    assert poses["base"][:3, 3] == pytest.approx([1, 2, 3])
    # "grip" coincides with "shelf" at (1, 2, 3) + (0, 1, 0)
    assert poses["hand::tip"][:3, 3] == pytest.approx([1, 3, 3])
    assert poses["hand::palm"][:3, 3] == pytest.approx([1, 3.2, 2.5])
    assert axis_in_world(mechanism, "hand::finger") == pytest.approx([0, 1, 0])
    wrist = next(one for one in mechanism.joints if one.name == "wrist")
    # "shelf" is attached to "base", "grip" to the first link of the hand
    assert (wrist.parent, wrist.child) == ("base", "hand::palm")
    assert mechanism.root == WORLD


def test_included_model_is_read_according_to_its_sdf_version(tmp_path):
    """In version 1.4 of the included model, the joint axis is in the model frame.

    The included model is rotated by 90 degrees about x.
    """
    hand = (
        f"""<link name="palm"/>{TILTED}{joint("j", "palm", "arm", Z_UP.format(""))}"""
    )
    folder = tmp_path / "hand"
    folder.mkdir()
    (folder / "model.sdf").write_text(
        f'<sdf version="1.4"><model name="any"><pose>9 9 9 0 0 0</pose>{hand}'
        "</model></sdf>"
    )
    pose = '<pose degrees="true">0 0 1 90 0 0</pose>'
    text = f"""{ARM}<include><uri>model://hand</uri><name>grip</name>{pose}</include>
        {joint("w", "base", "grip::palm", "", "fixed")}"""
    mechanism = model(tmp_path, text)
    assert axis_in_world(mechanism, "grip::j") == pytest.approx([0, -1, 0])
    poses = body_poses(mechanism, mechanism.home)
    assert poses["grip::arm"][:3, 3] == pytest.approx([0.3, 0, 1])


def test_model_pose_relative_to_a_world_frame_is_correct(tmp_path):
    path = tmp_path / "robot.sdf"
    path.write_text(
        f"""<sdf version="1.9"><world name="w"><frame name="table">
        <pose>0 0 0.7 0 0 0</pose></frame><frame name="spot" attached_to="table">
        <pose>1 0 0 0 0 0</pose></frame><model name="m"><pose relative_to="spot"/>
        <link name="base"/><link name="arm"/>{joint("j", "base", "arm")}</model>
        <joint name="bolt" type="fixed"><parent>world</parent><child>m::base</child>
        </joint></world></sdf>"""
    )
    mechanism = read_sdf(path)
    poses = body_poses(mechanism, mechanism.home)
    assert poses["arm"][:3, 3] == pytest.approx([1, 0, 0.7])


def test_import_reports_omitted_static_models(tmp_path):
    path = tmp_path / "robot.sdf"
    ground = '<model name="ground"><static>true</static><link name="plane"/></model>'
    arm = joint("j", "base", "arm")
    path.write_text(
        f"""<sdf version="1.9"><world name="w">{ground}<model name="m">
        <link name="base"/><link name="arm"/>{arm}</model></world></sdf>"""
    )
    mechanism = read_sdf(path)
    assert set(mechanism.bodies) == {"base", "arm"}
    assert "model of the world: 1 (ground)" in mechanism.left_out


def test_joint_with_the_name_of_a_link_is_renamed(tmp_path):
    mechanism = model(
        tmp_path, joint("arm", "base", "arm") + ARM + '<link name="arm"/>'
    )
    assert {one.name for one in mechanism.joints} == {"fix", "arm_joint"}


SHAPES = {
    "<box><size>0.4 0.05 0.02</size></box>": 4e-4,
    "<sphere><radius>0.1</radius></sphere>": 4 / 3 * np.pi * 1e-3,
    "<cylinder><radius>0.1</radius><length>0.3</length></cylinder>": np.pi * 3e-3,
    "<capsule><radius>0.1</radius><length>0.3</length></capsule>": np.pi * 13e-3 / 3,
    "<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>": np.pi * 8e-3,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_sdf_automatic_mass_equals_volume_times_density(shape, tmp_path):
    """The link consists of a steel shape, or of this shape and a lighter sphere."""
    collision = """<collision name="c"><pose>0.2 0 0 0 0 0</pose>{}<geometry>{}
        </geometry></collision>"""
    steel = collision.format("<density>7850</density>", shape)
    text = ARM + f'<link name="arm"><inertial auto="true"/>{steel}</link>'
    text += f"""<link name="two"><inertial auto="1"><density>7850</density></inertial>
        {collision.format("", shape)}<collision name="d"><density>1000</density>
        <geometry><sphere><radius>0.2</radius></sphere></geometry></collision></link>"""
    text += joint("j", "base", "arm") + joint("k", "base", "two")
    bodies = model(tmp_path, text).bodies
    mass = 7850 * SHAPES[shape]
    ball = 1000 * 4 / 3 * np.pi * 8e-3
    assert bodies["arm"].mass == pytest.approx(mass, rel=1e-12)
    assert bodies["arm"].centre == pytest.approx([0.2, 0, 0])
    assert bodies["two"].mass == pytest.approx(mass + ball, rel=1e-12)
    assert bodies["two"].centre[0] == pytest.approx(0.2 * mass / (mass + ball))


def test_sdf_links_without_mass_have_default_mass(tmp_path):
    """The default mass is 1 kg; with ``auto``, an explicit mass is preserved."""
    text = (
        ARM
        + """<link name="a"><inertial><pose>0 0 1 0 0 0</pose></inertial></link>
        <link name="b"><inertial auto="true"><mass>5</mass></inertial><collision
        name="c"><pose>0 0 2 0 0 0</pose><geometry><sphere><radius>1</radius></sphere>
        </geometry></collision></link>"""
    )
    text += joint("j", "base", "a") + joint("k", "base", "b")
    mechanism = model(tmp_path, text)
    bodies = mechanism.bodies
    assert [bodies[name].mass for name in ("base", "a", "b")] == [1, 1, 5]
    assert [bodies[name].centre[2] for name in ("base", "a", "b")] == [0, 1, 2]
    assert any("no inertial: 1 kg" in line for line in mechanism.taken)


def test_sdf_mimic_joint_follows_second_axis_of_universal_joint(tmp_path):
    """The coordinate is k = 2 (j - 0.1) + 0.5 = 0.3, where j = 0 is the second axis."""
    mimic = """<mimic joint="{}" axis="{}"><multiplier>2</multiplier><offset>0.5
        </offset><reference>0.1</reference></mimic>"""
    text = ARM + '<link name="a"/><link name="b"/><link name="c"/>'
    text += joint("k", "a", "b", Z_UP.format(mimic.format("u", "axis2")))
    text += joint("u", "base", "a", Z_UP.format("") + "<axis2><xyz>1 0 0</xyz></axis2>",
                  "universal")  # fmt: skip
    text += joint("l", "b", "c", Z_UP.format(mimic.format("k", "axis")))
    mechanism = model(tmp_path, text)
    home = {one.name: one.position for one in mechanism.joints}
    assert (home["k"], home["l"]) == pytest.approx((0.3, 0.9))
