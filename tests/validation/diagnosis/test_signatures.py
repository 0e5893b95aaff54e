"""Test the conditions of a campaign and the residual of the declared model."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.model.function import Function
from forcefit.inputs.table import BadInput
from forcefit.validation.diagnosis.derivatives import Derivatives
from forcefit.validation.diagnosis.signatures import Tangents, conditions_of, whiten
from tests.bar_for_tests import bar, fit_of
from tests.planar_arm_for_tests import SIGMA


def test_gravity_equals_the_gravity_covariates():
    """Without these covariates, gravity is zero."""
    along = {"gravity.x": np.arange(8.0), "gravity.z": np.full(8, -9.81)}
    here = conditions_of(bar(**along))
    expected = np.column_stack([np.arange(8.0), np.zeros(8), np.full(8, -9.81)])
    assert here.gravity.tolist() == expected.tolist()
    assert not conditions_of(bar()).gravity.any()


@pytest.mark.parametrize("name", ["bed", "approach"])
@pytest.mark.parametrize("given", [True, False])
def test_function_of_a_covariate_requires_the_covariate(name, given):
    """The side of approach is not required, because the preceding rows determine it."""
    function = (
        Function("reading", ("tx",), ("q.drive",), "reversal", {"0": 1e-6})
        if name == "approach"
        else Function("reading", ("tx",), (f"cov.{name}",), "powers", {"1": 1e-6})
    )
    campaign = bar(**({name: np.ones(8)} if given else {}))
    robot = replace(campaign.robot, functions=(function,))
    campaign = replace(campaign, robot=robot)
    if given or name == "approach":
        assert len(conditions_of(campaign)) == 8
    else:
        with pytest.raises(BadInput, match=f"expected a column cov.{name}"):
            conditions_of(campaign)


def test_residual_equals_reading_minus_declared_prediction():
    """The declared length error is 0.1 mm, and the measured one is 0.3 mm."""
    plain = bar()
    errors = np.zeros((2, 6))
    errors[1, 3] = 1e-4
    seen = fit_of(plain, 3e-4)
    seen[2:4, 1] = np.nan
    robot = plain.robot.with_errors(errors)
    campaign = replace(plain, robot=robot, measured=seen)
    tangents = Tangents(campaign, Derivatives(conditions_of(campaign)))
    expected = (fit_of(plain, 2e-4) / SIGMA)[np.isfinite(seen)]
    found = whiten(campaign, campaign.measured) - tangents.declared
    assert found == pytest.approx(expected, abs=1e-9)
    assert len(tangents.declared) == 46
