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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.distributions import ErrorSources
from assembly.estimates import proportion
from assembly.monte_carlo import Experiment
from assembly.posture import Posture
from assembly.posture_margins import prepare_margins
from assembly.worst_case import (
    bound_energy,
    bound_margin,
    random_corners,
    respond,
    worst_corner,
)
from stiffness.reading import BadInput

CONVEX = ("margin", "margin_free", "energy")
COSTS = ("reciprocal", "logarithm")
_TRAINING, _FRESH = 10, 11  # streams of random numbers
_CORNERS = 24
_TOLERANCE = 1e-3  # of a limit: by how much the programme may still violate it
_MOST_CUTS = 200


@dataclass(frozen=True, eq=False)
class Plan:
    """What is asked of the tolerances.

    Attributes:
        sources: m errors within tolerances of 1 [rad or m].
        group: (m,) class of each.
        names: of the G classes.
        costs: (G,) > 0.
        least: (G,) [rad or m] no tolerance is tighter.
        most: (G,) [rad or m] and none looser.
        cost: ``"reciprocal"`` or ``"logarithm"``.
        limits: by quantity: margin, margin_free, energy [J], force [N], moment [N m],
            stress [Pa], rotation [rad], translation [m].
        asked_yield: 1 means always; else the share of robots that must meet every
            limit at every posture.
        draws: training draws at every posture.
        seed: of all draws.
    """

    sources: ErrorSources
    group: NDArray
    names: tuple[str, ...]
    costs: NDArray
    least: NDArray
    most: NDArray
    limits: Mapping[str, float]
    cost: str = "reciprocal"
    asked_yield: float = 1.0
    draws: int = 1000
    seed: int = 1

    def spread(self, tolerances: NDArray) -> NDArray:
        """(m,) the tolerance of every source."""
        return tolerances[self.group]

    def gather(self, slopes: NDArray) -> NDArray:
        """(G,) sums over the sources of each class."""
        return np.bincount(self.group, weights=slopes, minlength=len(self.names))

    def price(self, tolerances: NDArray) -> float:
        """What tolerances cost."""
        if self.cost == "reciprocal":
            return float((self.costs / tolerances).sum())
        return float(-(self.costs * np.log(tolerances)).sum())


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


@dataclass(frozen=True, eq=False)
class _Postures:
    """All postures made ready for what is limited."""

    postures: Sequence[Posture]
    plan: Plan

    @cached_property
    def experiments(self) -> list[Experiment]:
        """Everything but the margins, at each posture."""
        sources, stress = self.plan.sources, "stress" in self.plan.limits
        found = [
            Experiment(p, sources, margins=False, stress=stress) for p in self.postures
        ]
        for key in self.plan.limits:
            if not key.startswith("margin"):
                found[0].check_limits([key])
        return found

    @cached_property
    def convex(self) -> dict[str, list]:
        """By convex limit, the postures prepared for it."""
        readings = {"margin": "rigid", "margin_free": "free"}
        return {
            key: [prepare_margins(p, readings[key]) for p in self.postures]
            if key in readings else [e.energies for e in self.experiments]
            for key in CONVEX if key in self.plan.limits
        }  # fmt: skip

    def shares(self, values: NDArray) -> NDArray:
        """(k,) largest quantity over its limit, of all limits and postures."""
        worst = np.zeros(len(values))
        others = [key for key in self.plan.limits if not key.startswith("margin")]
        for key, ready in self.convex.items():
            if key.startswith("margin"):
                for one in ready:
                    found = respond(one, self.plan.sources, values)[0]
                    share = found / self.plan.limits[key]
                    worst = np.maximum(worst, np.where(np.isnan(share), np.inf, share))
        for one in self.experiments if others else ():
            rows = one.answer(values, range(len(values)))
            screws = rows["platform_screw"]
            sizes = {
                "rotation": np.linalg.norm(screws[:, :3], axis=1),
                "translation": np.linalg.norm(screws[:, 3:], axis=1),
                "stress": rows["stress"].max(axis=1, initial=0.0),
            }
            for key in others:
                found = sizes[key] if key in sizes else rows[key]
                share = found / self.plan.limits[key]
                worst = np.maximum(worst, np.where(np.isnan(share), np.inf, share))
        return worst


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
    work = _Postures(postures, plan)
    driver = work
    if not work.convex:
        # nothing convex is limited: the energy gives the shape, the scale does the rest
        typical = _typical_energy(work)
        driver = _Postures(postures, replace(plan, limits={"energy": typical}))
    _check_taken_up(driver)
    t, bound, cuts = _cutting_planes(driver, progress)
    t = np.clip(t * _scale(work, t), plan.least, plan.most)
    always = plan.asked_yield == 1.0
    if not (always and work.convex):
        bound = np.nan
    answer = Allocation(plan, t, plan.price(t), bound, cuts)
    if always:
        answer = _prove(work, answer, progress)
    if fresh:
        answer = replace(answer, verification=_verify(work, t, fresh, progress))
    return answer


def _typical_energy(work: _Postures) -> float:
    """[J] of half the draws at the loosest tolerances, at the first posture."""
    plan = work.plan
    values = _standard(plan, _TRAINING, 200) * plan.spread(plan.most)
    rows = work.experiments[0].answer(values, range(len(values)))
    return max(float(np.median(rows["energy"])), 1e-12)


def _standard(plan: Plan, stream: int, count: int) -> NDArray:
    """(count, m) errors of unit tolerances."""
    return plan.sources.draw(0, count, plan.seed, stream)


def _check_taken_up(work: _Postures) -> None:
    """Refuse errors that neither play nor springs take up anywhere."""
    sources = work.plan.sources
    columns = 6 * sources.frame + sources.component
    for key, ready in work.convex.items():
        for one in ready:
            left = np.abs(one.unanswered[:, columns]).max(axis=0, initial=0.0)
            if left.max(initial=0.0) > 1e-9:
                name = sources.labels[int(left.argmax())]
                raise BadInput(
                    f"limit {key}: no play or spring takes up an error {name}; leave "
                    "it out, or limit the energy of a robot that gives way there"
                )


def _cutting_planes(
    work: _Postures, progress: Callable[[str, int, int], None]
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


def _violated(work: _Postures, t: NDArray) -> Any:
    """Planes ``a.t <= b`` that the tolerances violate."""
    plan = work.plan
    spread = plan.spread(t)
    for key, ready in work.convex.items():
        limit = plan.limits[key]
        if plan.asked_yield == 1.0:
            corners = random_corners(_CORNERS, len(spread), plan.seed)
            for one in ready:
                worst = worst_corner(one, plan.sources, spread, corners)
                slopes = plan.gather(worst.slopes * worst.signs)
                if worst.value > limit * (1 + _TOLERANCE):
                    yield _plane(slopes, worst.value, t, limit)
            continue
        draws = _standard(plan, _TRAINING, plan.draws)
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


def _scale(work: _Postures, t: NDArray) -> float:
    """Factor on all tolerances at which the draws, or the worst corner, just fit."""
    plan = work.plan
    if plan.asked_yield == 1.0:
        samples = random_corners(plan.draws, len(plan.sources), plan.seed)
        worst = [
            worst_corner(one, plan.sources, plan.spread(t), samples[:_CORNERS]).signs
            for ready in work.convex.values() for one in ready
        ]  # fmt: skip
        samples = np.vstack([samples, *worst]) if worst else samples
        allowed = 0
    else:
        samples = _standard(plan, _TRAINING, plan.draws)
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


def _prove(
    work: _Postures, answer: Allocation, progress: Callable[[str, int, int], None]
) -> Allocation:
    """The answer with proven bounds of the worst, over all postures."""
    plan, t = work.plan, answer.tolerances
    spread, worst, scale = plan.spread(t), {}, np.inf
    corners = random_corners(_CORNERS, len(spread), plan.seed + 1)
    total = sum(map(len, work.convex.values()))
    done = 0
    for key, ready in work.convex.items():
        lower, upper = 0.0, 0.0
        for one in ready:
            found = worst_corner(one, plan.sources, spread, corners).value
            bound = bound_energy if key == "energy" else bound_margin
            lower = max(lower, found)
            upper = max(upper, bound(one, plan.sources, spread))
            done += 1
            progress("proofs", done, total)
        worst[key] = lower, upper
        # tighter tolerances need that much less play, springs that much less again
        power = 0.5 if key == "energy" else 1.0
        scale = min(scale, (plan.limits[key] / max(upper, 1e-300)) ** power)
    covered = set(plan.limits) <= set(worst)
    proven = min(1.0, scale) if covered else float("nan")
    return replace(answer, worst=worst, proven_scale=proven)


def _verify(
    work: _Postures, t: NDArray, fresh: int,
    progress: Callable[[str, int, int], None],
) -> dict[str, Any]:  # fmt: skip
    """Yield of fresh draws: of each posture, and of all postures together."""
    plan = work.plan
    values = _standard(plan, _FRESH, fresh) * plan.spread(t)
    worst, each = np.zeros(fresh), []
    for i, posture in enumerate(work.postures):
        shares = _Postures([posture], plan).shares(values)
        worst = np.maximum(worst, shares)
        each.append(int((shares <= 1.0 + 1e-9).sum()) / fresh)
        progress("verification", i + 1, len(work.postures))
    good = int((worst <= 1.0 + 1e-9).sum())
    found = proportion(good, fresh)
    return {
        "draws": fresh, "yield": found, "worst_posture_yield": min(each),
        "posture_yields": each, "verdict": _verdict(found, plan.asked_yield),
        "largest_share_of_a_limit": float(worst.max()),
    }  # fmt: skip


def _verdict(found: Mapping[str, float], asked: float) -> str:
    """What an interval says of the yield asked for."""
    if asked == 1.0:
        return "no draw failed" if found["probability"] == 1.0 else "contradicted"
    if found["lower"] >= asked:
        return "shown"
    return "not contradicted" if found["upper"] >= asked else "contradicted"
