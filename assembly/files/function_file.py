"""Reading and writing of the effect ``function`` in robot files."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from forcefit.assembly.effects.forms import FORMS, column_indices, shape_names
from forcefit.assembly.effects.formula import names_in, parameter_units, parse_formula
from forcefit.assembly.effects.functions import (
    FORMULA,
    columns_of,
    components_of,
    parameters_of,
    variable_names,
)
from forcefit.assembly.effects.units import (
    result_unit,
    turning_variables,
    variable_unit,
    whole_unit,
)
from forcefit.assembly.measurement.variables import FORCE, LOADS
from forcefit.assembly.model.function import KINDS, PLACES, Function
from forcefit.assembly.model.joint_names import names_of
from forcefit.assembly.model.robot import BASE, Robot
from forcefit.inputs.table import BadInput, Table, nearest, quoted

FUNCTION = "function"
_POSITIVE = ("time_constant", "period", "depth")
_KINDS_OF_VARIABLES = (
    "q.<frame>, wrench.<frame>.<mx..fz>, load.<mx..fz>, load.force, position.<x..z>, "
    "time, approach, cov.<name>"
)


def read_function(table: Table, robot: Robot) -> Function:
    """Read an effect that is defined by a function.

    Args:
        table: ``[[effect]]`` table with the name ``function``.
        robot: robot in the same file.

    Returns:
        The function.

    Raises:
        BadInput: a frame, component, variable, form or parameter is unknown or missing,
            or a formula is invalid or has inconsistent units.
    """
    label = table.text("label", "", longest=200)
    if label:
        table.place = f"effect {quoted(label)}"
    where = table.text("where", expected='a frame, "base", "reading" or "load"')
    places = (*names_of(robot), *PLACES)
    if where not in places:
        message = (
            f'found {quoted(where)}, expected a frame, "base", "reading" or "load"'
        )
        raise table.bad("where", f"{message}{nearest(where, places)}")
    if where in robot.joints:
        where = robot.joints[where].main
    kind = table.choice("kind", KINDS, "screw")
    if kind == "compliance" and where in {"reading", "load"}:
        raise table.bad("kind", f'found "compliance" for {where}, expected "screw"')
    components = _words(table, "components", 6)
    for name in components:
        valid = components_of(where, robot)
        if name not in valid:
            hint = nearest(name, valid)
            raise table.bad("components", f"found {quoted(name)}{hint}")
    variables = tuple(_of_main(v, robot) for v in _words(table, "variables", 2))
    for name in variables:
        _check_variable(table, name, robot)
    form = table.choice("form", (*FORMS, FORMULA))
    formula = table.text("formula", longest=500) if form == FORMULA else ""
    session = table.text("session", longest=200) if table.has("session") else None
    function = Function(
        where=where,
        components=components,
        variables=variables,
        form=form,
        parameters=_numbers(table, "parameters"),
        kind=kind,
        label=label,
        formula=formula,
        session=session,
        std=_numbers(table, "std", least=0.0),
    )
    table.finish()
    _check_parameters(table, function, robot)
    return function


def _words(table: Table, key: str, most: int) -> tuple[str, ...]:
    """Return a list of distinct names from a key of the table."""
    value = table.require(key, f"1 to {most} names")
    if isinstance(value, list) and all(isinstance(v, str) for v in value):
        if 1 <= len(value) <= most and len(set(value)) == len(value):
            return tuple(value)
    raise table.bad(key, f"found {value!r:.60}, expected 1 to {most} different names")


def _numbers(
    table: Table, key: str, least: float = -math.inf
) -> Mapping[str, float]:  # fmt: skip
    """Return the numbers in an inner table, or an empty dictionary."""
    if not table.has(key):
        return {}
    inner = table.table(key)
    return {name: inner.number(name, "SI", least=least) for name in inner.content}


def _of_main(variable: str, robot: Robot) -> str:
    """Replace the name of a joint in a variable by the name of its main frame."""
    kind, _, rest = variable.partition(".")
    name, _, axis = rest.rpartition(".")
    if kind == "wrench" and name in robot.joints:
        return f"wrench.{robot.joints[name].main}.{axis}"
    return variable


def _check_variable(table: Table, name: str, robot: Robot) -> None:
    """Check that a variable is recorded in measurements."""
    kind, _, rest = name.partition(".")
    frames = [frame.name for frame in robot.frames]
    if kind == "q":
        valid = [f"q.{f.name}" for f in robot.frames if f.joint != "fixed"]
    elif kind == "load":
        valid = [*(f"load.{axis}" for axis in LOADS), FORCE]
    elif kind == "position":
        valid = [f"position.{axis}" for axis in "xyz"]
    elif kind == "wrench":
        valid = [f"wrench.{f}.{axis}" for f in (*frames, BASE) for axis in LOADS]
    elif kind == "cov" and rest:
        return
    else:
        valid = ["time", "approach"]
    if name in valid:
        return
    hint = nearest(name, valid) if kind in {"q", "load", "position", "wrench"} else ""
    message = f"found {quoted(name)}, expected {_KINDS_OF_VARIABLES}"
    raise table.bad("variables", f"{message}{hint if 'did you' in hint else ''}")


def _check_parameters(table: Table, function: Function, robot: Robot) -> None:
    """Check that all required parameters of a form, and no others, are specified."""
    for name in function.std:
        if name not in function.parameters:
            hint = nearest(name, function.parameters)
            raise table.bad(
                "std", f"found {quoted(name)}, which is not a parameter{hint}"
            )
    if function.form == FORMULA:
        _check_formula(table, function, robot)
        return
    form, count = FORMS[function.form], len(function.variables)
    if count > form.most:
        message = f"found {count}, expected at most {form.most} for {form.name}"
        raise table.bad("variables", message)
    if count < form.least:
        message = f"found {count}, expected {form.least} for {form.name}"
        raise table.bad("variables", message)
    first = function.variables[0]
    if form.remembers and first.startswith("wrench."):
        message = (
            f"found {quoted(first)}, expected a variable other than a wrench, "
            f"because {form.name} depends on its history"
        )
        raise table.bad("variables", f"{message}; expected no wrench")
    shapes = shape_names(form, count)
    for component in function.components:
        own = parameters_of(function, component)
        for name in own:
            if name not in shapes and not form.is_column(name, count):
                message = (
                    f"found {quoted(name)}, which is not a parameter of {form.name}"
                )
                raise table.bad("parameters", f"{message}; expected {_example(form)}")
        for name, needed in shapes.items():
            if needed and name not in own:
                message = f"{quoted(name)} is missing; {form.name} requires it"
                raise table.bad("parameters", message)
            if name.partition(".")[0] in _POSITIVE and own.get(name, 1.0) <= 0:
                message = f"{quoted(name)}: found {own[name]:g}, expected > 0"
                raise table.bad("parameters", message)
        if form.name == "spline":
            _check_knots(table, function, component)
        if form.name == "knee" and own["at"] <= 0:
            raise table.bad("parameters", f'"at": found {own["at"]:g}, expected > 0')
    waving = turning_variables(function)
    unturned = any(whole_unit(variable_unit(robot, name)) != "rad" for name in waving)
    if unturned and "period" not in function.parameters:
        message = (
            '"period" is missing; expected because the variable is not an angle in rad'
        )
        raise table.bad("parameters", message)


def _check_knots(table: Table, function: Function, component: str) -> None:
    """Check that a spline has one value per knot, and that its knots increase."""
    names = columns_of(function, component)
    indices = np.array([column_indices(name) for name in names])
    wanted = math.prod(indices.max(axis=0).tolist()) if names else 2
    if len(names) != wanted or len(names) < 2:
        message = f"found {len(names)} values, expected one per knot, at least two"
        raise table.bad("parameters", message)
    own = parameters_of(function, component)
    for end in ("", ".1", ".2"):
        if f"first{end}" in own and not own[f"first{end}"] < own[f"last{end}"]:
            message = (
                f'found "first{end}" >= "last{end}"; expected "first{end}" < '
                f'"last{end}"'
            )
            raise table.bad("parameters", message)


def _check_formula(table: Table, function: Function, robot: Robot) -> None:
    """Check that the names in a formula are known and its units are consistent."""
    aliases = variable_names(function.variables)
    try:
        tree = parse_formula(function.formula)
        used = names_in(tree)
        for component in function.components:
            own = parameters_of(function, component)
            for name in used:
                if name not in aliases and name not in own:
                    hint = nearest(name, [*aliases, *own])
                    message = f"found {quoted(name)}, which is neither a variable nor"
                    raise BadInput(f"{message} a parameter{hint}")
            for name in own:
                if name in aliases or name not in used:
                    why = "also a variable" if name in aliases else "not in the formula"
                    raise BadInput(f"parameter {quoted(name)} is {why}")
            units = {
                name: variable_unit(robot, function.variables[k])
                for name, k in aliases.items()
            }
            parameter_units(tree, units, result_unit(function, component))
    except BadInput as error:
        raise table.bad("formula", str(error)) from None


def _example(form: Any) -> str:
    """Return examples of the parameter names of a form."""
    word = form.words[0]
    name = word if form.indices is None else f"1.{word}" if word else "1"
    shapes = [quoted(shape) for shape in form.shapes]
    return " or ".join([f"names such as {quoted(name)}", *shapes])


def function_table(function: Function) -> dict[str, Any]:
    """Return a function as a table for a robot file.

    Args:
        function: function of a robot.

    Returns:
        Keys and values, from which :func:`read_function` reads the same function.
    """
    table: dict[str, Any] = {"name": FUNCTION}
    if function.label:
        table["label"] = function.label
    table["where"] = function.where
    if function.kind != "screw":
        table["kind"] = function.kind
    table["components"] = list(function.components)
    table["variables"] = list(function.variables)
    table["form"] = function.form
    if function.formula:
        table["formula"] = function.formula
    table["parameters"] = dict(function.parameters)
    if function.std:
        table["std"] = dict(function.std)
    if function.session is not None:
        table["session"] = function.session
    return table
