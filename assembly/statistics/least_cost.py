"""Minimum-cost tolerances for limits on nonconvex quantities (local minimum).

Wrenches, stress and pose errors are not convex in the errors, and a yield is not convex
in the tolerances. Each iteration linearises the limits at the worst samples of errors.
A convex programme then computes trial tolerances within a trust region around the
current ones. The trial tolerances are multiplied by the largest common factor with
which the samples satisfy the limits. They are accepted if their cost is smaller.
Otherwise, the trust region is reduced.

For a yield below 1, the derivatives are averaged over the samples closest to the limit.
This mean estimates the derivative of the quantile that the yield limits. For a yield
of 1, each of the worst samples is linearised separately, and the worst corners of the
tolerance box are searched in each iteration.

Sources:
    Hong (2009), Estimating quantile sensitivities; Fletcher, Leyffer (2002), Nonlinear
    programming without a penalty function (trust region).
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

_COARSE = 1e-3  # relative precision of the scaling in intermediate iterations
# smallest relative reduction of the cost for which a trial point is accepted
_GAIN = 1e-4
# initial and smallest radius of the trust region, as a factor by which a tolerance can
# change
_LARGEST_RADIUS, _SMALLEST_RADIUS = 2.0, 1.01
_MOST_STEPS = 60
_PLANES = 200  # largest number of samples that are linearised for a yield of 1
_NEARLY_ACTIVE = 0.8  # fraction of the limit above which a sample is linearised


def least_cost(
    requirement: Requirement, samples: Samples, t: NDArray,
    progress: Callable[[str, int, int], None],
) -> tuple[NDArray, Samples]:  # fmt: skip
    """Minimise the cost of tolerances locally.

    Args:
        requirement: requirement at all postures.
        samples: samples of the errors that must satisfy the limits.
        t: (G,) [rad or m] initial tolerances, which are scaled by a common factor.
        progress: function called with the name of a computation, the number of
            finished steps and the number of all steps.

    Returns:
        Tolerances, (G,) [rad or m], and the samples including all worst corners found.

    Raises:
        BadInput: the samples exceed the limits for all scale factors.
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
        # The new radius is half of the rejected step on a logarithmic scale.
        radius = np.exp(np.abs(np.log(trial / t)).max() / 2)
        if radius < _SMALLEST_RADIUS:
            break
    progress("least cost", _MOST_STEPS, _MOST_STEPS)
    return t, samples


def _saving(plan: Plan, before: NDArray, after: NDArray) -> float:
    """Return the relative reduction of the cost by new tolerances."""
    size = plan.price(before) if plan.cost == "reciprocal" else plan.costs.sum()
    return (plan.price(before) - plan.price(after)) / size


def _planes(requirement: Requirement, samples: Samples, t: NDArray) -> list[NDArray]:
    """Return the coefficients a of linearised limits ``a.t' <= 1``, each (G,)."""
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
    relative_slopes = slopes / t  # derivative with respect to each tolerance
    if requirement.plan.asked_yield < 1.0:
        # The logarithm of a zero utilisation has no derivative.
        nonzero = utilisation > 0
        relative_slopes = (relative_slopes[nonzero] / utilisation[nonzero, None]).sum(
            axis=0, keepdims=True
        )
        relative_slopes /= max(1, len(utilisation))
        utilisation = np.ones(1)
    right_sides = 1.0 - utilisation + relative_slopes @ t
    return [a / b for a, b in zip(relative_slopes, right_sides, strict=True) if b > 0]
