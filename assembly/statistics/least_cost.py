"""Cheaper tolerances where limits are not convex: a sequence of convex programmes.

Wrenches, stress and pose errors of the least energy are no convex functions of the
errors, nor is a yield one of the tolerances.  But what the worst samples ask has slopes
with every error, so with every tolerance: a programme with these planes, within a
factor of the tolerances there are, gives others; these are scaled alike until the
samples just fit again, and kept if they are cheaper.  If not, the next step is half as
long, until nothing is gained.  So the cost never rises, and ends where the
slopes balance the costs: at least cost in a neighbourhood, not proved for all others.

With a yield, the plane is the mean over the samples at the edge of failing: the slope
of the quantile.  Where none may fail each of the worst has its own plane, and the worst
corners of the tolerances are looked for again at every step.

Sources:
    Hong (2009), Estimating quantile sensitivities; Fletcher, Leyffer (2002), for
    programmes within a trust region.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from assembly.statistics.cutting_planes import cheapest_within
from assembly.statistics.requirement import Plan, Requirement
from assembly.statistics.scaling import Samples, fit, with_worst_corners

_COARSE = 1e-3  # of the limits, for comparing costs on the way
_GAIN = 1e-4  # relative, of the cost: less is none
_FURTHEST, _NEAREST = 2.0, 1.01  # factor on tolerances within which planes are believed
_MOST_STEPS = 60
_PLANES = 200  # the worst samples where none may fail
_NEARLY = 0.8  # of a limit: what may come to decide


def least_cost(
    work: Requirement, samples: Samples, t: NDArray,
    progress: Callable[[str, int, int], None],
) -> tuple[NDArray, Samples]:  # fmt: skip
    """Tolerances that cost no more than given proportions scaled alike.

    Args:
        work: what is required.
        samples: of the errors, that must fit.
        t: (G,) [rad or m] proportions to start from.
        progress: called with what is done, how far, and of how much.

    Returns:
        (G,) [rad or m], and the samples with all worst corners met on the way.

    Raises:
        BadInput: the samples fit at no scale.
    """
    plan, reach = work.plan, _FURTHEST
    t = fit(work, samples, t, _COARSE)
    for step in range(_MOST_STEPS):
        progress("least cost", step, _MOST_STEPS)
        if plan.asked_yield == 1.0:
            before = len(samples.values)
            samples = with_worst_corners(work, samples, t)
            t = fit(work, samples, t, _COARSE) if len(samples.values) > before else t
        planes = _planes(work, samples, t)
        least = np.maximum(plan.least, t / reach)
        most = np.minimum(plan.most, t * reach)
        trial = fit(work, samples, cheapest_within(plan, planes, least, most), _COARSE)
        if _saving(plan, t, trial) > _GAIN:
            t = trial
            continue
        # half as far, in logarithms, as the step that gained nothing
        reach = np.exp(np.abs(np.log(trial / t)).max() / 2)
        if reach < _NEAREST:
            break
    progress("least cost", _MOST_STEPS, _MOST_STEPS)
    return t, samples


def _saving(plan: Plan, before: NDArray, after: NDArray) -> float:
    """How much cheaper, relative to what all tolerances cost."""
    size = plan.price(before) if plan.cost == "reciprocal" else plan.costs.sum()
    return (plan.price(before) - plan.price(after)) / size


def _planes(work: Requirement, samples: Samples, t: NDArray) -> list[NDArray]:
    """(G,) each: a.t' <= 1 keeps the samples within the limits near t."""
    values = samples.values * work.plan.spread(t)
    shares = work.shares(values)[1]
    if work.plan.asked_yield == 1.0:
        order = np.argsort(shares, axis=None)[::-1][:_PLANES]
        places, draws = np.unravel_index(order, shares.shape)
        kept = shares[places, draws] > _NEARLY
        kept[0] = True
        places, draws = places[kept], draws[kept]
    else:
        worst = shares.max(axis=0)
        count = min(64, max(16, len(worst) // 20))
        draws = np.argsort(np.abs(np.log(np.maximum(worst, 1e-300))))[:count]
        places = shares[:, draws].argmax(axis=0)
    slopes = np.zeros((len(draws), len(work.plan.names)))
    for place in np.unique(places):
        rows = np.flatnonzero(places == place)
        own = work.share_slopes(int(place), values[draws[rows]]) * values[draws[rows]]
        slopes[rows] = [work.plan.gather(one) for one in own]
    size = shares[places, draws]
    relative = slopes / t  # slopes of the share with every tolerance
    if work.plan.asked_yield < 1.0:
        # a draw that uses up nothing of a limit says nothing of its slopes
        used = size > 0
        relative = (relative[used] / size[used, None]).sum(axis=0, keepdims=True)
        relative /= max(1, len(size))
        size = np.ones(1)
    right = 1.0 - size + relative @ t
    return [a / b for a, b in zip(relative, right, strict=True) if b > 0]
