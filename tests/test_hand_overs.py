"""Files hand each other what is stored, see ``hand_overs_for_tests.py``."""

import json

import pytest

from tests.answers_for_tests import QUESTIONS, close
from tests.hand_overs_for_tests import STORED, hand_overs

KNOWN = json.loads(STORED.read_text())
RELATIVE = 1e-6
LONG = ("diagnosis stand",)  # others of its kind are asked always


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n in LONG)) for n in KNOWN]
)
def test_files_hand_over_what_is_stored(name):
    stored, now = KNOWN[name], hand_overs(QUESTIONS[name], 0.0)
    other = {
        place: (was, now.get(place))
        for place, was in stored.items()
        if not close(was, now.get(place), RELATIVE)
    }
    assert not other
