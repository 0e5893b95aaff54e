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
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from assembly.robot import BASE, BeamLink, Frame, MatrixLink, Robot
from stiffness.beam import Section, rectangular_section, round_section
from stiffness.reading import BadInput
from validation.motion import (
    exponential,
    inverse,
    logarithm,
    matrix,
    placement,
    shifted,
    turn_of,
    turned,
)

LINKS = ("beam", "spring")
_SWAP = np.r_[3:6, 0:3]  # our [R T] <-> Exudyn's [T R]
_CLOSING = np.diag([1e10] * 6)  # [N m/rad, N/m] of the connectors that shut closures
_IDLE = 1e-6  # [N m/rad, N/m] holds passive joints that nothing else holds
_SHUT = 1e-12  # [rad, m] largest component a closure may keep open
_LOAD_STEPS = 4
_CLOSING_STEPS = 30
_NEWTON_TOLERANCE = 1e-10  # [m, -] of the last increment; convergence is quadratic


class SimulationFailed(RuntimeError):
    """No equilibrium was found.

    Attributes:
        robot: name of the robot.
        status: what happened, in a few words.
    """

    def __init__(self, robot: str, status: str) -> None:
        super().__init__(f"{robot}: the multibody simulation failed: {status}")
        self.robot = robot
        self.status = status


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
        closure_wrenches: (closures, 6) [N m, N] what each closure's second chain
            exerts on its first, at the platform's nominal origin, base axes.
        transforms: (n, 4, 4) frames seen from the base, before their own motion.
        gap: [rad, m] largest component left open in a closure.
        idle_energy: [J] in the springs that hold free motions; a check, nearly zero.
        seconds: [s] taken.
    """

    platform_screw: NDArray
    energy: float
    link_screws: NDArray
    link_wrenches: NDArray
    joint_screws: NDArray
    joint_wrenches: NDArray
    closure_wrenches: NDArray
    transforms: NDArray
    gap: float
    idle_energy: float
    seconds: float


def simulate_assembly(
    posture: Placed,
    scale: float = 1.0,
    links: str = "beam",
    stiffness: Mapping[str, ArrayLike] | None = None,
    load: ArrayLike | None = None,
    elements: int = 4,
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
        elements: beam elements per link.

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
    springs = _link_springs(posture.robot, links, given)
    model = _Model(posture.robot.name)
    try:
        tree = _build(model, posture, scale, springs, elements)
        if load is not None:
            wrench = np.asarray(load, dtype=float)
            model.add_load(tree.before[posture.robot.platform], wrench)
        model.solve(tree.closures)
        return _read(model, posture.robot, tree, started)
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
    robot: Robot, links: str, given: Mapping[str, NDArray]
) -> dict[str, NDArray]:
    """Stiffness of every link that is not to be a beam."""
    springs = {}
    for frame in robot.frames:
        link = frame.link
        if link is None or (isinstance(link, BeamLink) and links == "beam"):
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
class _Place:
    """A point and axes fixed to a body of the model.

    Attributes:
        body: Exudyn's number of the body.
        start: (4, 4) where the body is built, seen from the base.
        local: (4, 4) the place seen from the body.
    """

    body: int
    start: NDArray
    local: NDArray

    @property
    def built(self) -> NDArray:
        """(4, 4) where the place is built, seen from the base."""
        return self.start @ self.local

    def moved(self, T: NDArray) -> "_Place":
        """Another place on the same body; ``T`` is how this one sees it."""
        return replace(self, local=self.local @ T)


@dataclass(frozen=True, eq=False)
class _Elastic:
    """An elastic part between two places that coincide when it is stress-free.

    Attributes:
        near: place on the inner body.
        far: place on the outer body.
        parts: Exudyn's numbers, of one connector or of the elements of a beam.
        beam: which of the two.
    """

    near: _Place
    far: _Place
    parts: tuple[int, ...]
    beam: bool = False


@dataclass(frozen=True, eq=False)
class _Closure:
    """Two places that a connector pulls together.

    Attributes:
        first: place on the first chain.
        second: place on the second chain.
        marker: Exudyn's number of the connector's end on the first chain; it is moved.
        connector: Exudyn's number of the connector.
        shut: (4, 4) the second place seen from the first when closed, nominally.
    """

    first: _Place
    second: _Place
    marker: int
    connector: int
    shut: NDArray


@dataclass(frozen=True, eq=False)
class _Tree:
    """What was built.

    Attributes:
        before: places of the frames before their own motion.
        links: elastic bodies by frame.
        joints: joint springs by frame.
        idle: the springs of free motions.
        closures: in the robot's order.
        platform: (4, 4) nominal platform, seen from the base.
    """

    before: dict[str, _Place]
    links: dict[str, _Elastic]
    joints: dict[str, _Elastic]
    idle: list[_Elastic]
    closures: list[_Closure]
    platform: NDArray


def _build(
    model: "_Model",
    posture: Placed,
    scale: float,
    springs: Mapping[str, NDArray],
    elements: int,
) -> _Tree:
    """The open, stress-free robot with its errors, and its closures."""
    robot = posture.robot
    before: dict[str, _Place] = {}
    after = {BASE: model.ground}
    links: dict[str, _Elastic] = {}
    joints: dict[str, _Elastic] = {}
    idle: list[_Elastic] = []
    for frame, q in zip(robot.frames, posture.coordinates, strict=True):
        error = scale * frame.geometric_error
        place = after[frame.parent].moved(placement(frame.rotation, frame.translation))
        place = place.moved(placement(error[:3], error[3:]))
        if frame.name in springs:
            links[frame.name] = model.add_spring(place, springs[frame.name])
            place = links[frame.name].far
        elif isinstance(frame.link, BeamLink):
            links[frame.name] = _add_beam(model, place, frame, frame.link, elements)
            place = links[frame.name].far
        K = frame.joint_stiffness
        if K is not None and np.isfinite(np.diag(K)).any():
            joints[frame.name] = model.add_spring(place, K)
            place = joints[frame.name].far
        elif frame.passive:
            axes = np.arange(6) == frame.own_axis
            idle.append(model.add_spring(place, np.diag(np.where(axes, _IDLE, np.inf))))
            place = idle[-1].far
        before[frame.name] = place
        after[frame.name] = place.moved(_own_motion(frame, q))
    nominal = _nominal(posture)
    closures = []
    for a, b in robot.closures:
        shut = inverse(nominal[a]) @ nominal[b]  # what rounded files leave is no error
        closures.append(model.add_closure(before[a], before[b], shut))
    return _Tree(before, links, joints, idle, closures, nominal[robot.platform])


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


def _add_beam(
    model: "_Model", place: _Place, frame: Frame, link: BeamLink, elements: int
) -> _Elastic:
    """A straight beam, clamped to the place's body so that it ends at the place."""
    if link.length is not None and link.axis is not None:
        length, x = link.length, np.array(link.axis)
    else:
        x = turned(frame.rotation).T @ frame.translation
        length = float(np.linalg.norm(x))
    axes = matrix(_section_axes(x, link.up), np.zeros(3))
    base = place.moved(axes @ shifted([-length, 0.0, 0.0]))
    K = _section_stiffness(link, length / elements)
    parts, tip = model.add_beam(base, length, K, elements)
    return _Elastic(place, tip.moved(inverse(axes)), parts, beam=True)


def _section_axes(x: NDArray, up: Sequence[float] | None) -> NDArray:
    """Columns: along the beam, across, up; up is y unless the beam lies along y."""
    x = x / np.linalg.norm(x)
    if up is None:
        up = (0.0, 0.0, 1.0) if math.hypot(x[0], x[2]) < 1e-9 else (0.0, 1.0, 0.0)
    y = np.cross(up, x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def _section_stiffness(link: BeamLink, step: float) -> NDArray:
    """EA, GA_y, GA_z, GJ, EI_y, EI_z for elements of a length, corrected.

    An element of constant strain lacks the deflection step^3 / 12 EI of its own
    bending; given to its shear, the tip of a cantilever is exact for any number.

    Args:
        link: the beam.
        step: [m] length of an element.

    Returns:
        (6, 6) diagonal [N, N m^2].
    """
    section = _section(link)
    E, G = link.young, link.young / (2 * (1 + link.poisson))
    bending = E * np.array([section.I_y, section.I_z])
    shear = step**2 / (12 * bending[::-1])  # a force along y bends about z
    if link.theory == "timoshenko":
        shares = np.array([section.shear_y, section.shear_z])
        shear = shear + 1 / (G * section.area * shares)
    return np.diag([E * section.area, *(1 / shear), G * section.J, *bending])


def _section(link: BeamLink) -> Section:
    """The section of a beam from its declared numbers."""
    given = link.section
    if "radius" in given:
        inner = given.get("inner_radius", 0.0)
        return round_section(given["radius"], link.poisson, inner)
    if "width" in given:
        return rectangular_section(given["width"], given["height"], link.poisson)
    return Section(**given)


def _read(
    model: "_Model", robot: Robot, tree: _Tree, started: float
) -> MultibodyAssembly:
    """Everything asked of the equilibrium."""
    count = len(robot.frames)
    screws = {"links": np.zeros((count, 6)), "joints": np.zeros((count, 6))}
    wrenches = {"links": np.zeros((count, 6)), "joints": np.zeros((count, 6))}
    for kind, parts in (("links", tree.links), ("joints", tree.joints)):
        for name, part in parts.items():
            row = robot.index(name)
            relative = inverse(model.pose(part.near)) @ model.pose(part.far)
            screws[kind][row] = logarithm(relative)
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
        link_screws=screws["links"],
        link_wrenches=wrenches["links"],
        joint_screws=screws["joints"],
        joint_wrenches=wrenches["joints"],
        closure_wrenches=np.reshape(
            [model.closure_wrench(c, origin) for c in tree.closures], (-1, 6)
        ),
        transforms=transforms,
        gap=model.largest_gap(tree.closures),
        idle_energy=sum(model.energy(part) for part in tree.idle),
        seconds=time.perf_counter() - started,
    )


class _Model:
    """An Exudyn model: what it is built of, how it is solved, what can be read."""

    def __init__(self, robot: str) -> None:
        self.exu, self.item = _import_exudyn()
        self.robot = robot
        self.container = self.exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        ground = self.mbs.AddObject(self.item.ObjectGround())
        self.ground = _Place(int(ground), np.eye(4), np.eye(4))

    def discard(self) -> None:
        """Give the memory back; Exudyn keeps models and user functions otherwise."""
        self.mbs.SetPreStepUserFunction(0)
        self.mbs.Reset()
        self.container.Reset()

    def add_body(self, T: NDArray) -> _Place:
        """A rigid body built at ``T``; statics never sees its mass."""
        x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
        node = self.item.NodeRigidBodyEP(referenceCoordinates=[*T[:3, 3], w, x, y, z])
        body = self.item.ObjectRigidBody(
            mass=1.0, inertia=[1, 1, 1, 0, 0, 0], nodeNumber=self.mbs.AddNode(node)
        )
        return _Place(int(self.mbs.AddObject(body)), T, np.eye(4))

    def add_marker(self, place: _Place) -> int:
        """A marker at a place."""
        marker = self.item.MarkerBodyRigid(
            bodyNumber=place.body, localHT=self._transform(place.local)
        )
        return int(self.mbs.AddMarker(marker))

    def add_spring(self, place: _Place, K: NDArray) -> _Elastic:
        """A new body at the place, held there by a spring; ``inf`` locks an axis."""
        far = self.add_body(place.built)
        markers = [self.add_marker(place), self.add_marker(far)]
        soft = np.isfinite(np.diag(K))
        if not soft.all():
            lock = [int(locked) for locked in ~soft[_SWAP]]
            joint = self.item.GenericJoint(markerNumbers=markers, constrainedAxes=lock)
            self.mbs.AddObject(joint)
        spring = self._connect(markers, np.where(np.outer(soft, soft), K, 0.0))
        return _Elastic(place, far, (spring,))

    def add_beam(
        self, base: _Place, length: float, K: NDArray, elements: int
    ) -> tuple[tuple[int, ...], _Place]:
        """Elements along the base's x, clamped there, and the place at their end."""
        section = self.exu.BeamSection()
        section.stiffnessMatrix = K
        step = length / elements
        bodies = [self.add_spring(base, np.diag([np.inf] * 6)).far]
        parts = []
        for k in range(1, elements + 1):
            bodies.append(self.add_body(base.built @ shifted([k * step, 0.0, 0.0])))
            beam = self.item.ObjectBeamGeometricallyExact(
                nodeNumbers=[self._node(body) for body in bodies[-2:]],
                length=step,
                sectionData=section,
            )
            parts.append(int(self.mbs.AddObject(beam)))
        return tuple(parts), bodies[-1]

    def add_closure(self, first: _Place, second: _Place, shut: NDArray) -> _Closure:
        """A connector that is stress-free while the closure is open."""
        gap = inverse(first.built) @ second.built
        marker = self.add_marker(first.moved(gap))
        connector = self._connect([marker, self.add_marker(second)], _CLOSING)
        return _Closure(first, second, marker, connector, shut)

    def add_load(self, place: _Place, wrench: NDArray) -> None:
        """A wrench at a place, base axes, whose direction stays."""
        marker = self.add_marker(place)
        torque, force = self.item.LoadTorqueVector, self.item.LoadForceVector
        for kind, vector in ((torque, wrench[:3]), (force, wrench[3:])):
            self.mbs.AddLoad(kind(markerNumber=marker, loadVector=vector.tolist()))

    def solve(self, closures: list[_Closure]) -> None:
        """Pull the closures shut in steps, then shift their targets until they are."""
        opened = [logarithm(inverse(c.shut) @ self._gap(c)) for c in closures]
        extra = [np.zeros(6) for _ in closures]

        def pull(mbs: Any, t: float) -> bool:
            for closure, screw, more in zip(closures, opened, extra, strict=True):
                still = exponential(max(0.0, 1.0 - t) * screw) @ exponential(more)
                local = closure.first.local @ closure.shut @ still
                mbs.SetMarkerParameter(
                    closure.marker, "localHT", self._transform(local)
                )
            return True

        self.mbs.SetPreStepUserFunction(pull)
        self.mbs.Assemble()
        self._equilibrate(0.0, _LOAD_STEPS)
        for _ in range(_CLOSING_STEPS):
            if self.largest_gap(closures) <= _SHUT:
                return
            for closure, more in zip(closures, extra, strict=True):
                more -= self._left_open(closure)
            self._equilibrate(1.0, 1)
        raise SimulationFailed(
            self.robot,
            f"a closure stays open by {self.largest_gap(closures):.2g} rad or m: rigid "
            "parts do not fit",
        )

    def _equilibrate(self, start: float, steps: int) -> None:
        """Exudyn's static solver, from the last state, over one unit of its time."""
        settings = self.exu.SimulationSettings()
        settings.linearSolver.solverType = self.exu.LinearSolverType.EigenSparse
        settings.solution.file.write = False
        static = settings.staticSolver
        static.verboseMode = 0
        static.numberOfLoadSteps = steps
        static.loadStepStart = start
        static.useLoadFactor = start == 0.0  # loads grow as the closures shut
        static.minimumStepSize = 1e-3
        newton = static.newton
        newton.residualMode = 1  # of increments: residuals hide behind weak springs
        newton.absoluteTolerance = newton.relativeTolerance = _NEWTON_TOLERANCE
        newton.maxIterations = 25
        try:
            self.mbs.SolveStatic(settings, updateInitialValues=True)
        except self.exu.SolverError as error:
            raise SimulationFailed(self.robot, f"Exudyn: {error}") from None

    def largest_gap(self, closures: list[_Closure]) -> float:
        """[rad, m] largest component left open."""
        gaps = [np.abs(self._left_open(closure)).max() for closure in closures]
        return float(max(gaps, default=0.0))

    def _left_open(self, closure: _Closure) -> NDArray:
        """(6,) [rad, m] screw from the closed position to the present one."""
        first = self.pose(closure.first) @ closure.shut
        return logarithm(inverse(first) @ self.pose(closure.second))

    def pose(self, place: _Place) -> NDArray:
        """(4, 4) where a place is now, seen from the base."""
        read, kind = self.mbs.GetObjectOutputBody, self.exu.OutputVariableType
        R = np.reshape(read(place.body, kind.RotationMatrix), (3, 3))
        return matrix(R, read(place.body, kind.Position)) @ place.local

    def energy(self, part: _Elastic) -> float:
        """[J] stored in an elastic part."""
        kind = self.exu.OutputVariableType.PotentialEnergy
        mbs = self.mbs
        read = mbs.GetObjectOutputBody if part.beam else mbs.GetObjectOutput
        return float(sum(read(number, kind) for number in part.parts))

    def wrench(self, part: _Elastic) -> NDArray:
        """(6,) [N m, N] on the outer side, at the outer place, in its axes."""
        if not part.beam:
            return self._connector_wrench(part.parts[0])
        last = self.exu.ObjectIndex(part.parts[-1])
        force = self.mbs.ComputeItem(last, self.exu.ComputeItemType.ODE2LHS)[7:]
        total = self.exu.OutputVariableType.CoordinatesTotal
        a, b, c, d = self.mbs.GetNodeOutput(self._node(part.far), total)[3:7]
        # the forces of Euler parameters are G^T times the moment, and G G^T = 4
        G = 2 * np.array([[-b, a, -d, c], [-c, d, a, -b], [-d, -c, b, a]])
        R = self.pose(part.far)[:3, :3]
        return np.concatenate([R.T @ G @ force[3:] / 4, R.T @ force[:3]])

    def closure_wrench(self, closure: _Closure, point: NDArray) -> NDArray:
        """(6,) [N m, N] on the first chain, at a point of the base, base axes."""
        T = self.pose(closure.second)
        moment, force = (T[:3, :3] @ w for w in self._closing(closure))
        return np.concatenate([moment + np.cross(T[:3, 3] - point, force), force])

    def _closing(self, closure: _Closure) -> NDArray:
        """(2, 3) [N m], [N] of a closure's connector, in its axes."""
        return self._connector_wrench(closure.connector).reshape(2, 3)

    def _connector_wrench(self, number: int) -> NDArray:
        """(6,) [N m, N] K times the screw of its outer end."""
        kind, read = self.exu.OutputVariableType, self.mbs.GetObjectOutput
        return np.concatenate([
            read(number, kind.TorqueLocal),
            read(number, kind.ForceLocal),
        ])

    def _connect(self, markers: list[int], K: NDArray) -> int:
        """A 6 by 6 spring between two markers."""
        spring = self.item.RigidBodySpringDamper(
            markerNumbers=markers,
            stiffness=K[np.ix_(_SWAP, _SWAP)],
            useIntrinsicFormulation=True,
        )
        return int(self.mbs.AddObject(spring))

    def _gap(self, closure: _Closure) -> NDArray:
        """(4, 4) the second place seen from the first, as built."""
        return inverse(closure.first.built) @ closure.second.built

    def _node(self, place: _Place) -> Any:
        """Exudyn's node of a place's body."""
        return self.mbs.GetObjectParameter(place.body, "nodeNumber")

    def _transform(self, T: NDArray) -> Any:
        """Exudyn's own kind of transform."""
        return self.exu.HT(rotation=T[:3, :3], translation=T[:3, 3])


def _import_exudyn() -> tuple[Any, Any]:
    """Exudyn without windows and without a word on the console."""
    with contextlib.redirect_stdout(io.StringIO()):
        import exudyn
        from exudyn import itemInterface

    exudyn.special.userInterface.SuppressAll(True)
    exudyn.config.printToConsole = False
    return exudyn, itemInterface
