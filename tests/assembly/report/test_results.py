"""Results of ``assembly solve`` and ``assembly stiffness``, and their charts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.load import massless
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink, MeshLink, Robot
from forcefit.assembly.report.platform_stiffness import (
    DIRECTIONS,
    stiffness_of,
    stiffness_text,
)
from forcefit.assembly.report.pose_errors import pose_error_of
from forcefit.assembly.report.results import solution_of, solution_text
from forcefit.assembly.report.share_pictures import plot_shares, share_chart
from forcefit.assembly.robots import load_robot
from forcefit.page.charts import GREY
from tests.pages_for_tests import parse


def test_largest_error_of_a_bush_equals_closed_form():
    """For radial clearance r and axial clearance a, the error is hypot(r, a)."""
    r, a = 3e-5, 4e-5
    bush = Frame("bush", clearance=Clearance(radial=r, axial=a))
    posture = home_posture(Robot("bush", "tip", (bush, Frame("tip", "bush"))))
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
    heavy = Frame("arm", translation=[0, 0, 1], link=solid)
    (left_out,) = massless(Robot("one", "arm", (heavy,)), [0, 0, -9.81])
    assert 'the weight of "arm", whose stiffness is computed' in left_out
    weighed = replace(heavy, mass=3.0)
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
    robot = read_robot(write_file(GANTRY.replace("TYPE", kind)))
    results = solution_of(home_posture(robot), [0, 0, 0, 0, -50, 0])
    assert [c["frames"] for c in results["closures"]] == [["yrail.end", "table"]]
    text = solution_text(results)
    assert ".end" not in text
    bodies, closures = text.split("wrenches ")[1:]
    rows = [row.split()[0] for row in bodies.splitlines()[2:] if row.strip()]
    assert sorted(rows) == ["left", "table", "yrail"]
    assert closures.splitlines()[2].startswith("yrail - table ")


SLIDE = Frame("slide", joint="prismatic", link=MatrixLink(np.eye(6)))
SLIDER = Robot("slider", "tip", (SLIDE, Frame("tip", "slide")))


def test_stiffness_with_a_free_motion_has_finite_other_entries():
    results = stiffness_of(home_posture(SLIDER))
    assert results["status"] == "free motion"
    np.testing.assert_allclose(results["free_motions"], [[0, 0, 0, 0, 0, 1]])
    C = np.array(results["compliance"])
    assert np.isnan(C[5]).all()
    np.testing.assert_allclose(C[:5, :5], np.eye(5), atol=1e-12)
    said = " ".join(stiffness_text(results).split())
    assert "free motion 1 [0 0 0 0 0 1]" in said


def test_load_without_resistance_is_reported_as_no_equilibrium():
    results = stiffness_of(home_posture(SLIDER), [0, 0, 0, 0, 0, 1.0], state="exact")
    assert results["status"] == "no equilibrium"
    assert "no equilibrium" in stiffness_text(results)


def shares(parts):
    """Return equal contributions of links along every axis."""
    one = {f"part{k}": 1.0 / parts for k in range(parts)}
    return {name: {"links": dict(one), "joints": {}} for name in DIRECTIONS}


@pytest.mark.parametrize(("parts", "others"), [(5, 0), (20, 8)])
def test_contributions_in_the_chart_sum_to_one(parts, others):
    (spec,) = parse(share_chart(shares(parts), "")).figures
    heights = {t["name"]: t["y"] for t in spec["traces"]}
    np.testing.assert_allclose(sum(np.array(v) for v in heights.values()), 1.0)
    grey = [t for t in spec["traces"] if t["marker"]["color"] == GREY]
    assert [t["name"] for t in grey] == ([f"{others} others"] if others else [])
    assert all(one["y"] == pytest.approx([others / parts] * 6) for one in grey)


def test_plot_shows_the_sum_of_small_contributions_in_grey():
    figure = plot_shares({"robot": "r", "shares": shares(20)})
    bars = {c.get_label(): c.patches[0] for c in figure.axes[0].containers}
    spread = {name: np.ptp(p.get_facecolor()[:3]) for name, p in bars.items()}
    assert [name for name, size in spread.items() if size < 0.1] == ["8 others"]
