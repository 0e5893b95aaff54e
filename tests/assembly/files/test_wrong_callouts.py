"""Mistakes in the tolerances of a drawing that were read as something else."""

import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.inputs.table import BadInput
from tests.drawn_four_bar_for_tests import four_bar_file

BORE = 'position = "0.05 mm"\nextent = "20 mm"\n'
FRAMES = """
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
joint = "revolute"
actuated = true
[[frame]]
name = "tip"
parent = "b"
[[tolerance]]
feature = "b"
datums = ["a"]
"""


def message_on(tmp_path, text):
    path = tmp_path / "robot.toml"
    path.write_text(text)
    with pytest.raises(BadInput) as error:
        read_robot(path)
    assert "\n" not in str(error.value)
    assert str(error.value).count("robot.toml") == 1
    return str(error.value)


def of_crank(new, datum='["A"]'):
    """The four-bar whose crank has other keys in its only callout."""
    old = 'feature = "B"\ndatums = ["A"]\nlength = "100 +- 0.02 mm"\n'
    text = four_bar_file()
    assert old in text
    return text.replace(old, f'feature = "B"\ndatums = {datum}\n{new}\n')


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (BORE + "direction = [0, 0, 1]", "direction: found a direction that is not"),
        (BORE + "direction = [1, 0, 1]", "direction: found a direction that is not"),
        (
            'length = "100 +- 0.1 mm"\ndirection = [1, 0, 0]',
            "direction: found a direction for a feature without a zone, expected none",
        ),
        (BORE + 'hole = "12 H7"', "hole: found a hole without (M), expected a"),
        (BORE + "cp = 1.33", "cp: found a cp for a uniform distribution, expected"),
        (
            'coaxiality = "0.05 mm"\nextent = "20 mm"',
            'tolerance of "B on crank": found coaxiality to an axis 100 mm away',
        ),
        (
            BORE + 'name = "x"\n[[body.tolerance]]\nfeature = "A"\ndatums = ["B"]\n'
            'name = "x"\n' + BORE,
            "found datums that depend on each other",
        ),
        ('profile = "0.1 mm"\nextent = "20 mm"', "feature that is an axis, expected"),
    ],
)
def test_mistake_in_a_callout_of_a_body_is_reported_in_one_line(
    tmp_path, keys, message
):
    assert message in message_on(tmp_path, of_crank(keys))


def test_datum_that_is_named_twice_is_reported(tmp_path):
    found = message_on(tmp_path, of_crank(BORE, '["A", "A"]'))
    assert "datums: found ['A', 'A'], expected each datum once" in found


def test_two_features_of_the_same_name_are_reported(tmp_path):
    """Tables and the parts of a worst case are by name."""
    text = four_bar_file().replace('feature = "B"', 'name = "x"\nfeature = "B"', 1)
    text = text.replace('feature = "C"', 'name = "x"\nfeature = "C"', 1)
    found = message_on(tmp_path, text)
    assert 'tolerance of "x": found "length of x" twice, expected a different' in found


def test_direction_of_a_face_or_of_a_ball_is_reported(tmp_path):
    text = of_crank('position = "0.1 mm"\ndirection = [1, 0, 0]')
    pin = 'name = "B"\ntype = "revolute"'
    ball = message_on(tmp_path, text.replace(pin, pin.replace("revolute", "spherical")))
    assert "direction: found a direction for a point, expected none" in ball
    face = text.replace(pin, pin.replace("revolute", "planar"))
    face = face.replace('"0.1 mm"', '"0.1 mm"\nextent = ["40 mm", "30 mm"]')
    assert "found a direction for a face; its" in message_on(tmp_path, face)


def test_class_of_perpendicularity_needs_the_length_of_a_square_bore(tmp_path):
    text = of_crank('general = "ISO 2768-mK"')
    start = text.index('name = "B"\ntype')
    text = text[:start] + text[start:].replace(
        "axis = [0, 0, 1]", "axis = [1, 0, 0]", 1
    )
    found = message_on(tmp_path, text)
    assert "found class K of a bore without its length, expected" in found


def test_length_to_a_datum_at_the_same_place_is_reported(tmp_path):
    """0.1 um is within the accepted difference from the geometry, which is 0."""
    text = FRAMES + 'length = "0.0001 +- 0.00001 mm"'
    assert "a datum at the same place, expected" in message_on(tmp_path, text)


def test_parts_of_another_frame_must_have_its_fit(tmp_path):
    pin = 'name = "b"\nparent = "a"\n'
    end = 'clearance = { fit = "12 H7/h6", length = 0.01, parts = "a" }\n'
    text = FRAMES.replace(pin, pin + end) + 'position = "0.1 mm"\nextent = "20 mm"\n'
    found = message_on(tmp_path, text)
    assert 'of the parts "a", expected "12 H7/g6" as for an earlier frame' in found
