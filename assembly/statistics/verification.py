"""What is known of tolerances once they are found: proofs, and fresh draws."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.statistics.estimates import proportion
from assembly.statistics.requirement import FRESH, Requirement
from assembly.statistics.worst_case import (
    CORNERS,
    bound_energy,
    bound_margin,
    random_corners,
    worst_corner,
)


def prove_worst(
    work: Requirement, t: NDArray, progress: Callable[[str, int, int], None]
) -> tuple[dict[str, tuple[float, float]], float]:
    """Bounds of the worst that errors within tolerances do, over all postures.

    Args:
        work: what is required.
        t: (G,) [rad or m] tolerances.
        progress: called with what is done, how far, and of how much.

    Returns:
        By convex limit the worst corner found and the proven upper bound; and the
        factor on the tolerances, 1 or less, at which the proof meets all limits, NaN
        if some limit is not convex.
    """
    plan = work.plan
    spread, worst, scale = plan.spread(t), {}, np.inf
    corners = random_corners(CORNERS, len(spread), plan.seed + 1)
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
    return worst, proven


def verify_yield(
    work: Requirement, t: NDArray, fresh: int,
    progress: Callable[[str, int, int], None],
) -> dict[str, Any]:  # fmt: skip
    """Yield of fresh draws: of each posture, and of all postures together.

    Args:
        work: what is required.
        t: (G,) [rad or m] tolerances.
        fresh: draws, used for nothing else.
        progress: called with what is done, how far, and of how much.

    Returns:
        Plain values: the yield with its interval, that of every posture, the verdict.
    """
    plan = work.plan
    values = plan.draws_of(FRESH, fresh) * plan.spread(t)
    worst, each = np.zeros(fresh), []
    for i, posture in enumerate(work.postures):
        shares = Requirement([posture], plan).shares(values)
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
