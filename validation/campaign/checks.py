"""Check that the values in a campaign are plausible.

An impossible value raises an error whose message contains the likely mistake, such as a
wrong unit.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import POSE
from forcefit.assembly.model.robot import Robot
from forcefit.validation.campaign.campaign import LOAD, READING
from forcefit.validation.campaign.measurement_table import MeasurementTable

# [rad] Largest accepted command of a revolute joint.
_TURNS = 8 * np.pi
_FORCE = 1e7  # [N, N m] largest accepted load
# [K] Largest accepted difference from the calibration temperature. Absolute
# temperatures are therefore rejected.
_WARMEST = 250.0
_LATEST = 3e8  # [s] largest accepted time
_ROOM = 1000.0  # [m] largest accepted distance between machine and measuring device
_FINEST = 1e-15  # [rad, m] smallest accepted standard deviation of a reading
_UNITS = "; declare other units in [units] of campaign.toml"


def check_commands(table: MeasurementTable, robot: Robot) -> None:
    """Reject impossible values of commands, loads and covariates.

    Args:
        table: the table in SI units.
        robot: robot of the campaign.

    Raises:
        BadInput: a cell contains an impossible value.
    """
    reach = _body_length(robot)
    for name, values in table.columns.items():
        group, _, rest = name.partition(".")
        if group == "q" and robot.frame(rest).turns:
            lead = abs(robot.frame(rest).lead)  # [m/rad]
            largest = max(_TURNS, 10 * reach / lead) if lead else _TURNS
            _within(table, name, values, largest, f"an angle in rad{_UNITS}")
        elif group == "q":
            _within(table, name, values, 10 * reach, f"a travel in m{_UNITS}")
        elif group == "pose":
            largest = 2 * np.pi if rest in POSE[3:] else 10 * reach
            what = "a rotation vector in rad" if rest in POSE[3:] else "a position in m"
            _within(table, name, values, largest, f"{what}{_UNITS}")
        elif group == "load":
            unit = "N m" if rest in LOAD[:3] else "N"
            _within(table, name, values, _FORCE, f"a load in {unit}{_UNITS}")
    _check_covariates(table)


def _check_covariates(table: MeasurementTable) -> None:
    """Reject impossible values of temperature, time and direction of approach."""
    columns = table.columns
    if "cov.temperature" in columns:
        what = "the deviation from the temperature of calibration, in K"
        _within(table, "cov.temperature", columns["cov.temperature"], _WARMEST, what)
    if "cov.time" in columns:
        time, what = columns["cov.time"], "seconds since the first measurement"
        _within(table, "cov.time", time, _LATEST, what)
        for i in np.flatnonzero(time < 0)[:1]:
            message = f"found {time[i]:g} s, expected {what}, >= 0"
            raise table.bad(int(i), "cov.time", message)
    if "cov.approach" in columns:
        side = columns["cov.approach"]
        for i in np.flatnonzero(np.isfinite(side) & (np.abs(side) != 1))[:1]:
            message = f"found {side[i]:g}, expected -1 or 1"
            raise table.bad(int(i), "cov.approach", message)


def check_measured(table: MeasurementTable, points: Iterable[str]) -> None:
    """Reject a row without any measurement.

    Args:
        table: the table in SI units.
        points: names of additional measured points.

    Raises:
        BadInput: a row contains no measurement.
    """
    groups = ["meas", *(f"meas.{point}" for point in points)]
    measured = np.hstack([table.stack(group, READING, np.nan) for group in groups])
    for i in np.flatnonzero(np.isnan(measured).all(axis=1))[:1]:
        message = (
            "found no reading in this row; expected at least one of meas.rx ... meas.tz"
        )
        raise table.bad(int(i), "", message)


def check_readings(table: MeasurementTable, point: str, sigma: NDArray,
                   registration: str, extent: float) -> None:  # fmt: skip
    """Reject deviations larger than the robot and invalid standard deviations.

    Args:
        table: the table in SI units.
        point: name of the measured point, ``""`` for the reference point.
        sigma: (R, 6) [rad, m] standard deviation of each reading, NaN if unknown.
        registration: ``"known"`` or ``"unknown"``. If the pose of the measuring device
            is unknown, larger deviations are accepted.
        extent: [m] size of the robot over all configurations.

    Raises:
        BadInput: a reading is invalid.
    """
    at = f".{point}" if point else ""
    measured = table.stack(f"meas{at}", READING, np.nan)
    for k, name in enumerate(READING):
        for i in np.flatnonzero(np.isfinite(measured[:, k]) & np.isnan(sigma[:, k]))[
            :1
        ]:
            key = "rotation" if k < 3 else "position"
            message = (
                "found no standard deviation; expected one in this cell or "
                f"[noise] {key} in campaign.toml"
            )
            raise table.bad(int(i), f"sigma{at}.{name}", message)
        unit, largest = ("rad", np.pi) if k < 3 else ("m", extent)
        for i in np.flatnonzero(~(sigma[:, k] >= _FINEST) & ~np.isnan(sigma[:, k]))[:1]:
            message = f"found {sigma[i, k]:g} {unit}, expected a standard "
            message += "deviation > 0"
            raise table.bad(int(i), f"sigma{at}.{name}", message)
        expected = (
            f"at most half a turn in rad{_UNITS}"
            if k < 3
            else f"a length in m, at most the robot's size of {extent:.3g}{_UNITS}"
        )
        _within(table, f"sigma{at}.{name}", sigma[:, k], largest, expected)
        if registration == "unknown" and k >= 3:
            largest, expected = max(_ROOM, extent), f"a length in m{_UNITS}"
        _within(table, f"meas{at}.{name}", measured[:, k], largest, expected)


def extent_of(transforms: NDArray, reference_points: NDArray) -> float:
    """Return the diagonal [m] of the bounding box of a robot in all configurations.

    Args:
        transforms: (k, n, 4, 4) poses of the frames in each configuration.
        reference_points: (k, 3) [m] measured points, base axes.

    Returns:
        The diagonal, or 1 if all points coincide.
    """
    origins = transforms[..., :3, 3].reshape(-1, 3)
    points = np.concatenate([np.zeros((1, 3)), origins, reference_points])
    return float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0


def _body_length(robot: Robot) -> float:
    """Return the total length [m] of all bodies, including the travel of slides."""
    lengths = np.linalg.norm(robot.fixed_transforms[:, :3, 3], axis=1).sum()
    slides = [abs(f.position) for f in robot.frames if f.joint == "prismatic"]
    return float(lengths + sum(slides)) or 1.0


def _within(table: MeasurementTable, name: str, values: NDArray, largest: float,
            expected: str) -> None:  # fmt: skip
    """Raise BadInput if the magnitude of a value exceeds a limit."""
    for i in np.flatnonzero(np.abs(values) > largest * (1 + 1e-9))[:1]:
        message = f"found {values[i]:g}, expected {expected}"
        raise table.bad(int(i), name, message)
