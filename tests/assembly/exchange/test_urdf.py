"""Import of URDF files with XML variants, loops and mimic joints."""

import json

import numpy as np
import pytest

from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.exchange.mechanism import body_poses
from forcefit.assembly.exchange.urdf import read_urdf
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.inputs.errors import BadInput
from forcefit.stiffness.screws import rotation_matrix


def joint(name, parent, child, inside="", kind="continuous", tag="joint"):
    return f"""<{tag} name="{name}" type="{kind}"><parent link="{parent}"/>
        <child link="{child}"/>{inside}</{tag}>"""


def file_of(folder, text, links="", attributes=""):
    """Write a URDF with links that are named by single letters."""
    path = folder / "robot.urdf"
    given = "".join(f'<link name="{name}"/>' for name in links)
    path.write_text(f'<robot name="r" {attributes}>{given}{text}</robot>')
    return path


Z = '<axis xyz="0 0 1"/>'


@pytest.mark.parametrize(("before", "attributes", "inside"), [
    ('\n\n<?xml version="1.0"?>\n', "", ""),
    ('<!-- of -- mine --><?xml version="1.0"?>', "", "<!-- a -- b --- -->"),
    ("", 'xmlns="http://drake.mit.edu" xmlns:x="a" x:schemaLocation="b c"', ""),
    ("", "", "<gazebo><lost:thing lost:key='1'/></gazebo>"),
    ("\ufeff", 'xmlns="urn:other"', ""),
])  # fmt: skip
def test_urdf_variants_that_other_readers_accept_are_read(
    before, attributes, inside, tmp_path
):
    path = file_of(tmp_path, joint("j", "a", "b", Z) + inside, "ab", attributes)
    path.write_text(before + path.read_text())
    assert [one.name for one in read_urdf(path).joints] == ["j"]


@pytest.mark.parametrize(
    ("declared", "encoding"),
    [("UTF-16", "utf-16"), ("ISO-8859-1", "latin-1"), ("windows-1252", "cp1252")],
)
def test_urdf_is_read_in_its_declared_encoding(declared, encoding, tmp_path):
    path = file_of(tmp_path, joint("Gelenk_für_a", "a", "b", Z), "ab")
    text = f"<?xml version='1.0' encoding='{declared}'?>\r\n{path.read_text()}"
    path.write_bytes(text.encode(encoding))
    assert [one.name for one in read_urdf(path).joints] == ["Gelenk_für_a"]


def test_urdf_with_undeclared_encoding_is_rejected(tmp_path):
    path = file_of(tmp_path, joint("Gelenk_für_a", "a", "b", Z), "ab")
    path.write_bytes(path.read_text().encode("latin-1"))
    with pytest.raises(BadInput, match="is not UTF-8; expected a text file in UTF-8"):
        read_urdf(path)


def test_import_reports_joint_range_with_reversed_limits(tmp_path):
    limit = '<limit lower="1" upper="-1"/>'
    path = file_of(tmp_path, joint("j", "a", "b", Z + limit, "revolute"), "ab")
    mechanism = read_urdf(path)
    assert mechanism.joints[0].limits is None
    assert "joint range, lower above upper: 1 (j)" in mechanism.left_out


@pytest.mark.parametrize("name", ["base", "base.joint", "b", "world"])
def test_joint_named_base_is_renamed(name, tmp_path):
    """The name "base" is reserved for the fixed frame."""
    text = joint("base", "a", "b", '<origin xyz="0 0 0.1"/>' + Z)
    text += joint("base.joint", "b", "c", '<origin xyz="0 0 0.2"/>' + Z)
    text = text.replace('name="base.joint"', f'name="{name}.x"')
    path = file_of(tmp_path, text, "abc")
    (tmp_path / "robot.yaml").write_text("closed_loop: []\nname_mot: [base]\n")
    answer = convert(path, tmp_path / "out.toml")
    robot = read_robot(tmp_path / "out.toml")
    (drive,) = [frame.name for frame in robot.frames if frame.actuated]
    assert drive == "base.joint"
    assert any('"base" becomes frame "base.joint"' in line for line in answer.taken)
    end = place_robot(robot).transforms[robot.index("c")]
    assert end[:3, 3] == pytest.approx([0, 0, 0.3])


def four_bar(closing, folder):
    """Write a parallelogram with cranks of 0.2 m and a coupler of 0.4 m."""
    text = joint("p", "a", "b", Z) + joint("r", "a", "d", f'<origin xyz="0.4 0 0"/>{Z}')
    text += joint("q", "b", "c", f'<origin xyz="0 0.2 0"/>{Z}')
    return file_of(folder, text + closing, "abcd")


LINKS = '<link1 link="c" xyz="0.4 0 0"/><link2 link="d" xyz="0 0.2 0" rpy="0 0 0"/>'
CLOSING = {
    # the number of redundant constraints by Gruebler's formula is
    # 1 - (18 - 3 * 5) + number of constraints of the joint
    "spherical": (f'<loop_joint name="l" type="spherical">{LINKS}</loop_joint>', 1),
    "ball": (f'<drake:loop_joint name="l" type="ball">{LINKS}</drake:loop_joint>', 1),
    "continuous": (
        f'<loop_joint name="l" type="continuous">{LINKS}{Z}</loop_joint>', 3,
    ),
    "gazebo": (
        '<gazebo><joint name="l" type="revolute"><pose>0 0.2 0 0 0 0</pose>'
        "<parent>c</parent><child>d</child><axis><xyz>0 0 1</xyz></axis></joint>"
        "</gazebo>", 3,
    ),
    "gazebo universal": (
        '<gazebo><joint name="l" type="universal"><pose>0 0.2 0 0 0 0</pose>'
        "<parent>c</parent><child>d</child><axis><xyz>0 0 1</xyz></axis>"
        "<axis2><xyz>1 0 0</xyz></axis2></joint></gazebo>", 2,
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", CLOSING)
def test_parallelogram_with_a_urdf_loop_has_one_degree_of_freedom(kind, run, tmp_path):
    """The coupler of the parallelogram translates without rotation."""
    closing, redundant = CLOSING[kind]
    path = four_bar(closing, tmp_path)
    (tmp_path / "robot.yaml").write_text("closed_loop: []\nname_mot: [p]\n")
    answer = convert(path, tmp_path / "out.toml")
    assert answer.robot.platform == "c"  # not a body of the closing joint
    assert answer.open_before < 1e-12
    status, _, _ = run("assembly", "solve", tmp_path / "out.toml",
                       "--json", tmp_path / "o.json")  # fmt: skip
    assert status == 0
    mobility = json.loads((tmp_path / "o.json").read_text())["mobility"]
    assert (mobility["freedoms"], mobility["overconstraint"]) == (1, redundant)
    robot = read_robot(tmp_path / "out.toml")
    coupler = place_robot(robot, joints={"p": 0.5}).transforms[robot.index("c")]
    assert coupler[:3, :3] == pytest.approx(np.eye(3), abs=1e-9)
    crank = [-0.2 * np.sin(0.5), 0.2 * np.cos(0.5), 0]
    assert coupler[:3, 3] == pytest.approx(crank, abs=1e-9)


@pytest.mark.parametrize(("flag", "expected"), [
    ("", [1, 0, 0]),
    ("<use_parent_model_frame>1</use_parent_model_frame>", [0, 0, 1]),
])  # fmt: skip
def test_gazebo_joint_axis_is_in_child_or_model_frame(flag, expected, tmp_path):
    """The child is rotated by 90 degrees about y, which maps its z axis to x."""
    turned = f'<origin xyz="0 0 1" rpy="0 {np.pi / 2} 0"/>'
    text = joint("j", "a", "b", turned + Z) + joint("k", "a", "c", Z)
    text += f"""<gazebo><joint name="l" type="revolute"><parent>c</parent>
        <child>b</child><axis><xyz>0 0 1</xyz>{flag}</axis></joint></gazebo>"""
    mechanism = read_urdf(file_of(tmp_path, text, "abc"))
    closing = mechanism.joints[-1]
    poses = body_poses(mechanism, np.zeros(len(mechanism.joints)))
    found = (poses[closing.parent] @ closing.placement)[:3, :3] @ closing.axis
    assert found == pytest.approx(expected, abs=1e-12)
    assert mechanism.loops[0].second == "b"


def test_axes_of_drake_joints_are_correct(tmp_path):
    """The axes of a universal joint are x and y; a planar joint moves along x and y."""
    text = joint("u", "a", "b", "", "universal", "drake:joint")
    text += joint("s", "b", "c", "", "planar", "d:joint")
    text += joint("w", "c", "d", "", "ball", "drake:joint")
    mechanism = read_urdf(file_of(tmp_path, text, "abcd"))
    axes = {one.name: one.axis.tolist() for one in mechanism.joints}
    x, y, z = np.eye(3).tolist()
    assert axes == {"u.first": x, "u.second": y, "s.tx": x, "s.ty": y, "s.rz": z,
                    "w.rx": x, "w.ry": y, "w.rz": z}  # fmt: skip


def test_urdf_quaternion_has_order_xyzw(tmp_path):
    """The rotation is 90 degrees about z."""
    h = np.sqrt(0.5)
    text = joint("j", "a", "b", f'<origin xyz="1 0 0" quat_xyzw="0 0 {h} {h}"/>')
    mechanism = read_urdf(file_of(tmp_path, text, "ab"))
    turned = body_poses(mechanism, mechanism.home)["b"][:3, :3] @ [1, 0, 0]
    assert turned == pytest.approx([0, 1, 0])


def follower(name, parent, child, leader, factor, offset):
    inside = f'{Z}<mimic joint="{leader}" multiplier="{factor}" offset="{offset}"/>'
    return joint(name, parent, child, inside)


def test_chained_mimic_joints_satisfy_their_equations_at_home(tmp_path):
    """The couplings are z = 2 y + 0.1 and y = x + 0.5, with x = 0.3 at home."""
    text = follower("z", "c", "d", "y", 2, 0.1) + follower("y", "b", "c", "x", 1, 0.5)
    path = file_of(tmp_path, text + joint("x", "a", "b", Z), "abcd")
    (tmp_path / "robot.yaml").write_text("closed_loop: []\nhome: {x: 0.3}\n")
    convert(path, tmp_path / "out.toml")
    robot = read_robot(tmp_path / "out.toml")
    home = [robot.frame(name).position for name in "xyz"]
    assert home == pytest.approx([0.3, 0.8, 1.7])
    (tmp_path / "robot.yaml").write_text("closed_loop: []\nhome: {y: 0.3}\n")
    with pytest.raises(
        BadInput, match=r"home.y: found 0.3, but the joint follows .* 0.5, or"
    ):
        convert(path, tmp_path / "out.toml")


def test_computed_home_pose_satisfies_mimic_equation(tmp_path):
    """A crank at angle q and a follower at angle pi - q, both 1 m long, are 1 m apart.

    Their tips (cos q, sin q) and (1 - cos q, sin q) coincide at q = 60 degrees.
    """
    text = joint("x", "a", "b", Z) + follower("y", "a", "c", "x", -1, np.pi)
    text = text.replace('<child link="c"/>', '<child link="c"/><origin xyz="1 0 0"/>')
    text += "".join(
        joint(f"{one}tip", one, f"{one}"[0] + "t", '<origin xyz="1 0 0"/>', "fixed")
        for one in "bc"
    )
    links = "".join(f'<link name="{name}"/>' for name in ("bt", "ct"))
    path = file_of(tmp_path, links + text, "abc")
    (tmp_path / "robot.yaml").write_text(
        "closed_loop: [[bt, ct]]\ntype: [3d]\nname_mot: [x]\nhome: {x: 0.9}\n"
    )
    answer = convert(path, tmp_path / "out.toml")
    assert not answer.drives_held
    robot = read_robot(tmp_path / "out.toml")
    x, y = (robot.frame(name).position for name in "xy")
    assert x == pytest.approx(np.pi / 3, abs=1e-9)
    assert y == pytest.approx(np.pi - np.pi / 3, abs=1e-9)


@pytest.mark.parametrize("axes", ["XY", "YX", "YZ", "ZY", "ZX", "XZ"])
def test_universal_joint_becomes_two_revolute_joints(axes, tmp_path):
    path = file_of(tmp_path, joint("j", "a", "b", Z), "ab")
    (tmp_path / "robot.yaml").write_text(
        f"closed_loop: []\njoint_name: [j]\njoint_type: [UJOINT_{axes}]\n"
    )
    convert(path, tmp_path / "out.toml")
    robot = read_robot(tmp_path / "out.toml")
    turns = [frame.name for frame in robot.frames if frame.joint == "revolute"]
    assert turns == [f"j.r{axis.lower()}" for axis in axes]
    # the first rotation moves the axis of the second
    turned = place_robot(robot, joints={turns[0]: 0.5, turns[1]: 0.8})
    first, second = (np.eye(3)["XYZ".index(axis)] for axis in axes)
    expected = rotation_matrix(0.5 * first) @ rotation_matrix(0.8 * second)
    found = turned.transforms[robot.index("b")][:3, :3]
    assert found == pytest.approx(expected, abs=1e-12)


def test_import_reports_gazebo_plugins_and_springs(tmp_path):
    text = joint("j", "a", "b", Z) + joint("k", "b", "c", Z)
    text += """<gazebo><plugin name="p"><joint>j</joint><mimicJoint>k</mimicJoint>
        </plugin><plugin name="q"><joint>j</joint></plugin></gazebo>
        <gazebo reference="k"><springStiffness>5</springStiffness></gazebo>"""
    text += '<closure type="gear"><first joint="j"/><second joint="k"/></closure>'
    left_out = read_urdf(file_of(tmp_path, text, "abc")).left_out
    may = "not converted, though it may connect or move the bodies that it names"
    tie = f"closure, {may}: 1"
    assert tie in left_out
    tie = f"plugin, {may}: 1 (p)"
    assert tie in left_out
    assert "springStiffness, not converted, though it may carry load: 1 (k)" in left_out
