"""Data model of a manipulator: a tree of frames with loop closures.

Frames are defined in :mod:`forcefit.assembly.model.frame`, and link models in
:mod:`forcefit.assembly.model.link_kinds`.  Their names can also be imported from this
module.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.callouts.callout import Callout
from forcefit.assembly.callouts.fits import FittedEnd
from forcefit.assembly.model.equal_data import EqualData
from forcefit.assembly.model.frame import (
    BASE,
    JOINTS,
    LOCKED,
    NO_SPIN,
    Clearance,
    Frame,
    LockedAt,
    beam_axis,
    locked,
)
from forcefit.assembly.model.frame_series import NamedJoint, joints_of
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.link_kinds import (
    BeamLink,
    LibraryLink,
    Link,
    MatrixLink,
    MeshLink,
)
from forcefit.inputs.table import BadInput, nearest, quoted
from forcefit.results.display import Figures, html_table, largest, short_repr, show
from forcefit.stiffness.screws import rotation_matrix, transform

__all__ = [
    "BASE", "JOINTS", "LOCKED", "NO_SPIN", "BeamLink", "Clearance", "Frame",
    "LibraryLink", "Link", "LockedAt", "MatrixLink", "MeshLink", "Robot", "beam_axis",
    "parents_first",
]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Robot(EqualData):
    """Manipulator.

    Parents precede their children in ``frames``.  The arrays of this class have one row
    per frame.  Robots are equal if all of their data are bit-identical.

    Attributes:
        name: name of the robot.
        platform: name of the frame whose pose error is computed.
        frames: all frames.
        closures: pairs of frames that must coincide after assembly.
        description: one-line description.
        effects: parameters of the known effects, by effect name; see
            :mod:`forcefit.assembly.effects`.
        session_effects: additional effects of each session, by session name.
        functions: known effects of type :class:`Function`.
        learned_range: minimum and maximum of each variable in the data from which the
            effects were identified, by variable name.
        reference_point: point at which the robot was identified (3,) [m], in platform
            axes; None if the robot was not identified.
        diagnosis: data of the diagnosis that identified the robot: verdict, number of
            fitted readings, hold-out error, hash of the campaign, path of the
            covariance file.
        remarks: sentences about default values that a user can overlook.
        callouts: tolerance callouts of features.
        fits: ISO 286 fits by frame, for example ``"12 H7/g6"``; ``radial`` of the
            clearance is the mean clearance of the fit.
        fitted_ends: data of fits that determine ``tilt`` or ``spin``, by frame.
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
    learned_range: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    reference_point: tuple[float, float, float] | None = None
    diagnosis: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    callouts: tuple[Callout, ...] = ()
    fits: Mapping[str, str] = field(default_factory=dict)
    fitted_ends: Mapping[str, FittedEnd] = field(default_factory=dict)

    __repr__, _repr_html_, summary = short_repr, html_table, short_repr
    show = show

    def _figures(self) -> Figures:
        """Return the values shown in the printed summary."""
        kinds = ("actuated", "passive")
        count = [f"{sum(getattr(f, k) for f in self.frames)} {k}" for k in kinds]
        titles = [function.title for function in self.functions]
        return {
            "frames": f"{len(self.frames)}, joints {' and '.join(count)}",
            "closures": str(len(self.closures)),
            "platform": self.platform,
            "links": f"{sum(f.link is not None for f in self.frames)} elastic",
            "clearance": f"in {sum(map(_has_clearance, self.frames))} joints",
            "largest error": largest(self.errors),
            **({"effects": ", ".join(self.effects)} if self.effects else {}),
            **({"functions": ", ".join(titles)} if titles else {}),
        }

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", parents_first(self.frames))
        for name in (self.platform, *(n for pair in self.closures for n in pair)):
            self.index(name)

    def index(self, name: str) -> int:
        """Return the index of a frame.

        Args:
            name: name of the frame.

        Returns:
            Index of the frame in all arrays of this robot.

        Raises:
            BadInput: there is no such frame; the message suggests the closest name.
        """
        try:
            return self._rows[name]
        except KeyError:
            hint = nearest(name, self._rows)
            if name in self.joints:
                hint = f", but a joint of {', '.join(self.joints[name].frames)}"
            raise BadInput(f"{self.name}: no frame {quoted(name)}{hint}") from None

    def frame(self, name: str) -> Frame:
        """Return the frame with a given name; see :meth:`index` for errors."""
        return self.frames[self.index(name)]

    @cached_property
    def _hash(self) -> int:
        return hash((self.name, self.platform, self.frames))

    @cached_property
    def _rows(self) -> dict[str, int]:
        return {frame.name: i for i, frame in enumerate(self.frames)}

    @cached_property
    def joints(self) -> Mapping[str, NamedJoint]:
        """Joints that consist of several frames, by name."""
        return joints_of(self.frames)

    @cached_property
    def parents(self) -> NDArray:
        """Index of each frame's parent (n,), -1 for the base."""
        rows = {BASE: -1, **self._rows}
        return np.array([rows[f.parent] for f in self.frames], dtype=int)

    @cached_property
    def on_path(self) -> NDArray:
        """Mask (n, n); row i selects frame i and its ancestors."""
        count = len(self.frames)
        marks = np.eye(count, dtype=bool)
        for i, parent in enumerate(self.parents):
            if parent >= 0:
                marks[i] |= marks[parent]
        return marks

    @cached_property
    def fixed_transforms(self) -> NDArray:
        """Transforms (n, 4, 4) from parent frames, after their joints, to frames."""
        t = np.array([f.translation for f in self.frames])
        return transform(t, rotation_matrix([f.rotation for f in self.frames]))

    @cached_property
    def errors(self) -> NDArray:
        """Geometric errors delta l (n, 6) [rad, m]."""
        return np.array([f.geometric_error for f in self.frames])

    @property
    def declared_errors(self) -> NDArray:
        """Geometric errors (n, 6) [rad, m] without those due to bolting."""
        errors = self.errors.copy()
        for error, frame in zip(errors, self.frames, strict=True):
            if frame.locked_at is not None:
                error -= frame.locked_at.screw
        return errors

    @cached_property
    def positions(self) -> NDArray:
        """Joint coordinates in the home pose (n,) [rad or m]."""
        return np.array([f.position for f in self.frames])

    @property
    def has_effects(self) -> bool:
        """Whether the robot has known effects."""
        return bool(self.effects or self.session_effects or self.functions)

    @property
    def sessions(self) -> tuple[str, ...]:
        """Names of the sessions that have additional effects."""
        named = [f.session for f in self.functions if f.session is not None]
        return tuple(dict.fromkeys([*self.session_effects, *named]))

    def without_effects(self) -> "Robot":
        """Return the robot without its known effects."""
        if not self.has_effects:
            return self
        return replace(self, effects={}, session_effects={}, functions=())

    def with_errors(self, errors: ArrayLike) -> "Robot":
        """Return the robot with new geometric errors.

        Args:
            errors: delta l of all frames (n, 6) [rad, m].  They also replace errors due
                to bolting.

        Returns:
            Robot with the given errors.
        """
        rows = locked(errors, (len(self.frames), 6), f"{self.name}: errors")
        frames = zip(self.frames, rows, strict=True)
        return replace(self, frames=tuple(_with_error(f, e) for f, e in frames))

    def with_links(self, links: dict[str, Link]) -> "Robot":
        """Return the robot with new link models for the named frames."""
        for name in links:
            self.index(name)
        frames = (replace(f, link=links.get(f.name, f.link)) for f in self.frames)
        return replace(self, frames=tuple(frames))


def _with_error(frame: Frame, error: NDArray) -> Frame:
    """Return the frame with a new geometric error, without an error due to bolting."""
    bolt = frame.locked_at
    if bolt is not None:
        bolt = replace(bolt, screw=np.zeros(6))
    return replace(frame, geometric_error=error, locked_at=bolt)


def _has_clearance(frame: Frame) -> bool:
    """Return whether the joint of a frame has clearance."""
    return frame.clearance is not None


def parents_first(frames: Iterable[Frame]) -> tuple[Frame, ...]:
    """Sort frames so that parents precede their children.

    Args:
        frames: frames of one robot.

    Returns:
        Sorted frames; the given order is preserved if it is already valid.

    Raises:
        BadInput: two frames have the same name, a parent is missing, or the parents
            form a cycle.
    """
    frames = tuple(frames)
    rows: dict[str, int] = {}
    for i, frame in enumerate(frames):
        if frame.name == BASE or frame.name in rows:
            row = rows.get(frame.name)
            whose = "the root" if row is None else f"frame[{row + 1}]"
            raise BadInput(
                f"frame[{i + 1}].name: found {quoted(frame.name)}, which is already "
                f"the name of {whose}; expected a different name"
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
                f"frame {quoted(frame.name)}.parent: found "
                f"{quoted(frame.parent)}, which leads to a cycle of parents; "
                'expected a chain of parents that ends at "base"'
            )
    return _stable(frames, depth)


def _stable(frames: tuple[Frame, ...], depth: dict[str, int]) -> tuple[Frame, ...]:
    """Return frames sorted by depth, or unchanged if parents come first."""
    seen = {BASE}
    for frame in frames:
        if frame.parent not in seen:
            return tuple(sorted(frames, key=lambda f: depth[f.name]))
        seen.add(frame.name)
    return frames
