"""List functional forms, such as polynomials, with their prior probabilities.

All families of functional forms have equal prior probability. The probability of a
family is divided among its forms.  Higher harmonics have a smaller prior probability.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.variables import variable
from forcefit.assembly.model.robot import Robot

KNOTS = 7  # number of spline knots
MANY = 150  # smallest number of rows with which high harmonics are tested
# Tested time constants, relative to the duration of the campaign.
LAGS = 0.02, 0.03, 0.05, 0.07, 0.1, 0.14, 0.2, 0.3, 0.5
_CYCLES = 0.5, 1, 1.5, 2, 3, 4, 6  # tested numbers of cycles during the campaign
# Tested widths of hysteresis, relative to the range of the variable.
_DEPTHS = 0.03, 0.1, 0.3, 1.0
# Widths of hysteresis in the refined search, relative to the range of the variable.
_ALL_DEPTHS = tuple(0.01 * 1.4**k for k in range(15))
# Step of the search for the number of screw turns over the travel of a slide.
_TURNS = 0.5
# Largest tested number of screw turns over the travel of a slide.
_MOST_TURNS = 200.0
_FINER = 1.2  # first factor by which a shape parameter is changed to refine it
# Loads below this fraction of the largest load are treated as zero.
_NO_LOAD = 1e-3
_HIGH = 12  # highest order of a harmonic that is tested as the only harmonic
_CLOCKS = "time", "cov.time"
# Number of tested times of a jump in the first search and in the refined search.
_JUMPS, _MANY_JUMPS = 10, 91
# Quantiles at which steps and changes of stiffness are tested.
_INNER = np.linspace(0.1, 0.9, 9)


@dataclass(frozen=True)
class CandidateShape:
    """A functional form that is linear in its coefficients, such as a polynomial.

    Attributes:
        form: a name of :data:`forcefit.assembly.effects.forms.FORMS`.
        names: names of the coefficients.
        given: names and values of the nonlinear shape parameters.
    """

    form: str
    names: tuple[str, ...]
    given: tuple[tuple[str, float], ...] = ()

    @property
    def bends(self) -> NDArray:
        """Shape parameter to fit, (1,), or an empty array if there is none."""
        one = len(self.given) == 1 and self.form != "step"
        return np.array([value for _, value in self.given] if one else [])

    def bent(self, by: float) -> "CandidateShape":
        """Return the functional form with its shape parameter increased by ``by``."""
        ((key, value),) = self.given
        return replace(self, given=((key, value + by),))


def _powers(*powers: int) -> CandidateShape:
    return CandidateShape("powers", tuple(map(str, powers)))


def _waves(*orders: int, form: str = "waves") -> CandidateShape:
    """Return the sines and cosines of multiples of an angle."""
    names = tuple(f"{k}.{w}" for k in orders for w in ("sine", "cosine"))
    return CandidateShape(form, names)


def _at_each(
    form: str, names: tuple[str, ...], key: str, values: Iterable[float]
) -> list[CandidateShape]:
    """Return one functional form for each given value of the shape parameter."""
    return [CandidateShape(form, names, ((key, float(v)),)) for v in values]


STRAIGHT = _powers(1)
_WAVE = _waves(1).names
_ANGLE = ("0.cosine", *_WAVE)


def is_angle(robot: Robot, name: str) -> bool:
    """Return whether a variable is the coordinate of a revolute joint."""
    kind, _, rest = name.partition(".")
    return kind == "q" and robot.frame(rest).turns


def first(conditions: Conditions, name: str) -> list[CandidateShape]:
    """Return the functional forms of a variable that are tested first."""
    if name == "approach":
        return [STRAIGHT]
    cubic, memory = _powers(0, 1, 2, 3), _reversals(conditions, name, _DEPTHS)
    if is_angle(conditions.robot, name):
        single = [_waves(k) for k in range(1, _HIGH + 1)]
        return [_waves(1, 2, 3, 4), cubic, *single, *memory]
    steps = _steps(conditions, name, _JUMPS) if name in _CLOCKS else []
    return [cubic, STRAIGHT, _powers(2), *steps, *memory]


def every(conditions: Conditions, name: str) -> list[CandidateShape]:
    """Return all functional forms of one variable."""
    if name == "approach":
        return [STRAIGHT]
    x, time = variable(conditions, name), conditions.time
    shapes = first(conditions, name)
    shapes += [STRAIGHT, _powers(2), _powers(3), _powers(0, 1), _powers(0, 1, 2)]
    if is_angle(conditions.robot, name):
        orders = (2, 8, 20, 40) if len(conditions) >= MANY else (2, 8)
        shapes += [_waves(*range(1, k + 1)) for k in orders]
        shapes += uneven(conditions, name)
    if name in _CLOCKS:
        periods = np.ptp(x) / np.array(_CYCLES)
        shapes += _at_each("slow_wave", ("sine", "cosine"), "period", periods)
        shapes += _steps(conditions, name, _MANY_JUMPS)
    elif not name.startswith(("load", "position")):
        shapes += _at_each("step", ("size",), "at", np.unique(np.quantile(x, _INNER)))
    span = float(np.ptp(time))
    if name.startswith("cov.") and math.isfinite(span) and span:
        lags = span * np.array(LAGS)
        shapes += _at_each("lag", ("gain", "start"), "time_constant", lags)
    if len(np.unique(x)) > KNOTS:
        ends = (("first", float(x.min())), ("last", float(x.max())))
        knots = tuple(str(k + 1) for k in range(KNOTS))
        shapes.append(CandidateShape("spline", knots, ends))
    shapes += _reversals(conditions, name, _ALL_DEPTHS) + screw(conditions, name)
    return list(dict.fromkeys(shapes))


def uneven(conditions: Conditions, name: str) -> list[CandidateShape]:
    """Return the functional forms of a compliance that depends on an angle."""
    if not is_angle(conditions.robot, name):
        return []
    names = [("0.cosine", f"{k}.sine", f"{k}.cosine") for k in range(1, 5)]
    return [CandidateShape("waves", own) for own in names]


def screw(
    conditions: Conditions, name: str, form: str = "waves",
    names: tuple[str, ...] = _WAVE,
) -> list[CandidateShape]:  # fmt: skip
    """Return harmonics of a slide's coordinate, one for each possible screw lead."""
    if not name.startswith("q.") or is_angle(conditions.robot, name):
        return []
    x = variable(conditions, name)
    most = min(2.0 * len(np.unique(x)), _MOST_TURNS)
    turns = np.arange(1.0, most + _TURNS, _TURNS)
    return _at_each(form, names, "period", np.ptp(x) / turns)


def is_screw(shape: CandidateShape) -> bool:
    """Return whether a functional form is a harmonic with a given period."""
    return shape.form.endswith("waves") and bool(shape.given)


def of_direction(conditions: Conditions, name: str) -> list[CandidateShape]:
    """Return functional forms of backlash that varies with the angle of a drive."""
    if is_angle(conditions.robot, name):
        return [CandidateShape("reversal_waves", _ANGLE)]
    return screw(conditions, name, "reversal_waves", _ANGLE)


def of_two(
    conditions: Conditions, first: str, second: str
) -> tuple[tuple[str, str], list[CandidateShape]] | None:
    """Return the functional forms of two variables, and the ordered variables.

    If no function of these variables is considered, return None.
    """
    angles = [is_angle(conditions.robot, name) for name in (first, second)]
    if {first, second} == set(_CLOCKS):
        return None
    if all(angles):
        pair = ("1.1.sine", "1.1.cosine", "1.-1.sine", "1.-1.cosine")
        turned = CandidateShape("reversal_waves", _WAVE)
        return (first, second), [CandidateShape("waves", pair), turned]
    if any(angles):
        order = (first, second) if angles[0] else (second, first)
        scaled = [_waves(k, form="scaled_waves") for k in (1, 2, 3)]
        return order, [*scaled, CandidateShape("scaled_waves", _ANGLE)]
    if "approach" in {first, second}:
        other = second if first == "approach" else first
        shapes = [CandidateShape("reversal", (k,)) for k in ("1", "2")]
        shapes += screw(conditions, other, "reversal_waves", _ANGLE)
        return ("approach", other), [*shapes, CandidateShape("reversal", ("0", "1"))]
    powers = ("1.1",), ("1.2",), ("2.1",), ("1.0", "0.1", "1.1")
    return (first, second), [CandidateShape("powers", names) for names in powers]


def knees(load: NDArray, *, jump: bool) -> list[CandidateShape]:
    """Return piecewise linear springs whose stiffness changes at a given load.

    If ``jump`` is true, a spring with a jump at zero load is included.
    """
    least = _NO_LOAD * float(load.max(initial=0.0))
    levels = np.unique(np.quantile(load, _INNER))
    levels = levels[levels > least]
    knee = _at_each("knee", ("below", "above"), "at", levels)
    if jump and len(levels):
        knee += _at_each("knee", ("size",), "at", [least])
    return knee


def near(
    conditions: Conditions, variables: Sequence[str], shape: CandidateShape, part: float
) -> list[CandidateShape]:
    """Return two functional forms with a slightly smaller and a larger shape parameter.

    The change is ``part`` times half the distance between the values in the first
    search. If no shape parameter is fitted, the result is empty.
    """
    if not len(shape.bends):
        return []
    ((key, value),) = shape.given
    steps = [value * _FINER**part, value / _FINER**part]
    if key == "period":
        name = variables[0] if shape.form == "scaled_waves" else variables[-1]
        size = float(np.ptp(variable(conditions, name)))
        turns = size / value
        steps = [size / (turns + sign * part * _TURNS / 2) for sign in (-1, 1)]
    return _at_each(shape.form, shape.names, key, [step for step in steps if step > 0])


def _steps(conditions: Conditions, name: str, count: int) -> list[CandidateShape]:
    """Return step functions with jumps at quantiles of a variable."""
    levels = np.quantile(variable(conditions, name), np.linspace(0.05, 0.95, count))
    return _at_each("step", ("size",), "at", np.unique(levels))


def _reversals(
    conditions: Conditions, name: str, depths: Sequence[float]
) -> list[CandidateShape]:
    """Return functional forms of backlash and hysteresis."""
    if not name.startswith(("q.", "load.")) or name == "load.force":
        return []
    size = float(np.ptp(variable(conditions, name)))
    slips = _at_each("slip", ("size",), "depth", [depth * size for depth in depths])
    return [CandidateShape("reversal", ("0",)), *slips]


def log_priors(shapes: Sequence[CandidateShape]) -> NDArray:
    """Return the logarithms of the prior probabilities of functional forms."""
    weight = np.array([_weight(shape) for shape in shapes])
    families = [shape.form for shape in shapes]
    total = {f: weight[[g == f for g in families]].sum() for f in set(families)}
    own = np.array([total[f] for f in families])
    return np.log(weight / own) - math.log(len(total))


def _weight(shape: CandidateShape) -> float:
    """Return the relative prior probability of a functional form in its family."""
    if is_screw(shape):
        return dict(shape.given)["period"]
    return 1.0 / max(*_orders(shape), 1) if shape.form.endswith("waves") else 1.0


def falling(shape: CandidateShape, count: int) -> NDArray:
    """Return relative prior standard deviations (count,) of the coefficients."""
    if shape.form != "waves" or count != len(shape.names):
        return np.ones(count)
    order = np.array(_orders(shape))
    return order.clip(1).min() / order.clip(1)


def _orders(shape: CandidateShape) -> list[int]:
    """Return the order of the harmonic of each coefficient.

    For a product of two harmonics, the larger order is returned.
    """
    parts = [name.split(".")[:-1] for name in shape.names]
    return [max(abs(int(part)) for part in orders) for orders in parts]
