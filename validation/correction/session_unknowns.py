"""Define the robot parameters that are fitted in every session.

These are the pose of the measuring device, the effect ``drift``, the functions of time
and, if requested, the measured point and the zeros of the joints.  A slow wave or a
step in one session is not expected to repeat. The prior mean of its coefficients is
therefore 0, and their prior standard deviation is their previous size. A lag or creep
starts again in every session, so the prior means of its coefficients are the previous
values.  No drift is fitted without a column ``cov.time``.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY, apply_effects
from forcefit.assembly.effects.functions import (
    CLOCKS,
    FORMULA,
    apply_functions,
    columns_of,
    parameters_of,
)
from forcefit.assembly.effects.registration import BASE, TOOL
from forcefit.assembly.effects.units import units_of
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.robot import Robot

OF_A_SESSION = ("registration", "tool", "zeros")
DRIFT = "drift"
_ZERO = 1e-3  # [rad, m] prior standard deviation of the change of a joint's zero
_SETTLING = ("lag", "creep")  # functional forms that start again in every session
_STEP = 1e-6  # [rad, m] step of numerical derivatives, except for drift
_CONSTANT = "time_constant"


def of_one_session(robot: Robot) -> tuple[dict[str, float], tuple[Function, ...]]:
    """Return the drift parameters and the functions of time of a robot."""
    functions = tuple(
        f for f in robot.functions
        if f.session is None and any(name in CLOCKS for name in f.variables)
    )  # fmt: skip
    return dict(robot.effects.get(DRIFT, {})), functions


def without_session(robot: Robot) -> Robot:
    """Return the robot without the pose of the device and without changes with time."""
    effects = {name: dict(values) for name, values in robot.effects.items()}
    effects.pop(DRIFT, None)
    tool = {k: v for k, v in effects.pop("registration", {}).items() if k in TOOL}
    if tool:
        effects["registration"] = tool
    own = of_one_session(robot)[1]
    kept = tuple(f for f in robot.functions if f not in own)
    return replace(robot, effects=effects, functions=kept)


@dataclass(frozen=True, eq=False)
class SessionUnknowns:
    """Prior of the k parameters that are fitted in a session.

    Attributes:
        names: for each parameter, the title of its effect or function, and its name.
        mean: (k,) prior means.
        prior: (k,) prior precisions, 1 / variance; 0 for a flat prior.
        step: (k,) step of the numerical derivative.
        constant: [s] time constant of the drift; None if no drift is fitted.
        functions: functions of time with fitted coefficients.
    """

    names: tuple[tuple[str, str], ...]
    mean: NDArray
    prior: NDArray
    step: NDArray
    constant: float | None
    functions: tuple[Function, ...]

    def __len__(self) -> int:
        return len(self.names)

    @property
    def owners(self) -> list[str]:
        """Title of each function in the list of parameters."""
        return [_owner(i, function) for i, function in enumerate(self.functions)]

    def effects(self, x: NDArray) -> dict[str, dict[str, float]]:
        """Return the library effects for parameter values x (k,)."""
        values: dict[str, dict[str, float]] = {}
        for (effect, name), value in zip(self.names, x.tolist(), strict=True):
            if effect in LIBRARY:
                values.setdefault(effect, {})[name] = value
        if DRIFT in values and self.constant is not None:
            values[DRIFT][_CONSTANT] = self.constant
        return values

    def functions_with(self, x: NDArray, session: str | None) -> tuple[Function, ...]:
        """Return the functions of time for parameter values x (k,)."""
        known = dict(zip(self.names, x.tolist(), strict=True))
        return tuple(
            replace(
                function,
                parameters={
                    key: known.get((owner, key), value)
                    for key, value in function.parameters.items()
                },
                std={},
                session=session,
            )
            for owner, function in zip(self.owners, self.functions, strict=True)
        )

    def applied(self, conditions: Conditions, x: NDArray) -> Conditions:
        """Return the conditions of the session's rows with parameter values x (k,)."""
        known = apply_effects(conditions, self.effects(x))
        return apply_functions(known, self.functions_with(x, None), conditions)


def session_unknowns(
    robot: Robot, fitted: Sequence[str], *, clock: bool
) -> SessionUnknowns:
    """Return the parameters that are fitted in a session.

    Args:
        robot: saved robot, including the parameters of its original session.
        fitted: names of parameters in :data:`OF_A_SESSION`.
        clock: whether the time of each row was recorded. Otherwise, no changes with
            time are fitted.

    Returns:
        The parameters.
    """
    names: list[tuple[str, str]] = []
    if "registration" in fitted:
        names += [("registration", name) for name in BASE]
    if "tool" in fitted:
        names += [("registration", name) for name in TOOL]
    sizes = [np.inf] * len(names)
    places = LIBRARY["encoder_offset"].frames
    assert places is not None
    zeros = [("encoder_offset", n) for n in places(robot)] if "zeros" in fitted else []
    names += zeros
    sizes += [_ZERO] * len(zeros)
    step, mean = [_STEP] * len(names), [0.0] * len(names)
    drift, functions = of_one_session(robot) if clock else ({}, ())
    constant = drift.pop(_CONSTANT, None)
    # A formula is not fitted, because it is not linear in its parameters.
    functions = tuple(f for f in functions if f.form != FORMULA)
    alone = {name: (name[-2], value) for name, value in drift.items()}
    owned = [(DRIFT, True, alone)]
    owned += [
        (_owner(i, f), f.form in _SETTLING, _numbers(robot, f))
        for i, f in enumerate(functions)
    ]
    for owner, settles, numbers in owned:
        for name, (unit, value) in numbers.items():
            if value:
                alike = [v for u, v in numbers.values() if u == unit]
                names.append((owner, name))
                mean.append(value if settles else 0.0)
                sizes.append(float(np.sqrt(np.mean(np.square(alike)))))
    step += sizes[len(step) :]
    return SessionUnknowns(
        names=tuple(names),
        mean=np.array(mean),
        prior=np.array(sizes) ** -2.0,
        step=np.array(step),
        constant=constant,
        functions=functions,
    )


def _owner(number: int, function: Function) -> str:
    """Return the title of a function in the list of parameters."""
    return f"function of time {number + 1}: {function.title}"


def _numbers(robot: Robot, function: Function) -> dict[str, tuple[str, float]]:
    """Return the unit and the value of each linear coefficient of a function."""
    numbers, units = {}, units_of(robot, function)
    for component in function.components:
        own = parameters_of(function, component)
        for name in columns_of(function, component):
            full = f"{component}.{name}"
            full = full if full in function.parameters else name
            numbers[full] = units[full], own[name]
    return numbers
