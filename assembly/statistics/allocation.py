"""The loosest tolerances with which a robot still goes together: a convex programme.

Tolerances t_g, one for each class of errors, cost ``c_g / t_g`` (or ``-c_g log t_g``).
Two requirements are convex in t:

- *always* (yield 1): margin or energy at every corner of the tolerances, for
  ``m(t s)`` is convex in t for every choice s of signs, and proportional to t if it is
  the margin;
- *with a yield*: the mean of the worst (1 - yield) of many fixed draws s (the
  conditional value at risk), which is more than the yield asks.

Both are met by cutting planes: solve, find where the requirement is violated most, add
the plane that its slopes give, repeat.  Every plane holds for all tolerances that meet
the requirement, so the programme's cost bounds theirs from below.  Last, all tolerances
are scaled alike until the draws (or the worst corner) just meet every limit, also those
of wrenches, stress and pose error, which are not convex.

Sources:
    Kelley (1960), The cutting-plane method for solving convex programs; Rockafellar,
    Uryasev (2000), Optimization of conditional value-at-risk.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.posture import Posture
from assembly.statistics.estimates import proportion
from assembly.statistics.requirement import TRAINING, Plan, Requirement
from assembly.statistics.verification import prove_worst, verify_yield
from assembly.statistics.worst_case import (
    CORNERS,
    random_corners,
    respond,
    worst_corner,
)
from stiffness.reading import BadInput

_TOLERANCE = 1e-3  # of a limit: by how much the programme may still violate it
_MOST_CUTS = 200


@dataclass(frozen=True, eq=False)
class Allocation:
    """Tolerances, what they cost, and what is known of them.

    Attributes:
        plan: what was asked.
        tolerances: (G,) [rad or m].
        price: their cost.
        price_bound: no tolerances that always meet the convex limits cost less; NaN
            for a yield below 1, or without convex limits.
        cuts: planes in the programme.
        worst: by limit in :data:`CONVEX` and for yield 1: the worst corner found and
            the proven upper bound, over all postures.
        proven_scale: factor on the tolerances at which the proof meets the limits too;
            1 or less, NaN where nothing is proven.
        verification: of fresh draws: yields with their intervals.
    """

    plan: Plan
    tolerances: NDArray
    price: float
    price_bound: float
    cuts: int
    worst: dict[str, tuple[float, float]] = field(default_factory=dict)
    proven_scale: float = float("nan")
    verification: dict[str, Any] = field(default_factory=dict)


def allocate(
    postures: Sequence[Posture],
    plan: Plan,
    fresh: int = 2000,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> Allocation:
    """Find the cheapest tolerances that meet a plan over postures, and verify them.

    Args:
        postures: of one robot, the workspace.
        plan: what is asked.
        fresh: draws, none of which was used before, to verify with; 0 for none.
        progress: called with what is done, how far, and of how much.

    Returns:
        The tolerances.

    Raises:
        BadInput: an error is taken up by nothing, or even the tightest tolerances
            violate a limit.
    """
    work = Requirement(postures, plan)
    driver = work
    if not work.convex:
        # nothing convex is limited: the energy gives the shape, the scale does the rest
        typical = _typical_energy(work)
        driver = Requirement(postures, replace(plan, limits={"energy": typical}))
    driver.check_taken_up()
    t, bound, cuts = _cutting_planes(driver, progress)
    t = np.clip(t * _scale(work, t), plan.least, plan.most)
    always = plan.asked_yield == 1.0
    if not (always and work.convex):
        bound = np.nan
    answer = Allocation(plan, t, plan.price(t), bound, cuts)
    if always:
        worst, proven = prove_worst(work, t, progress)
        answer = replace(answer, worst=worst, proven_scale=proven)
    if fresh:
        answer = replace(answer, verification=verify_yield(work, t, fresh, progress))
    return answer


def _typical_energy(work: Requirement) -> float:
    """[J] of half the draws at the loosest tolerances, at the first posture."""
    plan = work.plan
    values = plan.draws_of(TRAINING, 200) * plan.spread(plan.most)
    rows = work.experiments[0].answer(values, range(len(values)))
    return max(float(np.median(rows["energy"])), 1e-12)


def _cutting_planes(
    work: Requirement, progress: Callable[[str, int, int], None]
) -> tuple[NDArray, float, int]:
    """Tolerances, the programme's cost and its planes."""
    plan = work.plan
    planes: list[tuple[NDArray, float]] = []
    t = np.array(plan.most, dtype=float)
    bound = -np.inf
    for step in range(_MOST_CUTS):
        progress("cutting planes", step, _MOST_CUTS)
        found = list(_violated(work, t))
        if not found:
            break
        planes += found
        t = _solve(plan, planes)
        bound = plan.price(t)
    progress("cutting planes", _MOST_CUTS, _MOST_CUTS)
    return t, bound, len(planes)


def _violated(work: Requirement, t: NDArray) -> Any:
    """Planes ``a.t <= b`` that the tolerances violate."""
    plan = work.plan
    spread = plan.spread(t)
    for key, ready in work.convex.items():
        limit = plan.limits[key]
        if plan.asked_yield == 1.0:
            corners = random_corners(CORNERS, len(spread), plan.seed)
            for one in ready:
                worst = worst_corner(one, plan.sources, spread, corners)
                slopes = plan.gather(worst.slopes * worst.signs)
                if worst.value > limit * (1 + _TOLERANCE):
                    yield _plane(slopes, worst.value, t, limit)
            continue
        draws = plan.draws_of(TRAINING, plan.draws)
        values = np.full(len(draws), -np.inf)
        slopes = np.zeros_like(draws)
        for one in ready:
            here, there = respond(one, plan.sources, draws * spread)
            higher = here > values
            values[higher], slopes[higher] = here[higher], (there * draws)[higher]
        tail = np.argsort(values)[-max(1, round((1 - plan.asked_yield) * len(draws))) :]
        if values[tail].mean() > limit * (1 + _TOLERANCE):
            mean = plan.gather(slopes[tail].mean(axis=0))
            yield _plane(mean, float(values[tail].mean()), t, limit)


def _plane(
    slopes: NDArray, value: float, t: NDArray, limit: float
) -> tuple[NDArray, float]:
    """The plane through a value and its slopes that must stay below a limit."""
    right = limit - value + float(slopes @ t)
    if right <= 0:
        raise BadInput(f"even perfect parts exceed a limit of {limit:g}")
    return slopes / right, 1.0


def _solve(plan: Plan, planes: list[tuple[NDArray, float]]) -> NDArray:
    """(G,) cheapest tolerances within all planes."""
    import cvxpy as cp

    A = np.array([a for a, _ in planes])
    # scaled: each alone would use up its plane at 1
    steepest = np.maximum(A, 0.0).max(axis=0)
    scale = np.minimum(plan.most, 1.0 / np.maximum(steepest, 1e-300))
    x = cp.Variable(len(plan.names))
    if plan.cost == "reciprocal":
        costs = plan.costs / scale
        goal = cp.Minimize((costs / costs.sum()) @ cp.inv_pos(x))
    else:
        goal = cp.Minimize(-(plan.costs / plan.costs.sum()) @ cp.log(x))
    held = [(A * scale) @ x <= 1.0, x <= plan.most / scale]
    if plan.least.any():
        held.append(x >= plan.least / scale)
    problem = cp.Problem(goal, held)
    problem.solve(solver="CLARABEL")
    if x.value is None:
        raise BadInput("tolerances: even the tightest ones allowed violate a limit")
    return np.clip(x.value * scale, plan.least, plan.most)


def _scale(work: Requirement, t: NDArray) -> float:
    """Factor on all tolerances at which the draws, or the worst corner, just fit."""
    plan = work.plan
    if plan.asked_yield == 1.0:
        samples = random_corners(plan.draws, len(plan.sources), plan.seed)
        worst = [
            worst_corner(one, plan.sources, plan.spread(t), samples[:CORNERS]).signs
            for ready in work.convex.values() for one in ready
        ]  # fmt: skip
        samples = np.vstack([samples, *worst]) if worst else samples
        allowed = 0
    else:
        samples = plan.draws_of(TRAINING, plan.draws)
        # so many may fail that the yield asked for is still held with 95 %
        allowed = _allowed_failures(plan.draws, plan.asked_yield)

    def fits(factor: float) -> bool:
        shares = work.shares(samples * plan.spread(factor * t))
        return int((shares > 1.0 + 1e-9).sum()) <= allowed

    low, high = 0.0, 1.0
    if fits(1.0):
        while high < 64.0 and fits(2.0 * high):
            high *= 2.0
        low, high = high, 2.0 * high
    while high - low > 1e-4 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    if low == 0.0:
        raise BadInput("tolerances: even perfect parts violate a limit")
    return low


def _allowed_failures(draws: int, asked: float) -> int:
    """Most failures with which a yield is held at 95 %, one-sided; at least none."""
    # proportion() falls as failures rise: the first that is too many, by bisection
    low, high = -1, draws
    while high - low > 1:
        middle = (low + high) // 2
        held = proportion(draws - middle, draws, 0.90)["lower"] >= asked
        low, high = (middle, high) if held else (low, middle)
    allowed = low
    if allowed < 0:
        raise BadInput(
            f"tolerances: {draws} draws cannot show a yield of {asked:g} even if none "
            "fails; ask for more draws"
        )
    return allowed
