"""Every built-in robot, and those of the literature, frame by frame as bodies."""

from pathlib import Path

import numpy as np
import pytest

from assembly.files.robot_file import read_robot
from assembly.kinematics.mobility import mobility
from assembly.kinematics.posture import home_posture
from assembly.linear.energy import solve_assembly
from assembly.platform_stiffness.platform_stiffness import platform_stiffness
from assembly.robots import BUILT_IN, load_robot
from tests.drawn_robots_for_tests import as_drawn

SAME = 1e-12
LITERATURE = Path(__file__).parents[4] / "shared" / "cases" / "robots"
OTHERS = ("agile_err", "bennett", "exechon_err", "gpm_err", "prs", "snu_err",
          "tsai_err", "bolted_four_bar")  # fmt: skip


@pytest.fixture(params=[*BUILT_IN, *OTHERS])
def postures(request, tmp_path):
    """Of the robot of bodies and of that of frames, at home."""
    name = request.param
    if name in BUILT_IN:
        robot = load_robot(name)
    elif not (LITERATURE / f"{name}.toml").exists():
        pytest.skip(f"{LITERATURE} is not here")
    else:
        robot = read_robot(LITERATURE / f"{name}.toml")
    (tmp_path / "drawn.toml").write_text(as_drawn(robot))
    return home_posture(read_robot(tmp_path / "drawn.toml")), home_posture(robot)


def test_any_robot_can_be_written_as_bodies_and_joints(postures):
    """Place, stiffness, mobility, and the energy of its errors under its weight."""
    drawn, framed = postures
    at, expected = (posture.platform[:3, 3] for posture in postures)
    assert np.abs(at - expected).max() < SAME
    K, reference = (platform_stiffness(posture).stiffness for posture in postures)
    size = np.sqrt(np.abs(np.diag(reference)).clip(1e-12))
    assert np.abs((K - reference) / np.outer(size, size)).max() < SAME
    found, counted = (mobility(posture) for posture in postures)
    assert found.platform_freedoms == counted.platform_freedoms
    assert found.redundant_constraints == counted.redundant_constraints
    gravity = None if "snu" in framed.robot.name else [0, 0, -9.81]  # singular at home
    solved, least = (solve_assembly(p, gravity=gravity) for p in postures)
    # what is minimised is energy less work, which is up to 100 times as large
    most = least.energy + abs(least.work)
    assert abs(solved.energy - least.energy) <= SAME * most
    assert abs(solved.work - least.work) <= SAME * most
