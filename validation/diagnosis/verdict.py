"""From probabilities to a verdict, and how often it is right on a campaign's design."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from validation.diagnosis.lack_of_fit import SIGNIFICANT
from validation.diagnosis.scoring import (
    FINITE,
    Scored,
    Screen,
    inclusion,
    named,
    posterior,
)

NOT_ENOUGH = "not_enough_rows"
CLAIM = 0.9  # probability from which an effect is claimed
RIVAL = 0.5  # probability from which another one stands against it
_LISTED = 0.02  # probability from which an alternative is listed

Sets = tuple[tuple[tuple[str, ...], float], ...]


def by_names(screen: Screen, sets: Sequence[Scored]) -> Sets:
    """Probabilities of sets of effects, whatever their way to act.

    Args:
        screen: whose sets.
        sets: scored.

    Returns:
        Names and probabilities, likeliest first.
    """
    weights: dict[tuple[str, ...], float] = {}
    for one, weight in zip(sets, posterior(sets), strict=True):
        names = named(screen, one)
        weights[names] = weights.get(names, 0.0) + float(weight)
    listed = sorted(weights.items(), key=lambda item: -item[1])
    return tuple((names, p) for names, p in listed if p >= _LISTED)


def linear_or_finite(
    sets: Sets, probability: dict[str, float], gain: float
) -> tuple[Sets, dict[str, float]]:
    """No effect beside the declared model: is that linear, or are motions finite?

    Scored models carry what the declared errors do to second order, so that no other
    effect is blamed for it.  Where they need nothing else, what that second order
    explains speaks for ``geometric_stiffening``.

    Args:
        sets: of effects, with their probabilities, likeliest first.
        probability: of every effect.
        gain: [-] squared whitened residual of the linear model, minus that with the
            second order.

    Returns:
        The same with the weight of no effect at all shared between both.
    """
    odds = math.exp(min(gain / 2, 500.0)) / max(len(probability), 1)
    part = odds / (1 + odds)
    weights = dict(sets)
    nothing = weights.pop((), 0.0)
    moved = {(): nothing * (1 - part), (FINITE,): nothing * part}
    for names, weight in moved.items():
        weights[names] = weights.get(names, 0.0) + weight
    listed = sorted(weights.items(), key=lambda item: -item[1])
    known = probability.get(FINITE, 0.0) + nothing * part
    return (
        tuple((names, p) for names, p in listed if p >= _LISTED),
        probability | {FINITE: known},
    )


def verdict(
    sets: Sets, probability: dict[str, float], more_than_noise: bool,
    *, small: bool = False,
) -> tuple[str, tuple[str, ...]]:  # fmt: skip
    """The verdict, and which effects it claims.

    Args:
        sets: of effects, with their probabilities, likeliest first.
        probability: of every effect.
        more_than_noise: whether the best set leaves more than noise.
        small: whether geometric errors or springs are found beside any set.

    Returns:
        ``"none_needed"``, ``"explained"``, ``"ambiguous"`` or ``"outside_library"``,
        and the names claimed.
    """
    if more_than_noise:
        return "outside_library", ()
    names, weight = sets[0]
    if not names and weight >= RIVAL:
        return "explained" if small else "none_needed", ()
    sure = tuple(sorted(name for name, p in probability.items() if p >= CLAIM))
    rivals = [name for name, p in probability.items() if RIVAL <= p < CLAIM]
    if sure and not rivals and dict(sets).get(sure, 0.0) >= RIVAL:
        return "explained", sure
    return "ambiguous", ()


@dataclass(frozen=True)
class Calibration:
    """How often the method is right on a campaign's own design, by simulation.

    Attributes:
        campaigns: simulated, of each kind.
        without: verdicts where nothing but noise was there.
        with_found: verdicts where the effects found were there at their fitted sizes.
        right: share of the latter that named exactly these effects.
        false_claims: share of all that named effects that were not there.
    """

    campaigns: int
    without: dict[str, int]
    with_found: dict[str, int]
    right: float
    false_claims: float


def calibrate(
    screen: Screen, best: Scored, count: int, update: Callable[[int, int], None]
) -> Calibration:
    """Simulate campaigns on a design and diagnose them.

    To first order about the declared model: signatures, noise and scoring are the
    diagnosis's, refits in the full model are left out.

    Args:
        screen: of the diagnosis.
        best: its best set.
        count: campaigns of each kind.
        update: told how many of all are done.

    Returns:
        The tally.
    """
    rng = np.random.default_rng(0)
    signal = screen.shown(best)
    truth = named(screen, best)
    tally: dict[bool, Counter[str]] = {False: Counter(), True: Counter()}
    right = wrong = 0
    for k in range(2 * count):
        present = k % 2 == 1
        noise = rng.standard_normal(screen.count)
        trial = screen.with_residual(signal + noise if present else noise)
        sets = trial.search()
        freedom = screen.count - sets[0].rank
        more = float(chi2.sf(sets[0].rss, freedom)) < SIGNIFICANT
        decision, claimed = verdict(by_names(trial, sets), inclusion(trial, sets), more)
        tally[present][decision] += 1
        expected = truth if present else ()
        right += present and decision == "explained" and claimed == truth
        wrong += decision == "explained" and claimed != expected
        update(k + 1, 2 * count)
    return Calibration(
        count, dict(tally[False]), dict(tally[True]),
        right / count if truth else float("nan"), wrong / (2 * count),
    )  # fmt: skip
