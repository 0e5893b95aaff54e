"""Summary of the errors along a path, as a dictionary and as text."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import POSE, home_posture
from forcefit.assembly.linear.closure import virtual_joints
from forcefit.assembly.model.joint_names import joint_of
from forcefit.assembly.model.link_stress import stressed_links
from forcefit.assembly.model.statuses import OK
from forcefit.assembly.path.path_errors import PathErrors
from forcefit.results.display import largest_row, listing
from forcefit.results.text import in_unit, lines_of, table_lines
from forcefit.results.units import FACTORS

# [periods] shortest duration for which vibration is small; at most 15 % for the quintic
# profile
LEAST_PERIODS = 10.0
_STARTS = 1e-6  # [-] tolerance for zero end accelerations, relative to the largest
LAWS = {"times": "spline through poses at given times"}
# description, SI unit and displayed unit of each reported largest value
LARGEST = {
    "inertial_translation": ("deflection due to acceleration", "m", "um"),
    "inertial_rotation": ("rotation due to acceleration", "rad", "mrad"),
    "translation": ("platform translation error", "m", "um"),
    "rotation": ("platform rotation error", "rad", "mrad"),
    "translation_bound": ("bound of the translation error", "m", "um"),
    "rotation_bound": ("bound of the rotation error", "rad", "mrad"),
    "force": ("force at the tip of a body", "N", "N"),
    "stress": ("von Mises stress", "Pa", "MPa"),
    "speed": ("speed of the platform", "m/s", "m/s"),
    "acceleration": ("acceleration of the platform", "m/s^2", "m/s^2"),
}


def sizes(errors: PathErrors) -> dict[str, NDArray]:
    """Return the magnitudes of the results at each instant.

    Args:
        errors: errors along a path at k instants.

    Returns:
        Magnitudes in SI units, with the keys of :data:`LARGEST`.  The shape is (k,), or
        (k, bodies) for forces and (k, links) for stresses.
    """
    arrays = errors.arrays
    found: dict[str, NDArray] = {}
    for name, key in (("inertial_screw", "inertial_{}"), ("platform_screw", "{}")):
        halves = np.split(arrays[name], 2, axis=1)
        for part, half in zip(("rotation", "translation"), halves, strict=True):
            found[key.format(part)] = np.linalg.norm(half, axis=1)
    for part in ("rotation", "translation"):
        if f"{part}_error" in arrays:
            found[f"{part}_bound"] = arrays[f"{part}_error"][:, 1]
    found["force"] = np.linalg.norm(arrays["wrench"][:, :, 3:], axis=2)
    if arrays["stress"].shape[1]:
        found["stress"] = arrays["stress"]
    for key in ("velocity", "acceleration"):
        name = "speed" if key == "velocity" else key
        found[name] = np.linalg.norm(arrays[f"platform_{key}"][:, 3:], axis=1)
    return found


def path_summary(errors: PathErrors) -> dict[str, Any]:
    """Return a summary of the errors along a path as a dictionary.

    Args:
        errors: errors along a path.

    Returns:
        Duration, frequency, largest values and their times.  ``status`` is ``"ok"``, or
        the status of the first point without a solution.
    """
    solved = errors.status == OK
    first = int(np.argmin(solved))
    times = errors.trajectory.times
    summary: dict[str, Any] = {
        "robot": errors.robot.name, "status": str(errors.status[first]),
        **({} if solved.all() else
           {"reason": f"at {times[first]:.6g} s: {errors.reason[first]}"}),
        "law": errors.trajectory.law, "duration": errors.trajectory.duration,
        "points": len(solved), "solved": int(solved.sum()),
        "first_frequency": errors.frequency, "periods": errors.periods,
        "remarks": remarks(errors),
    }  # fmt: skip
    if not solved.any():
        return summary
    owners = {
        "force": [joint_of(errors.robot, i) for i in range(len(errors.robot.frames))],
        "stress": [link.frame for link in stressed_links(errors.robot)],
    }
    summary["largest"] = {
        key: _peak(values, times, owners.get(key))
        for key, values in sizes(errors).items() if np.isfinite(values).any()
    }  # fmt: skip
    forces = errors.arrays["drive_force"]
    summary["drives"] = {
        name: _peak(np.abs(forces[:, k]), times) | {"unit": unit}
        for k, (name, unit) in enumerate(errors.drive_units.items())
    }  # fmt: skip
    return summary


def _peak(
    values: NDArray, times: NDArray, owners: list[str] | None = None
) -> dict[str, Any]:
    """Return the largest value, with its time and its body or link."""
    known = np.where(np.isfinite(values), values, -1.0)  # magnitudes are >= 0
    over_time = known if known.ndim == 1 else known.max(axis=1)
    row = largest_row(over_time)
    peak: dict[str, Any] = {"value": float(over_time[row]), "time": float(times[row])}
    if owners is not None:
        peak["frame"] = owners[largest_row(known[row])]
    return peak


def remarks(errors: PathErrors) -> list[str]:
    """Return remarks on effects that the quasi-static model neglects.

    Args:
        errors: errors along a path.

    Returns:
        Sentences without a full stop.
    """
    found, path = [], errors.trajectory
    if errors.periods < LEAST_PERIODS:
        found.append(
            f"the path takes {errors.periods:.3g} periods of the first natural "
            f"frequency, less than {LEAST_PERIODS:g}, so that the neglected vibration "
            "may exceed the computed deflection"
        )
    if not np.isfinite(errors.periods):
        found.append("no natural frequency was found, so the vibration is unknown")
    ends = np.abs(path.second[[0, -1]]).max()
    if path.jumps or ends > _STARTS * np.abs(path.second).max(initial=0.0):
        found.append(
            "the acceleration is discontinuous, so that the neglected vibration can "
            "double or triple the computed deflection"
        )
    if virtual_joints(errors.robot).cones.shape[1]:
        found.append(
            "impacts in clearances are neglected; without a load, the pose within the "
            "clearances and the deflection due to acceleration are not unique"
        )
    fall = (errors.status == OK) & np.isnan(errors.arrays["inertial_screw"][:, 0])
    if fall.any():
        found.append(
            f"at {fall.sum()} instants, the robot has no equilibrium at rest under "
            "these loads, so that the deflection due to acceleration is unknown"
        )
    if errors.free:
        found.append(_free_motions(errors))
    return found


def _free_motions(errors: PathErrors) -> str:
    """Return a remark on motions that the path does not prescribe."""
    names, robot = errors.trajectory.names, errors.robot
    freedoms = mobility(home_posture(robot)).platform_freedoms
    if names[0] in POSE and len(names) < freedoms:
        return (
            f"the path contains only {', '.join(names)}, but the platform has "
            f"{freedoms} degrees of freedom; the motion with minimum joint rates is "
            "used; expected a column for each component of the pose"
        )
    return (
        f"{errors.free} joint motions are prescribed neither by the path nor by the "
        "loop closures; the momentum along these motions is assumed to be zero"
    )


def path_text(summary: dict[str, Any]) -> str:
    """Return a summary as text."""
    lines = lines_of(summary, "status reason")
    periods = summary["periods"]
    in_periods = f", {periods:.3g} periods of {summary['first_frequency']:.4g} Hz"
    lines |= {
        "law": LAWS.get(summary["law"], summary["law"]),
        "path time": in_unit(summary["duration"], "s")
        + (in_periods if np.isfinite(periods) else ""),
        "points": f"{summary['points']}, {summary['solved']} solved",
    }
    text = [listing(summary["robot"], lines)]
    if "largest" in summary:
        text += _table(summary)
    return "\n".join(text + [f"note: {one}" for one in summary["remarks"]])


def _table(summary: dict[str, Any]) -> list[str]:
    """Return the largest values and drive forces as lines of text."""
    rows: dict[str, tuple[Any, ...]] = {}
    for key, peak in summary["largest"].items():
        words, _, unit = LARGEST[key]
        value = FACTORS.get(unit, 1.0) * peak["value"]
        rows[f"{words} [{unit}]"] = (value, peak["time"], peak.get("frame", ""))
    for name, peak in summary["drives"].items():
        rows[f"drive {name} [{peak['unit']}]"] = (peak["value"], peak["time"], "")
    return table_lines(("largest", "value", "at [s]", "body"), rows)
