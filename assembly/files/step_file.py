"""Reading of assembly plans with assembly steps (``docs/assembly_steps.md``)."""

from collections.abc import Callable
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from forcefit.assembly.files.written_units import without_units
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.model.joint_names import names_of, row_of
from forcefit.assembly.model.largest import LARGEST, LARGEST_LENGTH
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.steps import run
from forcefit.assembly.steps.plan import (
    Adjust,
    Fix,
    Join,
    Measure,
    Plan,
    Preload,
    Release,
    Step,
    check_plan,
)
from forcefit.assembly.steps.run import StepResult
from forcefit.inputs.table import BadInput, Table, describe, nearest, quoted, read_toml
from forcefit.results.quantities import flag, number, text
from forcefit.results.records import (
    Each,
    Either,
    Listed,
    WithUnits,
    Words,
    record,
)
from forcefit.stiffness.screws import SCREW, WRENCH

KINDS = ("fix", "join", "clamp", "preload", "release", "measure", "adjust")
_COMPONENTS = tuple(name.lower() for name in SCREW)
_LOADS = tuple(name.lower() for name in WRENCH)
_MOST_STEPS = 1000

_PART = Either((text("frame"), text("the two frames of a closure", "frame")))
_NAMES = Listed(Words(_COMPONENTS))
_POSITION = Each(number("displacement", "rad or m"))
_STEP = record(
    name_=text("name of the step"),
    fix_=text("frame that is fixed by a fixture"), join_=_PART,
    clamp_=text("frame that is clamped"), preload_=text("frame that is loaded"),
    release_=Either((text("name of a step"), text("names of steps", "step"))),
    measure_=_PART, adjust_=text("frame whose geometric error is changed"),
    at_=_POSITION, stiffness_=Each(number("stiffness", "N m/rad or N/m")),
    locked_=Either((flag("bolted in the current position"), _NAMES)),
    force_limit_=number("maximum closing force", "N"),
    leave_open_=flag("permit a gap that remains at the maximum force"),
    load_=Each(number("load", "N m or N")), components_=_NAMES,
    reading_=_PART, of_=_NAMES, increment_=number("increment", "rad or m"),
)  # fmt: skip
PLAN_FILE = record(step=Listed(WithUnits(_STEP)))


def assemble_in_steps(
    plan: Plan | Path | str,
    posture: Posture,
    errors: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> list[StepResult]:
    """Simulate the steps of an assembly plan.

    Args:
        plan: assembly plan, or a TOML file with ``[[step]]`` tables.
        posture: posture in which the robot with n frames is assembled.
        errors: geometric errors of k machines, (k, n, 6) [rad, m]; None for the errors
            in the robot file.
        gravity: gravity in base axes, (3,) [m/s^2], which acts in all steps.  Bodies
            without a fixture or joint do not move under gravity.

    Returns:
        Results of the steps, in order.

    Raises:
        BadInput: the file is invalid, or the plan does not match the robot.
        CannotAssemble: the constraints on rigid bodies contradict each other.
        FreeMotion: a load acts along a motion without resistance.
        SolverFailed: the clearance solver did not converge.
    """
    steps = plan if isinstance(plan, Plan) else read_steps(plan, posture.robot)
    return run.assemble_in_steps(steps, posture, errors, gravity)


def read_steps(path: Path | str, robot: Robot) -> Plan:
    """Read an assembly plan and check that it matches a robot.

    Args:
        path: TOML file with ``[[step]]`` tables.
        robot: robot to be assembled.

    Returns:
        Assembly plan.

    Raises:
        BadInput: the file is invalid, or the plan does not match the robot.
    """
    root = read_toml(path)
    tables = root.tables("step")
    root.finish()
    if not 0 < len(tables) <= _MOST_STEPS:
        fault = f"found {len(tables)}" if tables else "missing"
        raise root.bad("step", f"{fault}; expected 1 to {_MOST_STEPS} tables [[step]]")
    plan = Plan(_named([_step(table, robot) for table in tables], tables))
    try:
        check_plan(plan, robot)
    except BadInput as error:
        raise BadInput(f"{root.file}: {error}") from None
    return plan


def _named(steps: list[Step], tables: list[Table]) -> tuple[Step, ...]:
    """Append numbers to default names of steps that are not unique."""
    count: dict[str, int] = {}
    named = []
    for step, table in zip(steps, tables, strict=True):
        number = count[step.name] = count.get(step.name, 0) + 1
        if number > 1 and "name" not in table.content:
            step = replace(step, name=f"{step.name} {number}")
        named.append(step)
    return tuple(named)


def _step(table: Table, robot: Robot) -> Step:
    """Read a ``[[step]]`` table."""
    given = [kind for kind in KINDS if table.has(kind)]
    if not given:
        for key in _STEP.content:
            table.has(key)  # so that ``finish`` rejects only unknown keys
        table.finish()
    if len(given) != 1:
        found = f"found {' and '.join(given)}" if given else "found no type of step"
        fault = f"{found}, expected one of {', '.join(KINDS)}"
        raise table.bad(given[-1] if given else "", fault)
    kind = given[0]
    step = _READERS[kind](table, _name(table, kind), robot)
    table.finish()
    return step


def _name(table: Table, kind: str) -> str:
    """Return the name of a step, which is its type and frames by default."""
    value = table.content[kind]
    parts = value if isinstance(value, list) else [value]
    return table.text("name", f"{kind} {' - '.join(map(str, parts))}", longest=400)


def _fix(table: Table, name: str, robot: Robot) -> Fix:
    """Read a step that fixes a frame by a fixture."""
    position = _values(table, "at", "rad or m")
    if position is None:
        position = dict.fromkeys(SCREW, 0.0)
    return _held(table, Fix(name, _frame(table, "fix", robot), position))


def _clamp(table: Table, name: str, robot: Robot) -> Step:
    """Read a step that clamps a frame at a position or by a force."""
    frame = _frame(table, "clamp", robot)
    if not table.has("load"):
        position = _values(table, "at", "rad or m")
        return _held(table, Fix(name, frame, position, kind="clamp"))
    if table.has("at"):
        raise table.bad("at", 'found together with "load", expected only one of them')
    return Preload(name, frame, _wrench(table))


def _held(table: Table, fix: Fix) -> Fix:
    """Add the stiffness in a table to a fixture."""
    stiffness = _values(table, "stiffness", "N m/rad or N/m") or {}
    for component, value in stiffness.items():
        if not 0 < value <= LARGEST:
            fault = f"found {value:g}, expected a number > 0, at most {LARGEST:g}"
            raise table.bad(f"stiffness.{component.lower()}", fault)
        if fix.position is not None and component not in fix.position:
            fault = 'found a component that is not in "at", expected a fixed component'
            raise table.bad(f"stiffness.{component.lower()}", fault)
    return replace(fix, stiffness=stiffness)


def _join(table: Table, name: str, robot: Robot) -> Join:
    """Read a step that joins a closure or bolts a joint."""
    part = _part(table, "join", robot)
    locked: tuple[str, ...] = ()
    if isinstance(table.content.get("locked"), bool):
        locked = SCREW if table.boolean("locked", False) else ()
    elif table.has("locked"):
        locked = _names(table, "locked")
    limit = inf
    if table.has("force_limit"):
        limit = table.number("force_limit", "N", least=0.0, largest=LARGEST)
    leave_open = table.boolean("leave_open", False)
    if isinstance(part, str) and (locked or limit < inf or leave_open):
        key = "locked" if locked else "force_limit" if limit < inf else "leave_open"
        fault = "found for a joint that is bolted in place; expected a closure"
        raise table.bad(key, fault)
    if leave_open and limit == inf:
        raise table.bad("leave_open", 'found without "force_limit", expected both')
    return Join(name, part, locked, limit, leave_open)


def _preload(table: Table, name: str, robot: Robot) -> Preload:
    """Read a step that applies a load."""
    return Preload(name, _frame(table, "preload", robot), _wrench(table))


def _release(table: Table, name: str, robot: Robot) -> Release:
    """Read a step that releases fixtures, clamps or loads from previous steps."""
    value = table.require("release", "the name of an earlier step, or a list of them")
    names = value if isinstance(value, list) else [value]
    if not names or not all(isinstance(n, str) for n in names):
        fault = f"found {describe(value)}, expected the name of an earlier step"
        raise table.bad("release", fault)
    return Release(name, tuple(names))


def _measure(table: Table, name: str, robot: Robot) -> Measure:
    """Read a measurement step."""
    part = _part(table, "measure", robot)
    return Measure(name, part, _names(table, "components", SCREW))


def _adjust(table: Table, name: str, robot: Robot) -> Adjust:
    """Read an adjustment step, which minimises a measured deviation."""
    components = _names(table, "components")
    reading = _part(table, "reading", robot)
    of: tuple[str, ...] = SCREW
    if isinstance(reading, str):
        of = _names(table, "of")
        if len({c[0] for c in of}) > 1:
            fault = "found rotations and translations together, expected one kind"
            raise table.bad("of", fault)
    dimension = "length" if components[0][0] == "T" else "angle"
    without_units(table, "increment", dimension)
    increment = table.number("increment", "rad or m", 0.0, least=0.0, largest=1e3)
    if increment and len({c[0] for c in components}) > 1:
        fault = "found for rotations and translations together, expected one kind"
        raise table.bad("increment", fault)
    frame = _frame(table, "adjust", robot)
    return Adjust(name, frame, components, Measure(name, reading, of), increment)


_READERS: dict[str, Callable[[Table, str, Robot], Step]] = {
    "fix": _fix, "join": _join, "clamp": _clamp, "preload": _preload,
    "release": _release, "measure": _measure, "adjust": _adjust,
}  # fmt: skip


def _frame(table: Table, key: str, robot: Robot) -> str:
    """Read the name of a frame; the name of a joint denotes its main frame."""
    name = table.text(key, expected="the name of a frame")
    names = names_of(robot)
    if name not in names:
        fault = f"found {quoted(name)}, expected the name of a frame"
        raise table.bad(key, f"{fault}{nearest(name, names)}")
    if key == "join" and name in robot.joints:
        frames = ", ".join(robot.joints[name].frames)
        fault = f"found {quoted(name)}, a joint of several motions"
        raise table.bad(key, f"{fault}; expected one of its frames {frames}")
    return robot.frames[row_of(robot, name)].name


def _part(table: Table, key: str, robot: Robot) -> tuple[str, str] | str:
    """Read a frame, or a closure that is specified by two frames or joints."""
    value = table.require(key, "a frame, or the two frames of a closure")
    if isinstance(value, str):
        return _frame(table, key, robot)
    proper = isinstance(value, list) and all(isinstance(v, str) for v in value)
    for first, second in (value, value[::-1]) if proper and len(value) == 2 else ():
        for pair in ((first, second), (f"{first}.end", second)):
            if pair in robot.closures:
                return pair
    known = ", ".join(f'["{a}", "{b}"]' for a, b in robot.closures) or "no closure"
    fault = f"found {describe(value)}, expected a frame or one of the closures {known}"
    raise table.bad(key, fault)


def _names(
    table: Table, key: str, default: tuple[str, ...] | None = None
) -> tuple[str, ...]:
    """Read a list of screw components."""
    if default is not None and not table.has(key):
        return default
    expected = f"a list of {', '.join(_COMPONENTS)}"
    value = table.require(key, expected)
    proper = isinstance(value, list) and all(v in _COMPONENTS for v in value)
    if not proper or not value or len(set(value)) < len(value):
        raise table.bad(key, f"found {describe(value)}, expected {expected}")
    return tuple(v.upper() for v in value)


def _values(table: Table, key: str, unit: str) -> dict[str, float] | None:
    """Read numbers by screw component, or return None if the key is absent."""
    if not table.has(key):
        return None
    inner, values = table.table(key), {}
    for name in _COMPONENTS:
        if unit == "rad or m":
            without_units(inner, name, "angle" if name[0] == "r" else "length")
        if inner.has(name):
            largest = LARGEST_LENGTH if unit == "rad or m" else LARGEST
            values[name.upper()] = inner.number(name, unit, largest=largest)
    inner.finish()
    if not values:
        raise table.bad(
            key,
            f"found no component, expected at least one of {', '.join(_COMPONENTS)}",
        )
    return values


def _wrench(table: Table) -> np.ndarray:
    """Read the wrench in the key ``load``, (6,) [N m, N]."""
    inner = table.table("load") if table.has("load") else None
    if inner is None:
        raise table.bad("load", "missing; expected a table such as { fz = -50 }")
    values = [inner.number(name, "N m or N", 0.0, largest=LARGEST) for name in _LOADS]
    inner.finish()
    if not any(values):
        raise table.bad(
            "load", f"found no component, expected at least one of {', '.join(_LOADS)}"
        )
    return np.array(values)
