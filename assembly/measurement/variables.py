"""Variables of effects, by public name: ``q.drive``, ``load.fz``, ``time`` ..

Wrenches (``wrench.drive.mz``) are not among them: only the equilibrium has them.
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
        name: public name, except of a wrench.

    Returns:
        (R,), NaN where not known.
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
    """Return the history of the conditions' rows.

    Args:
        conditions: R rows.
        names: names of the variables needed.

    Returns:
        Their history, and (R,) the rows' indices in it; rows without a past are the
        first rows of separate sessions.
    """
    if conditions.history is not None and conditions.row is not None:
        return conditions.history, conditions.row
    asked = dict.fromkeys([*names, "time", "approach"])
    values = {name: variable(conditions, name) for name in asked}
    return History(values, np.ones(len(conditions), dtype=bool)), np.arange(
        len(conditions)
    )


def with_history(conditions: Conditions) -> Conditions:
    """Return the conditions as rows measured in sequence, as in a campaign.

    Args:
        conditions: R rows, as declared.

    Returns:
        The same; selections by :meth:`Conditions.take` keep the whole history.
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
