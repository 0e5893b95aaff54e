"""Basis functions (forms) for functions of one or two variables.

A function is a sum of basis functions, each multiplied by a coefficient.  A *form* is a
family of basis functions.  It can have nonlinear parameters, called *shapes*, such as a
time constant or a period.

========== ============================== ==========================================
form       coefficients                   basis functions
========== ============================== ==========================================
powers     ``0``, ``1``, ``2`` ..         x^i
           ``i.j`` of two variables       x^i y^j
waves      ``k.sine``, ``k.cosine``       harmonics k x, with period 2 pi or
                                          ``period``
           ``j.k.sine``, ``j.k.cosine``   harmonics j x + k y of two variables
spline     ``1`` .. ``n``                 natural cubic splines with n evenly spaced
           ``j.k`` of two variables       knots from ``first`` to ``last``, constant
                                          outside this interval
lag        ``gain``                       x with a first-order lag ``time_constant``
           ``start``                      decay of the state at time 0
creep      ``gain``, ``start``            as for lag, for a load applied in steps
step       ``size``                       0 for x < ``at``, otherwise 1
slow_wave  ``sine``, ``cosine``           sine and cosine of x with ``period``
reversal   ``0``, ``1``, ``2`` ..         direction of x times y^k, or times abs(y)^k
                                          for a load or a wrench y
slip       ``size``                       position from -1 to 1 of a friction element
                                          that slips after a motion ``depth`` of x
scaled_    ``k.sine``, ``k.cosine``       harmonics k x, multiplied by y
waves
reversal_  ``k.sine``, ``k.cosine``       direction of x times harmonics of y or x
waves
knee       ``below``                      x limited to -``at`` .. ``at``
           ``above``                      x minus the column ``below``
           ``size``                       column ``below`` divided by ``at``
========== ============================== ==========================================

Sources:
    de Boor, A Practical Guide to Splines, chapter IV (natural cubic interpolation).
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Shapes = Mapping[str, float]
Inputs = Sequence[NDArray]
_MOST = 999  # largest number of powers, harmonics or knots
# integer in the name of a basis function
_INDEX = re.compile("0|-?[1-9][0-9]{0,8}")


@dataclass(frozen=True)
class Form:
    """Family of basis functions of one or two variables.

    Attributes:
        name: name of the form in robot files.
        summary: one-line description.
        most: largest number of variables.
        shapes: names of nonlinear parameters, mapped to True if required.
        indices: smallest and largest integer with which the name of a basis function
            can begin; None if names contain no integers.
        words: allowed endings of the name of a basis function, such as ``"sine"``;
            ``""`` for names without ending.
        basis: function that returns the values (R, p) of basis functions for their p
            names, inputs (R,) and shapes.
        remembers: whether the function depends on earlier values of the first variable.
        least: smallest number of variables.
    """

    name: str
    summary: str
    most: int
    shapes: Mapping[str, bool]
    indices: tuple[int, int] | None
    words: tuple[str, ...]
    basis: Callable[[Sequence[str], Inputs, Shapes], NDArray]
    remembers: bool = False
    least: int = 1

    def is_column(self, name: str, variables: int) -> bool:
        """Return whether a name is valid for a basis function of so many variables."""
        head, word = name, ""
        if self.words != ("",):
            head, _, word = name.rpartition(".")
        if word not in self.words:
            return False
        if self.indices is None:
            return not head
        parts = head.split(".")
        count = variables if self.name in {"powers", "waves", "spline"} else 1
        least, most = self.indices
        return len(parts) == count and all(
            _INDEX.fullmatch(part) and least <= int(part) <= most for part in parts
        )


def column_indices(name: str) -> list[int]:
    """Return the integers with which the name of a basis function begins."""
    return [int(part) for part in name.split(".") if _INDEX.fullmatch(part)]


def _powers(names: Sequence[str], inputs: Inputs, shapes: Shapes) -> NDArray:
    columns = []
    for name in names:
        powers = zip(inputs, column_indices(name), strict=True)
        columns.append(math.prod((x**k for x, k in powers), start=np.ones(())))
    return _stacked(columns, inputs)


def _waves(names: Sequence[str], inputs: Inputs, shapes: Shapes) -> NDArray:
    turn = 2 * math.pi / shapes.get("period", 2 * math.pi)
    columns = []
    for name in names:
        counts = zip(inputs, column_indices(name), strict=True)
        angle = turn * sum(k * x for x, k in counts)
        wave = np.sin if name.rpartition(".")[2] == "sine" else np.cos
        columns.append(wave(angle))
    return _stacked(columns, inputs)


def _slow_wave(names: Sequence[str], inputs: Inputs, shapes: Shapes) -> NDArray:
    return _waves([f"1.{name}" for name in names], inputs, shapes)


def _spline(names: Sequence[str], inputs: Inputs, shapes: Shapes) -> NDArray:
    indices = np.array([column_indices(name) for name in names]).reshape(len(names), -1)
    columns = np.ones((len(inputs[0]), len(names)))
    for k, x in enumerate(inputs):
        ends = [f"{end}.{k + 1}" if len(inputs) > 1 else end for end in _ENDS]
        first, last = (shapes[end] for end in ends)
        knots = np.linspace(first, last, int(indices[:, k].max()))
        columns *= natural_spline(knots, x)[:, indices[:, k] - 1]
    return columns


_ENDS = ("first", "last")


def natural_spline(knots: NDArray, x: NDArray) -> NDArray:
    """Return natural cubic splines (R, n), each 1 at one knot and 0 at others."""
    from scipy.interpolate import CubicSpline

    if len(knots) < 2:
        return np.ones((len(x), len(knots)))
    inside = np.clip(x, knots[0], knots[-1])
    spline = CubicSpline(knots, np.eye(len(knots)), bc_type="natural")
    return np.nan_to_num(spline(np.nan_to_num(inside)))


def roughness(count: int) -> NDArray:
    """Return the roughness matrix of a spline with n evenly spaced knots.

    Args:
        count: number n of knots.

    Returns:
        Matrix R (n, n), where v R v is the integral of the squared second derivative
        for values v at knots of unit spacing.

    Sources:
        Green, Silverman, Nonparametric Regression, section 2.1.2 (R = Q B^-1 Q').
    """
    inner = max(count - 2, 0)
    Q = np.zeros((count, inner))
    for k in range(inner):
        Q[k : k + 3, k] = 1.0, -2.0, 1.0
    B = (4 * np.eye(inner) + np.eye(inner, k=1) + np.eye(inner, k=-1)) / 6
    return Q @ np.linalg.solve(B, Q.T)


def _remembered(names: Sequence[str], inputs: Inputs, shapes: Shapes) -> NDArray:
    """Return the lagged variable and the decaying initial state as two columns."""
    return np.column_stack([inputs[name == "start"] for name in names])


def _step(names: Sequence[str], inputs: Inputs, shapes: Shapes) -> NDArray:
    return _stacked(
        [np.where(inputs[0] >= shapes["at"], 1.0, 0.0)] * len(names), inputs
    )


def _reversal(names: Sequence[str], inputs: Inputs, shapes: Shapes) -> NDArray:
    """Return the direction of motion, multiplied by powers of the second input."""
    size = inputs[1] if len(inputs) > 1 else np.ones_like(inputs[0])
    return _stacked([inputs[0] * size ** int(name) for name in names], inputs)


def _scaled_waves(names: Sequence[str], inputs: Inputs, shapes: Shapes) -> NDArray:
    """Return harmonics of the first input, multiplied by the second input."""
    return _waves(names, inputs[:1], shapes) * inputs[1][:, None]


def _reversal_waves(names: Sequence[str], inputs: Inputs, shapes: Shapes) -> NDArray:
    """Return harmonics of an angle, multiplied by the direction of motion."""
    return _waves(names, inputs[1:], shapes) * inputs[0][:, None]


def _slip(names: Sequence[str], inputs: Inputs, shapes: Shapes) -> NDArray:
    """Return the position of a friction element, from -1 to 1."""
    return _stacked([inputs[0]] * len(names), inputs)


def _knee(names: Sequence[str], inputs: Inputs, shapes: Shapes) -> NDArray:
    """Divide a load into its components below and above the knee."""
    first = np.clip(inputs[0], -shapes["at"], shapes["at"])
    parts = {"below": first, "above": inputs[0] - first, "size": first / shapes["at"]}
    return _stacked([parts[name] for name in names], inputs)


def _stacked(columns: Sequence[NDArray], inputs: Inputs) -> NDArray:
    """Combine p columns to an array (R, p)."""
    rows = len(inputs[0])
    if not columns:
        return np.zeros((rows, 0))
    return np.column_stack([np.broadcast_to(column, (rows,)) for column in columns])


_WAVES = ("sine", "cosine")


def _memory(name: str, summary: str) -> Form:
    """Return a form whose value lags behind the variable."""
    return Form(
        name, summary, 1, {"time_constant": True}, None, ("gain", "start"), _remembered,
        remembers=True,
    )  # fmt: skip


FORMS: dict[str, Form] = {
    form.name: form
    for form in (
        Form("powers", "a polynomial", 2, {}, (0, 20), ("",), _powers),
        Form("waves", "harmonics with whole periods per turn", 2, {"period": False},
             (-_MOST, _MOST), _WAVES, _waves),
        Form("spline", "a cubic spline through values at evenly spaced knots", 2,
             dict.fromkeys(_ENDS, True), (1, _MOST), ("",), _spline),
        _memory("lag", "a first-order lag"),
        _memory("creep", "creep under a stepwise load"),
        Form("step", "a jump", 1, {"at": True}, None, ("size",), _step),
        Form("slow_wave", "a slow oscillation", 1, {"period": True}, None, _WAVES,
             _slow_wave),
        Form("reversal", "a jump when the direction of motion reverses", 2, {},
             (0, 20), ("",), _reversal, remembers=True),
        Form("slip", "a slipping element, saturated after a reversal", 1,
             {"depth": True}, None, ("size",), _slip, remembers=True),
        Form("scaled_waves", "harmonics times a second variable", 2, {"period": False},
             (0, _MOST), _WAVES, _scaled_waves, least=2),
        Form("reversal_waves", "harmonics with the sign of the direction", 2,
             {"period": False}, (0, _MOST), _WAVES, _reversal_waves, remembers=True),
        Form("knee", "one slope up to a load, another beyond", 1, {"at": True}, None,
             ("below", "above", "size"), _knee),
    )
}  # fmt: skip


def shape_names(form: Form, variables: int) -> dict[str, bool]:
    """Return the names of a form's shapes, and whether each is required."""
    if form.name == "spline" and variables > 1:
        return {f"{end}.{k}": True for k in (1, 2) for end in _ENDS}
    return dict(form.shapes)
