"""The platform's compliance by Exudyn's linearised system."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.platform_stiffness.linear_tangent import without_clearance
from assembly.robots import load_robot
from validation.crosscheck.link_models import link_models
from validation.multibody.linearised import linearised_compliance

pytestmark = pytest.mark.exudyn


@pytest.mark.parametrize("links", ["spring", "beam"])
@pytest.mark.parametrize("name", ["four_bar", "orthoglide"])
def test_it_is_the_classical_compliance(name, links):
    """Its derivatives are differences: 1e-5 of sqrt(C_ii C_jj), 2e-6 at most seen."""
    posture = home_posture(load_robot(name))
    expected = without_clearance(posture).compliance
    simulated = linearised_compliance(posture, link_models(posture.robot, links))
    size = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        simulated / np.outer(size, size), expected / np.outer(size, size), atol=1e-5
    )


def test_errors_and_clearances_do_not_count():
    posture = home_posture(load_robot("four_bar"))
    robot = posture.robot
    errors = np.full((len(robot.frames), 6), 1e-4)
    model = link_models(robot, "spring")
    nominal = linearised_compliance(posture, model)
    erring = linearised_compliance(
        replace(posture, robot=robot.with_errors(errors)), model
    )
    np.testing.assert_array_equal(erring, nominal)
