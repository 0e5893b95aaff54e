"""Readings that a robot foretells for commands, measured or not."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.predict import Prediction, predict
from forcefit.inputs.display import html_table, short_repr
from validation.campaign.campaign import READING, Campaign
from validation.diagnosis.prediction import finite_conditions
from validation.diagnosis.registration import register


@dataclass(frozen=True, eq=False)
class Foretold:
    """Readings of commands.

    Attributes:
        commands: what was commanded, of R rows.
        prediction: what the robot reads there.
        error: (3,) rms of measured minus foretold: position [m], rotation [rad] and in
            sigma; NaN where nothing was measured.
    """

    commands: Campaign
    prediction: Prediction
    error: NDArray

    __repr__, _repr_html_ = short_repr, html_table

    def table(self) -> dict[str, Any]:
        """For machines."""
        position, rotation, sigma = self.error.tolist()
        return {
            "rows": len(self.commands),
            "without_answer": [
                {"id": name, "reason": reason}
                for name, reason in zip(
                    self.commands.ids, self.prediction.reason, strict=True
                )
                if reason
            ],
            "open": int(self.prediction.undetermined.sum()),
            "error": {
                "unit": {"position": "m", "rotation": "rad"},
                "position": position, "rotation": rotation, "normalised": sigma,
            },
        }  # fmt: skip


def foretell(commands: Campaign) -> Foretold:
    """What the robot of a campaign reads for its commands.

    Args:
        commands: the robot, with its effects, and rows; where the registration is
            unknown and rows are measured, the device's frame is fitted to those.

    Returns:
        The readings.

    Raises:
        BadInput: the registration is unknown, and the rows do not tell it.
    """
    conditions = finite_conditions(commands)
    measured = commands.cells.any(axis=1)
    if commands.registration == "unknown" and measured.any():
        conditions = register(commands.take(measured), conditions)
    prediction = predict(conditions)
    return Foretold(commands, prediction, error_of(commands, prediction.deviation))


def error_of(campaign: Campaign, deviation: NDArray) -> NDArray:
    """Rms of measured minus foretold.

    Args:
        campaign: R rows.
        deviation: (R, 6) [rad, m] foretold.

    Returns:
        (3,) position [m], rotation [rad], and all readings in sigma; NaN where there
        is nothing to compare.
    """
    left = campaign.measured - deviation
    parts = left[:, 3:], left[:, :3], left / campaign.sigma
    return np.array([_rms(part) for part in parts])


def _rms(values: NDArray) -> float:
    """Root mean square of what is known; NaN of nothing."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def reading_names(commands: Campaign) -> list[tuple[str, str, int]]:
    """Columns of a table of readings: its name, the point, the component.

    Args:
        commands: whose names are wanted; only what is measured somewhere, all if
            nothing is.

    Returns:
        A triple for each.
    """
    points = [""]
    if commands.point is not None:
        points = list(dict.fromkeys(commands.point.tolist()))
    names = []
    for point in points:
        rows = np.ones(len(commands), dtype=bool)
        if commands.point is not None:
            rows = commands.point == point
        taken = commands.cells[rows].any(axis=0)
        if not commands.cells.any():
            taken = np.array([not point] * 3 + [True] * 3)
        at = f"meas.{point}" if point else "meas"
        names += [
            (f"{at}.{READING[k]}", point, k) for k in np.flatnonzero(taken).tolist()
        ]
    return names


def reading_table(foretold: Foretold) -> str:
    """Foretold readings as a table: ``id`` and the readings, under a campaign's names.

    Args:
        foretold: of any commands.

    Returns:
        CSV; a cell is empty where the robot has no answer.
    """
    commands, deviations = foretold.commands, foretold.prediction.deviation
    columns = reading_names(commands)
    values: dict[str, dict[str, float]] = {}
    for i, full in enumerate(commands.ids):
        point = "" if commands.point is None else str(commands.point[i])
        row = values.setdefault(full.removesuffix(f":{point}") if point else full, {})
        row |= {name: deviations[i, k] for name, at, k in columns if at == point}
    return csv_text(values, [name for name, _, _ in columns])


def csv_text(rows: Mapping[str, Mapping[str, object]], columns: Sequence[str]) -> str:
    """A table with labels.

    Args:
        rows: cells by column, by label.
        columns: beside ``id``, in order.

    Returns:
        CSV with a header; what a row lacks, and NaN, is empty.
    """
    lines = [",".join(["id", *columns])]
    for label, cells in rows.items():
        lines.append(",".join([label, *(_cell(cells.get(c, "")) for c in columns)]))
    return "\n".join(lines) + "\n"


def _cell(value: object) -> str:
    """A number with ten digits, a text as it is."""
    if not isinstance(value, float):
        return str(value)
    return "" if np.isnan(value) else f"{value:.10g}"
