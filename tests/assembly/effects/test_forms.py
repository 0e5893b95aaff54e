"""Basis columns of functions, compared with SciPy and NumPy."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicSpline

from forcefit.assembly.effects.forms import (
    FORMS,
    natural_spline,
    roughness,
    shape_names,
)

X = np.linspace(-1.2, 1.7, 31)
Y = np.cos(3 * X)


def columns(form, names, inputs=(X,), **shapes):
    return FORMS[form].basis(names, list(inputs), shapes)


def test_powers_and_harmonics_of_two_variables_equal_numpy():
    assert columns("powers", ["0", "3"]) == pytest.approx(np.array([X**0, X**3]).T)
    found = columns("powers", ["1.2"], (X, Y))[:, 0]
    assert found == pytest.approx(X * Y**2)
    found = columns("waves", ["2.-1.sine", "2.-1.cosine"], (X, Y))
    assert found == pytest.approx(np.array([np.sin(2 * X - Y), np.cos(2 * X - Y)]).T)
    found = columns("waves", ["3.cosine"], period=0.4)[:, 0]
    assert found == pytest.approx(np.cos(3 * 2 * np.pi * X / 0.4))


def test_natural_spline_equals_scipy():
    values = np.array([1.0, -2.0, 0.5, 3.0, 2.5])
    knots = np.linspace(-1.0, 1.5, 5)
    names = [str(k) for k in range(1, 6)]
    found = columns("spline", names, first=-1.0, last=1.5) @ values
    expected = CubicSpline(knots, values, bc_type="natural")(np.clip(X, -1.0, 1.5))
    assert found == pytest.approx(expected, rel=1e-12)


def test_spline_of_two_variables_equals_the_product_of_splines():
    names = [f"{j}.{k}" for j in (1, 2, 3) for k in (1, 2)]
    ends = {"first.1": -1.0, "last.1": 1.0, "first.2": -1.0, "last.2": 1.0}
    found = FORMS["spline"].basis(names, [X, Y], ends)
    one = natural_spline(np.linspace(-1, 1, 3), X)
    other = natural_spline(np.linspace(-1, 1, 2), Y)
    assert found == pytest.approx(
        np.einsum("rj,rk->rjk", one, other).reshape(len(X), -1)
    )
    assert set(shape_names(FORMS["spline"], 2)) == set(ends)


def test_spline_roughness_equals_the_integral_of_squared_curvature():
    values = np.array([1.0, -2.0, 0.5, 3.0, 2.5, 0.0])
    spline = CubicSpline(np.arange(6), values, bc_type="natural")
    pieces = [quad(lambda x: spline(x, 2) ** 2, k, k + 1)[0] for k in range(5)]
    assert values @ roughness(6) @ values == pytest.approx(sum(pieces), rel=1e-9)


@pytest.mark.parametrize(("form", "count", "known", "unknown"), [
    ("powers", 1, ["2", "20"], ["2.1", "-1", "02", "", "21", "+1", " 1", "1e0",
                                "0000000001", "\u0661", "9" * 5000]),
    ("powers", 2, ["1.2"], ["1"]),
    ("waves", 1, ["1.sine", "-999.sine", "0.cosine"],
     ["sine", "1", "1000.sine", "-1000.sine", "-0.sine", "1.tangent",
      "-" + "9" * 5000 + ".sine"]),
    ("spline", 1, ["1", "999"], ["0", "1000"]),
    ("lag", 1, ["gain"], ["1.gain"]),
    ("reversal", 2, ["1"], ["1.1"]),
    ("step", 1, ["size"], []),
])  # fmt: skip
def test_column_names_are_integers_within_their_range(form, count, known, unknown):
    found = {name: FORMS[form].is_column(name, count) for name in known + unknown}
    assert found == dict.fromkeys(known, True) | dict.fromkeys(unknown, False)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_spline_of_fewer_than_three_knots_has_zero_roughness(count):
    """A natural spline through two values is a line."""
    assert np.array_equal(roughness(count), np.zeros((count, count)))


def test_knee_changes_its_slope_at_the_given_load():
    """The compliance is 2 rad/(N m) up to 3 N m, and 0.5 for larger moments."""
    load = np.array([-5.0, -3.0, -1.0, 0.0, 2.0, 7.0])
    found = FORMS["knee"].basis(["below", "above"], [load], {"at": 3.0})
    assert found @ [2.0, 0.5] == pytest.approx([-7, -6, -2, 0, 4, 8])
    jump = FORMS["knee"].basis(["size"], [load], {"at": 0.5})
    assert 0.1 * jump[:, 0] == pytest.approx([-0.1, -0.1, -0.1, 0, 0.1, 0.1])


def test_scaled_waves_equal_harmonics_times_the_second_variable():
    force = np.linspace(-3.0, 5.0, len(X))
    found = FORMS["scaled_waves"].basis(["0.cosine", "2.sine"], [X, force], {})
    assert found == pytest.approx(np.column_stack([force, force * np.sin(2 * X)]))
