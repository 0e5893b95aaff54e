"""Compute the errors caused by the modelling assumptions at many poses."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from forcefit.assembly.effects.robot_effects import with_effects_applied
from forcefit.assembly.kinematics.posture import Posture, place_many, place_many_joints
from forcefit.assembly.kinematics.verdict import limits_passed
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.sweeps.targets import Targets, goals_of, of_joints
from forcefit.results.display import html_table, short_repr
from forcefit.validation.assumptions.assumptions import (
    assumption_costs,
    stiffness_costs,
)
from forcefit.validation.assumptions.platform_cost import PlatformCosts
from forcefit.validation.assumptions.validity import Cost


@dataclass(frozen=True, eq=False)
class CostsOverPoses:
    """Errors caused by all assumptions at the reachable poses of a list.

    Attributes:
        robot: robot with its geometric errors.
        asked: prescribed pose components [m or rad] of each requested pose.
        unreached: reason why each requested pose is unreachable; empty if it is
            reachable.
        costs: error of each assumption at each reachable pose, or the reason why it is
            unknown.
        platform: errors in platform stiffness at the reachable poses, or the reason why
            they are unknown.
    """

    robot: Robot
    asked: tuple[Mapping[str, float], ...]
    unreached: tuple[str, ...]
    costs: tuple[Mapping[str, Cost | str], ...]
    platform: PlatformCosts | str

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def reached(self) -> tuple[Mapping[str, float], ...]:
        """Prescribed pose components of each reachable pose."""
        return tuple(
            asked
            for asked, why in zip(self.asked, self.unreached, strict=True)
            if not why
        )

    @property
    def assumptions(self) -> tuple[str, ...]:
        """Names of the assumptions."""
        return tuple(self.costs[0]) if self.costs else ()

    @property
    def known(self) -> bool:
        """Whether at least one error is known."""
        return isinstance(self.platform, PlatformCosts) or any(
            isinstance(cost, Cost) for at in self.costs for cost in at.values()
        )


def costs_over_poses(
    robot: Robot,
    targets: Targets,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    solids: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> CostsOverPoses:
    """Return the errors of all assumptions at many poses.

    Args:
        robot: robot with its geometric errors.
        targets: the requested poses or joint coordinates.
        load: (6,) [N m, N] load on the platform at its origin, in base axes.
        gravity: (3,) [m/s^2] gravity in base axes; None for no gravity.
        solids: whether to compare the links with meshed solids.  Meshes are computed
            once for all poses.
        progress: function called after each pose with the number of finished poses and
            the number of all poses.

    Returns:
        The errors of all assumptions at every pose.

    Raises:
        BadInput: the kinematic loops do not close in the home pose, or a surface cannot
            be meshed.
    """
    rows = targets.at(np.arange(int(np.prod(targets.shape))))
    place = place_many_joints if of_joints(targets.names) else place_many
    postures, reasons = place(robot, goals_of(targets.names, robot, rows))
    asked = tuple(dict(zip(targets.names, map(float, r), strict=True)) for r in rows)
    beyond = [
        "" if p is None else limits_passed(robot, p.coordinates) for p in postures
    ]
    reasons = [
        f"beyond the limits of its joints: {passed}" if passed else reason
        for passed, reason in zip(beyond, reasons, strict=True)
    ]
    reached = [
        with_effects_applied(posture)
        for posture, passed in zip(postures, beyond, strict=True)
        if posture is not None and not passed
    ]  # fmt: skip
    platform: PlatformCosts | str = "no pose is reached"
    if reached:
        platform = stiffness_costs(reached, solids)
    costs = []
    for done, posture in enumerate(reached, 1):
        costs.append(assumption_costs(posture, load, gravity, solids))
        progress(done, len(reached))
    return CostsOverPoses(robot, asked, tuple(reasons), tuple(costs), platform)


def costs_at(
    posture: Posture,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    solids: bool = False,
) -> CostsOverPoses:
    """Return the errors of all assumptions at one posture."""
    costs = assumption_costs(posture, load, gravity, solids)
    platform = stiffness_costs([posture], solids)
    asked = (posture.pose(),)
    return CostsOverPoses(posture.robot, asked, ("",), (costs,), platform)
