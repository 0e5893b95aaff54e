"""Ranges of joints: read from every format, written back, infinite ones left out."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.exchange.convert import convert
from assembly.files.robot_file import read_robot, write_robot
from assembly.robots import load_robot

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
    """Limits by joint of the robot that a file becomes."""
    source = tmp_path / name
    source.write_text(text)
    convert(source, tmp_path / "out.toml")
    frames = read_robot(tmp_path / "out.toml").frames
    return {f.name: f.limits for f in frames if f.joint != "fixed"}


def test_urdf_ranges_become_limits(tmp_path):
    text = URDF.format(turn='lower="-1.5" upper="2"', slide='lower="-0.1" upper="0.3"')
    found = limits(tmp_path, "arm.urdf", text)
    assert found == {"turn": (-1.5, 2.0), "slide": (-0.1, 0.3)}


def test_urdf_ranges_that_bind_nothing_are_none(tmp_path):
    text = URDF.format(turn="", slide='lower="-1e16" upper="inf"')
    assert limits(tmp_path, "arm.urdf", text) == {"turn": None, "slide": None}


@pytest.mark.parametrize(
    ("unit", "turn", "limited", "expected"),
    [("degree", "-90 45", "", (-np.pi / 2, np.pi / 4)),
     ("radian", "-1 0.5", "", (-1.0, 0.5)),
     ("radian", "-1 0.5", 'limited="false"', None)],
)  # fmt: skip
def test_mjcf_ranges_become_limits_in_radians(tmp_path, unit, turn, limited, expected):
    text = MJCF.format(unit=unit, turn=turn, limited=limited)
    found = limits(tmp_path, "arm.xml", text)
    assert found["slide"] == (-0.1, 0.3)
    assert found["turn"] == (None if expected is None else pytest.approx(expected))


@pytest.mark.parametrize("ending", ["urdf", "xml"])
def test_limits_come_back_from_the_file_they_are_written_to(tmp_path, ending):
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
