"""Results printed by solve: certified sizes, and gravity without masses."""

from pathlib import Path

import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.load import massless
from forcefit.assembly.model.robot import Clearance, Frame, MeshLink, Robot
from forcefit.assembly.report.pose_errors import pose_error_of
from forcefit.assembly.report.results import solution_of, solution_text
from forcefit.assembly.robots import load_robot


def test_largest_error_of_solve_equals_the_certified_pose_error():
    """A bush of radius r and half length a: the tip moves by hypot(r, a)."""
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
