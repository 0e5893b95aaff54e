"""Reading and writing of ``[[effect]]`` tables, which define known effects."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.effects.effect import Values, at
from forcefit.assembly.files.function_file import (
    FUNCTION,
    function_table,
    read_function,
)
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, Table, nearest, quoted


def with_effects(robot: Robot, tables: Sequence[Table]) -> Robot:
    """Add the effects in a robot file to the robot.

    Args:
        robot: robot without effects from the same file.
        tables: all ``[[effect]]`` tables.

    Returns:
        Robot with effects.

    Raises:
        BadInput: an effect or parameter is unknown, an effect occurs twice or at a
            frame where it cannot act, or a value is not a finite number.
    """
    everywhere: dict[str, Values] = {}
    sessions: dict[str, dict[str, Values]] = {}
    functions = []
    for table in tables:
        name = table.choice("name", (*LIBRARY, FUNCTION))
        table.place = f"effect {quoted(name)}"
        if name == FUNCTION:
            functions.append(read_function(table, robot))
            continue
        try:
            effect = LIBRARY[name]
        except BadInput as error:  # an effect from another distribution is invalid
            raise table.bad("name", str(error)) from None
        session = table.text("session", longest=200) if table.has("session") else None
        if session is not None and not effect.by_row:
            raise table.bad(
                "session",
                f"found a session, but {name} acts in all sessions; remove session",
            )
        effects = everywhere if session is None else sessions.setdefault(session, {})
        if name in effects:
            raise table.bad(
                "name", "found this name twice; expected one [[effect]] per name"
            )
        effects[name] = _parameters(table, robot, name)
    return replace(
        robot, effects=everywhere, session_effects=sessions, functions=tuple(functions)
    )


def _parameters(table: Table, robot: Robot, effect: str) -> Values:
    """Read the parameters of an effect that is defined in the library."""
    allowed = parameter_names(robot, effect)
    inner = table.table("parameters") if table.has("parameters") else None
    table.finish()
    given = {} if inner is None else inner.content
    for key in given:
        if key not in allowed:
            hint = nearest(key, allowed)
            message = f"found {quoted(key)}, which is not a parameter of {effect}"
            raise table.bad("parameters", f"{message}{hint}")
    # time constants are required and positive
    times = {key for key in allowed if LIBRARY[effect].unit(robot, key) == "s"}
    for key in sorted(times - set(given)):
        owner = key.rpartition(".")[0]
        if not owner or any(k == owner or k.startswith(f"{owner}.") for k in given):
            raise table.bad(
                "parameters", f"{quoted(key)} is missing; expected a time in s"
            )
    if inner is None:
        return {}
    return {
        key: inner.number(key, "SI", above=0.0 if key in times else -math.inf)
        for key in given
    }


def effect_tables(robot: Robot) -> list[dict[str, Any]]:
    """Return the effects of a robot as tables for a robot file.

    Args:
        robot: robot with effects.

    Returns:
        One table per effect, from which :func:`with_effects` reads the same effects.
    """

    def listed(
        effects: Mapping[str, Values], **more: str
    ) -> list[dict[str, Any]]:  # fmt: skip
        return [
            {"name": name, "parameters": dict(values), **more}
            for name, values in effects.items()
        ]

    tables = listed(robot.effects)
    for session, effects in robot.session_effects.items():
        tables += listed(effects, session=session)
    return tables + [function_table(function) for function in robot.functions]


def parameter_names(robot: Robot, effect: str) -> tuple[str, ...]:
    """Return the names of all parameters of an effect.

    Args:
        robot: robot to which the effect is applied.
        effect: name of an effect in the library.

    Returns:
        Names such as ``"leg1.drive"`` or ``"g.z"``.
    """
    one = LIBRARY[effect]
    if one.frames is None:
        return one.components
    return tuple(at(f, c) for f in one.frames(robot) for c in one.components)
