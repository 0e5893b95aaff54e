"""Forms of functions and their prior probabilities."""

import numpy as np
import pytest

from tests.bar_for_tests import bar
from validation.diagnosis import shapes
from validation.diagnosis.forms_tried import CandidateShape
from validation.diagnosis.signatures import conditions_of

CONDITIONS = conditions_of(
    bar(rows=30, time=np.arange(30.0), temperature=np.linspace(-1, 2, 30) ** 2)
)


@pytest.mark.parametrize("name", ["q.drive", "time", "cov.temperature", "position.x"])
def test_priors_of_all_forms_sum_to_one(name):
    found = shapes.every(CONDITIONS, name, "screw")
    assert len(set(found)) == len(found)
    assert np.exp(shapes.log_priors(found)).sum() == pytest.approx(1.0)


def test_prior_of_waves_falls_with_their_order():
    waves = [CandidateShape("waves", (f"{k}.sine", f"{k}.cosine")) for k in (1, 2, 9)]
    prior = np.exp(shapes.log_priors(waves))
    assert prior[0] / prior == pytest.approx([1.0, 2.0, 9.0])
    several = CandidateShape("waves", ("1.sine", "1.cosine", "4.sine", "4.cosine"))
    assert shapes.falling(several, 4) == pytest.approx([1.0, 1.0, 0.25, 0.25])


def test_general_forms_are_among_all_forms():
    for name in ("q.drive", "time", "cov.temperature"):
        every = shapes.every(CONDITIONS, name, "screw")
        assert set(shapes.first(CONDITIONS, name)) <= set(every)


def test_steps_are_tried_between_nearly_all_rows():
    steps = [s for s in shapes.every(CONDITIONS, "time", "screw") if s.form == "step"]
    levels = np.sort([dict(s.given)["at"] for s in steps])
    for jump in np.arange(3.5, 26.0):
        # rows on both sides of a jump are told apart by some level
        assert ((levels > jump - 0.5) & (levels <= jump + 0.5)).any()


def test_products_have_a_form_that_a_robot_file_can_store():
    from assembly.effects.forms import FORMS

    pairs = [("q.drive", "time"), ("approach", "load.fz"), ("time", "position.x")]
    for first, second in pairs:
        variables, found = shapes.of_two(CONDITIONS, first, second)
        assert set(variables) == {first, second}
        for shape in found:
            form = FORMS[shape.form]
            assert form.most >= 2
            assert all(form.is_column(name, 2) for name in shape.names)
