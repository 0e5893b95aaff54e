"""Define the body frames and elements of a simulation model.

Objects are identified by their indices in Exudyn.  Screws and wrenches are ordered
[R T], as in the whole library.
"""

from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import NDArray

from forcefit.validation.multibody.contact import JointClearance


class SimulationFailed(RuntimeError):
    """Exception raised if the simulation found no equilibrium.

    Attributes:
        robot: name of the robot.
        status: reason in a few words.
    """

    def __init__(self, robot: str, status: str) -> None:
        super().__init__(f"{robot}: the multibody simulation failed: {status}")
        self.robot = robot
        self.status = status


class OutOfTime(SimulationFailed):
    """Exception raised if the simulation reached its time limit."""


@dataclass(frozen=True, eq=False)
class Place:
    """A coordinate frame fixed to a body of the model.

    Attributes:
        body: index of the body in Exudyn.
        start: (4, 4) initial pose of the body in the base frame.
        local: (4, 4) pose of this frame in the body's frame.
    """

    body: int
    start: NDArray
    local: NDArray

    @property
    def built(self) -> NDArray:
        """Initial pose of this frame in the base frame, (4, 4)."""
        return self.start @ self.local

    def moved(self, T: NDArray) -> "Place":
        """Return a frame on the same body with pose ``T`` relative to this frame."""
        return replace(self, local=self.local @ T)


@dataclass(frozen=True, eq=False)
class Elastic:
    """An elastic body between two body frames that coincide in the unstressed state.

    Attributes:
        near: body frame on the inner body.
        far: body frame on the outer body.
        parts: index of the connector, or indices of the beam elements, in Exudyn.
        beam: whether the elastic body is a beam.
        nodes: body frames along a beam from base to tip, at equal distances.
        modes: interface modes of a meshed body; None for other elastic bodies.
    """

    near: Place
    far: Place
    parts: tuple[int, ...]
    beam: bool = False
    nodes: tuple[Place, ...] = ()
    modes: "Modes | None" = None


@dataclass(frozen=True, eq=False)
class MeshedSolid:
    """A link of finite elements with two rigid interfaces, in the axes of its mesh.

    Attributes:
        nodes: (n, 3) [m] positions of the nodes.
        stiffness: (3n, 3n) [N/m] sparse matrix; row 3 i + k is direction k of node i.
        base: (k,) indices of the nodes of the interface to the parent frame.
        tip: (m,) indices of the nodes of the interface to the frame.
        centers: (2, 3) [m] reference points of base and tip.
    """

    nodes: NDArray
    stiffness: Any
    base: NDArray
    tip: NDArray
    centers: NDArray


@dataclass(frozen=True, eq=False)
class MeshBody:
    """A meshed solid and its orientation in a robot.

    Attributes:
        solid: the solid.  Links of equal shape share one solid.
        turn: (3, 3) rotation matrix from mesh axes to frame axes.
    """

    solid: MeshedSolid
    turn: NDArray


@dataclass(frozen=True, eq=False)
class Modes:
    """Interface modes of a meshed body, relative to its base.

    Attributes:
        node: index of the node with the mode coordinates in Exudyn.
        stiffness: (6, 6) modal stiffness.
        wrench: (6, 6) matrix that converts mode coordinates to the wrench at the tip,
            in frame axes.
    """

    node: int
    stiffness: NDArray
    wrench: NDArray


@dataclass(frozen=True, eq=False)
class Closure:
    """Two body frames that a connector moves into coincidence.

    Attributes:
        first: body frame on the first chain.
        second: body frame on the second chain.
        marker: index in Exudyn of the end of the connector on the first chain. This end
            is moved to close the loop.
        connector: index of the connector in Exudyn.
        closed: (4, 4) nominal pose of the second body frame relative to the first body
            frame in the closed loop.
    """

    first: Place
    second: Place
    marker: int
    connector: int
    closed: NDArray


@dataclass(frozen=True, eq=False)
class Contact:
    """A joint with clearance between two body frames.

    Attributes:
        near: body frame on the inner body.
        far: body frame on the outer body.
        clearance: bounds on the motions of the joint.
    """

    near: Place
    far: Place
    clearance: JointClearance
