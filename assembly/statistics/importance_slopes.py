"""Exact derivatives of the platform screw with respect to groups of errors.

The gain of a group of errors is a root mean square of derivatives of the platform
screw. The mean is over draws and over the errors of the group, which are weighted by
their variances. For the derivatives of the minimum-energy solution (22), see
:mod:`forcefit.assembly.statistics.sensitivity`.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.statistics.callout_sources import Sources
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.importance import SaltelliDesign
from forcefit.assembly.statistics.linear_response import LinearResponse
from forcefit.assembly.statistics.sensitivity import solution_slopes

DRAWS = 32  # number of draws over which the derivatives are averaged


def platform_gains(experiment: Experiment, design: SaltelliDesign) -> NDArray:
    """Compute the platform motion per unit of error (gain) of each group.

    Args:
        experiment: error distributions and posture.
        design: design with the groups and the draws.

    Returns:
        Gains of rotation and translation, (2, d) [rad or m per rad or m]. A gain is
        NaN if the group contains both angles and lengths, if there is no solution, or
        if the robot has bolted joints.
    """
    sources = experiment.sources
    values = design.A[:DRAWS]
    squares = np.zeros((2, len(sources)))
    draws = experiment.energies.solve(sources.errors(values))
    known = np.isfinite(draws.energy) & np.isfinite(draws.clearances).all(axis=1)
    known &= not any(f.locked_at for f in sources.robot.frames)
    if known.any():
        slopes = platform_slopes(experiment.energies, draws[known])
        of_sources = sources.of_numbers(slopes)
        mean = (of_sources**2).mean(axis=1)
        squares = np.stack([mean[:3].sum(axis=0), mean[3:].sum(axis=0)])
    gains = np.full((2, len(design.groups)), np.nan)
    for g, unit in enumerate(error_units(sources, design)):
        columns = design.groups[g][1]
        variance = sources.variance[columns]
        if unit != "rad, m" and known.any() and variance.any():
            gains[:, g] = np.sqrt(squares[:, columns] @ variance / variance.sum())
    return gains


def platform_slopes(prepared: LinearResponse, draws: Assembly) -> NDArray:
    """Differentiate the platform screw with respect to every geometric error.

    Args:
        prepared: linear response of the posture.
        draws: solutions for k draws, with clearances relative to their bounds.

    Returns:
        Derivatives, (6, k, n, 6) [rad or m per rad or m].
    """
    count, frames = draws.errors.shape[:2]
    repeated = draws[np.tile(np.arange(count), 6)]
    by_screw = np.repeat(np.eye(6), count, axis=0)
    by_wrench = np.zeros((6 * count, frames, 6))
    slopes = solution_slopes(prepared, repeated, by_wrench, by_screw)
    return slopes.reshape(6, count, frames, 6)


def error_units(sources: Sources, design: SaltelliDesign) -> list[str]:
    """Return the unit of the errors in each group."""
    units = sources.units
    of_groups = [{units[i] for i in columns} for _, columns in design.groups]
    return [of.pop() if len(of) == 1 else "rad, m" for of in of_groups]
