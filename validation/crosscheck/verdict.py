"""Decide whether two models agree, adding scales until every check is decided.

With large errors and few scales, terms of higher order can imitate or cancel a
first-order error. A check may then be undecided.  Smaller scales are then added, each
half of the previous one.  A check can fail only if at least four scales were solved.

A quantity below the noise of a model is not compared, for example if the robot has
neither errors nor loads.  Such a check has no signal and has not passed.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from forcefit.assembly.model.statuses import (
    FAILED,
    FAILS,
    NO_SIGNAL,
    NOT_DECIDED,
    OK,
    PASSED,
    UNDECIDED,
)
from forcefit.inputs.table import BadInput
from forcefit.validation.crosscheck.pair import Pair

SCALES = (1.0, 0.5, 0.25, 0.125)
NOT_CHECKED = "not checked, nothing to compare"
# Smallest number of scales at which a check can fail, and largest number of scales.
_FEWEST, _MOST = 4, 6


@dataclass(frozen=True)
class Check:
    """Comparison of a value with its bound.

    Attributes:
        value: best estimate of the value, >= 0.
        bound: bound on the value.
        uncertainty: uncertainty of the value.
        signal: whether the compared quantities exceed the noise.
    """

    value: float
    bound: float
    uncertainty: float = 0.0
    signal: bool = True

    @property
    def verdict(self) -> str:
        """Outcome of the check.

        The outcome is ``"ok"``, ``"fails"``, ``"undecided"`` if the uncertainty is too
        large, or ``"no signal"`` if the compared quantities are below the noise.
        """
        if self.value - self.uncertainty > self.bound:
            return FAILS
        if not self.signal and not max(self.value, self.uncertainty) > self.bound:
            return NO_SIGNAL
        # Comparisons with NaN are false, so NaN is undecided.
        known = self.value <= self.bound and self.uncertainty <= self.bound
        return OK if known else UNDECIDED


class Judged(Protocol):
    """Protocol of a comparison with checks."""

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """Pair of solutions at each scale, largest scale first."""

    @property
    def checks(self) -> Mapping[str, Check]:
        """Checks of the comparison, by name."""


Comparison = TypeVar("Comparison", bound=Judged)


def verdict(comparison: Judged) -> str:
    """Return the outcome of all checks at the solved scales.

    Args:
        comparison: comparison with its checks.

    Returns:
        ``"passed"``, ``"failed"`` or ``"not decided"``; ``"no signal"`` if no check has
        a signal.
    """
    outcomes = {check.verdict for check in comparison.checks.values()}
    if FAILS in outcomes and len(comparison.pairs) >= _FEWEST:
        return FAILED
    if outcomes & {FAILS, UNDECIDED}:
        return NOT_DECIDED
    return PASSED if OK in outcomes else NO_SIGNAL


def compare_scales(
    scales: Sequence[float],
    solve: Callable[[float], Pair],
    judge: Callable[[tuple[Pair, ...], int], Comparison],
) -> Comparison:
    """Solve both models at several scales, adding scales until the verdict is decided.

    Args:
        scales: at least two different factors on all imperfections.
        solve: function that solves both models at a scale.
        judge: function that returns a comparison for the pairs of solutions, largest
            scale first, and the number of requested scales.

    Returns:
        The comparison.  It is undecided only if at least six scales were solved.

    Raises:
        BadInput: fewer than two scales are given, or a scale is not finite and > 0.
    """
    factors = check_scales(scales)
    pairs = [solve(scale) for scale in factors]
    while True:
        comparison = judge(tuple(pairs), len(factors))
        if verdict(comparison) != NOT_DECIDED or len(pairs) >= _MOST:
            return comparison
        pairs.append(solve(pairs[-1].scale / 2))


def check_scales(scales: Sequence[float]) -> list[float]:
    """Check the scales and return them in descending order.

    Args:
        scales: factors on errors, clearances and load.

    Returns:
        The different scales, largest first.

    Raises:
        BadInput: fewer than two scales are given, or a scale is not finite and > 0.
    """
    factors = sorted({float(s) for s in scales}, reverse=True)
    if len(factors) < 2 or not all(0 < s < np.inf for s in factors):
        raise BadInput(
            f"scale: found {list(scales)}, expected at least two different factors > 0"
        )
    return factors


def verdict_text(comparison: Judged) -> str:
    """Format the verdict, with the number of checks without a signal."""
    texts = {
        PASSED: "passed",
        FAILED: "FAILED",
        NOT_DECIDED: "NOT DECIDED: the errors are too large at these scales; use "
        "smaller scales",
        NO_SIGNAL: "NOT CHECKED: no difference exceeds the noise, for example because "
        "the robot has neither errors nor load",
    }
    outcome = verdict(comparison)
    silent = sum(check.verdict == NO_SIGNAL for check in comparison.checks.values())
    if outcome == PASSED and silent:
        count = len(comparison.checks)
        return f"passed; {silent} of {count} checks had no signal above the noise"
    return texts[outcome]
