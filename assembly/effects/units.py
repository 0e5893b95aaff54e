"""Units of the variables, results and parameters of functions."""

from forcefit.assembly.effects.forms import FORMS, column_indices, shape_names
from forcefit.assembly.effects.formula import (
    Unit,
    parameter_units,
    parse_formula,
    unit_text,
)
from forcefit.assembly.effects.functions import (
    CLOCKS,
    FORMULA,
    parameters_of,
    variable_names,
)
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.robot import Robot

_COVARIATES: dict[str, Unit] = {"temperature": {"K": 1}, "time": {"s": 1}}
_ANGLE: Unit = {}  # rad is dimensionless


def variable_unit(robot: Robot, name: str) -> Unit:
    """Return the unit of a variable as exponents of m, N, s, K and covariate names.

    Args:
        robot: robot with the variable.
        name: public name of the variable.

    Returns:
        Exponents by unit; empty for dimensionless variables.
    """
    kind, _, rest = name.partition(".")
    if kind == "q":
        return {"m": 1} if robot.frame(rest).joint == "prismatic" else _ANGLE
    if kind in {"load", "wrench"}:
        moment = rest.rpartition(".")[2].startswith("m")
        return {"N": 1, "m": 1} if moment else {"N": 1}
    if kind == "position":
        return {"m": 1}
    covariate = rest if kind == "cov" else name
    if covariate == "approach":
        return _ANGLE
    return _COVARIATES.get(covariate, {f"[{covariate}]": 1})


def result_unit(function: Function, component: str) -> Unit:
    """Return the unit of one component of the result of a function."""
    turns = component.startswith(("r", "m"))
    if function.where == "load":
        return {"N": 1, "m": 1} if turns else {"N": 1}
    screw: dict[str, float] = {} if turns else {"m": 1}
    if function.kind == "screw":
        return screw
    wrench: Unit = {"N": 1, "m": 1} if turns else {"N": 1}
    names = dict.fromkeys([*screw, *wrench])
    return {name: screw.get(name, 0) - wrench.get(name, 0) for name in names}


def units_of(robot: Robot, function: Function) -> dict[str, str]:
    """Return the units of the parameters of a function in robot files.

    Args:
        robot: robot on which the function acts.
        function: any function.

    Returns:
        Unit of each parameter, such as ``"rad/K"``.
    """
    units: dict[str, str] = {}
    for component in function.components:
        for name in parameters_of(function, component):
            full = f"{component}.{name}"
            full = full if full in function.parameters else name
            units[full] = _parameter_unit(robot, function, component, name)
    return {name: units[name] for name in function.parameters}


def _parameter_unit(
    robot: Robot, function: Function, component: str, name: str
) -> str:  # fmt: skip
    """Return the unit of a parameter for one component of the function."""
    given = [variable_unit(robot, variable) for variable in function.variables]
    whole = result_unit(function, component)
    angle = component.startswith("r") and function.where != "load"
    if function.form == FORMULA:
        aliases = variable_names(function.variables)
        known = {alias: given[k] for alias, k in aliases.items()}
        units = parameter_units(parse_formula(function.formula), known, whole)
        return unit_text(units.get(name, {}))
    form = FORMS[function.form]
    if name in shape_names(form, len(given)):
        if name == "time_constant":
            return "s"
        if name == "period":
            return whole_unit(variable_unit(robot, turning_variables(function)[0]))
        return whole_unit(given[int(name[-1]) - 1 if name[-1].isdigit() else 0])
    powers = [0] * len(given)
    if form.name in {"powers", "reversal"}:
        powers = column_indices(name)
        given = given[-1:] if form.name == "reversal" else given
    elif form.name == "scaled_waves":
        powers = [0, 1]
    elif form.name == "knee":
        powers = [int(name != "size")]
    elif form.remembers and len(given) == 1:
        powers = [int(name == "gain" and function.variables[0] not in CLOCKS)]
    unit = dict(whole)
    for each, power in zip(given, powers, strict=True):
        for key, k in each.items():
            unit[key] = unit.get(key, 0) - power * k
    text = unit_text(unit)
    return f"rad{text.removeprefix('1')}" if angle and text.startswith("1") else text


def turning_variables(function: Function) -> tuple[str, ...]:
    """Return the variables in which a function is periodic."""
    if function.form == "reversal_waves":
        return function.variables[-1:]
    if function.form == "scaled_waves":
        return function.variables[:1]
    return function.variables if function.form in {"waves", "slow_wave"} else ()


def whole_unit(unit: Unit) -> str:
    """Return the unit of a variable as text, ``rad`` if dimensionless."""
    return unit_text(unit) if unit else "rad"
