"""Test forms of functions and their prior probabilities."""

import numpy as np
import pytest

from forcefit.validation.diagnosis import function_forms as forms
from forcefit.validation.diagnosis.signatures import conditions_of
from tests.bar_for_tests import bar

CONDITIONS = conditions_of(
    bar(rows=30, time=np.arange(30.0), temperature=np.linspace(-1, 2, 30) ** 2)
)


@pytest.mark.parametrize("name", ["q.drive", "time", "cov.temperature", "position.x"])
def test_prior_probabilities_of_all_forms_sum_to_one(name):
    found = forms.every(CONDITIONS, name)
    assert len(set(found)) == len(found)
    assert np.exp(forms.log_priors(found)).sum() == pytest.approx(1.0)


def test_forms_of_two_variables_can_be_stored_in_robot_files():
    from forcefit.assembly.effects.forms import FORMS

    pairs = [("q.drive", "time"), ("approach", "load.fz"), ("time", "position.x")]
    for first, second in pairs:
        variables, found = forms.of_two(CONDITIONS, first, second)
        assert set(variables) == {first, second}
        for shape in found:
            form = FORMS[shape.form]
            assert form.most >= 2
            assert all(form.is_column(name, 2) for name in shape.names)
