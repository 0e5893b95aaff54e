"""``[[effect]]`` of a robot file: known effects of the machine."""

from collections.abc import Sequence

from assembly.effects import LIBRARY
from assembly.effects.effect import at
from assembly.model.robot import Robot
from forcefit.inputs.table import Table, nearest, quoted


def read_effects(tables: Sequence[Table], robot: Robot) -> dict[str, dict[str, float]]:
    """Effects of a robot file.

    Args:
        tables: every ``[[effect]]``.
        robot: of the same file.

    Returns:
        Parameters by their public names, by effect.

    Raises:
        BadInput: an unknown effect or parameter, an effect given twice or at a frame
            where it cannot act, or a value that is not a finite number.
    """
    effects: dict[str, dict[str, float]] = {}
    for table in tables:
        name = table.choice("name", tuple(LIBRARY))
        table.place = f"effect {quoted(name)}"
        if name in effects:
            raise table.bad("name", "found twice; expected one [[effect]] of each name")
        allowed = parameter_names(robot, name)
        inner = table.table("parameters") if table.has("parameters") else None
        table.finish()
        effects[name] = {}
        for key in inner.content if inner is not None else ():
            if key not in allowed:
                hint = nearest(key, allowed)
                message = f"found {quoted(key)}, which is no parameter of {name} here"
                raise table.bad("parameters", f"{message}{hint}")
            assert inner is not None
            effects[name][key] = inner.number(key, "SI")
    return effects


def parameter_names(robot: Robot, effect: str) -> tuple[str, ...]:
    """Public names of all parameters that an effect may have on a robot.

    Args:
        robot: any.
        effect: a name of the library.

    Returns:
        Names such as ``"leg1.drive"`` or ``"g.z"``.
    """
    one = LIBRARY[effect]
    if one.frames is None:
        return one.components
    return tuple(at(f, c) for f in one.frames(robot) for c in one.components)
