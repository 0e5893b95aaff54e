"""A learned function as a formula a person can read."""

import pytest

from assembly.model.function import Function
from validation.diagnosis.sentence import formula


@pytest.mark.parametrize(
    ("form", "parameters", "expected"),
    [
        ("powers", {"0": 1e-3, "1": 2e-3, "3": -4e-3},
         "rz = 0.001 + 0.002 drive + -0.004 drive^3"),
        ("waves", {"1.sine": 2e-5, "2.cosine": 3e-5},
         "rz = 2e-05 sin(1 drive) + 3e-05 cos(2 drive)"),
    ],
)  # fmt: skip
def test_numbers_stand_before_what_they_multiply(form, parameters, expected):
    function = Function("drive", ("rz",), ("q.drive",), form, parameters)
    assert formula(function) == expected
