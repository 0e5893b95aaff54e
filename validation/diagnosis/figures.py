"""Create the charts of a diagnosis and a 3-D view of the robot.

Each function returns HTML for a report page.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.energy import Assembly, CannotAssemble
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.measurement.predict import assemble_row
from forcefit.assembly.report.scene import robot_scene
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.page.charts import BLUE, GREY, RED, Axis, bars, chart, grid, label, matrix
from forcefit.validation.diagnosis.diagnosis import Diagnosis
from forcefit.validation.diagnosis.separability import compare_signatures
from forcefit.validation.diagnosis.signatures import conditions_of
from forcefit.validation.diagnosis.verdict import CLAIM, RIVAL

_SIDES = ((0, 1, "from above"), (0, 2, "from the side"))
_COLOURS = {"before": RED, "after": BLUE}


def error_chart(diagnosis: Diagnosis) -> str:
    """Return a bar chart of the noise and of the errors before and after diagnosis."""
    charts = []
    for kind, unit in (("rotation", "rad"), ("position", "m")):
        names = ("before", "after", "noise")
        values = {name: getattr(getattr(diagnosis, name), kind) for name in names}
        known = {name: v for name, v in values.items() if np.isfinite(v)}
        if known:
            axis = Axis(f"{kind}: rms on held-out rows", unit)
            caption = "Rows that were used neither to choose nor to fit the model."
            charts.append(bars(known, axis, caption, float("nan")))
    return grid(*charts)


def sequence_chart(diagnosis: Diagnosis) -> str:
    """Return a bar chart of the error of each model in the model sequence, [sigma]."""
    values: dict[str, float] = {}
    for step in diagnosis.sequence:
        again = step.term in values  # several functions may be learned
        name = f"{step.term} ({len(values) + 1})" if again else step.term
        values[name] = step.error.normalised
    axis = Axis("rms on held-out rows [sigma]")
    return bars(values, axis, "A value of 1 (line) is the stated noise.")


def vector_charts(diagnosis: Diagnosis) -> str:
    """Return top and side views of the residual displacements of measured points."""
    platform = diagnosis.conditions.postures.platform
    where = platform[:, :3, 3] + platform[:, :3, :3] @ diagnosis.conditions.point
    known = ~diagnosis.outliers
    shifts = {
        name: np.nan_to_num(residual[:, 3:])
        for name, residual in _residuals(diagnosis).items()
    }
    size = np.linalg.norm(shifts["before"][known], axis=1)
    span = float(np.ptp(where, axis=0).max()) or 1.0
    larger = 0.12 * span / max(float(np.quantile(size, 0.9)), 1e-12)
    ids = [text for row in _labels(diagnosis) for text in (row, row, "")]
    charts = []
    for i, j, side in _SIDES:
        traces = []
        for name, shift in shifts.items():
            start, end = where[known], (where + larger * shift)[known]
            gap = np.full_like(start, np.nan)
            points = np.stack([start, end, gap], axis=1).reshape(-1, 3)
            traces.append({
                "type": "scatter", "mode": "lines", "name": name,
                "x": points[:, i], "y": points[:, j],
                "line": {"color": _COLOURS[name]}, "text": ids, "hoverinfo": "text",
            })  # fmt: skip
        axes = Axis("xyz"[i], "m"), Axis("xyz"[j], "m", {"scaleanchor": "x"})
        caption = f"Seen {side}; residuals {larger:.0f} times larger; no outliers."
        charts.append(chart(traces, *axes, caption))
    return grid(*charts)


def covariate_charts(diagnosis: Diagnosis) -> str:
    """Return charts of the residual as a function of each variable."""
    kept, rows = ~diagnosis.outliers, _labels(diagnosis)
    sizes = {
        name: np.sqrt(np.nanmean((left / diagnosis.campaign.sigma) ** 2, axis=1))[kept]
        for name, left in _residuals(diagnosis).items()
    }
    charts = []
    for (name, unit), values in _varied(diagnosis).items():
        if np.ptp(values) == 0:
            continue
        traces: list[dict[str, Any]] = [
            {
                "type": "scatter", "mode": "markers", "name": when, "text": rows,
                "x": values[kept], "y": z,
                "marker": {"color": _COLOURS[when], "size": 5},
            }
            for when, z in sizes.items()
        ]  # fmt: skip
        ends = [values[kept].min(), values[kept].max()]
        traces.append({
            "type": "scatter", "mode": "lines", "x": ends, "y": [1.0, 1.0],
            "line": {"color": GREY}, "hoverinfo": "skip", "showlegend": False,
        })  # fmt: skip
        log = Axis("residual / sigma", options={"type": "log"})
        caption = "A value of 1 (line) is the stated noise."
        charts.append(chart(traces, Axis(name, unit), log, caption))
    return grid(*charts)


def _residuals(diagnosis: Diagnosis) -> dict[str, NDArray]:
    """Return the residuals (R, 6) [rad, m] before and after the diagnosis."""
    return {"before": diagnosis.residual_before, "after": diagnosis.residual_after}


def _labels(diagnosis: Diagnosis) -> list[str]:
    """Return the labels of all rows except outliers."""
    ids = zip(diagnosis.campaign.ids, diagnosis.outliers, strict=True)
    return [label(name) for name, outlier in ids if not outlier]


def _varied(diagnosis: Diagnosis) -> dict[tuple[str, str], NDArray]:
    """Return the names and units of the variables shown in charts."""
    campaign = diagnosis.campaign
    varied = {("load size", "N"): np.linalg.norm(campaign.loads[:, 3:], axis=1)}
    for i, frame in enumerate(campaign.robot.frames):
        if frame.actuated and len(varied) < 8:
            unit = "m" if frame.joint == "prismatic" else "rad"
            varied[frame.name, unit] = campaign.coordinates[:, i]
    units = {"temperature": "K", "time": "s"}
    for name, values in campaign.covariates.items():
        varied[name, units.get(name, "")] = values
    return varied


def probability_chart(diagnosis: Diagnosis) -> str:
    """Return a bar chart of the probabilities of all effects."""
    ranked = sorted(diagnosis.probability.items(), key=lambda item: -item[1])
    axis = Axis(f"probability (claimed from {CLAIM}, a rival from {RIVAL})",
                options={"range": [0, 1]})  # fmt: skip
    return bars(
        dict(ranked), axis, "Posterior weight of all sets with the effect.", CLAIM
    )


def confounding_chart(diagnosis: Diagnosis) -> str:
    """Return a chart of the similarity of the effects."""
    columns: dict[str, NDArray] = {}
    # The most general hypothesis is listed first.
    for element in diagnosis.traced.columns.library:
        if np.any(element.columns):
            columns.setdefault(element.name, element.columns)
    angles = compare_signatures(columns)
    return imitation_chart(angles.shared, angles.names)


def imitation_chart(shared: NDArray, names: tuple[str, ...]) -> str:
    """Return a chart of the similarity of the effects.

    Args:
        shared: (m, m) fraction of effect i that effect j can imitate, in element [i,
            j].
        names: names of the m effects.

    Returns:
        The chart as HTML.
    """
    return matrix(
        shared, names, "fraction of the row's effect that the column can imitate",
        "Value 1: the column's effect can imitate any effect of the row.", around=False,
    )  # fmt: skip


def worst_row(diagnosis: Diagnosis) -> tuple[int, str]:
    """Return the held-out row with the largest error of the declared model.

    Returns:
        The index of the row, and the kind of the error, ``"position"`` or
        ``"rotation"``. If there is no such row, the index is -1 and the text is empty.
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
    """Return the identified machine assembled under a row's load, or None."""
    campaign = replace(diagnosis.campaign, robot=diagnosis.robot)
    try:
        forced = assemble_row(replace(conditions_of(campaign), exact=False), row)
    except (CannotAssemble, FreeMotion, SolverFailed):
        return None
    return forced if isinstance(forced, Assembly) else None


def worst_robot(diagnosis: Diagnosis) -> str:
    """Return a 3-D scene of the robot in the row with the largest error."""
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
