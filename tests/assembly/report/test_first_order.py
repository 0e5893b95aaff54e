"""Status of results at singular postures."""

import math
import re

import numpy as np
import pytest

from forcefit import BeamLink, run_study, write_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.report.pose_errors import pose_error_of, pose_error_text
from forcefit.assembly.report.results import solution_of, solution_text
from forcefit.validation.study.headline import verdict
from forcefit.validation.study.study_file import read_study
from tests.linkages_for_tests import SLIDER_CRANK, slider_crank
from tests.three_upu_for_tests import HEIGHT, three_upu

SAID = "singular posture: the first-order analysis is inconclusive; finite motions: 0 J"


def test_energy_at_a_singular_posture_is_that_of_the_exact_solution():
    """The first-order solution would have zero energy."""
    results = solution_of(home_posture(three_upu(seed=1)))
    assert results["energy"] > 1e-4
    assert results["status"] == "singular"
    assert results["reason"].startswith(SAID)
    assert SAID in solution_text(results)


def test_robot_without_errors_has_zero_energy_at_a_singular_posture():
    results = solution_of(home_posture(three_upu()))
    assert results["status"] == "ok"
    assert results["energy"] == 0.0


def test_regular_posture_has_a_first_order_solution():
    aside = {"tx": 0.05, "ty": 0.02, "tz": HEIGHT}
    assert solution_of(place_robot(three_upu(seed=1), pose=aside))["status"] == "ok"


@pytest.mark.parametrize("seed", [None, 1])
def test_singular_posture_has_no_pose_error_bounds(seed):
    results = pose_error_of(home_posture(three_upu(seed)), ["frozen"])
    assert results["status"] == "singular"
    assert results["error"] is None
    assert SAID in pose_error_text(results)


def test_rod_near_its_dead_centre_has_status_singular():
    """Near its dead centre, a rod with the length error e has the energy k (e - s)^2 /
    2.

    Here, s = crank + rod - distance. The first-order solution has zero energy.
    """
    angle, short, (crank, length) = 0.02, 2e-4, SLIDER_CRANK
    rod = BeamLink({"radius": 0.01}, 70e9, 0.33)
    down = math.asin(crank * math.sin(angle) / length)
    slack = crank * (1 - math.cos(angle)) + length * (1 - math.cos(down))
    stiffness = 70e9 * math.pi * 0.01**2 / length
    results = solution_of(home_posture(slider_crank(angle, rod, -short)))
    assert results["energy"] == pytest.approx(0.0, abs=1e-9)
    assert results["status"] == "singular"
    expected = stiffness * (short - slack) ** 2 / 2
    said = re.search(r"finite motions: ([\d.e+-]+) J", results["reason"])
    assert float(said[1]) == pytest.approx(expected, rel=1e-3)


def test_large_first_order_motion_has_status_singular():
    """At 0.1 mm from the singular axis, the first-order rotation is several radians."""
    aside = {"tx": 1e-4, "ty": 0.0, "tz": HEIGHT}
    results = solution_of(place_robot(three_upu(seed=1), pose=aside))
    assert np.abs(results["platform_screw"][:3]).max() > 0.3
    assert results["status"] == "singular"


def test_study_at_a_singular_posture_does_not_pass(tmp_path):
    write_robot(three_upu(seed=1), tmp_path / "snu.toml")
    (tmp_path / "study.toml").write_text(
        'robot = "snu.toml"\n[checks]\ncrosscheck = false\n', encoding="utf-8"
    )
    results = run_study(read_study(tmp_path / "study.toml", tmp_path / "out"))
    assert not results.passed
    assert results.error == {}
    assert verdict(results).startswith(SAID[0].upper() + SAID[1:])
    assert np.isfinite(results.solution["energy"])
