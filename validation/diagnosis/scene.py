"""The robot of a diagnosis, to be turned in its page."""

from dataclasses import replace

import numpy as np

from assembly.linear.energy import Assembly, CannotAssemble
from assembly.linear.reduction import FreeMotion
from assembly.measurement.predict import assemble_row
from assembly.report.scene import robot_scene
from assembly.solvers.conic import SolverFailed
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.signatures import conditions_of


def worst_row(diagnosis: Diagnosis) -> tuple[int, str]:
    """The hold-out row at which the declared model errs most.

    Args:
        diagnosis: the diagnosis.

    Returns:
        The row and what of it is largest, ``"position"``, or ``"rotation"`` where no
        position was measured; -1 and an empty text without such a row.
    """
    aside = diagnosis.held.rows & ~diagnosis.outliers
    for name, part in (("position", slice(3, 6)), ("rotation", slice(0, 3))):
        components = diagnosis.residual_before[:, part]
        known = aside & np.isfinite(components).any(axis=1)
        if known.any():
            sizes = np.sqrt(np.nansum(components**2, axis=1))
            return int(np.argmax(np.where(known, sizes, -1.0))), name
    return -1, ""


def assembled(diagnosis: Diagnosis, row: int) -> Assembly | None:
    """The machine found, at a row under its load.

    Args:
        diagnosis: the diagnosis.
        row: its index.

    Returns:
        The assembly by small screws, None where there is none.
    """
    campaign = replace(diagnosis.campaign, robot=diagnosis.robot)
    try:
        forced = assemble_row(replace(conditions_of(campaign), exact=False), row)
    except (CannotAssemble, FreeMotion, SolverFailed):
        return None
    return forced if isinstance(forced, Assembly) else None


def worst_robot(diagnosis: Diagnosis) -> str:
    """The robot at the worst row, see :func:`worst_row`, as it is assembled there.

    Args:
        diagnosis: the diagnosis.

    Returns:
        HTML of a scene; empty without such a row or assembly.
    """
    row, name = worst_row(diagnosis)
    forced = assembled(diagnosis, row) if row >= 0 else None
    if forced is None:
        return ""
    effects = ", ".join(diagnosis.effects).replace("_", " ") or "none"
    return robot_scene(
        forced, None, None,
        f"Row {diagnosis.campaign.ids[row]}, held out, where the declared model errs "
        f"most in {name}. Grey: nominal. Coloured: the machine found, assembled under "
        f"the row's load (effects: {effects}). Red: elastic links; blue: rigid bodies; "
        "orange: driven joints.",
    )  # fmt: skip
