"""Unknowns of a session and their prior sizes."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.model.function import Function
from forcefit.assembly.robots import load_robot
from forcefit.validation.correction.session_unknowns import (
    session_unknowns,
)

DRIFT = {"amplitude.tx": 3e-5, "amplitude.tz": -4e-5, "time_constant": 900.0}
STEP = Function("reading", ("tx",), ("cov.time",), "step", {"size": 2e-5, "at": 600.0})
SPRING = Function("base", ("rz",), ("load.mz",), "powers", {"1": 1e-6})
FORMULA = replace(STEP, form="formula", formula="a*time", parameters={"a": 1e-9})


@pytest.fixture
def saved():
    return replace(
        load_robot("arm6"),
        effects={"drift": DRIFT, "registration": {"base.tx": 0.1, "tool.tx": 0.02}},
        functions=(STEP, SPRING, FORMULA),
    )


def test_session_drift_starts_at_its_saved_value_and_a_step_at_zero(saved):
    """The rms of 3 and 4 is 5 / sqrt 2. Shape parameters are kept, and a formula is not
    fitted."""
    unknowns = session_unknowns(saved, (), clock=True)
    names = [name for _, name in unknowns.names]
    assert names == ["amplitude.tx", "amplitude.tz", "size"]
    assert unknowns.mean.tolist() == [3e-5, -4e-5, 0.0]
    sizes = unknowns.prior**-0.5
    assert sizes == pytest.approx([5e-5 / 2**0.5, 5e-5 / 2**0.5, 2e-5])
    x = np.array([1e-5, 2e-5, 7e-6])
    assert unknowns.effects(x)["drift"] == {
        "amplitude.tx": 1e-5, "amplitude.tz": 2e-5, "time_constant": 900.0,
    }  # fmt: skip
    (step,) = unknowns.functions_with(x, "today")
    assert step.parameters == {"size": 7e-6, "at": 600.0}
    assert step.session == "today"


def test_prior_size_of_each_power_of_time_is_its_saved_value(saved):
    """1e-4 m and 1e-12 m/s^3 have no common unit."""
    numbers = {"0": 1e-4, "1": 2e-8, "3": 1e-12}
    cubic = Function("reading", ("tx",), ("time",), "powers", numbers)
    robot = replace(saved, effects={}, functions=(cubic,))
    unknowns = session_unknowns(robot, (), clock=True)
    assert unknowns.prior**-0.5 == pytest.approx([1e-4, 2e-8, 1e-12])
