"""Tests of the platform stiffness against Exudyn."""

import json
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.robots import load_robot
from forcefit.validation.crosscheck.stiffness_check import check_stiffness
from tests.robots_for_tests import NUMBERS, irsbot2_with, with_frames

pytestmark = pytest.mark.exudyn

SLOW = ("hexapod", "orthoglide", "arm6")


@pytest.mark.parametrize(
    "name", ["four_bar", *(pytest.param(n, marks=pytest.mark.slow) for n in SLOW)]
)
@pytest.mark.parametrize("links", ["spring", "beam"])
def test_stiffness_without_errors_agrees_with_the_simulation(name, links):
    """Without errors, beams are straight and their stiffness is K_E."""
    answer = check_stiffness(home_posture(load_robot(name)), links=links)
    assert answer.differences["linearised"] < 1e-8
    assert answer.differences["exact"] < 1e-6
    assert answer.differences["linear"] < 1e-8


@pytest.mark.slow
def test_stiffness_of_a_forced_assembly_agrees_with_the_simulation():
    """At the full errors of the paper, the nominal compliance has an error of 5 %."""
    case = NUMBERS["cases"][1]
    posture = place_robot(irsbot2_with(case), {"tx": 0.1, "tz": -0.5})
    answer = check_stiffness(posture, [20, 10, -5, 100, 50, -300])
    assert answer.differences["linear"] > 0.05
    assert answer.differences["linearised"] < 1e-7
    assert answer.differences["exact"] < 1e-6
    assert answer.passed


@pytest.mark.parametrize("force", [-100, 50])
def test_stiffness_of_a_loaded_robot_agrees_with_the_simulation(force):
    answer = check_stiffness(
        home_posture(load_robot("four_bar")), [0, 0, 0, 0, force, 0]
    )
    assert answer.differences["linear"] > 1e-2
    assert answer.differences["linearised"] < 1e-8
    assert answer.differences["exact"] < 1e-6
    assert answer.passed


def test_tangential_stiffness_of_a_pin_in_contact_equals_closed_form():
    """The stiffness is F / c, in series with that of the arm."""
    force, bound, k = 300.0, 5e-5, 1e6
    link = MatrixLink(np.diag([1e4, 1e4, 1e4, k, k, k]))
    frames = (
        Frame("arm", translation=[0.5, 0, 0], link=link),
        Frame("pin", "arm", clearance=Clearance(radial=bound, axial=0.0, tilt=0.0)),
        Frame("tip", "pin", [0.1, 0, 0]),
    )
    posture = home_posture(Robot("pin", "tip", frames, ()))
    answer = check_stiffness(posture, [0, 0, 0, force, 0, 0], clearances=True)
    assert answer.passed
    assert np.isnan(answer.simulated.stepped).all()
    # the force that rotates the arm changes this by less than 1e-3
    along = 1 / k + bound / force + 0.1**2 / 1e4
    assert answer.simulated.linearised[4, 4] == pytest.approx(along, rel=1e-2)
    assert answer.differences["linearised"] < 1e-3
    assert answer.tolerance == 2e-2


def test_stiffness_check_fails_for_a_wrong_stiffness():
    answer = check_stiffness(home_posture(load_robot("four_bar")))
    assert answer.passed
    wrong = replace(answer.exact, root=answer.exact.root * (1 + 1e-5))
    assert not replace(answer, exact=wrong).passed


def test_stiffness_of_divided_links_converges_to_that_of_beams():
    """The error of n elements is proportional to 1/n^2."""
    robot, off = load_robot("four_bar"), []
    for pieces in (1, 2, 4):
        links = {f.name: replace(f.link, pieces=pieces) for f in robot.frames if f.link}
        cut = home_posture(robot.with_links(links))
        answer = check_stiffness(cut, [0, 0, 0, 20, 0, -100], links="beam")
        assert ('"pieces" of the link' in answer.text()) == (not answer.passed)
        off.append(answer.differences["linearised"])
    assert off[0] == pytest.approx(0.02, rel=0.1)
    assert np.array(off[:-1]) / off[1:] == pytest.approx(4.0, rel=0.1)


def test_stiffness_check_reports_a_different_equilibrium_of_the_simulation():
    answer = check_stiffness(home_posture(load_robot("four_bar")), [0, 0, 0, 0, 50, 0])
    assert answer.moved == pytest.approx(answer.simulated_moved, abs=1e-9)
    there = answer.simulated.platform.copy()
    there[:3, 3] += 0.2 * answer.moved[3:]
    elsewhere = replace(answer.simulated, platform=there, stable=False)
    # A different equilibrium has no effect if the compliances agree.
    assert replace(answer, simulated=elsewhere).passed
    stiffer = replace(elsewhere, linearised=0.5 * elsewhere.linearised)
    other = replace(answer, simulated=stiffer)
    assert not other.passed
    assert other.another_equilibrium
    assert "undecided: the two models are at different equilibria" in other.text()
    assert "(unstable)" in other.text()
    stiffer = replace(answer.simulated, linearised=0.5 * elsewhere.linearised)
    other = replace(answer, simulated=stiffer)
    assert not other.another_equilibrium
    assert "FAILED" in other.text()


def test_stiffness_check_reports_a_joint_that_is_locked_and_elastic():
    K = np.diag([np.inf, 1e3, 1e3, np.inf, np.inf, 1e6])
    robot = with_frames(
        load_robot("four_bar"), lambda f: f.name == "crank_pin", joint_stiffness=K
    )
    answer = check_stiffness(home_posture(robot))
    assert answer.mixed == ()
    bent = replace(answer, bent=True)
    assert bent.mixed == ("crank_pin",)
    assert not bent.passed
    assert "undecided: crank_pin" in bent.text()


def test_crosscheck_of_stiffness_reports_both_compliances(run, rejected):
    status, out, _ = run(
        "validation", "crosscheck", "four_bar", "--state", "exact", "--load", "fy=-50",
        "--links", "spring", "--json", "-",
    )  # fmt: skip
    answer = json.loads(out)
    assert status == 0
    assert answer["passed"]
    assert np.array(answer["compliance"]["multibody"]).shape == (6, 6)
    words = ["validation", "crosscheck", "four_bar", "--state", "exact"]
    assert "--state: found together with" in rejected(*words, "--figure", "x.png")
