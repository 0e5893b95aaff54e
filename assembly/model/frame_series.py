"""Series of frames that form one joint with several degrees of freedom.

A series is identified by the frame names, the joint types and the common origin of the
frames.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from forcefit.assembly.model.frame import Frame
from forcefit.stiffness.screws import rotation_matrix, transform

_SAME = 1e-9  # [m] largest distance between coincident frames
# Types of joints that consist of several frames. Each key contains the name ending and
# the joint type of these frames, in order from the first to the second body.
_SERIES: dict[tuple[tuple[str, str], ...], str] = {
    (("first", "revolute"), ("second", "revolute")): "universal",
    (
        ("first", "revolute"),
        ("second", "revolute"),
        ("third", "revolute"),
    ): "spherical",
    (("turn", "revolute"), ("slide", "prismatic")): "cylindrical",
    (
        ("slide_x", "prismatic"),
        ("slide_y", "prismatic"),
        ("turn", "revolute"),
    ): "planar",
}


@dataclass(frozen=True)
class NamedJoint:
    """Joint that consists of several frames.

    Attributes:
        name: name of the joint.
        kind: ``"universal"``, ``"spherical"``, ``"cylindrical"`` or ``"planar"``.
        frames: names of the moving frames of the joint, parents first.
        main: name of the frame that has the origin and the axes of the joint.
        carriers: names of the frames to which the geometric error of the joint is
            assigned: two for a universal joint, otherwise one.
    """

    name: str
    kind: str
    frames: tuple[str, ...]
    main: str
    carriers: tuple[str, ...]


def joints_of(frames: Sequence[Frame]) -> dict[str, NamedJoint]:
    """Return the joints that consist of several frames, by name.

    Args:
        frames: frames of a robot, parents first.
    """
    known = {frame.name: frame for frame in frames}
    stems: dict[str, list[Frame]] = {}
    for frame in frames:
        stem, dot, _ = frame.name.rpartition(".")
        if dot and frame.passive and stem not in known:
            stems.setdefault(stem, []).append(frame)
    found = (_joint(known, stem, parts) for stem, parts in stems.items())
    return {joint.name: joint for joint in found if joint is not None}


def _joint(
    known: Mapping[str, Frame], stem: str, parts: list[Frame]
) -> NamedJoint | None:
    """Return the joint formed by frames with a common name, or None."""
    ends = tuple((part.name[len(stem) + 1 :], part.joint) for part in parts)
    kind = _SERIES.get(ends) or _SERIES.get(ends[::-1])
    if kind is None or not _at_one_point(known, stem, parts):
        return None
    names = tuple(part.name for part in parts)
    ordered = names if ends in _SERIES else names[::-1]
    main = ordered[2] if kind == "planar" else ordered[0]
    carriers = ordered if kind == "universal" else ordered[:1]
    return NamedJoint(stem, kind, names, main, carriers)


def _at_one_point(known: Mapping[str, Frame], stem: str, parts: list[Frame]) -> bool:
    """Return whether frames are connected in series at one point."""
    frame, T = parts[-1], np.eye(4)
    while frame is not parts[0]:
        T = transform(frame.translation, rotation_matrix(frame.rotation)) @ T
        if not frame.parent.startswith(f"{stem}."):
            return False
        frame = known[frame.parent]
    return float(np.abs(T[:3, 3]).max()) <= _SAME
