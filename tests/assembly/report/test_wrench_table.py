"""Guides in a table of wrenches."""

import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.report.results import solution_of, solution_text

ARM = """
format = 2
name = "arm"
platform = "tool"
platform_at = [0, 0, "150 mm"]
[[body]]
name = "tool"
[[joint]]
name = "rail"
type = "prismatic"
between = ["base", "tool"]
at = [0, 0, 0]
axis = [0, 0, 1]
axis2 = [1, 0, 0]
actuated = true
[joint.clearance.guide]
gap = "12 um"
length = "70 mm"
width = "50 mm"
height = "24 mm"
"""


def test_table_of_wrenches_has_one_row_for_a_joint_with_contacts(tmp_path):
    """50 N along -y, 0.15 m above a vertical rail: 7.5 N m about the joint's x."""
    path = tmp_path / "arm.toml"
    path.write_text(ARM)
    posture = home_posture(read_robot(path))
    text = solution_text(solution_of(posture, [0, 0, 0, 0, -50, 0]))
    table = text.split("wrenches through the bodies")[1].splitlines()[2:]
    rows = {row.split()[0]: row.split()[1:] for row in table if row.strip()}
    assert set(rows) == {"rail", "tool"}
    found = [float(number) for number in rows["rail"]]
    assert found == pytest.approx([7.5, 0, 0, 0, -50, 0])


GANTRY = """
format = 2
name = "gantry"
platform = "table"
platform_at = [0, 0, 0]
[[body]]
name = "table"
[[joint]]
name = "left"
type = "prismatic"
between = ["base", "table"]
at = [-0.1, 0, 0]
axis = [0, 1, 0]
actuated = true
[[joint]]
name = "yrail"
type = "TYPE"
between = ["base", "table"]
at = [0.1, 0, 0]
axis = [0, 1, 0]
"""


@pytest.mark.parametrize("kind", ["prismatic", "cylindrical"])
def test_tables_of_wrenches_name_the_drawn_joint_that_closes_a_loop(tmp_path, kind):
    """The public keys keep the names of the frames."""
    path = tmp_path / "gantry.toml"
    path.write_text(GANTRY.replace("TYPE", kind))
    results = solution_of(home_posture(read_robot(path)), [0, 0, 0, 0, -50, 0])
    assert [c["frames"] for c in results["closures"]] == [["yrail.end", "table"]]
    text = solution_text(results)
    assert ".end" not in text
    bodies, closures = text.split("wrenches ")[1:]
    rows = [row.split()[0] for row in bodies.splitlines()[2:] if row.strip()]
    assert sorted(rows) == ["left", "table", "yrail"]
    assert closures.splitlines()[2].startswith("yrail - table ")
