"""Values and units of formulas, and rejection of invalid formulas."""

import math

import numpy as np
import pytest

from forcefit.assembly.effects.formula import (
    evaluate,
    names_in,
    parameter_units,
    parse_formula,
    unit_text,
)
from forcefit.inputs.errors import BadInput

M, N, S = {"m": 1}, {"N": 1}, {"s": 1}


@pytest.mark.parametrize("text", [
    "a*sin(3*q) + b", "-q**2/(1 + abs(q))", "exp(-q/b)*cos(pi*q) - sqrt(a)", "2",
    "tanh(a*q)*sign(q) + log(b)", "a**q", "atan(q) - tan(q/4)", "+a",
])  # fmt: skip
def test_formula_value_equals_python_eval(text):
    known = {"q": 0.7, "a": 1.3, "b": 2.5}
    names = {n: getattr(math, n) for n in ("sin", "cos", "tan", "exp", "log", "tanh",
             "sqrt", "pi", "atan")}  # fmt: skip
    expected = eval(text, {"__builtins__": {}, "abs": abs, **names,
                    "sign": lambda x: math.copysign(1, x)}, known)  # fmt: skip
    arrays = {k: np.asarray(v) for k, v in known.items()}
    assert float(evaluate(parse_formula(text), arrays)) == pytest.approx(expected)


@pytest.mark.parametrize("text", [
    "", "q +", "__import__('os').system('true')", "q.real", "q[0]", "lambda: 1",
    "q if q else 1", "[q]", "'q'", "q > 1", "sin(q, q)", "sin(x=q)", "sin", "True",
    "q := 1", "f(q)", "1e999*q", "(" * 90 + "q" + ")" * 90, "-" * 90 + "q", "q" * 600,
    "q; q", "1j", "a and b", "q % 2", "q // 2",
])  # fmt: skip
def test_text_that_is_not_a_formula_is_rejected(text):
    if text == "sin":  # A function name without brackets is treated as a variable.
        assert names_in(parse_formula(text)) == ["sin"]
    elif text.startswith("(("):  # Repeated brackets do not increase the depth.
        assert names_in(parse_formula(text)) == ["q"]
    else:
        with pytest.raises(BadInput):
            parse_formula(text)


@pytest.mark.parametrize(("text", "variables", "result", "units"), [
    ("a*sin(3*q) + b", {"q": {}}, {}, {"a": "1", "b": "1"}),
    ("a*exp(-t/c)", {"t": S}, M, {"a": "m", "c": "s"}),
    ("a*f**2 + b*f", {"f": N}, M, {"a": "m/N^2", "b": "m/N"}),
    ("sqrt(a)*t", {"t": S}, M, {"a": "m^2/s^2"}),
    ("a/(1 + (f/b)**2)", {"f": N}, {}, {"a": "1", "b": "N"}),
    ("1e-4*sin(q)", {"q": {}}, M, {}),
    ("a*b*t", {"t": S}, {}, {"a": "1/s", "b": "1"}),
])  # fmt: skip
def test_parameter_units_follow_from_variables_and_result(
    text, variables, result, units
):
    found = parameter_units(parse_formula(text), variables, result)
    assert {name: unit_text(unit) for name, unit in found.items()} == units


@pytest.mark.parametrize(("text", "variables", "result"), [
    ("sin(t)", {"t": S}, {}), ("q + t", {"q": {}, "t": S}, {}), ("t", {"t": S}, M),
    ("a*t + a", {"t": S}, {}), ("2**t", {"t": S}, {}), ("t**q", {"t": S, "q": {}}, M),
    ("exp(2*t)", {"t": S}, {}),
])  # fmt: skip
def test_formula_with_inconsistent_units_is_rejected(text, variables, result):
    with pytest.raises(BadInput, match="units clash"):
        parameter_units(parse_formula(text), variables, result)


@pytest.mark.parametrize("around", ["-{}", "+{}", "abs({})", "(a+{})", "({}*a)"])
def test_formula_nested_deeper_than_fifty_operations_is_rejected(around):
    """Operations are nested on both sides."""
    text = "q"
    for _ in range(50):
        text = around.format(text)
    parse_formula(text)
    with pytest.raises(BadInput, match="nested deeper than 50"):
        parse_formula(around.format(text))


def test_formula_longer_than_500_characters_is_rejected():
    parse_formula("q" * 500)
    with pytest.raises(BadInput, match="found 501 characters"):
        parse_formula("q" * 501)


def test_unit_exponents_of_powers_add_up():
    """The result (a t)^2 sqrt(b t) / t is a length."""
    tree = parse_formula("(a*t)**2*t**0.5*sqrt(b)/t")
    found = parameter_units(tree, {"t": S}, M)
    a, b = ({**dict.fromkeys("ms", 0), **found[name]} for name in "ab")
    for unit, exponent in (("m", 1), ("s", -1.5)):
        assert 2 * a[unit] + b[unit] / 2 == pytest.approx(exponent)
