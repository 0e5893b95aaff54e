"""Compute the smallest change in each robot parameter that a cross-check detects.

Each parameter in turn is changed by one per cent, and the linear model is solved again.
This solution replaces the simulation in the cross-check. The smallest detectable change
is the relative change at which a check exceeds its bound. It is extrapolated from the
values of the check for the change of one per cent. A parameter is called unproved if a
change by its full value is not detected.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.assembled import Assembly
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.robot import (
    BeamLink,
    Clearance,
    Frame,
    MatrixLink,
    MeshLink,
)
from forcefit.assembly.model.statuses import NO_EQUILIBRIUM
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.stiffness.screws import SCREW
from forcefit.validation.crosscheck.clearance_metric import ClearanceMetric
from forcefit.validation.crosscheck.link_models import link_stiffness
from forcefit.validation.crosscheck.pair import (
    Pair,
    hold_free_motions,
    holding_energy,
    scaled,
)
from forcefit.validation.crosscheck.pose_metric import PoseMetric

_CHANGE = 1e-2  # [-] relative change of a parameter
# Name of the check whose value is proportional to the square of a parameter change.
_QUADRATIC = "optimality gap"
# [-] A parameter is unproved if its smallest detectable relative change is larger.
UNPROVED = 1.0
_NAMED = 4  # largest number of parameter names in a line of text
_KINDS = ("link", "joint stiffness", "clearance", "error")


@dataclass(frozen=True)
class Resolution:
    """Smallest detectable change of one robot parameter.

    Attributes:
        name: frame and quantity, for example ``leg1.elbow.radial``.
        kind: kind of the parameter: link, joint stiffness, clearance or error.
        value: value of the parameter, or 1 for a factor on a stiffness matrix.
        smallest: smallest relative change that a check detects; infinite if no check
            detects a change.
        by: name of the check that detects this change.
    """

    name: str
    kind: str
    value: float
    smallest: float
    by: str = ""

    @property
    def unproved(self) -> bool:
        """Whether a change by the full value of the parameter is not detected."""
        return not self.smallest < UNPROVED


def resolutions(
    posture: Posture, pairs: Sequence[Pair], metric: PoseMetric | ClearanceMetric,
    load: NDArray, gravity: NDArray,
) -> list[Resolution]:  # fmt: skip
    """Return the smallest parameter changes that a cross-check detects.

    Args:
        posture: posture at which the models are compared.
        pairs: solutions at several scales, largest first.
        metric: comparison of the solutions.
        load: (6,) [N m, N] load at scale 1.
        gravity: (3,) [m/s^2] gravity at scale 1.

    Returns:
        One result per parameter, in the order of the robot's frames.  Parameters are
        link stiffnesses, finite joint stiffnesses, clearances, and nonzero components
        of geometric errors.
    """
    found = []
    for name, kind, value, frame in _changes(posture, bool(gravity.any())):
        changed = _with_frame(posture, frame)
        try:
            smallest, by = _noticed(changed, pairs, metric, load, gravity)
        except (CannotAssemble, FreeMotion, SolverFailed):
            smallest, by = _CHANGE, NO_EQUILIBRIUM
        found.append(Resolution(name, kind, value, smallest, by))
    return found


def _changes(posture: Posture, weight: bool) -> Iterator[tuple[str, str, float, Frame]]:
    """Yield the name, kind and value of each parameter, and the changed frame."""
    more = 1.0 + _CHANGE
    for frame in posture.robot.frames:
        link = frame.link
        if isinstance(link, BeamLink):
            stiffer = replace(link, young=more * link.young)
            yield f"{frame.name}.link", "link", 1.0, replace(frame, link=stiffer)
        elif link is not None and not (weight and isinstance(link, MeshLink)):
            K = MatrixLink(more * link_stiffness(frame))
            yield f"{frame.name}.link", "link", 1.0, replace(frame, link=K)
        yield from _joint_changes(frame, more)
        clearance = frame.clearance or Clearance()
        for key, bound in vars(clearance).items():
            if bound and np.isfinite(bound):
                larger = replace(clearance, **{key: more * bound})
                name = f"{frame.name}.{key}"
                yield name, "clearance", bound, replace(frame, clearance=larger)
        for i in np.flatnonzero(frame.geometric_error).tolist():
            error = frame.geometric_error.copy()
            error[i] *= more
            name = f"{frame.name}.error.{SCREW[i]}"
            value = float(frame.geometric_error[i])
            yield name, "error", value, replace(frame, geometric_error=error)


def _joint_changes(
    frame: Frame, more: float
) -> Iterator[tuple[str, str, float, Frame]]:
    """Yield the changed finite joint stiffnesses of a frame."""
    K = frame.joint_stiffness
    if K is None:
        return
    kind, diagonal = "joint stiffness", np.diag(K)
    finite = np.isfinite(diagonal) & (diagonal > 0)
    if K[~np.eye(6, dtype=bool)].any():
        yield f"{frame.name}.K", kind, 1.0, replace(frame, joint_stiffness=more * K)
        return
    for i in np.flatnonzero(finite).tolist():
        stiffer = K.copy()
        stiffer[i, i] *= more
        name = f"{frame.name}.K.{SCREW[i]}"
        yield name, kind, float(diagonal[i]), replace(frame, joint_stiffness=stiffer)


def _with_frame(posture: Posture, frame: Frame) -> Posture:
    """Return the posture with the frame of the same name replaced."""
    frames = [frame if f.name == frame.name else f for f in posture.robot.frames]
    return replace(posture, robot=replace(posture.robot, frames=tuple(frames)))


def _noticed(
    changed: Posture, pairs: Sequence[Pair], metric: PoseMetric | ClearanceMetric,
    load: NDArray, gravity: NDArray,
) -> tuple[float, str]:  # fmt: skip
    """Return the smallest detectable relative change and the check that detects it."""
    first = pairs[0]
    if first.simulated.held:
        changed = hold_free_motions(changed)
    s = first.scale
    other = solve_assembly(scaled(changed, s), s * load, gravity=s * gravity)
    # The linear model is homogeneous, so any two scales give the same result.
    compared = tuple(
        replace(pair, simulated=_as_simulated(other, first, pair)) for pair in pairs[:2]
    )
    checks = replace(metric, pairs=compared).limits
    smallest, by = np.inf, ""
    for name, check in checks.items():
        if not check.signal or not check.value > 0.0:
            continue
        ratio = check.bound / check.value
        change = _CHANGE * (np.sqrt(ratio) if name == _QUADRATIC else ratio)
        if change < smallest:
            smallest, by = float(change), name
    return smallest, by


def _as_simulated(other: Assembly, first: Pair, pair: Pair) -> Any:
    """Convert a linear solution to a result of the simulation at another scale."""
    ratio = pair.scale / first.scale
    held = holding_energy(other.posture.robot, other.joint_screws)
    energy = (other.energy - held) * ratio**2 + pair.between
    return SimpleNamespace(
        platform_screw=ratio * other.platform_screw,
        energy=energy,
        rigid_energy=energy,
        link_screws=ratio * other.link_screws,
        link_wrenches=ratio * other.wrenches,
        joint_screws=ratio * other.joint_screws,
        joint_wrenches=ratio * other.joint_wrenches,
        clearance_screws=ratio * other.clearance_screws,
        held=pair.simulated.held,
    )


def resolution_text(found: Sequence[Resolution]) -> list[str]:
    """Format the detectable changes of each kind and the unproved parameters."""
    lines = []
    for kind in _KINDS:
        proved = [r for r in found if r.kind == kind and not r.unproved]
        if proved:
            low, high = (f(proved, key=lambda r: r.smallest) for f in (min, max))
            lines.append(
                f"smallest detectable change, {kind}: {_percent(low.smallest)} "
                f"({low.name}) to {_percent(high.smallest)} ({high.name})"
            )
    unproved = [r.name for r in found if r.unproved]
    if unproved:
        more = f" and {len(unproved) - _NAMED} more" if len(unproved) > _NAMED else ""
        lines.append(
            f"unproved (a change by the full value is not detected): {len(unproved)} "
            f"of {len(found)} parameters: {', '.join(unproved[:_NAMED])}{more}"
        )
    return lines


def _percent(share: float) -> str:
    """Format a fraction in per cent with two significant digits."""
    return f"{100 * share:.2g} %"
