"""Uniform scaling of tolerances so that error samples satisfy all limits."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.statistics.estimates import proportion
from forcefit.assembly.statistics.requirement import Requirement
from forcefit.assembly.statistics.worst_case import CORNERS, random_corners
from forcefit.inputs.table import BadInput

_FINE = 1e-4  # relative precision of the largest value divided by its limit
_MOST_TRIALS = 80


@dataclass(frozen=True, eq=False)
class Samples:
    """Error samples that must satisfy every limit at every posture.

    Attributes:
        values: (k, m) errors divided by their tolerances.
        allowed: number of samples that may violate a limit.
    """

    values: NDArray
    allowed: int


def draw_samples(requirement: Requirement, stream: int, times: int = 1) -> Samples:
    """Return random errors or, for a yield of 1, corners of the tolerance box.

    Args:
        requirement: requirement at all postures.
        stream: random number stream.
        times: factor on the number of draws in the plan.

    Returns:
        The samples. If no more than the allowed number violates a limit, the required
        yield is demonstrated with 95 % confidence.

    Raises:
        BadInput: there are too few draws to demonstrate the yield.
    """
    plan = requirement.plan
    if plan.asked_yield == 1.0:
        corners = random_corners(plan.draws, len(plan.sources), plan.seed + stream)
        return Samples(corners, 0)
    draws = times * plan.draws
    allowed = _allowed_failures(draws, plan.asked_yield)
    return Samples(plan.draws_of(stream, draws), allowed)


def with_worst_corners(
    requirement: Requirement, samples: Samples, t: NDArray
) -> Samples:
    """Add the worst corner of the tolerance box for each limit and posture to samples.

    Args:
        requirement: requirement at all postures, with a yield of 1.
        samples: current corners.
        t: (G,) [rad or m] tolerances.

    Returns:
        The samples and all new worst corners.
    """
    corners = np.vstack([
        samples.values[: CORNERS // 2],
        samples.values[-CORNERS // 2 :],
    ])
    signs_of_cases = [
        requirement.worst_corner(key, i, t, corners).signs
        for key, i in requirement.cases
    ]
    new = [
        signs for signs in np.unique(signs_of_cases, axis=0)
        if not (samples.values == signs).all(axis=1).any()
    ]  # fmt: skip
    return Samples(np.vstack([samples.values, *new]), samples.allowed)


def scale_uniformly(
    requirement: Requirement, samples: Samples, t: NDArray, precision: float = _FINE
) -> NDArray:
    """Multiply tolerances by the largest factor with which samples satisfy the limits.

    Args:
        requirement: requirement at all postures.
        samples: samples of the errors.
        t: (G,) [rad or m] tolerances.
        precision: relative precision of the largest value divided by its limit, or of
            the factor.

    Returns:
        Scaled tolerances within their bounds, (G,) [rad or m].

    Raises:
        BadInput: the samples exceed the limits for all factors.
    """
    plan = requirement.plan
    low, high, factor, power = 0.0, np.inf, 1.0, 1.0
    previous = np.nan, np.nan
    for _ in range(_MOST_TRIALS):
        trial = np.clip(factor * t, plan.least, plan.most)
        utilisations = requirement.utilisations(samples.values * plan.spread(trial))[
            1
        ].max(axis=0)
        # The samples that may violate a limit are excluded.
        utilisation = float(
            np.partition(utilisations, -1 - samples.allowed)[-1 - samples.allowed]
        )
        fits = utilisation <= 1.0 + 1e-9
        low, high = (factor, high) if fits else (low, factor)
        if fits and (utilisation >= 1 - precision or (trial >= plan.most).all()):
            return trial
        if low > 0 and high <= low * (1 + precision):
            break
        if low == 0 and high < 1e-9:
            raise BadInput(
                "tolerances: even a robot without geometric errors exceeds a limit; "
                "increase the limit or reduce the clearances"
            )
        if (
            0 < utilisation < np.inf
            and 0 < previous[1] < np.inf
            and factor != previous[0]
        ):
            steep = np.log(utilisation / previous[1]) / np.log(factor / previous[0])
            power = float(np.clip(steep, 0.3, 10.0))
        previous = factor, utilisation
        # Extrapolate by a power law of the utilisation, or bisect.
        factor = _next_factor(low, high, factor, utilisation, power, precision)
    return np.clip(low * t, plan.least, plan.most)


def _next_factor(
    low: float, high: float, factor: float, utilisation: float, power: float,
    precision: float,
) -> float:  # fmt: skip
    """Return the next trial value of a common factor on all tolerances."""
    if 0 < utilisation < np.inf:
        guess = factor * ((1 - precision / 2) / utilisation) ** (1 / power)
        if low * (1 + precision / 4) < guess < high * (1 - precision / 4):
            return max(guess, 0.02 * factor) if low == 0 else min(guess, 50 * factor)
    if low == 0:
        return high / 2
    return 2 * low if high == np.inf else float(np.sqrt(low * high))


def _allowed_failures(draws: int, asked: float) -> int:
    """Return the largest number of failed draws with which a yield is demonstrated."""
    # The lower bound on the yield decreases with the number of failures.
    low, high = -1, draws
    while high - low > 1:
        middle = (low + high) // 2
        held = proportion(draws - middle, draws, 0.90)["lower"] >= asked
        low, high = (middle, high) if held else (low, middle)
    if low < 0:
        raise BadInput(
            f"tolerances: {draws} draws are too few to demonstrate a yield of "
            f"{asked:g}, even if none of them fails; use more draws"
        )
    return low
