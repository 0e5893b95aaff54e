"""Error messages for invalid robot files."""

import math
import re

import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.inputs.table import BadInput
from tests.robot_files_for_tests import (
    FOUR_BAR,
    PLAY,
    SLIDER,
    SPRING,
    assert_refused,
    rows,
)


def test_unchanged_example_robot_files_are_valid(write_file):
    """The invalid files in this module are changed versions of these two files."""
    robot = read_robot(write_file(FOUR_BAR))
    assert [f.name for f in robot.frames][:2] == ["crank", "elbow"]
    assert home_posture(robot).mismatch < 1e-12
    assert read_robot(write_file(SLIDER)).platform == "tool"


REFUSED = {
    "negative tolerance": (
        "mass = 1.2", "mass = 1.2\ntolerance = [0, 0, 1e-3, -1e-3, 0, 0]",
        'frame "coupler".tolerance: found the number -0.001, expected 6 numbers'),
    "limits the wrong way round": (
        "mass = 1.2", "mass = 1.2\njoint = \"revolute\"\nlimits = [1.0, -1.0]",
        'frame "coupler".limits: found [1, -1], expected the smaller number'),
    "limits of a fixed joint": (
        "mass = 1.2", "mass = 1.2\nlimits = [-1.0, 1.0]",
        'frame "coupler".limits: found limits on a fixed joint'),
    "unknown key of a link": (
        "poisson = 0.3 }", "poisson = 0.3, densty = 1.0 }",
        'frame "coupler".link: unknown key "densty"; did you mean "density"?'),
    "unknown key of a closure": (
        'frames = ["coupler", "seat"]', 'frames = ["coupler", "seat"]\nframe = 1',
        'closure[1]: unknown key "frame"; did you mean "frames"?'),
    "unknown key of dh": (
        "mass = 1.2", "mass = 1.2\n[[frame]]\nname = 'x'\nparent = 'base'\n"
        "dh = { tetha = 1 }",
        'frame "x".dh: unknown key "tetha"; did you mean "theta"?'),
    "unknown platform": (
        'platform = "coupler"', 'platform = "coupler1"',
        'platform: found "coupler1", expected the name of a frame; did you mean '
        '"coupler"?'),
    "the base as platform": (
        'platform = "coupler"', 'platform = "base"',
        'platform: found "base"; expected a frame (add a fixed frame with parent '
        '"base")'),
    "a frame without a parent": (
        'parent = "wrist"', "",
        'frame "seat".parent: missing; expected the name of a frame, or "base"'),
    "an unknown parent": (
        'parent = "wrist"', 'parent = "wirst"',
        'frame "seat".parent: found "wirst", expected a frame of this robot or '
        '"base"; did you mean "wrist"?'),
    "a ring of parents": (
        'name = "rocker"\nparent = "base"', 'name = "rocker"\nparent = "seat"',
        'frame "rocker".parent: found "seat", which leads to a cycle of parents; '
        'expected a chain of parents that ends at "base"'),
    "a name given twice": (
        'name = "wrist"', 'name = "crank"',
        'frame[5].name: found "crank", which is already the name of '
        "frame[1]; expected a different name"),
    "a frame called base": (
        'name = "wrist"', 'name = "base"',
        'frame[5].name: found "base", which is already the name of the '
        "root; expected a different name"),
    "a joint of another kind": (
        'joint = "revolute"\nactuated', 'joint = "revolut"\nactuated',
        'frame "crank".joint: found \'revolut\', expected "fixed" | "revolute" | '
        '"prismatic" | "helical"; did you mean "revolute"?'),
    "a helical joint without pitch": (
        'joint = "revolute"\nactuated', 'joint = "helical"\nactuated',
        'frame "crank".pitch: missing; expected a finite number [m per turn]'),
    "a pitch of 0": (
        'joint = "revolute"\nactuated', 'joint = "helical"\npitch = 0\nactuated',
        'frame "crank".pitch: found 0, expected a magnitude of at least 1e-09 m'),
    "a pitch of another joint": (
        'joint = "revolute"\nactuated', 'joint = "revolute"\npitch = 0.01\nactuated',
        'frame "crank".pitch: found a pitch on a revolute joint, expected none, or a '),
    "a number for true": (
        "actuated = true", "actuated = 1",
        'frame "crank".actuated: found 1, expected true or false'),
    "a position of a fixed joint": (
        'joint = "revolute"\nactuated = true', "",
        'frame "crank".position: found position on a fixed joint; expected joint = '
        '"revolute" | "prismatic" | "helical", or no position'),
    "a negative mass": (
        "mass = 1.2", "mass = -1.2",
        'frame "coupler".mass: found -1.2, expected a finite number >= 0 [kg]'),
    "a force of a drive that holds its coordinate": (
        "actuated = true", "actuated = true\ndrive_force = 5.0",
        'frame "crank".drive_force: found a force on a joint that is not passive; '
        'expected a joint = "revolute" | "prismatic" | "helical" that is not '
        "actuated, because a force-controlled drive does not hold its coordinate"),
    "a force that is no number": (
        "position = 1.0\njoint_stiffness", "position = 1.0\ndrive_force = nan\n"
        "joint_stiffness",
        'frame "rocker".drive_force: found nan, expected a finite number'),
    "an infinite length": (
        "translation = [0.3, 0.0, 0.0]", "translation = [0.3, -inf, 0.0]",
        'frame "wrist".translation: found -inf as number 2, expected 3 finite numbers '
        "[m]"),
    "a length beyond any machine": (
        "translation = [0.3, 0.0, 0.0]", "translation = [3e6, 0.0, 0.0]",
        'frame "wrist".translation: found [3000000.0, 0.0, 0.0], expected numbers of '
        "magnitude at most 1e+06 [m]"),
    "dh beside a translation": (
        "translation = [0.3, 0.0, 0.0]", "translation = [0.3, 0.0, 0.0]\ndh = {a = 1}",
        'frame "wrist".translation: found translation together with "dh"; both '
        "place the frame, expected only one of them"),
    "a list for dh": (
        "translation = [0.3, 0.0, 0.0]", "dh = [0, 0, 0.3, 0]",
        'frame "wrist".dh: found [0, 0, 0.3, 0], expected a table'),
    "a negative clearance": (
        "radial = 29e-6", "radial = -29e-6",
        'frame "elbow".clearance.radial: found -2.9e-05, expected a finite number >= 0 '
        "[m]"),
    "a clearance whose square is no number": (
        "radial = 29e-6", "radial = 1e-200",
        'frame "elbow".clearance.radial: found 1e-200, expected 0 or'),
    "a ball beside a radial clearance": (
        "radial = 29e-6", "ball = 1e-5, radial = 29e-6",
        'frame "elbow".clearance.radial: found together with "ball", expected only '
        "one of them"),
    "a ball on a slide": (
        'joint = "revolute"\nposition = -1.0\n' + PLAY,
        'joint = "prismatic"\nclearance = { ball = 1e-5 }',
        'frame "elbow".clearance.ball: found a bound on a sliding joint, '),
    "an unbounded clearance of a joint that moves": (
        PLAY, "clearance = { spin = inf }",
        'frame "elbow".clearance.spin: found inf, expected a finite'),
    "a number for a clearance": (
        PLAY, "clearance = 1e-5",
        'frame "elbow".clearance: found 1e-05, expected a table'),
    "five stiffnesses": (
        SPRING, "joint_stiffness = [1, 2, 3, 4, 5]",
        'frame "rocker".joint_stiffness: found [1, 2, 3, 4, 5] of length 5, expected 6 '
        "diagonal terms > 0 or inf (number 3 may be 0: free), or 6 rows of 6 "
        "[N m/rad .. N/m]"),
    "a stiffness of zero": (
        SPRING, "joint_stiffness = [1, 0, 3, 4, 5, 6]",
        'frame "rocker".joint_stiffness: found the number 0, expected 6 diagonal '),
    "a locked bearing": (
        SPRING, "joint_stiffness = [inf, inf, inf, 2e8, 2e8, 2e8]",
        'frame "rocker".joint_stiffness: found inf along the motion of a passive '
        "joint, which would lock it; expected 0 (free, as a bearing), a number > 0 (a "
        'spring), or joint = "fixed"'),
    "a free row that is not empty": (
        SPRING, f"joint_stiffness = {rows({(3, 3): 0, (3, 4): 1, (4, 3): 1})}",
        'frame "rocker".joint_stiffness: not positive definite: found 0 as term '
        "[3, 3] of the diagonal, expected > 0"),
    "nan in a joint's stiffness": (
        SPRING, f"joint_stiffness = {rows({(2, 3): math.nan})}",
        'frame "rocker".joint_stiffness: found nan as number 3 in row 2, expected 6 '),
    "something beside an inf": (
        SPRING, f"joint_stiffness = {rows({(1, 1): math.inf, (2, 1): 1, (1, 2): 1})}",
        'frame "rocker".joint_stiffness: found 1 at [1, 2]; expected inf only on the '
        "diagonal, with zeros elsewhere in its row and column"),
    "an asymmetric joint": (
        SPRING, f"joint_stiffness = {rows({(1, 2): 0.5})}",
        'frame "rocker".joint_stiffness: not symmetric: found [1, 2] = 5.000000e-01 '
        "but [2, 1] = 0.000000e+00, expected equal numbers"),
    "an indefinite joint": (
        SPRING, f"joint_stiffness = {rows({(1, 2): 2, (2, 1): 2})}",
        'frame "rocker".joint_stiffness: not positive definite: found -1.0e+00 as '
        "smallest eigenvalue when scaled to a unit diagonal, expected > 0"),
    "a closure of one frame": (
        '["coupler", "seat"]', '["coupler", "coupler"]',
        "closure[1].frames: found ['coupler', 'coupler'], expected two different frame "
        "names"),
    "a closure with nobody": (
        '["coupler", "seat"]', '["coupler", "seta"]',
        'closure[1].frames: found "seta", expected the name of a frame; did you mean '
        '"seat"?'),
    "a closure with the base": (
        '["coupler", "seat"]', '["coupler", "base"]',
        'closure[1].frames: found "base"; expected a frame (add a fixed frame with '
        'parent "base")'),
    "a closure at a joint": (
        '["coupler", "seat"]', '["coupler", "wrist"]',
        'closure[1].frames: found a revolute joint at frame "wrist"; expected a fixed '
        "joint without clearance or joint_stiffness; add such a frame"),
    "a platform with a stiffness": (
        "mass = 1.2", "joint_stiffness = [1, 1, 1, 1, 1, 1]",
        'platform: found joint_stiffness at frame "coupler"; expected a fixed joint '
        "without clearance or joint_stiffness; add such a frame"),
    "a closure that does not hold": (
        "translation = [0.5, 0.0, 0.0]\njoint", "translation = [1.5, 0.0, 0.0]\njoint",
        'four_bar: closure[1] ("coupler", "seat") is open in the home pose: found a '
        "gap of "),
    "one frame instead of many": (
        "[[closure]]", "[closure]",
        "closure: found {'frames': ['coupler', 'seat']}, expected tables "
        "[[closure]]"),
    "a description that is none": (
        'description = "a parallelogram"', "description = 3",
        "description: found 3, expected a string"),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), REFUSED.values(), ids=REFUSED)
def test_invalid_robot_file_is_rejected(old, new, message, write_file):
    assert_refused(write_file, old, new, message)


CONTENTS = {
    "nothing": (b"", "platform: missing; expected the name of a frame"),
    "no frame": (b'platform = "a"', "frame: missing; expected 1 to 2000 tables"),
    "bytes": (bytes(range(256)) * 9, "byte 128 is not UTF-8"),
    "UTF-16": (FOUR_BAR.encode("utf-16"), "byte 0 is not UTF-8"),
    "a gigantic key": (
        b'"' + b"key" * 10**6 + b'" = 1\nplatform = "a"',
        "unknown key ",
    ),
    "a gigantic value": (b'platform = "' + b"abc" * 10**6 + b'"', "platform: found "),
}


@pytest.mark.parametrize(("content", "message"), CONTENTS.values(), ids=CONTENTS)
def test_error_message_about_another_file_is_short(content, message, write_file):
    path = write_file(content)
    with pytest.raises(BadInput, match=re.escape(f"{path}: {message}")) as caught:
        read_robot(path)
    assert len(str(caught.value)) < len(str(path)) + 300
    assert "\n" not in str(caught.value)


def test_missing_file_or_folder_is_rejected(tmp_path):
    with pytest.raises(BadInput, match="none.toml: cannot be read: No such file"):
        read_robot(tmp_path / "none.toml")
    with pytest.raises(BadInput, match="cannot be read: Is a directory"):
        read_robot(tmp_path)
    with pytest.raises(BadInput, match="cannot be read: "):
        read_robot("a\0b.toml")
