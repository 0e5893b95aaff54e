"""Save the robot that a diagnosis identified, with its uncertainty.

The posterior covariance of all parameters is written to a separate file.  The robot
file also contains standard deviations, ``tolerance`` for geometric errors and ``std``
for function coefficients.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.robot import Robot
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.fit import MachineFit
from forcefit.validation.diagnosis.learned_range import learned_range
from forcefit.validation.diagnosis.nuisance import GEOMETRY
from forcefit.validation.diagnosis.saved_covariance import (
    covariance_of,
    write_covariance,
)
from forcefit.validation.diagnosis.unknowns import Small

if TYPE_CHECKING:
    from forcefit.validation.diagnosis.diagnosis import Diagnosis


def corrected(diagnosis: "Diagnosis") -> Robot:
    """Return the fitted robot with its uncertainty and a record of the diagnosis."""
    campaign, robot = diagnosis.campaign, _with_tolerances(diagnosis.fit)
    ranges = learned_range(campaign, ~diagnosis.outliers)
    x, y, z = campaign.reference_point.tolist()
    learned = [f for functions in functions_of(diagnosis) for f in functions]
    return replace(
        robot,
        functions=(*campaign.robot.functions, *learned),
        learned_range={**robot.learned_range, **ranges},
        reference_point=(x, y, z),
        diagnosis=_record(diagnosis),
    )


def functions_of(diagnosis: "Diagnosis") -> list[list[Function]]:
    """Return the learned functions with coefficients and standard deviations.

    Returns:
        A list for each learned function, because one learned function may require
        several functions in a robot file.
    """
    fit, units = diagnosis.fit, diagnosis.campaign.motion_units
    learned = []
    for one in fit.unknowns.functions:
        assert fit.unknowns.sensitivities is not None
        own = fit.unknowns.place(one)
        found = fit.unknowns.sensitivities.fitted(
            one.candidate, fit.x[own], fit.std[own]
        )
        learned.append([_named(function, units) for function in found])
    return learned


def _named(one: Function, units: Mapping[str, str]) -> Function:
    """Add a name to a function that describes a measured motion of a frame."""
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


def _with_tolerances(fit: MachineFit) -> Robot:
    """Store the standard deviations of geometric errors as tolerances."""
    robot = fit.robot
    for part, own in fit.unknowns.places:
        if not isinstance(part, Small) or part.name != GEOMETRY:
            continue
        # If no reading depends on a screw component, the prior standard deviation is
        # stored.
        unseen = np.repeat(
            [part.std[part.axis // 3 == kind].max(initial=0.0) for kind in (0, 1)], 3
        )
        sigma = np.array([
            unseen if frame.tolerance is None else frame.tolerance
            for frame in robot.frames
        ])
        sigma[part.frame, part.axis] = fit.std[own]
        frames = zip(robot.frames, sigma, strict=True)
        robot = replace(robot, frames=tuple(replace(f, tolerance=s) for f, s in frames))
    return robot


def _record(diagnosis: "Diagnosis") -> dict[str, Any]:
    """Return the record of the diagnosis for the robot file."""
    campaign, noise = diagnosis.campaign, asdict(diagnosis.noise)
    record: dict[str, Any] = {
        "campaign": campaign.name,
        "digest": _digest(campaign),
        "verdict": diagnosis.verdict,
        "rows": len(campaign),
        "rows_fitted": int(diagnosis.fitted.sum()),
        "held_out": diagnosis.held.how,
        "held_out_rows": int(diagnosis.held.rows.sum()),
    }
    del noise["normalised"]
    sizes = {"": asdict(diagnosis.after), "before_": asdict(diagnosis.before)}
    for name, errors in (sizes | {"noise_": noise}).items():
        record |= {f"{name}{k}": v for k, v in errors.items() if np.isfinite(v)}
    if campaign.not_measured:
        record["not_measured"] = campaign.not_measured
    return record


def _digest(campaign: Campaign) -> str:
    """Return a digest of the commands and readings of a campaign."""
    text = hashlib.sha256()
    for values in (campaign.coordinates, campaign.loads, campaign.measured):
        text.update(np.round(values, 12).tobytes())
    return text.hexdigest()[:16]


def save(diagnosis: "Diagnosis", path: Path | str) -> None:
    """Write the identified machine to a robot file, and its covariance next to it.

    Args:
        diagnosis: the diagnosis.
        path: path of the robot file.  The file of the covariance has the same name with
            the suffix ``.npz``.

    Raises:
        BadInput: a file cannot be written.
    """
    path = Path(path)
    robot, beside = corrected(diagnosis), path.with_suffix(".npz")
    if len(diagnosis.fit.x):
        write_covariance(covariance_of(diagnosis.fit, robot), beside)
        record = {**robot.diagnosis, "covariance": str(beside.resolve())}
        robot = replace(robot, diagnosis=record)
    write_robot(robot, path)
