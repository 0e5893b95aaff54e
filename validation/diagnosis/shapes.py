"""Forms of functions of one or two variables, and their prior probabilities.

All families of forms of a variable have the same prior probability.  The forms of a
family share it; the share of waves falls with their order.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.conditions import Conditions
from assembly.measurement.variables import variable
from validation.diagnosis.forms_tried import CandidateShape, all_shapes, is_angle, waves

_DEPTHS = 0.03, 0.1, 0.3, 1.0  # of slip, relative to the variable's range
_ALL_DEPTHS = tuple(0.01 * 1.4**k for k in range(15))
_TURNS = 0.5  # of a screw over the range of its slide: step of a scan of its lead
_MOST_TURNS = 200.0
_FINER = 1.2  # of a number in which a form is not linear: first step of its refinement
_NO_LOAD = 1e-3  # of the largest one: what takes up backlash
_HIGH = 12  # highest order of waves that is tried alone
STRAIGHT = CandidateShape("powers", ("1",))
_CLOCKS = "time", "cov.time"
_JUMPS, _MANY_JUMPS = 10, 91  # numbers of times at which a step is tried
ANGLE = ("0.cosine", "1.sine", "1.cosine")


def first(conditions: Conditions, name: str) -> list[CandidateShape]:
    """Return general forms that show whether a variable matters."""
    if name == "approach":
        return [CandidateShape("powers", ("1",))]
    powers = CandidateShape("powers", ("0", "1", "2", "3"))
    straight = [CandidateShape("powers", (k,)) for k in ("1", "2")]
    if is_angle(conditions.robot, name):
        single = [waves(k) for k in range(1, _HIGH + 1)]
        return [waves(1, 2, 3, 4), powers, *single, *_reversals(conditions, name)]
    steps = _steps(conditions, name, _JUMPS) if name in _CLOCKS else []
    return [powers, *straight, *steps, *_reversals(conditions, name)]


def every(conditions: Conditions, name: str, kind: str) -> list[CandidateShape]:
    """Return all forms of one variable."""
    shapes = list(all_shapes(conditions, name, kind))
    if is_angle(conditions.robot, name):
        shapes += [waves(k) for k in range(9, _HIGH + 1)]
    if name in _CLOCKS:
        shapes = [s for s in shapes if s.form != "step"]
        shapes += _steps(conditions, name, _MANY_JUMPS)
    more = [*first(conditions, name), *_reversals(conditions, name, _ALL_DEPTHS)]
    more += screw(conditions, name)
    return list(dict.fromkeys([*shapes, *more]))


def screw(
    conditions: Conditions, name: str, form: str = "waves",
    names: tuple[str, ...] = ANGLE[1:],
) -> list[CandidateShape]:  # fmt: skip
    """Return waves of a slide's coordinate, whose period is the lead of its screw."""
    if not name.startswith("q.") or is_angle(conditions.robot, name):
        return []
    x = variable(conditions, name)
    size, count = float(np.ptp(x)), len(np.unique(x))
    turns = np.arange(1.0, min(2.0 * count, _MOST_TURNS) + _TURNS, _TURNS)
    return [CandidateShape(form, names, (("period", size / k),)) for k in turns]


def knees(load: NDArray, *, jump: bool) -> list[CandidateShape]:
    """Return laws with a knee at some of the loads; also a jump at load zero."""
    largest = float(load.max(initial=0.0))
    levels = np.unique(np.quantile(load, np.linspace(0.1, 0.9, 9)))
    levels = levels[levels > _NO_LOAD * largest]
    knee = [
        CandidateShape("knee", ("below", "above"), (("at", float(v)),)) for v in levels
    ]
    if jump and len(levels):
        knee.append(CandidateShape("knee", ("size",), (("at", _NO_LOAD * largest),)))
    return knee


def is_screw(shape: CandidateShape) -> bool:
    """Return whether a form is one of :func:`screw`."""
    return shape.form.endswith("waves") and bool(shape.given)


def near(
    conditions: Conditions, variables: Sequence[str], shape: CandidateShape, part: float
) -> list[CandidateShape]:
    """Return a form with the number in which it is not linear a bit less, and more.

    Args:
        conditions: R rows.
        variables: one or two.
        shape: form.
        part: of half the step by which forms are tried first.

    Returns:
        Two forms; none of a form without such a number, or of a step.
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
    return [replace(shape, given=((key, step),)) for step in steps if step > 0]


def _steps(conditions: Conditions, name: str, count: int) -> list[CandidateShape]:
    """Return steps at quantiles of a variable."""
    x = variable(conditions, name)
    levels = np.unique(np.quantile(x, np.linspace(0.05, 0.95, count)))
    return [CandidateShape("step", ("size",), (("at", float(v)),)) for v in levels]


def _reversals(
    conditions: Conditions, name: str, depths: Sequence[float] = _DEPTHS
) -> list[CandidateShape]:
    """Return forms with memory: reversal and slip."""
    if not name.startswith(("q.", "load.")) or name == "load.force":
        return []
    size = float(np.ptp(variable(conditions, name)))
    slips = [
        CandidateShape("slip", ("size",), (("depth", depth * size),))
        for depth in depths
    ]
    return [CandidateShape("reversal", ("0",)), *slips]


def of_two(
    conditions: Conditions, first: str, second: str
) -> tuple[tuple[str, str], list[CandidateShape]] | None:
    """Return the forms of a product of two variables.

    Returns:
        The variables in the order of the forms, and the forms; None if the product
        is not useful.
    """
    angles = [is_angle(conditions.robot, name) for name in (first, second)]
    if {first, second} == {"time", "cov.time"}:
        return None
    if all(angles):
        pair = ("1.1.sine", "1.1.cosine", "1.-1.sine", "1.-1.cosine")
        turned = CandidateShape("reversal_waves", ANGLE[1:])
        return (first, second), [CandidateShape("waves", pair), turned]
    if any(angles):
        order = (first, second) if angles[0] else (second, first)
        scaled = [
            CandidateShape(
                "scaled_waves", tuple(f"{k}.{w}" for w in ("sine", "cosine"))
            )
            for k in (1, 2, 3)
        ]
        return order, [*scaled, CandidateShape("scaled_waves", ANGLE)]
    if "approach" in {first, second}:
        other = second if first == "approach" else first
        shapes = [CandidateShape("reversal", (k,)) for k in ("1", "2")]
        shapes += screw(conditions, other, "reversal_waves", ANGLE)
        return ("approach", other), [*shapes, CandidateShape("reversal", ("0", "1"))]
    shapes = [CandidateShape("powers", (k,)) for k in ("1.1", "1.2", "2.1")]
    return (first, second), [*shapes, CandidateShape("powers", ("1.0", "0.1", "1.1"))]


def uneven(conditions: Conditions, name: str) -> list[CandidateShape]:
    """Return forms of a compliance that varies over a turn."""
    if not is_angle(conditions.robot, name):
        return []
    names = [("0.cosine", f"{k}.sine", f"{k}.cosine") for k in range(1, 5)]
    return [CandidateShape("waves", own) for own in names]


def of_direction(conditions: Conditions, name: str) -> list[CandidateShape]:
    """Return forms of backlash that varies over a turn, of a drive or of its screw."""
    if is_angle(conditions.robot, name):
        return [CandidateShape("reversal_waves", ANGLE)]
    return screw(conditions, name, "reversal_waves", ANGLE)


def log_priors(shapes: Sequence[CandidateShape]) -> NDArray:
    """Return the log prior of each form among all forms of its variables."""
    weight = np.array([_weight(shape) for shape in shapes])
    families = [shape.form for shape in shapes]
    total = {f: weight[[g == f for g in families]].sum() for f in set(families)}
    own = np.array([total[f] for f in families])
    return np.log(weight / own) - math.log(len(total))


def _weight(shape: CandidateShape) -> float:
    """Return the relative prior of a form in its family."""
    if is_screw(shape):
        return dict(shape.given)["period"]
    if shape.form.endswith("waves"):
        orders = [
            abs(int(part)) for name in shape.names for part in name.split(".")[:-1]
        ]
        return 1.0 / max(*orders, 1)
    return 1.0


def falling(shape: CandidateShape, count: int) -> NDArray:
    """Return (count,) relative prior standard deviations of a form's columns."""
    if shape.form != "waves" or count != len(shape.names):
        return np.ones(count)
    order = np.array([
        max(abs(int(part)) for part in name.split(".")[:-1]) for name in shape.names
    ])
    return order.clip(1).min() / order.clip(1)
