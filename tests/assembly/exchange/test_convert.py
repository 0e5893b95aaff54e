"""Tests of ``forcefit convert`` with example robots and built-in robots."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.load import weights
from forcefit.assembly.robots import BUILT_IN
from forcefit.inputs.errors import BadInput
from tests.examples_for_tests import example

NAMES = ("5bar_linkage", "5bar_linkage_iso3d", "5bar_linkage_iso6d", "cassie_like",
         "digit_like", "disney_like", "robot_delta", "talos_like",
         "wl16_like")  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_conversion_of_example_robots_closes_their_loops(name, tmp_path):
    answer = convert(example(name), tmp_path / "robot.toml")
    assert answer.difference < 1e-12
    assert answer.open_after < 1e-9
    posture = home_posture(read_robot(tmp_path / "robot.toml"))
    assert posture.mismatch < 1e-9


@pytest.mark.slow
def test_conversion_of_kangaroo_with_correct_loop_types_closes_its_loops(tmp_path):
    """The types are those of the later loops file kangaroo_like_2legs."""
    points = [f"closedloop{i}_A" for i in (0, 2, 6, 7, 8, 9, 10, 11)]
    answer = convert(example("kangaroo_like"), tmp_path / "robot.toml", points=points)
    assert answer.taken == ()
    assert answer.open_after < 1e-9
    assert answer.difference < 1e-12


SPATIAL_LOOP = """<robot name="bent"><link name="base"/><link name="a"/><link name="b"/>
<link name="c"/><link name="end"/>
<joint name="one" type="revolute"><parent link="base"/><child link="a"/>
<axis xyz="0 0 1"/></joint>
<joint name="two" type="revolute"><parent link="a"/><child link="b"/>
<origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>
<joint name="three" type="revolute"><parent link="b"/><child link="c"/>
<origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>
<joint name="tip" type="fixed"><parent link="c"/><child link="end"/>
<origin xyz="1 0 0"/></joint>
<link name="goal"/><joint name="ground" type="fixed"><parent link="base"/>
<child link="goal"/><origin xyz="1.5 0 0" rpy="0.1 0 0"/></joint></robot>"""


def bent_loop(folder, types):
    """Write a planar chain with a loop to a tilted frame, which cannot close as 6d."""
    path = folder / "robot.urdf"
    path.write_text(SPATIAL_LOOP)
    loops = f"closed_loop: [[end, goal]]\n{types}name_mot: [one]\n"
    path.with_suffix(".yaml").write_text(loops)
    return path


@pytest.mark.parametrize("types", ["", "type: ['6d']\n"])
def test_loop_of_default_type_is_closed_at_a_point(types, tmp_path):
    path = bent_loop(tmp_path, types)
    answer = convert(path, tmp_path / "robot.toml")
    assert answer.open_after < 1e-9
    assert "loop1" in answer.text()
    assert answer.table()["taken"] == list(answer.taken)
    assert convert(path, tmp_path / "robot.toml", points=["goal"]).taken == ()
    with pytest.raises(BadInput, match="loop1 .* cannot be closed"):
        convert(path, tmp_path / "robot.toml", points=())


def test_points_option_rejects_unknown_loop_names(run, tmp_path):
    path = bent_loop(tmp_path, "type: ['3d']\n")
    target = tmp_path / "robot.toml"
    status, _, error = run("convert", path, "-o", target, "--points", "gaol")
    assert status == 2
    assert "--points: found 'gaol'" in error.replace('"', "'")
    assert "goal" in error
    assert not target.exists()
    status, _, error = run("convert", "arm6", "-o", target, "--points", "all")
    assert status == 2
    assert error.count("\n") == 1
    status, out, _ = run("convert", path, "-o", target, "--points", "none")
    assert status == 0
    assert "taken:" not in out


# file suffix in a quick test run, for robots with a long run time
QUICK = {"hexapod": "urdf", "delta": "xml", "orthoglide": "", "irsbot2": ""}


@pytest.mark.parametrize(
    ("name", "ending"),
    [pytest.param(name, ending, marks=() if QUICK.get(name, ending) == ending
                  else pytest.mark.slow)
     for name in BUILT_IN for ending in ("urdf", "xml")],
)  # fmt: skip
def test_frames_of_built_in_robots_are_equal_after_two_conversions(
    name, ending, tmp_path
):
    """The comparison includes the home posture and other drive coordinates."""
    there, back = tmp_path / f"robot.{ending}", tmp_path / "back.toml"
    assert convert(name, there).difference < 1e-12
    assert convert(there, back).difference < 1e-12
    robot, again = BUILT_IN[name](), read_robot(back)
    assert again.platform == robot.platform
    drives = {f.name: f.position + 0.02 for f in robot.frames if f.actuated}
    assert drives == pytest.approx(
        {f.name: f.position + 0.02 for f in again.frames if f.actuated}, abs=1e-12
    )
    for joints in (None, drives):
        old, new = place_robot(robot, joints=joints), place_robot(again, joints=joints)
        # the platform is compared because rods can rotate about their own axes
        assert new.platform == pytest.approx(old.platform, abs=1e-9)
    rows = [again.index(frame.name) for frame in robot.frames]
    home = home_posture(again).transforms[rows]
    assert home == pytest.approx(home_posture(robot).transforms, abs=1e-12)


def weight_on_the_ground(robot):
    """Return the total weight wrench at the base origin, (6,) [N m, N]."""
    posture = home_posture(robot)
    bodies, carried = weights(posture, [1.0, 2.0, 3.0])
    wrenches = bodies + carried
    arms = np.cross(posture.transforms[:, :3, 3], wrenches[:, 3:])
    return np.concatenate([wrenches[:, :3] + arms, wrenches[:, 3:]], axis=1).sum(axis=0)


@pytest.mark.parametrize("ending", ["urdf", "xml"])
def test_total_weight_is_equal_after_two_conversions(ending, tmp_path):
    """Beams with a density become masses."""
    there, back = tmp_path / f"robot.{ending}", tmp_path / "back.toml"
    convert("arm6", there)
    convert(there, back)
    expected = weight_on_the_ground(BUILT_IN["arm6"]())
    assert np.linalg.norm(expected[3:]) > 10
    found = weight_on_the_ground(read_robot(back))
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-10)


@pytest.mark.parametrize("ending", ["urdf", "xml"])
def test_converted_geometry_includes_geometric_errors(ending, tmp_path):
    """The loop of a four-bar linkage closes with a longer crank and rocker."""
    robot = BUILT_IN["four_bar"]()
    source = tmp_path / "robot.toml"
    errors = np.zeros((len(robot.frames), 6))
    errors[robot.index("end_rocker"), 3] = 1e-3
    longer = {"link_length": {"crank_pin": 2e-3}, "encoder_offset": {"crank": 0.01}}
    write_robot(replace(robot.with_errors(errors), effects=longer), source)
    there, back = tmp_path / f"robot.{ending}", tmp_path / "back.toml"
    convert(source, there)
    convert(there, back)
    posture = home_posture(read_robot(back))
    assert posture.mismatch < 1e-9
    names = [frame.name for frame in posture.robot.frames]
    places = dict(zip(names, posture.transforms[:, :3, 3], strict=True))
    angle = robot.frame("crank").position + 0.01
    crank = [0.102 * np.cos(angle), 0.102 * np.sin(angle), 0]
    assert places["crank_pin"] == pytest.approx(crank, abs=1e-12)
    rocker = places["end_rocker"] - places["rocker"]
    assert np.linalg.norm(rocker) == pytest.approx(0.251, abs=1e-12)
    assert places["end_rocker"] == pytest.approx(places["end_coupler"], abs=1e-9)


def test_conversion_reports_loops_that_rigid_bodies_cannot_close(tmp_path):
    """The loops of the overconstrained IRSBot-2 do not close with a longer link."""
    robot = BUILT_IN["irsbot2"]()
    errors = np.zeros((len(robot.frames), 6))
    errors[robot.index("leg1.link_a")] = [1e-3, 0, 0, 1e-3, 0, 0]
    source = tmp_path / "robot.toml"
    write_robot(robot.with_errors(errors), source)
    answer = convert(source, tmp_path / "robot.urdf")
    assert answer.difference < 1e-12
    assert any("forced assembly" in line for line in answer.left_out)


def test_overlay_adds_platform_clearances_and_links_to_a_urdf(tmp_path):
    overlay = tmp_path / "overlay.toml"
    overlay.write_text(
        'platform = "effector"\n[[frame]]\nname = "free*"\n'
        "clearance = { radial = 1e-5, tilt = 1e-4 }\n"
        '[[frame]]\nname = "free1"\n'
        "link = { beam = { radius = 0.02 }, young = 7e10, poisson = 0.3 }\n"
    )
    convert(example("5bar_linkage"), tmp_path / "robot.toml", overlay=overlay)
    robot = read_robot(tmp_path / "robot.toml")
    assert robot.platform == "effector"
    assert [f.clearance.radial for f in robot.frames if f.clearance] == [1e-5, 1e-5]
    assert robot.frame("free1").link.section == {"radius": 0.02}


@pytest.mark.parametrize(("text", "message"), [
    ('[[frame]]\nname = "fre1"\nmass = 1\n',
     'found "fre1", expected the name of a frame'),
    ('[[frame]]\nname = "free1"\ntranslation = [0, 0, 1]\n', "which cannot place frames"
     ),
    ('[[frame]]\nname = "free1"\nmas = 1\n', 'unknown key "mas"'),
    ("[[link]]\n", 'unknown key "link"'),
    ('platform = "efector"\n', 'did you mean "effector"?'),
])  # fmt: skip
def test_invalid_overlay_is_rejected(run, text, message, tmp_path):
    overlay = tmp_path / "overlay.toml"
    overlay.write_text(text)
    status, out, err = run(
        "convert", example("5bar_linkage"), "-o", tmp_path / "robot.toml",
        "--overlay", overlay,
    )  # fmt: skip
    assert (status, out) == (2, "")
    assert message in err
    assert "overlay.toml" in err
    assert not (tmp_path / "robot.toml").exists()


def test_ball_and_mimic_joints_become_single_joints_and_drives(tmp_path):
    """A ball joint becomes three revolute joints, and a mimic joint becomes a drive."""
    source = tmp_path / "robot.urdf"
    joint = (
        '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>{4}'
        "</joint>"
    )
    source.write_text(
        '<robot name="r">' + "".join(f'<link name="{n}"/>' for n in "abcde")
        + joint.format("ball", "spherical", "a", "b", '<origin xyz="0 0 1"/>')
        + joint.format("cardan", "universal", "b", "c", '<axis xyz="1 0 0"/>')
        + joint.format("first", "continuous", "c", "d", '<axis xyz="0 -2 0"/>')
        + joint.format("second", "prismatic", "d", "e",
                       '<mimic joint="first" multiplier="2" offset="0.1"/>')
        + "<gazebo/></robot>"
    )  # fmt: skip
    answer = convert(source, tmp_path / "robot.toml")
    robot = read_robot(tmp_path / "robot.toml")
    turns = [f.name for f in robot.frames if f.joint == "revolute"]
    assert turns == ["ball.rx", "ball.ry", "ball.rz", "cardan.first", "cardan.second",
                     "first"]  # fmt: skip
    assert robot.frame("second").position == 0.1
    assert robot.frame("second").actuated
    assert any(
        line.startswith("mimic: second = 2 * first + 0.1") for line in answer.left_out
    )
    assert "element gazebo: 1" in answer.left_out
    # a rotation by 90 degrees about -y maps z to -x
    place = place_robot(robot, joints={"first": np.pi / 2})
    R = place.transforms[robot.index("e")][:3, :3]
    assert R @ [0, 0, 1] == pytest.approx([-1, 0, 0], abs=1e-12)


def test_convert_command_prints_files_and_largest_difference(run, tmp_path):
    target = tmp_path / "robot.toml"
    status, out, _ = run("convert", "delta", "-o", tmp_path / "d.urdf", "--json", "-")
    table = json.loads(out)
    assert status == 0
    assert table["largest_difference"] < 1e-12
    assert [Path(name).name for name in table["files"]] == ["d.urdf", "d.yaml"]
    status, out, _ = run("convert", tmp_path / "d.urdf", "-o", target)
    assert status == 0
    assert "read back in 100 random postures" in out
    assert f"written: {target}" in out


@pytest.mark.parametrize("given", ["rocker", "tip"])
def test_platform_of_an_overlay_is_not_reported_as_missing(given, tmp_path):
    """The platform is the last body in the chain or an intermediate body."""
    text = (
        '<robot name="r"><link name="a"/><link name="rocker"/><link name="tip"/>'
        '<joint name="j" type="revolute"><parent link="a"/><child link="rocker"/>'
        '</joint><joint name="k" type="revolute"><parent link="rocker"/>'
        '<child link="tip"/><origin xyz="1 0 0"/></joint></robot>'
    )
    source, overlay = tmp_path / "robot.urdf", tmp_path / "overlay.toml"
    source.write_text(text)
    overlay.write_text(f'platform = "{given}"\n')
    answer = convert(source, tmp_path / "robot.toml", overlay=overlay)
    assert answer.robot.platform == given
    assert "no platform is named" not in answer.text()
    assert "no platform is named" in convert(source, tmp_path / "robot.toml").text()


def test_platform_with_the_name_of_its_joint_is_found(tmp_path):
    """In MJCF, a body and its joint often have the same name."""
    source, overlay = tmp_path / "robot.xml", tmp_path / "overlay.toml"
    source.write_text(
        '<mujoco><worldbody><body name="wrist"><joint name="wrist"/>'
        '<geom size="0.1"/></body></worldbody></mujoco>'
    )
    overlay.write_text('platform = "wrist"\n')
    answer = convert(source, tmp_path / "robot.toml", overlay=overlay)
    assert answer.robot.platform == "wrist.link"


def test_file_with_more_than_2000_joints_is_rejected(tmp_path):
    """The maximum number is the same as for robot files."""
    steps = "".join(
        f'<link name="l{i + 1}"/><joint name="j{i}" type="continuous">'
        f'<parent link="l{i}"/><child link="l{i + 1}"/></joint>'
        for i in range(2001)
    )
    path = tmp_path / "chain.urdf"
    path.write_text(f'<robot name="r"><link name="l0"/>{steps}</robot>')
    with pytest.raises(BadInput, match=r"found 2001 joints, expected at most 2000"):
        convert(path, tmp_path / "chain.toml")
    assert not (tmp_path / "chain.toml").exists()
