"""Results equal the stored results; see ``answers_for_tests.py``."""

import json

import pytest

from tests.answers_for_tests import QUESTIONS, STORED, close, leaves

ANSWERS = json.loads(STORED.read_text())
RELATIVE = 1e-6
# slow results; similar results are always compared
LONG = ("tube",)


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.slow] * (n in LONG)) for n in QUESTIONS],
)
def test_results_equal_stored_results(name):
    assert not unlike_those_stored(name)


def unlike_those_stored(name):
    stored, now = ANSWERS[name], leaves(QUESTIONS[name](0.0))
    return {
        place: (was, now.get(place))
        for place, was in stored.items()
        if not close(was, now.get(place), RELATIVE)
    }
