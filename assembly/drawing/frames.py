"""Conversion of bodies and joints to a robot with frames and closures.

A joint becomes one frame with the same name, or one frame for each degree of freedom
(``joint.first``).  A body becomes a fixed frame with the same name if it has a mass or
a link, is the platform, or is connected by a loop closure.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.drawing.callouts import frame_callouts, frame_fits
from forcefit.assembly.drawing.drawing import Drawing, DrawnBody, DrawnJoint
from forcefit.assembly.drawing.links import link_at_tip
from forcefit.assembly.drawing.parts import (
    Parallel,
    Part,
    every_part,
    joint_axes,
    parallel_parts,
    parts_of,
)
from forcefit.assembly.drawing.tree import ROOT, Edge, Node, Step, steps_of
from forcefit.assembly.model.placed_frames import PlacedFrame, place_frames
from forcefit.assembly.model.robot import BASE, Frame, Robot
from forcefit.inputs.table import BadInput, quoted
from forcefit.stiffness.screws import transform


@dataclass(frozen=True, eq=False)
class _Plan:
    """Names of the frames of a robot.

    Attributes:
        drawing: bodies and joints.
        joints: joints by name.
        bodies: bodies by name.
        own: name of the body frame of each node that has a body frame.
        carriers: name of the frame, for each node, that is the parent of the frames of
            all edges that start at this node.
        links: name of the link frame of each body for which it differs from the body
            frame.
        ends: name of the last frame of each edge that closes a loop.
        seats: name of the frame that coincides with this last frame when the loop is
            closed.
    """

    drawing: Drawing
    joints: Mapping[str, DrawnJoint]
    bodies: Mapping[str, DrawnBody]
    own: Mapping[Node, str]
    carriers: Mapping[Node, str]
    links: Mapping[str, str]
    ends: Mapping[Edge, str]
    seats: Mapping[Edge, str]


def robot_of_drawing(drawing: Drawing) -> Robot:
    """Convert bodies and joints to a robot with frames and closures.

    Args:
        drawing: bodies and joints.

    Returns:
        Robot.  Its remarks list the joints that close loops.

    Raises:
        BadInput: no joint connects a body to the base, the ends of a link coincide, or
            a link from a library would have to be reversed.
    """
    steps = steps_of(drawing)
    plan = _plan(drawing, steps)
    placed: list[PlacedFrame] = []
    closures = []
    for step in steps:
        placed += _frames_of(plan, step)
        if chain := _parallel(step):
            placed += _second_chain(step, chain)
            closures.append((chain.meets, chain.parts[-1].name))
        if step.closes:
            placed += _ends(plan, step)
            closures.append((plan.ends[step.edge], plan.seats[step.edge]))
    remarks = (*_cuts(steps), *drawing.remarks)
    fits, ends = frame_fits(steps)
    return Robot(
        drawing.name, drawing.platform, place_frames(placed), tuple(closures),
        drawing.description, remarks=remarks,
        callouts=frame_callouts(drawing, steps, placed), fits=fits, fitted_ends=ends,
    )  # fmt: skip


def _cuts(steps: list[Step]) -> tuple[str, ...]:
    """Return a remark on the joints that close loops."""
    closing = [step for step in steps if step.closes]
    names = [f"{quoted(s.edge.item.name)} (at {quoted(s.end[0])})" for s in closing]
    return (f"loops close after {', '.join(names)}",) if names else ()


def _plan(drawing: Drawing, steps: list[Step]) -> _Plan:
    """Return the names of all frames, which are unique."""
    joints = {joint.name: joint for joint in drawing.joints}
    bodies = {body.name: body for body in drawing.bodies}
    taken = _part_names(drawing)
    met = {step.end for step in steps if step.closes} - {ROOT}
    massive = {(body.name, True) for body in drawing.bodies if _has_mass(body)}
    linked = {s.end for s in steps if _is_body(drawing, s)}
    own: dict[Node, str] = {}
    for node in [(drawing.platform, True), *sorted(met | massive | linked)]:
        name = node[0] if node[1] else f"{node[0]}.near"
        if node not in own:
            own[node] = _free_name(name, taken)
    links: dict[str, str] = {}
    ends: dict[Edge, str] = {}
    seats: dict[Edge, str] = {}
    for step in steps:
        item = step.edge.item
        if not isinstance(item, DrawnJoint) and not _is_body(drawing, step):
            links[item.name] = _free_name(f"{item.name}.link", taken)
        if step.closes:
            met_at = own.get(step.end) or _free_name(f"{item.name}.{BASE}", taken)
            seats[step.edge] = met_at
            ends[step.edge] = _free_name(f"{item.name}.end", taken)
    carriers = {ROOT: BASE}
    for step in steps:
        if not step.closes:
            carriers[step.end] = own.get(step.end) or _last_name(step, links)
    return _Plan(drawing, joints, bodies, own, carriers, links, ends, seats)


def _part_names(drawing: Drawing) -> set[str]:
    """Return the names of the frames of all joints, which must be unique."""
    owners: dict[str, str] = {}
    for joint in drawing.joints:
        for part in every_part(joint):
            if part.name in owners:
                raise BadInput(
                    f"joint {quoted(joint.name)}: found {quoted(part.name)} as the "
                    "name of a frame, which is also the name of a frame of joint "
                    f"{quoted(owners[part.name])}; expected a different name"
                )
            owners[part.name] = joint.name
    return set(owners)


def _free_name(name: str, taken: set[str]) -> str:
    """Return a name with suffixes that make it unique, and add it to ``taken``."""
    while name in taken:
        name += ".body"
    taken.add(name)
    return name


def _is_body(drawing: Drawing, step: Step) -> bool:
    """Return whether the frame of a link is also the frame of its body."""
    body = step.edge.item
    if isinstance(body, DrawnJoint) or step.closes or step.reverse:
        return False
    return body.name != drawing.platform or _tip(body) is None


def _tip(body: DrawnBody) -> str | None:
    """Return the joint at the end of a link, or None for the reference point."""
    return body.ends[1] if body.ends else None


def _last_name(step: Step, links: Mapping[str, str]) -> str:
    """Return the name of the last frame of an edge."""
    item = step.edge.item
    if isinstance(item, DrawnJoint):
        return parts_of(item, step.reverse)[-1].name
    return links[item.name]


def _frames_of(plan: _Plan, step: Step) -> list[PlacedFrame]:
    """Return the frames of an edge and of the body at its end."""
    item, carrier = step.edge.item, plan.carriers[step.start]
    placed: list[PlacedFrame] = []
    if isinstance(item, DrawnJoint):
        for part in parts_of(item, step.reverse):
            placed.append((_frame(item, part, carrier), part.pose))
            carrier = part.name
    else:
        is_body = _is_body(plan.drawing, step)
        name = plan.own[step.end] if is_body else plan.links[item.name]
        base, tip = (_end_pose(plan, item, k) for k in (step.reverse, not step.reverse))
        link = link_at_tip(item, base, tip, step.reverse)
        mass = _mass(item, tip) if is_body else {}
        placed.append((Frame(name, carrier, link=link, **mass), tip))
        carrier = name
    if not step.closes and step.end in plan.own and plan.own[step.end] != carrier:
        placed.append(_body_frame(plan, step.end, carrier))
    return placed


def _frame(joint: DrawnJoint, part: Part, carrier: str) -> Frame:
    """Return a frame of a joint."""
    numbers = part.numbers
    motion = _motion(joint, part.position) if part.kind != "fixed" else {}
    return Frame(
        part.name, carrier, joint=part.kind, **motion,
        clearance=numbers.clearance, joint_stiffness=numbers.stiffness,
        geometric_error=numbers.error, tolerance=numbers.tolerance,
        locked_at=numbers.locked_at,
    )  # fmt: skip


def _parallel(step: Step) -> Parallel | None:
    """Return the second chain of contacts of an edge, or None."""
    item = step.edge.item
    return parallel_parts(item, step.reverse) if isinstance(item, DrawnJoint) else None


def _second_chain(step: Step, chain: Parallel) -> list[PlacedFrame]:
    """Return the frames of the second chain of contacts of a joint."""
    joint, carrier = step.edge.item, chain.start
    assert isinstance(joint, DrawnJoint)
    placed = []
    for part in chain.parts:
        placed.append((_frame(joint, part, carrier), part.pose))
        carrier = part.name
    return placed


def _motion(joint: DrawnJoint, position: float) -> dict:
    """Return the motion of a joint as keys of a frame."""
    return {
        "pitch": joint.pitch, "actuated": joint.actuated, "position": position,
        "limits": joint.limits,
    }  # fmt: skip


def _mass(body: DrawnBody, pose: NDArray) -> dict:
    """Return the mass and inertia of a body as keys of a frame."""
    if not _has_mass(body):
        return {}
    R = pose[:3, :3]
    centre, J = R.T @ (body.centre - pose[:3, 3]), R.T @ body.inertia @ R
    return {"mass": body.mass, "centre_of_mass": centre, "inertia": (J + J.T) / 2}


def _has_mass(body: DrawnBody) -> bool:
    """Return whether a body has a mass or moments of inertia."""
    return bool(body.mass or body.inertia.any())


def _end_pose(plan: _Plan, body: DrawnBody, tip: bool) -> NDArray:
    """Return the home pose of an end of a link, (4, 4)."""
    name = body.ends[tip] if body.ends else None
    if name is None:
        return transform(plan.drawing.platform_at, np.eye(3))
    return joint_axes(plan.joints[name])


def _pose(plan: _Plan, node: Node) -> NDArray:
    """Return the home pose of a body frame, (4, 4)."""
    name, far = node
    body = plan.bodies[name]
    if name == plan.drawing.platform and far:
        return transform(plan.drawing.platform_at, np.eye(3))
    if body.ends:
        return _end_pose(plan, body, far)
    joint = next(j for j in plan.joints.values() if name in (j.first, j.second))
    return transform(body.centre if _has_mass(body) else joint.at, body.axes)


def _body_frame(plan: _Plan, node: Node, carrier: str) -> PlacedFrame:
    """Return the body frame, which includes the mass of the body."""
    pose = _pose(plan, node)
    mass = _mass(plan.bodies[node[0]], pose) if node[1] else {}
    return Frame(plan.own[node], carrier, **mass), pose


def _ends(plan: _Plan, step: Step) -> list[PlacedFrame]:
    """Return the last frame of an edge that closes a loop, and a frame on the base."""
    end = Frame(plan.ends[step.edge], _last_name(step, plan.links))
    if step.end != ROOT:
        return [(end, _pose(plan, step.end))]
    item = step.edge.item
    assert isinstance(item, DrawnJoint)
    pose = transform(item.at, np.eye(3))
    return [(Frame(plan.seats[step.edge]), pose), (end, pose)]
