"""The assembly zone, problem (21), as a margin on the clearances.

The margin t is the factor on all clearances at which the manipulator just assembles
with every link and joint rigid: it is assemblable where t <= 1.  The margin varies
continuously, unlike a yes or no, and its inverse is the factor on the errors.

As printed, (21) makes compliant joints rigid in every direction (``"rigid"``, the
literal reading); ``"free"`` lets them turn about their own axis, as a hinge does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.posture import Posture
from assembly.linear.closure import checked_size
from assembly.linear.lanes import margins_side_by_side
from assembly.linear.reference.zone import least_margin
from assembly.linear.robot_structure import structure_of
from assembly.linear.solutions import FALLBACK, SOLVED
from assembly.model.clearance import Compliant
from assembly.model.point_results import PointResults
from assembly.model.robot import Robot
from assembly.solvers.conic import SolverFailed
from assembly.solvers.method import Method, check_method

MARGIN_GAP = 1e-8  # of a margin, accepted above its bound ..
_GAP_ABSOLUTE = 1e-12  # .. plus this
# readings of compliant joints, by the names of their margins
MARGIN_READINGS: dict[str, Compliant] = {"margin": "rigid", "margin_free": "free"}
ASSEMBLABLE = 1.0 + 1e-6  # a margin within rounding of 1 counts as inside


@dataclass(frozen=True)
class Zone:
    """Solution of problem (21) at one posture.

    Attributes:
        margin: factor on the clearances at which it just assembles; None if no factor
            does.
        bound: certified lower bound of the margin; None if it is None.
        method: which gave it: ``"compiled"``, or ``"reference"``, numpy and Clarabel.
    """

    margin: float | None
    bound: float | None
    method: Method

    @property
    def assemblable(self) -> bool:
        """Whether it assembles rigidly."""
        return self.margin is not None and self.margin <= ASSEMBLABLE

    @property
    def unproved(self) -> str:
        """What the certificate leaves unproved, empty if nothing."""
        if self.margin is None or self.bound is None:
            return ""
        allowed = MARGIN_GAP * self.margin + _GAP_ABSOLUTE
        # written so that NaN is not proved
        if self.margin - self.bound <= allowed:
            return ""
        return f"the margin {self.margin:.9g} is proved down to {self.bound:.9g} only"


@dataclass(frozen=True, eq=False, repr=False)
class Margins(PointResults):
    """Zone margins of k points, each with its certificate; ``[i]`` is one of them.

    Attributes:
        margin: (k,) factor on all clearances at which it just assembles; inf where
            none does, NaN where the solver failed.
        bound: (k,) certified lower bound, within 1e-8 of the margin where the compiled
            method solved.
        method: (k,) which gave it: ``"compiled"`` or ``"reference"``.
        forces: (k, nu) on the clearances, in units that each cone's size works: what
            proves the bound, sizes of all cones adding up to 1; zero where no clearance
            is needed, NaN where the reference solved.
        reason: (k,) message where the solver failed, or what of the margin is not
            proved; else empty.
    """

    margin: NDArray
    bound: NDArray
    method: NDArray
    forces: NDArray
    reason: NDArray

    VARIABLES: ClassVar = {
        "margin": "margin",
        "margin_bound": "bound",
        "method": "method",
        "reason": "reason",
    }

    def __getitem__(self, i: int) -> Zone:
        """Point i; raises where the solver failed."""
        margin, bound = float(self.margin[i]), float(self.bound[i])
        if np.isnan(margin):
            raise SolverFailed("least factor on the clearances", self.reason[i])
        method = self.method[i]
        none = np.isinf(margin)
        return Zone(None, None, method) if none else Zone(margin, bound, method)


@overload
def zone_margin(
    posture: Posture, compliant: Compliant = "rigid", errors: None = None,
    method: Method = "compiled",
) -> Zone: ...  # fmt: skip


@overload
def zone_margin(
    posture: Sequence[Posture], compliant: Compliant = "rigid",
    errors: ArrayLike | None = None, method: Method = "compiled",
) -> Margins: ...  # fmt: skip


@overload
def zone_margin(
    posture: Posture, compliant: Compliant = "rigid", *, errors: ArrayLike,
    method: Method = "compiled",
) -> Margins: ...  # fmt: skip


def zone_margin(
    posture: Posture | Sequence[Posture], compliant: Compliant = "rigid",
    errors: ArrayLike | None = None, method: Method = "compiled",
) -> Zone | Margins:  # fmt: skip
    """Factor on all clearances at which a rigid manipulator just assembles.

    Args:
        posture: where the robot stands; or many postures of one robot.
        compliant: ``"rigid"`` or ``"free"``: passive joints with stiffness, see above.
        errors: (k, n, 6) [rad, m] geometric errors in place of the robot's, a set for
            each of k postures, or k sets at one.
        method: ``"compiled"``, and the reference where that does not prove its answer;
            or ``"reference"``, numpy and Clarabel alone.  The answer's ``method`` says
            which gave it.

    Returns:
        The margin with a certified lower bound; of many postures or sets all of them.

    Raises:
        ValueError: ``compliant`` or ``method`` is something else.
        SolverFailed: the cone solver gave up.
    """
    check_method(method)
    if isinstance(posture, Posture) and errors is None:
        checked_size(posture.robot)
        T, off = posture.transforms[None], np.array([posture.mismatch])
        margin, bound, _, left = _compiled(
            posture.robot, T, compliant, off, None, method
        )
        if left[0]:
            return Zone(*least_margin(posture, compliant), "reference")
        return Zone(float(margin[0]), float(bound[0]), "compiled")
    postures = [posture] if isinstance(posture, Posture) else list(posture)
    sets = None if errors is None else np.asarray(errors, dtype=float)
    return zone_margins(
        postures[0].robot, np.array([p.transforms for p in postures]), compliant,
        np.array([p.mismatch for p in postures]), sets, method,
    )  # fmt: skip


def zone_margins(
    robot: Robot, transforms: ArrayLike, compliant: Compliant = "rigid",
    mismatch: ArrayLike = 0.0, errors: ArrayLike | None = None,
    method: Method = "compiled",
) -> Margins:  # fmt: skip
    """Margins of problem (21) at many postures, or for many errors.

    Args:
        robot: of n frames.
        transforms: (k, n, 4, 4) frames seen from the base; one row serves k sets of
            errors.
        compliant: ``"rigid"`` or ``"free"``, see :mod:`assembly.linear.zone`.
        mismatch: one number or one for each row of ``transforms`` [rad, m], nominal
            closure error of the frames.
        errors: (n, 6) or (k, n, 6) [rad, m] geometric errors; the robot's if absent.
        method: as of :func:`zone_margin`.

    Returns:
        The margins, in the order given.

    Raises:
        ValueError: ``compliant`` or ``method`` is something else.
    """
    check_method(method)
    T = np.asarray(transforms, dtype=float)
    off = np.broadcast_to(np.asarray(mismatch, dtype=float), (len(T),)).copy()
    own = None if errors is None else np.asarray(errors, dtype=float)
    margin, bound, forces, left = _compiled(robot, T, compliant, off, own, method)
    forces[left] = np.nan
    reason = np.full(len(margin), "", dtype=object)
    for i in np.flatnonzero(left).tolist():
        erring = robot
        if own is not None:
            erring = robot.with_errors(own if own.ndim == 2 else own[i])
        unknown, where = np.full(len(robot.frames), np.nan), i if len(T) > 1 else 0
        posture = Posture(erring, unknown, T[where], float(off[where]))
        margin[i] = bound[i] = np.nan
        try:
            zone = Zone(*least_margin(posture, compliant), "reference")
        except SolverFailed as error:
            reason[i] = str(error)
            continue
        reason[i] = zone.unproved
        margin[i] = np.inf if zone.margin is None else zone.margin
        bound[i] = np.inf if zone.bound is None else zone.bound
    gave = np.where(left, "reference", "compiled").astype(object)
    return Margins(margin, bound, gave, forces, reason)


def _compiled(
    robot: Robot, T: NDArray, compliant: Compliant, mismatch: NDArray,
    errors: NDArray | None, method: Method,
) -> tuple[NDArray, NDArray, NDArray, NDArray]:  # fmt: skip
    """Margins, their bounds and forces, and whether each is left to the reference."""
    if compliant not in {"rigid", "free"}:
        raise ValueError(f"compliant is {compliant!r}, expected 'rigid' or 'free'")
    own = robot.errors if errors is None else errors
    joints, structure = structure_of(robot, compliant)
    count = len(own) if len(T) == 1 and own.ndim == 3 else len(T)
    forces = np.zeros((count, joints.cones.shape[1]))
    margin, bound = np.full((2, count), np.nan)
    outcome = np.full(count, FALLBACK)
    if method == "reference":
        return margin, bound, forces, outcome > SOLVED
    if not own.any():  # no clearance is needed
        return *np.zeros((2, count)), forces, np.zeros(count, dtype=bool)
    if joints.scaled.all():
        # writable and in C order, whatever comes: the kernels are compiled for one kind
        points = (
            np.require(T, requirements=["C", "W"]),
            np.require(own.reshape(-1, *own.shape[-2:]), requirements=["C", "W"]),
            mismatch,
        )
        margins_side_by_side(structure, *points, (margin, bound, forces, outcome))
    return margin, bound, forces, outcome > SOLVED
