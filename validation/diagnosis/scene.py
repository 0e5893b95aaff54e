"""The robot of a diagnosis, to be turned in its page."""

from dataclasses import replace

import numpy as np

from assembly.effects import apply_effects
from assembly.linear.energy import Assembly, CannotAssemble
from assembly.linear.reduction import FreeMotion
from assembly.measurement.predict import assemble_row
from assembly.report.scene import robot_scene
from assembly.solvers.conic import SolverFailed
from validation.diagnosis.diagnosis import Diagnosis


def worst_row(diagnosis: Diagnosis) -> tuple[int, str]:
    """The hold-out row at which the declared model errs most.

    Args:
        diagnosis: the diagnosis.

    Returns:
        The row and what of it is largest, ``"position"``, or ``"rotation"`` where no
        position was measured; -1 and an empty text without such a row.
    """
    aside = ~diagnosis.split.fitted & ~diagnosis.outliers
    for name, part in (("position", slice(3, 6)), ("rotation", slice(0, 3))):
        components = diagnosis.residual_before[:, part]
        known = aside & np.isfinite(components).any(axis=1)
        if known.any():
            sizes = np.sqrt(np.nansum(components**2, axis=1))
            return int(np.argmax(np.where(known, sizes, -1.0))), name
    return -1, ""


def assembled(diagnosis: Diagnosis, row: int) -> Assembly | None:
    """The robot at a row under its load, with the library's effects of the best set.

    Args:
        diagnosis: the diagnosis.
        row: its index.

    Returns:
        The assembly by small screws, None where there is none.
    """
    model = diagnosis.model
    conditions = replace(model.conditions, exact=False)
    try:
        forced = assemble_row(apply_effects(conditions, model.fit.effects), row)
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
    effects = ", ".join(diagnosis.model.fit.effects).replace("_", " ") or "none"
    return robot_scene(
        forced, None, None,
        f"Row {diagnosis.campaign.ids[row]}, kept aside, where the declared model errs "
        f"most in {name}. Grey: nominal. Coloured: assembled under the row's load with "
        f"the library's effects of the best set ({effects}); geometric errors fitted "
        "beside them and learned functions are not drawn. Red: elastic links; blue: "
        "rigid bodies; orange: driven joints.",
    )  # fmt: skip
