"""Reading of ``[[tolerance]]`` tables in both robot file formats."""

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.callout_maps import place_callouts
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.inputs.writing import ROBOT_MARK
from tests.assembly.files.test_callout_features import BRACKET

FILE = """
format = 2
name = "arm"
platform = "plate"
platform_at = [0.7, 0, 0.1]

[[tolerance]]                       # tolerance of the base
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
    """Return the file without the second of two datums that refer to each other."""
    start = FILE.index('[[leg.body.tolerance]]\nfeature = "foot"')
    return FILE[:start] + FILE[FILE.index("[[leg.joint]]") :]


def read(tmp_path, text, name="robot.toml"):
    path = tmp_path / name
    path.write_text(text)
    return read_robot(path)


def placed(robot):
    return place_callouts(home_posture(robot))


def test_callouts_are_equal_in_both_file_formats(tmp_path, without_circle):
    """The second robot has a round face and a datum with maximum material condition."""
    names = [c.name for c in read(tmp_path, without_circle).callouts]
    assert names == [
        "face", "leg1.foot on base", "leg1.pad on rod", "leg2.pad on rod",
    ]  # fmt: skip
    for text in (without_circle, BRACKET):
        robot = read(tmp_path, text)
        write_robot(robot, tmp_path / "frames.toml")
        assert (tmp_path / "frames.toml").read_text().startswith(ROBOT_MARK)
        again = read_robot(tmp_path / "frames.toml")
        for one, other in zip(robot.callouts, again.callouts, strict=True):
            assert vars(one) == vars(other)
        for one, other in zip(placed(robot), placed(again), strict=True):
            assert one.errors == pytest.approx(other.errors, abs=1e-15)


def test_callouts_of_a_copied_leg_are_rotated(tmp_path, without_circle):
    robot = read(tmp_path, without_circle)
    first, second = placed(robot)[2:]
    one = first.errors[robot.index("leg1.pad.slide_x")]
    other = second.errors[robot.index("leg2.pad.slide_x")]
    assert np.abs(one).max() > 0
    assert one == pytest.approx(other, abs=1e-15)


def test_normal_of_a_face_is_axis_of_its_planar_joint(tmp_path, without_circle):
    """A profile tolerance of 0.1 mm permits a displacement of 50 um along the normal.

    A perpendicularity tolerance of 0.02 mm limits the tilt of a face of 40 by 30 mm to
    0.5 mrad about y of the joint.
    """
    robot = read(tmp_path, without_circle)
    face = placed(robot)[2]
    errors = face.errors[robot.index("leg1.pad.slide_x")]
    at = np.linalg.pinv(face.zone.columns)
    assert face.zone.support(errors[4] @ at) == pytest.approx(50e-6, rel=1e-6)
    tilts = sorted(face.zone.support(errors[k] @ at) for k in (0, 1, 2))
    assert tilts == pytest.approx([0, 0.5e-3, 10e-6 / 15e-3], abs=1e-9)


def test_position_of_a_feature_does_not_depend_on_joint_contacts(tmp_path):
    """The feature is at the centre of a bore, the contacts are at its ends."""
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


def test_fit_of_a_joint_is_assigned_to_its_frame(tmp_path, without_circle):
    joint = 'name = "foot"\ntype = "revolute"'
    text = without_circle.replace(joint, joint + '\nclearance = { fit = "12 H7/g6" }')
    robot = read(tmp_path, text)
    assert dict(robot.fits) == dict.fromkeys(("leg1.foot", "leg2.foot"), "12 H7/g6")
