"""Round faces, envelopes and datums with maximum material condition in robot files."""

import re

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.callout_maps import place_callouts
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.worst_pose import worst_pose
from forcefit.inputs.table import BadInput

# bracket with the mounting face A, bore B (12 H7) and bore C, in which a rod rotates
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


# plate with hole B (12 H7) on an exact pin, and hole C, in which a rod rotates
PLATE = """
format = 2
name = "plate"
platform = "rod"
platform_at = [0, 0, "50 mm"]
[[body]]
name = "plate"
[[body.tolerance]]
feature = "C"
datums = ["B (M)"]
datum_hole = "12 H7"
datum_extent = "20 mm"
position = 1e-12
extent = "20 mm"
[[body]]
name = "rod"
[[joint]]
name = "B"
type = "revolute"
between = ["base", "plate"]
at = [0, 0, 0]
axis = [0, 0, 1]
actuated = true
[[joint]]
name = "C"
type = "revolute"
between = ["plate", "rod"]
at = ["100 mm", 0, "20 mm"]
axis = [0, 0, 1]
actuated = true
"""


def read(tmp_path, text, name="robot.toml"):
    path = tmp_path / name
    path.write_text(text)
    return read_robot(path)


def placed(robot):
    return place_callouts(home_posture(robot))


def largest(one, row):
    """Return the maximum of an error component over the tolerance zone."""
    return one.zone.support(row @ np.linalg.pinv(one.zone.columns))


def test_tilt_of_a_round_face_is_limited_by_its_diameter(tmp_path):
    """Limits of displacement and tilt of a face with a diameter of 40 mm.

    A profile tolerance of 0.06 mm permits 30 um along the normal and a tilt of 30 um /
    20 mm.  A parallelism tolerance of 0.04 mm limits the tilt to 20 um / 20 mm.
    """
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


def test_shift_of_a_datum_does_not_exceed_clearance_of_its_fit(tmp_path):
    """The clearance is at least twice the shift plus 6 um, the minimum for g6."""
    robot = read(tmp_path, BRACKET)
    sources = sources_of(robot)
    values = sources.draw(0, 20_000, 1)
    shift = 9 * np.linalg.norm(values[:, -3:-1], axis=1)  # [um]
    diametral = 20.5 + 2e6 * values[:, -1]
    assert (diametral >= 2 * shift + 6 - 1e-9).all()
    assert shift.max() > 8


def test_body_shifts_and_tilts_with_primary_datum_at_maximum_material(tmp_path):
    """Both ends of the 20 mm long bore B are displaced by at most s = 0 to 9 um.

    At a height h above the centre of B, the maximum displacement is
    s max(1, 2 h / 20 mm), and its variance is E[s^2] (1/8 + (h / 20 mm)^2 / 2) in each
    direction.  The platform is at h = 50 mm.
    """
    robot = read(tmp_path, PLATE)
    sources = sources_of(robot)
    prepared = linear_response(home_posture(robot))
    found = worst_pose(prepared, sources, "translation")
    assert found.attained == pytest.approx(45e-6, rel=1e-6)
    draws = prepared.solve(sources.errors(sources.draw(0, 40_000, 1)))
    variance = (9e-6) ** 2 / 3 * (1 / 8 + (50 / 20) ** 2 / 2)
    shifts = draws.platform_screw[:, 3:]
    assert shifts.var(axis=0) == pytest.approx([variance, variance, 0], rel=0.03)
    write_robot(robot, tmp_path / "frames.toml")
    again = read_robot(tmp_path / "frames.toml")
    assert [vars(c) for c in again.callouts] == [vars(c) for c in robot.callouts]


def test_envelope_requirement_limits_the_tilt_of_a_face(tmp_path):
    """With (E), a length of 30 +- 0.05 mm limits the tilt to 50 um / 20 mm."""
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
         'datums: found "B (M)" as datum A, which can tilt in the hole; expected '
         'also "datum_extent", the length of this hole'),
        ('datum_hole = "12 H7"', 'datum_hole = "12 H7"\ndatum_extent = "20 mm"',
         "datum_extent: found without (M) at datum A; expected none"),
        ('datum_hole = "12 H7"', 'datum_hole = "12 H7"\ndatum_extent = "20 mm (M)"',
         "datum_extent: found (M), expected a length without (M)"),
        ('["A", "B (M)"]', '["B", "A (M)"]', 'found "A (M)", a planar joint; expected'),
        ('datum_hole = "12 H7"', "", 'found "B (M)" without a hole size, expected'),
        ('datum_hole = "12 H7"', 'datum_hole = "12 H8"',
         'tolerance of "bore C": found the hole "12 H8", expected that of the fit'),
        ('datum_hole = "12 H7"', 'datum_hole = "12 h"', "expected a size such as"),
        ('datum_hole = "12 H7"', 'datum_hole = "12 g6"',
         'datum_hole: found "12 g6", a shaft; expected a hole with a capital letter'),
        ('datum_hole = "12 H7"', 'datum_hole = "13 H7"',
         'found the hole "13 H7", expected that of the fit "12 H7/g6"'),
        ('["A", "B (M)"]', '["C", "B (M)"]',
         'datums: found "C", which is the feature itself, expected a different joint'),
        ('"B (M)"', '"B"', "datum_hole: found a hole size, and 0 datums with (M)"),
        ('["A", "B (M)"]', '["A", "B", "B (M)"]', "expected each datum once"),
        ('diameter = "40 mm"', 'diameter = "40 mm"\nextent = ["40 mm", "30 mm"]',
         'diameter: found together with "extent"'),
        ('diameter = "40 mm"', 'diameter = "0 mm"', "expected a diameter such as"),
        ('extent = "20 mm"', 'diameter = "20 mm"',
         "diameter: found for a feature that is an axis"),
        ('position = "0.04 mm"', 'length = "100 +- 0.1 mm (E)"',
         "length: found (E) for a feature that is not a face"),
        ('profile = "0.06 mm"\nparallelism = "0.04 mm"\ndiameter = "40 mm"',
         'length = "30 +- 0.05 mm (E)"', "extent: missing; expected two sizes"),
    ],
)  # fmt: skip
def test_invalid_callout_is_rejected(tmp_path, old, new, message):
    assert old in BRACKET
    with pytest.raises(BadInput, match=re.escape(message)) as error:
        read(tmp_path, BRACKET.replace(old, new, 1))
    assert "\n" not in str(error.value)
    assert "robot.toml" in str(error.value)
