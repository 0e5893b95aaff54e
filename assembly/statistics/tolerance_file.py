"""Reader for tolerance files: error classes, costs and limits.

The format is described in ``docs/tolerances.md``.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from forcefit.assembly.kinematics.callout_maps import place_callouts
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.error_distributions import KINDS, ErrorSources
from forcefit.assembly.model.joint_names import error_label, error_rows
from forcefit.assembly.model.random_errors import frames_named
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.statistics.callout_sources import CalloutSources, Sources
from forcefit.assembly.statistics.quantities import POSE_ERRORS, UNITS, limit_names
from forcefit.assembly.statistics.ranking import kind_of
from forcefit.assembly.statistics.requirement import COSTS, Plan
from forcefit.assembly.steps.bolted import refuse_bolted
from forcefit.inputs.table import BadInput, Table, nearest, quoted, read_toml
from forcefit.stiffness.screws import SCREW

# [rad, m] largest accepted tolerances, for which errors are small screws
_LOOSEST = (0.1, 0.01)


def read_plan(path: Path | str, robot: Robot) -> Plan:
    """Read a tolerance file.

    Args:
        path: path of the TOML file.
        robot: robot to whose errors the tolerances apply.

    Returns:
        The plan.

    Raises:
        BadInput: the file is invalid, or the worst case of callouts is requested for a
            robot with a bolted joint.
    """
    root = read_toml(path)
    cost = _choice(root, "cost", COSTS)
    distribution = _choice(root, "distribution", ("uniform", "truncated"))
    asked_yield = root.number("yield", "1", 1.0, above=0.0, largest=1.0)
    deviations = root.number("deviations", "1", 3.0, above=0.0)
    draws = root.number("draws", "1", 1000.0, least=1.0, largest=1e7)
    seed = root.number("seed", "1", 1.0, least=0.0, largest=1e15)
    if draws != int(draws) or seed != int(seed):
        raise root.bad("draws", "expected whole numbers for draws and seed")
    limits = _limits(root.table("limits")) if root.has("limits") else {}
    tables = root.tables("tolerance")
    root.finish()
    if not tables:
        raise root.bad("tolerance", "missing; expected tables [[tolerance]]")
    groups = _groups(root, tables, robot)
    others = sorted(set(limits or {"margin_free"}) - set(POSE_ERRORS))
    if groups.callouts and asked_yield == 1.0:
        refuse_bolted(robot, "worst case of callouts (yield = 1)")
    if groups.callouts and asked_yield == 1.0 and others:
        fault = f"found 1 with callouts and a limit on {others[0]}"
        expected = "expected less than 1, or limits on rotation and translation only"
        raise root.bad("yield", f"{fault}; {expected}")
    sources: Sources = _independent(robot, groups, distribution, deviations)
    group = list(groups.of.values())
    if groups.callouts:
        own = sources if group and isinstance(sources, ErrorSources) else None
        sources, more = _with_callouts(robot, groups, own)
        group += more
    return Plan(
        sources=sources,
        group=np.array(group),
        names=tuple(groups.names),
        costs=np.array(groups.costs),
        least=np.array(groups.least),
        most=np.array(groups.most),
        limits=limits or {"margin_free": 1.0},
        cost=cost,
        asked_yield=float(asked_yield),
        draws=int(draws),
        seed=int(seed),
    )


def _independent(
    robot: Robot, groups: "_Groups", distribution: str, deviations: float
) -> ErrorSources:
    """Return independent errors with tolerances of 1 rad or 1 m."""
    frame, component = np.array(list(groups.of), dtype=int).reshape(-1, 2).T
    count = len(groups.of)
    return ErrorSources(
        robot=robot,
        frame=frame,
        component=component,
        kind=np.full(count, KINDS.index(distribution)),
        centre=np.zeros(count),
        scale=np.full(count, 1.0 / deviations if distribution == "truncated" else 1.0),
        least=np.zeros(count),
        limit=np.full(count, deviations),
        signed=np.ones(count, dtype=bool),
    )


def _with_callouts(
    robot: Robot, groups: "_Groups", independent: ErrorSources | None
) -> tuple[CalloutSources, list[int]]:
    """Return errors for zones of width 1 m, and the class of each callout."""
    placed = place_callouts(home_posture(robot))
    unit = [
        replace(placed[k], errors=placed[k].errors / placed[k].callout.first_width)
        for k in groups.callouts
    ]
    classes = [
        number
        for one, number in zip(unit, groups.callouts.values(), strict=True)
        for _ in range(sum(one.zone.dimensions))
    ]
    return CalloutSources(robot, tuple(unit), independent), classes


class _Groups(NamedTuple):
    """Classes of errors; all errors of a class have the same tolerance."""

    of: dict[tuple[int, int], int]  # index of the class, by frame and component
    callouts: dict[int, int]  # index of the class, by callout
    names: list[str]
    costs: list[float]
    least: list[float]
    most: list[float]


def _groups(root: Table, tables: Sequence[Table], robot: Robot) -> _Groups:
    """Return the classes of errors from the ``[[tolerance]]`` tables."""
    rows, callouts, names, costs, least, most = groups = _Groups({}, {}, [], [], [], [])
    for number, table in enumerate(tables):
        if table.has("callouts"):
            places, unit = list[tuple[int, int]](), 1
            default = _callouts(table, robot, callouts, number)
        else:
            places, unit = _places(table, robot)
            default = error_label(robot, *places[0])
        for place in places:
            if place in rows:
                label = error_label(robot, *place)
                first = rows[place]
                where = "this table" if first == number else quoted(names[first])
                raise table.bad("", f"found {quoted(label)} twice, first in {where}")
            rows[place] = number
        names.append(table.text("name", default))
        symbol = ("rad", "m")[unit]
        costs.append(table.number("cost", "1", 1.0, above=0.0))
        most.append(table.number("most", symbol, _LOOSEST[unit], above=0.0))
        tightest = table.number("least", symbol, 0.0, least=0.0, below=most[-1])
        least.append(tightest)
        table.finish()
    if len(set(names)) < len(names):
        raise root.bad(
            "tolerance",
            "found two tolerances of the same name, expected different names",
        )
    return groups


def _callouts(table: Table, robot: Robot, callouts: dict[int, int], number: int) -> str:
    """Add the callouts of a class to a mapping, and return the default class name."""
    value = table.content["callouts"]
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        raise table.bad("callouts", "expected a list of names of [[tolerance]] entries")
    names = [callout.name for callout in robot.callouts]
    for name in value:
        # A name without a leg name selects the callout in every leg.
        found = [k for k, own in enumerate(names) if name in (own, kind_of(own))]
        if not found:
            raise table.bad("callouts", f"found {quoted(name)}{nearest(name, names)}")
        for k in found:
            one = robot.callouts[k]
            if one.hole or any(datum.hole for datum in one.datums):
                fault = f"found {quoted(names[k])}, which is at maximum material"
                expected = (
                    "expected callouts without (M), whose zones have a constant width"
                )
                raise table.bad("callouts", f"{fault}, {expected}")
            if callouts.setdefault(k, number) != number:
                raise table.bad("callouts", f"found {quoted(names[k])} twice")
    if not value:
        raise table.bad("callouts", "expected at least one callout")
    words = robot.callouts[next(k for k, n in callouts.items() if n == number)].words
    return f"{words} of {value[0]}"


def _choice(table: Table, key: str, valid: tuple[str, ...]) -> str:
    """Return the value of a key, or the first valid value if the key is missing."""
    word = table.text(key, valid[0])
    if word not in valid:
        raise table.bad(key, f"found {quoted(word)}{nearest(word, valid)}")
    return word


def _limits(table: Table) -> dict[str, float]:
    """Return the limits by quantity."""
    valid = limit_names()
    limits = {}
    for key in list(table.content):
        if key not in valid:
            raise table.bad("", f"unknown key {quoted(key)}{nearest(key, valid)}")
        limits[key] = table.number(key, UNITS[key], above=0.0)
    return limits


def _places(table: Table, robot: Robot) -> tuple[list[tuple[int, int]], int]:
    """Return frames and components of a class, and 0 for angles or 1 for lengths."""
    names = table.require("frames", "a list of frame names")
    parts = table.require("components", 'a list such as ["TX"]')
    for key, value in (("frames", names), ("components", parts)):
        if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
            raise table.bad(key, "expected a list of names")
    for part in parts:
        if part not in SCREW:
            raise table.bad("components", f"found {quoted(part)}{nearest(part, SCREW)}")
    units = {int(SCREW.index(part) >= 3) for part in parts}
    if len(units) != 1:
        raise table.bad(
            "components",
            "expected components that are all angles or all lengths, at least one",
        )
    try:
        frames = frames_named(robot, names)
    except BadInput as error:
        raise table.bad("frames", str(error)) from None
    if not frames:
        raise table.bad("frames", "expected at least one frame")
    places = [
        (row, order[SCREW.index(part)])
        for name in frames for row, order in error_rows(robot, name) for part in parts
    ]  # fmt: skip
    return places, units.pop()
