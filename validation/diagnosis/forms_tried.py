"""Forms in which a candidate may depend on its variable, general ones first."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.conditions import Conditions
from assembly.measurement.variables import variable
from assembly.model.robot import Robot

KNOTS = 7
MANY = 150  # rows from which many waves a turn are looked for
LAGS = 0.02, 0.03, 0.05, 0.07, 0.1, 0.14, 0.2, 0.3, 0.5  # of the span of time


@dataclass(frozen=True)
class CandidateShape:
    """A form with the names of its columns.

    Attributes:
        form: a name of :data:`assembly.effects.forms.FORMS`.
        names: of its columns.
        given: numbers in which it is not linear.
    """

    form: str
    names: tuple[str, ...]
    given: tuple[tuple[str, float], ...] = ()

    @property
    def bends(self) -> NDArray:
        """(0,) or (1,) the number in which it is not linear, if that is fitted."""
        one = len(self.given) == 1 and self.form != "step"
        return np.array([value for _, value in self.given] if one else [])

    def bent(self, by: float) -> "CandidateShape":
        """The form with that number larger."""
        ((key, value),) = self.given
        return replace(self, given=((key, value + by),))


def waves(*orders: int) -> CandidateShape:
    """Sines and cosines of these orders of an angle."""
    return CandidateShape(
        "waves", tuple(f"{k}.{w}" for k in orders for w in ("sine", "cosine"))
    )


def _powers(*powers: int) -> CandidateShape:
    return CandidateShape("powers", tuple(str(k) for k in powers))


REVERSAL = CandidateShape("reversal", ("0",))


def all_shapes(conditions: Conditions, name: str, kind: str) -> list[CandidateShape]:
    """Every form that is tried where a variable counts, those with a name first."""
    x = variable(conditions, name)
    low, high = float(x.min()), float(x.max())
    if name == "approach":
        return [_powers(1)]
    shapes = [_powers(1), _powers(2), _powers(3), _powers(0, 1), _powers(0, 1, 2),
              _powers(0, 1, 2, 3)]  # fmt: skip
    if name.startswith("q."):
        shapes.append(REVERSAL)
    if is_angle(conditions.robot, name):
        shapes += [waves(k) for k in range(1, 9)]
        shapes += [waves(*range(1, k + 1)) for k in (2, 4, 8)]
        if len(conditions) >= MANY:
            shapes += [waves(*range(1, k + 1)) for k in (20, 40)]
        if kind == "compliance":
            shapes += [
                CandidateShape("waves", ("0.cosine", f"{k}.sine", f"{k}.cosine"))
                for k in range(1, 5)
            ]
    if name in {"time", "cov.time"}:
        shapes += [
            CandidateShape(
                "slow_wave", ("sine", "cosine"), (("period", (high - low) / k),)
            )
            for k in (0.5, 1, 1.5, 2, 3, 4, 6)
        ]
    if not name.startswith(("load", "position")):
        levels = np.quantile(x, np.linspace(0.1, 0.9, 9))
        shapes += [
            CandidateShape("step", ("size",), (("at", float(v)),))
            for v in np.unique(levels)
        ]
    span = float(np.ptp(conditions.time))
    if name.startswith("cov.") and math.isfinite(span) and span:
        shapes += [
            CandidateShape("lag", ("gain", "start"), (("time_constant", part * span),))
            for part in LAGS
        ]
    if len(np.unique(x)) > KNOTS:
        ends = (("first", low), ("last", high))
        shapes.append(
            CandidateShape("spline", tuple(str(k + 1) for k in range(KNOTS)), ends)
        )
    return shapes


def is_angle(robot: Robot, name: str) -> bool:
    """Whether a variable is the coordinate of a joint that turns."""
    kind, _, rest = name.partition(".")
    return kind == "q" and robot.frame(rest).joint == "revolute"
