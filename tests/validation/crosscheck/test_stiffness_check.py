"""K_C against load steps in Exudyn, also where forced assembly stiffens the robot."""

import json
from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture, place_robot
from assembly.robots import load_robot
from forcefit.inputs.table import BadInput
from tests.robots_for_tests import NUMBERS, irsbot2_with
from validation.crosscheck.stiffness_check import check_stiffness

pytestmark = pytest.mark.exudyn


@pytest.mark.parametrize(
    "name", ["hexapod", pytest.param("orthoglide", marks=pytest.mark.slow), "arm6"]
)
@pytest.mark.parametrize("links", ["spring", "beam"])
def test_robots_without_errors_are_as_stiff_in_the_simulation(name, links):
    """Nothing is bent there, so that beams are K_E too."""
    answer = check_stiffness(home_posture(load_robot(name)), links=links)
    assert answer.differences["exact"] < 1e-6
    assert answer.differences["linear"] < 1e-6


def test_a_forced_assembly_is_as_stiff_in_the_simulation():
    """At the paper's full errors: the classical matrix is off by 6 %, the tangent not.

    Springs of 1 N m/rad turn by 0.04 rad there, the square of which is 2e-3.
    """
    case = NUMBERS["cases"][1]
    posture = place_robot(irsbot2_with(case), {"tx": 0.1, "tz": -0.5})
    answer = check_stiffness(posture, [0, 0, 0, 100, 50, -300])
    assert answer.differences["linear"] > 0.05
    assert answer.differences["exact"] < 2e-5
    assert answer.passed


def test_what_is_left_under_a_load_falls_with_its_square():
    """The simulation applies a bent spring half-way between its ends."""
    posture = home_posture(load_robot("four_bar"))
    left = [
        check_stiffness(posture, [0, 0, 0, 0, -force, 0]).differences["exact"]
        for force in (100, 50)
    ]
    assert left[0] / left[1] == pytest.approx(4.0, rel=0.1)


def test_a_wrong_stiffness_is_found_out():
    answer = check_stiffness(home_posture(load_robot("four_bar")))
    assert answer.passed
    wrong = replace(answer.exact, root=answer.exact.root * (1 + 1e-5))
    assert not replace(answer, exact=wrong).passed


def test_a_moment_already_there_is_refused():
    with pytest.raises(BadInput, match="expected forces alone"):
        check_stiffness(home_posture(load_robot("four_bar")), [1.0, 0, 0, 0, 0, 0])


def test_the_command_says_what_it_compared(run):
    status, out, _ = run(
        "validation", "crosscheck", "four_bar", "--stiffness", "--load", "fy=-50",
        "--links", "spring", "--json", "-",
    )  # fmt: skip
    answer = json.loads(out)
    assert status == 0
    assert answer["passed"]
    assert np.array(answer["compliance"]["multibody"]).shape == (6, 6)
    status, _, err = run(
        "validation", "crosscheck", "four_bar", "--stiffness", "--clearances"
    )
    assert status == 2
    assert "--stiffness: not with" in err
