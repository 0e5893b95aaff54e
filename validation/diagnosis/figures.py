"""Charts of a diagnosis.  Functions take it and return HTML of a page."""

import numpy as np
from numpy.typing import NDArray

from forcefit.page.charts import BLUE, GREY, RED, Axis, bars, chart, label, matrix
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.separability import Separability, compare_signatures

_SIDES = ((0, 1, "from above"), (0, 2, "from the side"))


def error_chart(diagnosis: Diagnosis) -> str:
    """Before, after and noise on the held-out rows, position and rotation.

    Args:
        diagnosis: the diagnosis.

    Returns:
        HTML of bars; what was not measured is left out.
    """
    sizes = {
        "before": diagnosis.before,
        "after": diagnosis.after,
        "noise": diagnosis.noise,
    }
    charts = []
    for kind, unit in (("position", "m"), ("rotation", "rad")):
        values = {name: getattr(e, kind) for name, e in sizes.items()}
        known = {name: v for name, v in values.items() if np.isfinite(v)}
        if known:
            axis = Axis(f"{kind}: rms on held-out rows", unit)
            caption = "Rows that chose and fitted nothing."
            charts.append(bars(known, axis, caption, float("nan")))
    return f"<div class=grid>{''.join(charts)}</div>"


def sequence_chart(diagnosis: Diagnosis) -> str:
    """Error of every model of the sequence on the held-out rows, in sigmas.

    Args:
        diagnosis: the diagnosis.

    Returns:
        HTML of bars in the order of the steps.
    """
    values: dict[str, float] = {}
    for step in diagnosis.sequence:
        again = step.term in values  # several functions may be learned
        name = f"{step.term} ({len(values) + 1})" if again else step.term
        values[name] = step.error.normalised
    axis = Axis("rms on held-out rows [sigma]")
    return bars(values, axis, "Line at 1: noise as stated.")


def vector_charts(diagnosis: Diagnosis) -> str:
    """Residual displacements where they were measured, seen from the top and the side.

    Args:
        diagnosis: the diagnosis.

    Returns:
        HTML of lines before and after, all to the same scale.
    """
    platform = diagnosis.conditions.postures.platform
    where = platform[:, :3, 3] + platform[:, :3, :3] @ diagnosis.conditions.point
    known = ~diagnosis.outliers
    both = {
        "before": (RED, np.nan_to_num(diagnosis.residual_before[:, 3:])),
        "after": (BLUE, np.nan_to_num(diagnosis.residual_after[:, 3:])),
    }
    size = np.linalg.norm(both["before"][1][known], axis=1)
    span = float(np.ptp(where, axis=0).max()) or 1.0
    larger = 0.12 * span / max(float(np.quantile(size, 0.9)), 1e-12)
    ids = [label(i) for i, k in zip(diagnosis.campaign.ids, known, strict=True) if k]
    charts = []
    for i, j, side in _SIDES:
        traces = []
        for name, (colour, shift) in both.items():
            start, end = where[known], (where + larger * shift)[known]
            gap = np.full_like(start, np.nan)
            points = np.stack([start, end, gap], axis=1).reshape(-1, 3)
            traces.append({
                "type": "scatter", "mode": "lines", "name": name,
                "x": points[:, i], "y": points[:, j], "line": {"color": colour},
                "text": [one for row in ids for one in (row, row, "")],
                "hoverinfo": "text",
            })  # fmt: skip
        equal = {"scaleanchor": "x"}
        axes = Axis("xyz"[i], "m"), Axis("xyz"[j], "m", equal)
        caption = f"Seen {side}, {larger:.0f} times larger; all rows but outliers."
        charts.append(chart(traces, *axes, caption))
    return f"<div class=grid>{''.join(charts)}</div>"


def covariate_charts(diagnosis: Diagnosis) -> str:
    """Size of the residual against everything that was varied, before and after.

    Args:
        diagnosis: the diagnosis.

    Returns:
        HTML of a chart for each of load, drives and covariates.
    """
    kept, charts = ~diagnosis.outliers, []
    rows = [label(i) for i, k in zip(diagnosis.campaign.ids, kept, strict=True) if k]
    for (name, unit), values in _varied(diagnosis).items():
        if np.ptp(values) == 0:
            continue
        traces = []
        for residual, colour, when in (
            (diagnosis.residual_before, RED, "before"),
            (diagnosis.residual_after, BLUE, "after"),
        ):
            z = np.sqrt(np.nanmean((residual / diagnosis.campaign.sigma) ** 2, axis=1))
            traces.append({
                "type": "scatter", "mode": "markers", "name": when, "text": rows,
                "x": values[kept], "y": z[kept], "marker": {"color": colour, "size": 5},
            })  # fmt: skip
        ends = [values[kept].min(), values[kept].max()]
        traces.append({
            "type": "scatter", "mode": "lines", "x": ends, "y": [1.0, 1.0],
            "line": {"color": GREY}, "hoverinfo": "skip", "showlegend": False,
        })  # fmt: skip
        log = Axis("residual / sigma", options={"type": "log"})
        caption = "Line at 1: noise as stated."
        charts.append(chart(traces, Axis(name, unit), log, caption))
    return f"<div class=grid>{''.join(charts)}</div>"


def _varied(diagnosis: Diagnosis) -> dict[tuple[str, str], NDArray]:
    """What the residual may depend on, by its name and unit."""
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
    """Probability of every effect that the design can show.

    Args:
        diagnosis: the diagnosis.

    Returns:
        HTML of bars, the likeliest on top.
    """
    ranked = sorted(diagnosis.probability.items(), key=lambda item: -item[1])
    axis = Axis("probability (claimed from 0.9, a rival from 0.5)",
                options={"range": [0, 1]})  # fmt: skip
    return bars(dict(ranked), axis, "Posterior weight of all sets with it.", 0.9)


def separability_of(diagnosis: Diagnosis) -> Separability:
    """Angles between the signatures of effects, by the design of this campaign.

    Args:
        diagnosis: the diagnosis.

    Returns:
        The comparison, each effect in its most general form.
    """
    columns: dict[str, NDArray] = {}
    for element in diagnosis.traced.columns.library:
        if element.name not in columns and np.any(element.columns):
            columns[element.name] = element.columns
    return compare_signatures(columns)


def confounding_chart(diagnosis: Diagnosis) -> str:
    """What can imitate what: share of the row's effect that the column's can show.

    Args:
        diagnosis: the diagnosis.

    Returns:
        HTML of a matrix of numbers from 0 to 1.
    """
    angles = separability_of(diagnosis)
    return matrix(
        angles.shared, angles.names, "share of the row that the column can imitate",
        "1: whatever the row's effect does, the column's can do as well.", around=False,
    )  # fmt: skip
