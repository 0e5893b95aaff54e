"""What effects may depend on, by public name: ``q.drive``, ``load.fz``, ``time`` ..

Wrenches (``wrench.drive.mz``) are not here: they follow only from the equilibrium.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.conditions import Conditions
from assembly.measurement.history import History, in_order
from stiffness.screws import WRENCH

COMMON = ("temperature", "time", "approach")  # covariates with a column of their own
FORCE = "load.force"  # the size of the force
LOADS = tuple(name.lower() for name in WRENCH)


def variable(here: Conditions, name: str) -> NDArray:
    """A variable in every situation.

    Args:
        here: R situations.
        name: public, of no wrench.

    Returns:
        (R,) NaN where it is not known.
    """
    kind, _, rest = name.partition(".")
    if kind == "q":
        return here.coordinates[:, here.robot.index(rest)]
    if name == FORCE:
        return np.linalg.norm(here.load[:, 3:], axis=1)
    if kind == "load":
        return here.load[:, LOADS.index(rest)]
    if kind == "position":
        return here.postures.platform[:, "xyz".index(rest), 3]
    covariate = rest if kind == "cov" else name
    if covariate in COMMON:
        values: NDArray = getattr(here, covariate)
        return values
    return here.covariates.get(covariate, np.full(len(here), np.nan))


def past(here: Conditions, names: Iterable[str]) -> tuple[History, NDArray]:
    """The rows that conditions come after.

    Args:
        here: R situations.
        names: variables asked for.

    Returns:
        Their history, and (R,) which of its rows they are; situations that have no
        past are the first rows of sessions of their own.
    """
    if here.history is not None and here.row is not None:
        return here.history, here.row
    asked = dict.fromkeys([*names, "time", "approach"])
    values = {name: variable(here, name) for name in asked}
    return History(values, np.ones(len(here), dtype=bool)), np.arange(len(here))


def with_history(here: Conditions) -> Conditions:
    """Conditions whose rows were measured one after the other, as a campaign's.

    Args:
        here: R situations, as declared.

    Returns:
        The same; parts that :meth:`Conditions.take` takes remember all of them.
    """
    names = [f"q.{frame.name}" for frame in here.robot.frames]
    names += [f"load.{name}" for name in LOADS]
    names.append(FORCE)
    names += [f"position.{axis}" for axis in "xyz"]
    names += ["time", "approach", *(f"cov.{c}" for c in (*COMMON, *here.covariates))]
    values = {name: variable(here, name) for name in names}
    history, row = in_order(values, here.session)
    return replace(here, history=history, row=row)
