"""Common representation of URDF, MJCF and SDF: bodies, joints and loops.

A joint carries a child body, whose pose in the parent body is ``placement @ motion @
after``; the motion is about or along ``axis``.  Each joint has one degree of freedom; a
joint with several of them is a chain of such joints with massless bodies in between.
Units are metres, radians and kilograms.
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
        centre: centre of mass (3,) [m], in body axes.
        inertia: moments of inertia about the centre of mass (3, 3) [kg m^2], in body
            axes.
    """

    name: str
    mass: float = 0.0
    centre: NDArray = field(default_factory=lambda: np.zeros(3))
    inertia: NDArray = field(default_factory=lambda: np.zeros((3, 3)))


@dataclass(frozen=True, eq=False)
class Joint:
    """Joint between a body and its parent, as described at the top of this module.

    Attributes:
        name: name, unique among joints.
        kind: ``"fixed"``, ``"revolute"``, ``"prismatic"`` or ``"helical"``.
        parent: name of the body that carries the joint.
        child: name of the body that the joint carries.
        placement: (4, 4) pose of the joint in the parent.
        axis: (3,) unit vector in the joint's axes.
        after: (4, 4) pose of the child in the joint's axes after its motion.
        position: [rad or m] coordinate at home.
        actuated: whether a drive holds the joint.
        limits: [rad or m] smallest and largest coordinate; None without limits.
        stiffness: [N m/rad or N/m] stiffness of a spring along the motion; 0 for none.
        rest: [rad or m] coordinate at which this spring has no load.
        lead: [m/rad] translation per angle of a helical joint; 0 for others.
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
    """Loop closure: two places on different bodies that coincide.

    Attributes:
        name: name of the loop.
        first: name of the first body.
        second: name of the second body.
        at_first: (4, 4) pose of the place in the first body.
        at_second: (4, 4) pose of the place in the second body.
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
        joints: joints, sorted such that parents come first.
        loops: pairs of places that coincide.
        platform: name of a body; None if the file names none.
        left_out: descriptions of parts of the file that a mechanism cannot represent.
        taken: descriptions of assumptions where the file is incomplete.
        couplings: joints that follow others, sorted such that a leader's own coupling
            comes before its followers'.
        unweighed: names of bodies whose mass comes from meshes, which are not read.
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
        """(joints,) [rad or m] coordinates at home."""
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
                f"{file}: link {quoted(joint.child)}: found two joints with it "
                f"as child, {quoted(carried[joint.child].name)} and "
                f"{quoted(joint.name)}; expected one, and the other declared as "
                "a loop"
            )
        carried[joint.child] = joint
        below[joint.parent].append(joint)
    roots = [name for name in bodies if name not in carried]
    if len(roots) != 1:
        names = " and ".join(map(quoted, roots[:3])) or "none (a cycle of parents)"
        raise BadInput(
            f"{file}: found as root link {names}, expected exactly one link "
            "that is no child of a joint"
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
        mechanism: mechanism of n joints.
        coordinates: (n,) [rad or m] coordinates of all joints, in their order.

    Returns:
        (4, 4) pose relative to the root, by the body's name.
    """
    poses = {mechanism.root: np.eye(4)}
    for joint, q in zip(mechanism.joints, coordinates, strict=True):
        at = poses[joint.parent] @ joint.placement
        poses[joint.child] = at @ motion(joint, float(q)) @ joint.after
    return poses


def motion(joint: Joint, coordinate: float) -> NDArray:
    """Return the (4, 4) motion of a joint for a coordinate [rad or m]."""
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
        name: name of the joint, to which the name of each part is appended.
        parent: name of the parent body.
        child: name of the body that the joint carries.
        placement: (4, 4) pose of the joint in the parent.
        after: (4, 4) pose of the child in the axes of the last part after its motion.
        freedoms: name, kind and axis (3,) of each part.

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
    """Return a ball joint as three rotations, which are singular only far from home."""
    return [(f"r{axis}", "revolute", np.array(UNIT_VECTORS[axis])) for axis in turns]


def slides() -> list[tuple[str, str, NDArray]]:
    """Return the parts of a spatial translation: three prismatic joints."""
    return [(f"t{axis}", "prismatic", np.array(UNIT_VECTORS[axis])) for axis in "xyz"]
