"""Frame of a manipulator: a body and the joint at its distal end.

The body connects the parent to the frame (``docs/robot_files.md``).  The following
small screws are composed at the frame, in its axes and in this order: geometric error,
link deformation, joint clearance and joint deformation.  The motion of the joint about
or along the z axis of the frame follows, and moves the child frames.
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
ONE_OF_BALL = 'found together with "ball", expected only one of them'
NO_SPIN = "expected none: the motion along the thread has no clearance"

FORCE_CONTROL = (
    'expected a joint = "revolute" | "prismatic" | "helical" that is not actuated, '
    "because a force-controlled drive does not hold its coordinate"
)


@dataclass(frozen=True)
class Clearance:
    """Clearance bounds of a joint, denoted by c-bar in eqs. (1)-(5) of the paper.

    If a bound is ``None``, the joint has no clearance in this direction.  The only
    exception is the free motion of a passive joint, which is then unbounded.

    Attributes:
        radial: radius of the disc for (TX, TY) [m], eq. (2).
        axial: bound on abs(TZ) [m], eq. (3).
        tilt: radius of the disc for (RX, RY) [rad], eq. (4).
        spin: bound on abs(RZ) [rad], eq. (5).
        ball: radius of the ball for (TX, TY, TZ) [m], which replaces ``radial`` and
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


# rules for the position within the clearance at which a joint is bolted
LEFT = ("least", "uniform", "worst")


@dataclass(frozen=True, eq=False)
class LockedAt:
    """Data of a fixed joint with clearance that is bolted at one pose.

    Attributes:
        clearance: clearance of the joint before bolting.
        pose: platform pose at which the joint is bolted, ``tx .. rz`` [m, rad].
        joints: drive coordinates [rad or m] at that pose, as an alternative to
            ``pose``.  If both are empty, the joint is bolted in the home pose.
        left: rule for the position within the clearance at which the joint is bolted,
            used for random draws. All rules select a position of minimum energy. The
            rule ``"least"`` selects the position with the minimum sum of squares, and
            ``"uniform"`` selects a random position. The rule ``"worst"`` selects the
            position with the largest pose error, for which ``assembly error`` computes
            bounds.
        screw: position (6,) [rad, m] within the clearance after bolting, which is part
            of the geometric error.  Computed by
            :func:`forcefit.assembly.steps.bolted.bolt_joints`.
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
    """Body and the joint at its distal end.

    Attributes:
        name: unique name of the frame; the part before a dot is the name of the leg.
        parent: name of the parent frame, or ``"base"``.
        translation: origin of the frame (3,) [m], in the axes of the parent frame after
            the motion of the parent joint.
        rotation: rotation vector of the frame axes (3,) [rad], relative to the same
            parent axes.
        joint: type of the joint.  ``"revolute"`` rotates about the z axis of the frame,
            ``"prismatic"`` translates along it, ``"helical"`` does both, and
            ``"fixed"`` does not move.  The coordinate of a helical joint is the angle.
        actuated: whether a drive holds the joint at its commanded coordinate; otherwise
            the joint moves freely.
        position: joint coordinate in the home pose [rad or m].
        limits: minimum and maximum commanded coordinate [rad or m], or None.
        geometric_error: geometric error delta l of the body (6,) [rad, m].
        tolerance: standard deviations of delta l about the given value (6,) [rad, m]; 0
            for exact components, None if unknown.
        clearance: clearance of the joint, or None.
        locked_at: pose at which a fixed joint is bolted, and its clearance before
            bolting; None if the joint is not bolted.
        joint_stiffness: stiffness K_B of the joint (6, 6), or None.  Rigid directions
            have ``inf`` on the diagonal.  Zeros in the row and column of a passive
            joint's own motion leave this motion free.  An array (6,), as in robot
            files, specifies the diagonal.
        drive_force: constant force of a drive on a passive joint [N m or N], along the
            motion of the joint and positive in the direction of increasing coordinate.
        link: elasticity of the body; None if rigid.
        mass: mass of the body [kg], in addition to the mass of its link.
        centre_of_mass: centre of this additional mass (3,) [m], in the frame axes.
        inertia: moments of inertia of this additional mass about its centre (3, 3)
            [kg m^2], in the frame axes.  The matrix must be symmetric, and its
            principal moments must be those of a physically possible rigid body.
        pitch: translation of a helical joint per turn [m], positive for a right-handed
            thread; 0 for all other joint types.
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
                'an additional clearance; expected joint = "fixed"'
            )
        if (self.joint == "helical") != (self.pitch != 0.0):
            raise BadInput(
                f"frame {quoted(self.name)}.pitch: found {self.pitch:g} on a "
                f"{self.joint} joint; expected a nonzero pitch for a helical joint, "
                "and 0 for all others"
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
            # Robot files contain only the upper triangle.
            J = locked((self.inertia + self.inertia.T) / 2, (3, 3), "inertia")
            object.__setattr__(self, "inertia", J)

    @cached_property
    def _hash(self) -> int:
        # Compared robots often differ only in translations and geometric errors.
        numbers = self.translation.tobytes() + self.geometric_error.tobytes()
        return hash((self.name, numbers))

    def _figures(self) -> Figures:
        """Return the fields for the printed summary."""
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
        """Whether the joint can move but has no position-controlled drive."""
        return self.joint != "fixed" and not self.actuated

    @property
    def compliant(self) -> bool:
        """Whether the joint is passive and a spring resists its motion."""
        return self.passive and bool(self.own_stiffness)

    @property
    def resistance(self) -> NDArray | None:
        """Stiffness K_B (6, 6), zero along a passive motion; None if rigid."""
        if self.joint_stiffness is not None or not self.passive:
            return self.joint_stiffness
        K = np.full(6, np.inf)
        K[self.own_axis] = 0.0
        return np.diag(K)

    @property
    def lead(self) -> float:
        """Translation of a helical joint per angle [m/rad]; 0 for other joints."""
        return self.pitch / (2 * math.pi)

    @property
    def turns(self) -> bool:
        """Whether the coordinate is an angle (revolute and helical joints)."""
        return self.joint in {"revolute", "helical"}

    @property
    def own_axis(self) -> int:
        """Index of the screw component of the joint motion: TZ if prismatic, else RZ.

        For a helical joint, component RZ represents the complete motion, including the
        translation; see :func:`forcefit.assembly.model.links.motion_map`.
        """
        return 5 if self.joint == "prismatic" else 2

    @property
    def own_stiffness(self) -> float | None:
        """Stiffness along the joint motion [N m/rad or N/m]; None if not given."""
        K = self.joint_stiffness
        return None if K is None else float(K[self.own_axis, self.own_axis])

    @property
    def springs(self) -> NDArray | None:
        """Stiffness K_B (6, 6) with ``inf`` along a free motion, or None."""
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
        value: array or nested list of numbers.
        shape: required shape.
        whose: name of the array, for error messages.

    Returns:
        Read-only array of floats.

    Raises:
        ValueError: the shape is wrong, or the array contains NaN.
    """
    array = np.array(value, dtype=float)
    if array.shape != shape:
        raise ValueError(f"{whose} has shape {array.shape}, expected {shape}")
    if np.isnan(array).any():
        raise ValueError(f"{whose} contains NaN")
    array.setflags(write=False)
    return array


def between_origins(frame: Frame) -> NDArray:
    """Return the vector from the parent origin to the frame origin (3,) [m]."""
    return np.asarray(rotation_matrix(frame.rotation).T @ frame.translation)


def beam_axis(frame: Frame) -> tuple[float, NDArray]:
    """Return the length and direction of a frame's beam.

    Args:
        frame: frame whose link is a :class:`BeamLink`.

    Returns:
        Length [m], and unit vector from base to tip (3,) in the frame axes.

    Raises:
        ValueError: the link is not a beam, or both origins coincide.
    """
    if not isinstance(frame.link, BeamLink):
        raise ValueError(f"frame '{frame.name}' has no beam")
    if frame.link.length is not None and frame.link.axis is not None:
        axis = np.array(frame.link.axis)
        return frame.link.length, axis / np.linalg.norm(axis)
    # The rotation of a revolute parent joint does not change the length and direction
    # of the beam in the frame axes.
    along = between_origins(frame)
    length = math.sqrt(along @ along)
    if length == 0.0:
        raise ValueError(f"frame '{frame.name}': the beam has length 0")
    return length, along / length
