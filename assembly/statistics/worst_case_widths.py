"""Minimum-cost widths of callout zones for a yield of 1.

The worst pose error is the maximum of ``sum_g t_g s_g(n) + c(n)`` over all directions
n, where s_g are support functions of the zones and c that of the clearances. This
equation requires that no loop is over-constrained, or that bodies are elastic and
joints have no clearance. Tolerances t are therefore feasible if and only if ``sum_g
t_g s_g(n) <= limit - c(n)`` for all n. These inequalities are used as cutting planes,
see :mod:`forcefit.assembly.statistics.cutting_planes`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.statistics.allocated_tolerances import Allocation
from forcefit.assembly.statistics.callout_sources import CalloutSources, sources_of
from forcefit.assembly.statistics.cutting_planes import cheapest_within
from forcefit.assembly.statistics.error_sets import (
    ErrorSets,
    error_sets,
    zones_of_errors,
)
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.quantities import POSE_ERRORS, UNITS
from forcefit.assembly.statistics.replay import Replay
from forcefit.assembly.statistics.requirement import Plan, Requirement
from forcefit.assembly.statistics.verification import verify
from forcefit.assembly.statistics.worst_pose import farthest_screw
from forcefit.inputs.table import BadInput

_TOLERANCE = 1e-3  # accepted relative violation of limits before the final scaling
_MOST_STEPS = 200

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class _Case:
    """A limit at a posture, with the sets of all errors and clearances."""

    key: str
    sets: ErrorSets
    classes: tuple[int, ...]  # class index of each zone; -1 for a clearance
    where: str

    def scaled(self, shares: NDArray) -> ErrorSets:
        """Return the error sets for given tolerances."""
        factors = np.ones(self.sets.screws.shape[1])
        for columns, g in zip(self.sets.columns, self.classes, strict=True):
            factors[columns] = shares[g] if g >= 0 else 1.0
        return replace(self.sets, screws=self.sets.screws * factors)

    def worst(self, shares: NDArray) -> tuple[float, float, NDArray]:
        """Return the worst pose error found, an upper bound, and its direction."""
        half = 3 * POSE_ERRORS.index(self.key)
        (low, high), screw = farthest_screw(self.scaled(shares), half)
        direction = screw[half : half + 3]
        size = float(np.linalg.norm(direction))
        return low, high, direction / size if size else np.eye(3)[0]

    def supports(self, direction: NDArray, count: int) -> tuple[NDArray, float]:
        """Return the support functions of the classes, (G,), and of the clearances."""
        half = 3 * POSE_ERRORS.index(self.key)
        weights = direction @ self.sets.screws[half : half + 3]
        found = np.zeros(count + 1)
        for zone, columns, g in zip(
            self.sets.zones, self.sets.columns, self.classes, strict=True
        ):
            found[g] += zone.farthest_u(weights[columns])[1]
        return found[:-1], float(found[-1])


def allot_worst_case(
    postures: Sequence[Posture], plan: Plan, fresh: int, progress: Progress,
    replay: Replay | None = None,
) -> Allocation:  # fmt: skip
    """Find the minimum-cost tolerances with which every robot satisfies the limits.

    Args:
        postures: postures of one robot.
        plan: plan with callouts, limits on rotation or translation, and a yield of 1.
        fresh: number of new draws for the verification; 0 to skip it.
        progress: function called with the name of a computation, the number of
            finished steps and the number of all steps.
        replay: stored results of an interrupted computation.

    Returns:
        The tolerances, with the worst pose errors and a lower bound on the cost.

    Raises:
        BadInput: the worst pose error is not a maximum of support functions, or a limit
            is exceeded by clearances alone or with the tightest tolerances.
    """
    if plan.clearance != "worst":
        fault = f"found {plan.clearance} with callouts and a yield of 1"
        raise BadInput(f"--clearance: {fault}, expected worst")
    robot = plan.sources.robot
    if robot.fits:
        of_fits = sources_of(robot)
        assert isinstance(of_fits, CalloutSources)
        loose = of_fits.with_largest_clearances()
        postures = [replace(posture, robot=loose) for posture in postures]
    requirement = Requirement(postures, plan, replay or Replay())
    perfect_parts = requirement.perfect_parts()
    cases = [_case(p, plan, key) for p in postures for key in plan.limits]
    shares, planes = np.ones(len(plan.names)), list[NDArray]()
    for step in range(_MOST_STEPS):
        progress("cutting planes", step, _MOST_STEPS)
        violated = [plane for case in cases for plane in _plane(case, plan, shares)]
        if not violated:
            break
        planes += violated
        shares = cheapest_within(plan, planes, plan.least, plan.most) / plan.most
    progress("cutting planes", _MOST_STEPS, _MOST_STEPS)
    price_bound = plan.price(shares * plan.most)
    shares = shares * min(_factor(case, plan, shares) for case in cases)
    tolerances = shares * plan.most
    verification: dict[str, Any] = {}
    if fresh:
        tolerances, verification = verify(requirement, tolerances, fresh, progress)
    price = plan.price(tolerances)
    return Allocation(
        plan, tolerances, price, tolerances, price, price_bound, len(planes),
        _worst(cases, tolerances / plan.most), 1.0, verification, perfect_parts,
    )  # fmt: skip


def _case(posture: Posture, plan: Plan, key: str) -> _Case:
    """Return the data of a limit at a posture, with zones of the largest widths."""
    sources = plan.sources
    assert isinstance(sources, CalloutSources)
    sets = error_sets(linear_response(posture), sources)
    where = ", ".join(f"{k} = {v:.4g}" for k, v in posture.pose().items())
    if len(sets.rigid_rows) or (len(sets.spring_rows) and sets.clearances):
        kind = "rigid" if len(sets.rigid_rows) else "elastic with clearance"
        raise BadInput(
            f"yield: found 1 for an over-constrained robot that is {kind} "
            f"(at {where}), expected less than 1; use statistics --worst-case to "
            "compute its worst case"
        )
    firsts = np.cumsum([0, *(len(unit) for _, _, unit in zones_of_errors(sources))])
    own = [int(plan.group[first]) for first in firsts[:-1]]
    classes = (*own, *[-1] * (len(sets.zones) - len(own)))
    full = np.ones(sets.screws.shape[1])
    for columns, g in zip(sets.columns, classes, strict=True):
        full[columns] = plan.most[g] if g >= 0 else 1.0
    return _Case(key, replace(sets, screws=sets.screws * full), classes, where)


def _plane(case: _Case, plan: Plan, shares: NDArray) -> list[NDArray]:
    """Return the cutting plane ``a.t <= 1`` if the tolerances violate a limit."""
    limit = plan.limits[case.key]
    low, _, direction = case.worst(shares)
    if low <= limit * (1 + _TOLERANCE):
        return []
    supports, clearance = case.supports(direction, len(plan.names))
    if clearance >= limit:
        value = f"{clearance:.4g} {UNITS[case.key]} at {case.where}"
        raise BadInput(
            f"limit {case.key}: clearances alone cause {value}, expected "
            f"less than {limit:g} {UNITS[case.key]}"
        )
    return [supports / plan.most / (limit - clearance)]


def _factor(case: _Case, plan: Plan, shares: NDArray) -> float:
    """Return a factor on all tolerances with which a limit is satisfied."""
    # The worst pose error is a convex function of the factor, so linear interpolation
    # between zero and the tolerances gives an upper bound.
    limit, high = plan.limits[case.key], case.worst(shares)[1]
    if high <= limit:
        return 1.0
    alone = case.worst(shares * 0.0)[1]
    return max(0.0, (limit - alone) / (high - alone))


def _worst(cases: Sequence[_Case], shares: NDArray) -> dict[str, tuple[float, float]]:
    """Return the largest value found and the largest bound of each limited quantity."""
    found: dict[str, tuple[float, float]] = {}
    for case in cases:
        low, high, _ = case.worst(shares)
        before = found.get(case.key, (0.0, 0.0))
        found[case.key] = max(before[0], low), max(before[1], high)
    return found
