"""Common representation of URDF, MJCF and SDF: bodies, joints and loops.

A joint connects a child body to its parent body.  The pose of the child relative to the
parent is ``placement @ motion @ after``, where the motion is about or along ``axis``.
Each joint has one degree of freedom.  A joint with several degrees of freedom is a
chain of such joints with massless bodies in between.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.coupling import Coupling
from forcefit.inputs.table import BadInput, nearest, quoted
from forcefit.stiffness.screws import UNIT_VECTORS, rotation_matrix, transform

WORLD = "world"  # name of the fixed body
HERE = np.eye(4)
HERE.setflags(write=False)


@dataclass(frozen=True, eq=False)
class Body:
    """Rigid body.

    Attributes:
        name: name, unique among bodies.
        mass: mass [kg].
        centre: centre of mass, (3,) [m], in body axes.
        inertia: inertia matrix about the centre of mass, (3, 3) [kg m^2], in body axes.
    """

    name: str
    mass: float = 0.0
    centre: NDArray = field(default_factory=lambda: np.zeros(3))
    inertia: NDArray = field(default_factory=lambda: np.zeros((3, 3)))


@dataclass(frozen=True, eq=False)
class Joint:
    """Joint with one degree of freedom between a body and its parent.

    Attributes:
        name: name, unique among joints.
        kind: ``"fixed"``, ``"revolute"``, ``"prismatic"`` or ``"helical"``.
        parent: name of the parent body.
        child: name of the child body.
        placement: pose of the joint relative to the parent, (4, 4).
        axis: unit vector of the axis in the joint frame, (3,).
        after: pose of the child relative to the moved joint frame, (4, 4).
        position: coordinate in the home pose [rad or m].
        actuated: whether the joint is driven.
        limits: smallest and largest coordinate [rad or m]; None without limits.
        stiffness: stiffness of a spring along the motion [N m/rad or N/m]; 0 without
            spring.
        rest: coordinate at which the spring is unloaded [rad or m].
        lead: translation per angle of a helical joint [m/rad]; 0 for other joints.
    """

    name: str
    kind: str
    parent: str
    child: str
    placement: NDArray = field(default_factory=lambda: HERE)
    axis: NDArray = field(default_factory=lambda: np.array(UNIT_VECTORS["z"]))
    after: NDArray = field(default_factory=lambda: HERE)
    position: float = 0.0
    actuated: bool = False
    limits: tuple[float, float] | None = None
    stiffness: float = 0.0
    rest: float = 0.0
    lead: float = 0.0


@dataclass(frozen=True, eq=False)
class Loop:
    """Loop closure: two frames on different bodies coincide.

    Attributes:
        name: name of the loop.
        first: name of the first body.
        second: name of the second body.
        at_first: pose of the frame on the first body, (4, 4).
        at_second: pose of the frame on the second body, (4, 4).
        point: whether only the origins coincide, as in a ball joint.
    """

    name: str
    first: str
    second: str
    at_first: NDArray = field(default_factory=lambda: HERE)
    at_second: NDArray = field(default_factory=lambda: HERE)
    point: bool = False


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Robot as a tree of bodies with loop closures.

    Attributes:
        name: name of the robot.
        root: name of the fixed body.
        bodies: bodies by name, including the root.
        joints: joints, sorted such that parents precede children.
        loops: loop closures.
        platform: name of the platform; None if the file does not specify it.
        left_out: descriptions of file content that a mechanism cannot represent.
        taken: descriptions of assumptions that were made because data are missing.
        couplings: couplings between joints, sorted such that leaders precede followers.
        unweighed: names of bodies whose mass depends on meshes, which are not read.
    """

    name: str
    root: str
    bodies: Mapping[str, Body]
    joints: tuple[Joint, ...]
    loops: tuple[Loop, ...] = ()
    platform: str | None = None
    left_out: tuple[str, ...] = ()
    taken: tuple[str, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    unweighed: tuple[str, ...] = ()

    @property
    def home(self) -> NDArray:
        """Coordinates of all joints in the home pose, (joints,) [rad or m]."""
        return np.array([joint.position for joint in self.joints])


def parents_first(joints: Sequence[Joint], bodies: Mapping[str, Body], file: str) -> (
    tuple[str, tuple[Joint, ...]]
):  # fmt: skip
    """Sort joints so that parents precede children, and find the root.

    Args:
        joints: joints in any order.
        bodies: all bodies, by name.
        file: name of the file, for error messages.

    Returns:
        Name of the root, and sorted joints.

    Raises:
        BadInput: a body is missing or has two parents, or there is not exactly one
            root.
    """
    carried: dict[str, Joint] = {}
    below: dict[str, list[Joint]] = {name: [] for name in bodies}
    for joint in joints:
        for name in (joint.parent, joint.child):
            if name not in bodies:
                where = f"{file}: joint {quoted(joint.name)}"
                raise BadInput(
                    f"{where}: found {quoted(name)}, expected the name of a link"
                    f"{nearest(name, bodies)}"
                )
        if joint.child in carried:
            raise BadInput(
                f"{file}: link {quoted(joint.child)}: found that it is the child of "
                f"two joints, {quoted(carried[joint.child].name)} and "
                f"{quoted(joint.name)}; expected one joint; declare the other joint as "
                "a loop"
            )
        carried[joint.child] = joint
        below[joint.parent].append(joint)
    roots = [name for name in bodies if name not in carried]
    if len(roots) != 1:
        names = " and ".join(map(quoted, roots[:3])) or "none (a cycle of parents)"
        raise BadInput(
            f"{file}: found as root link {names}, expected exactly one link "
            "that is not the child of a joint"
        )
    order, waiting = [], list(reversed(below[roots[0]]))
    while waiting:
        joint = waiting.pop()
        order.append(joint)
        waiting += reversed(below[joint.child])
    if len(order) != len(joints):
        reached = {joint.name for joint in order}
        lost = next(joint for joint in joints if joint.name not in reached)
        raise BadInput(
            f"{file}: joint {quoted(lost.name)}: found a cycle of parents, "
            f"expected parents that lead to the root {quoted(roots[0])}"
        )
    return roots[0], tuple(order)


def body_poses(mechanism: Mechanism, coordinates: NDArray) -> dict[str, NDArray]:
    """Return the poses of all bodies.

    Args:
        mechanism: mechanism with n joints.
        coordinates: coordinates of all joints, (n,) [rad or m].

    Returns:
        Pose relative to the root, (4, 4), by the name of the body.
    """
    poses = {mechanism.root: np.eye(4)}
    for joint, q in zip(mechanism.joints, coordinates, strict=True):
        at = poses[joint.parent] @ joint.placement
        poses[joint.child] = at @ motion(joint, float(q)) @ joint.after
    return poses


def motion(joint: Joint, coordinate: float) -> NDArray:
    """Return the transform (4, 4) of a joint motion by a coordinate [rad or m]."""
    along = coordinate * joint.axis
    if joint.kind in {"revolute", "helical"}:
        return transform(joint.lead * along, rotation_matrix(along))
    return transform(along if joint.kind == "prismatic" else np.zeros(3), np.eye(3))


def chain(
    name: str, parent: str, child: str, placement: NDArray, after: NDArray,
    freedoms: Sequence[tuple[str, str, NDArray]],
) -> tuple[list[Joint], list[Body]]:  # fmt: skip
    """Split a joint with several degrees of freedom into a chain of joints.

    Args:
        name: name of the joint, to which a suffix for each new joint is appended.
        parent: name of the parent body.
        child: name of the child body.
        placement: pose of the first new joint relative to the parent, (4, 4).
        after: pose of the child relative to the moved frame of the last joint, (4, 4).
        freedoms: name suffix, kind and axis (3,) of each new joint.

    Returns:
        The joints, and the bodies between them.
    """
    between = [Body(f"{name}.after_{part}") for part, _, _ in freedoms[:-1]]
    ends = [parent, *(body.name for body in between), child]
    joints = [
        Joint(
            f"{name}.{part}", kind, ends[i], ends[i + 1],
            placement=placement if i == 0 else HERE,
            axis=axis,
            after=after if i == len(freedoms) - 1 else HERE,
        )
        for i, (part, kind, axis) in enumerate(freedoms)
    ]  # fmt: skip
    return joints, between


def ball(turns: str = "xyz") -> list[tuple[str, str, NDArray]]:
    """Return the suffix, kind and axis of each rotation of a ball joint."""
    return [(f"r{axis}", "revolute", np.array(UNIT_VECTORS[axis])) for axis in turns]


def slides() -> list[tuple[str, str, NDArray]]:
    """Return the suffix, kind and axis of each prismatic joint of a free body."""
    return [(f"t{axis}", "prismatic", np.array(UNIT_VECTORS[axis])) for axis in "xyz"]
