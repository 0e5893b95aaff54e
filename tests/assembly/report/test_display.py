"""Display of objects in a console or notebook."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forcefit import Clearance, read_campaign, solve_assembly, solve_exact, zone_margin
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.kinematics.singularity import find_singularities
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.pose_error import reachable_screws
from forcefit.assembly.report.results import solution_of, solution_text
from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.sections import round_section
from forcefit.stiffness.link import LinkStiffness
from tests.robots_for_tests import NUMBERS, coaxial_beams, irsbot2_with

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
LINES, CHARACTERS = 16, 1000


@pytest.fixture(scope="module")
def answer():
    robot = irsbot2_with(NUMBERS["cases"][0])
    return solve_assembly(place_robot(robot, pose={"tx": 0.1, "tz": -0.5}))


@pytest.fixture(scope="module")
def shown(answer):
    """Return one object of each type that users obtain."""
    C = beam_compliance(0.452, round_section(0.04, 0.3), 60e9, 0.3)
    link = LinkStiffness("Timoshenko beam", C, tip=[0.452, 0, 0], base=np.zeros(3))
    posture = answer.posture
    return [
        posture.robot, posture.robot.frames[0], posture, answer, solve_exact(posture),
        bound_pose_error(answer), zone_margin(posture),
        reachable_screws(answer, "free"),
        answer.linearisation, answer.joints, link,
        find_singularities(posture.robot, posture.transforms[None]),
        read_campaign(CAMPAIGNS / "self_weight"),
    ]  # fmt: skip


def test_text_of_every_result_object_is_a_few_lines_long(shown):
    """The default text of a dataclass would have thousands of characters. A table in a
    notebook has a row for each line of the text.
    """
    for thing in shown:
        text = repr(thing)
        assert len(text) <= CHARACTERS, type(thing)
        assert len(text.splitlines()) <= LINES, type(thing)
        assert text.startswith(type(thing).__name__)
        if hasattr(thing, "_repr_html_"):
            cells = re.findall(r"<td[^>]*>(.*?)</td>", thing._repr_html_())
            assert len(cells) == len(text.splitlines()) - 1


def test_assembly_summary_equals_the_lines_of_the_command(answer):
    printed = solution_text(solution_of(answer.posture))
    shown = answer.summary()
    for name in ("pose", "assembly energy", "platform error"):
        (said,) = re.findall(rf"^  {name}  +(.*)$", printed, flags=re.M)
        assert re.findall(rf"^  {name}  +(.*)$", shown, flags=re.M) == [said]
    assert answer.summary() == repr(answer)


def test_text_of_many_points_contains_their_number_and_the_maximum():
    """The margins of the points are 1, 2 and 4."""
    play = Clearance(axial=1e-5, radial=1e-5)
    at = home_posture(coaxial_beams(np.zeros(6), clearance=play))
    errors = np.zeros((3, 6, 6))
    errors[:, 2, 5] = [1e-5, 2e-5, 4e-5]
    zones = zone_margin(at, errors=errors)
    assert repr(zones) == (
        "Zone\n  points  3, 1 assemble rigidly\n  margin  at most 4 where finite"
    )
    bounds = bound_pose_error(solve_assembly(at, errors=errors))
    assert "points       3, 3 bounded" in repr(bounds)
    low, high = bounds.translation_error.max(axis=0)
    assert f"translation  {1e3 * low:.6g} to {1e3 * high:.6g} mm" in repr(bounds)


def test_text_contains_the_largest_force_and_error(answer):
    robot = answer.posture.robot
    forces = np.linalg.norm(answer.wrenches[:, 3:], axis=1)
    where = robot.frames[forces.argmax()].name
    assert f"{forces.max():.4g} N, in {where}" in repr(answer)
    turns, shifts = 1e3 * robot.errors[:, :3], 1e3 * robot.errors[:, 3:]
    turn, shift = (np.linalg.norm(e, axis=1).max() for e in (turns, shifts))
    assert f"largest error  {turn:.4g} mrad, {shift:.4g} mm" in repr(robot)


def test_names_from_files_are_escaped_in_notebooks(answer):
    robot = replace(answer.posture.robot, name="<script>&")
    table = robot._repr_html_()
    assert "&lt;script&gt;&amp;" in table
    assert "<script>" not in table
