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

_CHUNK = 256  # draws between two reports


def prove_worst(
    work: Requirement, t: NDArray, progress: Callable[[str, int, int], None]
) -> tuple[dict[str, tuple[float, float]], float]:
    """Bounds of the worst that errors within tolerances do, over all postures.

    Args:
        work: what is required.
        t: (G,) [rad or m] tolerances.
        progress: called with what is done, how far, and of how much.

    Returns:
        By limit the worst corner found and the proven upper bound, NaN where the
        limit is not convex; and the factor on the tolerances, 1 or less, at which the
        proof meets all limits, NaN if some limit is not convex.
    """
    plan = work.plan
    spread, worst, scale = plan.spread(t), {}, np.inf
    corners = random_corners(CORNERS, len(spread), plan.seed + 1)
    total = sum(map(len, work.ready.values()))
    done = 0
    for key, ready in work.ready.items():
        lower, upper = 0.0, 0.0
        bound = bound_energy if key == "energy" else bound_margin
        for one in ready:
            found = worst_corner(one, plan.sources, spread, corners, key).value
            lower = max(lower, found)
            if key in work.convex:
                upper = max(upper, bound(one, plan.sources, spread))
            done += 1
            progress("proofs", done, total)
        worst[key] = lower, upper if key in work.convex else np.nan
        if key not in work.convex:
            scale = np.nan
            continue
        # tighter tolerances need that much less play, springs that much less again
        power = 0.5 if key == "energy" else 1.0
        scale = np.minimum(scale, (plan.limits[key] / max(upper, 1e-300)) ** power)
    return worst, float(np.minimum(1.0, scale))


def verify_yield(
    work: Requirement, t: NDArray, fresh: int,
    progress: Callable[[str, int, int], None], stream: int = FRESH,
) -> dict[str, Any]:  # fmt: skip
    """Yield of fresh draws: of each posture, and of all postures together.

    Args:
        work: what is required.
        t: (G,) [rad or m] tolerances.
        fresh: draws, used for nothing else.
        progress: called with what is done, how far, and of how much.
        stream: of random numbers.

    Returns:
        Plain values: the yield with its interval, that of every posture, the verdict.
    """
    plan = work.plan
    values = plan.draws_of(stream, fresh) * plan.spread(t)
    worst = np.zeros((len(work.postures), fresh))
    row = np.array([i for _, i in work.places])
    for first in range(0, fresh, _CHUNK):
        some = slice(first, first + _CHUNK)
        np.maximum.at(worst[:, some], row, work.shares(values[some]))
        progress("verification", min(first + _CHUNK, fresh), fresh)
    fits = worst <= 1.0 + 1e-9
    each = fits.mean(axis=1).tolist()
    worst = worst.max(axis=0)
    good = int(fits.all(axis=0).sum())
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
