"""Error messages for invalid tolerances and fits in robot files."""

import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.inputs.table import BadInput
from tests.assembly.files.test_callout_file import FILE
from tests.assembly.files.test_form import ARM
from tests.assembly.files.test_guide_fit import GUIDE
from tests.drawn_four_bar_for_tests import four_bar_file

FRAMES = """
name = "two"
platform = "tip"
[[frame]]
name = "a"
parent = "base"
joint = "revolute"
actuated = true
clearance = { fit = "12 H7/g6" }
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
END = 'clearance = { fit = "12 H7/h6", length = 0.01, parts = "a" }\n'
CRANK, LENGTH = four_bar_file(), 'length = "100 +- 0.02 mm"'
BORE = 'position = "0.05 mm"\nextent = "20 mm"\n'
POINT = CRANK.replace(LENGTH, 'position = "0.1 mm"\ndirection = [1, 0, 0]')
FACE = POINT.replace('"0.1 mm"', '"0.1 mm"\nextent = ["40 mm", "30 mm"]')
PIN, JOINT = 'name = "B"\ntype = "revolute"', '[[joint]]\nname = "pin"'
TWO_PINS = (
    ARM
    + """
[[joint]]
name = "tip"
type = "revolute"
between = ["rod", "wheel"]
at = ["200 mm", 0, 0]
axis = [0, 0, 1]
clearance = { radial = "10 um" }
[[body]]
name = "wheel"
"""
)


def of_tip(zones):
    """Return a tolerance table of the joint ``tip`` with the given zones."""
    table = '[[body.tolerance]]\nfeature = "tip"\ndatums = ["pin"]\n'
    return f'{table}{zones}\nextent = "20 mm"\n{JOINT}'


# for each file: text to be replaced, new text, and expected message
REFUSED = {
    "bodies": (FILE, [
        ("", "", 'tolerance of "leg1.pad on rod": found datums that depend'),
        ('datums = ["foot"]', 'datums = ["foots"]',
         '"pad" on "rod".datums: found "foots", expected a joint of "rod"; did you '
         'mean "foot"'),
        ('datums = ["foot"]', "datums = []", "expected a list of one to three names"),
        ('"0.1 mm"\nextent = "10 mm"', '"0.1"\nextent = "10 mm"',
         'position: found \'0.1\', expected a width > 0'),
        ('extent = "10 mm"', "", "extent: missing; expected the length of the bore"),
        ('perpendicularity = "0.02 mm"', 'perpendicularity = "0.2 mm"',
         "found 0.2 mm, expected less than that of the location, 0.1 mm"),
        ('profile = "0.04 mm"', 'coaxiality = "0.04 mm"',
         "found this zone for a feature that is a plane"),
        ('hole = "12 H7"', "", 'found (M), expected only for the position of a bore'),
        ('position = "0.1 mm"\nextent = "10 mm"', "",
         "found no tolerance, expected one of position | coaxiality"),
        ('name = "face"', 'nane = "face"', 'unknown key "nane"'),
        ("cp = 1.33", "cp = 0", "cp: found 0"),
        ('position = "0.1 mm"\nextent = "10 mm"', 'general = "DIN 7168"',
         'general: found "DIN 7168", expected a text such as "ISO 2768-mK"'),
        ('position = "0.1 mm"\nextent = "10 mm"', 'length = "590 +- 1 mm"',
         "found a length of 590 mm, expected the length at home, 600 mm"),
    ]),
    "frames": (FRAMES, [
        ('feature = "b"', 'feature = "c"', 'found "c", expected the name of a frame'),
        ('datums = ["a"]', 'datums = ["tip"]', 'the datum "tip" on another body'),
        ('datums = ["a"]', 'datums = [{ frame = "a", extent = "20 mm" }]',
         'found "a" with "extent"; expected "extent" exactly for a hole at maximum'),
        ('datums = ["a"]', 'datums = [{ frame = "a", shape = "cone" }]',
         "found 'cone', expected \"axis\" | \"plane\""),
        ('datums = ["a"]', 'datums = ["a"]\ndirection = [0, 0, 1]',
         "not perpendicular to the axis"),
        ('length = "400 +- 0.05 mm"', f'{BORE}direction = [0, 0, 1]',
         "direction: found a direction that is not"),
        ("translation = [0.4, 0, 0]\n", "",
         "found a length of 400 mm, expected the length at home, 0 mm"),
        ('name = "b"', 'name = "b"\nclearance = { fit = "25 H7/p6" }',
         'clearance.fit: found "25 H7/p6", an interference fit'),
        ('name = "b"', 'name = "b"\nclearance = { fit = "12 H7/g6", radial = 1e-5 }',
         'radial: found together with "fit"'),
        ('name = "b"', 'name = "b"\nclearance = { fit = 12 }',
         "clearance.fit: found 12, expected a fit such as"),
    ]),
    "frames of other parts": (FRAMES.replace('length = "400 +- 0.05 mm"', BORE), [
        ('name = "b"\nparent = "a"\n', f'name = "b"\nparent = "a"\n{END}',
         'for the parts "a", expected "12 H7/g6" as at an earlier frame'),
    ]),
    "frames at one place": (FRAMES.replace("[0.4, 0, 0]", "[0, 0, 0]"), [
        # this length agrees with the distance of 0 within the accepted difference
        ('"400 +- 0.05 mm"', '"0.0001 +- 0.00001 mm"',
         "a coincident datum, expected"),
    ]),
    "form": (ARM, [
        ('"0.006 mm"', '"0.006"', 'tolerance of "pin".cylindricity: found \'0.006\''),
        ('"0.006 mm"', '"0.006 mm (M)"', "found a width with (M), expected a width"),
        ("cylindricity", "flatness", "found no gap that is affected by the flatness"),
        ('{ fit = "12 H7/g6", length = "40 mm" }', '{ axial = "5 um" }',
         'joint "pin".clearance: found no gap that is affected by the cylindricity of '
         "its features, expected a radial clearance, a fit or bearings"),
        ('{ fit = "12 H7/g6", length = "40 mm" }', '{ fit = "25 H7/p6" }',
         'clearance.fit: found "25 H7/p6", an interference fit'),
        ('cylindricity = "0.006 mm"', 'cylindricity = "0.006 mm"\ndatums = ["pin"]',
         "datums: found this key for a feature that has only a form tolerance, "
         "expected none"),
    ]),
    "zones, which form, orientation and location decrease in this order": (TWO_PINS, [
        (JOINT, of_tip('position = "0.05 mm"\nparallelism = "0.02 mm"\n'
                       'cylindricity = "0.03 mm"'),
         "found 0.03 mm, expected less than the parallelism, 0.02 mm"),
        (JOINT, of_tip('position = "0.05 mm"\ncylindricity = "0.05 mm"'),
         "found 0.05 mm, expected less than the position, 0.05 mm"),
        (JOINT, of_tip('position = "0.05 mm"\nparallelism = "0.05 mm"'),
         "parallelism: found 0.05 mm, expected less than that of the location"),
    ]),
    "guide": (GUIDE, [
        ("FIT", '"25 H7/p6"', 'guide.fit: found "25 H7/p6", an interference fit'),
        ("FIT", '["40 H7/g6"]', "guide.fit: found a list of length 1, expected one"),
        ("FIT", "12", "guide.fit: found 12, expected a fit such as"),
        ("FIT", '"40 H7/g6", gap = "5 um"', 'guide.gap: found together with "fit"'),
        ("guide = { fit = FIT", 'fit = "40 H7/g6"\nguide = { gap = "5 um"',
         'with "guide", expected it in the guide'),
    ]),
    "crank": (CRANK, [
        (LENGTH, f'{BORE}direction = [1, 0, 1]',
         "direction: found a direction that is not"),
        (LENGTH, 'length = "100 +- 0.1 mm"\ndirection = [1, 0, 0]',
         "direction: found a direction for a feature without a zone, expected none"),
        (LENGTH, f'{BORE}hole = "12 H7"', "hole: found a hole without (M), expected a"),
        (LENGTH, f"{BORE}cp = 1.33",
         "cp: found cp with a uniform distribution, expected"),
        (LENGTH, 'coaxiality = "0.05 mm"\nextent = "20 mm"',
         'tolerance of "B on crank": found coaxiality to an axis 100 mm away'),
        (LENGTH, f'{BORE}name = "x"\n[[body.tolerance]]\nfeature = "A"\n'
         f'datums = ["B"]\nname = "x"\n{BORE}',
         "found datums that depend on each other"),
        (LENGTH, 'profile = "0.1 mm"\nextent = "20 mm"',
         "feature that is an axis, expected"),
        (f'datums = ["A"]\n{LENGTH}', f'datums = ["A", "A"]\n{BORE}',
         "datums: found ['A', 'A'], expected each datum once"),
        # names of callouts must be unique, because results are listed by name
        ("[[body.tolerance]]\n", '[[body.tolerance]]\nname = "x"\n',
         'tolerance of "x": found "length of x" twice, expected a different'),
    ]),
    "point": (POINT, [
        (PIN, PIN.replace("revolute", "spherical"),
         "direction: found a direction for a point, expected none"),
    ]),
    "face": (FACE, [
        (PIN, PIN.replace("revolute", "planar"), "found a direction for a face, whose"),
    ]),
}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "old", "new", "message"),
    [(text, *row) for text, rows in REFUSED.values() for row in rows],
)
def test_invalid_tolerance_is_rejected(tmp_path, text, old, new, message):
    assert old in text
    (tmp_path / "robot.toml").write_text(text.replace(old, new))
    with pytest.raises(BadInput) as refused:
        read_robot(tmp_path / "robot.toml")
    told = str(refused.value)
    assert message in told
    assert "\n" not in told
    assert told.count("robot.toml") == 1


def test_general_perpendicularity_tolerance_requires_length_of_bore(tmp_path):
    head, pin, tail = CRANK.replace(LENGTH, 'general = "ISO 2768-mK"').partition(PIN)
    text = head + pin + tail.replace("axis = [0, 0, 1]", "axis = [1, 0, 0]", 1)
    (tmp_path / "robot.toml").write_text(text)
    with pytest.raises(BadInput, match="found class K for a bore without its length, "):
        read_robot(tmp_path / "robot.toml")
