"""Simulate the forced assembly as a multibody system, independently of the model.

In the open robot, every body is placed unstressed with its full geometric error.
Forces then close the loops, and Exudyn computes the static equilibrium with finite
rotations.  The simulation and the virtual-joint model share only the robot data and the
joint coordinates.

At each frame, three motions are applied in the order of the paper: the geometric error,
the deformation of the link, and the motion of the joint.  Rotation vector and
translation of an error are both in the frame's axes.  Without clearances, passive
joints move freely about or along their z axis.  A connector closes each loop.  The
target position of the connector is corrected until the closure error vanishes.

Sources:
    Gerstmayr (2023), "Exudyn - a C++-based Python package for flexible multibody
    systems", for the solver; Sonneville, Cardona & Bruels (2014), "Geometrically exact
    beam finite element formulated on the special Euclidean group", for its beam.
"""

import contextlib
import io
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.model.contact_closures import loops
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput
from forcefit.results.display import html_table, short_repr
from forcefit.validation.multibody.exudyn_model import (
    HOLDING_STIFFNESS,
    IDLE_STIFFNESS,
    Model,
    Regularisation,
)
from forcefit.validation.multibody.exudyn_parts import (
    Contact,
    Elastic,
    MeshBody,
    OutOfTime,
)
from forcefit.validation.multibody.exudyn_parts import (
    SimulationFailed as SimulationFailed,
)
from forcefit.validation.multibody.exudyn_reading import (
    closure_wrench,
    contact_energy,
    energy,
    pose,
    screw_between,
    wrench,
)
from forcefit.validation.multibody.exudyn_solver import (
    NO_EQUILIBRIUM,
    largest_gap,
    solve,
)
from forcefit.validation.multibody.exudyn_vibration import (
    natural_frequencies,
    set_masses,
)
from forcefit.validation.multibody.motion import shifted, turn_of
from forcefit.validation.multibody.open_robot import (
    Case,
    OpenTree,
    PostureLike,
    build,
    link_springs,
)

LINKS = ("beam", "spring")
# [s] Largest time of a simulation.
TIME_LIMIT = 600.0
_FINEST = 1e-10  # [m, rad, -] lower bound of the tolerance on the last Newton increment
# Regularisations in the order in which they are tried. The second regularisation
# prevents large rotations of a rod between two spherical joints about its axis.
_TIGHT = (
    Regularisation(1e10, IDLE_STIFFNESS),
    Regularisation(1e10, HOLDING_STIFFNESS),
)
# The position of a joint within its clearance depends on round-off if there is no
# contact. Softer contacts and more smoothing reduce this effect.  The connectors of
# closures must not be much more compliant than the contacts.
WITH_CLEARANCES = (
    Regularisation(1e12, IDLE_STIFFNESS),
    Regularisation(1e10, IDLE_STIFFNESS, contact=0.1),
    Regularisation(1e9, IDLE_STIFFNESS, narrow=5e-4, tolerance=1e-6),
    Regularisation(1e11, IDLE_STIFFNESS),
    Regularisation(1e11, HOLDING_STIFFNESS),
)


@dataclass(frozen=True, eq=False)
class SimulationModel:
    """Options of the simulation model of links and joints.

    Attributes:
        links: model of the links.  ``"beam"``: links with a cross-section are
            geometrically exact beams, and other links are 6 by 6 springs.
            ``"spring"``: all links are springs.
        stiffness: mapping from frame to K_E (6, 6) [N m/rad .. N/m], at the frame in
            its axes, for springs without a matrix in the robot.
        meshes: mapping from frame to meshed body for links that are solids of finite
            elements in a floating frame.
        elements: number of elements of each beam.
        clearances: whether joints have clearances, which are scaled like the errors.
        bushes: whether joints with radial clearance and tilt are pins in two bushes;
            see :func:`forcefit.validation.multibody.contact.joint_clearance`.
        hold: whether springs on free motions are added from the start. Otherwise, they
            are added only if no equilibrium is found.
    """

    links: str = "beam"
    stiffness: Mapping[str, ArrayLike] = field(default_factory=dict)
    meshes: Mapping[str, MeshBody] = field(default_factory=dict)
    elements: int = 4
    clearances: bool = False
    bushes: bool = False
    hold: bool = False

    def __post_init__(self) -> None:
        if self.links not in LINKS:
            raise BadInput(
                f"simulate_assembly: links = {self.links!r}, expected one of {LINKS}"
            )


_STANDARD = SimulationModel()
# Likely reason for a failure without loads, appended to the message.
_UNDETERMINED = (
    "; without a load, the position of an unloaded joint within its clearance is "
    "determined by round-off; expected a load that presses the joints against their "
    "bounds"
)


@dataclass(frozen=True, eq=False)
class MultibodyAssembly:
    """A robot assembled by the simulation.

    The first axis of arrays contains the frames in the order of the robot. Screws and
    wrenches are at each frame, in frame axes. They are zero for frames without the
    corresponding spring.

    Attributes:
        platform_screw: (6,) [rad, m] rotation vector of R_actual R_nominal^T, and
            displacement of the platform's origin, base axes.
        energy: [J] energy of all links and joint springs.
        link_screws: (n, 6) [rad, m] deformations of the links, as logarithms of
            motions.
        link_wrenches: (n, 6) [N m, N] wrenches on the tips of the links.
        joint_screws: (n, 6) [rad, m] deformations of the joint springs.
        joint_wrenches: (n, 6) [N m, N] wrenches on the outer ends of the joint springs.
        clearance_screws: (n, 6) [rad, m] motions of joints within clearances, and free
            motions of passive joints.
        closure_wrenches: (closures, 6) [N m, N] wrenches that the second chain of each
            closure exerts on the first, at the platform's nominal origin, base axes.
        transforms: (n, 4, 4) poses of the frames in the base frame, before the motion
            of their joints.
        gap: [rad, m] largest component of the closure errors.
        idle_energy: [J] energy of the weak springs on free motions, nearly zero.
        contact_energy: [J] energy of the elastic contacts.
        held: whether springs of 0.01 N m/rad or N/m act on free motions.  They are
            added if no equilibrium is found without them.
        seconds: [s] computing time.
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
    held: bool
    seconds: float

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def rigid_energy(self) -> float:
        """Energy [J] with rigid contacts, to first order in the contact compliance."""
        return self.energy + 2 * self.contact_energy


def simulate_assembly(
    posture: PostureLike,
    scale: float = 1.0,
    model: SimulationModel = _STANDARD,
    *,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    couple: ArrayLike | None = None,
    time_limit: float = TIME_LIMIT,
) -> MultibodyAssembly:
    """Simulate the forced assembly of a robot in Exudyn.

    Args:
        posture: the robot and its joint coordinates.  Actuated joints are locked.
        scale: factor by which the robot's geometric errors and drive forces are
            multiplied.
        model: options for links and joints.
        load: (6,) [N m, N] load of constant direction on the platform at its origin,
            base axes.
        gravity: (3,) [m/s^2] gravity in base axes.  Only bodies with a mass and beams
            with a density have weight.
        couple: (3,) [N m] additional couple on the platform, base axes.  The couple
            consists of forces of constant direction on arms that rotate with the
            platform, and therefore has a potential.
        time_limit: [s] time after which the simulation fails.

    Returns:
        The assembled robot.

    Raises:
        BadInput: the stiffness of a spring is missing.
        SimulationFailed: no equilibrium was found.
        OutOfTime: the time limit was reached.
    """
    started = time.monotonic()
    given = {name: np.asarray(K, dtype=float) for name, K in model.stiffness.items()}
    solids = dict(model.meshes)
    springs = link_springs(posture.robot, model.links, given, solids)
    case = Case(
        posture=posture,
        scale=scale,
        springs=springs,
        meshes=solids,
        elements=model.elements,
        clearances=model.clearances,
        bushes=model.bushes,
        load=_vector(load, 6),
        gravity=_vector(gravity, 3),
        couple=_vector(couple, 3),
    )
    *first, last = WITH_CLEARANCES if model.clearances else _TIGHT
    first = [] if model.hold else first
    for regularisation in first:
        try:
            return _simulate(case, regularisation, started, time_limit)
        except OutOfTime:
            raise
        except SimulationFailed:
            continue
    try:
        return _simulate(case, last, started, time_limit)
    except OutOfTime:
        raise
    except SimulationFailed as error:
        undetermined = model.clearances and not _is_loaded(case)
        if not (undetermined and error.status.startswith(NO_EQUILIBRIUM)):
            raise
        raise SimulationFailed(error.robot, error.status + _UNDETERMINED) from None


def _is_loaded(case: Case) -> bool:
    """Return whether loads, weights or forces of drives act on the robot."""
    given = case.load.any() or case.gravity.any() or case.couple.any()
    return bool(given or any(frame.drive_force for frame in case.posture.robot.frames))


def _vector(given: ArrayLike | None, size: int) -> NDArray:
    """Return a given vector (size,), or zeros if it is None."""
    return np.zeros(size) if given is None else np.asarray(given, dtype=float)


def _simulate(
    case: Case, regularisation: Regularisation, started: float, limit: float
) -> MultibodyAssembly:
    """Build and solve a model, read its results, and release its memory."""
    robot = case.posture.robot
    # The tolerance is proportional to the clearances, which are multiplied by the
    # scale.
    tolerance = max(regularisation.tolerance * min(case.scale, 1.0), _FINEST)
    regularisation = replace(regularisation, tolerance=tolerance)
    model = Model(*import_exudyn(), robot.name, regularisation)
    model.deadline = started + limit
    try:
        tree = build(model, case)
        solve(model, tree.closures, narrow=bool(tree.contacts))
        return _read(model, robot, tree, started)
    finally:
        model.discard()


def simulated_frequencies(
    posture: PostureLike, count: int = 6, elements: int = 8
) -> NDArray:
    """Return the natural frequencies of a robot in Exudyn at its nominal pose.

    Args:
        posture: the robot and its joint coordinates.  Drives are locked.  Links with a
            cross-section are beams with consistent masses.  Other links must have a
            stiffness matrix, and have no mass.
        count: largest number of frequencies.
        elements: number of elements of each beam.

    Returns:
        Frequencies, lowest first, (k,) [Hz].  Springs of 1e-6 N m/rad or N/m act on
        free motions.

    Raises:
        BadInput: the stiffness of a link is unknown.
    """
    robot = without_clearance(posture.robot)
    robot = robot.with_errors(np.zeros_like(robot.errors))
    posture = replace(posture, robot=robot)  # type: ignore[type-var]
    case = Case(
        posture=posture, scale=0.0, springs=link_springs(robot, "beam", {}, {}),
        meshes={}, elements=elements, clearances=False, bushes=False,
        load=np.zeros(6), gravity=np.zeros(3), couple=np.zeros(3),
    )  # fmt: skip
    # The unloaded robot is built with closed loops, so it is in equilibrium.
    model = Model(
        *import_exudyn(), robot.name, Regularisation(math.inf, IDLE_STIFFNESS)
    )
    model.deadline = time.monotonic() + TIME_LIMIT
    try:
        tree = build(model, case)
        bodies = [
            (tree.bodies[f.name].moved(shifted(f.centre_of_mass)), f.mass, f.inertia)
            for f in robot.frames
        ]
        model.mbs.Assemble()
        model.hold_idle(model.regularisation.idle)
        set_masses(model, bodies)
        return natural_frequencies(model)[:count]
    finally:
        model.discard()


def closing_sequence(
    posture: PostureLike,
    steps: int = 8,
    scale: float = 1.0,
    load: ArrayLike | None = None,
) -> NDArray:
    """Return the frame poses of a robot without clearances while its loops are closed.

    Args:
        posture: the robot and its joint coordinates.  Links with a cross-section are
            beams.  Other links must have a stiffness matrix.
        steps: number of steps for closing the loops, at least 4.
        scale: factor on the geometric errors.
        load: (6,) [N m, N] load on the platform, which increases while the loops are
            closed.

    Returns:
        Poses of the n frames in the base frame at k steps, (k, n, 4, 4), with k at
        least ``steps + 1``.  The robot is open and unstressed at the first step, and
        closed at the last.

    Raises:
        BadInput: the stiffness of a link is unknown.
        SimulationFailed: no equilibrium was found.
    """
    robot = posture.robot
    springs = link_springs(robot, "beam", {}, {})
    case = Case(
        posture=posture,
        scale=scale,
        springs=springs,
        meshes={},
        elements=4,
        clearances=False,
        bushes=False,
        load=_vector(load, 6),
        gravity=np.zeros(3),
        couple=np.zeros(3),
    )
    model = Model(*import_exudyn(), robot.name, _TIGHT[-1])
    model.deadline = time.monotonic() + TIME_LIMIT
    try:
        tree = build(model, case)
        model.recorded = [tree.before[frame.name] for frame in robot.frames]
        solve(model, tree.closures, steps=steps)
        return np.array(model.history)
    finally:
        model.discard()


def without_clearance(robot: Robot) -> Robot:
    """Return a robot without its clearances, for comparison with a simulation.

    Args:
        robot: robot with or without clearances.

    Returns:
        The robot without clearances.  Its passive joints move about or along their z
        axis without bounds.  Closures between parallel contacts are omitted, because
        they are rigid without clearance.
    """
    frames = tuple(replace(frame, clearance=None) for frame in robot.frames)
    return replace(robot, frames=frames, closures=loops(robot))


def _read(
    model: Model, robot: Robot, tree: OpenTree, started: float
) -> MultibodyAssembly:
    """Return the screws, wrenches and energies of the equilibrium."""
    count = len(robot.frames)
    screws = {kind: np.zeros((count, 6)) for kind in ("link", "joint", "clearance")}
    wrenches = {kind: np.zeros((count, 6)) for kind in ("link", "joint")}
    kinds: tuple[tuple[str, Mapping[str, Elastic | Contact]], ...] = (
        ("link", tree.links),
        ("joint", tree.joints),
        ("clearance", tree.idle),
        ("clearance", tree.contacts),
    )
    for kind, parts in kinds:
        for name, part in parts.items():
            row = robot.index(name)
            screws[kind][row] = screw_between(model, part)
            if kind in wrenches and isinstance(part, Elastic):
                wrenches[kind][row] = wrench(model, part)
    transforms = np.array([pose(model, tree.before[f.name]) for f in robot.frames])
    T = transforms[robot.index(robot.platform)]
    turn = turn_of(T[:3, :3] @ tree.platform[:3, :3].T)
    origin = tree.platform[:3, 3]
    closings = [closure_wrench(model, c, origin) for c in tree.closures]
    springs = (*tree.links.values(), *tree.joints.values())
    return MultibodyAssembly(
        platform_screw=np.concatenate([turn, T[:3, 3] - origin]),
        energy=sum(energy(model, part) for part in springs),
        link_screws=screws["link"],
        link_wrenches=wrenches["link"],
        joint_screws=screws["joint"],
        joint_wrenches=wrenches["joint"],
        clearance_screws=screws["clearance"],
        closure_wrenches=np.reshape(closings, (-1, 6)),
        transforms=transforms,
        gap=largest_gap(model, tree.closures),
        idle_energy=sum(energy(model, part) for part in tree.idle.values()),
        contact_energy=sum(contact_energy(model, c) for c in tree.contacts.values()),
        held=bool(model.idle) and model.regularisation.idle == HOLDING_STIFFNESS,
        seconds=time.monotonic() - started,
    )


def import_exudyn() -> tuple[Any, Any, Any]:
    """Import Exudyn without its windows and console output."""
    with contextlib.redirect_stdout(io.StringIO()):
        import exudyn
        from exudyn import FEM, itemInterface

    exudyn.special.userInterface.SuppressAll(True)
    exudyn.config.printToConsole = False
    return exudyn, itemInterface, FEM
