"""Convert a compensation to tables for controllers and to text."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import POSE, pose_components
from forcefit.results.quantities import Quantity, flag, text
from forcefit.results.text import readings_text
from forcefit.validation.campaign.campaign import LOAD
from forcefit.validation.campaign.tables import row_dataset, screw
from forcefit.validation.correction.prediction import csv_text

if TYPE_CHECKING:
    import xarray

    from forcefit.validation.correction.compensation import Compensation


def command_table(compensation: "Compensation") -> str:
    """Return the corrected commands as a table in the format of the targets.

    Args:
        compensation: result of :func:`.compensation.compensate`.

    Returns:
        CSV with ``id``, ``q.*`` or ``pose.*``, and the given loads and covariates.
    """
    targets = compensation.targets
    platform = compensation.transforms[:, targets.robot.index(targets.robot.platform)]
    columns: dict[str, Any] = {}
    if targets.commanded == "pose":
        poses = pose_components(platform)
        columns |= {f"pose.{name}": poses[:, k] for k, name in enumerate(POSE)}
    else:
        columns |= {
            f"q.{n}": x
            for n, x in zip(compensation.drives, compensation.commands.T, strict=True)
        }
    loads = zip(LOAD, targets.loads.T, strict=True)
    columns |= {f"load.{name}": w for name, w in loads if w.any()}
    columns |= {f"cov.{name}": x for name, x in targets.covariates.items()}
    if targets.session is not None:
        columns["session"] = targets.session
    return _text(compensation, columns)


def offset_table(compensation: "Compensation") -> str:
    """Return a table of controller offsets and of the errors before and after.

    Args:
        compensation: result of :func:`.compensation.compensate`.

    Returns:
        CSV with ``id`` and the offsets ``offset.<drive>`` [rad or m].  The columns
        ``before`` and ``after`` contain the position errors [m] and rotation errors
        [rad] before and after the correction.  The column ``spread`` is the standard
        deviation [m] of the position after correction.
    """
    columns: dict[str, Any] = {
        f"offset.{n}": x
        for n, x in zip(compensation.drives, compensation.offsets.T, strict=True)
    }
    for when, error in (("before", compensation.before), ("after", compensation.after)):
        columns[f"{when}.position"] = np.linalg.norm(error[:, 3:], axis=1)
        columns[f"{when}.rotation"] = np.linalg.norm(error[:, :3], axis=1)
    columns["spread.position"] = np.linalg.norm(compensation.spread[:, 3:], axis=1)
    return _text(compensation, columns)


def compensation_dataset(compensation: "Compensation") -> "xarray.Dataset":
    """Return a compensation as a data set over ``row``.

    Args:
        compensation: result of :func:`.compensation.compensate`.

    Returns:
        Data set with ``command`` and ``offset`` of each drive, the screws ``before``
        and ``after``, the standard deviation ``spread`` of ``after``, ``limited`` and
        ``reason``.
    """
    drives = list(compensation.drives)
    of_drive = ("drive",)
    values = {
        "command": (
            Quantity("corrected command", "rad or m", of_drive), compensation.commands
        ),
        "offset": (
            Quantity("offset of the command", "rad or m", of_drive),
            compensation.offsets,
        ),
        "before": (screw("error of the given command"), compensation.before),
        "after": (screw("error of the corrected command"), compensation.after),
        "spread": (screw("standard deviation of the error"), compensation.spread),
        "limited": (flag("a joint limit prevents the correction"),
                    compensation.limited),
        "reason": (text("reason"), compensation.reason),
    }  # fmt: skip
    return row_dataset(compensation.targets, values, {"drive": drives})


def _text(compensation: "Compensation", columns: dict[str, Any]) -> str:
    """Format columns as CSV with a header."""
    rows = {
        label: {
            name: values[i] if name == "session" else float(values[i])
            for name, values in columns.items()
        }
        for i, label in enumerate(compensation.targets.ids)
    }
    return csv_text(rows, list(columns))


def summary(
    compensation: "Compensation", diagnosed: Mapping[str, float] | None = None
) -> dict[str, Any]:
    """Return expected errors and rows without a solution as plain values.

    Args:
        compensation: result of :func:`.compensation.compensate`.
        diagnosed: rms errors ``position`` [m] and ``rotation`` [rad] on the held-out
            rows of the diagnosis. If it is None, they are read from the robot file.

    Returns:
        Plain values.  ``expected`` combines the error after correction, the parameter
        uncertainty, and the unexplained error of the diagnosis.  It is None if the
        unexplained error is unknown.
    """
    ids = compensation.targets.ids
    record = compensation.targets.robot.diagnosis
    spread = _sizes(compensation.spread)
    unexplained = _unexplained(record, diagnosed)
    expected: dict[str, float | None] = {"position": None, "rotation": None}
    if compensation.spread.any() or unexplained is not None:
        left = _sizes(np.hypot(compensation.after, compensation.spread))
        more = unexplained or {"position": 0.0, "rotation": 0.0}
        expected = {
            key: None if size is None else float(np.hypot(size, more[key]))
            for key, size in left.items()
        }
    return {
        "rows": len(ids),
        "drives": list(compensation.drives),
        "offsets": compensation.offsets,
        "error": {
            "unit": {"position": "m", "rotation": "rad"},
            "before": _sizes(compensation.before),
            "after": _sizes(compensation.after),
            "spread": spread,
            "expected": expected,
        },
        "not_measured": list(record.get("not_measured", [])),
        "limited": [ids[i] for i in np.flatnonzero(compensation.limited)],
        "without_answer": [
            {"id": ids[i], "reason": compensation.reason[i]}
            for i in np.flatnonzero(compensation.reason != "")
        ],
    }


def _unexplained(
    record: Mapping[str, Any], diagnosed: Mapping[str, float] | None
) -> dict[str, float] | None:
    """Return the unexplained errors [m] and [rad], or None if they are unknown."""
    sizes = {}
    for key in ("position", "rotation"):
        after = record.get(key, 0.0) if diagnosed is None else diagnosed[key]
        noise = record.get(f"noise_{key}", 0.0)
        sizes[key] = float(np.sqrt(3.0 * max(0.0, after**2 - noise**2)))
    return sizes if diagnosed is not None or "normalised" in record else None


def _sizes(error: NDArray) -> dict[str, float | None]:
    """Return the rms position and the rms rotation, None if there are no values."""

    def rms(part: NDArray) -> float | None:
        known = part[np.isfinite(part).all(axis=1)]
        return float(np.sqrt(np.mean(np.sum(known**2, axis=1)))) if len(known) else None

    return {"position": rms(error[:, 3:]), "rotation": rms(error[:, :3])}


def summary_text(compensation: "Compensation", table: Mapping[str, Any]) -> str:
    """Format ``table``, the result of :func:`summary`, as text."""
    lines = [f"{table['rows']} commands, drives {', '.join(compensation.drives)}"]
    says = {
        "before": "error without correction", "after": "error with correction",
        "spread": "uncertainty of the model", "expected": "expected error",
    }  # fmt: skip
    for key, words in says.items():
        size = table["error"][key]
        if key == "spread" and not compensation.spread.any():
            continue
        if size["position"] is not None:
            lines.append(f"{words}: {readings_text(size)}")
    if table["error"]["expected"]["position"] is None:
        lines.append(
            "expected error: the residual of the robot's diagnosis (see "
            "--diagnosed), because the file contains no uncertainty"
        )
    if table["not_measured"]:
        lines.append(
            "components without readings when the robot was identified: "
            f"{', '.join(table['not_measured'])}; their expected errors are "
            "computed from the geometric errors in the other directions"
        )
    if table["limited"]:
        lines.append(f"rows at a joint limit: {', '.join(table['limited'][:10])}")
    lines += [f"{row['id']}: {row['reason']}" for row in table["without_answer"][:10]]
    return "\n".join(lines)
