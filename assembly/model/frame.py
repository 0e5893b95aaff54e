"""A frame of a manipulator: one body and the joint at the body's far end.

The body connects the parent to the frame (``docs/robot_files.md``).  Small screws act
at the frame, in its axes and in the paper's order: geometric error, link deformation,
joint clearance, joint deformation.  The motion of the joint comes last.  It is about or
along the z axis of the frame, and it moves the child frames.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.model.equal_data import EqualData
from forcefit.assembly.model.inertia import inertia_fault, six_moments
from forcefit.assembly.model.link_kinds import BeamLink, Link
from forcefit.inputs.table import BadInput, quoted
from forcefit.results.display import Figures, brief, html_table, short_repr
from forcefit.stiffness.screws import rotation_matrix

JOINTS = ("fixed", "revolute", "prismatic", "helical")
BASE = "base"
LOCKED = (
    "found inf along the motion of a passive joint, which would lock it; expected "
    '0 (free, as a bearing), a number > 0 (a spring), or joint = "fixed"'
)
SLIDING_BALL = "found a bound on a sliding joint, expected radial"
ONE_OF_BALL = 'found together with "ball", expected one of them'
NO_SPIN = "expected none: the motion along the thread has no clearance"

FORCE_CONTROL = (
    'expected a joint = "revolute" | "prismatic" | "helical" that is not actuated: a '
    "drive that applies a force holds no coordinate"
)


@dataclass(frozen=True)
class Clearance:
    """Bounds of a joint's clearance, the paper's c-bar of eqs. (1)-(5).

    ``None`` means that the bound is not given.  The joint then has no clearance in this
    direction.  Along the free motion of a passive joint, ``None`` means an unbounded
    motion.

    Attributes:
        radial: [m] radius of the disc for (TX, TY), eq. (2).
        axial: [m] bound of abs(TZ), eq. (3).
        tilt: [rad] radius of the disc for (RX, RY), eq. (4).
        spin: [rad] bound of abs(RZ), eq. (5).
        ball: [m] radius of the ball for (TX, TY, TZ), which replaces ``radial`` and
            ``axial`` for a ball joint.
    """

    radial: float | None = None
    axial: float | None = None
    tilt: float | None = None
    spin: float | None = None
    ball: float | None = None

    def __post_init__(self) -> None:
        if self.ball is not None and (self.radial, self.axial) != (None, None):
            key = "axial" if self.radial is None else "radial"
            raise BadInput(f"clearance.{key}: {ONE_OF_BALL}")


# rules for the position in which a joint is bolted
LEFT = ("least", "uniform", "worst")


@dataclass(frozen=True, eq=False)
class LockedAt:
    """A fixed joint with clearance that is bolted at one pose and rigid afterwards.

    Attributes:
        clearance: clearance of the joint before it is bolted.
        pose: components ``tx .. rz`` [m, rad] of the platform at that pose.
        joints: coordinates [rad or m] of drives at that pose, in place of ``pose``.  If
            both are empty, the joint is bolted in the home pose.
        left: position of the joint in its clearance when it is bolted, used for random
            draws.  All three rules select among the positions of least energy:
            ``"least"``, the least sum of squares; ``"uniform"``, a random position;
            ``"worst"``, the largest pose error, which ``assembly error`` bounds.
        screw: (6,) [rad, m] clearance that is locked in; it is part of the geometric
            error.  Computed by :func:`forcefit.assembly.steps.bolted.bolt_joints`.
    """

    clearance: Clearance
    pose: Mapping[str, float] = field(default_factory=dict)
    joints: Mapping[str, float] = field(default_factory=dict)
    left: str = "least"
    screw: NDArray = field(default_factory=lambda: np.zeros(6))

    def __post_init__(self) -> None:
        if self.left not in LEFT:
            raise BadInput(
                f"locked_at.left: found {quoted(self.left)}, expected one of "
                f"{', '.join(LEFT)}"
            )
        object.__setattr__(self, "screw", locked(self.screw, (6,), "locked_at: screw"))


@dataclass(frozen=True, eq=False)
class Frame(EqualData):
    """One body and the joint at its far end; see the head of this module.

    Attributes:
        name: unique name of the frame; the part before a dot is the leg's name.
        parent: name of the parent frame, or ``"base"``.
        translation: (3,) [m] origin of the frame in the axes of the parent's frame
            after the motion of the parent's joint.
        rotation: (3,) [rad] rotation vector of the frame's axes relative to the same
            axes of the parent's frame.
        joint: type of the joint.  ``"revolute"`` rotates about the frame's z axis,
            ``"prismatic"`` translates along it, ``"helical"`` does both, and
            ``"fixed"`` does not move.  The coordinate of a helical joint is the angle.
        actuated: whether a drive holds the joint at its commanded coordinate; otherwise
            its motion is free.
        position: [rad or m] joint coordinate in the home pose.
        limits: [rad or m] least and largest coordinate that can be commanded; None
            without limits.
        geometric_error: (6,) [rad, m] geometric error delta l of the body.
        tolerance: (6,) [rad, m] standard deviations of delta l about the given value. 0
            means an exact component; None means that they are unknown.
        clearance: clearance of the joint; None if it has none.
        locked_at: pose at which a fixed joint is bolted, with its clearance before
            bolting; None if it is not bolted.
        joint_stiffness: (6, 6) stiffness K_B of the joint, or None.  ``inf`` on the
            diagonal means a rigid direction.  Zeros in the row and column of a passive
            joint's own motion leave this motion free.  If (6,) numbers are given, as in
            robot files, they become the diagonal of the matrix.
        drive_force: [N m or N] constant force of a drive on a passive joint, along the
            motion of the joint; positive in the direction of increasing coordinate.
        link: elasticity of the body, None if rigid.
        mass: [kg] mass of the body in addition to the mass of its link.
        centre_of_mass: (3,) [m] centre of this additional mass, in the frame's axes.
        inertia: (3, 3) [kg m^2] moments of inertia of this additional mass about its
            centre, in the frame's axes.  The matrix must be symmetric, and a rigid body
            with its principal moments must exist.
        pitch: [m] translation of a helical joint per turn, positive for a right-hand
            thread; 0 for other joints.
    """

    name: str
    parent: str = BASE
    translation: NDArray = field(default_factory=lambda: np.zeros(3))
    rotation: NDArray = field(default_factory=lambda: np.zeros(3))
    joint: str = "fixed"
    actuated: bool = False
    position: float = 0.0
    limits: tuple[float, float] | None = None
    geometric_error: NDArray = field(default_factory=lambda: np.zeros(6))
    tolerance: NDArray | None = None
    clearance: Clearance | None = None
    locked_at: LockedAt | None = None
    joint_stiffness: NDArray | None = None
    drive_force: float = 0.0
    link: Link | None = None
    mass: float = 0.0
    centre_of_mass: NDArray = field(default_factory=lambda: np.zeros(3))
    inertia: NDArray = field(default_factory=lambda: np.zeros((3, 3)))
    pitch: float = 0.0

    __repr__, _repr_html_ = short_repr, html_table

    def __post_init__(self) -> None:
        for name, shape in _SHAPES.items():
            value = getattr(self, name)
            if value is not None:
                if name == "joint_stiffness" and np.ndim(value) == 1:
                    value = np.diag(value)
                value = locked(value, shape, f"frame '{self.name}': {name}")
                object.__setattr__(self, name, value)
        if self.locked_at is not None and (self.joint != "fixed" or self.clearance):
            raise BadInput(
                f"frame {quoted(self.name)}.locked_at: found a joint that moves or has "
                'another clearance; expected joint = "fixed"'
            )
        if (self.joint == "helical") != (self.pitch != 0.0):
            raise BadInput(
                f"frame {quoted(self.name)}.pitch: found {self.pitch:g} on a "
                f"{self.joint} joint; expected 0 except on a helical joint, "
                "where it is not 0"
            )
        if self.pitch and self.clearance and self.clearance.spin is not None:
            place = f"frame {quoted(self.name)}.clearance.spin"
            raise BadInput(f"{place}: found a bound on a helical joint, {NO_SPIN}")
        ball = self.clearance is not None and self.clearance.ball is not None
        if ball and self.joint in {"prismatic", "helical"}:
            raise BadInput(f"frame {quoted(self.name)}.clearance.ball: {SLIDING_BALL}")
        own = self.own_stiffness
        if self.passive and own is not None and np.isinf(own):
            raise BadInput(f"frame {quoted(self.name)}.joint_stiffness: {LOCKED}")
        if self.drive_force and not self.passive:
            kind = "actuated" if self.actuated else "fixed"
            raise BadInput(
                f"frame {quoted(self.name)}.drive_force: found {self.drive_force:g} on "
                f"a {kind} joint; {FORCE_CONTROL}"
            )
        if self.inertia.any():
            fault = inertia_fault(self.inertia)
            if fault:
                raise BadInput(f"frame {quoted(self.name)}.inertia: {fault}")
            # files contain only the upper triangle
            J = locked((self.inertia + self.inertia.T) / 2, (3, 3), "inertia")
            object.__setattr__(self, "inertia", J)

    @cached_property
    def _hash(self) -> int:
        # these numbers differ between random errors and identified geometries
        numbers = self.translation.tobytes() + self.geometric_error.tobytes()
        return hash((self.name, numbers))

    def _figures(self) -> Figures:
        """Return the fields in short form; rarely used fields only if not zero."""
        shown = {f.name: brief(getattr(self, f.name)) for f in fields(self)[1:]}
        for name in ("drive_force", "pitch"):
            if not getattr(self, name):
                del shown[name]
        del shown["inertia"]
        if self.inertia.any():
            shown["inertia"] = brief(np.array(six_moments(self.inertia)))
        return shown

    @property
    def passive(self) -> bool:
        """Whether the joint can move and has no position-controlled drive."""
        return self.joint != "fixed" and not self.actuated

    @property
    def compliant(self) -> bool:
        """Whether the joint is passive and a spring resists its motion."""
        return self.passive and bool(self.own_stiffness)

    @property
    def resistance(self) -> NDArray | None:
        """(6, 6) K_B of the joint, zero along a passive motion; None if rigid."""
        if self.joint_stiffness is not None or not self.passive:
            return self.joint_stiffness
        K = np.full(6, np.inf)
        K[self.own_axis] = 0.0
        return np.diag(K)

    @property
    def lead(self) -> float:
        """[m/rad] translation of a helical joint per angle, 0 for other joints."""
        return self.pitch / (2 * math.pi)

    @property
    def turns(self) -> bool:
        """Whether the coordinate is an angle: for revolute and helical joints."""
        return self.joint in {"revolute", "helical"}

    @property
    def own_axis(self) -> int:
        """Index of the component of a screw that is the joint's motion: RZ or TZ.

        TZ applies to prismatic joints.  RZ of a helical joint is its whole motion,
        including the translation (:func:`forcefit.assembly.model.links.motion_map`).
        """
        return 5 if self.joint == "prismatic" else 2

    @property
    def own_stiffness(self) -> float | None:
        """[N m/rad or N/m] K_B along the joint's motion; None without K_B."""
        K = self.joint_stiffness
        return None if K is None else float(K[self.own_axis, self.own_axis])

    @property
    def springs(self) -> NDArray | None:
        """(6, 6) K_B of the springs, with ``inf`` along a free motion."""
        K = self.joint_stiffness
        if K is None or self.compliant or not self.passive:
            return K
        K = K.copy()
        K[self.own_axis, self.own_axis] = np.inf
        return K


_SHAPES = {
    "translation": (3,),
    "rotation": (3,),
    "geometric_error": (6,),
    "tolerance": (6,),
    "joint_stiffness": (6, 6),
    "centre_of_mass": (3,),
    "inertia": (3, 3),
}


def locked(value: ArrayLike, shape: tuple[int, ...], whose: str) -> NDArray:
    """Return a read-only copy of an array.

    Args:
        value: the array, or a list of numbers.
        shape: the required shape.
        whose: name of the array, with which the error message begins.

    Returns:
        The array of floats.

    Raises:
        ValueError: the shape differs, or a number is NaN.
    """
    array = np.array(value, dtype=float)
    if array.shape != shape:
        raise ValueError(f"{whose} has shape {array.shape}, expected {shape}")
    if np.isnan(array).any():
        raise ValueError(f"{whose} contains NaN")
    array.setflags(write=False)
    return array


def between_origins(frame: Frame) -> NDArray:
    """Return the (3,) [m] vector from parent's to frame's origin, in frame axes."""
    return np.asarray(rotation_matrix(frame.rotation).T @ frame.translation)


def beam_axis(frame: Frame) -> tuple[float, NDArray]:
    """Return the length and direction of a frame's beam.

    Args:
        frame: frame whose link is a :class:`BeamLink`.

    Returns:
        [m] length, and (3,) unit vector from base to tip in the frame's axes.

    Raises:
        ValueError: the frame has no beam, or the two origins coincide.
    """
    if not isinstance(frame.link, BeamLink):
        raise ValueError(f"frame '{frame.name}' has no beam")
    if frame.link.length is not None and frame.link.axis is not None:
        axis = np.array(frame.link.axis)
        return frame.link.length, axis / np.linalg.norm(axis)
    # a revolute parent joint rotates the beam about its start: its length and direction
    # in the frame's axes remain
    along = between_origins(frame)
    length = math.sqrt(along @ along)
    if length == 0.0:
        raise ValueError(f"frame '{frame.name}': the beam has length 0")
    return length, along / length
