"""The largest pose error of the platform: problem (27) with certified bounds.

As printed, (27) is degenerate: with the deformations frozen at the solution of (22),
complementary slackness fixes every loaded clearance.  So there are three readings of
what may still move:

======== =================================================================
frozen   all deformations stay; only unloaded clearances move (the paper)
free     compliant joints also turn freely about their own axis
budget   everything that closes with at most (1 + eta) times the least energy
======== =================================================================

Passive joints keep within the bounds of their own motion.  Rotation and translation are
bounded each by itself: a tool on a bearing turns freely, and its point still has a
largest error.

The set of platform screws (:mod:`assembly.linear.reach`) is convex.  By the method
``"compiled"`` its farthest one is bracketed by
:func:`assembly.solvers.one_problem.farthest`, which asks Clarabel for single supports
in doubt; by ``"reference"`` by :func:`assembly.solvers.outer_cuts.farthest`, in numpy,
and Clarabel for every support.  The first two readings are compiled whole
(:mod:`assembly.linear.moving_clearances`): some tenths of a millisecond a point.  For
``budget``, and a point that this does not cover, the set is set up in numpy, one by
one.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.posture import Posture
from assembly.linear.assembled import Assembly
from assembly.linear.certificate import unproved
from assembly.linear.energy import failure_status, solve_assembly
from assembly.linear.moving_clearances import Asked, compiled_bounds
from assembly.linear.reach import reachable_screws
from assembly.linear.reference import CannotAssemble
from assembly.linear.robot_structure import structure_of
from assembly.model.point_results import PointResults
from assembly.model.robot import Robot
from assembly.solvers.conic import SolverFailed
from assembly.solvers.method import Method
from forcefit.inputs.display import (
    Figures,
    bracket,
    html_table,
    short_repr,
)


@dataclass(frozen=True, eq=False)
class PoseError:
    """Certified bounds of the largest pose error, and screws that attain the lower.

    Attributes:
        reading: ``"frozen"``, ``"free"`` or ``"budget"``.
        rotation_error: [rad] (lower, upper) bounds.
        translation_error: [m] (lower, upper) bounds.
        rotation_screw: (6,) [rad, m] attains the lower bound of the rotation.
        translation_screw: (6,) [rad, m] attains that of the translation.
        cuts: support functions computed.
        method: which searched: ``"compiled"``, or ``"reference"``, numpy and Clarabel.
        proof: says what of it is not proved.
    """

    reading: str
    rotation_error: tuple[float, float]
    translation_error: tuple[float, float]
    rotation_screw: NDArray
    translation_screw: NDArray
    cuts: int
    method: Method
    proof: Callable[[], str] = str

    __repr__, _repr_html_, summary = short_repr, html_table, short_repr

    @cached_property
    def unproved(self) -> str:
        """What of the solution of (22), or of the width asked, is not proved.

        Empty if nothing; only found out when asked, it takes longer than the bounds.
        """
        return self.proof()

    def _figures(self) -> Figures:
        """What ``forcefit assembly error`` prints of it."""
        figures = {
            "reading": self.reading,
            "rotation": bracket(self.rotation_error, "mrad"),
            "translation": bracket(self.translation_error, "mm"),
        }
        return figures | ({"not proved": self.unproved} if self.unproved else {})


@dataclass(frozen=True, eq=False, repr=False)
class PoseErrors(PointResults):
    """Certified bounds of the largest pose errors of k points; ``[i]`` is one of them.

    Attributes:
        reading: ``"frozen"``, ``"free"`` or ``"budget"``.
        rotation_error: (k, 2) [rad] lower and upper; NaN without a solution of (22).
        translation_error: (k, 2) [m] likewise.
        rotation_screw: (k, 6) [rad, m] attains the lower bound of the rotation.
        translation_screw: (k, 6) [rad, m] attains that of the translation.
        supports: (k,) support functions computed.
        method: (k,) which searched: ``"compiled"`` or ``"reference"``.
        one_by_one: (k,) bool, whose set of screws was set up in numpy.
        status: (k,) ``"ok"``, ``"cannot assemble"``, or ``"solver failed"`` where
            there is no solution or its certificate falls short.
        reason: (k,) message where the status is not ok.
    """

    reading: str
    rotation_error: NDArray
    translation_error: NDArray
    rotation_screw: NDArray
    translation_screw: NDArray
    supports: NDArray
    method: NDArray
    one_by_one: NDArray
    status: NDArray
    reason: NDArray

    VARIABLES: ClassVar = {
        "rotation_error": "rotation_error",
        "translation_error": "translation_error",
        "rotation_screw": "rotation_screw",
        "translation_screw": "translation_screw",
        "method": "method",
        "status": "status",
        "reason": "reason",
    }

    def __getitem__(self, i: int) -> PoseError:
        """Point i; NaN, and why, where there is no solution."""
        return PoseError(
            reading=self.reading,
            rotation_error=tuple(self.rotation_error[i].tolist()),
            translation_error=tuple(self.translation_error[i].tolist()),
            rotation_screw=self.rotation_screw[i],
            translation_screw=self.translation_screw[i],
            cuts=int(self.supports[i]),
            method=self.method[i],
            proof=partial(str, self.reason[i]),
        )


def bound_pose_error(
    assembly: Assembly,
    reading: str = "frozen",
    energy_budget: float = 0.05,
    tolerance_rotation: float = 1e-6,
    tolerance_translation: float = 1e-6,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    method: Method = "compiled",
) -> PoseError:
    """Bracket the largest rotation and translation error of the platform.

    Args:
        assembly: of least energy, without a load in reading ``budget``.
        reading: see the head of this module.
        energy_budget: eta of reading ``budget``.
        tolerance_rotation: [rad] asked of upper minus lower bound.
        tolerance_translation: [m] likewise.
        offset: (3,) [m] from the platform's origin to the point whose error is meant.
        method: ``"compiled"``; or ``"reference"``, numpy and Clarabel alone: tenths of
            a second.

    Returns:
        Bounds; wider than asked only if 400 supports did not suffice, which
        ``unproved`` then says; infinite where the platform can turn, or its point
        move, without bound.

    Raises:
        ValueError: reading or method is unknown, or ``budget`` is asked under a load.
        SolverFailed: the cone solver gave up.
    """
    asked = Asked(
        reading, energy_budget, tolerance_rotation, tolerance_translation, offset,
        method,
    )  # fmt: skip
    posture = assembly.posture
    if assembly.joints is structure_of(posture.robot)[0] and not assembly.frame_loads:
        bounds = _pose_errors(
            posture.robot, posture.transforms[None], np.array([posture.mismatch]),
            posture.robot.errors[None], assembly.as_many, asked,
        )  # fmt: skip
        if not bounds.one_by_one[0]:
            return replace(bounds[0], proof=partial(unproved, assembly))
    return _bounds_of_one(assembly, asked)


def _bounds_of_one(assembly: Assembly, asked: Asked) -> PoseError:
    """The bounds of a set that is set up in numpy."""
    reachable = reachable_screws(assembly, asked.reading, asked.energy_budget)
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
        reading=asked.reading,
        rotation_error=rotation,
        translation_error=translation,
        rotation_screw=rotation_screw,
        translation_screw=translation_screw,
        cuts=supports + more,
        method=asked.method,
        proof=proof,
    )


def _too_wide(
    part: str, bounds: tuple[float, float], tolerance: float, unit: str
) -> str:
    """That bounds are farther apart than asked, if they are."""
    low, high = bounds
    # both infinite: the platform can move without bound
    if high - low <= tolerance or low == high:
        return ""
    return (
        f"the bounds of the {part} are {high - low:.1e} {unit} apart, "
        f"expected {tolerance:.1e}"
    )


def bound_pose_errors(
    robot: Robot,
    transforms: ArrayLike,
    reading: str = "frozen",
    errors: ArrayLike | None = None,
    mismatch: ArrayLike = 0.0,
    energies: Assembly | None = None,
    energy_budget: float = 0.05,
    tolerance_rotation: float = 1e-6,
    tolerance_translation: float = 1e-6,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    method: Method = "compiled",
) -> PoseErrors:
    """Bracket the largest rotation and translation errors at many points.

    Args:
        robot: of n frames.
        transforms: (k, n, 4, 4) frames seen from the base.
        reading: ``"frozen"``, ``"free"`` or ``"budget"``, see
            :mod:`assembly.linear.pose_error`.
        errors: (n, 6) or (k, n, 6) [rad, m] geometric errors; the robot's if absent.
        mismatch: (k,) or one number [rad, m], nominal closure error of the frames.
        energies: of :func:`assembly.linear.energy.minimise_energies` for the same
            arguments, if known.
        energy_budget: eta of reading ``budget``.
        tolerance_rotation: [rad] asked of upper minus lower bound.
        tolerance_translation: [m] likewise.
        offset: (3,) [m] from the platform's origin to the point whose error is meant.
        method: as of :func:`bound_pose_error`.

    Returns:
        The bounds, in the order given.

    Raises:
        ValueError: reading or method is unknown, or a shape does not fit the robot.
    """
    asked = Asked(
        reading, energy_budget, tolerance_rotation, tolerance_translation, offset,
        method,
    )  # fmt: skip
    T = np.asarray(transforms, dtype=float)
    if energies is None:
        unknown = np.full((len(T), len(robot.frames)), np.nan)
        where = Posture(robot, unknown, T, mismatch)
        energies = solve_assembly(where, errors=errors, method=method)
    if len(energies) != len(T):
        raise ValueError(
            f"bound_pose_errors: energies of {len(energies)} points, expected "
            f"{len(T)}, one for each of the transforms"
        )
    off = np.broadcast_to(np.asarray(mismatch, dtype=float), (len(T),)).copy()
    bounds = _pose_errors(robot, T, off, errors, energies, asked)
    for i in np.flatnonzero(bounds.one_by_one).tolist():
        try:
            one = _bounds_of_one(energies[i], asked)
        except (CannotAssemble, SolverFailed) as error:
            bounds.status[i], bounds.reason[i] = failure_status(error), str(error)
            continue
        bounds.rotation_error[i] = one.rotation_error
        bounds.translation_error[i] = one.translation_error
        bounds.rotation_screw[i] = one.rotation_screw
        bounds.translation_screw[i] = one.translation_screw
        bounds.supports[i] = one.cuts
        if one.unproved:
            bounds.status[i], bounds.reason[i] = "solver failed", one.unproved
    return bounds


def _pose_errors(
    robot: Robot, T: NDArray, off: NDArray, errors: ArrayLike | None,
    energies: Assembly, asked: Asked,
) -> PoseErrors:  # fmt: skip
    """The compiled bounds, with what is known of (22)."""
    bounds = compiled_bounds(robot, T, off, errors, energies, asked)
    return PoseErrors(
        reading=asked.reading,
        rotation_error=bounds.rotation,
        translation_error=bounds.translation,
        rotation_screw=bounds.rotation_screw,
        translation_screw=bounds.translation_screw,
        supports=bounds.supports,
        method=np.full(len(T), asked.method, dtype=object),
        one_by_one=(bounds.outcome > 0) & (energies.status == "ok"),
        status=energies.status.copy(),
        reason=energies.reason.copy(),
    )
