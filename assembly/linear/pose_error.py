"""Certified bounds on the largest pose error of the platform, problem (27).

Problem (27) of the paper is degenerate.  It fixes the deformations at their values in
problem (22), and complementary slackness then fixes every loaded clearance.  The
argument ``assumption`` therefore selects which screws can still move:

======== =======================================================================
frozen   all deformations are fixed; only joints with unloaded clearances move
free     compliant joints also rotate freely about their own axis
budget   all assemblies with at most (1 + eta) times the minimum energy
======== =======================================================================

Motions of passive joints stay within their limits.  Rotation and translation are
bounded separately, because a tool on a bearing rotates freely while the error of its
point is bounded.

The set of platform screws (:mod:`forcefit.assembly.linear.reference.pose_error`) is
convex.  With ``"compiled"``, :func:`forcefit.assembly.solvers.one_problem.farthest`
bounds the largest screw of the set, and calls Clarabel only for inaccurate support
functions.  With ``"reference"``, :func:`forcefit.assembly.solvers.outer_cuts.farthest`
bounds it in numpy, and Clarabel computes every support function.

For ``frozen`` and ``free``, all steps are compiled
(:mod:`forcefit.assembly.linear.moving_clearances`).  For ``budget``, and for points
that the compiled search does not cover, the set is constructed in numpy, one point at a
time.
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
    """Certified bounds on the largest pose error at one or many points.

    The arrays of many points begin with a point axis.

    Attributes:
        assumption: ``"frozen"``, ``"free"`` or ``"budget"``.
        rotation_error: (..., 2) [rad] lower and upper bound; NaN at a point without a
            solution of (22).
        translation_error: (..., 2) [m] lower and upper bound.
        rotation_screw: (..., 6) [rad, m] screw that attains the rotation's lower bound.
        translation_screw: (..., 6) [rad, m] screw that attains the translation's lower
            bound.
        supports: (...) number of support functions evaluated.
        method: (...) method of the search: ``"compiled"``, or ``"reference"`` for numpy
            and Clarabel.
        one_by_one: (...) bool, True if the set of screws was constructed in numpy for
            this point alone.
        status: (...) ``"ok"``; for many points also ``"cannot assemble"``, or
            ``"solver failed"`` if there is no solution or its certificate is too weak.
        reason: (...) message if the status is not ok.
        proof: function that returns a text about the unproved properties of a point.
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
        """Former name of ``assumption``."""
        warn_renamed("PoseError.reading", "PoseError.assumption")
        return self.assumption

    @cached_property
    def unproved(self) -> Any:
        """Message about unproved properties of the solution of (22) or of the bounds.

        The text is empty if everything is proved.
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
    """Bound the largest rotation and translation error of the platform.

    Args:
        assembly: minimum-energy assembly, of one or many points; without loads for
            ``budget``.
        assumption: name from the table at the head of this module.
        energy_budget: eta of ``budget``.
        tolerance_rotation: [rad] largest accepted difference between the upper and
            lower bound on the rotation.
        tolerance_translation: [m] largest accepted difference between the bounds on the
            translation.
        offset: (3,) [m] from the platform's origin to the point whose error is bounded,
            base axes.
        method: ``"compiled"``; or ``"reference"``, which uses only numpy and Clarabel.

    Returns:
        Bounds on the errors.  They are wider than required if 400 support functions do
        not suffice; ``unproved`` then contains a message.  They are infinite if the
        platform can rotate, or its point translate, without limit.  For many
        assemblies, one object contains all points.  A point without bounds does not
        raise an exception; instead, ``reason`` contains its message.

    Raises:
        ValueError: ``assumption`` or ``method`` is unknown, or ``budget`` has a load.
        FreeMotion: a load drives a motion that nothing resists under this assumption.
        SolverFailed: the cone solver did not converge.
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
    """Bound the pose errors of many assemblies."""
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
    """Bound the pose errors of one assembly in numpy."""
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
    """Return a message if the bounds are too far apart, otherwise ``""``."""
    low, high = bounds
    # Both bounds are infinite if the platform moves freely.
    if high - low <= tolerance or low == high:
        return ""
    return (
        f"the bounds of the {part} are {high - low:.1e} {unit} apart, "
        f"expected {tolerance:.1e}"
    )
