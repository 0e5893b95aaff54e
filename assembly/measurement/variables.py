"""What effects may depend on, by public name: ``q.drive``, ``load.fz``, ``time`` ..

Wrenches (``wrench.drive.mz``) are not among them: the equilibrium alone gives them.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.conditions import COVARIATES, Conditions
from assembly.measurement.history import History, in_order
from stiffness.screws import WRENCH

FORCE = "load.force"  # the size of the force
LOADS = tuple(name.lower() for name in WRENCH)


def variable(conditions: Conditions, name: str) -> NDArray:
    """Return a variable in every row.

    Args:
        conditions: R rows.
        name: public, of no wrench.

    Returns:
        (R,) NaN where it is not known.
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
    """Return the rows that conditions come after.

    Args:
        conditions: R rows.
        names: variables asked for.

    Returns:
        Their history, and (R,) which of its rows they are; rows without a past
        are the first rows of sessions of their own.
    """
    if conditions.history is not None and conditions.row is not None:
        return conditions.history, conditions.row
    asked = dict.fromkeys([*names, "time", "approach"])
    values = {name: variable(conditions, name) for name in asked}
    return History(values, np.ones(len(conditions), dtype=bool)), np.arange(
        len(conditions)
    )


def with_history(conditions: Conditions) -> Conditions:
    """Return conditions whose rows were measured one after the other, as a campaign's.

    Args:
        conditions: R rows, as declared.

    Returns:
        The same; parts that :meth:`Conditions.take` takes remember all of them.
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
