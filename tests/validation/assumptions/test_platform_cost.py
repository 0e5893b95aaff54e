"""Tests of the platform compliance with links as beams and as solids."""

import json

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.validation.assumptions.platform_cost import (
    NoSolids,
    difference,
    platform_costs,
    solid_compliance,
)
from forcefit.validation.assumptions.solid_links import solid_link

pytestmark = pytest.mark.usefixtures("coarse_solids")

ROUND = BeamLink({"radius": 0.05}, 70e9, 0.3)
SPRINGS = np.diag([3e5, 2e5, 1e5, 1e8, 2e8, 3e8])


def triangle():
    """Return a platform on two short round bars of different thickness."""
    short = BeamLink({"radius": 0.08}, 70e9, 0.3)
    frames = (
        Frame("slim", translation=[0.3, 0.1, 0.0], link=ROUND),
        Frame("slim_end", "slim", rotation=[0, 0, 0.4], joint="revolute",
              joint_stiffness=SPRINGS),
        Frame("platform", "slim_end"),
        Frame("wall", translation=[0.0, 0.4, 0.0]),
        Frame("stout", "wall", [0.3, -0.1, 0.05], link=short, joint="revolute",
              joint_stiffness=SPRINGS),
        Frame("stout_end", "stout", [0.0, -0.2, -0.05]),
    )  # fmt: skip
    return Robot("triangle", "platform", frames, (("platform", "stout_end"),))


@pytest.fixture(scope="module")
def posture():
    robot = triangle()
    posture = home_posture(robot)
    assert posture.mismatch < 1e-12
    return posture


def test_solid_link_has_nearly_the_stiffness_of_a_beam():
    """Rigid ends increase K_E by a few per cent."""
    link = BeamLink({"width": 0.05, "height": 0.1}, 70e9, 0.3, up=(0, 1, 1))
    frame = Frame("tip", translation=[0.1, 0.2, -0.2], link=link)
    solid = solid_link(frame)
    whole = np.zeros((12, 6))
    whole[6:] = whole[:6] = np.eye(6)
    whole[9, 1], whole[10, 0] = solid.span[2], -solid.span[2]
    left = np.abs(solid.ends @ whole).max()
    assert left < 1e-9 * np.abs(solid.ends).max()
    assert difference(link_compliance(frame), np.linalg.inv(solid.condensed)) < 0.08
    assert difference(link_compliance(frame), np.linalg.inv(solid.spread)) < 0.08


@pytest.mark.slow
def test_virtual_joints_agree_with_solids_with_rigid_ends(posture):
    """Static condensation is exact for rigid ends."""
    costs = platform_costs([posture])
    assert costs.meshed[0] < 1e-9
    assert 1e-3 < costs.beams[0] < 0.1
    assert 1e-3 < costs.ends[0] < 0.3
    # the bar of larger diameter has the larger error
    assert list(costs.by_link) == ["stout", "slim"]
    assert 1e-4 < costs.mesh_error < 2e-2


@pytest.mark.slow
def test_error_of_a_cantilever_equals_the_error_of_its_link():
    frame = Frame("tip", translation=[0.3, 0.0, 0.0], link=ROUND)
    posture = home_posture(Robot("cantilever", "tip", (frame,)))
    solid = solid_link(frame)
    expected = np.linalg.inv(solid.condensed)
    np.testing.assert_allclose(
        solid_compliance(posture, {"tip": solid}), expected, rtol=1e-7, atol=1e-15
    )
    costs = platform_costs([posture])
    assert costs.beams == pytest.approx(difference(link_compliance(frame), expected))
    assert costs.by_link == {"tip": pytest.approx(costs.beams)}


def test_robots_without_solids_or_stiffness_are_rejected():
    rigid = Robot("rigid", "tip", (Frame("tip", translation=[0.3, 0, 0]),))
    with pytest.raises(NoSolids, match="no link has a shape"):
        platform_costs([home_posture(rigid)])
    arm = Frame("arm", translation=[0.3, 0, 0], link=ROUND, joint="revolute")
    free = Robot("arm", "hand", (arm, Frame("hand", "arm")))
    with pytest.raises(FreeMotion, match="the platform moves freely along"):
        platform_costs([home_posture(free)])


@pytest.mark.slow
def test_validity_command_names_the_link_with_the_largest_error(run, tmp_path):
    path, picture = tmp_path / "triangle.toml", tmp_path / "cost.svg"
    write_robot(triangle(), path)
    status, out, _ = run(
        "validation", "validity", str(path), "--solids", "--load", "fz=-100", "--json",
        "-", "--figure", str(picture),
    )  # fmt: skip
    answer = json.loads(out)
    assert status == 0
    assert answer["platform"]["compliance"]["meshed"] < 1e-9
    assert next(iter(answer["platform"]["by_link"])) == "stout"
    assert "only that link a beam" in picture.read_text()


def test_validity_over_poses_reports_median_and_largest_error(run, tmp_path):
    """One of three poses is unreachable."""
    listed = tmp_path / "poses.csv"
    listed.write_text("id,pose.tx,pose.tz\na,0,-0.5\nb,0.2,-0.5\nc,3,-0.5\n")
    words = ["validation", "validity", "irsbot2", "--solids", "--json", "-"]
    status, out, _ = run(*words, "--poses", str(listed))
    answer = json.loads(out)
    assert status == 0
    assert [row["status"] for row in answer["poses"]] == ["ok", "ok", "out of reach"]
    assert answer["reached"] == 2
    beams = answer["platform"]["compliance"]["beams"]
    each = [row["platform"]["compliance"]["beams"] for row in answer["poses"][:2]]
    assert beams["largest"] == max(each)
    assert beams["median"] == pytest.approx(sum(each) / 2)
    assert beams["at"] == answer["poses"][each.index(max(each))]["asked"]
    assert answer["costs"]["linear closures"]["known"] == 0
    _, out, _ = run(*words, "--grid", "tx=0:0.2:0.2,tz=-0.5")
    by_grid = json.loads(out)["platform"]["compliance"]["beams"]
    assert by_grid["largest"] == pytest.approx(beams["largest"])
    status, out, _ = run(*words[:4], "--grid", "tx=0:0.2:0.2,tz=-0.5")
    assert "over 2 of 2 poses, median and largest" in out
    assert "% at tx=" in out


@pytest.mark.parametrize(("words", "message"), [
    (["--grid", "tx=0", "--pose", "tx=0"], "expected only one of --pose (or --joint)"),
    (["--figure", "a.png"], "--figure: found without --solids"),
    (["--grid", "qx=0"], "unknown pose component"),
])  # fmt: skip
def test_mutually_exclusive_options_are_rejected(run, words, message):
    status, _, err = run("validation", "validity", "irsbot2", *words)
    assert status == 2
    assert message in err
