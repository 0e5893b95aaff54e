"""How far tolerances can all be loosened alike until samples of the errors just fit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.statistics.estimates import proportion
from assembly.statistics.requirement import Requirement
from assembly.statistics.worst_case import CORNERS, random_corners
from forcefit.inputs.table import BadInput

_FINE = 1e-4  # of the limits: how nearly the samples are to use them up
_MOST_TRIALS = 80


@dataclass(frozen=True, eq=False)
class Samples:
    """Errors that must meet every limit at every posture, but for a few.

    Attributes:
        values: (k, m) within tolerances of 1.
        allowed: how many may fail.
    """

    values: NDArray
    allowed: int


def draw_samples(work: Requirement, stream: int, times: int = 1) -> Samples:
    """Fixed draws, or corners of the tolerances if none may ever fail.

    Args:
        work: what is required.
        stream: of random numbers.
        times: so many times the plan's draws.

    Returns:
        The samples; so many may fail that the yield asked for is held with 95 %.

    Raises:
        BadInput: too few draws to show that yield.
    """
    plan = work.plan
    if plan.asked_yield == 1.0:
        corners = random_corners(plan.draws, len(plan.sources), plan.seed + stream)
        return Samples(corners, 0)
    draws = times * plan.draws
    allowed = _allowed_failures(draws, plan.asked_yield)
    return Samples(plan.draws_of(stream, draws), allowed)


def with_worst_corners(work: Requirement, samples: Samples, t: NDArray) -> Samples:
    """The samples and the worst corners of tolerances, by limit and posture.

    Args:
        work: what is required; no failure is allowed.
        samples: corners so far.
        t: (G,) [rad or m] tolerances.

    Returns:
        With the corners that were not among them.
    """
    start = np.vstack([samples.values[: CORNERS // 2], samples.values[-CORNERS // 2 :]])
    found = [work.worst_corner(key, i, t, start).signs for key, i in work.places]
    new = [
        signs for signs in np.unique(found, axis=0)
        if not (samples.values == signs).all(axis=1).any()
    ]  # fmt: skip
    return Samples(np.vstack([samples.values, *new]), samples.allowed)


def fit(
    work: Requirement, samples: Samples, t: NDArray, precision: float = _FINE
) -> NDArray:
    """Tolerances scaled alike, within their bounds, until the samples just fit.

    Args:
        work: what is required.
        samples: of the errors.
        t: (G,) [rad or m] proportions.
        precision: relative, of the largest share of a limit, or of the factor.

    Returns:
        (G,) [rad or m]; all at their loosest if they fit there.

    Raises:
        BadInput: the samples fit at no scale.
    """
    plan = work.plan
    low, high, factor, power = 0.0, np.inf, 1.0, 1.0
    last = np.nan, np.nan
    for _ in range(_MOST_TRIALS):
        tried = np.clip(factor * t, plan.least, plan.most)
        shares = work.shares(samples.values * plan.spread(tried))[1].max(axis=0)
        # the largest share of all samples but those that may fail
        share = float(np.partition(shares, -1 - samples.allowed)[-1 - samples.allowed])
        fits = share <= 1.0 + 1e-9
        low, high = (factor, high) if fits else (low, factor)
        if fits and (share >= 1 - precision or (tried >= plan.most).all()):
            return tried
        if low > 0 and high <= low * (1 + precision):
            break
        if low == 0 and high < 1e-9:
            raise BadInput("tolerances: even perfect parts violate a limit")
        if 0 < share < np.inf and 0 < last[1] < np.inf and factor != last[0]:
            steep = np.log(share / last[1]) / np.log(factor / last[0])
            power = float(np.clip(steep, 0.3, 10.0))
        last = factor, share
        # as if the share were a power of the factor; else the middle
        factor = _next(low, high, factor, share, power, precision)
    return np.clip(low * t, plan.least, plan.most)


def _next(
    low: float, high: float, factor: float, share: float, power: float,
    precision: float,
) -> float:  # fmt: skip
    """The factor to try next."""
    if 0 < share < np.inf:
        guess = factor * ((1 - precision / 2) / share) ** (1 / power)
        if low * (1 + precision / 4) < guess < high * (1 - precision / 4):
            return max(guess, 0.02 * factor) if low == 0 else min(guess, 50 * factor)
    if low == 0:
        return high / 2
    return 2 * low if high == np.inf else float(np.sqrt(low * high))


def _allowed_failures(draws: int, asked: float) -> int:
    """Most failures with which a yield is held at 95 %, one-sided; at least none."""
    # proportion() falls as failures rise: the first that is too many, by bisection
    low, high = -1, draws
    while high - low > 1:
        middle = (low + high) // 2
        held = proportion(draws - middle, draws, 0.90)["lower"] >= asked
        low, high = (middle, high) if held else (low, middle)
    if low < 0:
        raise BadInput(
            f"tolerances: {draws} draws cannot show a yield of {asked:g} even if none "
            "fails; ask for more draws"
        )
    return low
