"""[[tolerance]] of robot files: both formats say the same, mistakes in one line."""

import re

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.callout_maps import place_callouts
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import ROBOT_MARK

FILE = """
format = 2
name = "arm"
platform = "plate"
platform_at = [0.7, 0, 0.1]

[[tolerance]]                       # of the base
feature = "leg1.foot"
datums = ["leg2.foot"]
position = "0.1 mm"
extent = "10 mm"

[[body]]
name = "plate"
[[body.tolerance]]
feature = "leg1.pad"
datums = ["leg2.pad"]
profile = "0.04 mm"
extent = ["40 mm", "30 mm"]
name = "face"

[[leg]]
name = "leg"
repeat = { count = 2, about = [0, 0, 1] }

[[leg.body]]
name = "rod"
[[leg.body.tolerance]]
feature = "pad"
datums = ["foot"]
profile = "0.1 mm"
perpendicularity = "0.02 mm"
extent = ["40 mm", "30 mm"]
distribution = "normal"
cp = 1.33
[[leg.body.tolerance]]
feature = "foot"
datums = ["pad"]
position = "0.05 mm (M)"
hole = "12 H7"
extent = "20 mm"

[[leg.joint]]
name = "foot"
type = "revolute"
between = ["base", "rod"]
at = [0.3, 0, 0]
axis = [0, 0, 1]

[[leg.joint]]
name = "pad"
type = "planar"
between = ["rod", "plate"]
at = [0.5, 0, 0.2]
axis = [0, 0, 1]
"""


@pytest.fixture(scope="module")
def without_circle():
    """The file without the pair of datums that refer to each other."""
    start = FILE.index('[[leg.body.tolerance]]\nfeature = "foot"')
    return FILE[:start] + FILE[FILE.index("[[leg.joint]]") :]


def read(tmp_path, text, name="robot.toml"):
    path = tmp_path / name
    path.write_text(text)
    return read_robot(path)


def placed(robot):
    return place_callouts(home_posture(robot))


def test_file_of_frames_written_from_bodies_has_the_same_callouts(
    tmp_path, without_circle
):
    robot = read(tmp_path, without_circle)
    assert [c.name for c in robot.callouts] == [
        "face", "leg1.foot on base", "leg1.pad on rod", "leg2.pad on rod",
    ]  # fmt: skip
    write_robot(robot, tmp_path / "frames.toml")
    assert (tmp_path / "frames.toml").read_text().startswith(ROBOT_MARK)
    again = read_robot(tmp_path / "frames.toml")
    for one, other in zip(robot.callouts, again.callouts, strict=True):
        assert vars(one) == vars(other)
    for one, other in zip(placed(robot), placed(again), strict=True):
        assert one.errors == pytest.approx(other.errors, abs=1e-15)


def test_callouts_of_a_copied_leg_are_rotated_with_the_leg(tmp_path, without_circle):
    robot = read(tmp_path, without_circle)
    first, second = placed(robot)[2:]
    one = first.errors[robot.index("leg1.pad.slide_x")]
    other = second.errors[robot.index("leg2.pad.slide_x")]
    assert np.abs(one).max() > 0
    assert one == pytest.approx(other, abs=1e-15)


def test_normal_of_a_face_is_the_normal_of_its_planar_joint(tmp_path, without_circle):
    """Profile 0.1: TZ within 50 um along the normal, which is the first frame's y;
    perpendicularity 0.02 over 40 by 30 mm: 0.5 mrad about the joint's y."""
    robot = read(tmp_path, without_circle)
    face = placed(robot)[2]
    errors = face.errors[robot.index("leg1.pad.slide_x")]
    at = np.linalg.pinv(face.zone.columns)
    assert face.zone.support(errors[4] @ at) == pytest.approx(50e-6, rel=1e-6)
    tilts = sorted(face.zone.support(errors[k] @ at) for k in (0, 1, 2))
    assert tilts == pytest.approx([0, 0.5e-3, 10e-6 / 15e-3], abs=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("", "", 'tolerance of "leg1.pad on rod": found datums that depend'),
        ('datums = ["foot"]', 'datums = ["foots"]',
         '"pad" on "rod".datums: found "foots", expected a joint of "rod"; did you '
         'mean "foot"'),
        ('feature = "pad"', 'feature = "padd"', 'found "padd", expected a joint of'),
        ('datums = ["foot"]', "datums = []", "expected a list of one to three names"),
        ('"0.1 mm"\nextent = "10 mm"', '"0.1"\nextent = "10 mm"',
         'position: found \'0.1\', expected a width > 0'),
        ('extent = "10 mm"', "", "extent: missing; expected the length of the bore"),
        ('perpendicularity = "0.02 mm"', 'perpendicularity = "0.2 mm"',
         "found 0.2 mm, expected less than that of the location, 0.1 mm"),
        ('profile = "0.04 mm"', 'coaxiality = "0.04 mm"',
         "found this zone at a feature that is a plane"),
        ('hole = "12 H7"', "", 'found (M), expected only for the position of a bore'),
        ('hole = "12 H7"', 'hole = "12 H4"', '"H4", expected a grade from 5 to 11'),
        ('position = "0.1 mm"\nextent = "10 mm"', "",
         "found no tolerance, expected one of position | coaxiality"),
        ('name = "face"', 'nane = "face"', 'unknown key "nane"'),
        ("cp = 1.33", "cp = 0", "cp: found 0"),
        ('position = "0.1 mm"\nextent = "10 mm"', 'general = "DIN 7168"',
         'general: found "DIN 7168", expected a text such as "ISO 2768-mK"'),
        ('position = "0.1 mm"\nextent = "10 mm"', 'length = "590 +- 1 mm"',
         "found a length of 590 mm, expected that at home, 600 mm"),
    ],
)  # fmt: skip
def test_mistake_in_a_callout_is_reported_in_one_line(tmp_path, old, new, message):
    assert old in FILE
    with pytest.raises(BadInput, match=re.escape(message)) as error:
        read(tmp_path, FILE.replace(old, new, 1))
    assert "\n" not in str(error.value)
    assert "robot.toml" in str(error.value)


FRAMES = """
name = "two"
platform = "tip"
[[frame]]
name = "a"
parent = "base"
joint = "revolute"
actuated = true
[[frame]]
name = "b"
parent = "a"
translation = [0.4, 0, 0]
joint = "revolute"
actuated = true
[[frame]]
name = "tip"
parent = "b"
translation = [0.3, 0, 0]
[[tolerance]]
feature = "b"
datums = ["a"]
length = "400 +- 0.05 mm"
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('feature = "b"', 'feature = "c"', 'found "c", expected the name of a frame'),
        ('datums = ["a"]', 'datums = ["tip"]', 'the datum "tip" on another body'),
        ('datums = ["a"]', 'datums = [{ frame = "a", shape = "cone" }]',
         "found 'cone', expected \"axis\" | \"plane\""),
        ('datums = ["a"]', 'datums = ["a"]\ndirection = [0, 0, 1]',
         "not perpendicular to the axis"),
    ],
)  # fmt: skip
def test_mistake_in_a_callout_of_a_file_of_frames_is_reported_in_one_line(
    tmp_path, old, new, message
):
    with pytest.raises(BadInput, match=re.escape(message)):
        read(tmp_path, FRAMES.replace(old, new, 1))


def test_contacts_of_a_joint_do_not_move_its_feature(tmp_path):
    """A bore is two frames at its ends; the feature is in its middle all the same."""
    start = FILE.index('[[leg.body.tolerance]]\nfeature = "pad"')
    end = FILE.index('[[leg.body.tolerance]]\nfeature = "foot"')
    text = (FILE[:start] + FILE[end:]).replace('hole = "12 H7"\n', "")
    text = text.replace(" (M)", "")
    joint = 'name = "foot"\ntype = "revolute"'
    bore = joint + '\nclearance = { radial = 1e-5, length = "20 mm" }'
    moved = []
    for name, one in (("plain.toml", text), ("bore.toml", text.replace(joint, bore))):
        robot = read(tmp_path, one, name)
        home = home_posture(robot)
        to_platform = linear_response(home).platform
        errors = [p.errors.reshape(6 * len(robot.frames), -1) for p in placed(robot)]
        moved.append(np.hstack([to_platform @ one for one in errors]))
    assert np.abs(moved[0]).max() > 1e-5
    assert moved[1] == pytest.approx(moved[0], abs=1e-12)


FIT = FRAMES.replace('name = "b"', 'name = "b"\nclearance = { fit = "12 H7/g6" }')


def test_fit_of_a_drawn_joint_equals_the_fit_of_its_frame(tmp_path, without_circle):
    joint = 'name = "foot"\ntype = "revolute"'
    text = without_circle.replace(joint, joint + '\nclearance = { fit = "12 H7/g6" }')
    robot = read(tmp_path, text)
    assert dict(robot.fits) == dict.fromkeys(("leg1.foot", "leg2.foot"), "12 H7/g6")


@pytest.mark.parametrize(
    ("clearance", "message"),
    [
        (
            '{ fit = "25 H7/p6" }',
            'clearance.fit: found "25 H7/p6", an interference fit',
        ),
        ('{ fit = "12 H7/z6" }', 'clearance.fit: found "z6", expected one of the let'),
        ('{ fit = "12 H7/g6", radial = 1e-5 }', 'radial: found together with "fit"'),
        ("{ fit = 12 }", "clearance.fit: found 12, expected a fit such as"),
    ],
)
def test_mistake_in_a_fit_is_reported_in_one_line(tmp_path, clearance, message):
    with pytest.raises(BadInput, match=re.escape(message)):
        read(tmp_path, FIT.replace('{ fit = "12 H7/g6" }', clearance))
