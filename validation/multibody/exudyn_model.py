"""Build an Exudyn model of bodies, springs, contacts, closures and loads.

Bodies are massless for the static solver.  A body frame (``Place``) is a coordinate
frame fixed to a body.  Elastic bodies and locked joints connect two body frames.
Screws and wrenches of this module are ordered [R T], although Exudyn orders them as
[T R].
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from forcefit.validation.multibody.conservative_springs import far_couple, middle_wrench
from forcefit.validation.multibody.contact import (
    NARROW,
    WIDE,
    JointClearance,
    cone_forces,
)
from forcefit.validation.multibody.exudyn_parts import Closure, Contact, Elastic, Place
from forcefit.validation.multibody.motion import inverse, shifted

_SWAP = np.r_[3:6, 0:3]  # swaps [R T] and Exudyn's order [T R]
IDLE_STIFFNESS = 1e-6  # [N m/rad, N/m] final stiffness of free motions
# [N m/rad, N/m] Stiffness of free motions while the loops are closed.
HOLDING_STIFFNESS = 1e-2
# [N/m] Stiffness of the springs that centre joints within their clearances.  The
# rotational stiffness [N m/rad] is 1e-3 times this value, and 1e-6 times about the
# joint axis.
_CENTRING = 1e3


@dataclass(frozen=True)
class Regularisation:
    """Auxiliary springs and tolerances of the simulation.

    Attributes:
        closing: [N m/rad, N/m] stiffness of the connectors that close the loops.
            ``inf`` denotes rigid joints. It requires a robot whose loops are closed
            from the start.
        idle: [N m/rad, N/m] final stiffness of the weak springs on free motions.
        narrow: [-] final smoothing width of contacts, relative to their clearances.
        tolerance: [m, rad, -] size of the increment at which Newton's iteration ends.
        contact: factor by which the stiffness of contacts is multiplied.
        conservative: whether spring wrenches are energy gradients instead of Exudyn's
            approximation.
    """

    closing: float
    idle: float
    narrow: float = NARROW
    tolerance: float = 1e-10
    contact: float = 1.0
    conservative: bool = False


class Model:
    """An Exudyn model and the state of its solution.

    Attributes:
        robot: name of the robot, for messages.
        regularisation: springs and tolerances of the simulation.
        ground: index of the base in Exudyn.
        width: [-] smoothing width of contacts, relative to their clearances.
        deadline: [s] value of ``time.monotonic`` after which the solver stops.
        callback_error: exception raised by a user function.  Exudyn does not report
            this exception.
        idle: indices of the springs on free motions in Exudyn, and the axes of the
            springs.
        recorded: body frames that are recorded while the loops are closed.
        history: poses of these frames at each step, (frames, 4, 4) each.
    """

    def __init__(
        self,
        exudyn: Any,
        items: Any,
        fem: Any,
        robot: str,
        regularisation: Regularisation,
    ) -> None:
        self.exu, self.item, self.fem = exudyn, items, fem
        self.robot, self.regularisation = robot, regularisation
        self.container = self.exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        ground = self.mbs.AddObject(self.item.ObjectGround())
        self.ground = Place(int(ground), np.eye(4), np.eye(4))
        self.width, self.deadline = WIDE, math.inf
        self.callback_error: BaseException | None = None
        self.idle: list[tuple[int, int]] = []
        self.recorded: list[Place] = []
        self.history: list[NDArray] = []

    def discard(self) -> None:
        """Release the memory of the model."""
        self.mbs.SetPreStepUserFunction(0)
        self.mbs.Reset()
        self.container.Reset()

    def add_body(self, T: NDArray) -> Place:
        """Add a rigid body with initial pose ``T``."""
        x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
        node = self.item.NodeRigidBodyEP(referenceCoordinates=[*T[:3, 3], w, x, y, z])
        body = self.item.ObjectRigidBody(
            mass=1.0, inertia=[1, 1, 1, 0, 0, 0], nodeNumber=self.mbs.AddNode(node)
        )
        return Place(int(self.mbs.AddObject(body)), T, np.eye(4))

    def add_marker(self, place: Place) -> int:
        """Add a marker at a body frame."""
        marker = self.item.MarkerBodyRigid(
            bodyNumber=place.body, localHT=self.transform(place.local)
        )
        return int(self.mbs.AddMarker(marker))

    def add_spring(self, place: Place, K: NDArray) -> Elastic:
        """Add a body on a spring at a body frame. A stiffness ``inf`` locks an axis."""
        far = self.add_body(place.built)
        markers = [self.add_marker(place), self.add_marker(far)]
        soft = np.isfinite(np.diag(K))
        if not soft.all():
            lock = [int(locked) for locked in ~soft[_SWAP]]
            joint = self.item.GenericJoint(markerNumbers=markers, constrainedAxes=lock)
            self.mbs.AddObject(joint)
        K = np.where(np.outer(soft, soft), K, 0.0)
        spring = self._connect(markers, K)
        # For a spring with a single elastic axis, Exudyn's wrench equals the energy
        # gradient.
        if self.regularisation.conservative and soft.sum() > 1:
            self._follow_energy(spring, markers[1], K)
        return Elastic(place, far, (spring,))

    def add_idle(self, place: Place, axis: int) -> Elastic:
        """Add a body that moves along one axis of a body frame on a weak spring."""
        K = np.diag(np.where(np.arange(6) == axis, HOLDING_STIFFNESS, np.inf))
        spring = self.add_spring(place, K)
        self.idle.append((spring.parts[0], axis))
        return spring

    def hold_idle(self, stiffness: float) -> None:
        """Set the stiffness of the weak springs on free motions."""
        for part, axis in self.idle:
            K = np.diag(np.where(np.arange(6) == axis, stiffness, 0.0))
            self.mbs.SetObjectParameter(part, "stiffness", K[np.ix_(_SWAP, _SWAP)])

    def rest_idle(self, motions: NDArray) -> None:
        """Set the coordinates (j,) [rad or m] at which the weak springs are relaxed."""
        for (part, axis), motion in zip(self.idle, motions, strict=True):
            rest = np.where(np.arange(6) == axis, motion, 0.0)
            self.mbs.SetObjectParameter(part, "offset", rest[_SWAP].tolist())

    def add_contact(self, place: Place, clearance: JointClearance) -> Contact:
        """Add a body that moves within a clearance on a weak centring spring."""
        clearance = clearance.softened(self.regularisation.contact)
        rows = np.array(clearance.unlocked, dtype=int)
        centring = np.full(6, np.inf)
        centring[rows] = _CENTRING * np.where(rows < 3, 1e-3, 1.0)
        centring[2] *= 1e-3
        spring = self.add_spring(place, np.diag(centring))
        weak = np.where(np.isfinite(centring), centring, 0.0).tolist()

        def contact_wrench(screw: list[float]) -> list[float]:
            wrench = [k * s for k, s in zip(weak, screw, strict=True)]
            for cone in clearance.cones:
                for row, value in cone_forces(cone, screw, self.width):
                    wrench[row] += value
            return wrench

        self.set_law(spring.parts[0], contact_wrench)
        return Contact(place, spring.far, clearance)

    def set_law(self, connector: int, law: Callable[[list[float]], Any]) -> None:
        """Set the wrench of a connector to a given function.

        Args:
            connector: index of the connector in Exudyn.
            law: function that returns the resisting wrench (6,) [R T], half-way between
                the ends, for the screw between the ends.
        """

        def wrench(
            mbs: Any, t: float, item: int, shift: Any, turn: Any, *_: Any
        ) -> Any:
            try:
                self.check_time()
                moment_force = list(law([*turn, *shift]))
            except BaseException as error:
                self.callback_error = error
                raise
            return moment_force[3:] + moment_force[:3]

        name = "springForceTorqueUserFunction"
        self.mbs.SetObjectParameter(connector, name, wrench)

    def add_beam(
        self, base: Place, length: float, K: NDArray, elements: int,
        inertia: NDArray,
    ) -> tuple[tuple[int, ...], tuple[Place, ...]]:  # fmt: skip
        """Add a beam along the x axis of a body frame, to which it is clamped.

        Args:
            base: body frame to which the beam is clamped.
            length: [m] length of the beam.
            K: (6, 6) [N, N m^2] stiffness of the section.
            elements: number of elements.
            inertia: (3,) mass per length [kg/m] and its second moments about y and z
                [kg m].  Only vibrations require them.

        Returns:
            Indices of the elements in Exudyn, and the body frames at the nodes.
        """
        section = self.exu.BeamSection()
        section.stiffnessMatrix = K
        mass, about_y, about_z = inertia
        section.massPerLength = mass
        section.inertia = np.diag([about_y + about_z, about_y, about_z])
        step = length / elements
        bodies = [self.add_spring(base, np.diag([np.inf] * 6)).far]
        parts = []
        for k in range(1, elements + 1):
            bodies.append(self.add_body(base.built @ shifted([k * step, 0.0, 0.0])))
            beam = self.item.ObjectBeamGeometricallyExact(
                nodeNumbers=[self.node(body) for body in bodies[-2:]],
                length=step,
                sectionData=section,
            )
            parts.append(int(self.mbs.AddObject(beam)))
        return tuple(parts), tuple(bodies)

    def add_closure(self, first: Place, second: Place, closed: NDArray) -> Closure:
        """Add a connector that is unstressed while the loop is open."""
        gap = inverse(first.built) @ second.built
        marker = self.add_marker(first.moved(gap))
        markers = [marker, self.add_marker(second)]
        stiffness = self.regularisation.closing
        if np.isinf(stiffness):
            joint = self.item.GenericJoint(
                markerNumbers=markers, constrainedAxes=[1] * 6
            )
            connector = int(self.mbs.AddObject(joint))
        else:
            connector = self._connect(markers, np.eye(6) * stiffness)
        return Closure(first, second, marker, connector, closed)

    def add_load(self, place: Place, wrench: NDArray) -> None:
        """Add a wrench of constant direction at a body frame, in base axes."""
        torque = self.item.LoadTorqueVector(
            markerNumber=self.add_marker(place), loadVector=wrench[:3].tolist()
        )
        self.mbs.AddLoad(torque)
        self.add_force(place, wrench[3:])

    def add_following_load(self, place: Place, wrench: NDArray) -> None:
        """Add a wrench that rotates with its body, in the axes of a body frame."""
        marker = self.add_marker(place)
        for load, vector in (
            (self.item.LoadTorqueVector, wrench[:3]),
            (self.item.LoadForceVector, wrench[3:]),
        ):
            self.mbs.AddLoad(
                load(markerNumber=marker, bodyFixed=True, loadVector=vector.tolist())
            )

    def add_force(self, place: Place, force: NDArray) -> None:
        """Add a force (3,) [N] of constant direction at a body frame, in base axes."""
        load = self.item.LoadForceVector(
            markerNumber=self.add_marker(place), loadVector=force.tolist()
        )
        self.mbs.AddLoad(load)

    def check_time(self) -> None:
        """Raise ``TimeoutError`` after the deadline."""
        if time.monotonic() > self.deadline:
            raise TimeoutError

    def node(self, place: Place) -> Any:
        """Return Exudyn's node number of the body to which a frame is fixed."""
        return self.mbs.GetObjectParameter(place.body, "nodeNumber")

    def transform(self, T: NDArray) -> Any:
        """Convert a (4, 4) pose to Exudyn's homogeneous transformation."""
        return self.exu.HT(rotation=T[:3, :3], translation=T[:3, 3])

    def _follow_energy(self, spring: int, far: int, K: NDArray) -> None:
        """Set the wrenches on both ends of a spring to the gradient of its energy."""
        rows, lacking = K.tolist(), [0.0] * 3

        def law(screw: list[float]) -> list[float]:
            wrench = middle_wrench(rows, screw)
            lacking[:] = far_couple(screw, wrench[3:])
            return wrench

        # Exudyn evaluates connectors before loads. Loads are differentiated only with
        # respect to the far end. The couple must be constant in these derivatives.
        load = self.item.LoadTorqueVector(
            markerNumber=far, bodyFixed=True,
            loadVectorUserFunction=lambda mbs, t, load: lacking,
        )  # fmt: skip
        self.mbs.AddLoad(load)
        self.set_law(spring, law)

    def _connect(self, markers: list[int], K: NDArray) -> int:
        """Return a connector with a 6 by 6 stiffness between two markers."""
        spring = self.item.RigidBodySpringDamper(
            markerNumbers=markers,
            stiffness=K[np.ix_(_SWAP, _SWAP)],
            useIntrinsicFormulation=True,
        )
        return int(self.mbs.AddObject(spring))
