"""The forced assembly as a multibody simulation: an independent second opinion.

Every body is placed open and stress-free, with its full geometric error; the closures
are then pulled shut by force, and Exudyn finds the static equilibrium with finite
rotations.  Nothing but the robot's data and its joint coordinates is shared with the
virtual-joint model: placement, beams and equilibrium are found anew.

At a frame the body's error comes first, then the link's deformation, then the joint's,
as in the paper; rotation vector and translation of an error are both in the frame's
axes.  Joints are tight here: passive ones turn or slide freely along their own z.
A closure is shut by a connector whose target is shifted until nothing is left open, so
overconstrained rigid loops (parallelograms) are no special case.

Sources:
    Gerstmayr (2023), "Exudyn - a C++-based Python package for flexible multibody
    systems", for the solver; Sonneville, Cardona & Bruels (2014), "Geometrically exact
    beam finite element formulated on the special Euclidean group", for its beam.
"""

import contextlib
import io
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.robot import BASE, BeamLink, Frame, MatrixLink, Robot
from stiffness.beam import declared_section
from stiffness.reading import BadInput
from validation.beams import beam_axes, beam_span, element_stiffness
from validation.contact import joint_play
from validation.exudyn_model import (
    CLOSING,
    CLOSING_CONTACTS,
    Closure,
    Contact,
    Elastic,
    MeshBody,
    Model,
    Place,
)
from validation.exudyn_model import SimulationFailed as SimulationFailed
from validation.motion import (
    inverse,
    logarithm,
    matrix,
    placement,
    shifted,
    turn_of,
)

LINKS = ("beam", "spring")
_IDLE = 1e-6  # [N m/rad, N/m] holds passive joints that nothing else holds


class Placed(Protocol):
    """What is asked of a posture."""

    @property
    def robot(self) -> Robot:
        """The manipulator."""

    @property
    def coordinates(self) -> NDArray:
        """(n,) [rad or m] joint coordinates at which the nominal closures hold."""


@dataclass(frozen=True, eq=False)
class MultibodyAssembly:
    """A robot forced together, as the simulation found it.

    Rows are frames in the robot's order; screws and wrenches are at the frame, in its
    axes, zero where the frame has no such spring.

    Attributes:
        platform_screw: (6,) [rad, m] rotation vector of R_actual R_nominal^T and
            difference of the platform's origin, base axes.
        energy: [J] of all links and joint springs.
        link_screws: (n, 6) [rad, m] deformations: logarithm of the relative motion.
        link_wrenches: (n, 6) [N m, N] what acts on the link's tip from outside.
        joint_screws: (n, 6) [rad, m] deformations of the joint springs.
        joint_wrenches: (n, 6) [N m, N] what acts on their outer side.
        clearance_screws: (n, 6) [rad, m] play, and own motions of passive joints.
        closure_wrenches: (closures, 6) [N m, N] what each closure's second chain
            exerts on its first, at the platform's nominal origin, base axes.
        transforms: (n, 4, 4) frames seen from the base, before their own motion.
        gap: [rad, m] largest component left open in a closure.
        idle_energy: [J] in the springs that hold free motions; a check, nearly zero.
        contact_energy: [J] by which contacts yield.
        seconds: [s] taken.
    """

    platform_screw: NDArray
    energy: float
    link_screws: NDArray
    link_wrenches: NDArray
    joint_screws: NDArray
    joint_wrenches: NDArray
    clearance_screws: NDArray
    closure_wrenches: NDArray
    transforms: NDArray
    gap: float
    idle_energy: float
    contact_energy: float
    seconds: float

    @property
    def rigid_energy(self) -> float:
        """[J] energy that rigid contacts would leave, to first order of their yield."""
        return self.energy + 2 * self.contact_energy


def simulate_assembly(
    posture: Placed,
    scale: float = 1.0,
    links: str = "beam",
    stiffness: Mapping[str, ArrayLike] | None = None,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    elements: int = 4,
    clearances: bool = False,
    meshes: Mapping[str, MeshBody] | None = None,
) -> MultibodyAssembly:
    """Force a robot together in Exudyn.

    Args:
        posture: the robot and its joint coordinates; actuated joints are locked there.
        scale: factor on the robot's geometric errors.
        links: ``"beam"``: links with a section are geometrically exact beams, the
            others 6 by 6 springs; ``"spring"``: all of them are springs.
        stiffness: by frame, K_E (6, 6) [N m/rad .. N/m] at the frame, in its axes, of
            links that become springs and whose matrix the robot does not give.
        load: (6,) [N m, N] on the platform at its origin, base axes; its direction
            stays.
        gravity: (3,) [m/s^2] base axes: bodies with a mass and beams with a density
            weigh; other links, whose mass is not known, do not.
        elements: beam elements per link.
        clearances: whether joints play, scaled like the errors; tight otherwise.
        meshes: by frame, links that are solids of finite elements in a floating frame.

    Returns:
        The assembled robot.

    Raises:
        BadInput: an unknown kind of link, or a spring's stiffness is missing.
        SimulationFailed: no equilibrium was found.
    """
    if links not in LINKS:
        raise BadInput(f"simulate_assembly: links = {links!r}, expected one of {LINKS}")
    started = time.perf_counter()
    given = {name: np.asarray(K, dtype=float) for name, K in (stiffness or {}).items()}
    solids = dict(meshes or {})
    springs = _link_springs(posture.robot, links, given, solids)
    case = _Case(posture, scale, springs, elements, clearances, solids)
    *first, last = CLOSING_CONTACTS if clearances else CLOSING
    for closing in first:
        with contextlib.suppress(SimulationFailed):
            return _simulate(case, closing, load, gravity, started)
    return _simulate(case, last, load, gravity, started)


@dataclass(frozen=True, eq=False)
class _Case:
    """What is to be built; see :func:`simulate_assembly`."""

    posture: Placed
    scale: float
    springs: Mapping[str, NDArray]
    elements: int
    clearances: bool
    meshes: Mapping[str, MeshBody]


def _simulate(
    case: _Case,
    closing: float,
    load: ArrayLike | None,
    gravity: ArrayLike | None,
    started: float,
) -> MultibodyAssembly:
    """Build, load, solve, read, and give the memory back."""
    robot = case.posture.robot
    model = Model(*_import_exudyn(), robot.name, closing)
    try:
        tree = _build(model, case)
        if load is not None:
            wrench = np.asarray(load, dtype=float)
            model.add_load(tree.before[robot.platform], wrench)
        if gravity is not None:
            _weigh(model, robot, tree, np.asarray(gravity, dtype=float))
        model.solve(tree.closures, narrow=bool(tree.contacts))
        return _read(model, robot, tree, started)
    finally:
        model.discard()


def closing_sequence(
    posture: Placed, steps: int = 8, scale: float = 1.0, load: ArrayLike | None = None
) -> NDArray:
    """Where the frames are while the closures of a tight robot are pulled shut.

    Args:
        posture: as in :func:`simulate_assembly`; links with a section are beams, the
            others must be given by a matrix.
        steps: in which the closures are shut, at least 4.
        scale: factor on the geometric errors.
        load: (6,) [N m, N] on the platform, which grows meanwhile.

    Returns:
        (k, n, 4, 4) frames seen from the base: open and stress-free first, shut last;
        k is at least ``steps + 1``.

    Raises:
        BadInput: a link's stiffness is not known.
        SimulationFailed: no equilibrium was found.
    """
    robot = posture.robot
    springs = _link_springs(robot, "beam", {}, {})
    case = _Case(posture, scale, springs, elements=4, clearances=False, meshes={})
    model = Model(*_import_exudyn(), robot.name, CLOSING[-1])
    try:
        tree = _build(model, case)
        model.steps = steps
        model.watched = [tree.before[frame.name] for frame in robot.frames]
        if load is not None:
            wrench = np.asarray(load, dtype=float)
            model.add_load(tree.before[robot.platform], wrench)
        model.solve(tree.closures)
        return np.array(model.seen)
    finally:
        model.discard()


def without_clearance(robot: Robot) -> Robot:
    """The same robot with every joint tight, to compare with a simulation.

    Args:
        robot: any.

    Returns:
        A robot without play; its passive joints move along their z without bound.
    """
    frames = tuple(replace(frame, clearance=None) for frame in robot.frames)
    return replace(robot, frames=frames)


def _link_springs(
    robot: Robot,
    links: str,
    given: Mapping[str, NDArray],
    meshes: Mapping[str, MeshBody],
) -> dict[str, NDArray]:
    """Stiffness of every link that is to be neither a beam nor a mesh."""
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
                f"simulate_assembly: the link of frame '{frame.name}' is to be a "
                "spring, expected its 6 by 6 matrix in `stiffness`"
            )
    return springs


@dataclass(frozen=True, eq=False)
class _Tree:
    """What was built.

    Attributes:
        bodies: places of the frames on their bodies, before any play or joint spring.
        before: places of the frames before their own motion.
        links: elastic bodies by frame.
        joints: joint springs by frame.
        idle: the springs of free motions by frame.
        contacts: joints with play by frame.
        closures: in the robot's order.
        platform: (4, 4) nominal platform, seen from the base.
    """

    bodies: dict[str, Place]
    before: dict[str, Place]
    links: dict[str, Elastic]
    joints: dict[str, Elastic]
    idle: dict[str, Elastic]
    contacts: dict[str, Contact]
    closures: list[Closure]
    platform: NDArray


def _build(model: Model, case: _Case) -> _Tree:
    """The open, stress-free robot with its errors, and its closures."""
    posture, robot = case.posture, case.posture.robot
    bodies: dict[str, Place] = {}
    before: dict[str, Place] = {}
    after = {BASE: model.ground}
    links: dict[str, Elastic] = {}
    joints: dict[str, Elastic] = {}
    idle: dict[str, Elastic] = {}
    contacts: dict[str, Contact] = {}
    for frame, q in zip(robot.frames, posture.coordinates, strict=True):
        error = case.scale * frame.geometric_error
        place = after[frame.parent].moved(placement(frame.rotation, frame.translation))
        place = place.moved(placement(error[:3], error[3:]))
        if frame.name in case.meshes:
            links[frame.name] = model.add_mesh(place, case.meshes[frame.name])
            place = links[frame.name].far
        elif frame.name in case.springs:
            links[frame.name] = model.add_spring(place, case.springs[frame.name])
            place = links[frame.name].far
        elif isinstance(frame.link, BeamLink):
            links[frame.name] = _add_beam(model, place, frame, case.elements)
            place = links[frame.name].far
        bodies[frame.name] = place
        play = joint_play(frame, case.scale)
        if case.clearances and play.cones:
            contacts[frame.name] = model.add_contact(place, play)
            place = contacts[frame.name].far
        K = frame.joint_stiffness
        if K is not None and np.isfinite(np.diag(K)).any():
            joints[frame.name] = model.add_spring(place, K)
            place = joints[frame.name].far
        elif frame.passive and not frame.compliant and frame.name not in contacts:
            axes = np.arange(6) == frame.own_axis
            K = np.diag(np.where(axes, _IDLE, np.inf))
            idle[frame.name] = model.add_spring(place, K)
            place = idle[frame.name].far
        before[frame.name] = place
        after[frame.name] = place.moved(_own_motion(frame, q))
    nominal = _nominal(posture)
    closures = []
    for a, b in robot.closures:
        shut = inverse(nominal[a]) @ nominal[b]  # what rounded files leave is no error
        closures.append(model.add_closure(before[a], before[b], shut))
    platform = nominal[robot.platform]
    return _Tree(bodies, before, links, joints, idle, contacts, closures, platform)


def _nominal(posture: Placed) -> dict[str, NDArray]:
    """(4, 4) of every frame without imperfections, before its own motion."""
    T: dict[str, NDArray] = {}
    after = {BASE: np.eye(4)}
    for frame, q in zip(posture.robot.frames, posture.coordinates, strict=True):
        own = placement(frame.rotation, frame.translation)
        T[frame.name] = after[frame.parent] @ own
        after[frame.name] = T[frame.name] @ _own_motion(frame, q)
    return T


def _own_motion(frame: Frame, q: float) -> NDArray:
    """(4, 4) the joint's motion about or along z."""
    if frame.joint == "prismatic":
        return shifted([0.0, 0.0, q])
    return placement([0.0, 0.0, q if frame.joint == "revolute" else 0.0], np.zeros(3))


def _add_beam(model: Model, place: Place, frame: Frame, elements: int) -> Elastic:
    """A straight beam, clamped to the place's body so that it ends at the place."""
    link = frame.link
    assert isinstance(link, BeamLink)
    length, x = beam_span(frame, link)
    axes = matrix(beam_axes(x, link.up), np.zeros(3))
    base = place.moved(axes @ shifted([-length, 0.0, 0.0]))
    K = element_stiffness(link, length / elements)
    parts, nodes = model.add_beam(base, length, K, elements)
    return Elastic(place, nodes[-1].moved(inverse(axes)), parts, True, nodes)


def _weigh(model: Model, robot: Robot, tree: _Tree, gravity: NDArray) -> None:
    """Loads of everything that has a mass.

    A beam's weight acts at its nodes, with the moments at its ends of a clamped beam
    under uniform load: the tip of a cantilever is then exact for any number of nodes.
    """
    for frame in robot.frames:
        if frame.mass:
            centre = tree.bodies[frame.name].moved(shifted(frame.centre_of_mass))
            model.add_load(centre, np.concatenate([np.zeros(3), frame.mass * gravity]))
        link = frame.link
        if not isinstance(link, BeamLink) or link.density is None:
            continue
        length, x = beam_span(frame, link)
        line = x / np.linalg.norm(x) * length
        part = tree.links[frame.name]
        nodes = part.nodes or (part.near.moved(shifted(-line)), part.far)
        step = tree.bodies[frame.name].built[:3, :3] @ line / (len(nodes) - 1)
        section = declared_section(link.section, link.poisson)
        weight = link.density * section.area * length * gravity
        weight = weight / (len(nodes) - 1)
        moment = np.cross(step, weight) / 12
        for k, node in enumerate(nodes):
            first, last = k == 0, k == len(nodes) - 1
            force = weight * (0.5 if first or last else 1.0)
            couple = moment * (float(first) - float(last))
            model.add_load(node, np.concatenate([couple, force]))


def _read(model: Model, robot: Robot, tree: _Tree, started: float) -> MultibodyAssembly:
    """Everything asked of the equilibrium."""
    count = len(robot.frames)
    screws = {kind: np.zeros((count, 6)) for kind in ("link", "joint", "play")}
    wrenches = {kind: np.zeros((count, 6)) for kind in ("link", "joint")}
    kinds: tuple[tuple[str, Mapping[str, Elastic | Contact]], ...] = (
        ("link", tree.links),
        ("joint", tree.joints),
        ("play", tree.idle),
        ("play", tree.contacts),
    )
    for kind, parts in kinds:
        for name, part in parts.items():
            row = robot.index(name)
            relative = inverse(model.pose(part.near)) @ model.pose(part.far)
            screws[kind][row] = logarithm(relative)
            if kind in wrenches and isinstance(part, Elastic):
                wrenches[kind][row] = model.wrench(part)
    transforms = np.array([model.pose(tree.before[f.name]) for f in robot.frames])
    T = transforms[robot.index(robot.platform)]
    turn = turn_of(T[:3, :3] @ tree.platform[:3, :3].T)
    origin = tree.platform[:3, 3]
    return MultibodyAssembly(
        platform_screw=np.concatenate([turn, T[:3, 3] - origin]),
        energy=sum(
            model.energy(p) for p in (*tree.links.values(), *tree.joints.values())
        ),
        link_screws=screws["link"],
        link_wrenches=wrenches["link"],
        joint_screws=screws["joint"],
        joint_wrenches=wrenches["joint"],
        clearance_screws=screws["play"],
        closure_wrenches=np.reshape(
            [model.closure_wrench(c, origin) for c in tree.closures], (-1, 6)
        ),
        transforms=transforms,
        gap=model.largest_gap(tree.closures),
        idle_energy=sum(model.energy(part) for part in tree.idle.values()),
        contact_energy=sum(map(model.contact_energy, tree.contacts.values())),
        seconds=time.perf_counter() - started,
    )


def _import_exudyn() -> tuple[Any, Any, Any]:
    """Exudyn without windows and without a word on the console."""
    with contextlib.redirect_stdout(io.StringIO()):
        import exudyn
        from exudyn import FEM, itemInterface

    exudyn.special.userInterface.SuppressAll(True)
    exudyn.config.printToConsole = False
    return exudyn, itemInterface, FEM
