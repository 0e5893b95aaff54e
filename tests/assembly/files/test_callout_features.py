"""Round faces, envelopes and datums at maximum material in robot files."""

import re

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.callout_maps import place_callouts
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.inputs.table import BadInput

# a bracket: mounting face A, bore B 12 H7, bore C; a rod turns in C
BRACKET = """
format = 2
name = "bracket"
platform = "rod"
platform_at = ["300 mm", 0, "20 mm"]

[[body]]
name = "bracket"
[[body.tolerance]]
feature = "C"
name = "bore C"
datums = ["A", "B (M)"]
datum_hole = "12 H7"
position = "0.04 mm"
extent = "20 mm"
[[body.tolerance]]
feature = "flange"
datums = ["A"]
profile = "0.06 mm"
parallelism = "0.04 mm"
diameter = "40 mm"
[[body]]
name = "rod"
[[body]]
name = "cover"

[[joint]]
name = "A"
type = "planar"
between = ["base", "bracket"]
at = [0, 0, 0]
axis = [0, 0, 1]
[[joint]]
name = "B"
type = "revolute"
between = ["base", "bracket"]
at = [0, 0, 0]
axis = [0, 0, 1]
actuated = true
clearance = { fit = "12 H7/g6" }
[[joint]]
name = "C"
type = "revolute"
between = ["bracket", "rod"]
at = ["100 mm", 0, "20 mm"]
axis = [0, 0, 1]
actuated = true
[[joint]]
name = "flange"
type = "planar"
between = ["bracket", "cover"]
at = ["50 mm", 0, "30 mm"]
axis = [0, 0, 1]
"""


def read(tmp_path, text, name="robot.toml"):
    path = tmp_path / name
    path.write_text(text)
    return read_robot(path)


def placed(robot):
    return place_callouts(home_posture(robot))


def largest(one, row):
    """Largest component of the error of a frame over the zone."""
    return one.zone.support(row @ np.linalg.pinv(one.zone.columns))


def test_zone_of_a_round_face_is_a_double_cone_of_its_diameter(tmp_path):
    """Profile 0.06: 30 um along the normal, 30 um / 20 mm of tilt; parallelism 0.04
    leaves 20 um / 20 mm = 1 mrad."""
    robot = read(tmp_path, BRACKET)
    (face,) = (p for p in placed(robot) if "flange" in p.name)
    errors = face.errors[robot.index("flange.slide_x")]
    supports = sorted(largest(face, row) for row in errors)
    assert supports == pytest.approx([0, 0, 0, 30e-6, 1e-3, 1e-3], rel=1e-6, abs=1e-12)
    free = BRACKET.replace('parallelism = "0.04 mm"', "")
    (face,) = (p for p in placed(read(tmp_path, free)) if "flange" in p.name)
    supports = sorted(largest(face, row) for row in face.errors[errors_row(robot)])
    assert supports[-1] == pytest.approx(1.5e-3, rel=1e-6)


def errors_row(robot):
    return robot.index("flange.slide_x")


def test_shift_of_a_datum_uses_the_hole_of_its_fit(tmp_path):
    """The hole of B is drawn once: its clearance is 2 times the shift at least, and
    6 um more, the least play of g6."""
    robot = read(tmp_path, BRACKET)
    sources = sources_of(robot)
    values = sources.draw(0, 20_000, 1)
    shift = 9 * np.linalg.norm(values[:, -3:-1], axis=1)  # um, unit disc of 9 um
    diametral = 20.5 + 2e6 * values[:, -1]
    assert (diametral >= 2 * shift + 6 - 1e-9).all()
    assert shift.max() > 8


def test_envelope_requirement_limits_the_tilt_of_a_face_by_its_length(tmp_path):
    """30 +- 0.05 mm: 50 um along the normal for both; with (E) over a diameter of
    40 mm a tilt of at most 50 um / 20 mm."""
    zones = 'profile = "0.06 mm"\nparallelism = "0.04 mm"'
    tilts = []
    for mark in ("", " (E)"):
        text = BRACKET.replace(zones, f'length = "30 +- 0.05 mm{mark}"')
        robot = read(tmp_path, text)
        (face,) = (p for p in placed(robot) if "flange" in p.name)
        supports = sorted(largest(face, row) for row in face.errors[errors_row(robot)])
        assert 50e-6 == pytest.approx(supports[-1 if not mark else 3], rel=1e-6)
        tilts.append(supports[-1] if mark else 0.0)
    assert tilts == pytest.approx([0.0, 2.5e-3], rel=1e-6)
    write_robot(robot, tmp_path / "frames.toml")
    assert read_robot(tmp_path / "frames.toml").callouts[1].envelope


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"B (M)"', '"B (M"', 'datums: found "B (M", expected a joint of "bracket"'),
        ('["A", "B (M)"]', '["B (M)", "A"]',
         'datums: found "B (M)" as datum A, whose tilt would change too; expected (M) '
         "at datum B or C"),
        ('["A", "B (M)"]', '["B", "A (M)"]', 'found "A (M)", a planar joint; expected'),
        ('datum_hole = "12 H7"', "", 'found "B (M)" without a hole size, expected'),
        ('datum_hole = "12 H7"', 'datum_hole = "12 H8"',
         'tolerance of "bore C": found the hole "12 H8", expected that of the fit'),
        ('datum_hole = "12 H7"', 'datum_hole = "12 h"', "expected a size such as"),
        ('datum_hole = "12 H7"', 'datum_hole = "12 g6"',
         'datum_hole: found "12 g6", a shaft; expected a hole, whose letter is a cap'),
        ('datum_hole = "12 H7"', 'datum_hole = "13 H7"',
         'found the hole "13 H7", expected that of the fit "12 H7/g6"'),
        ('["A", "B (M)"]', '["C", "B (M)"]',
         'datums: found "C", which is the feature itself, expected another joint'),
        ('"B (M)"', '"B"', "datum_hole: found a hole size, and 0 datums with (M)"),
        ('["A", "B (M)"]', '["A", "B", "B (M)"]', "expected each datum once"),
        ('diameter = "40 mm"', 'diameter = "40 mm"\nextent = ["40 mm", "30 mm"]',
         'diameter: found it together with "extent"'),
        ('diameter = "40 mm"', 'diameter = "0 mm"', "expected that of a round face"),
        ('extent = "20 mm"', 'diameter = "20 mm"',
         "diameter: found it at a feature that is an axis"),
        ('position = "0.04 mm"', 'length = "100 +- 0.1 mm (E)"',
         "length: found (E) at a feature that is not a face"),
        ('profile = "0.06 mm"\nparallelism = "0.04 mm"\ndiameter = "40 mm"',
         'length = "30 +- 0.05 mm (E)"', "extent: missing; expected two sizes"),
    ],
)  # fmt: skip
def test_mistake_in_a_callout_is_reported_in_one_line(tmp_path, old, new, message):
    assert old in BRACKET
    with pytest.raises(BadInput, match=re.escape(message)) as error:
        read(tmp_path, BRACKET.replace(old, new, 1))
    assert "\n" not in str(error.value)
    assert "robot.toml" in str(error.value)
