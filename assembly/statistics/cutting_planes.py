"""Minimum-cost tolerances for convex requirements, by cutting planes.

Two types of requirements are convex in the tolerances t:

- *yield 1*: a limit on the margin or the energy at every corner of the tolerance box.
  For every vector s of signs, the quantity ``m(t s)`` is convex in t.
- *yield below 1*: a limit on the mean of the worst fraction (1 - yield) of many fixed
  draws s. This mean is the conditional value at risk. A limit on this mean is
  stricter than the required yield.

Each iteration minimises the cost subject to linear inequalities (cutting planes). If
the result violates the requirement, the linearisation of the violated quantity is added
as a further inequality. All feasible tolerances satisfy these inequalities, so each
minimum is a lower bound on the cost.

Sources:
    Kelley (1960), The cutting-plane method for solving convex programs; Rockafellar,
    Uryasev (2000), Optimization of conditional value-at-risk.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.statistics.requirement import TRAINING, Plan, Requirement
from forcefit.assembly.statistics.worst_case import CORNERS, random_corners
from forcefit.inputs.table import BadInput

_TOLERANCE = 1e-3  # largest accepted violation, relative to the limit
_MOST_CUTS = 200


def cut_planes(
    requirement: Requirement, progress: Callable[[str, int, int], None]
) -> tuple[NDArray, float, int]:
    """Find the minimum-cost tolerances that satisfy convex requirements.

    Args:
        requirement: requirement at all postures.
        progress: function called with the name of a computation, the number of
            finished steps and the number of all steps.

    Returns:
        Tolerances, (G,) [rad or m], a lower bound on their cost, and the number of
        cutting planes.

    Raises:
        BadInput: a limit is exceeded without errors or with the tightest tolerances.
    """
    plan = requirement.plan
    planes: list[NDArray] = []
    t = np.array(plan.most, dtype=float)
    bound = -np.inf
    for step in range(_MOST_CUTS):
        progress("cutting planes", step, _MOST_CUTS)
        violated = list(_violated(requirement, t))
        if not violated:
            break
        planes += violated
        t = cheapest_within(plan, planes, plan.least, plan.most)
        bound = plan.price(t)
    progress("cutting planes", _MOST_CUTS, _MOST_CUTS)
    return t, bound, len(planes)


def cheapest_within(
    plan: Plan, planes: Sequence[NDArray], least: NDArray, most: NDArray
) -> NDArray:
    """Find the minimum-cost tolerances t that satisfy ``a.t <= 1`` for all a.

    Args:
        plan: plan with the cost coefficients.
        planes: (G,) [1/rad or 1/m] coefficients a of each cutting plane.
        least: (G,) [rad or m] smallest tolerances.
        most: (G,) [rad or m] largest tolerances.

    Returns:
        (G,) [rad or m] tolerances.

    Raises:
        BadInput: no tolerances satisfy all inequalities.
    """
    import cvxpy as cp

    A = np.array(planes).reshape(-1, len(plan.names))
    # Scale each tolerance by the largest value it can have if all others are zero.
    steepest = np.maximum(A, 0.0).max(axis=0, initial=0.0)
    scale = np.minimum(most, 1.0 / np.maximum(steepest, 1e-300))
    x = cp.Variable(len(plan.names))
    if plan.cost == "reciprocal":
        costs = plan.costs / scale
        goal = cp.Minimize((costs / costs.sum()) @ cp.inv_pos(x))
    else:
        goal = cp.Minimize(-(plan.costs / plan.costs.sum()) @ cp.log(x))
    constraints = [(A * scale) @ x <= 1.0, x <= most / scale]
    if least.any():
        constraints.append(x >= least / scale)
    problem = cp.Problem(goal, constraints)
    problem.solve(solver="CLARABEL")
    if x.value is None:
        raise BadInput(
            "tolerances: even the smallest allowed tolerances exceed a limit; increase "
            "the limit or allow smaller tolerances"
        )
    return np.clip(x.value * scale, least, most)


def _violated(requirement: Requirement, t: NDArray) -> Iterator[NDArray]:
    """Yield cutting planes ``a.t <= 1`` that the tolerances t violate."""
    plan = requirement.plan
    spread = plan.spread(t)
    for key, prepared in requirement.convex.items():
        limit = plan.limits[key]
        if plan.asked_yield == 1.0:
            corners = random_corners(CORNERS, len(spread), plan.seed)
            for i in range(len(prepared)):
                worst = requirement.worst_corner(key, i, t, corners)
                slopes = plan.gather(worst.slopes * worst.signs)
                if worst.value > limit * (1 + _TOLERANCE):
                    yield _plane(slopes, worst.value, t, limit)
            continue
        draws = plan.draws_of(TRAINING, plan.draws)
        values = np.full(len(draws), -np.inf)
        slopes = np.zeros_like(draws)
        for i in range(len(prepared)):
            responses, response_slopes = requirement.respond(key, i, draws * spread)
            higher = responses > values
            values[higher], slopes[higher] = (
                responses[higher],
                (response_slopes * draws)[higher],
            )
        tail = np.argsort(values)[-max(1, round((1 - plan.asked_yield) * len(draws))) :]
        if values[tail].mean() > limit * (1 + _TOLERANCE):
            mean = plan.gather(slopes[tail].mean(axis=0))
            yield _plane(mean, float(values[tail].mean()), t, limit)


def _plane(slopes: NDArray, value: float, t: NDArray, limit: float) -> NDArray:
    """Return the coefficients a of a limit linearised at t, ``a.t' <= 1``."""
    right = limit - value + float(slopes @ t)
    if right <= 0:
        raise BadInput(
            f"even a robot without geometric errors exceeds a limit of {limit:g}; "
            "increase the limit or reduce the clearances"
        )
    return slopes / right
