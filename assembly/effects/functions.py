"""Apply general effects (functions) from a robot file or a diagnosis.

A function changes the stress-free screws at a frame, the pose of the base, the reading,
or the load.  A function that depends on a wrench, for example a compliance, is solved
together with the equilibrium (:mod:`forcefit.assembly.measurement.yields`).
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.base_compliance import on_foundation
from forcefit.assembly.effects.forms import FORMS, shape_names
from forcefit.assembly.effects.formula import evaluate, parse_formula
from forcefit.assembly.effects.places import with_screws
from forcefit.assembly.measurement.conditions import Conditions, Yield
from forcefit.assembly.measurement.variables import LOADS, past, variable
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.links import own_screw
from forcefit.assembly.model.robot import BASE, Robot
from forcefit.inputs.errors import BadInput
from forcefit.stiffness.screws import SCREW

AXES = tuple(axis.lower() for axis in SCREW)
THREAD = "rs"  # [rad] motion along the thread of a helical joint
FORMULA = "formula"
CLOCKS = ("time", "cov.time")
_parsed = lru_cache(maxsize=256)(parse_formula)


def along(robot: Robot, where: str, component: str, values: NDArray) -> NDArray:
    """Project screws or wrenches onto a component at a frame.

    Args:
        robot: any robot.
        where: name of a frame.
        component: ``rx`` .. ``tz``, or ``rs`` for a helical joint.
        values: (..., 6) screws or wrenches at the frame.

    Returns:
        Products of the values with the unit screw, (...).
    """
    if component == THREAD:
        return values @ unit_screw(robot, where, component)
    return values[..., AXES.index(component)]


def is_loaded(function: Function) -> bool:
    """Return whether the value of a function depends on wrenches in the robot."""
    wrench = any(name.startswith("wrench.") for name in function.variables)
    return wrench or function.kind == "compliance"


def covariates_of(robot: Robot, sessions: Iterable[str]) -> dict[str, str]:
    """Return the covariates on which the functions of a robot depend.

    Args:
        robot: robot with its functions.
        sessions: sessions to consider.

    Returns:
        Covariates without the prefix ``cov.``, each with the title of a function that
        depends on it.
    """
    owners: dict[str, str] = {}
    for function in robot.functions:
        if function.session not in (None, *sessions):
            continue
        names = [n.removeprefix("cov.") for n in function.variables if _is_covariate(n)]
        form = FORMS.get(function.form)
        if form is not None and form.remembers:
            late = "time_constant" in form.shapes
            names.append("time" if late else "approach")
        owners |= dict.fromkeys(names, function.title)
    return owners


def _is_covariate(name: str) -> bool:
    return name in {"time", "approach"} or name.startswith("cov.")


def components_of(where: str, robot: Robot) -> tuple[str, ...]:
    """Return the components that a function can have.

    Args:
        where: name of a frame, ``"base"``, ``"reading"`` or ``"load"``.
        robot: the robot on which it acts.

    Returns:
        ``mx`` .. ``fz`` for the load, otherwise ``rx`` .. ``tz``, and ``rs`` for a
        helical joint.
    """
    threads = [frame.name for frame in robot.frames if frame.pitch]
    return LOADS if where == "load" else (*AXES, *[THREAD] * (where in threads))


def unit_screw(robot: Robot, where: str, component: str) -> NDArray:
    """Return the unit screw or unit wrench of a component, (6,)."""
    if component == THREAD:
        return own_screw(robot.frame(where))
    return np.eye(6)[(LOADS if where == "load" else AXES).index(component)]


def parameters_of(function: Function, component: str) -> dict[str, float]:
    """Return the parameters of a function for one component."""
    own: dict[str, float] = {}
    for name, value in function.parameters.items():
        whose, _, rest = name.partition(".")
        if whose not in function.components:
            own.setdefault(name, value)
        elif whose == component:
            own[rest] = value
    return own


def columns_of(function: Function, component: str) -> list[str]:
    """Return the names of the coefficients in which a function is linear."""
    if function.form == FORMULA:
        return []
    shapes = shape_names(FORMS[function.form], len(function.variables))
    return [name for name in parameters_of(function, component) if name not in shapes]


def basis(conditions: Conditions, function: Function, names: Sequence[str]) -> NDArray:
    """Evaluate the basis functions of a function.

    Args:
        conditions: conditions of R measurements.
        function: function with a form and without wrenches.  Only its shapes are used,
            not its coefficients.
        names: p names of basis functions, such as ``"1.sine"``.

    Returns:
        (R, p) values of the basis functions in the units of the variables; NaN where a
        variable is unknown.
    """
    shapes = parameters_of(function, function.components[0])
    inputs = inputs_of(conditions, function)
    return FORMS[function.form].basis(names, list(inputs.T), shapes)


def inputs_of(conditions: Conditions, function: Function) -> NDArray:
    """Evaluate the inputs of a function.

    Args:
        conditions: conditions of R measurements.
        function: the function.

    Returns:
        (R, k) values of the variables, NaN for wrenches.  If the form depends on
        earlier values, the present state replaces the first variable.
    """
    first, *further = function.variables
    inputs = [_now(conditions, name) for name in further]
    form = FORMS.get(function.form)
    if form is None or not form.remembers:
        return np.column_stack([_now(conditions, first), *inputs])
    history, row = past(conditions, [first])
    if form.name == "slip":
        depth = parameters_of(function, function.components[0])["depth"]
        return history.slip(first, depth)[row, None]
    if form.name == "reversal_waves":
        angle = inputs[0] if inputs else _now(conditions, first)
        return np.column_stack([history.direction(first)[row], angle])
    if form.name == "reversal":
        # Friction depends on the magnitude of the load.
        sizes = [
            np.abs(x) if name.startswith("load.") else x
            for name, x in zip(further, inputs, strict=True)
        ]
        return np.column_stack([history.direction(first)[row], *sizes])
    shapes = parameters_of(function, function.components[0])
    late = shapes["time_constant"]
    # For the variable ``time``, the input is the lagged response to a unit step at time
    # 0.
    if first in CLOCKS:
        return np.column_stack([1.0 - history.fading(late), history.fading(late)])[row]
    lagged = history.lagged(first, late, held=form.name == "creep")
    return np.column_stack([lagged[row], history.fading(late)[row]])


def _now(conditions: Conditions, name: str) -> NDArray:
    """Return the present values of a variable, (R,)."""
    if name.startswith("wrench."):
        return np.full(len(conditions), np.nan)
    if conditions.history is not None and conditions.row is not None:
        return conditions.history.values[name][conditions.row]
    return variable(conditions, name)


def value_of(function: Function, component: str, inputs: Sequence[NDArray]) -> NDArray:
    """Evaluate one component of a function.

    Args:
        function: the function.
        component: one of the components of the function.
        inputs: (R,) values of each input, from :func:`inputs_of`.

    Returns:
        (R,) values [rad, m, N m, N]; for a compliance, values per unit of the wrench.
    """
    numbers = parameters_of(function, component)
    if function.form == FORMULA:
        aliases = variable_names(function.variables)
        known = {name: np.asarray(number) for name, number in numbers.items()}
        known |= {name: inputs[k] for name, k in aliases.items()}
        values = evaluate(_parsed(function.formula), known)
        return np.broadcast_to(values, inputs[0].shape)
    names = columns_of(function, component)
    columns = FORMS[function.form].basis(names, inputs, numbers)
    return columns @ np.array([numbers[name] for name in names])


def variable_names(variables: Sequence[str]) -> dict[str, int]:
    """Return the names that a formula can use for its variables.

    Args:
        variables: public names of the variables.

    Returns:
        Index of the variable for each name.  A variable can be named by the last part
        of its public name, by the first part if this is unique, and by the public name
        with ``_`` in place of dots.
    """
    indices: dict[str, list[int]] = {}
    for k, name in enumerate(variables):
        parts = name.split(".")
        for spelt in dict.fromkeys([parts[-1], parts[0], "_".join(parts)]):
            indices.setdefault(spelt, []).append(k)
    return {name: which[0] for name, which in indices.items() if len(which) == 1}


def apply_functions(
    conditions: Conditions,
    functions: Iterable[Function],
    recorded: Conditions | None = None,
) -> Conditions:
    """Apply functions to the conditions of their sessions.

    Args:
        conditions: conditions of R measurements.
        functions: functions to apply.
        recorded: conditions without effects, from which the inputs are computed.

    Returns:
        The conditions with all functions applied.

    Raises:
        BadInput: a function is not finite for one of the measurements.
    """
    recorded = conditions if recorded is None else recorded
    for function in functions:
        acts = in_session(conditions, function.session)
        if acts.any():
            inputs = inputs_of(recorded, function)
            conditions = _with_function(conditions, function, inputs, acts)
    return conditions


def in_session(conditions: Conditions, session: str | None) -> NDArray:
    """Return a mask (R,) of the readings in a session, or of all readings for None."""
    if session is None:
        return np.ones(len(conditions), dtype=bool)
    if conditions.session is None:
        return np.zeros(len(conditions), dtype=bool)
    return conditions.session == session


def _with_function(
    conditions: Conditions, function: Function, inputs: NDArray, acts: NDArray
) -> Conditions:
    """Add a function that acts in the given measurements."""
    where = function.where
    named = [name.split(".")[1] for name in function.variables if "wrench" in name]
    if BASE in (where, *named):
        conditions = on_foundation(conditions)
        where = conditions.robot.frames[0].name if where == BASE else where
    if is_loaded(function):
        return _yielding(conditions, function, where, inputs, acts)
    change = np.zeros((len(conditions), 6))
    for component in function.components:
        values = np.where(acts, value_of(function, component, list(inputs.T)), 0.0)
        _check_finite(function, values, inputs)
        change += values[:, None] * unit_screw(conditions.robot, where, component)
    if where == "reading":
        return replace(conditions, reading=conditions.reading + change)
    if where == "load":
        return replace(conditions, load=conditions.load + change)
    return with_screws(conditions, where, change)


def _check_finite(function: Function, values: NDArray, inputs: NDArray) -> None:
    """Raise BadInput if a function is not finite in a measurement."""
    for row in np.flatnonzero(~np.isfinite(values))[:1]:
        known = zip(function.variables, inputs[row], strict=False)
        where = ", ".join(f"{name} = {x:g}" for name, x in known)
        raise BadInput(
            f'effect "{function.title}": found {values[row]:g} at {where}, expected a '
            "finite number"
        )


def _yielding(
    conditions: Conditions,
    function: Function,
    where: str,
    inputs: NDArray,
    acts: NDArray,
) -> Conditions:
    """Add a deflection law to the conditions."""
    slots: dict[int, int] = {}  # column of the inputs for each wrench index
    through: list[tuple[str, int]] = []
    for k, name in enumerate(function.variables):
        if name.startswith("wrench."):
            frame, _, component = name.removeprefix("wrench.").rpartition(".")
            frame = conditions.robot.frames[0].name if frame == BASE else frame
            slots[k] = len(through)
            through.append((frame, LOADS.index(component)))
    sized = function.form == "reversal"
    new = []
    for component in function.components:
        row = (*AXES, THREAD).index(component)

        def law(x: NDArray, w: NDArray, component: str = component) -> NDArray:
            known = [
                (np.abs(w[:, slots[k]]) if sized else w[:, slots[k]])
                if k in slots else x[:, k]
                for k in range(x.shape[1] - 1)
            ]  # fmt: skip
            values = value_of(function, component, known)
            if function.kind == "compliance":
                values = values * w[:, -1]
            return np.where(x[:, -1] > 0, values, 0.0)

        own = [(where, row)] if function.kind == "compliance" else []
        x = np.column_stack([inputs, acts])
        spring = bool(own) and not through
        new.append(Yield(where, row, (*through, *own), x, law, spring))
    return replace(conditions, yields=(*conditions.yields, *new))


def in_session_alone(
    conditions: Conditions, changed: Conditions, session: str
) -> Conditions:
    """Restrict effects to the measurements of one session.

    Args:
        conditions: conditions of R measurements without the effects.
        changed: conditions of the same measurements with these effects.
        session: name of the session in which the effects act.

    Returns:
        Conditions that equal ``changed`` in this session, and ``conditions`` in other
        sessions.
    """
    acts = in_session(conditions, session)[:, None]

    def mixed(name: str) -> NDArray:
        return np.where(acts, getattr(changed, name), getattr(conditions, name))

    errors = np.where(acts[:, :, None], changed.errors, conditions.errors)
    return replace(
        conditions, errors=errors, load=mixed("load"), gravity=mixed("gravity"),
        reading=mixed("reading"), base=mixed("base"), tool=mixed("tool"),
    )  # fmt: skip
