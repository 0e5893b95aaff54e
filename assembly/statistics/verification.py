"""What is known of tolerances once they are found: proofs, and fresh draws."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.statistics.estimates import bracketed
from assembly.statistics.requirement import FRESH, Requirement
from assembly.statistics.scaling import Samples, fit
from assembly.statistics.worst_case import (
    CORNERS,
    bound_energy,
    bound_margin,
    random_corners,
)

_CHUNK = 256  # draws between two reports
_ROUNDING = 1e-9  # of a limit
LOOKS, CONFIDENCE = 4, 0.95  # at most; of all looks together


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
        for i, one in enumerate(ready):
            lower = max(lower, work.worst_corner(key, i, t, corners).value)
            if key in work.convex:
                prove = partial(_proof, bound, one, plan.sources, spread)
                (proven,) = work.replay.recall(prove, spread, key, i)
                upper = max(upper, float(proven))
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


def _proof(bound: Callable, *given: Any) -> tuple[float]:
    """An upper bound of the worst at one posture."""
    return (bound(*given),)


def verify(
    work: Requirement, t: NDArray, fresh: int, progress: Callable[[str, int, int], None]
) -> tuple[NDArray, dict[str, Any]]:
    """Verify tolerances by fresh draws; tighten those that are contradicted.

    Each look takes draws of its own, and all looks together are wrong no more often
    than the confidence says: the error's probability is split over them (Bonferroni).

    Args:
        work: what is required.
        t: (G,) [rad or m] tolerances.
        fresh: draws of each look, used for nothing else.
        progress: called with what is done, how far, and of how much.

    Returns:
        (G,) [rad or m] tolerances, and what the last look said of them.
    """
    asked = work.plan.asked_yield
    for look in range(LOOKS):
        level = 1.0 - (1.0 - CONFIDENCE) / LOOKS
        check = verify_yield(work, t, fresh, progress, FRESH + look, level)
        check |= {
            "look": look + 1, "most_looks": LOOKS, "confidence": CONFIDENCE,
            "confidence_of_a_look": level,
        }  # fmt: skip
        if check["verdict"] != "contradicted" or look + 1 == LOOKS:
            break
        drawn = work.plan.draws_of(FRESH + look, fresh)
        t = fit(work, Samples(drawn, int((1.0 - asked) * fresh)), t)
    return t, check


def verify_yield(
    work: Requirement, t: NDArray, fresh: int,
    progress: Callable[[str, int, int], None], stream: int = FRESH,
    level: float = CONFIDENCE,
) -> dict[str, Any]:  # fmt: skip
    """Yield of fresh draws: of each posture, and of all postures together.

    Args:
        work: what is required.
        t: (G,) [rad or m] tolerances.
        fresh: draws, used for nothing else.
        progress: called with what is done, how far, and of how much.
        stream: of random numbers.
        level: of confidence of the interval.

    Returns:
        Plain values: the yield with its interval, that of every posture, the verdict.
        A draw whose pose error is not decided counts as failed, and in the interval as
        either.
    """
    plan = work.plan
    values = plan.draws_of(stream, fresh) * plan.spread(t)
    least, most = np.zeros((2, len(work.postures), fresh))
    row = np.array([i for _, i in work.places])
    for first in range(0, fresh, _CHUNK):
        some = slice(first, first + _CHUNK)
        lower, upper = work.shares(values[some])
        np.maximum.at(least[:, some], row, lower)
        np.maximum.at(most[:, some], row, upper)
        progress("verification", min(first + _CHUNK, fresh), fresh)
    fits, fails = most <= 1.0 + _ROUNDING, least > 1.0 + _ROUNDING
    each = fits.mean(axis=1).tolist()
    good, bad = int(fits.all(axis=0).sum()), int(fails.any(axis=0).sum())
    found = bracketed(good, bad, fresh, level)
    return {
        "draws": fresh, "yield": found, "worst_posture_yield": min(each),
        "posture_yields": each, "verdict": _verdict(found, plan.asked_yield),
        "largest_share_of_a_limit": float(most.max()),
    }  # fmt: skip


def _verdict(found: Mapping[str, float], asked: float) -> str:
    """What an interval says of the yield asked for."""
    if asked == 1.0:
        return "no draw failed" if found["probability"] == 1.0 else "contradicted"
    if found["lower"] >= asked:
        return "shown"
    return "not contradicted" if found["upper"] >= asked else "contradicted"
