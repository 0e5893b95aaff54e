"""Tests of the curves of functions."""

import json
from math import sin

import numpy as np
import pytest

from tests.assembly.files.test_effect_file import arm_with
from tests.assembly.files.test_function_file import FORMULA, PUBLIC

BANDED = PUBLIC.replace("session =", 'std = { "1.sine" = 2e-6 }\nsession =')
LAG = """name = "function"
where = "tool"
components = ["tx"]
variables = ["cov.temperature"]
form = "lag"
parameters = { gain = 1e-6, time_constant = 200.0 }
"""


def explained(tmp_path, run, *words, effects=(BANDED, FORMULA, LAG)):
    file = tmp_path / "curves.json"
    path = str(arm_with(tmp_path, *effects))
    code, text, error = run("validation", "explain", path, "--json", str(file), *words)
    assert (code, error) == (0, "")
    return text, json.loads(file.read_text())["functions"]


def test_explained_curves_equal_their_functions_and_deviations(tmp_path, run):
    text, (wave, formula, lag) = explained(tmp_path, run)
    x = np.array(wave["x"])
    assert (x[0], x[-1]) == pytest.approx((-np.pi, np.pi))
    expected = 1.2e-4 * np.sin(x) - 3e-5 * np.cos(x)
    assert wave["value"] == pytest.approx(expected, abs=1e-18)
    assert wave["std"] == pytest.approx(2e-6 * np.abs(np.sin(x)), abs=1e-18)
    assert wave["units"] == {"variable": "rad", "value": "rad"}
    assert [p["unit"] for p in wave["parameters"]] == ["rad", "rad"]
    assert formula["value"][20] == pytest.approx(1e-4 * sin(3 * x[20]) + 2e-5)
    late = np.array(lag["x"])
    assert lag["value"] == pytest.approx(1e-6 * (1 - np.exp(-late / 200)), abs=1e-18)
    assert lag["parameters"][0]["unit"] == "m/K"
    assert lag["variable"] == "time"
    assert "gear of the drive: screw rz at drive" in text


def test_explain_accepts_a_range_and_writes_a_figure(tmp_path, run):
    figure = tmp_path / "curves.svg"
    _, (wave, *_) = explained(
        tmp_path, run, "--over", "q.drive=0:1", "--figure", str(figure)
    )
    assert (wave["x"][0], wave["x"][-1]) == (0.0, 1.0)
    assert figure.read_text().count("gear of the drive") >= 1


def test_function_of_two_variables_has_three_curves(tmp_path, run):
    both = (
        LAG
        .replace('"lag"', '"powers"')
        .replace('["cov.temperature"]', '["q.drive", "load.fy"]')
        .replace("gain = 1e-6, time_constant = 200.0", '"1.1" = 1e-6')
    )
    _, found = explained(tmp_path, run, effects=(both,))
    assert [c["beside"] for c in found] == [{"load.fy": v} for v in (-100, 0, 100)]
    assert found[2]["value"] == pytest.approx(1e-4 * np.array(found[2]["x"]))


@pytest.mark.parametrize(("words", "effects", "message"), [
    ((), (), "found no learned function"),
    (("--over", "q.driv=0:1"), (PUBLIC,), 'did you mean "q.drive"'),
    (("--over", "q.drive=1:0"), (PUBLIC,), "expected MINIMUM:MAXIMUM"),
])  # fmt: skip
def test_explain_rejects_invalid_functions_and_ranges(
    words, effects, message, tmp_path, rejected
):
    path = arm_with(tmp_path, *effects)
    assert message in rejected("validation", "explain", path, *words)
