"""Test extrapolation errors of functions against refits."""

from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.validation.diagnosis.candidates import Candidate, CandidatePart
from forcefit.validation.diagnosis.function_forms import CandidateShape
from forcefit.validation.diagnosis.gaussian import marginalise
from forcefit.validation.diagnosis.range_parts import PARTS, range_error
from forcefit.validation.diagnosis.signatures import conditions_of
from tests.campaigns_for_tests import campaign_of

ROWS = 60


def function_of(variable):
    part = CandidatePart("reading", ("tx",), variable)
    return Candidate((part,), "screw", CandidateShape("powers", ("1",)))


def model(columns, std, z, wet):
    campaign = campaign_of(np.zeros((ROWS, 6)), wet=wet)
    readings = SimpleNamespace(
        columns=SimpleNamespace(conditions=conditions_of(campaign))
    )
    flat = np.full((ROWS, 1), ROWS**-0.5)
    columns = columns - flat @ (flat.T @ columns)
    z = z - flat[:, 0] * (flat[:, 0] @ z)
    return SimpleNamespace(
        readings=readings, marginal=marginalise(columns, std, z, flat)
    )


def refitted(columns, std, z, wet):
    """Return the rms error of parts of the range, each predicted from the others."""
    X = np.column_stack([columns, np.ones(ROWS)])
    precision = np.diag([*(std**-2.0), 0.0])
    order = np.argsort(np.argsort(wet))
    left = np.empty(ROWS)
    for part in range(PARTS):
        own = order * PARTS // ROWS == part
        A = X[~own]
        x = np.linalg.solve(A.T @ A + precision, A.T @ z[~own])
        left[own] = z[own] - X[own] @ x
    return np.sqrt(np.mean(left**2))


def test_extrapolation_errors_equal_those_of_refits():
    rng = np.random.default_rng(8)
    wet = rng.uniform(0, 3, ROWS)
    z = rng.normal(size=ROWS) + 3 * wet
    waves = np.column_stack([np.sin(k * wet) for k in (2, 5, 9)])
    std = np.array([4.0, 2.0, 1.0])
    nothing = np.zeros((ROWS, 0))
    found = range_error(
        function_of("cov.wet"),
        model(waves, std, z, wet),
        model(nothing, np.zeros(0), z, wet),
        np.arange(ROWS),
    )
    assert found.variable == "cov.wet"
    assert found.after == pytest.approx(refitted(waves, std, z, wet), rel=1e-9)
    assert found.without == pytest.approx(refitted(nothing, np.zeros(0), z, wet))


def test_extrapolation_error_is_none_for_few_distinct_values():
    wet = np.repeat([0.0, 1.0], ROWS // 2)
    one = model(wet[:, None], np.ones(1), wet, wet)
    assert range_error(function_of("cov.wet"), one, one, np.arange(ROWS)) is None
