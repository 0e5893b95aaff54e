"""A manipulator as data: a tree of frames, and the closures that hold it together.

A frame stands for two things, the body that reaches from its parent to it and the
joint at the body's far end (``docs/robot_files.md``).  Small screws act at it in the
paper's order, in its axes: geometric error, link deformation, joint clearance, joint
deformation; then the joint's own motion about or along its z carries the children.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.model.function import Function
from forcefit.inputs.display import Figures, html_table, largest, short_repr
from forcefit.inputs.table import BadInput, nearest, quoted
from stiffness.screws import rotation_matrix, transform

JOINTS = ("fixed", "revolute", "prismatic")
BASE = "base"
LOCKED = (
    "found inf along the own motion of a passive joint, which would lock it; expected "
    '0 (free, as a bearing), a number > 0 (a spring), or joint = "fixed"'
)


@dataclass(frozen=True)
class Clearance:
    """Bounds of a joint's play, the paper's c-bar of eqs. (1)-(5).

    ``None`` is "not given": no play, except along the free motion of a passive joint,
    where it means unbounded.

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


@dataclass(frozen=True)
class BeamLink:
    """A straight beam between the parent's origin and the frame's.

    Attributes:
        section: the section's declared numbers, such as ``{"radius": 0.04}`` [m].
        young: [Pa] Young's modulus.
        poisson: [-] Poisson's ratio.
        density: [kg/m^3] or None if the link has no declared mass.
        theory: ``"timoshenko"`` or ``"euler"``.
        length: [m] if it is not the distance of the origins, else None.
        axis: unit vector from base to tip in the frame's axes, together with length.
        up: direction of the section's height in the frame's axes, or None.
    """

    section: dict[str, float]
    young: float
    poisson: float
    density: float | None = None
    theory: str = "timoshenko"
    length: float | None = None
    axis: tuple[float, float, float] | None = None
    up: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class MatrixLink:
    """A link given by its stiffness K_E at the frame, in the frame's axes.

    Attributes:
        stiffness: (6, 6) [N m/rad .. N/m] symmetric positive definite.
    """

    stiffness: NDArray


@dataclass(frozen=True)
class MeshLink:
    """A link whose K_E comes from finite elements on its surface.

    Attributes:
        surface: the surface file.
        base: interface at the parent's side, as written in robot files.
        tip: interface at the frame's side.
        young: [Pa] Young's modulus.
        poisson: [-] Poisson's ratio.
        density: [kg/m^3] or None.
        unit: length unit of the surface file.
        up: with ``frame_up`` fixes the roll: a direction in the mesh's axes.
        frame_up: the same direction in the frame's axes.
        axis: direction from base to tip in the frame's axes; None from the parent's
            origin to the frame's.
        interface: ``"rigid"`` or ``"distributing"``.
    """

    surface: Path
    base: str | dict
    tip: str | dict
    young: float
    poisson: float
    density: float | None = None
    unit: str = "m"
    up: tuple[float, float, float] | None = None
    frame_up: tuple[float, float, float] | None = None
    interface: str = "rigid"
    axis: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class LibraryLink:
    """A link whose K_E is kept in a stiffness library.

    Attributes:
        library: the library's path.
        key: the entry's key.
    """

    library: Path
    key: str


Link = BeamLink | MatrixLink | MeshLink | LibraryLink


@dataclass(frozen=True, eq=False)
class Frame:
    """One body and the joint at its far end; see the head of this module.

    Attributes:
        name: unique; dots group by leg.
        parent: name of the parent frame, or ``"base"``.
        translation: (3,) [m] origin seen from the parent's frame after its joint.
        rotation: (3,) [rad] rotation vector of the axes, likewise.
        joint: ``"fixed"``, ``"revolute"`` or ``"prismatic"``, about or along own z.
        actuated: a locked, commanded joint; otherwise its motion is free.
        position: [rad or m] joint coordinate in the home pose.
        limits: [rad or m] least and largest coordinate that may be commanded, or None.
        geometric_error: (6,) [rad, m] delta l.
        tolerance: (6,) [rad, m] standard deviations of delta l about the value given,
            0 where it is exact; None where they are not known.
        clearance: the joint's play, None if it has none.
        joint_stiffness: (6, 6) K_B with ``inf`` on the diagonal where rigid, or None;
            0 along a passive joint's own motion (its row and column) leaves it free.
        link: elasticity of the body, None if rigid.
        mass: [kg] of the body beside its link's own.
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
    joint_stiffness: NDArray | None = None
    link: Link | None = None
    mass: float = 0.0
    centre_of_mass: NDArray = field(default_factory=lambda: np.zeros(3))

    __repr__, _repr_html_ = short_repr, html_table

    def __post_init__(self) -> None:
        for name, shape in _SHAPES.items():
            value = getattr(self, name)
            if value is not None:
                value = _locked(value, shape, f"frame '{self.name}': {name}")
                object.__setattr__(self, name, value)
        own = self.own_stiffness
        if self.passive and own is not None and np.isinf(own):
            raise BadInput(f"frame {quoted(self.name)}.joint_stiffness: {LOCKED}")

    @property
    def passive(self) -> bool:
        """Whether the joint moves by itself: a mobile joint that is not driven."""
        return self.joint != "fixed" and not self.actuated

    @property
    def compliant(self) -> bool:
        """Whether the joint is passive and its motion is a spring's."""
        return self.passive and bool(self.own_stiffness)

    @property
    def own_axis(self) -> int:
        """Row of the screw along which the joint moves: RZ, or TZ if prismatic."""
        return 5 if self.joint == "prismatic" else 2

    @property
    def own_stiffness(self) -> float | None:
        """[N m/rad or N/m] of K_B along the joint's motion, None without K_B."""
        K = self.joint_stiffness
        return None if K is None else float(K[self.own_axis, self.own_axis])

    @property
    def springs(self) -> NDArray | None:
        """(6, 6) K_B of what deforms: ``inf`` also along a motion that is free."""
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


@dataclass(frozen=True, eq=False)
class Robot:
    """A manipulator.

    Frames are kept parents first.  Rows of every array below are frames in that order.

    Attributes:
        name: of the robot.
        platform: name of the frame whose pose error is asked for.
        frames: all frames.
        closures: pairs of frames that must coincide once assembled.
        description: one line.
        effects: parameters of the effects that the machine is known to have, by name;
            see :mod:`assembly.effects`.
        session_effects: likewise those of one session alone, by session.
        functions: general effects that it is known to have.
        remarks: what its file leaves to a default that is easily overlooked.
    """

    name: str
    platform: str
    frames: tuple[Frame, ...]
    closures: tuple[tuple[str, str], ...] = ()
    description: str = ""
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    session_effects: Mapping[str, Mapping[str, Mapping[str, float]]] = field(
        default_factory=dict
    )
    functions: tuple[Function, ...] = ()
    remarks: tuple[str, ...] = ()

    __repr__, _repr_html_, summary = short_repr, html_table, short_repr

    def _figures(self) -> Figures:
        """What one asks for first."""
        kinds = ("actuated", "passive")
        count = [f"{sum(getattr(f, k) for f in self.frames)} {k}" for k in kinds]
        titles = [function.title for function in self.functions]
        return {
            "frames": f"{len(self.frames)}, joints {' and '.join(count)}",
            "closures": str(len(self.closures)),
            "platform": self.platform,
            "links": f"{sum(f.link is not None for f in self.frames)} elastic",
            "play": f"in {sum(f.clearance is not None for f in self.frames)} joints",
            "largest error": largest(self.errors),
            **({"effects": ", ".join(self.effects)} if self.effects else {}),
            **({"functions": ", ".join(titles)} if titles else {}),
        }

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", parents_first(self.frames))
        for name in (self.platform, *(n for pair in self.closures for n in pair)):
            self.index(name)

    def index(self, name: str) -> int:
        """Row of a frame.

        Args:
            name: the frame's name.

        Returns:
            Its row in every array of this robot.

        Raises:
            BadInput: there is no such frame; the nearest name is given.
        """
        try:
            return self._rows[name]
        except KeyError:
            hint = nearest(name, self._rows)
            raise BadInput(f"{self.name}: no frame {quoted(name)}{hint}") from None

    def frame(self, name: str) -> Frame:
        """The frame of a name; see :meth:`index` for the error."""
        return self.frames[self.index(name)]

    @cached_property
    def _rows(self) -> dict[str, int]:
        return {frame.name: i for i, frame in enumerate(self.frames)}

    @cached_property
    def parents(self) -> NDArray:
        """(n,) row of each frame's parent, -1 for the base."""
        rows = {BASE: -1, **self._rows}
        return np.array([rows[f.parent] for f in self.frames], dtype=int)

    @cached_property
    def on_path(self) -> NDArray:
        """(n, n) bool: row i marks the frames from the base to frame i, itself too."""
        count = len(self.frames)
        marks = np.eye(count, dtype=bool)
        for i, parent in enumerate(self.parents):
            if parent >= 0:
                marks[i] |= marks[parent]
        return marks

    @cached_property
    def fixed_transforms(self) -> NDArray:
        """(n, 4, 4) each frame seen from its parent's frame after the joint."""
        t = np.array([f.translation for f in self.frames])
        return transform(t, rotation_matrix([f.rotation for f in self.frames]))

    @cached_property
    def errors(self) -> NDArray:
        """(n, 6) [rad, m] the geometric errors delta l."""
        return np.array([f.geometric_error for f in self.frames])

    @cached_property
    def positions(self) -> NDArray:
        """(n,) [rad or m] joint coordinates from which the home pose is solved."""
        return np.array([f.position for f in self.frames])

    @property
    def has_effects(self) -> bool:
        """Whether the machine is known to have any."""
        return bool(self.effects or self.session_effects or self.functions)

    @property
    def sessions(self) -> tuple[str, ...]:
        """Names of the sessions to which some effect belongs."""
        named = [f.session for f in self.functions if f.session is not None]
        return tuple(dict.fromkeys([*self.session_effects, *named]))

    def without_effects(self) -> "Robot":
        """The same robot with nothing but what its frames and closures declare."""
        if not self.has_effects:
            return self
        return replace(self, effects={}, session_effects={}, functions=())

    def with_errors(self, errors: ArrayLike) -> "Robot":
        """The same robot with other geometric errors.

        Args:
            errors: (n, 6) [rad, m] delta l of every frame.

        Returns:
            A new robot.
        """
        rows = _locked(errors, (len(self.frames), 6), f"{self.name}: errors")
        frames = zip(self.frames, rows, strict=True)
        return replace(
            self, frames=tuple(replace(f, geometric_error=e) for f, e in frames)
        )

    def with_links(self, links: dict[str, Link]) -> "Robot":
        """The same robot with other links at the frames named."""
        for name in links:
            self.index(name)
        frames = (replace(f, link=links.get(f.name, f.link)) for f in self.frames)
        return replace(self, frames=tuple(frames))


def parents_first(frames: Iterable[Frame]) -> tuple[Frame, ...]:
    """Frames sorted so that parents precede children, otherwise in the order given.

    Args:
        frames: of one robot.

    Returns:
        The same frames.

    Raises:
        BadInput: two frames share a name, a parent is missing, or parents form a ring.
    """
    frames = tuple(frames)
    rows: dict[str, int] = {}
    for i, frame in enumerate(frames):
        if frame.name == BASE or frame.name in rows:
            row = rows.get(frame.name)
            whose = "the root" if row is None else f"frame[{row + 1}]"
            raise BadInput(
                f"frame[{i + 1}].name: found {quoted(frame.name)}, already the name of "
                f"{whose}; expected another"
            )
        rows[frame.name] = i
    for frame in frames:
        if frame.parent not in rows and frame.parent != BASE:
            hint = nearest(frame.parent, [*rows, BASE])
            raise BadInput(
                f"frame {quoted(frame.name)}.parent: found {quoted(frame.parent)}, "
                f'expected a frame of this robot or "base"{hint}'
            )
    children: dict[str, list[Frame]] = {}
    for frame in frames:
        children.setdefault(frame.parent, []).append(frame)
    depth = {BASE: 0}
    waiting = [BASE]
    while waiting:
        name = waiting.pop()
        for child in children.get(name, ()):
            depth[child.name] = depth[name] + 1
            waiting.append(child.name)
    for frame in frames:
        if frame.name not in depth:
            raise BadInput(
                f"frame {quoted(frame.name)}.parent: found {quoted(frame.parent)}, and "
                'from there on a ring of parents; expected them to lead to "base"'
            )
    return _stable(frames, depth)


def _stable(frames: tuple[Frame, ...], depth: dict[str, int]) -> tuple[Frame, ...]:
    """The given order if parents already come first, else by depth."""
    seen = {BASE}
    for frame in frames:
        if frame.parent not in seen:
            return tuple(sorted(frames, key=lambda f: depth[f.name]))
        seen.add(frame.name)
    return frames


def _locked(value: ArrayLike, shape: tuple[int, ...], whose: str) -> NDArray:
    """A read-only float copy of the right shape, without NaN."""
    array = np.array(value, dtype=float)
    if array.shape != shape:
        raise ValueError(f"{whose} has shape {array.shape}, expected {shape}")
    if np.isnan(array).any():
        raise ValueError(f"{whose} contains NaN")
    array.setflags(write=False)
    return array


def beam_axis(frame: Frame) -> tuple[float, NDArray]:
    """Length and direction of a frame's beam.

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
    # a revolute parent turns the beam about its start, which changes neither
    along = rotation_matrix(frame.rotation).T @ frame.translation
    length = math.sqrt(along @ along)
    if length == 0.0:
        raise ValueError(f"frame '{frame.name}': a beam of no length")
    return length, along / length
