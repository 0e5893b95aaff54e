"""Extrapolate differences between two models to scale 0, with uncertainties.

======  ===================  ==========================================================
symbol  code                 meaning
======  ===================  ==========================================================
s       ``scale``            factor on geometric errors, clearances and load
slope   ``difference_slope`` slope of log difference over log scale, as s goes to 0
limit   ``limit_difference`` difference / s^p extrapolated to s = 0, relative
======  ===================  ==========================================================

The uncertainty of a limit is estimated by omitting the largest scale. It is twice the
resulting change of the limit.  Differences below :data:`FLOOR` are regarded as noise of
the simulation.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.model.robot import Robot
from forcefit.validation.crosscheck.link_models import link_stiffness
from forcefit.validation.crosscheck.pair import Pair, sprung
from forcefit.validation.crosscheck.verdict import Check

# [-] Tolerance of every relative difference, extrapolated to scale 0.
LIMIT_TOLERANCE = 1e-3
# resolution of a simulation [rad], [m]
FLOOR = {"rotation": 1e-10, "translation": 1e-11}
# Changes are regarded as noise if they are smaller than this multiple of the effect of
# weak springs.
_NOISE = 3.0
HALVES = {"rotation": slice(0, 3), "translation": slice(3, 6)}


def spring_limits(
    robot: Robot, pairs: Sequence[Pair], spread: bool = False
) -> dict[str, Check]:
    """Return checks of spring deformations, wrenches and energy at scale 0.

    Args:
        robot: robot with the compared links and joint springs.
        pairs: both solutions at several scales.
        spread: whether loads act between the ends of links.  Link wrenches are then not
            compared, because the linear model contains no such loads.

    Returns:
        Mapping from quantity to its check; see :func:`limit_difference`.  Differences
        are relative to the largest value of all links or joints.
    """
    scales = np.array([pair.scale for pair in pairs])
    stiff = _stiffest(robot)
    screw = np.array(list(FLOOR.values()))
    limits = {}
    for kind, part in (("link", "link"), ("joint", "joint_stiffness")):
        rows = [getattr(frame, part) is not None for frame in robot.frames]
        if not any(rows):
            continue
        wrench = "wrenches" if kind == "link" else "joint_wrenches"
        compared = [("screws", f"{kind}_screws", screw, ("rotation", "translation"))]
        if kind == "joint" or not spread:
            compared.append(("wrenches", wrench, stiff * screw, ("moment", "force")))
        for what, linear, floor, labels in compared:
            name = f"{kind}_{what}"
            mask = sprung(robot)[rows] if name == "joint_wrenches" else 1.0
            ours = np.array([getattr(p.linear, linear)[rows] for p in pairs]) * mask
            theirs = np.array([getattr(p.simulated, name)[rows] for p in pairs])
            theirs = theirs * mask
            noise = _NOISE * pairs[0].noise_of(linear)[rows]
            for label, half, least in zip(labels, HALVES.values(), floor, strict=True):
                least = max(least, noise[..., half].max())
                limits[f"{kind} {label}"] = limit_difference(
                    scales, ours[..., half], theirs[..., half], 1, least
                )
    ours = np.array([pair.linear_energy for pair in pairs])
    theirs = np.array([pair.simulated.rigid_energy for pair in pairs])
    least = energy_floor(robot)
    return limits | {"energy": limit_difference(scales, ours, theirs, 2, least)}


def energy_floor(robot: Robot) -> float:
    """Return the energy [J] of the stiffest spring for a deformation :data:`FLOOR`."""
    return float((_stiffest(robot) * np.array(list(FLOOR.values())) ** 2).max())


def limit_difference(
    scales: NDArray, ours: NDArray, theirs: NDArray, power: int, floor: float,
    bound: float = LIMIT_TOLERANCE, least_size: float = 0.0,
) -> Check:  # fmt: skip
    """Return the check of the relative difference between two models at scale 0.

    Args:
        scales: (k,) different scales, largest first.
        ours: (k, ...) values of the virtual-joint model, proportional to a power of the
            scale.
        theirs: (k, ...) values of the simulation.
        power: exponent of the scale.
        floor: size below which differences are noise, in the unit of the values.
        bound: largest accepted relative difference.
        least_size: smallest divisor of the difference, in the unit of the values.

    Returns:
        The check of the largest relative difference. It has a signal if the noise is
        smaller than the bound times the largest value of ``ours``.
    """
    weight = scales.reshape(-1, *[1] * (ours.ndim - 1)) ** -float(power)
    limit, change = limit_of(scales, (theirs - ours) * weight)
    largest = np.abs(ours * weight).max()
    size = max(largest, floor / bound, least_size, 1e-300)
    uncertainty = max(0.0, change - 2 * floor) / size
    return Check(limit / size, bound, uncertainty, signal=not largest < size)


def limit_of(scales: NDArray, values: NDArray) -> tuple[float, float]:
    """Extrapolate values to scale 0 and return the largest component.

    Args:
        scales: (k,) different scales, largest first.
        values: (k, ...) values at these scales.

    Returns:
        The absolute value of the component, and its uncertainty.
    """
    limit = extrapolate(scales, values)
    change = limit - extrapolate(scales[1:], values[1:])
    return float(np.abs(limit).max()), 2 * float(np.abs(change).max())


def _stiffest(robot: Robot) -> NDArray:
    """Return the largest stiffness of all springs, (2,) [N m/rad, N/m]."""
    diagonals = [np.zeros(6)]
    links = [frame for frame in robot.frames if frame.link is not None]
    diagonals += [np.diag(link_stiffness(frame)) for frame in links]
    joints = [f.joint_stiffness for f in robot.frames if f.joint_stiffness is not None]
    diagonals += [np.diag(np.where(np.isfinite(K), K, 0.0)) for K in joints]
    return np.max(diagonals, axis=0).reshape(2, 3).max(axis=1)


def difference_slope(scales: ArrayLike, differences: ArrayLike, floor: float) -> float:
    """Return the slope of log difference over log scale as the scale goes to 0.

    In a difference of second order, ``c2 s^2 + c3 s^3 + ..``, the terms may partly
    cancel.  The slope of a straight line through the logarithms would then be wrong.
    Therefore, the first-order term ``c1 s`` is extrapolated from ``difference / s``.
    The slope at the smallest scale is computed from the ratio of this term and the
    terms of higher order.

    Args:
        scales: (k,) positive scales, largest first.
        differences: (k, ...) components of the difference at these scales.
        floor: size below which differences are noise and are omitted.

    Returns:
        The slope: 2 without a first-order term, 1 without terms of higher order, and
        NaN if fewer than two differences exceed the floor.
    """
    scales, parts = _clear(scales, differences, floor)
    if len(scales) < 2:
        return math.nan
    first = scales[-1] * extrapolate(scales, parts / scales[:, None])
    size = float(np.linalg.norm(first))
    return 2.0 - size / (size + float(np.linalg.norm(parts[-1] - first)))


def slope_check(
    scales: ArrayLike, differences: ArrayLike, floor: float, bound: float
) -> Check:
    """Return the check that a slope equals 2.

    Args:
        scales: (k,) scales, largest first.
        differences: (k, ...) components of the difference at these scales.
        floor: size below which differences are noise and are omitted.
        bound: largest accepted difference of the slope from 2.

    Returns:
        The check.  Its uncertainty is the change of the slope if the largest scale is
        omitted, and infinite for two scales.  The check has no signal if fewer than two
        differences exceed the floor, or if noise can change the slope by more than the
        bound.
    """
    value = 2.0 - difference_slope(scales, differences, floor)
    if math.isnan(value):
        return Check(math.nan, bound, signal=False)
    if value <= bound:
        return Check(value, bound)
    if _slope_of_noise(scales, differences, floor) > bound:
        return Check(math.nan, bound, signal=False)
    left = np.asarray(scales)[1:], np.asarray(differences)[1:]
    fewer = 2.0 - difference_slope(*left, floor)
    change = abs(value - fewer) if not math.isnan(fewer) else math.inf
    return Check(value, bound, change)


def _clear(
    scales: ArrayLike, differences: ArrayLike, floor: float
) -> tuple[NDArray, NDArray]:
    """Return the differences (k, components) above the noise, and their scales."""
    scales = np.asarray(scales, dtype=float)
    parts = np.asarray(differences, dtype=float).reshape(len(scales), -1)
    clear = np.linalg.norm(parts, axis=1) > floor
    return scales[clear], parts[clear]


def _slope_of_noise(scales: ArrayLike, differences: ArrayLike, floor: float) -> float:
    """Return the largest slope change that noise of size ``floor`` can cause."""
    scales, parts = _clear(scales, differences, floor)
    weights = extrapolate(scales, np.diag(1.0 / scales))
    first = scales[-1] * floor * float(np.abs(weights).sum())
    return first / float(np.linalg.norm(parts[-1]))


def extrapolate(scales: NDArray, values: NDArray) -> NDArray:
    """Return the value at scale 0 of the interpolating polynomial (Neville).

    Args:
        scales: (k,) different scales.
        values: (k, ...) values at these scales.

    Returns:
        Value at scale 0, (...).  Its error is of the order of the product of the
        scales.
    """
    table = [np.asarray(v, dtype=float) for v in values]
    for step in range(1, len(table)):
        for i in range(len(table) - step):
            near, far = scales[i + step], scales[i]
            table[i] = (far * table[i + 1] - near * table[i]) / (far - near)
    return table[0]
