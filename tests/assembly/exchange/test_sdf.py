"""Import of SDF files with a four-bar linkage or a screw joint."""

import numpy as np
import pytest

from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.inputs.table import BadInput

# link lengths of the four-bar linkage [m]; the crank is parallel to x at home
GROUND, CRANK, COUPLER, ROCKER = 0.3, 0.1, 0.3, 0.25


def pin(crank_angle):
    """Return the position of the joint between coupler and rocker.

    It follows from the law of cosines.
    """
    a = CRANK * np.array([np.cos(crank_angle), np.sin(crank_angle)])
    b = np.array([GROUND, 0.0])
    between = np.linalg.norm(b - a)
    along = (COUPLER**2 - ROCKER**2 + between**2) / (2 * between)
    up = np.sqrt(COUPLER**2 - along**2)
    x = (b - a) / between
    return a + along * x + up * np.array([-x[1], x[0]])


def four_bar(extra=""):
    """Return the SDF text of a four-bar linkage.

    The parent of the joint between rocker and world is the rocker.
    """
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
    """Return the conversion of an SDF text and the robot, whose crank is driven."""
    source = tmp_path / "robot.sdf"
    source.write_text(text)
    loops = tmp_path / "loops.yaml"
    loops.write_text("closed_loop: []\nname_mot: [drive]\nplatform: coupler\n")
    answer = convert(source, tmp_path / "robot.toml", loops=loops)
    return answer, read_robot(tmp_path / "robot.toml")


def test_sdf_four_bar_linkage_agrees_with_law_of_cosines(tmp_path):
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


def spindle(pitch, backwards=False, kind="screw", nut="", slide=""):
    """Return the SDF text of a spindle with a nut, which a prismatic joint guides."""
    ends = ("nut", "spindle") if backwards else ("spindle", "nut")
    return f"""<sdf version="1.10"><model name="press">
<link name="spindle"/>
<link name="nut"><pose>0 0 0.2 0 0 0</pose></link>
<joint name="drive" type="revolute"><parent>world</parent><child>spindle</child>
 <axis><xyz>0 0 1</xyz></axis></joint>
<joint name="thread" type="{kind}"><parent>{ends[0]}</parent><child>{ends[1]}</child>
 {pitch}<axis><xyz>0 0 1</xyz>{nut}</axis></joint>
<joint name="guide" type="prismatic"><parent>world</parent><child>nut</child>
 <axis><xyz>0 0 1</xyz>{slide}</axis></joint>
</model></sdf>"""


def press(tmp_path, text):
    """Return the conversion of an SDF text and the robot, whose spindle is driven."""
    source = tmp_path / "press.sdf"
    source.write_text(text)
    loops = tmp_path / "loops.yaml"
    loops.write_text("closed_loop: []\nname_mot: [drive]\nplatform: nut\n")
    answer = convert(source, tmp_path / "press.toml", loops=loops)
    return answer, read_robot(tmp_path / "press.toml")


RIGHT = "<screw_thread_pitch>0.01</screw_thread_pitch>"  # [m per turn]


@pytest.mark.parametrize(("pitch", "expected"), [
    (RIGHT, 0.01),
    ("<screw_thread_pitch>-0.01</screw_thread_pitch>", -0.01),
    # this pitch is in rad/m and positive for a left-hand thread
    (f"<thread_pitch>{-2 * np.pi / 0.01}</thread_pitch>", 0.01),
    (f"<thread_pitch>5</thread_pitch>{RIGHT}", 0.01),
])  # fmt: skip
@pytest.mark.parametrize("backwards", [False, True])
def test_right_hand_thread_of_an_sdf_file_lowers_the_nut(
    tmp_path, pitch, expected, backwards
):
    """A rotation of the spindle by +360 degrees lowers the nut by the pitch.

    The order of parent and child does not change the direction.
    """
    _, robot = press(tmp_path, spindle(pitch, backwards))
    for angle in (0.3, -2.0):
        at = place_robot(robot, joints={"drive": angle}).transforms
        T = at[robot.index("nut")]
        height = 0.2 - expected * angle / (2 * np.pi)
        assert T[:3, 3] == pytest.approx([0, 0, height], abs=1e-12)
        assert T[:3, :3] == pytest.approx(np.eye(3), abs=1e-12)


def test_home_pose_satisfies_screw_and_mimic_equations(tmp_path):
    """The drive angle q satisfies s = 0.02 m + 1 m/rad q and s = -lead q."""
    rule = (
        '<mimic joint="drive"><multiplier>1</multiplier><offset>0.02</offset></mimic>'
    )
    _, robot = press(tmp_path, spindle(RIGHT, slide=rule))
    lead = 0.01 / (2 * np.pi)
    found = robot.frame("drive").position
    assert found == pytest.approx(-0.02 / (1 + lead), abs=1e-9)


def test_import_reports_omitted_range_and_spring_of_a_screw_joint(tmp_path):
    nut = "<limit><lower>-1</lower><upper>1</upper></limit>"
    nut += "<dynamics><spring_stiffness>3</spring_stiffness></dynamics>"
    answer, robot = press(tmp_path, spindle(RIGHT, nut=nut))
    assert robot.frame("thread").limits is None
    left_out = " ".join(answer.left_out)
    assert (
        "joint axis limit of a screw, whose unit the format does not define" in left_out
    )
    assert "joint axis dynamics, not converted, though it may carry load" in left_out


@pytest.mark.parametrize(("pitch", "message"), [
    ("", "screw_thread_pitch: missing; expected a number"),
    ("<thread_pitch>0</thread_pitch>", "found 0, expected a thread of 1e-09 to 1 m"),
    ("<screw_thread_pitch>2</screw_thread_pitch>", "found 2, expected a thread"),
])  # fmt: skip
def test_sdf_screw_joint_with_invalid_pitch_is_rejected(tmp_path, pitch, message):
    with pytest.raises(BadInput, match=message):
        press(tmp_path, spindle(pitch))
    assert not (tmp_path / "press.toml").exists()
