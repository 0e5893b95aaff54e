"""Map tolerance callouts of drawings to geometric errors delta l of the frames.

Each feature of a body deviates from its nominal position by a small screw: the screw
within its tolerance zone plus the screw of its datum frame.  The datum frame is
constructed from the datums A, B and C.  Datum A fixes the components that its shape
determines, B fixes components that A does not fix, and C fixes the remaining
components.  A feature before its joint is the end of a body; its screw is the geometric
error delta l of the frame.  A feature after its joint is the start of the next body.
The frames that the joint carries then move relative to the feature by the opposite
screw.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from graphlib import CycleError, TopologicalSorter

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.callout import (
    HELD,
    Callout,
    Datum,
    axes_along,
    check_orientation,
    zone_of,
)
from forcefit.assembly.callouts.zone import Zone
from forcefit.assembly.callouts.zones_of_features import datum_shift
from forcefit.assembly.kinematics.placed_callout import (
    PlacedCallout,
    check_holes,
    fault_of,
)
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.model.placed_frames import own_motion
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, quoted
from forcefit.stiffness.screws import screw_map, transform

_RANK = 1e-9  # smaller singular values are round-off

# name of a frame; True for the body after its joint, False for the body before it
Side = tuple[str, bool]


@dataclass(frozen=True, eq=False)
class _Bodies:
    """Rigid bodies of a robot in its home pose."""

    robot: Robot
    before: NDArray  # (n, 4, 4) frames before their joint motion, seen from the base
    after: NDArray  # (n, 4, 4) frames after their joint motion, seen from the base
    # index of the body after the joint of each frame; the last entry is for the base
    groups: tuple[int, ...]

    def body(self, side: Side) -> int:
        """Return the index of the body before or after the joint of a frame."""
        row = self.robot.index(side[0])
        return self.groups[row if side[1] else self.robot.parents[row]]

    def pose(self, side: Side) -> NDArray:
        """Return the home pose of a frame before or after its joint motion, (4, 4)."""
        return (self.after if side[1] else self.before)[self.robot.index(side[0])]


def place_callouts(home: Posture) -> tuple[PlacedCallout, ...]:
    """Compute the frame errors due to the tolerance callouts of a robot.

    Args:
        home: home posture of the robot.

    Returns:
        The callouts in the order of the robot, followed by the datum shifts.

    Raises:
        BadInput: a feature has two callouts, a datum is on a different body, datums
            form a cycle, or a callout contradicts the nominal geometry.
    """
    callouts = home.robot.callouts
    if not callouts:
        return ()
    bodies = _bodies(home)
    sides = {(c.feature, c.after): k for k, c in enumerate(callouts)}
    if len(sides) < len(callouts):
        twice = next(
            c for k, c in enumerate(callouts) if sides[c.feature, c.after] != k
        )
        fault = "found the feature twice, expected one [[tolerance]] per feature"
        raise BadInput(fault_of(twice, fault))
    datums = [_datum_sides(bodies, c, sides) for c in callouts]
    zones = [_zone(bodies, c, d[0], callouts, sides)
             for c, d in zip(callouts, datums, strict=True)]  # fmt: skip
    shifting = [(k, j) for k, c in enumerate(callouts)
                for j, datum in enumerate(c.datums) if datum.hole]  # fmt: skip
    zones += [
        datum_shift(datum.hole, datum.extent)
        for datum in (callouts[k].datums[j] for k, j in shifting)
    ]
    widths = np.cumsum([0, *(sum(zone.dimensions) for zone in zones)])
    own = [_own_screw(zone, end, widths[-1])
           for zone, end in zip(zones, widths[1:], strict=True)]  # fmt: skip
    screws = np.zeros((len(callouts), 6, widths[-1]))
    for k in _order(callouts, datums, sides):
        pairs = zip(shifting, own[len(callouts) :], strict=True)
        shifts = {j: screw for (of, j), screw in pairs if of == k}
        frame = _datum_frame(
            bodies, callouts[k], datums[k], callouts, sides, screws, shifts
        )
        screws[k] = own[k] + _to_feature(_feature_pose(bodies, callouts[k])) @ frame
    errors = np.zeros((len(bodies.robot.frames), 6, widths[-1]))
    for k, callout in enumerate(callouts):
        _add_errors(errors, bodies, callout, screws[k])
    parts = np.split(errors, widths[1:-1], axis=2)
    n = len(callouts)
    found = [
        PlacedCallout(*row) for row in zip(callouts, zones[:n], parts[:n], strict=True)
    ]
    _check_names([placed.name for placed in found], callouts)
    for (k, j), zone, part in zip(shifting, zones[n:], parts[n:], strict=True):
        callout = replace(callouts[k], distribution="uniform")
        found.append(PlacedCallout(callout, zone, part, callouts[k].datums[j]))
    check_holes(home.robot, found, bodies.body)
    return tuple(found)


def _own_screw(zone: Zone, end: int, total: int) -> NDArray:
    """Return the screw of a feature per unit of the coordinates of all zones."""
    screw = np.zeros((6, total))
    screw[:, end - sum(zone.dimensions) : end] = zone.columns
    return screw


def _check_names(names: list[str], callouts: tuple[Callout, ...]) -> None:
    """Raise BadInput if two features have the same name in printed tables."""
    for k, name in enumerate(names):
        if name in names[:k]:
            fault = f"found {quoted(name)} twice, expected a different name per feature"
            raise BadInput(fault_of(callouts[k], fault))


def _bodies(home: Posture) -> _Bodies:
    """Group the frames that are connected by fixed joints or closures."""
    robot, n = home.robot, len(home.robot.frames)
    # The parent index -1 refers to the last entry, the base.
    group = list(range(n + 1))

    def root(i: int) -> int:
        while group[i] != i:
            i = group[i]
        return i

    for i, frame in enumerate(robot.frames):
        loose = frame.clearance is not None or frame.joint_stiffness is not None
        if frame.joint == "fixed" and not loose:
            group[root(i)] = root(int(robot.parents[i]) % (n + 1))
    for a, b in robot.closures:
        group[root(robot.index(a))] = root(robot.index(b))
    pairs = zip(robot.frames, home.coordinates, strict=True)
    motions = [own_motion(replace(frame, position=float(q))) for frame, q in pairs]
    after = home.transforms @ np.array(motions)
    return _Bodies(robot, home.transforms, after, tuple(root(i) for i in range(n + 1)))


def _datum_sides(
    bodies: _Bodies, callout: Callout, sides: Mapping[Side, int]
) -> list[Side]:
    """Return the frame of each datum, and whether the body is after its joint."""
    body = bodies.body((callout.feature, callout.after))
    found = []
    for name in (datum.frame for datum in callout.datums):
        here = [(name, a) for a in (False, True) if bodies.body((name, a)) == body]
        if not here:
            fault = f"found the datum {quoted(name)} on another body"
            fault += ", expected a feature of the same body"
            raise BadInput(fault_of(callout, fault))
        if name == callout.feature and (name, callout.after) in here:
            fault = f"found the datum {quoted(name)}, which is the feature itself"
            fault += ", expected another feature of the body"
            raise BadInput(fault_of(callout, fault))
        # If two frames of the datum are on this body, the frame with callouts is
        # selected.
        found.append(next((side for side in here if side in sides), here[0]))
    return found


def _order(
    callouts: tuple[Callout, ...], datums: list[list[Side]], sides: Mapping[Side, int]
) -> list[int]:
    """Return the callouts sorted with datums before the features that refer to them."""
    needs = {
        k: [sides[side] for side in datums[k] if side in sides]
        for k in range(len(callouts))
    }
    try:
        return list(TopologicalSorter(needs).static_order())
    except CycleError as error:
        names = " -> ".join(quoted(callouts[k].name) for k in error.args[1])
        fault = f"found datums that depend on each other: {names}; expected no cycle"
        raise BadInput(fault_of(callouts[error.args[1][0]], fault)) from None


def _feature_pose(bodies: _Bodies, callout: Callout) -> NDArray:
    """Return the home pose of a feature: origin at its middle, z along its axis."""
    pose = bodies.pose((callout.feature, callout.after))
    return pose @ transform(np.array(callout.at), callout.axes)


def _datum_pose(
    bodies: _Bodies, datum: Datum, side: Side, callouts: tuple[Callout, ...],
    sides: Mapping[Side, int],
) -> NDArray:  # fmt: skip
    """Return the home pose of a datum."""
    if side in sides:
        return _feature_pose(bodies, callouts[sides[side]])
    return bodies.pose(side) @ transform(np.array(datum.at), axes_along(datum.axis))


def _zone(
    bodies: _Bodies, callout: Callout, datum: Side, callouts: tuple[Callout, ...],
    sides: Mapping[Side, int],
) -> Zone:  # fmt: skip
    """Return the tolerance zone of a callout, oriented relative to its datum A."""
    pose = _feature_pose(bodies, callout)
    of_datum = _datum_pose(bodies, callout.datums[0], datum, callouts, sides)
    shape = callout.datums[0].shape
    R = pose[:3, :3]
    offset = R.T @ (pose[:3, 3] - of_datum[:3, 3])
    axis = None if shape == "point" else R.T @ of_datum[:3, 2]
    try:
        same = None  # a feature at a fixed joint can be a face or a bore
        if shape != "body":
            same = (shape == "plane") == (callout.shape == "plane")
        check_orientation(callout, np.eye(3)[2], axis, same)
        return zone_of(callout, offset, axis)
    except BadInput as error:
        raise BadInput(fault_of(callout, str(error))) from None


def _to_feature(pose: NDArray) -> NDArray:
    """Return the matrix that transforms screws from the base to a pose, (6, 6)."""
    R = pose[:3, :3]
    return screw_map(-R.T @ pose[:3, 3], R.T)


def _datum_frame(
    bodies: _Bodies, callout: Callout, datums: list[Side],
    callouts: tuple[Callout, ...], sides: Mapping[Side, int], screws: NDArray,
    shifts: Mapping[int, NDArray],
) -> NDArray:  # fmt: skip
    """Return the screw of the datum frame per unit of each zone coordinate, (6, M)."""
    D, free = np.zeros(screws.shape[1:]), np.eye(6)
    for j, (datum, side) in enumerate(zip(callout.datums, datums, strict=True)):
        pose = _datum_pose(bodies, datum, side, callouts, sides)
        own = screws[sides[side]] if side in sides else np.zeros_like(D)
        if j in shifts:
            own = own + shifts[j]
        to_datum = _to_feature(pose)
        # Lengths are divided by the distance to the feature, so that rad and m have
        # equal weights.
        gap = pose[:3, 3] - _feature_pose(bodies, callout)[:3, 3]
        scale = np.repeat([1.0, 1.0 / max(float(np.linalg.norm(gap)), 1e-3)], 3)[
            :, None
        ]
        held = list(HELD[datum.shape])
        Q, sizes, _ = np.linalg.svd(scale * (to_datum @ free), full_matrices=False)
        Q = Q[:, sizes > _RANK * max(sizes[0], 1.0)] if sizes.size else Q
        u, s, vt = np.linalg.svd(Q[held])
        rank = int((s > _RANK).sum())
        missing = (scale * (own - to_datum @ D))[held]
        y = vt[:rank].T @ ((u[:, :rank].T @ missing) / s[:rank, None])
        back = np.linalg.solve(to_datum, Q / scale)
        D = D + back @ y
        free = back @ vt[rank:].T
    return D


def _add_errors(
    errors: NDArray, bodies: _Bodies, callout: Callout, screw: NDArray
) -> None:
    """Add the frame errors delta l that the screw of a feature causes."""
    robot, row = bodies.robot, bodies.robot.index(callout.feature)
    pose = _feature_pose(bodies, callout)
    if not callout.after:
        errors[row] += _carried(pose, bodies.before[row]) @ screw
        return
    children = np.flatnonzero(robot.parents == row)
    if not len(children):
        fault = "found no frame carried by its joint, expected at least one"
        raise BadInput(fault_of(callout, fault))
    for child in children:
        errors[child] -= _carried(pose, bodies.before[child]) @ screw


def _carried(old: NDArray, new: NDArray) -> NDArray:
    """Return the matrix that transforms screws from one pose to another, (6, 6)."""
    return _to_feature(new) @ np.linalg.inv(_to_feature(old))
