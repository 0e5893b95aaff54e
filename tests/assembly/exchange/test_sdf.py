"""SDF: a four-bar whose joints close its loop, against the law of cosines."""

import numpy as np
import pytest

from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import place_robot

# crank 0.1, coupler 0.3, rocker 0.25, ground 0.3 [m]; at home the crank lies along x
GROUND, CRANK, COUPLER, ROCKER = 0.3, 0.1, 0.3, 0.25


def pin(crank_angle):
    """Where coupler and rocker meet above the ground link, by the law of cosines."""
    a = CRANK * np.array([np.cos(crank_angle), np.sin(crank_angle)])
    b = np.array([GROUND, 0.0])
    between = np.linalg.norm(b - a)
    along = (COUPLER**2 - ROCKER**2 + between**2) / (2 * between)
    up = np.sqrt(COUPLER**2 - along**2)
    x = (b - a) / between
    return a + along * x + up * np.array([-x[1], x[0]])


def four_bar(extra=""):
    """Text of the SDF; its rocker's joint is written from the rocker to the world."""
    x, y = pin(0.0)
    tilt = np.arctan2(y, x - CRANK)
    return f"""<sdf version="1.9"><model name="four_bar">
<link name="crank"><pose>0 0 0 0 0 0</pose><inertial><mass>0.5</mass></inertial></link>
<link name="coupler">
 <pose degrees="true">{CRANK} 0 0 0 0 {np.degrees(tilt)}</pose></link>
<link name="rocker"><pose>{x} {y} 0 0 0 0</pose></link>
<frame name="tool" attached_to="coupler"><pose>{COUPLER} 0 0 0 0 0</pose></frame>
<joint name="drive" type="revolute"><parent>world</parent><child>crank</child>
 <axis><xyz>0 0 1</xyz>
  <limit><lower>-1</lower><upper>2</upper><effort>9</effort></limit></axis></joint>
<joint name="pin_a" type="revolute"><parent>crank</parent><child>coupler</child>
 <axis><xyz expressed_in="__model__">0 0 1</xyz></axis></joint>
<joint name="pin_b" type="revolute"><pose relative_to="tool">0 0 0 0 0 0</pose>
 <parent>coupler</parent><child>rocker</child><axis><xyz>0 0 1</xyz></axis></joint>
<joint name="pin_c" type="revolute">
 <pose relative_to="__model__">{GROUND} 0 0 0 0 0</pose>
 <parent>rocker</parent><child>world</child><axis><xyz>0 0 1</xyz></axis></joint>{extra}
</model></sdf>"""


def converted(tmp_path, text):
    """The robot of an SDF whose crank is driven."""
    source = tmp_path / "robot.sdf"
    source.write_text(text)
    loops = tmp_path / "loops.yaml"
    loops.write_text("closed_loop: []\nname_mot: [drive]\nplatform: coupler\n")
    answer = convert(source, tmp_path / "robot.toml", loops=loops)
    return answer, read_robot(tmp_path / "robot.toml")


def test_sdf_four_bar_equals_the_law_of_cosines(tmp_path):
    answer, robot = converted(tmp_path, four_bar())
    assert answer.open_before < 1e-12
    assert len(robot.closures) == 1
    assert "joint axis limit effort: 1 (drive)" in answer.left_out
    assert robot.frame("drive").limits == (-1.0, 2.0)
    for angle in (0.0, 0.3, 1.0):
        posture = place_robot(robot, joints={"drive": angle})
        T = posture.transforms[robot.index("coupler")]
        assert (T @ [COUPLER, 0, 0, 1])[:2] == pytest.approx(pin(angle), abs=1e-9)
        start = [CRANK * np.cos(angle), CRANK * np.sin(angle), 0]
        assert T[:3, 3] == pytest.approx(start, abs=1e-9)
