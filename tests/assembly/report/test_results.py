"""Results of ``assembly solve`` as text."""

from pathlib import Path

import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.load import massless
from forcefit.assembly.model.robot import Clearance, Frame, MeshLink, Robot
from forcefit.assembly.report.pose_errors import pose_error_of
from forcefit.assembly.report.results import solution_of, solution_text
from forcefit.assembly.robots import load_robot


def test_largest_error_of_a_bush_equals_closed_form():
    """For radial clearance r and axial clearance a, the error is hypot(r, a)."""
    r, a = 3e-5, 4e-5
    frames = (
        Frame("bush", clearance=Clearance(radial=r, axial=a)), Frame("tip", "bush")
    )  # fmt: skip
    posture = home_posture(Robot("bush", "tip", frames))
    results = solution_of(posture)
    assert results["worst_error"]["translation"] == pytest.approx(5e-5, abs=1e-6)
    certified = pose_error_of(posture, ["frozen"])["error"]["frozen"]["translation"]
    assert results["worst_error"]["translation"] == certified["upper"]
    assert "assumption frozen of (27)" in solution_text(results)


def test_gravity_without_mass_is_reported_to_have_no_effect():
    robot = load_robot("irsbot2")
    (remark,) = massless(robot, [0, 0, -9.81])
    assert remark.startswith("gravity has no effect, because no frame has a mass")
    assert massless(robot, None) == massless(robot, [0, 0, 0]) == []
    solid = MeshLink(Path("arm.stl"), "z=0", "z=1", 2e11, 0.3, 7850.0)
    heavy = Robot("one", "arm", (Frame("arm", translation=[0, 0, 1], link=solid),))
    (left_out,) = massless(heavy, [0, 0, -9.81])
    assert 'the weight of "arm", whose stiffness is computed' in left_out
    weighed = Frame("arm", translation=[0, 0, 1], link=solid, mass=3.0)
    assert massless(Robot("one", "arm", (weighed,)), [0, 0, -9.81]) == []
    assert massless(load_robot("hexapod"), [0, 0, -9.81]) == []
    results = solution_of(home_posture(robot), gravity=[0, 0, -9.81])
    assert remark in results["remarks"]


ARM = """
format = 2
platform = "tool"
platform_at = [0, 0, "150 mm"]
body = [{ name = "tool" }]
joint = [{ name = "rail", type = "prismatic", between = ["base", "tool"], at = [0, 0, 0], axis = [0, 0, 1], axis2 = [1, 0, 0], actuated = true, clearance = { guide = { gap = "12 um", length = "70 mm", width = "50 mm", height = "24 mm" } } }]
"""  # noqa: E501


def test_table_of_wrenches_has_one_row_for_a_joint_with_contacts(write_file):
    """A force of 50 N at a distance of 0.15 m causes a moment of 7.5 N m."""
    posture = home_posture(read_robot(write_file(ARM)))
    text = solution_text(solution_of(posture, [0, 0, 0, 0, -50, 0]))
    table = text.split("wrenches through the bodies")[1].splitlines()[2:]
    rows = {row.split()[0]: row.split()[1:] for row in table if row.strip()}
    assert set(rows) == {"rail", "tool"}
    found = [float(number) for number in rows["rail"]]
    assert found == pytest.approx([7.5, 0, 0, 0, -50, 0])


GANTRY = """
format = 2
platform = "table"
platform_at = [0, 0, 0]
body = [{ name = "table" }]
joint = [
    { name = "left", type = "prismatic", between = ["base", "table"], at = [-0.1, 0, 0], axis = [0, 1, 0], actuated = true },
    { name = "yrail", type = "TYPE", between = ["base", "table"], at = [0.1, 0, 0], axis = [0, 1, 0] },
]
"""  # noqa: E501


@pytest.mark.parametrize("kind", ["prismatic", "cylindrical"])
def test_wrench_tables_contain_the_joint_that_closes_a_loop(write_file, kind):
    """The JSON keys contain the frame names."""
    results = solution_of(
        home_posture(read_robot(write_file(GANTRY.replace("TYPE", kind)))),
        [0, 0, 0, 0, -50, 0],
    )
    assert [c["frames"] for c in results["closures"]] == [["yrail.end", "table"]]
    text = solution_text(results)
    assert ".end" not in text
    bodies, closures = text.split("wrenches ")[1:]
    rows = [row.split()[0] for row in bodies.splitlines()[2:] if row.strip()]
    assert sorted(rows) == ["left", "table", "yrail"]
    assert closures.splitlines()[2].startswith("yrail - table ")
