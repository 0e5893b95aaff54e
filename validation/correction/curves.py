"""Plot the functions in a robot file with their uncertainty.

Functions describe deviations that depend on temperature, time, load or position.  If a
function depends on previous values of its variable, the response to a unit step is
plotted over time. If a function depends on the direction of motion, it is plotted for
increasing values.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.forms import FORMS
from forcefit.assembly.effects.formula import unit_text
from forcefit.assembly.effects.functions import CLOCKS, parameters_of, value_of
from forcefit.assembly.effects.units import (
    result_unit,
    units_of,
    variable_unit,
    whole_unit,
)
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.errors import plot_label
from forcefit.results.display import html_table, short_repr
from forcefit.validation.diagnosis.saved_covariance import FUNCTION, known_covariance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_POINTS = 181
_SHOWN = 13  # number of points of each curve in the text
_LATE = 4.0  # [time constants or periods] plotted duration of a step response
# Half of the plotted range of each variable, in the unit of the variable.
_RANGES = {"temperature": 10.0, "approach": 1.0}
_LOAD = 100.0  # [N, N m] half of the plotted range of a load component
_TRAVEL = 0.5  # [m] half of the plotted range of a position


@dataclass(frozen=True, eq=False)
class Curve:
    """Values of one component of a function along one variable.

    Attributes:
        function: the function.
        component: plotted component of the screw or compliance.
        variable: variable on the horizontal axis.
        constant: name and constant value of the second variable. None if the function
            has one variable.
        x: (k,) values of the variable, in its unit.
        values: (k,) values of the component [rad, m, N m, N], divided by N or N m for a
            compliance.
        std: (k,) standard deviations; 0 if the robot file contains no uncertainty.
        units: unit of ``x``, and unit of ``values``.
    """

    function: Function
    component: str
    variable: str
    constant: tuple[str, float] | None
    x: NDArray
    values: NDArray
    std: NDArray
    units: tuple[str, str]

    __repr__, _repr_html_ = short_repr, html_table


def curves_of(
    robot: Robot, over: Mapping[str, tuple[float, float]] | None = None
) -> list[Curve]:
    """Evaluate all functions of a robot along curves.

    Args:
        robot: robot with its functions.
        over: mapping from variable to its smallest and largest plotted value.  By
            default, it is the range of the knots for splines, a full turn for angles,
            and a typical range for other variables.

    Returns:
        One curve for each component of a function of one variable. Three curves for
        each component of a function of two variables, with different values of the
        second variable.
    """
    curves = []
    for function in robot.functions:
        along, others = _variables(function)
        least, most = (over or {}).get(along) or _range(robot, function, along)
        x = np.linspace(least, most, _POINTS)
        constants: list[tuple[str, float] | None] = [None]
        if others:
            ends = (over or {}).get(others) or _range(robot, function, others)
            constants = [(others, v) for v in np.linspace(*ends, 3).tolist()]
        for component in function.components:
            for fixed in constants:
                curves.append(_curve(robot, function, component, along, fixed, x))
    return curves


def _variables(function: Function) -> tuple[str, str]:
    """Return the plotted variable and the second variable, if there is one."""
    first, *rest = function.variables
    if function.form in {"lag", "creep"}:
        return "time", ""
    if function.form in {"reversal", "reversal_waves"}:
        return (rest or [first])[0], ""
    return first, (rest or [""])[0]


def _curve(
    robot: Robot, function: Function, component: str, along: str,
    fixed: tuple[str, float] | None, x: NDArray,
) -> Curve:  # fmt: skip
    """Return a curve with its standard deviations."""
    values = _values(function, component, x, fixed)
    numbers, C = _covariance_of(robot, function)
    slopes = np.zeros((len(numbers), len(values)))
    for slope, name, sigma in zip(slopes, numbers, np.sqrt(np.diag(C)), strict=True):
        if sigma > 0.0:
            more = {**function.parameters, name: function.parameters[name] + sigma}
            changed = _values(replace(function, parameters=more), component, x, fixed)
            slope[:] = np.nan_to_num(changed - values) / sigma
    variance = np.maximum(np.einsum("kx,kl,lx->x", slopes, C, slopes), 0.0)
    turns = component.startswith("r") and function.where != "load"
    given = unit_text(result_unit(function, component))
    value_unit = f"rad{given.removeprefix('1')}" if turns else given
    x_unit = "s" if along == "time" else whole_unit(variable_unit(robot, along))
    return Curve(
        function=function,
        component=component,
        variable=along,
        constant=fixed,
        x=x,
        values=values,
        std=np.sqrt(variance),
        units=(x_unit, value_unit),
    )


def _covariance_of(robot: Robot, function: Function) -> tuple[list[str], NDArray]:
    """Return the uncertain parameters of a function, and their covariance (k, k)."""
    known = known_covariance(robot)
    place = str(next(k for k, f in enumerate(robot.functions) if f is function))
    own = [
        k for k, n in enumerate(known.numbers)
        if n.kind == FUNCTION and n.owner == place
    ]  # fmt: skip
    names = [known.numbers[k].name for k in own]
    return names, known.covariance[np.ix_(own, own)]


def _values(
    function: Function, component: str, x: NDArray, fixed: tuple[str, float] | None
) -> NDArray:
    """Return a component of the function at values x of the variable."""
    own = parameters_of(function, component)
    inputs = [x]
    if function.form in {"lag", "creep"}:
        left = np.exp(-x / own["time_constant"])
        inputs = [1.0 - left, left]
    elif function.form == "slip":
        inputs = [np.ones_like(x)]
    elif function.form == "reversal_waves":
        inputs = [np.ones_like(x), x]
    elif function.form == "reversal":
        sized = function.variables[-1].startswith(("load.", "wrench."))
        inputs = [np.ones_like(x), np.abs(x) if sized else x][: len(function.variables)]
    elif fixed is not None:
        inputs = [x, np.full_like(x, fixed[1])]
    return value_of(function, component, inputs)


def _range(robot: Robot, function: Function, variable: str) -> tuple[float, float]:
    """Return the plotted range of a variable."""
    own = parameters_of(function, function.components[0])
    k = function.variables.index(variable) if variable in function.variables else 0
    if function.form == "spline":
        at = f".{k + 1}" if len(function.variables) > 1 else ""
        return own[f"first{at}"], own[f"last{at}"]
    if "at" in own:
        return own["at"] - abs(own["at"]) - 1.0, own["at"] + abs(own["at"]) + 1.0
    if variable in CLOCKS:
        longest = max(own.get("time_constant", 0.0), own.get("period", 0.0))
        return 0.0, _LATE * (longest or 1000.0)
    kind, _, rest = variable.partition(".")
    if kind == "q":
        frame = robot.frame(rest)
        half = _TRAVEL if frame.joint == "prismatic" else pi
        return frame.limits or (-half, half)
    size = _LOAD if kind in {"load", "wrench"} else _RANGES.get(rest or kind, 1.0)
    return -size, size


def table(robot: Robot, curves: list[Curve]) -> list[dict[str, Any]]:
    """Convert the curves to plain values."""
    return [
        {
            "label": c.function.title,
            "where": c.function.where,
            "component": c.component,
            "kind": c.function.kind,
            "form": c.function.form,
            "formula": c.function.formula or None,
            "session": c.function.session,
            "parameters": [
                {"name": name, "value": value, "std": c.function.std.get(name),
                 "unit": unit}
                for (name, value), unit in zip(
                    c.function.parameters.items(),
                    units_of(robot, c.function).values(),
                    strict=True,
                )
            ],
            "variable": c.variable,
            "beside": None if c.constant is None else dict([c.constant]),
            "units": {"variable": c.units[0], "value": c.units[1]},
            "x": c.x, "value": c.values, "std": c.std,
        }
        for c in curves
    ]  # fmt: skip


def text(curves: list[Curve]) -> str:
    """Format the curves as text, with :data:`_SHOWN` points each."""
    lines: list[str] = []
    for c in curves:
        second = f", {c.constant[0]} = {c.constant[1]:.4g}" if c.constant else ""
        form = FORMS[c.function.form].summary if c.function.form in FORMS else "formula"
        lines += [
            "",
            f"{c.function.title}: {c.function.kind} {c.component} at "
            f"{c.function.where}, {form}{second}",
            f"{c.variable} [{c.units[0]}]    {c.component} [{c.units[1]}]    1 sigma",
        ]
        for i in np.linspace(0, _POINTS - 1, _SHOWN).astype(int).tolist():
            band = f"{c.std[i]:.2g}" if c.function.std else "-"
            lines.append(f"{c.x[i]:12.5g} {c.values[i]:14.5g}    {band}")
    return "\n".join(lines[1:])


def figure_of(curves: list[Curve]) -> "Figure":
    """Plot each curve in a separate panel, with a band of two standard deviations.

    Args:
        curves: result of :func:`curves_of`, at least one curve.

    Returns:
        The figure.
    """
    from matplotlib.figure import Figure

    columns = min(len(curves), 3)
    rows = -(-len(curves) // columns)
    figure = Figure(figsize=(4.2 * columns, 3.2 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, c in zip(panels, curves, strict=False):
        panel.fill_between(
            c.x, c.values - 2 * c.std, c.values + 2 * c.std, color="C0", alpha=0.25,
            lw=0,
        )  # fmt: skip
        panel.plot(c.x, c.values, color="C0")
        second = f", {c.constant[0]} = {c.constant[1]:.3g}" if c.constant else ""
        panel.set_title(plot_label(f"{c.function.title}{second}"), fontsize=9)
        panel.set_xlabel(plot_label(f"{c.variable} [{c.units[0]}]"))
        panel.set_ylabel(plot_label(f"{c.component} [{c.units[1]}]"))
        panel.grid(visible=True, alpha=0.3)
    for panel in panels[len(curves) :]:
        panel.set_visible(False)
    return figure
