"""Conversion between mechanisms and robots with frames.

A moving joint becomes a frame with the name of the joint.  The child body of a fixed
joint becomes a frame with the name of the body.  The child body of a moving joint has
its own frame only if it has a mass, is the last body in a chain, or is connected by a
loop closure.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.balls import balls_at_rest
from forcefit.assembly.exchange.mechanism import (
    HERE,
    Body,
    Joint,
    Loop,
    Mechanism,
    ball,
    body_poses,
    chain,
)
from forcefit.assembly.exchange.orientation import onto
from forcefit.assembly.exchange.rigid_bodies import (
    lumped_body,
    mass_keys,
    with_possible_moments,
)
from forcefit.assembly.exchange.springs import other_springs, springs_at_rest
from forcefit.assembly.model.contact_closures import loops
from forcefit.assembly.model.robot import BASE, Frame, Robot
from forcefit.inputs.errors import BadInput
from forcefit.stiffness.screws import rotation_vector, transform

Places = Mapping[str, tuple[str, NDArray]]


@dataclass(frozen=True, eq=False)
class RobotAndMechanism:
    """A robot with frames and the same robot as a mechanism with bodies.

    Attributes:
        robot: robot with frames.
        mechanism: mechanism with bodies.
        places: frame of each body (``"base"`` for the root), and pose of the body
            relative to this frame after the frame's motion, (4, 4).
    """

    robot: Robot
    mechanism: Mechanism
    places: Places


def points_as_joints(mechanism: Mechanism, home: NDArray) -> Mechanism:
    """Insert a ball joint into each loop that is closed only at a point.

    Args:
        mechanism: mechanism with n joints.
        home: coordinates for which the loops are closed, (n,) [rad or m].

    Returns:
        Mechanism in its home pose.  The ball joints have zero coordinates, and each
        loop constrains all six degrees of freedom.
    """
    poses = body_poses(mechanism, home)
    bodies = dict(mechanism.bodies)
    pairs = zip(mechanism.joints, home, strict=True)
    at_home = tuple(replace(joint, position=float(q)) for joint, q in pairs)
    joints = list(balls_at_rest(at_home))
    loops = []
    for loop in mechanism.loops:
        if loop.point:
            first = poses[loop.first] @ loop.at_first
            second = poses[loop.second] @ loop.at_second
            turned = transform(np.zeros(3), second[:3, :3].T @ first[:3, :3])
            tip = Body(f"{loop.name}.tip")
            parts, between = chain(
                loop.name, loop.first, tip.name, loop.at_first, HERE, ball()
            )
            joints += parts
            bodies |= {body.name: body for body in [*between, tip]}
            loop = replace(
                loop, first=tip.name, at_first=HERE, at_second=loop.at_second @ turned,
                point=False,
            )  # fmt: skip
        loops.append(loop)
    return replace(mechanism, bodies=bodies, joints=tuple(joints), loops=tuple(loops))


def robot_of_mechanism(mechanism: Mechanism) -> RobotAndMechanism:
    """Convert a mechanism to a robot.

    Args:
        mechanism: mechanism in its home pose, whose loops constrain all six degrees of
            freedom.

    Returns:
        Robot, mechanism, and poses of the bodies relative to the frames.

    Raises:
        BadInput: the mechanism has no body that can be the platform.
    """
    platform = mechanism.platform or guess_platform(mechanism)
    mechanism = with_possible_moments(_without_base(mechanism))
    springs = springs_at_rest(mechanism)
    left_out = mechanism.left_out + other_springs(mechanism)
    mechanism = replace(mechanism, left_out=left_out)
    mechanism = _with_ends(replace(mechanism, platform=platform))
    carriers = {joint.parent for joint in mechanism.joints}
    met = {name for loop in mechanism.loops for name in (loop.first, loop.second)}
    taken = {BASE, *(j.name for j in mechanism.joints if j.kind != "fixed")}
    frames: list[Frame] = []
    places: dict[str, tuple[str, NDArray]] = {mechanism.root: (BASE, np.eye(4))}

    def add(name: str, parent: str, T: NDArray, **rest: object) -> str:
        turn = rotation_vector(T[:3, :3])
        frames.append(Frame(name, parent, T[:3, 3], turn, **rest))  # type: ignore[arg-type]
        return name

    def own(body: Body) -> str:
        name = body.name
        while name in taken:
            name += ".link"
        taken.add(name)
        return name

    for joint in mechanism.joints:
        parent, at = places[joint.parent]
        body = mechanism.bodies[joint.child]
        mass = mass_keys(body)
        T = at @ joint.placement
        if joint.kind == "fixed":
            name = add(own(body), parent, T @ joint.after, **mass)
            places[body.name] = name, np.eye(4)
            continue
        turn = transform(np.zeros(3), onto(joint.axis))
        motion = {
            "joint": joint.kind, "actuated": joint.actuated, "limits": joint.limits,
            "pitch": 2 * np.pi * joint.lead,
        }  # fmt: skip
        motion["joint_stiffness"] = springs.get(joint.name)
        name = joint.name
        add(name, parent, T @ turn, position=joint.position, **motion)
        after = turn.T @ joint.after
        seen = mass or body.name in met or body.name not in carriers
        if seen or body.name == platform:
            name = add(own(body), name, after, **mass)
            after = np.eye(4)
        places[body.name] = name, after
    closures = tuple((places[k.first][0], places[k.second][0]) for k in mechanism.loops)
    robot = Robot(mechanism.name, places[platform][0], tuple(frames), closures)
    return RobotAndMechanism(robot, mechanism, places)


def _without_base(mechanism: Mechanism) -> Mechanism:
    """Rename the joint ``base``, because this name is reserved for the fixed base."""
    names = {joint.name for joint in mechanism.joints}
    if BASE not in names:
        return mechanism
    other = _unlike(f"{BASE}.joint", names)
    joints = tuple(
        replace(j, name=other) if j.name == BASE else j for j in mechanism.joints
    )
    taken = (
        f'joint "{BASE}" becomes frame "{other}", because "{BASE}" is the name '
        "of the fixed base"
    )
    return replace(mechanism, joints=joints, taken=(*mechanism.taken, taken))


def guess_platform(mechanism: Mechanism) -> str:
    """Return the body at the end of the longest chain of joints.

    Args:
        mechanism: mechanism with at least one joint.

    Returns:
        Name of a body without child bodies.  If several chains have the same length,
        the first one is used.

    Raises:
        BadInput: the mechanism has no joint.
    """
    depth = {mechanism.root: 0}
    for joint in mechanism.joints:
        depth[joint.child] = depth[joint.parent] + (joint.kind != "fixed")
    if len(depth) == 1:
        raise BadInput(f"{mechanism.name}: found no joint, expected at least one joint")
    met = {name for loop in mechanism.loops for name in (loop.first, loop.second)}
    # bodies that were added to close a loop are not candidates
    closing = [j for j in mechanism.joints if _closes(j, mechanism)]
    made = {joint.child for joint in closing}
    met |= {joint.parent for joint in closing}
    carriers = {j.parent for j in mechanism.joints if j.child not in made}
    ends = [name for name in depth if name not in carriers | made]
    free = [name for name in ends if name not in met]
    return max(free or ends, key=lambda name: depth[name])


def _closes(joint: Joint, mechanism: Mechanism) -> bool:
    """Return whether a joint was added to close a loop."""
    return any(
        loop.first == f"{loop.name}.tip"
        and (joint.name == loop.name or joint.name.startswith(f"{loop.name}."))
        for loop in mechanism.loops
    )


def _with_ends(mechanism: Mechanism) -> Mechanism:
    """Add a massless body at each end of a loop, unless the end is a body frame."""
    bodies, joints, loops = dict(mechanism.bodies), list(mechanism.joints), []
    for loop in mechanism.loops:
        ends = []
        for end, name, at in (
            ("first", loop.first, loop.at_first),
            ("second", loop.second, loop.at_second),
        ):
            if name == mechanism.root or not np.array_equal(at, np.eye(4)):
                tip = Body(f"{loop.name}.{end}")
                bodies[tip.name] = tip
                joints.append(Joint(tip.name, "fixed", name, tip.name, at))
                name = tip.name
            ends.append(name)
        loops.append(Loop(loop.name, ends[0], ends[1]))
    return replace(mechanism, bodies=bodies, joints=tuple(joints), loops=tuple(loops))


def mechanism_of_robot(robot: Robot, home: NDArray) -> RobotAndMechanism:
    """Convert a robot to a mechanism of rigid bodies.

    Clearances and geometric errors are omitted.

    Args:
        robot: robot with n frames.
        home: coordinates in the home pose, (n,) [rad or m].

    Returns:
        Robot and mechanism.  The body of a fixed frame has the name of the frame.  The
        name of a moving body is the name of its frame with the suffix ``.link``.
    """
    names = {f.name for f in robot.frames}
    root = _unlike(BASE, names)
    on = {BASE: root}
    bodies = {root: Body(root)}
    joints, places = [], {root: (BASE, np.eye(4))}
    carriers = {frame.parent for frame in robot.frames}
    for frame, T, q in zip(robot.frames, robot.fixed_transforms, home, strict=True):
        fixed = frame.joint == "fixed"
        child = frame.name if fixed else _unlike(f"{frame.name}.link", names)
        name = _unlike(f"{frame.name}.joint", names) if fixed else frame.name
        joints.append(
            Joint(
                name, frame.joint, on[frame.parent], child, T,
                position=float(q), actuated=frame.actuated, limits=frame.limits,
                lead=frame.lead,
            )
        )  # fmt: skip
        on[frame.name] = child
        bodies[child] = Body(child)
        places[child] = frame.name, np.eye(4)
    for parent in carriers:
        children = [f for f in robot.frames if f.parent == parent]
        bodies[on[parent]] = lumped_body(on[parent], children)
    mechanism = Mechanism(
        name=robot.name,
        root=root,
        bodies=bodies,
        joints=tuple(joints),
        loops=tuple(
            Loop(f"loop{i}", on[a], on[b]) for i, (a, b) in enumerate(loops(robot), 1)
        ),
        platform=on[robot.platform],
    )
    return RobotAndMechanism(robot, mechanism, places)


def _unlike(name: str, taken: set[str]) -> str:
    """Append underscores to a name until it is unique."""
    while name in taken:
        name += "_"
    return name
