"""Import and export of joint limits."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.robots import load_robot

URDF = """<robot name="arm"><link name="a"/><link name="b"/><link name="c"/>
<joint name="turn" type="revolute"><parent link="a"/><child link="b"/>
 <axis xyz="0 0 1"/><limit {turn} effort="5" velocity="1"/></joint>
<joint name="slide" type="prismatic"><parent link="b"/><child link="c"/>
 <origin xyz="1 0 0"/><axis xyz="1 0 0"/><limit {slide} effort="5"/></joint>
</robot>"""
MJCF = """<mujoco><compiler angle="{unit}"/><worldbody><body name="b">
<joint name="turn" type="hinge" range="{turn}" {limited}/>
<inertial mass="1" pos="0 0 0"/><body name="c" pos="1 0 0">
<joint name="slide" type="slide" axis="1 0 0" range="-0.1 0.3"/>
<inertial mass="1" pos="0 0 0"/></body></body></worldbody></mujoco>"""


def limits(tmp_path, name, text):
    """Return the joint limits of a robot after import from a file."""
    source = tmp_path / name
    source.write_text(text)
    convert(source, tmp_path / "out.toml")
    frames = read_robot(tmp_path / "out.toml").frames
    return {f.name: f.limits for f in frames if f.joint != "fixed"}


RANGES = [
    ("arm.urdf", URDF.format(turn='lower="-1.5" upper="2"',
                             slide='lower="-0.1" upper="0.3"'), (-1.5, 2.0)),
    ("arm.urdf", URDF.format(turn="", slide='lower="-0.1" upper="0.3"'), None),
    ("arm.xml", MJCF.format(unit="degree", turn="-90 45", limited=""),
     (-np.pi / 2, np.pi / 4)),
    ("arm.xml", MJCF.format(unit="radian", turn="-1 0.5", limited=""), (-1.0, 0.5)),
    ("arm.xml", MJCF.format(unit="radian", turn="-1 0.5", limited='limited="false"'),
     None),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text", "expected"), RANGES)
def test_imported_joint_limits_are_in_radians(tmp_path, name, text, expected):
    found = limits(tmp_path, name, text)
    assert found["slide"] == (-0.1, 0.3)
    assert found["turn"] == (None if expected is None else pytest.approx(expected))


def test_infinite_urdf_range_is_imported_without_limits(tmp_path):
    text = URDF.format(turn="", slide='lower="-1e16" upper="inf"')
    assert limits(tmp_path, "arm.urdf", text) == {"turn": None, "slide": None}


SDF = """<sdf version="1.9"><model name="m"><link name="a"/><link name="b">
<pose>1 0 0 0 0 0</pose></link><joint name="world_a" type="fixed"><parent>{first}
</parent><child>{second}</child></joint><joint name="cross" type="{kind}">
<parent>a</parent><child>b</child>
<axis><xyz>0 0 1</xyz><limit><lower>-0.3</lower><upper>0.4</upper></limit></axis>
<axis2><xyz>0 1 0</xyz><limit><lower>-0.5</lower><upper>0.6</upper></limit></axis2>
</joint></model></sdf>"""


@pytest.mark.parametrize("kind", ["universal", "revolute2"])
@pytest.mark.parametrize("held", ["a", "b"])
def test_both_axes_of_an_sdf_universal_joint_have_limits(tmp_path, kind, held):
    """The limits do not depend on which of the two links is fixed."""
    text = SDF.format(first="world", second=held, kind=kind)
    found = limits(tmp_path, "m.sdf", text)
    assert found == {"cross.first": (-0.3, 0.4), "cross.second": (-0.5, 0.6)}


def test_both_axes_of_an_sdf_universal_joint_have_stiffness(tmp_path):
    """The stiffness is infinite in all directions except about the joint axis."""
    text = SDF.format(first="world", second="a", kind="universal")
    for tag, k in (("axis", 5), ("axis2", 7)):
        spring = f"<dynamics><spring_stiffness>{k}</spring_stiffness></dynamics>"
        text = text.replace(f"</{tag}>", f"{spring}</{tag}>")
    # a prismatic joint is driven, so that the universal joint is passive
    slide = (
        '<link name="c"/><joint name="slide" type="prismatic"><parent>b</parent>'
        "<child>c</child><axis><xyz>1 0 0</xyz></axis></joint></model>"
    )
    (tmp_path / "m.sdf").write_text(text.replace("</model>", slide))
    (tmp_path / "m.yaml").write_text("closed_loop: []\nname_mot: [slide]\n")
    convert(tmp_path / "m.sdf", tmp_path / "m.toml", loops=tmp_path / "m.yaml")
    robot = read_robot(tmp_path / "m.toml")
    for name, k in (("cross.first", 5.0), ("cross.second", 7.0)):
        stiffness = np.diag(robot.frame(name).joint_stiffness)
        assert stiffness[2] == k
        assert np.isinf(np.delete(stiffness, 2)).all()


@pytest.mark.parametrize("ending", ["urdf", "xml"])
def test_joint_limits_are_equal_after_two_conversions(tmp_path, ending):
    robot = load_robot("orthoglide")
    frames = tuple(
        replace(f, limits=(-0.5, -0.1)) if f.actuated else f for f in robot.frames
    )
    write_robot(replace(robot, frames=frames), tmp_path / "in.toml")
    convert(tmp_path / "in.toml", tmp_path / f"robot.{ending}")
    loops = tmp_path / "robot.yaml"
    convert(tmp_path / f"robot.{ending}", tmp_path / "back.toml",
            loops=loops if loops.exists() else None)  # fmt: skip
    back = read_robot(tmp_path / "back.toml")
    for frame in back.frames:
        if frame.joint != "fixed":
            assert frame.limits == ((-0.5, -0.1) if frame.actuated else None)
