"""Tolerance allocation: minimum-cost tolerances that satisfy limits.

Each class g of errors has a tolerance t_g with the cost ``c_g / t_g`` or ``-c_g log
t_g``. The assembly margin and the elastic energy are convex in the tolerances. If no
other quantity is limited and the required yield is 1,
:mod:`forcefit.assembly.statistics.cutting_planes` finds the optimum and a lower bound
on the cost. Wrenches, stress and pose errors are not convex in the tolerances, and
neither is a yield below 1. For limits on them,
:mod:`forcefit.assembly.statistics.least_cost` starts from that solution and finds a
local minimum of the cost.

Finally, all tolerances are multiplied by a common factor. It is the largest factor
with which random draws (or, for a yield of 1, the worst corners of the tolerance box)
satisfy every limit. The result is verified with new random draws.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.statistics.allocated_tolerances import Allocation
from forcefit.assembly.statistics.callout_sources import CalloutSources
from forcefit.assembly.statistics.cutting_planes import cut_planes
from forcefit.assembly.statistics.least_cost import least_cost
from forcefit.assembly.statistics.replay import Replay
from forcefit.assembly.statistics.requirement import (
    SCALING,
    TRAINING,
    Plan,
    Requirement,
)
from forcefit.assembly.statistics.scaling import (
    draw_samples,
    scale_uniformly,
    with_worst_corners,
)
from forcefit.assembly.statistics.verification import prove_worst, verify
from forcefit.assembly.statistics.worst_case_widths import allot_worst_case

# ratio of the number of draws for the final factor to the number of training draws
_SCALING_DRAWS = 4


def allocate(
    postures: Sequence[Posture],
    plan: Plan,
    fresh: int = 2000,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
    replay: Replay | None = None,
) -> Allocation:
    """Find minimum-cost tolerances that satisfy the limits of a plan, and verify them.

    Args:
        postures: postures of one robot in its workspace.
        plan: costs and limits.
        fresh: number of independent draws for the verification; 0 to skip it.
        progress: function called with the name of a computation, the number of
            finished steps and the number of all steps.
        replay: stored results of an interrupted computation.

    Returns:
        The tolerances.

    Raises:
        BadInput: no clearance or spring can compensate an error, or a limit is exceeded
            even without errors or with the tightest tolerances.
    """
    replay = replay or Replay()
    if isinstance(plan.sources, CalloutSources) and plan.asked_yield == 1.0:
        return allot_worst_case(postures, plan, fresh, progress, replay)
    requirement = Requirement(postures, plan, replay)
    perfect_parts = requirement.perfect_parts()
    convex_requirement = requirement
    if not requirement.convex:
        # If no limited quantity is convex, start from the solution for a limit on the
        # energy.
        typical = _typical_energy(requirement)
        convex_requirement = Requirement(
            postures, replace(plan, limits={"energy": typical}), replay
        )
    convex_requirement.check_taken_up()
    proportions, price_bound, cuts = cut_planes(convex_requirement, progress)
    tolerances, uniformly_scaled = _scaled_tolerances(
        requirement, proportions, progress
    )
    verification: dict[str, Any] = {}
    if fresh:
        tolerances, verification = verify(requirement, tolerances, fresh, progress)
    allocation = Allocation(
        plan=plan,
        tolerances=tolerances,
        price=plan.price(tolerances),
        uniformly_scaled=uniformly_scaled,
        price_uniformly_scaled=plan.price(uniformly_scaled),
        price_bound=price_bound if requirement.is_convex else np.nan,
        cuts=cuts,
        verification=verification,
        perfect_parts=perfect_parts,
    )
    if plan.asked_yield == 1.0:
        worst_cases, proven_scale = prove_worst(requirement, tolerances, progress)
        allocation = replace(allocation, worst=worst_cases, proven_scale=proven_scale)
    return allocation


def _scaled_tolerances(
    requirement: Requirement,
    proportions: NDArray,
    progress: Callable[[str, int, int], None],
) -> tuple[NDArray, NDArray]:
    """Return the minimum-cost tolerances and the uniformly scaled tolerances."""
    samples = draw_samples(requirement, TRAINING)
    if requirement.is_convex:
        uniformly_scaled = scale_uniformly(
            requirement,
            with_worst_corners(requirement, samples, proportions),
            proportions,
        )
        return uniformly_scaled, uniformly_scaled
    tolerances, samples = least_cost(requirement, samples, proportions, progress)
    if requirement.plan.asked_yield == 1.0:
        for one in (proportions, tolerances):
            samples = with_worst_corners(
                requirement, samples, scale_uniformly(requirement, samples, one)
            )
    else:
        samples = draw_samples(requirement, SCALING, _SCALING_DRAWS)
    tolerances, uniformly_scaled = (
        scale_uniformly(requirement, samples, tolerances),
        scale_uniformly(requirement, samples, proportions),
    )
    return min(
        (tolerances, uniformly_scaled), key=requirement.plan.price
    ), uniformly_scaled


def _typical_energy(requirement: Requirement) -> float:
    """Return the median energy [J] at the first posture for the loosest tolerances."""
    plan = requirement.plan
    values = plan.draws_of(TRAINING, 200) * plan.spread(plan.most)
    rows = requirement.experiments[0].evaluate(values, range(len(values)))
    return max(float(np.median(rows["energy"])), 1e-12)
