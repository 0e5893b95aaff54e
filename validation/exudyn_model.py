"""An Exudyn model: what it is built of, how it is solved, what is read from it.

Bodies are massless to the static solver; places are points and axes fixed to bodies;
elastic parts and locked joints stand between two places.  Exudyn orders screws and
wrenches [T R]; everything in and out of here is [R T] like in the whole library.
"""

from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import identity
from scipy.spatial.transform import Rotation

from validation.contact import NARROW, WIDE, Play, cone_energy, cone_push
from validation.motion import exponential, inverse, logarithm, matrix, shifted

_SWAP = np.r_[3:6, 0:3]  # our [R T] <-> Exudyn's [T R]
CLOSING = (1e10,)  # [N m/rad, N/m] of the connectors that shut closures, in turn
CLOSING_CONTACTS = (1e12, 1e11)  # the same beside contacts: hardly softer than these
_SHUT = 1e-12  # [rad, m] largest component a closure may keep open
_LOAD_STEPS = 4
_CLOSING_STEPS = 30
_STAGES = (
    "closures are pulled shut and loads grow",
    "contacts harden",
    "the last gaps are closed",
)
_NARROWING_STEPS = 30  # of the smoothing of contacts, geometrically
_CENTRING = 1e3  # [N/m] of bounded play; 1e-3 of it in N m/rad, 1e-6 about own axes
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


@dataclass(frozen=True, eq=False)
class Place:
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

    def moved(self, T: NDArray) -> "Place":
        """Another place on the same body; ``T`` is how this one sees it."""
        return replace(self, local=self.local @ T)


@dataclass(frozen=True, eq=False)
class Elastic:
    """An elastic part between two places that coincide when it is stress-free.

    Attributes:
        near: place on the inner body.
        far: place on the outer body.
        parts: Exudyn's numbers, of one connector or of the elements of a beam.
        beam: which of the two.
        nodes: places along a beam, from base to tip, at equal distances.
        modes: of a meshed body, which is one part and no beam; None otherwise.
    """

    near: Place
    far: Place
    parts: tuple[int, ...]
    beam: bool = False
    nodes: tuple[Place, ...] = ()
    modes: "Modes | None" = None


@dataclass(frozen=True, eq=False)
class Solid:
    """A link as finite elements, with two rigid interfaces, in its mesh's axes.

    Attributes:
        nodes: (n, 3) [m].
        stiffness: (3n, 3n) [N/m] sparse; row 3 i + k is direction k of node i.
        base: (k,) nodes of the interface at the parent's side.
        tip: (m,) nodes of the interface at the frame's side.
        centers: (2, 3) [m] where base and tip are read.
    """

    nodes: NDArray
    stiffness: Any
    base: NDArray
    tip: NDArray
    centers: NDArray


@dataclass(frozen=True, eq=False)
class MeshBody:
    """A solid put where a robot has it.

    Attributes:
        solid: shared by all links of one shape; it is condensed once.
        turn: (3, 3) the mesh's axes seen from the frame's.
    """

    solid: Solid
    turn: NDArray


@dataclass(frozen=True, eq=False)
class Modes:
    """Interface modes of a meshed body, seen from its base.

    Attributes:
        node: Exudyn's number of the node of their coordinates.
        stiffness: (6, 6) reduced to the modes.
        wrench: (6, 6) from mode coordinates to the wrench at the tip, frame's axes.
    """

    node: int
    stiffness: NDArray
    wrench: NDArray


@dataclass(frozen=True, eq=False)
class Closure:
    """Two places that a connector pulls together.

    Attributes:
        first: place on the first chain.
        second: place on the second chain.
        marker: Exudyn's number of the connector's end on the first chain; it is moved.
        connector: Exudyn's number of the connector.
        shut: (4, 4) the second place seen from the first when closed, nominally.
    """

    first: Place
    second: Place
    marker: int
    connector: int
    shut: NDArray


@dataclass(frozen=True, eq=False)
class Contact:
    """A joint with play between two places.

    Attributes:
        near: place on the inner body.
        far: place on the outer body.
        play: how it may move.
    """

    near: Place
    far: Place
    play: Play


class Model:
    """An Exudyn model: what it is built of, how it is solved, what can be read."""

    def __init__(
        self, exudyn: Any, items: Any, fem: Any, robot: str, closing: float
    ) -> None:
        self.exu, self.item, self.fem = exudyn, items, fem
        self.robot, self.closing = robot, closing
        self.container = self.exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        ground = self.mbs.AddObject(self.item.ObjectGround())
        self.ground = Place(int(ground), np.eye(4), np.eye(4))
        self.width = WIDE  # [-] of the contacts' smoothing
        self.steps = 0  # in which closures are pulled shut, if more than needed
        self.watched: list[Place] = []  # places whose way from open to shut is kept
        self.seen: list[NDArray] = []

    def discard(self) -> None:
        """Give the memory back; Exudyn keeps models and user functions otherwise."""
        self.mbs.SetPreStepUserFunction(0)
        self.mbs.Reset()
        self.container.Reset()

    def add_body(self, T: NDArray) -> Place:
        """A rigid body built at ``T``; statics never sees its mass."""
        x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
        node = self.item.NodeRigidBodyEP(referenceCoordinates=[*T[:3, 3], w, x, y, z])
        body = self.item.ObjectRigidBody(
            mass=1.0, inertia=[1, 1, 1, 0, 0, 0], nodeNumber=self.mbs.AddNode(node)
        )
        return Place(int(self.mbs.AddObject(body)), T, np.eye(4))

    def add_marker(self, place: Place) -> int:
        """A marker at a place."""
        marker = self.item.MarkerBodyRigid(
            bodyNumber=place.body, localHT=self._transform(place.local)
        )
        return int(self.mbs.AddMarker(marker))

    def add_spring(self, place: Place, K: NDArray) -> Elastic:
        """A new body at the place, held there by a spring; ``inf`` locks an axis."""
        far = self.add_body(place.built)
        markers = [self.add_marker(place), self.add_marker(far)]
        soft = np.isfinite(np.diag(K))
        if not soft.all():
            lock = [int(locked) for locked in ~soft[_SWAP]]
            joint = self.item.GenericJoint(markerNumbers=markers, constrainedAxes=lock)
            self.mbs.AddObject(joint)
        spring = self._connect(markers, np.where(np.outer(soft, soft), K, 0.0))
        return Elastic(place, far, (spring,))

    def add_contact(self, place: Place, play: Play) -> Contact:
        """A new body at the place that may play; a weak spring centres it."""
        rows = np.array(play.loose, dtype=int)
        centring = np.full(6, np.inf)
        centring[rows] = _CENTRING * np.where(rows < 3, 1e-3, 1.0)
        centring[2] *= 1e-3
        spring = self.add_spring(place, np.diag(centring))
        weak = np.where(np.isfinite(centring), centring, 0.0).tolist()

        def push(mbs: Any, t: float, item: int, shift: Any, turn: Any, *_: Any) -> Any:
            screw = [*turn, *shift]
            wrench = [k * s for k, s in zip(weak, screw, strict=True)]
            for cone in play.cones:
                offsets = [screw[row] for row in cone.rows]
                pushes = cone_push(cone, offsets, self.width)
                for row, value in zip(cone.rows, pushes, strict=True):
                    wrench[row] += value
            return wrench[3:] + wrench[:3]

        name = "springForceTorqueUserFunction"
        self.mbs.SetObjectParameter(spring.parts[0], name, push)
        return Contact(place, spring.far, play)

    def add_beam(
        self, base: Place, length: float, K: NDArray, elements: int
    ) -> tuple[tuple[int, ...], tuple[Place, ...]]:
        """Elements along the base's x, clamped there, and their ends."""
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
        return tuple(parts), tuple(bodies)

    def add_mesh(self, place: Place, body: MeshBody) -> Elastic:
        """A meshed body in its floating frame, clamped so that its tip is at the place.

        Its modes are the static ones of rigid interfaces (Hurty-Craig-Bampton), found
        by Exudyn from the full stiffness matrix.

        Args:
            place: where the frame is while the body is free of stress.
            body: the solid.

        Returns:
            The elastic part from the place to the tip.
        """
        solid = body.solid
        floating = _floating(self.fem, solid)
        origin = place.moved(matrix(body.turn, -body.turn @ solid.centers[1]))
        numbers = floating.AddObjectFFRFreducedOrder(
            self.mbs,
            positionRef=origin.built[:3, 3].tolist(),
            rotationMatrixRef=origin.built[:3, :3],
        )
        number = int(numbers["oFFRFreducedOrder"])
        base = origin.moved(shifted(solid.centers[0]))
        markers = [self._interface(number, solid, k) for k in range(2)]
        far = self.add_body(origin.moved(shifted(solid.centers[1])).built)
        for pair in (
            [self.add_marker(base), markers[0]],
            [markers[1], self.add_marker(far)],
        ):
            self.mbs.AddObject(self.item.GenericJoint(markerNumbers=pair))
        K = np.asarray(floating.stiffnessMatrixReduced)
        wrench = _tip_wrenches(body, np.asarray(floating.modeBasis), K)
        modes = Modes(int(numbers["nGenericODE2"]), K, wrench)
        tip = far.moved(matrix(body.turn.T, np.zeros(3)))
        return Elastic(place, tip, (number,), modes=modes)

    def _interface(self, number: int, solid: Solid, side: int) -> int:
        """A marker that moves with an interface, 0 the base and 1 the tip."""
        nodes = (solid.base, solid.tip)[side]
        arms = solid.nodes[nodes] - solid.centers[side]
        # weights whose mean is the centre: an offset would not turn with the nodes
        rows = np.vstack([np.ones(len(arms)), arms.T / np.abs(arms).max()])
        weights = np.linalg.lstsq(rows, np.array([1.0, 0.0, 0.0, 0.0]))[0]
        marker = self.item.MarkerSuperElementRigid(
            bodyNumber=number, meshNodeNumbers=nodes.tolist(), weightingFactors=weights
        )
        return int(self.mbs.AddMarker(marker))

    def add_closure(self, first: Place, second: Place, shut: NDArray) -> Closure:
        """A connector that is stress-free while the closure is open."""
        gap = inverse(first.built) @ second.built
        marker = self.add_marker(first.moved(gap))
        markers = [marker, self.add_marker(second)]
        connector = self._connect(markers, np.eye(6) * self.closing)
        return Closure(first, second, marker, connector, shut)

    def add_load(self, place: Place, wrench: NDArray) -> None:
        """A wrench at a place, base axes, whose direction stays."""
        marker = self.add_marker(place)
        torque, force = self.item.LoadTorqueVector, self.item.LoadForceVector
        for kind, vector in ((torque, wrench[:3]), (force, wrench[3:])):
            self.mbs.AddLoad(kind(markerNumber=marker, loadVector=vector.tolist()))

    def solve(self, closures: list[Closure], narrow: bool = False) -> None:
        """Pull the closures shut in steps, then shift their targets until they are.

        Args:
            closures: to be shut.
            narrow: whether there are contacts, whose smoothing is to shrink in between.

        Raises:
            SimulationFailed: no equilibrium was found.
        """
        opened = [logarithm(inverse(c.shut) @ self._gap(c)) for c in closures]
        shift = np.zeros((2, len(closures), 6))  # of the targets, at 2 times

        def pull(mbs: Any, t: float) -> bool:
            self._look()
            self.width = WIDE * (NARROW / WIDE) ** min(max(t - 1.0, 0.0), 1.0)
            way = min(max(t - 2.0, 0.0), 1.0)
            shifts = (1.0 - way) * shift[0] + way * shift[1]
            for closure, screw, more in zip(closures, opened, shifts, strict=True):
                target = exponential(max(0.0, 1.0 - t) * screw) @ exponential(more)
                local = self._transform(closure.first.local @ closure.shut @ target)
                mbs.SetMarkerParameter(closure.marker, "localHT", local)
            return True

        self.mbs.SetPreStepUserFunction(pull)
        self.mbs.Assemble()
        self._equilibrate(0.0, max(_LOAD_STEPS, self.steps))
        if narrow:
            self._equilibrate(1.0, _NARROWING_STEPS)
        for _ in range(_CLOSING_STEPS):
            if self.largest_gap(closures) <= _SHUT:
                self._look()
                return
            shift[0] = shift[1]
            shift[1] -= [self._left_open(closure) for closure in closures]
            self._equilibrate(2.0, 1)
        raise SimulationFailed(
            self.robot,
            f"a closure stays open by {self.largest_gap(closures):.2g} rad or m: rigid "
            "parts do not fit",
        )

    def _equilibrate(self, start: float, steps: int) -> None:
        """Exudyn's static solver, from the last state, over one unit of its time.

        Args:
            start: 0: closures are pulled shut and loads grow; 1: contacts harden; 2:
                the closures' targets are shifted.
            steps: to begin with; a step that fails is cut.

        Raises:
            SimulationFailed: the shortest step fails.
        """
        settings = self.exu.SimulationSettings()
        settings.linearSolver.solverType = self.exu.LinearSolverType.EigenSparse
        settings.solution.file.write = False
        static = settings.staticSolver
        static.verboseMode = 0
        static.numberOfLoadSteps = steps
        static.loadStepStart = start
        static.useLoadFactor = start == 0.0
        static.minimumStepSize = 1e-3
        newton = static.newton
        newton.residualMode = 1  # of increments: residuals hide behind weak springs
        newton.absoluteTolerance = newton.relativeTolerance = _NEWTON_TOLERANCE
        newton.maxIterations = 25
        newton.numericalDifferentiation.relativeEpsilon = 1e-8  # of user functions
        try:
            self.mbs.SolveStatic(settings, updateInitialValues=True)
        except self.exu.ExudynError as error:
            said = str(error).splitlines()[0]
            status = f"no equilibrium while {_STAGES[int(start)]} (Exudyn: {said})"
            raise SimulationFailed(self.robot, status) from None

    def _look(self) -> None:
        """Keep where the watched places are now."""
        if self.watched:
            self.seen.append(np.array([self.pose(place) for place in self.watched]))

    def largest_gap(self, closures: list[Closure]) -> float:
        """[rad, m] largest component left open."""
        gaps = [np.abs(self._left_open(closure)).max() for closure in closures]
        return float(max(gaps, default=0.0))

    def _left_open(self, closure: Closure) -> NDArray:
        """(6,) [rad, m] screw from the closed position to the present one."""
        first = self.pose(closure.first) @ closure.shut
        return logarithm(inverse(first) @ self.pose(closure.second))

    def pose(self, place: Place) -> NDArray:
        """(4, 4) where a place is now, seen from the base."""
        read, kind = self.mbs.GetObjectOutputBody, self.exu.OutputVariableType
        R = np.reshape(read(place.body, kind.RotationMatrix), (3, 3))
        return matrix(R, read(place.body, kind.Position)) @ place.local

    def energy(self, part: Elastic) -> float:
        """[J] stored in an elastic part."""
        if part.modes is not None:
            q = self._mode_coordinates(part.modes)
            return float(q @ part.modes.stiffness @ q) / 2
        kind = self.exu.OutputVariableType.PotentialEnergy
        mbs = self.mbs
        read = mbs.GetObjectOutputBody if part.beam else mbs.GetObjectOutput
        return float(sum(read(number, kind) for number in part.parts))

    def contact_energy(self, contact: Contact) -> float:
        """[J] by which the contact's bounds yield."""
        screw = logarithm(inverse(self.pose(contact.near)) @ self.pose(contact.far))
        return sum(
            cone_energy(cone, [float(screw[row]) for row in cone.rows], self.width)
            for cone in contact.play.cones
        )

    def wrench(self, part: Elastic) -> NDArray:
        """(6,) [N m, N] on the outer side, at the outer place, in its axes."""
        if part.modes is not None:
            near, far = (self.pose(p)[:3, :3] for p in (part.near, part.far))
            halves = part.modes.wrench @ self._mode_coordinates(part.modes)
            return np.concatenate([far.T @ near @ half for half in np.split(halves, 2)])
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

    def closure_wrench(self, closure: Closure, point: NDArray) -> NDArray:
        """(6,) [N m, N] on the first chain, at a point of the base, base axes."""
        T = self.pose(closure.second)
        moment, force = (T[:3, :3] @ w for w in self._closing(closure))
        return np.concatenate([moment + np.cross(T[:3, 3] - point, force), force])

    def _closing(self, closure: Closure) -> NDArray:
        """(2, 3) [N m], [N] of a closure's connector, in its axes."""
        return self._connector_wrench(closure.connector).reshape(2, 3)

    def _connector_wrench(self, number: int) -> NDArray:
        """(6,) [N m, N] K times the screw of its outer end."""
        kind, read = self.exu.OutputVariableType, self.mbs.GetObjectOutput
        return np.concatenate([
            read(number, kind.TorqueLocal),
            read(number, kind.ForceLocal),
        ])

    def _mode_coordinates(self, modes: Modes) -> NDArray:
        """(6,) of a meshed body."""
        kind = self.exu.OutputVariableType.Coordinates
        return np.array(self.mbs.GetNodeOutput(modes.node, kind))

    def _connect(self, markers: list[int], K: NDArray) -> int:
        """A 6 by 6 spring between two markers."""
        spring = self.item.RigidBodySpringDamper(
            markerNumbers=markers,
            stiffness=K[np.ix_(_SWAP, _SWAP)],
            useIntrinsicFormulation=True,
        )
        return int(self.mbs.AddObject(spring))

    def _gap(self, closure: Closure) -> NDArray:
        """(4, 4) the second place seen from the first, as built."""
        return inverse(closure.first.built) @ closure.second.built

    def _node(self, place: Place) -> Any:
        """Exudyn's node of a place's body."""
        return self.mbs.GetObjectParameter(place.body, "nodeNumber")

    def _transform(self, T: NDArray) -> Any:
        """Exudyn's own kind of transform."""
        return self.exu.HT(rotation=T[:3, :3], translation=T[:3, 3])


def _tip_wrenches(body: MeshBody, basis: NDArray, K: NDArray) -> NDArray:
    """(6, 6) wrench at the tip, frame's axes, of unit mode coordinates."""
    solid = body.solid
    arms = solid.nodes[solid.tip] - solid.centers[1]
    rigid = np.zeros((len(arms), 3, 6))
    for k in range(3):
        rigid[:, :, k] = np.cross(np.eye(3)[k], arms)
        rigid[:, k, 3 + k] = 1.0
    moved = basis.reshape(-1, 3, basis.shape[1])[solid.tip]
    screws = np.linalg.lstsq(rigid.reshape(-1, 6), moved.reshape(-1, 6))[0]
    turn = np.kron(np.eye(2), body.turn)
    return turn @ np.linalg.solve(screws.T, K)


_CONDENSED: WeakKeyDictionary[Solid, Any] = WeakKeyDictionary()


def _floating(fem: Any, solid: Solid) -> Any:
    """Exudyn's floating body of a solid, condensed at its first use."""
    if solid not in _CONDENSED:
        link = fem.FEMinterface()
        link.nodes = {"Position": solid.nodes}
        link.surface = [{"Name": "none", "Trigs": []}]
        link.stiffnessMatrix = solid.stiffness
        link.massMatrix = identity(3 * len(solid.nodes), format="csr")  # unused
        link.ComputeHurtyCraigBamptonModes(
            [solid.base.tolist(), solid.tip.tolist()],
            0,
            computationMode=fem.HCBstaticModeSelection.RBE2,
        )
        _CONDENSED[solid] = fem.ObjectFFRFreducedOrderInterface(link)
    return _CONDENSED[solid]
