"""Build the unstressed robot with open loops and geometric errors.

At each frame, three motions are applied in the order of the paper: the geometric error,
the deformation of the link, and the motion of the joint.  Rotation vector and
translation of an error are both in the frame's axes.  Passive joints without a spring
move freely about or along their z axis.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import BASE, BeamLink, Frame, MatrixLink, Robot
from forcefit.inputs.table import BadInput, quoted
from forcefit.stiffness.beam.sections import declared_section
from forcefit.validation.multibody.beams import beam_axes, beam_span, element_stiffness
from forcefit.validation.multibody.contact import joint_clearance
from forcefit.validation.multibody.exudyn_model import Model
from forcefit.validation.multibody.exudyn_parts import (
    Closure,
    Contact,
    Elastic,
    MeshBody,
    Place,
)
from forcefit.validation.multibody.exudyn_solids import add_mesh
from forcefit.validation.multibody.motion import inverse, matrix, placement, shifted


class PostureLike(Protocol):
    """Protocol with the properties of a posture that the simulation uses."""

    @property
    def robot(self) -> Robot:
        """The manipulator."""

    @property
    def coordinates(self) -> NDArray:
        """Joint coordinates that close the nominal loops, (n,) [rad or m]."""


@dataclass(frozen=True, eq=False)
class Case:
    """Description of the model to build.

    Attributes:
        posture: the robot and its joint coordinates.
        scale: factor by which geometric errors and clearances are multiplied.
        springs: mapping from frame to K_E for links that are springs; see
            :func:`link_springs`.
        meshes: mapping from frame to meshed body for links that are solids.
        elements: number of elements of each beam.  Links that are neither springs nor
            solids are beams.
        clearances: whether joints have their clearances.
        bushes: whether pins are in two bushes.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.
        couple: (3,) [N m] additional couple of dead forces on the platform, base axes.
    """

    posture: PostureLike
    scale: float
    springs: Mapping[str, NDArray]
    meshes: Mapping[str, MeshBody]
    elements: int
    clearances: bool
    bushes: bool
    load: NDArray
    gravity: NDArray
    couple: NDArray


def link_springs(
    robot: Robot,
    links: str,
    given: Mapping[str, NDArray],
    meshes: Mapping[str, MeshBody],
) -> dict[str, NDArray]:
    """Return the stiffness of the links that are neither beams nor solids.

    Args:
        robot: robot of the simulation.
        links: ``"beam"`` or ``"spring"``.
        given: mapping from frame to K_E (6, 6) [N m/rad .. N/m] for links without K_E
            in the robot.
        meshes: mapping from frame to solid.

    Returns:
        Mapping from frame to K_E.

    Raises:
        BadInput: a stiffness is missing.
    """
    springs = {}
    for frame in robot.frames:
        link = frame.link
        beam = isinstance(link, BeamLink) and links == "beam"
        if link is None or beam or frame.name in meshes:
            continue
        if isinstance(link, MatrixLink):
            springs[frame.name] = given.get(frame.name, link.stiffness)
        elif frame.name in given:
            springs[frame.name] = given[frame.name]
        else:
            raise BadInput(
                f"simulate_assembly: the link of frame '{frame.name}' is simulated "
                "as a spring; expected its 6 by 6 matrix in `stiffness`"
            )
    return springs


@dataclass(frozen=True, eq=False)
class OpenTree:
    """Body frames, springs and closures of a complete model.

    The keys of each mapping are names of frames.

    Attributes:
        platform: (4, 4) nominal pose of the platform in the base frame.
        bodies: body frame of each robot frame, before clearance and joint spring.
        before: body frame of each robot frame, before the motion of its joint.
        links: elastic links.
        joints: joint springs.
        idle: weak springs of free motions.
        contacts: joints with clearance.
        closures: closures in the order of the robot.
    """

    platform: NDArray
    bodies: dict[str, Place] = field(default_factory=dict)
    before: dict[str, Place] = field(default_factory=dict)
    links: dict[str, Elastic] = field(default_factory=dict)
    joints: dict[str, Elastic] = field(default_factory=dict)
    idle: dict[str, Elastic] = field(default_factory=dict)
    contacts: dict[str, Contact] = field(default_factory=dict)
    closures: list[Closure] = field(default_factory=list)


def build(model: Model, case: Case) -> OpenTree:
    """Build the unstressed open robot with its errors, closures and loads.

    Args:
        model: empty model.
        case: description of the robot and its loads.

    Returns:
        The body frames, springs and closures of the model.

    Raises:
        BadInput: the robot contains a helical joint.
    """
    posture, robot = case.posture, case.posture.robot
    refuse_helical(robot)
    nominal = _nominal(posture)
    tree = OpenTree(platform=nominal[robot.platform])
    after = {BASE: model.ground}
    for frame, q in zip(robot.frames, posture.coordinates, strict=True):
        place = _add_frame(model, case, frame, after[frame.parent], tree)
        after[frame.name] = place.moved(_own_motion(frame, q))
    for a, b in robot.closures:
        # Closure errors due to rounded numbers in a robot file are not geometric
        # errors.
        closed = inverse(nominal[a]) @ nominal[b]
        closure = model.add_closure(tree.before[a], tree.before[b], closed)
        tree.closures.append(closure)
    if case.load.any():
        model.add_load(tree.before[robot.platform], case.load)
    if case.couple.any():
        _add_couple(model, tree.before[robot.platform], tree.platform, case.couple)
    if case.gravity.any():
        _add_weights(model, robot, tree, case.gravity)
    return tree


def refuse_helical(robot: Robot) -> None:
    """Raise BadInput if a robot contains a helical joint."""
    for frame in robot.frames:
        if frame.pitch:
            raise BadInput(
                f"{robot.name}: frame {quoted(frame.name)}: found a helical joint, "
                "expected revolute, prismatic and fixed joints for a simulation"
            )


def _add_frame(
    model: Model, case: Case, frame: Frame, parent: Place, tree: OpenTree
) -> Place:
    """Add body, link and joint of a frame, and return the frame before the joint."""
    error = case.scale * frame.geometric_error
    place = parent.moved(placement(frame.rotation, frame.translation))
    place = place.moved(placement(error[:3], error[3:]))
    if frame.name in case.meshes:
        tree.links[frame.name] = add_mesh(model, place, case.meshes[frame.name])
        place = tree.links[frame.name].far
    elif frame.name in case.springs:
        tree.links[frame.name] = model.add_spring(place, case.springs[frame.name])
        place = tree.links[frame.name].far
    elif isinstance(frame.link, BeamLink):
        tree.links[frame.name] = _add_beam(model, place, frame, case.elements)
        place = tree.links[frame.name].far
    tree.bodies[frame.name] = place
    clearance = joint_clearance(frame, case.scale, case.bushes)
    if case.clearances and (clearance.cones or (clearance.free and not frame.passive)):
        tree.contacts[frame.name] = model.add_contact(place, clearance)
        place = tree.contacts[frame.name].far
    K = frame.springs
    if K is not None and np.isfinite(np.diag(K)).any():
        tree.joints[frame.name] = model.add_spring(place, K)
        place = tree.joints[frame.name].far
    if frame.passive and not frame.compliant and frame.name not in tree.contacts:
        tree.idle[frame.name] = model.add_idle(place, frame.own_axis)
        place = tree.idle[frame.name].far
    if case.scale * frame.drive_force:
        force = np.zeros(6)
        force[frame.own_axis] = case.scale * frame.drive_force
        model.add_following_load(place, force)
        model.add_following_load(tree.bodies[frame.name], -force)
    tree.before[frame.name] = place
    return place


def _nominal(posture: PostureLike) -> dict[str, NDArray]:
    """Return nominal poses (4, 4) of the frames, before the motion of their joints."""
    T: dict[str, NDArray] = {}
    after = {BASE: np.eye(4)}
    for frame, q in zip(posture.robot.frames, posture.coordinates, strict=True):
        own = placement(frame.rotation, frame.translation)
        T[frame.name] = after[frame.parent] @ own
        after[frame.name] = T[frame.name] @ _own_motion(frame, q)
    return T


def _own_motion(frame: Frame, q: float) -> NDArray:
    """Return the motion (4, 4) of the joint about or along its z axis."""
    if frame.joint == "prismatic":
        return shifted([0.0, 0.0, q])
    return placement([0.0, 0.0, q if frame.joint == "revolute" else 0.0], np.zeros(3))


def _add_beam(model: Model, place: Place, frame: Frame, elements: int) -> Elastic:
    """Add a straight beam that ends at a body frame."""
    link = frame.link
    assert isinstance(link, BeamLink)
    length, x = beam_span(frame, link)
    axes = matrix(beam_axes(x, link.up), np.zeros(3))
    base = place.moved(axes @ shifted([-length, 0.0, 0.0]))
    K = element_stiffness(link, length / elements)
    section = declared_section(link.section, link.poisson)
    sizes = np.array([section.area, section.I_y, section.I_z])
    inertia = (link.density or 0.0) * sizes
    parts, nodes = model.add_beam(base, length, K, elements, inertia)
    return Elastic(place, nodes[-1].moved(inverse(axes)), parts, True, nodes)


def _add_couple(model: Model, place: Place, nominal: NDArray, couple: NDArray) -> None:
    """Add a couple m as a pair of forces m x axis / 2 on 1 m arms for each axis."""
    for axis, arm in zip(nominal[:3, :3].T, np.eye(3), strict=True):
        force = np.cross(couple, axis) / 2
        model.add_force(place.moved(shifted(arm)), force)
        model.add_force(place, -force)


def _add_weights(model: Model, robot: Robot, tree: OpenTree, gravity: NDArray) -> None:
    """Add the weights of all masses.

    The weight of a beam acts at its nodes, with the end moments of a clamped beam under
    uniform load.  The tip deflection of a cantilever is then exact for any number of
    nodes.  Each moment is a pair of forces of constant direction on arms that rotate
    with the node, so the moments have a potential.
    """
    for frame in robot.frames:
        if frame.mass:
            centre = tree.bodies[frame.name].moved(shifted(frame.centre_of_mass))
            model.add_force(centre, frame.mass * gravity)
        link = frame.link
        if not isinstance(link, BeamLink) or link.density is None:
            continue
        length, x = beam_span(frame, link)
        line = x / np.linalg.norm(x) * length
        part = tree.links[frame.name]
        nodes = part.nodes or (part.near.moved(shifted(-line)), part.far)
        step = tree.bodies[frame.name].built[:3, :3] @ line / (len(nodes) - 1)
        section = declared_section(link.section, link.poisson)
        weight = link.density * section.area * length * gravity / (len(nodes) - 1)
        for node in nodes[1:-1]:
            model.add_force(node, weight)
        for node, sign in ((nodes[0], 1.0), (nodes[-1], -1.0)):
            arm = shifted(node.built[:3, :3].T @ step)
            model.add_force(node, weight * (1 / 2 - sign / 12))
            model.add_force(node.moved(arm), weight * sign / 12)
