"""The loosest tolerances with which a robot still goes together, for the least cost.

Tolerances t_g, one for each class of errors, cost ``c_g / t_g`` (or ``-c_g log t_g``).
Margin and energy are convex limits: :mod:`assembly.statistics.cutting_planes` finds
the least cost and proves it where none may fail.  A yield, and limits of wrenches,
stress and pose errors, are not: :mod:`assembly.statistics.least_cost` goes on from
there to a least cost nearby.  Last, all tolerances are scaled alike until draws that
shaped nothing, or the worst corners, just meet every limit, and fresh ones verify them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.posture import Posture
from assembly.statistics.cutting_planes import cut_planes
from assembly.statistics.least_cost import least_cost
from assembly.statistics.replay import Replay
from assembly.statistics.requirement import SCALING, TRAINING, Plan, Requirement
from assembly.statistics.scaling import draw_samples, fit, with_worst_corners
from assembly.statistics.verification import prove_worst, verify
from forcefit.inputs.display import html_table, short_repr

if TYPE_CHECKING:
    import xarray


_MORE_TO_SCALE = 4  # times the draws that shape the tolerances: one number costs little


@dataclass(frozen=True, eq=False)
class Allocation:
    """Tolerances, what they cost, and what is known of them.

    Attributes:
        plan: what was asked.
        tolerances: (G,) [rad or m].
        price: their cost.
        alike: (G,) [rad or m] those whose proportions the convex limits (or, without
            any, the energy) decide, scaled alike to meet all limits.
        price_alike: their cost; no less than ``price``.
        price_bound: no tolerances that always meet the convex limits cost less; NaN
            for a yield below 1, or where a limit is not convex.
        cuts: planes in the convex programme.
        worst: by limit and for yield 1: the worst corner found and the proven upper
            bound, over all postures; NaN where nothing is proven.
        proven_scale: factor on the tolerances at which the proof meets the limits too;
            1 or less, NaN where nothing is proven.
        verification: of fresh draws: yields with their intervals.
    """

    plan: Plan
    tolerances: NDArray
    price: float
    alike: NDArray
    price_alike: float
    price_bound: float
    cuts: int
    worst: dict[str, tuple[float, float]] = field(default_factory=dict)
    proven_scale: float = float("nan")
    verification: dict[str, Any] = field(default_factory=dict)

    __repr__, _repr_html_ = short_repr, html_table

    def to_xarray(self) -> "xarray.Dataset":
        """Tolerances over ``class``, as ``--output`` writes them."""
        from assembly.statistics.tolerances import tolerance_dataset

        return tolerance_dataset(self)


def allocate(
    postures: Sequence[Posture],
    plan: Plan,
    fresh: int = 2000,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
    replay: Replay | None = None,
) -> Allocation:
    """Find the cheapest tolerances that meet a plan over postures, and verify them.

    Args:
        postures: of one robot, the workspace.
        plan: what is asked.
        fresh: draws, none of which was used before, to verify with; 0 for none.
        progress: called with what is done, how far, and of how much.
        replay: keeps what is computed, to go on from after a kill.

    Returns:
        The tolerances.

    Raises:
        BadInput: an error is taken up by nothing, or perfect parts or even the
            tightest tolerances violate a limit.
    """
    replay = replay or Replay()
    work = Requirement(postures, plan, replay)
    work.check_perfect_parts()
    driver = work
    if not work.convex:
        # nothing convex is limited: the energy gives a shape to start from
        typical = _typical_energy(work)
        driver = Requirement(
            postures, replace(plan, limits={"energy": typical}), replay
        )
    driver.check_taken_up()
    shape, bound, cuts = cut_planes(driver, progress)
    t, alike = _fit_all(work, shape, progress)
    check: dict[str, Any] = {}
    if fresh:
        t, check = verify(work, t, fresh, progress)
    answer = Allocation(
        plan, t, plan.price(t), alike, plan.price(alike),
        bound if work.is_convex else np.nan, cuts, verification=check,
    )  # fmt: skip
    if plan.asked_yield == 1.0:
        worst, proven = prove_worst(work, t, progress)
        answer = replace(answer, worst=worst, proven_scale=proven)
    return answer


def _fit_all(
    work: Requirement, shape: NDArray, progress: Callable[[str, int, int], None]
) -> tuple[NDArray, NDArray]:
    """The cheapest tolerances found, and the shape scaled alike."""
    samples = draw_samples(work, TRAINING)
    if work.is_convex:
        alike = fit(work, with_worst_corners(work, samples, shape), shape)
        return alike, alike
    t, samples = least_cost(work, samples, shape, progress)
    if work.plan.asked_yield == 1.0:
        for one in (shape, t):
            samples = with_worst_corners(work, samples, fit(work, samples, one))
    else:
        samples = draw_samples(work, SCALING, _MORE_TO_SCALE)
    t, alike = fit(work, samples, t), fit(work, samples, shape)
    return min((t, alike), key=work.plan.price), alike


def _typical_energy(work: Requirement) -> float:
    """[J] of half the draws at the loosest tolerances, at the first posture."""
    plan = work.plan
    values = plan.draws_of(TRAINING, 200) * plan.spread(plan.most)
    rows = work.experiments[0].answer(values, range(len(values)))
    return max(float(np.median(rows["energy"])), 1e-12)
