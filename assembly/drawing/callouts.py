"""Conversion of tolerance callouts of joints to callouts of frames."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.callout import Callout, Datum
from forcefit.assembly.callouts.fits import FittedEnd
from forcefit.assembly.drawing.drawing import Drawing, DrawnCallout, DrawnJoint
from forcefit.assembly.drawing.parts import every_part, parts_of
from forcefit.assembly.drawing.tree import Step
from forcefit.assembly.model.placed_frames import PlacedFrame, own_motion
from forcefit.inputs.table import BadInput, quoted

_ROUNDING = 1e-12
# shape of a datum, by joint type; the default is an axis
_DATUM_SHAPES = {
    "planar": "plane",
    "spherical": "point",
    "prismatic": "guide",
    "fixed": "body",
}
Vector = tuple[float, float, float]


def frame_callouts(
    drawing: Drawing, steps: Sequence[Step], placed: Sequence[PlacedFrame]
) -> tuple[Callout, ...]:
    """Convert callouts of joints to callouts of frames.

    Args:
        drawing: bodies and joints.
        steps: edges of the spanning tree.
        placed: frames with their home poses.

    Returns:
        The callouts.  Axes and directions are in frame axes.
    """
    passed = {s.edge.item.name: s for s in steps if isinstance(s.edge.item, DrawnJoint)}
    poses = {frame.name: (pose, pose @ own_motion(frame)) for frame, pose in placed}
    return tuple(_of_frames(drawn, passed, poses) for drawn in drawing.callouts)


def frame_fits(
    steps: Sequence[Step],
) -> tuple[dict[str, str], dict[str, FittedEnd]]:
    """Return the fits and fitted ends of all joint frames, by name."""
    found = {
        part.name: part.numbers
        for step in steps if isinstance(step.edge.item, DrawnJoint)
        for part in every_part(step.edge.item, step.reverse) if part.numbers.fit
    }  # fmt: skip
    ends = {name: own.fitted_end for name, own in found.items() if own.fitted_end}
    return {name: own.fit for name, own in found.items()}, ends


def _of_frames(
    drawn: DrawnCallout, passed: Mapping[str, Step],
    poses: Mapping[str, tuple[NDArray, NDArray]],
) -> Callout:  # fmt: skip
    """Convert the callout of a joint to a callout of its frame."""
    callout = drawn.callout
    step = passed[callout.feature]
    frame, after, joint = _side(step, drawn.body)
    pose = poses[frame][after]
    R = pose[:3, :3]
    across = None if drawn.direction is None else np.array(drawn.direction)
    if callout.shape == "plane":  # the first side of a face is along x of the joint
        across = joint.across if len(callout.extent) == 2 else None
    datums = []
    for datum in callout.datums:
        name, other, of_datum = _side(passed[datum.frame], drawn.body)
        of = poses[name][other]
        axis = _vector(of[:3, :3].T @ _axis(of_datum, drawn.body))
        shape = _DATUM_SHAPES.get(of_datum.kind, "axis")
        hole_of = _hole_of(passed[datum.frame], drawn) if datum.hole else ""
        datums.append(
            Datum(
                name,
                shape,
                axis,
                _point(of, of_datum),
                datum.hole,
                hole_of,
                datum.extent,
            )  # fmt: skip
        )
    return replace(
        callout, feature=frame, after=after, datums=tuple(datums),
        axis=_vector(R.T @ _axis(joint, drawn.body)),
        direction=None if across is None else _vector(R.T @ across),
        at=_point(pose, joint), hole_of=_hole_of(step, drawn) if callout.hole else "",
    )  # fmt: skip


def _hole_of(step: Step, drawn: DrawnCallout) -> str:
    """Return the name of the fit of a hole, or of the joint if it has no fit."""
    joint = step.edge.item
    assert isinstance(joint, DrawnJoint)
    fitted = [p for p in parts_of(joint, step.reverse) if p.numbers.fit]
    if joint.kind == "universal":
        bearing = "first" if drawn.body == joint.first else "second"
        fitted = [p for p in fitted if p.name.startswith(f"{joint.name}.{bearing}")]
    ends = [(p.numbers.fitted_end, p.name) for p in fitted]
    names = {name if end is None else end.parts for end, name in ends}
    if len(names) > 1:
        fault = f"found (M) at {quoted(joint.name)}, which is fitted in two bearings"
        expected = "expected a fit with the length of one bore"
        where = f"tolerance of {quoted(drawn.callout.name)}"
        raise BadInput(f"{where}: {fault}, {expected}")
    return names.pop() if names else joint.name


def _side(step: Step, body: str) -> tuple[str, bool, DrawnJoint]:
    """Return the joint frame at a body, whether this frame moves, and the joint."""
    joint = step.edge.item
    assert isinstance(joint, DrawnJoint)
    after = step.start[0] != body
    return parts_of(joint, step.reverse)[-1 if after else 0].name, after, joint


def _axis(joint: DrawnJoint, body: str) -> NDArray:
    """Return the joint axis that is fixed to a body, (3,), in base axes."""
    second = joint.kind == "universal" and body == joint.second
    return joint.axis2 if second else joint.axis


def _point(pose: NDArray, joint: DrawnJoint) -> Vector:
    """Return the position of a joint relative to a frame."""
    point = pose[:3, :3].T @ (joint.at - pose[:3, 3])
    x, y, z = (float(v) + 0.0 for v in np.where(abs(point) < _ROUNDING, 0.0, point))
    return x, y, z


def _vector(vector: NDArray) -> Vector:
    """Return a unit vector without rounding errors in components that are 0 or 1."""
    rounded = np.where(abs(vector) < _ROUNDING, 0.0, vector)
    rounded = np.where(abs(abs(rounded) - 1) < _ROUNDING, np.sign(rounded), rounded)
    if np.array_equal(abs(rounded), [0.0, 0.0, 1.0]):
        rounded = abs(rounded)
    x, y, z = (float(v) + 0.0 for v in rounded)
    return x, y, z
