"""``assembly error`` at a point and along a direction; ``exact`` under gravity."""

import json

import numpy as np
import pytest

from assembly.energy import solve_assembly
from assembly.exact import solve_exact
from assembly.pose_error import bound_pose_error
from assembly.posture import home_posture, place_robot
from assembly.reach import reachable_screws
from assembly.robots import load_robot

ROBOT = ["irsbot2", "--pose", "tx=0.1,tz=-0.5"]


def test_a_point_of_the_platform_and_a_direction(run):
    status, out, _ = run(
        "assembly", "error", *ROBOT, "--reading", "free", "--point", "x=0.1,z=-0.05",
        "--direction", "tx=1,tz=-1", "--json", "-",
    )  # fmt: skip
    assert status == 0
    found = json.loads(out)
    posture = place_robot(load_robot("irsbot2"), pose={"tx": 0.1, "tz": -0.5})
    offset = posture.platform[:3, :3] @ [0.1, 0, -0.05]
    answer = solve_assembly(posture)
    expected = bound_pose_error(answer, "free", offset=offset)
    error = found["error"]["free"]
    assert error["translation"]["lower"] == pytest.approx(
        expected.translation_error[0], abs=1e-9
    )
    direction = np.array([0, 0, 0, 1, 0, -1]) / np.sqrt(2)
    assert found["direction"] == pytest.approx(direction.tolist())
    support = reachable_screws(answer, "free").at_point(offset).support(direction)
    assert error["along"]["upper"] == pytest.approx(support.height, rel=1e-9)
    assert error["along"]["lower"] == pytest.approx(support.height, rel=1e-6)
    screw = error["along"]["platform_screw"]
    assert direction @ screw == pytest.approx(error["along"]["lower"])
    assert error["along"]["upper"] <= error["translation"]["upper"]


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--point", "tx=1"], '--point: unknown component "tx"; valid: x, y, z'),
        (["--direction", "mx=1"], '--direction: unknown component "mx"'),
        (["--direction", "tx=0"], "expected components of a translation or of a rot"),
        (["--direction", "tx=1,rz=1"], "expected components of a translation or of"),
    ],
)
def test_what_is_no_point_or_direction_is_refused(run, option, message):
    status, out, err = run("assembly", "error", *ROBOT, *option)
    assert status == 2
    assert out == ""
    assert message in err


def test_exact_under_gravity_and_the_linearisation_error_of_a_weight(run):
    gravity = ["--gravity", "z=-9.81", "--json", "-"]
    _, out, _ = run("assembly", "exact", "arm6", *gravity)
    exact = json.loads(out)
    here = solve_exact(home_posture(load_robot("arm6")), gravity=[0, 0, -9.81])
    assert exact["platform_screw"] == pytest.approx(here.platform_screw.tolist())
    assert exact["platform_screw"][5] < -5e-4
    _, out, _ = run("assembly", "solve", "arm6", *gravity)
    linear = json.loads(out)
    assert linear["linearisation_error"]["status"] == "ok"
    off = np.subtract(linear["platform_screw"], exact["platform_screw"])
    assert linear["linearisation_error"]["translation"] == pytest.approx(
        off[3:].tolist(), abs=1e-15
    )
