"""Assembly zone, problem (21), as a margin on the clearances.

The margin t is the factor by which all clearances must be scaled so that the
manipulator can just be assembled with rigid links and joints.  Assembly is possible if
t <= 1.  The margin is a continuous function of the errors, and 1 / t is the factor by
which the errors could be multiplied.

In (21) as printed, compliant joints are rigid in every direction (``"rigid"``).  With
``"free"``, they rotate about their own axis like a hinge.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.posture import Posture, together
from forcefit.assembly.linear.closure import checked_size
from forcefit.assembly.linear.lanes import COMPILED, REFERENCE, margins_side_by_side
from forcefit.assembly.linear.reference.zone import least_margin
from forcefit.assembly.linear.robot_structure import structure_of
from forcefit.assembly.model.point_results import N, PointResults
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.solvers.method import Method, check_method, log_reference
from forcefit.results.display import Figures

# largest accepted gap between margin and lower bound, relative to the margin
MARGIN_GAP = 1e-8
_GAP_ABSOLUTE = 1e-12  # [-] absolute part of the accepted gap
# behaviour of compliant joints about their own axis, for each margin
Compliant = Literal["rigid", "free"]
MARGINS: dict[str, Compliant] = {"margin": "rigid", "margin_free": "free"}
# largest margin at which a robot can be assembled: 1 plus round-off
ASSEMBLABLE = 1.0 + 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Zone(PointResults, Generic[N]):
    """Solution of problem (21) at one posture or at many, with a leading point axis.

    Attributes:
        margin: (...) factor on the clearances at which the robot can just be assembled;
            inf if there is no such factor, NaN if the solver failed.  At a single
            posture, a failure raises an exception instead.
        bound: (...) certified lower bound on the margin; the compiled method returns it
            within 1e-8 of the margin.
        method: (...) method that solved the point: ``"compiled"``, or ``"reference"``
            for numpy and Clarabel.
        forces: (..., nu) [-] forces on the clearances that prove the bound, multiplied
            by the sizes of the cones and normalised so that their magnitudes on all
            cones add up to 1.  Zero if no clearance is needed; NaN if the point was
            solved by the reference method.
        reason: (...) message if the solver failed; else empty.
    """

    margin: N
    bound: N
    method: Any
    forces: NDArray
    reason: Any

    AXES: ClassVar = {"margin": 0, "bound": 0, "method": 0, "forces": 1, "reason": 0}
    VARIABLES: ClassVar = {
        "margin": "margin",
        "margin_bound": "bound",
        "method": "method",
        "reason": "unproved",
    }

    def _figures(self) -> Figures:
        """Return the margin of one posture, or the largest margin of many postures."""
        if not self.of_many:
            margin, bound = f"{self.margin:.6g}", f"{self.bound:.6g}"
            return {"margin": margin, "bound": bound, "method": self.method}
        margins = np.asarray(self.margin)
        largest = margins[np.isfinite(margins)].max(initial=0.0)
        inside = np.count_nonzero(self.assemblable)
        points = f"{len(self)}, {inside} assemble rigidly"
        return {"points": points, "margin": f"at most {largest:.6g} where finite"}

    def __getitem__(self, rows: Any) -> "Zone":
        """Return the margins of one posture or a selection of postures."""
        taken = super().__getitem__(rows)
        if not taken.of_many and np.isnan(taken.margin):
            raise SolverFailed("smallest factor on the clearances", taken.reason)
        return taken

    @property
    def assemblable(self) -> Any:
        """True where the manipulator can be assembled without deformation."""
        return self.margin <= ASSEMBLABLE

    @property
    def unproved(self) -> Any:
        """Reason why the margin is missing or unproved; empty if it is proved."""
        margin, bound = np.atleast_1d(self.margin, self.bound)
        with np.errstate(invalid="ignore"):
            # With NaN, the comparison is False, so the margin is not proved.
            proved = margin - bound <= MARGIN_GAP * margin + _GAP_ABSOLUTE
        text = np.array(self.reason, dtype=object, ndmin=1)
        for i in np.flatnonzero(~proved & (margin != bound) & (text == "")):
            least = f"{bound[i]:.9g}"
            text[i] = f"the margin {margin[i]:.9g} is certified down to {least} only"
        return text if self.of_many else text[0]


@overload
def zone_margin(
    posture: Posture, compliant: Compliant = "rigid", errors: None = None,
    method: Method = "compiled",
) -> Zone[float]: ...  # fmt: skip


@overload
def zone_margin(
    posture: Sequence[Posture], compliant: Compliant = "rigid",
    errors: ArrayLike | None = None, method: Method = "compiled",
) -> Zone[NDArray]: ...  # fmt: skip


@overload
def zone_margin(
    posture: Posture, compliant: Compliant = "rigid", *, errors: ArrayLike,
    method: Method = "compiled",
) -> Zone[NDArray]: ...  # fmt: skip


def zone_margin(
    posture: Posture | Sequence[Posture], compliant: Compliant = "rigid",
    errors: ArrayLike | None = None, method: Method = "compiled",
) -> Zone:  # fmt: skip
    """Compute the factor on clearances at which a rigid manipulator can be assembled.

    Args:
        posture: the robot's configuration; or many postures of one robot.
        compliant: whether passive joints with stiffness are ``"rigid"`` or ``"free"``
            about their own axis.
        errors: (n, 6) [rad, m] geometric errors that replace those of the robot; or (k,
            n, 6), one set for each of k postures, or k sets at one posture.
        method: ``"compiled"`` falls back on the reference method for points that the
            compiled method cannot certify; ``"reference"`` uses only numpy and
            Clarabel.  The field ``method`` of the result contains the method used for
            each point.

    Returns:
        The margin with a certified lower bound; for many postures or sets of errors,
        one object with all points.

    Raises:
        ValueError: ``compliant`` or ``method`` is unknown.
        SolverFailed: the cone solver did not converge at a single point.
    """
    check_method(method)
    if not isinstance(posture, Posture):
        posture = together(posture)
    if errors is None:
        checked_size(posture.robot)
        own = posture.robot.errors
    else:
        own = np.asarray(errors, dtype=float)
    margin, bound, forces, left = _compiled(posture, compliant, own, method)
    if left.any() and method == "compiled":
        count = int(left.sum())
        log_reference(posture.robot.name, "zone margin", count, len(left))
    if posture.transforms.ndim == 3 and own.ndim == 2:
        if not left[0]:
            return Zone(float(margin[0]), float(bound[0]), "compiled", forces[0], "")
        found = least_margin(_erring(posture, own, 0), compliant == "free")
        return Zone(*found, "reference", np.full(len(forces[0]), np.nan), "")
    forces[left] = np.nan
    reason = np.full(len(margin), "", dtype=object)
    for i in np.flatnonzero(left).tolist():
        margin[i] = bound[i] = np.nan
        try:
            margin[i], bound[i] = least_margin(
                _erring(posture, own, i), compliant == "free"
            )
        except SolverFailed as error:
            reason[i] = str(error)
    gave = np.where(left, "reference", "compiled").astype(object)
    return Zone(margin, bound, gave, forces, reason)


def _erring(posture: Posture, errors: NDArray, i: int) -> Posture:
    """Return one of k postures, with its own geometric errors."""
    if posture.transforms.ndim > 3:
        posture = posture[i if len(posture.transforms) > 1 else 0]
    own = errors if errors.ndim == 2 else errors[i]
    if own is posture.robot.errors:
        return posture
    return replace(posture, robot=posture.robot.with_errors(own))


def _compiled(
    posture: Posture, compliant: Compliant, own: NDArray, method: Method
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Compute margins, bounds and forces; mark points that remain unsolved."""
    if compliant not in {"rigid", "free"}:
        raise ValueError(f"compliant is {compliant!r}, expected 'rigid' or 'free'")
    joints, structure = structure_of(posture.robot, False, compliant == "free")
    T = posture.transforms if posture.transforms.ndim > 3 else posture.transforms[None]
    count = len(own) if len(T) == 1 and own.ndim == 3 else len(T)
    forces = np.zeros((count, joints.cones.shape[1]))
    margin, bound = np.full((2, count), np.nan)
    outcome = np.full(count, REFERENCE)
    if method == "reference":
        return margin, bound, forces, outcome != COMPILED
    if not own.any():  # no clearance is needed
        return *np.zeros((2, count)), forces, np.zeros(count, dtype=bool)
    if joints.scaled.all():
        # The kernels require writable arrays in C order.
        points = (
            np.require(T, requirements=["C", "W"]),
            np.require(own.reshape(-1, *own.shape[-2:]), requirements=["C", "W"]),
            np.full(len(T), posture.mismatch, dtype=float),
        )
        margins_side_by_side(structure, *points, (margin, bound, forces, outcome))
    return margin, bound, forces, outcome != COMPILED
