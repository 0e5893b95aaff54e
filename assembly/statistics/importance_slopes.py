"""Exact derivatives of the platform's screw with respect to groups of errors.

A ratio of two sampled standard deviations would contain sampling noise. As long as the
active clearances do not change, the solution (22) is linear in the errors, and its
derivatives are exact (:mod:`forcefit.assembly.statistics.sensitivity`). The gain of a
group is the root mean square of these derivatives over several draws and over the
group's errors, weighted by variance.
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
    """Compute the gain of each group of errors: platform motion per unit of error.

    Args:
        experiment: error distributions and posture.
        design: design whose groups and first draws are used.

    Returns:
        (2, d) rotation [rad] and translation [m] per rad or m of error. NaN for a group
        that mixes angles and lengths, if no draw has a solution, and for robots with
        bolted joints, whose locked-in clearances depend on the errors.
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
        prepared: the prepared posture.
        draws: solutions of k draws, with clearances relative to their bounds.

    Returns:
        (6, k, n, 6) [rad or m per rad or m] derivatives.
    """
    count, frames = draws.errors.shape[:2]
    repeated = draws[np.tile(np.arange(count), 6)]
    by_screw = np.repeat(np.eye(6), count, axis=0)
    by_wrench = np.zeros((6 * count, frames, 6))
    slopes = solution_slopes(prepared, repeated, by_wrench, by_screw)
    return slopes.reshape(6, count, frames, 6)


def error_units(sources: Sources, design: SaltelliDesign) -> list[str]:
    """Return the unit of the errors of each group."""
    units = sources.units
    of_groups = [{units[i] for i in columns} for _, columns in design.groups]
    return [of.pop() if len(of) == 1 else "rad, m" for of in of_groups]
