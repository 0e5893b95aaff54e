"""What is judged of the fit of the best set."""

from types import SimpleNamespace

import numpy as np

from validation.diagnosis import judge


def test_small_terms_behind_a_fit_count_as_unknowns_by_what_the_readings_say(
    monkeypatch,
):
    """Of 3.6 small unknowns known by the readings 4 degrees of freedom are gone."""
    monkeypatch.setattr(judge, "lack_of_fit", lambda *asked: asked)
    behind = SimpleNamespace(left=lambda residual: 0.5 * residual, unknowns=3.6)
    fit = SimpleNamespace(residual=np.array([2.0, -4.0]))
    selection = SimpleNamespace(behind=behind, unknowns=5, fit=fit)
    settled = SimpleNamespace(fitting="rows", inflation=3.0)
    rows, left, unknowns = judge._lack_of_fit(settled, selection)
    assert rows == "rows"
    np.testing.assert_array_equal(left, [3.0, -6.0])
    assert unknowns == 9
