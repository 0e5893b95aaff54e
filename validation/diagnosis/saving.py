"""The robot that a diagnosis saves: its numbers, how sure they are, where it is known.

The posterior covariance of all numbers is written in a file of its own; geometric
errors carry their standard deviation as ``tolerance``, functions as ``std``.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.files.robot_file import write_robot
from assembly.model.function import Function
from assembly.model.robot import Robot
from validation.campaign.campaign import READING, Campaign
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.learned_range import learned_range
from validation.diagnosis.saved_covariance import covariance_of, write_covariance
from validation.diagnosis.small_terms import GEOMETRY
from validation.diagnosis.unknowns import Small


def corrected(diagnosis: Diagnosis) -> Robot:
    """The machine found, as it is saved.

    Args:
        diagnosis: the diagnosis.

    Returns:
        The fitted robot with the range it was identified in, the point measured, the
        uncertainty of its geometric errors, and a record of the diagnosis.
    """
    campaign = diagnosis.campaign
    robot = _with_tolerances(diagnosis)
    ranges = learned_range(campaign, ~diagnosis.outliers)
    x, y, z = campaign.reference_point.tolist()
    return replace(
        robot,
        functions=(*campaign.robot.functions, *_functions(diagnosis)),
        learned_range={**robot.learned_range, **ranges},
        reference_point=(x, y, z),
        diagnosis=_record(diagnosis),
    )


def _functions(diagnosis: Diagnosis) -> list[Any]:
    """Learned functions with the standard deviations of their numbers."""
    return [f for some in functions_of(diagnosis) for f in some]


def functions_of(diagnosis: Diagnosis) -> list[list[Any]]:
    """Functions of a robot file that were learned, with their numbers.

    Args:
        diagnosis: the diagnosis.

    Returns:
        For every function learned one of a robot file, or several of one kind.
    """
    fit, unknowns = diagnosis.fit, diagnosis.fit.unknowns
    first = len(unknowns.parts) - len(unknowns.functions)
    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    learned = zip(unknowns.functions, unknowns.slices[first:], strict=True)
    if unknowns.sensitivities is None:
        return []
    units = diagnosis.campaign.motion_units
    fitted = unknowns.sensitivities.fitted
    return [
        [_named(f, units) for f in fitted(one.candidate, fit.x[own], std[own])]
        for one, own in learned
    ]


def _named(one: Function, units: Mapping[str, str]) -> Function:
    """A function, labelled where a frame moves by a gain of a measured motion."""
    name = one.variables[0].removeprefix("cov.")
    kinds = {"rad" if component[0] == "r" else "m" for component in one.components}
    straight = one.form == "powers" and one.kind == "screw" and one.where != "load"
    first = all(k.rpartition(".")[2] == "1" for k in one.parameters)
    if not straight or not first or one.variables[1:] or kinds != {units.get(name)}:
        return one
    words = ", ".join(
        f"{k.rpartition('.')[0]} {v:.3g} +- {one.std[k]:.1g}".strip()
        for k, v in one.parameters.items()
    )
    label = f"measured motion of {one.where} by {name}, gain {words}"
    return replace(one, label=label)


def _with_tolerances(diagnosis: Diagnosis) -> Robot:
    """The robot whose geometric errors carry how uncertain they are."""
    # a component that the readings do not see is as uncertain as its prior, which is
    # that of the other components of its kind
    fit, robot = diagnosis.fit, diagnosis.robot
    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    places = zip(fit.unknowns.parts, fit.unknowns.slices, strict=True)
    for part, own in places:
        if not isinstance(part, Small) or part.name != GEOMETRY:
            continue
        sigma = np.full((len(robot.frames), 6), np.nan)
        sigma[part.frame, part.axis] = std[own]
        prior = [_largest(part.std[part.axis // 3 == kind]) for kind in (0, 1)]
        unseen = np.repeat(prior, 3)
        declared = [f.tolerance for f in robot.frames]
        for row, given in enumerate(declared):
            known = unseen if given is None else given
            sigma[row] = np.where(np.isnan(sigma[row]), known, sigma[row])
        frames = tuple(
            replace(f, tolerance=s) for f, s in zip(robot.frames, sigma, strict=True)
        )
        robot = replace(robot, frames=frames)
    return robot


def _largest(values: NDArray) -> float:
    return float(values.max(initial=0.0))


def _record(diagnosis: Diagnosis) -> dict[str, Any]:
    """What the file says of the diagnosis that made it."""
    campaign, after = diagnosis.campaign, diagnosis.after
    record: dict[str, Any] = {
        "campaign": campaign.name,
        "digest": digest(campaign),
        "verdict": diagnosis.verdict,
        "rows": len(campaign),
        "rows_fitted": int(diagnosis.fitted.sum()),
        "held_out": diagnosis.held.how,
        "held_out_rows": int(diagnosis.held.rows.sum()),
    }
    sizes = {"": after, "before_": diagnosis.before}
    for name, errors in sizes.items():
        for kind in ("position", "rotation", "normalised"):
            value = getattr(errors, kind)
            if np.isfinite(value):
                record[f"{name}{kind}"] = value
    for kind in ("position", "rotation"):
        if np.isfinite(getattr(diagnosis.noise, kind)):
            record[f"noise_{kind}"] = getattr(diagnosis.noise, kind)
    missing = not_measured(campaign)
    if missing:
        record["not_measured"] = missing
    return record


def not_measured(campaign: Campaign) -> list[str]:
    """Components of a reading that no row has."""
    seen = np.flatnonzero(campaign.cells.any(axis=0)).tolist()
    return [name for k, name in enumerate(READING) if k not in seen]


def digest(campaign: Campaign) -> str:
    """What tells a campaign's rows from others: a digest of commands and readings."""
    text = hashlib.sha256()
    for values in (campaign.coordinates, campaign.loads, campaign.measured):
        text.update(np.round(values, 12).tobytes())
    return text.hexdigest()[:16]


def save(diagnosis: Diagnosis, path: Path | str) -> None:
    """Write the machine found as a robot file, its covariance beside it.

    Args:
        diagnosis: the diagnosis.
        path: of the robot file; the covariance is written to the same name with the
            ending ``.npz``.

    Raises:
        BadInput: a file cannot be written.
    """
    path = Path(path)
    robot, beside = corrected(diagnosis), path.with_suffix(".npz")
    if len(diagnosis.fit.x):
        fit = diagnosis.fit
        known = covariance_of(fit.unknowns, fit.x, fit.covariance, robot)
        write_covariance(known, beside)
        record = {**robot.diagnosis, "covariance": str(beside.resolve())}
        robot = replace(robot, diagnosis=record)
    write_robot(robot, path)
