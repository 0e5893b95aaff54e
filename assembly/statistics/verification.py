"""Verification of tolerances by upper bounds and by new random draws."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.statistics.estimates import bracketed
from forcefit.assembly.statistics.requirement import FRESH, Requirement
from forcefit.assembly.statistics.scaling import Samples, scale_uniformly
from forcefit.assembly.statistics.worst_case import (
    CORNERS,
    bound_energy,
    bound_margin,
    random_corners,
)

_BATCH = 256  # number of draws between two calls of ``progress``
_ROUNDING = 1e-9  # relative tolerance for the comparison with a limit
# largest number of verifications, and their joint confidence level
LOOKS, CONFIDENCE = 4, 0.95


def prove_worst(
    requirement: Requirement, t: NDArray, progress: Callable[[str, int, int], None]
) -> tuple[dict[str, tuple[float, float]], float]:
    """Bound the limited quantities over all errors within tolerances and all postures.

    Args:
        requirement: requirement at all postures.
        t: (G,) [rad or m] tolerances.
        progress: function called with the name of a computation, the number of
            finished steps and the number of all steps.

    Returns:
        For each limit, the largest value found at corners of the tolerance box, and a
        proven upper bound (NaN if the quantity is not convex). Also the common factor
        <= 1 on all tolerances for which the upper bounds satisfy all limits (NaN if a
        quantity is not convex).
    """
    plan = requirement.plan
    spread, worst, scale = plan.spread(t), {}, np.inf
    corners = random_corners(CORNERS, len(spread), plan.seed + 1)
    total = sum(map(len, requirement.prepared.values()))
    done = 0
    for key, prepared in requirement.prepared.items():
        lower, upper = 0.0, 0.0
        bound = bound_energy if key == "energy" else bound_margin
        for i, posture in enumerate(prepared):
            lower = max(lower, requirement.worst_corner(key, i, t, corners).value)
            if key in requirement.convex:
                prove = partial(_proof, bound, posture, plan.sources, spread)
                (bound_there,) = requirement.replay.recall(prove, spread, key, i)
                upper = max(upper, float(bound_there))
            done += 1
            progress("proofs", done, total)
        worst[key] = lower, upper if key in requirement.convex else np.nan
        if key not in requirement.convex:
            scale = np.nan
            continue
        # If the tolerances decrease by a factor, the margin decreases by this factor.
        # The bound on the energy decreases at least by its square.
        power = 0.5 if key == "energy" else 1.0
        scale = np.minimum(scale, (plan.limits[key] / max(upper, 1e-300)) ** power)
    return worst, float(np.minimum(1.0, scale))


def _proof(bound: Callable, *given: Any) -> tuple[float]:
    """Return an upper bound on a limited quantity at one posture."""
    return (bound(*given),)


def verify(
    requirement: Requirement,
    t: NDArray,
    fresh: int,
    progress: Callable[[str, int, int], None],
) -> tuple[NDArray, dict[str, Any]]:
    """Verify tolerances with new random draws, and reduce them if the yield is too low.

    Each verification uses independent draws. The error probability is divided equally
    among all verifications (Bonferroni correction).

    Args:
        requirement: requirement at all postures.
        t: (G,) [rad or m] tolerances.
        fresh: number of draws per verification.
        progress: function called with the name of a computation, the number of
            finished steps and the number of all steps.

    Returns:
        Tolerances, (G,) [rad or m], and the results of the last verification.
    """
    asked = requirement.plan.asked_yield
    for look in range(LOOKS):
        level = 1.0 - (1.0 - CONFIDENCE) / LOOKS
        verification = verify_yield(
            requirement, t, fresh, progress, FRESH + look, level
        )
        verification |= {
            "look": look + 1, "most_looks": LOOKS, "confidence": CONFIDENCE,
            "confidence_of_a_look": level,
        }  # fmt: skip
        if verification["verdict"] != "contradicted" or look + 1 == LOOKS:
            break
        values = requirement.plan.draws_of(FRESH + look, fresh)
        t = scale_uniformly(requirement, Samples(values, int((1.0 - asked) * fresh)), t)
    return t, verification


def verify_yield(
    requirement: Requirement, t: NDArray, fresh: int,
    progress: Callable[[str, int, int], None], stream: int = FRESH,
    level: float = CONFIDENCE,
) -> dict[str, Any]:  # fmt: skip
    """Estimate the yield of tolerances from new random draws.

    Args:
        requirement: requirement at all postures.
        t: (G,) [rad or m] tolerances.
        fresh: number of draws.
        progress: function called with the name of a computation, the number of
            finished steps and the number of all steps.
        stream: random number stream.
        level: confidence level of the interval.

    Returns:
        A dictionary with the yield and its confidence interval, the yield at each
        posture, and the verdict. If a limit is between the bounds on a pose error, the
        draw counts as a failure in the yield, and the interval includes both outcomes.
    """
    plan = requirement.plan
    values = plan.draws_of(stream, fresh) * plan.spread(t)
    least, most = np.zeros((2, len(requirement.postures), fresh))
    posture_of_case = np.array([i for _, i in requirement.cases])
    for first in range(0, fresh, _BATCH):
        some = slice(first, first + _BATCH)
        lower, upper = requirement.utilisations(values[some])
        np.maximum.at(least[:, some], posture_of_case, lower)
        np.maximum.at(most[:, some], posture_of_case, upper)
        progress("verification", min(first + _BATCH, fresh), fresh)
    fits, fails = most <= 1.0 + _ROUNDING, least > 1.0 + _ROUNDING
    each = fits.mean(axis=1).tolist()
    good, bad = int(fits.all(axis=0).sum()), int(fails.any(axis=0).sum())
    interval = bracketed(good, bad, fresh, level)
    return {
        "draws": fresh, "yield": interval, "worst_posture_yield": min(each),
        "posture_yields": each, "verdict": _verdict(interval, plan.asked_yield),
        "largest_share_of_a_limit": float(most.max()),
    }  # fmt: skip


def _verdict(interval: Mapping[str, float], asked: float) -> str:
    """Return whether the draws show, contradict or do not contradict the yield."""
    if asked == 1.0:
        return "no draw failed" if interval["probability"] == 1.0 else "contradicted"
    if interval["lower"] >= asked:
        return "shown"
    return "not contradicted" if interval["upper"] >= asked else "contradicted"
