"""Problem (21), the zone's margin, at many postures or for many errors at once."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.batch.robot_structure import structure_of
from assembly.kinematics.posture import Posture
from assembly.linear.zone import zone_margin
from assembly.model.clearance import Compliant
from assembly.model.robot import Robot
from assembly.solvers.conic import SolverFailed
from forcefit.inputs.display import html_table, short_repr

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True, eq=False)
class Margins:
    """Zone margins of k points, each with its certificate.

    Attributes:
        margin: (k,) factor on all clearances at which it just assembles; inf where
            none does, NaN where the solver failed.
        bound: (k,) certified lower bound, within 1e-8 of the margin where the compiled
            method solved.
        fallback: (k,) bool, solved by :func:`assembly.linear.zone.zone_margin`.
        reason: (k,) message where the solver failed, or what of the margin is not
            proved; else empty.
    """

    margin: NDArray
    bound: NDArray
    fallback: NDArray
    reason: NDArray

    __repr__, _repr_html_ = short_repr, html_table

    def to_xarray(self) -> "xarray.Dataset":
        """Over ``point``; see :mod:`assembly.model.tables`."""
        from assembly.model.tables import points_dataset

        return points_dataset({
            "margin": self.margin,
            "margin_bound": self.bound,
            "reason": self.reason,
        })

    def to_pandas(self) -> "pandas.DataFrame":
        """A row for each point, columns (variable, component)."""
        from assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "point")


def zone_margins(
    robot: Robot, transforms: ArrayLike, compliant: Compliant = "rigid",
    mismatch: ArrayLike = 0.0, errors: ArrayLike | None = None,
) -> Margins:  # fmt: skip
    """Margins of problem (21) at many postures, or for many errors.

    Args:
        robot: of n frames.
        transforms: (k, n, 4, 4) frames seen from the base.
        compliant: ``"rigid"`` or ``"free"``, see :mod:`assembly.linear.zone`.
        mismatch: (k,) or one number [rad, m], nominal closure error of the frames.
        errors: (k, n, 6) [rad, m] geometric errors; the robot's if absent.

    Returns:
        The margins, in the order given.

    Raises:
        ValueError: ``compliant`` is something else.
    """
    from assembly.batch.compiled_zone import all_margins

    if compliant not in {"rigid", "free"}:
        raise ValueError(f"compliant is {compliant!r}, expected 'rigid' or 'free'")
    T = np.require(transforms, dtype=float, requirements=["C", "W"])
    count, n = len(T), len(robot.frames)
    off = np.broadcast_to(np.asarray(mismatch, dtype=float), (count,)).copy()
    joints, structure = structure_of(robot, compliant)
    margin, bound = np.full(count, np.nan), np.full(count, np.nan)
    outcome, reason = np.ones(count, dtype=np.int64), np.full(count, "", dtype=object)
    own = None if errors is None else np.array(errors, dtype=float, order="C")
    if joints.scaled.all() and len(joints.scaled):
        if own is None:
            errors_of_all = robot.errors.copy(order="C")
            all_margins(structure, T, errors_of_all, off, margin, bound, outcome)
        else:
            for i in range(count):
                one = slice(i, i + 1)
                all_margins(
                    structure, T[one], own[i], off[one], margin[one],
                    bound[one], outcome[one],
                )  # fmt: skip
    for i in np.flatnonzero(outcome).tolist():
        erring = robot if own is None else robot.with_errors(own[i])
        posture = Posture(erring, np.full(n, np.nan), T[i], float(off[i]))
        margin[i] = bound[i] = np.nan
        try:
            zone = zone_margin(posture, compliant)
        except SolverFailed as error:
            reason[i] = str(error)
            continue
        reason[i] = zone.unproved
        margin[i] = np.inf if zone.margin is None else zone.margin
        bound[i] = np.inf if zone.bound is None else zone.bound
    return Margins(margin, bound, outcome > 0, reason)
