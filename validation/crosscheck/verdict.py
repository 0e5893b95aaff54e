"""Verdicts of comparisons: what must hold, and scales enough to tell whether it does.

At large errors and few scales a limit is not known to its bound: what looks wrong may
be of higher order, and what is wrong may hide behind it.  Then smaller scales are
added, each half of the last, until every check is decided: a wrong term of first order
stays, all others fade.  Nothing fails on fewer than four scales.

Where a quantity does not stand out of the noise of either model (a robot without errors
and load) nothing was compared: such a check does not hold, it has not run.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.posture import Posture
from forcefit.inputs.table import BadInput
from validation.crosscheck.pair import Pair

SCALES = (1.0, 0.5, 0.25, 0.125)
NO_SIGNAL = "not checked, nothing to compare"
_FEWEST, _MOST = 4, 6  # scales on which a check may fail; at which none is added


@dataclass(frozen=True)
class Check:
    """Something that must not exceed a bound.

    Attributes:
        value: best estimate, >= 0.
        bound: on it.
        unsure: what the value is not known to.
        signal: whether what is compared stands out of the noise.
    """

    value: float
    bound: float
    unsure: float = 0.0
    signal: bool = True

    @property
    def verdict(self) -> str:
        """Whether it holds.

        ``"ok"``; ``"fails"``; ``"undecided"`` if it is not known well enough; ``"no
        signal"`` if there is nothing that it could be about.
        """
        if self.value - self.unsure > self.bound:
            return "fails"
        if not self.signal and not max(self.value, self.unsure) > self.bound:
            return "no signal"
        # a value that is not a number is not known
        known = self.value <= self.bound and self.unsure <= self.bound
        return "ok" if known else "undecided"


class Comparison(Protocol):
    """Two models at several scales, and what was concluded."""

    @property
    def posture(self) -> Posture:
        """Where the robot stands."""

    @property
    def load(self) -> NDArray:
        """(6,) [N m, N] on the platform at scale 1."""

    @property
    def gravity(self) -> NDArray:
        """(3,) [m/s^2] at scale 1."""

    @property
    def links(self) -> str:
        """How the simulation modelled links."""

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """One for each scale, largest first."""

    @property
    def asked(self) -> int:
        """How many of the scales were asked for; the others were added."""

    @property
    def checks(self) -> dict[str, Check]:
        """What must hold, by name."""

    def header(self) -> list[str]:
        """Names of columns."""

    def rows(self) -> list[list[str]]:
        """Cells, one row for each scale."""


Answer = TypeVar("Answer", bound=Comparison)


def verdict(answer: Comparison) -> str:
    """What was found on the scales there are.

    Args:
        answer: of a comparison.

    Returns:
        ``"passed"``, ``"failed"``, ``"not decided"``, or ``"no signal"`` where no check
        had anything to compare.
    """
    found = {check.verdict for check in answer.checks.values()}
    if "fails" in found and len(answer.pairs) >= _FEWEST:
        return "failed"
    if found & {"fails", "undecided"}:
        return "not decided"
    return "passed" if "ok" in found else "no signal"


def compare_scales(
    scales: Sequence[float],
    solve: Callable[[float], Pair],
    judge: Callable[[tuple[Pair, ...], int], Answer],
) -> Answer:
    """Solve at several scales, and at smaller ones until the verdict is decided.

    Args:
        scales: factors on all imperfections, at least two different ones.
        solve: both models at a scale.
        judge: makes an answer of pairs, largest scale first, and the number of those
            asked for.

    Returns:
        The answer, decided or on six scales at least.

    Raises:
        BadInput: fewer than two scales, or one that is not finite and > 0.
    """
    factors = check_scales(scales)
    pairs = [solve(scale) for scale in factors]
    while True:
        answer = judge(tuple(pairs), len(factors))
        if verdict(answer) != "not decided" or len(pairs) >= _MOST:
            return answer
        pairs.append(solve(pairs[-1].scale / 2))


def check_scales(scales: Sequence[float]) -> list[float]:
    """Scales from which a slope can be read, largest first.

    Args:
        scales: factors on errors, clearances and load.

    Returns:
        Those that differ, sorted.

    Raises:
        BadInput: fewer than two, or one that is not finite and > 0.
    """
    factors = sorted({float(s) for s in scales}, reverse=True)
    if len(factors) < 2 or not all(0 < s < np.inf for s in factors):
        raise BadInput(
            f"scale: found {list(scales)}, expected at least two different factors > 0"
        )
    return factors


def comparison_table(answer: Comparison, more: Mapping[str, Any]) -> dict[str, Any]:
    """A comparison as plain values, keys of the public format.

    Args:
        answer: what was found.
        more: what is its kind's own.

    Returns:
        ``scales`` holds those asked for, ``added_scales`` the others.
    """
    robot = answer.posture.robot
    tables = [pair.table(robot) for pair in answer.pairs]
    found = verdict(answer)
    return {
        "robot": robot.name,
        "status": "ok",
        "pose": answer.posture.pose(),
        "load": answer.load,
        "gravity": answer.gravity,
        "links": answer.links,
        "scales": tables[: answer.asked],
        "added_scales": tables[answer.asked :],
        **more,
        "checks": {
            name: {
                "value": check.value,
                "tolerance": check.bound,
                "uncertainty": check.unsure,
                "verdict": check.verdict,
                "passed": check.verdict == "ok",
            }
            for name, check in answer.checks.items()
        },
        "verdict": found,
        "passed": found == "passed",
    }


def comparison_text(lines: list[str], answer: Comparison) -> str:
    """A comparison for people.

    Args:
        lines: to begin with.
        answer: what was found.

    Returns:
        These lines, the table, every check and the verdict, without colours.
    """
    table = [answer.header(), *answer.rows()]
    lines = lines + ["  ".join(f"{cell:>26}" for cell in row) for row in table]
    words = {"ok": "ok", "fails": "FAILS", "undecided": "NOT DECIDED"}
    for name, check in answer.checks.items():
        said = f"{check.value:.1e} (bound {check.bound:g})"
        word = words.get(check.verdict)
        lines.append(f"{name}: {NO_SIGNAL if word is None else f'{said} {word}'}")
    added = len(answer.pairs) - answer.asked
    if added:
        lines.append(f"scales added to tell: {added}")
    return "\n".join([*lines, verdict_text(answer)])


def verdict_text(answer: Comparison) -> str:
    """The verdict in a few words; what it does not rest on is counted."""
    ends = {
        "passed": "passed",
        "failed": "FAILED",
        "not decided": "NOT DECIDED: the errors are too large for these scales; ask "
        "for smaller ones",
        "no signal": "NOT CHECKED: nothing stands out of the noise; a robot without "
        "errors and load compares zero with zero",
    }
    found = verdict(answer)
    idle = sum(check.verdict == "no signal" for check in answer.checks.values())
    if found == "passed" and idle:
        return f"passed; {idle} of {len(answer.checks)} checks had nothing to compare"
    return ends[found]
