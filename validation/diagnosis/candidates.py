"""Describe candidate functions, which represent effects outside the library.

A candidate function describes a small displacement or a compliance that depends on one
or two variables. It acts at a frame, at the base or on the readings.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.functions import AXES, THREAD
from forcefit.assembly.effects.places import body_axis, drives, growing
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.variables import variable
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.validation.diagnosis.function_forms import CandidateShape

TURN, SHIFT = AXES[:3], AXES[3:]
# Changes below this fraction of the largest vector component are treated as zero.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class CandidatePart:
    """Location at which a candidate function acts, with the function's variables."""

    where: str
    components: tuple[str, ...]
    variable: str
    second_variable: str = ""

    @property
    def variables(self) -> tuple[str, ...]:
        """Public names of the one or two variables of the function."""
        second = (self.second_variable,) if self.second_variable else ()
        return (self.variable, *second)


@dataclass(frozen=True)
class Candidate:
    """A function that may act at one location or at several similar locations.

    Attributes:
        parts: locations and variables.
        kind: ``"screw"`` or ``"compliance"``.
        shape: functional form, such as a polynomial, which is the same for all parts.
    """

    parts: tuple[CandidatePart, ...]
    kind: str
    shape: CandidateShape

    def functions(self) -> list[Function]:
        """Return the functions in the format of a robot file, without coefficients."""
        numbers = dict.fromkeys(self.shape.names, 0.0) | dict(self.shape.given)
        return [
            Function(
                p.where,
                p.components,
                p.variables,
                self.shape.form,
                numbers,
                self.kind,
            )
            for p in self.parts
        ]


def is_turn(component: str) -> bool:
    """Return whether a screw component is a rotation or a moment."""
    return component[0] in "rm"


def own_component(frame: Frame) -> str:
    """Return the screw component along which a joint moves."""
    return THREAD if frame.pitch else AXES[frame.own_axis]


def variables_of(conditions: Conditions) -> list[str]:
    """Return the names of the variables on which a function can depend.

    Variables are drive coordinates, loads, positions and covariates. A variable is
    returned if its values differ and if at least one session has a value in every row.
    """
    names = [f"q.{name}" for name in drives(conditions.robot)]
    names += [f"load.{axis}" for axis in ("mx", "my", "mz", "fx", "fy", "fz")]
    names += ["load.force", *(f"position.{axis}" for axis in "xyz")]
    names += ["cov.temperature", "time", "approach"]
    names += [f"cov.{name}" for name in conditions.covariates]
    values = {
        name: variable(conditions, name)[known]
        for name in names
        if (known := is_known(conditions, name)).any()
    }
    largest: dict[str, float] = {}
    for name, x in values.items():
        kind = _kind(name)
        largest[kind] = max(largest.get(kind, 0.0), float(np.abs(x).max()))
    return [n for n, x in values.items() if np.ptp(x) > _ROUNDING * largest[_kind(n)]]


def _kind(name: str) -> str:
    """Return the vector to which a variable belongs, or its own name."""
    vectors = "position.", "load.m", "load.f"
    return next((v for v in vectors if name.startswith(v)), name)


def is_known(conditions: Conditions, *names: str) -> NDArray:
    """Return a mask (R,) of rows for which all variables are known.

    If a variable is unknown in one row of a session, the whole session is excluded.
    Without sessions, all rows are treated as one session.  Wrenches are not checked.
    """
    known = np.ones(len(conditions), dtype=bool)
    for name in names:
        known &= np.isfinite(variable(conditions, name))
    if conditions.session is None:
        return known if known.all() else np.zeros_like(known)
    lacking = np.unique(conditions.session[~known])
    return known & ~np.isin(conditions.session, lacking)


def places_of(
    robot: Robot, variables: Sequence[str]
) -> Iterator[tuple[str, tuple[CandidatePart, ...]]]:
    """Yield all locations at which candidate functions can act, for each variable.

    Yields:
        The kind of function, and its locations with the variable.  A function may act
        along a single component, along three components, on all drives, or on all
        bodies.
    """
    single: list[tuple[str, tuple[str, ...]]]
    single = [(f.name, (axis,)) for f in robot.frames for axis in AXES]
    single += [(f.name, (THREAD,)) for f in robot.frames if f.pitch]
    single += [(p, (axis,)) for p in ("base", "reading") for axis in AXES]
    single.append(("reading", AXES))
    for name in (*(f.name for f in robot.frames), "base"):
        single += [(name, TURN), (name, SHIFT)]
    own = tuple((f.name, (own_component(f),)) for f in robot.frames if f.actuated)
    along = tuple((name, _along(robot, name)) for name in growing(robot))
    for name in variables:
        for where, components in single:
            yield "screw", (CandidatePart(where, components, name),)
            if where not in {"reading", "base"} and len(components) == 1:
                yield "compliance", (CandidatePart(where, components, name),)
        if not name.startswith("q.") and len(along) > 1:
            yield "screw", tuple(CandidatePart(w, c, name) for w, c in along)
    if len(own) > 1:
        together = tuple(CandidatePart(w, c, f"q.{w}") for w, c in own)
        yield "screw", together
        yield "compliance", together


def _along(robot: Robot, name: str) -> tuple[str, ...]:
    """Return the translation components along the axis of a body."""
    axis = np.abs(body_axis(robot.frame(name))[1])
    return tuple(a for a, part in zip(SHIFT, axis, strict=True) if part > 1e-9)
