"""A frame of a manipulator: one body and the joint at its far end.

The body reaches from the parent to the frame (``docs/robot_files.md``).  Small screws
act at the frame in the paper's order, in its axes: geometric error, link deformation,
joint clearance, joint deformation; then the joint's own motion about or along its z
carries the children.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.model.link_kinds import BeamLink, Link
from forcefit.inputs.table import BadInput, quoted
from forcefit.results.display import html_table, short_repr
from stiffness.screws import rotation_matrix

JOINTS = ("fixed", "revolute", "prismatic")
BASE = "base"
LOCKED = (
    "found inf along the own motion of a passive joint, which would lock it; expected "
    '0 (free, as a bearing), a number > 0 (a spring), or joint = "fixed"'
)


@dataclass(frozen=True)
class Clearance:
    """Bounds of a joint's clearance, the paper's c-bar of eqs. (1)-(5).

    ``None`` means "not given": no clearance, except along the free motion of a passive
    joint, where it means unbounded.

    Attributes:
        radial: [m] radius of the disc for (TX, TY), eq. (2).
        axial: [m] bound of abs(TZ), eq. (3).
        tilt: [rad] radius of the disc for (RX, RY), eq. (4).
        spin: [rad] bound of abs(RZ), eq. (5).
    """

    radial: float | None = None
    axial: float | None = None
    tilt: float | None = None
    spin: float | None = None


@dataclass(frozen=True, eq=False)
class LockedAt:
    """A fixed joint with clearance that is bolted at one pose and rigid afterwards.

    Attributes:
        clearance: before it is bolted.
        pose: components ``tx .. rz`` [m, rad] of the platform at that pose.
        joints: or coordinates [rad or m] of drives; home if both are empty.
        screw: (6,) [rad, m] clearance that is locked in; it is part of the geometric
            error.  Computed by :func:`assembly.steps.bolted.bolt_joints`.
    """

    clearance: Clearance
    pose: Mapping[str, float] = field(default_factory=dict)
    joints: Mapping[str, float] = field(default_factory=dict)
    screw: NDArray = field(default_factory=lambda: np.zeros(6))

    def __post_init__(self) -> None:
        object.__setattr__(self, "screw", locked(self.screw, (6,), "locked_at: screw"))


@dataclass(frozen=True, eq=False)
class Frame:
    """One body and the joint at its far end; see the head of this module.

    Attributes:
        name: unique; dots group by leg.
        parent: name of the parent frame, or ``"base"``.
        translation: (3,) [m] origin seen from the parent's frame after its joint.
        rotation: (3,) [rad] rotation vector of the axes, seen from there too.
        joint: ``"fixed"``, ``"revolute"`` or ``"prismatic"``, about or along own z.
        actuated: whether the joint is locked at a command; otherwise its motion is
            free.
        position: [rad or m] joint coordinate in the home pose.
        limits: [rad or m] least and largest coordinate that may be commanded, or None.
        geometric_error: (6,) [rad, m] delta l.
        tolerance: (6,) [rad, m] standard deviations of delta l about the given value, 0
            where it is exact; None if unknown.
        clearance: clearance of the joint; None if it has none.
        locked_at: where the joint is bolted, with its clearance before; None if it is
            not.
        joint_stiffness: (6, 6) K_B with ``inf`` on the diagonal where rigid, or None;
            0 along a passive joint's own motion (its row and column) leaves it free.
        link: elasticity of the body, None if rigid.
        mass: [kg] of the body in addition to its link's own.
        centre_of_mass: (3,) [m] of that mass, in the frame's axes.
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
    link: Link | None = None
    mass: float = 0.0
    centre_of_mass: NDArray = field(default_factory=lambda: np.zeros(3))

    __repr__, _repr_html_ = short_repr, html_table

    def __post_init__(self) -> None:
        for name, shape in _SHAPES.items():
            value = getattr(self, name)
            if value is not None:
                value = locked(value, shape, f"frame '{self.name}': {name}")
                object.__setattr__(self, name, value)
        if self.locked_at is not None and (self.joint != "fixed" or self.clearance):
            raise BadInput(
                f"frame {quoted(self.name)}.locked_at: found a joint that moves or has "
                'a clearance besides; expected joint = "fixed"'
            )
        own = self.own_stiffness
        if self.passive and own is not None and np.isinf(own):
            raise BadInput(f"frame {quoted(self.name)}.joint_stiffness: {LOCKED}")

    @property
    def passive(self) -> bool:
        """Whether the joint is passive: mobile but not driven."""
        return self.joint != "fixed" and not self.actuated

    @property
    def compliant(self) -> bool:
        """Whether the joint is passive and its motion has a spring."""
        return self.passive and bool(self.own_stiffness)

    @property
    def resistance(self) -> NDArray | None:
        """(6, 6) joint's K_B, None if rigid; free along a passive joint's motion."""
        if self.joint_stiffness is not None or not self.passive:
            return self.joint_stiffness
        K = np.full(6, np.inf)
        K[self.own_axis] = 0.0
        return np.diag(K)

    @property
    def own_axis(self) -> int:
        """Index of the joint's own component of a screw: RZ, or TZ if prismatic."""
        return 5 if self.joint == "prismatic" else 2

    @property
    def own_stiffness(self) -> float | None:
        """[N m/rad or N/m] K_B along the joint's motion, None without K_B."""
        K = self.joint_stiffness
        return None if K is None else float(K[self.own_axis, self.own_axis])

    @property
    def springs(self) -> NDArray | None:
        """(6, 6) K_B of the springs: ``inf`` also along a free motion."""
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
}


def locked(value: ArrayLike, shape: tuple[int, ...], whose: str) -> NDArray:
    """Return a read-only copy of an array.

    Args:
        value: the array, or a list that makes one.
        shape: the required shape.
        whose: beginning of the message.

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
    """Return (3,) [m] vector from the parent's origin to the frame's, in its axes."""
    return np.asarray(rotation_matrix(frame.rotation).T @ frame.translation)


def beam_axis(frame: Frame) -> tuple[float, NDArray]:
    """Return the length and direction of a frame's beam.

    Args:
        frame: one with a :class:`BeamLink`.

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
    # a revolute parent rotates the beam about its start, which changes neither
    along = between_origins(frame)
    length = math.sqrt(along @ along)
    if length == 0.0:
        raise ValueError(f"frame '{frame.name}': a beam of no length")
    return length, along / length
