"""Tolerances of locally minimum cost for limits on nonconvex quantities.

Wrenches, stress and pose errors are not convex in the errors, and a yield is not convex
in the tolerances.  However, the derivatives of the limited quantities with respect to
every error and every tolerance are known for the worst samples, so the limits can be
linearised. A convex programme with the linearised limits computes a trial point within
a trust region around the current tolerances.  The trial point is scaled uniformly until
the samples just meet the limits again.  The trial point is accepted if its cost is
smaller; otherwise the trust region is reduced.  The cost therefore never increases. The
result is a local minimum, which need not be global.

For a yield below 1, the linearised limit is the mean over the samples closest to the
limit, which is the derivative of the quantile.  For a yield of 1, each of the worst
samples has a separate linearised limit. The worst corners of the tolerance box are
searched again at every step.

Sources:
    Hong (2009), Estimating quantile sensitivities; Fletcher, Leyffer (2002), for
    programmes within a trust region.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.statistics.cutting_planes import cheapest_within
from forcefit.assembly.statistics.requirement import Plan, Requirement
from forcefit.assembly.statistics.scaling import (
    Samples,
    scale_uniformly,
    with_worst_corners,
)

_COARSE = 1e-3  # precision of the scaling at intermediate steps, relative to the limits
# smallest relative reduction of the cost per step for which the iteration continues
_GAIN = 1e-4
# largest and smallest factor on the tolerances in one step (trust region)
_LARGEST_RADIUS, _SMALLEST_RADIUS = 2.0, 1.01
_MOST_STEPS = 60
_PLANES = 200  # number of worst samples that are linearised for a yield of 1
_NEARLY_ACTIVE = 0.8  # samples above this fraction of the limit count as active


def least_cost(
    requirement: Requirement, samples: Samples, t: NDArray,
    progress: Callable[[str, int, int], None],
) -> tuple[NDArray, Samples]:  # fmt: skip
    """Reduce the cost of tolerances, starting from uniformly scaled ones.

    Args:
        requirement: requirement at all postures.
        samples: samples of the errors that must meet the limits.
        t: (G,) [rad or m] tolerances at the start; only their proportions matter.
        progress: called with the name of a step, its progress and its total.

    Returns:
        (G,) [rad or m] tolerances, and the samples with the worst corners of all
        iterations.

    Raises:
        BadInput: no scale factor makes the samples meet the limits.
    """
    plan, radius = requirement.plan, _LARGEST_RADIUS
    t = scale_uniformly(requirement, samples, t, _COARSE)
    for step in range(_MOST_STEPS):
        progress("least cost", step, _MOST_STEPS)
        if plan.asked_yield == 1.0:
            before = len(samples.values)
            samples = with_worst_corners(requirement, samples, t)
            t = (
                scale_uniformly(requirement, samples, t, _COARSE)
                if len(samples.values) > before
                else t
            )
        planes = _planes(requirement, samples, t)
        least = np.maximum(plan.least, t / radius)
        most = np.minimum(plan.most, t * radius)
        trial = scale_uniformly(
            requirement, samples, cheapest_within(plan, planes, least, most), _COARSE
        )
        if _saving(plan, t, trial) > _GAIN:
            t = trial
            continue
        # half of the rejected step, in logarithms
        radius = np.exp(np.abs(np.log(trial / t)).max() / 2)
        if radius < _SMALLEST_RADIUS:
            break
    progress("least cost", _MOST_STEPS, _MOST_STEPS)
    return t, samples


def _saving(plan: Plan, before: NDArray, after: NDArray) -> float:
    """Return the reduction of the cost, relative to the cost of all tolerances."""
    size = plan.price(before) if plan.cost == "reciprocal" else plan.costs.sum()
    return (plan.price(before) - plan.price(after)) / size


def _planes(requirement: Requirement, samples: Samples, t: NDArray) -> list[NDArray]:
    """Return linearised limits a.t' <= 1, a (G,), at the samples nearest to limits."""
    values = samples.values * requirement.plan.spread(t)
    utilisations = requirement.utilisations(values)[1]
    if requirement.plan.asked_yield == 1.0:
        order = np.argsort(utilisations, axis=None)[::-1][:_PLANES]
        cases, draws = np.unravel_index(order, utilisations.shape)
        critical = utilisations[cases, draws] > _NEARLY_ACTIVE
        critical[0] = True
        cases, draws = cases[critical], draws[critical]
    else:
        worst = utilisations.max(axis=0)
        count = min(64, max(16, len(worst) // 20))
        draws = np.argsort(np.abs(np.log(np.maximum(worst, 1e-300))))[:count]
        cases = utilisations[:, draws].argmax(axis=0)
    slopes = np.zeros((len(draws), len(requirement.plan.names)))
    for case in np.unique(cases):
        rows = np.flatnonzero(cases == case)
        slopes_of_case = (
            requirement.utilisation_slopes(int(case), values[draws[rows]])
            * values[draws[rows]]
        )
        slopes[rows] = [requirement.plan.gather(one) for one in slopes_of_case]
    utilisation = utilisations[cases, draws]
    relative_slopes = slopes / t  # relative derivative of utilisation by each tolerance
    if requirement.plan.asked_yield < 1.0:
        # a draw with zero utilisation has no relative slopes
        nonzero = utilisation > 0
        relative_slopes = (relative_slopes[nonzero] / utilisation[nonzero, None]).sum(
            axis=0, keepdims=True
        )
        relative_slopes /= max(1, len(utilisation))
        utilisation = np.ones(1)
    right_sides = 1.0 - utilisation + relative_slopes @ t
    return [a / b for a, b in zip(relative_slopes, right_sides, strict=True) if b > 0]
