"""K_C by virtual joints against the links' finite elements themselves."""

import json

import numpy as np
import pytest

from assembly.files.robot_file import write_robot
from assembly.kinematics.posture import home_posture
from assembly.linear.reduction import FreeMotion
from assembly.model.links import link_compliance
from assembly.model.robot import BeamLink, Frame, Robot
from validation.assumptions.platform_cost import (
    NoSolids,
    difference,
    platform_cost,
    solid_compliance,
)
from validation.assumptions.solid_links import prism, solid_link

ROUND = BeamLink({"radius": 0.05}, 70e9, 0.3)
SPRINGS = np.diag([3e5, 2e5, 1e5, 1e8, 2e8, 3e8])


def triangle():
    """Two short round bars from a wall to one platform, on springs, one thicker."""
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


@pytest.mark.parametrize(
    ("section", "volume"),
    [
        ({"radius": 0.1}, 32 * np.sin(2 * np.pi / 64) * 0.01),
        ({"radius": 0.1, "inner_radius": 0.06}, 32 * np.sin(np.pi / 32) * 0.0064),
        ({"width": 0.1, "height": 0.3}, 0.03),
    ],
)
def test_a_prism_is_closed_and_has_its_volume(section, volume):
    """By the divergence theorem, whose sum is that only of a closed surface."""
    surface = prism(section)
    corners = surface.points[surface.triangles] - [0.3, 0.2, 0.1]
    volumes = np.linalg.det(corners) / 6
    assert volumes.sum() == pytest.approx(volume, rel=1e-12)
    directed = surface.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    there, back = ({tuple(edge) for edge in d} for d in (directed, directed[:, ::-1]))
    assert there == back


def test_a_solid_moved_as_a_whole_costs_nothing_and_else_is_a_beam():
    """Square section 1 x 2, length 6: K_E within the few per cent of its held ends."""
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
def test_virtual_joints_lose_nothing_of_solids_that_act_at_their_ends(posture):
    """Condensed K_E against the displacement method over all bodies: rounding."""
    cost = platform_cost(posture)
    assert cost.meshed < 1e-9
    assert 1e-3 < cost.beams < 0.1
    assert 1e-3 < cost.ends < 0.3
    assert list(cost.by_link) == ["stout", "slim"]  # the shorter for its thickness


@pytest.mark.slow
def test_one_link_costs_the_platform_what_it_costs_itself():
    frame = Frame("tip", translation=[0.3, 0.0, 0.0], link=ROUND)
    posture = home_posture(Robot("cantilever", "tip", (frame,)))
    solid = solid_link(frame)
    expected = np.linalg.inv(solid.condensed)
    np.testing.assert_allclose(
        solid_compliance(posture, {"tip": solid}), expected, rtol=1e-7, atol=1e-15
    )
    cost = platform_cost(posture)
    assert cost.beams == pytest.approx(difference(link_compliance(frame), expected))
    assert cost.by_link == {"tip": pytest.approx(cost.beams)}


def test_what_cannot_be_compared_is_refused():
    rigid = Robot("rigid", "tip", (Frame("tip", translation=[0.3, 0, 0]),))
    with pytest.raises(NoSolids, match="no link has a shape"):
        platform_cost(home_posture(rigid))
    arm = Frame("arm", translation=[0.3, 0, 0], link=ROUND, joint="revolute")
    free = Robot("arm", "hand", (arm, Frame("hand", "arm")))
    with pytest.raises(FreeMotion, match="nothing resists the platform's motion"):
        platform_cost(home_posture(free))


@pytest.mark.slow
def test_the_command_names_the_link_that_costs_most(run, tmp_path):
    path = tmp_path / "triangle.toml"
    write_robot(triangle(), path)
    status, out, _ = run(
        "validation", "validity", str(path), "--solids", "--load", "fz=-100", "--json",
        "-",
    )  # fmt: skip
    answer = json.loads(out)
    assert status == 0
    assert answer["platform"]["compliance"]["meshed"] < 1e-9
    assert next(iter(answer["platform"]["by_link"])) == "stout"
