"""Evaluate the variables of effects, such as ``q.drive``, ``load.fz`` and ``time``.

Wrenches such as ``wrench.drive.mz`` are excluded, because they depend on the
equilibrium.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.measurement.conditions import COVARIATES, Conditions
from forcefit.assembly.measurement.history import History, in_order
from forcefit.stiffness.screws import WRENCH

FORCE = "load.force"  # magnitude of the platform force
LOADS = tuple(name.lower() for name in WRENCH)


def variable(conditions: Conditions, name: str) -> NDArray:
    """Return the values of a variable in all measurements.

    Args:
        conditions: conditions of R measurements.
        name: public name of the variable, which must not be a wrench.

    Returns:
        (R,) values, NaN if unknown.
    """
    kind, _, rest = name.partition(".")
    if kind == "q":
        return conditions.coordinates[:, conditions.robot.index(rest)]
    if name == FORCE:
        return np.linalg.norm(conditions.load[:, 3:], axis=1)
    if kind == "load":
        return conditions.load[:, LOADS.index(rest)]
    if kind == "position":
        return conditions.postures.platform[:, "xyz".index(rest), 3]
    covariate = rest if kind == "cov" else name
    if covariate in COVARIATES:
        values: NDArray = getattr(conditions, covariate)
        return values
    return conditions.covariates.get(covariate, np.full(len(conditions), np.nan))


def past(conditions: Conditions, names: Iterable[str]) -> tuple[History, NDArray]:
    """Return the measurement history to which the given measurements belong.

    Args:
        conditions: conditions of R measurements.
        names: names of the required variables.

    Returns:
        The history, and the indices of the measurements in it, (R,).  Without a
        history, each measurement is the first of a separate session.
    """
    if conditions.history is not None and conditions.row is not None:
        return conditions.history, conditions.row
    asked = dict.fromkeys([*names, "time", "approach"])
    values = {name: variable(conditions, name) for name in asked}
    return History(values, np.ones(len(conditions), dtype=bool)), np.arange(
        len(conditions)
    )


def with_history(conditions: Conditions) -> Conditions:
    """Add a history that consists of the given measurements in their order.

    Args:
        conditions: conditions of R measurements.

    Returns:
        The conditions with ``history``.
    """
    names = [f"q.{frame.name}" for frame in conditions.robot.frames]
    names += [f"load.{name}" for name in LOADS]
    names.append(FORCE)
    names += [f"position.{axis}" for axis in "xyz"]
    names += [
        "time",
        "approach",
        *(f"cov.{c}" for c in (*COVARIATES, *conditions.covariates)),
    ]
    values = {name: variable(conditions, name) for name in names}
    history, row = in_order(values, conditions.session)
    return replace(conditions, history=history, row=row)
