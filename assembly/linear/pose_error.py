"""The largest pose error of the platform: problem (27) with certified bounds.

As printed, (27) is degenerate: with the deformations frozen at the solution of (22),
complementary slackness fixes every loaded clearance.  So there are three assumptions on
the screws that may still move:

======== =================================================================
frozen   all deformations stay; only unloaded clearances move (the paper)
free     compliant joints also turn freely about their own axis
budget   everything that closes with at most (1 + eta) times the least energy
======== =================================================================

Passive joints keep within the bounds of their own motion.  Rotation and translation are
bounded separately: a tool on a bearing turns freely, and its point still has a largest
error.

The set of platform screws (:mod:`forcefit.assembly.linear.reference.pose_error`) is
convex. With ``"compiled"``, :func:`forcefit.assembly.solvers.one_problem.farthest`
brackets its farthest screw and calls Clarabel for single supports in doubt.  With
``"reference"``, :func:`forcefit.assembly.solvers.outer_cuts.farthest` does so in numpy,
and Clarabel computes every support.

The first two assumptions are compiled from end to end
(:mod:`forcefit.assembly.linear.moving_clearances`) and take some tenths of a
millisecond a point.  For ``budget``, and for points that this does not cover, the set
is set up in numpy, point by point.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.linear.assembled import Assembly
from forcefit.assembly.linear.certificate import unproved
from forcefit.assembly.linear.energy import failure_status
from forcefit.assembly.linear.moving_clearances import Asked, compiled_bounds
from forcefit.assembly.linear.reference.energy import CannotAssemble
from forcefit.assembly.linear.reference.pose_error import reachable_screws
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.linear.robot_structure import structure_of
from forcefit.assembly.model.point_results import Numbers, PointResults
from forcefit.assembly.model.statuses import OK, SOLVER_FAILED
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.solvers.method import Method
from forcefit.inputs.renamed import renamed_keywords, warn_renamed
from forcefit.results.display import Figures, bracket, short_repr


@dataclass(frozen=True, eq=False, repr=False)
class PoseError(PointResults):
    """Certified bounds of the largest pose error; of many points, with a leading axis.

    Attributes:
        assumption: ``"frozen"``, ``"free"`` or ``"budget"``.
        rotation_error: (..., 2) [rad] lower and upper bound; NaN at a point without a
            solution of (22).
        translation_error: (..., 2) [m] lower and upper bound.
        rotation_screw: (..., 6) [rad, m] attains the lower bound of the rotation.
        translation_screw: (..., 6) [rad, m] attains that of the translation.
        supports: (...) number of support functions computed.
        method: (...) of the search: ``"compiled"``, or ``"reference"``, numpy and
            Clarabel.
        one_by_one: (...) bool, True if the set of screws was set up in numpy.
        status: (...) ``"ok"``; for many points also ``"cannot assemble"``, or
            ``"solver failed"`` if there is no solution or its certificate falls short.
        reason: (...) message where the status is not ok.
        proof: function that returns what is not proved of one point.
    """

    assumption: str
    rotation_error: NDArray
    translation_error: NDArray
    rotation_screw: NDArray
    translation_screw: NDArray
    supports: Numbers
    method: Any
    one_by_one: Any
    status: Any = OK
    reason: Any = ""
    proof: Callable[[], str] = str

    AXES: ClassVar = {
        "supports": 0, "rotation_error": 1, "translation_error": 1, "rotation_screw": 1,
        "translation_screw": 1, "method": 0, "one_by_one": 0, "status": 0, "reason": 0,
    }  # fmt: skip
    VARIABLES: ClassVar = {
        "rotation_error": "rotation_error",
        "translation_error": "translation_error",
        "rotation_screw": "rotation_screw",
        "translation_screw": "translation_screw",
        "method": "method",
        "status": "status",
        "reason": "reason",
    }

    summary = short_repr

    @property
    def reading(self) -> str:
        """Old name of ``assumption``."""
        warn_renamed("PoseError.reading", "PoseError.assumption")
        return self.assumption

    @cached_property
    def unproved(self) -> Any:
        """(...) part of the solution of (22), or of the width, that is not proved.

        Empty if all is proved.  For one point it is computed on first use, because it
        takes longer than the bounds.
        """
        return self.reason if self.of_many else self.reason or self.proof()

    def _figures(self) -> Figures:
        """Return the numbers that ``forcefit assembly error`` prints."""
        figures = {"assumption": self.assumption}
        rotation, translation = self.rotation_error, self.translation_error
        if self.of_many:
            known = self.status == OK
            figures["points"] = f"{len(self)}, {np.count_nonzero(known)} bounded"
            rotation, translation = (
                one[known].max(axis=0, initial=0.0) for one in (rotation, translation)
            )
        figures["rotation"] = bracket(rotation, "mrad")
        figures["translation"] = bracket(translation, "mm")
        if not self.of_many and self.unproved:
            figures["not proved"] = self.unproved
        return figures


@renamed_keywords(reading="assumption")
def bound_pose_error(
    assembly: Assembly,
    assumption: str = "frozen",
    energy_budget: float = 0.05,
    tolerance_rotation: float = 1e-6,
    tolerance_translation: float = 1e-6,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    method: Method = "compiled",
) -> PoseError:
    """Bracket the largest rotation and translation error of the platform.

    Args:
        assembly: assembly of least energy, one or many, without a load for ``budget``.
        assumption: see the head of this module.
        energy_budget: eta of ``budget``.
        tolerance_rotation: [rad] required difference of upper and lower bound.
        tolerance_translation: [m] the same for the translation.
        offset: (3,) [m] from the platform's origin to the point whose error is bounded,
            base axes.
        method: ``"compiled"``; or ``"reference"``, numpy and Clarabel alone, which
            takes tenths of a second.

    Returns:
        Bounds.  They are wider than required only if 400 supports did not suffice;
        ``unproved`` then says so.  They are infinite where the platform can turn, or
        its point move, without bound.  For many assemblies, one object with all points;
        a point without bounds raises nothing and has its reason in ``reason``.

    Raises:
        ValueError: assumption or method is unknown, or ``budget`` has a load.
        FreeMotion: a load drives a motion that nothing resists by this assumption.
        SolverFailed: the cone solver gave up.
    """
    asked = Asked(
        assumption, energy_budget, tolerance_rotation, tolerance_translation, offset,
        method,
    )  # fmt: skip
    if assembly.of_many:
        return _bounds_of_many(assembly, asked)
    joints, _ = structure_of(assembly.posture.robot)
    if assembly.joints is joints and not assembly.frame_loads:
        rows, left = compiled_bounds(assembly.as_many, asked)
        if not left[0]:
            own = {name: values[0] for name, values in rows.items()}
            own["supports"] = int(own["supports"])
            return PoseError(
                assumption, **own, method=method, one_by_one=False,
                proof=partial(unproved, assembly),
            )  # fmt: skip
    return _bounds_of_one(assembly, asked)


def _bounds_of_many(assembly: Assembly, asked: Asked) -> PoseError:
    """Return the compiled bounds; others are computed point by point."""
    rows, left = compiled_bounds(assembly, asked)
    status, reason = assembly.status.copy(), assembly.reason.copy()
    left &= status == OK
    for i in np.flatnonzero(left).tolist():
        try:
            one = _bounds_of_one(assembly[i], asked)
        except (CannotAssemble, FreeMotion, SolverFailed) as error:
            status[i], reason[i] = failure_status(error), str(error)
            continue
        for name, values in rows.items():
            values[i] = getattr(one, name)
        if one.unproved:
            status[i], reason[i] = SOLVER_FAILED, one.unproved
    method = np.full(len(assembly), asked.method, dtype=object)
    return PoseError(asked.assumption, **rows, method=method, one_by_one=left,
                     status=status, reason=reason)  # fmt: skip


def _bounds_of_one(assembly: Assembly, asked: Asked) -> PoseError:
    """Return the bounds of a set that is set up in numpy."""
    reachable = reachable_screws(assembly, asked.assumption, asked.energy_budget)
    reachable = reachable.at_point(asked.offset)
    rotation, rotation_screw, supports = reachable.farthest(
        0, asked.tolerance_rotation, asked.method
    )
    translation, translation_screw, more = reachable.farthest(
        3, asked.tolerance_translation, asked.method
    )

    def proof() -> str:
        open_ = (
            unproved(assembly),
            _too_wide("rotation", rotation, asked.tolerance_rotation, "rad"),
            _too_wide("translation", translation, asked.tolerance_translation, "m"),
        )
        return "; ".join(filter(None, open_))

    return PoseError(
        assumption=asked.assumption,
        rotation_error=np.array(rotation),
        translation_error=np.array(translation),
        rotation_screw=rotation_screw,
        translation_screw=translation_screw,
        supports=supports + more,
        method=asked.method,
        one_by_one=True,
        proof=proof,
    )


def _too_wide(
    part: str, bounds: tuple[float, float], tolerance: float, unit: str
) -> str:
    """Return a message if bounds are farther apart than required, else an empty one."""
    low, high = bounds
    # both infinite: the platform can move without bound
    if high - low <= tolerance or low == high:
        return ""
    return (
        f"the bounds of the {part} are {high - low:.1e} {unit} apart, "
        f"expected {tolerance:.1e}"
    )
