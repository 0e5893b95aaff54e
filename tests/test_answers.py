"""Answers are those that are stored, see ``answers_for_tests.py``."""

import json

import pytest

from forcefit.native.libraries import by_numba
from tests.answers_for_tests import QUESTIONS, STORED, close, leaves

ANSWERS = json.loads(STORED.read_text())
RELATIVE = 1e-6
BOUNDS = 1e-4  # bounds may differ by the tolerance asked for, 1e-6 of some hundredths
LINEAR = ("linear", "loaded", "drawn", "at once", "of any kind", "placed")
# others of their kind are asked always
LONG = ("tube",)


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.slow] * (n in LONG)) for n in QUESTIONS],
)
def test_answers_are_those_stored(name):
    assert not unlike_those_stored(name)


@pytest.mark.parametrize("name", [n for n in QUESTIONS if n.startswith(LINEAR)])
def test_answers_are_the_same_without_a_compiler_for_cpp(name):
    """The same loops by numba, which a machine without one uses."""
    with by_numba():
        assert not unlike_those_stored(name, BOUNDS)


def unlike_those_stored(name, relative=RELATIVE):
    stored, now = ANSWERS[name], leaves(QUESTIONS[name](0.0))
    return {
        place: (was, now.get(place))
        for place, was in stored.items()
        if not close(was, now.get(place), relative)
    }
