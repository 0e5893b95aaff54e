r"""Robot at a posture, with unknowns that move its frames by finite screws.

The motions at a frame are composed in its axes.  Each one is an exponential of a screw:

    T_i = T_parent  F_i  exp(dl)^  exp(de)  exp(dc)  exp(db)  (motion of the joint).

F_i is the nominal body.  exp(dl)^ is the geometric error: a rotation vector and a
translation, both in the frame's axes.  The motion of the joint is a rotation about z or
a translation along z.  Its magnitude is the nominal joint coordinate, plus an
additional motion if the joint is passive.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.closure_rates import closure_signs
from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.kinematics.se3 import exponential, inverse
from forcefit.assembly.linear.closure import VirtualJoints
from forcefit.assembly.model.links import own_screws
from forcefit.assembly.model.robot import Robot
from forcefit.stiffness.screws import rotation_matrix, transform

# kinds of motion at a frame, in the order of composition; OWN is the motion of the
# joint
LINK, CLEARANCE, SPRING, OWN = range(4)


@dataclass(frozen=True, eq=False)
class FiniteRobot:
    """Robot at a posture, with its unknowns as columns of finite screws.

    Attributes:
        posture: nominal posture of the robot.
        joints: virtual joints of the robot; their columns are the unknowns y, u and q,
            in this order.
    """

    posture: Posture
    joints: VirtualJoints

    @cached_property
    def _blocks(self) -> NDArray:
        """(n, 6, N) columns of all unknowns by frame and component."""
        j = self.joints
        every = np.hstack([j.elastic, j.cones, j.free])
        return every.reshape(len(self.posture.robot.frames), 6, every.shape[1])

    @cached_property
    def frame(self) -> NDArray:
        """(N,) index of the frame at which each unknown acts."""
        return np.argmax(np.abs(self._blocks).max(axis=1), axis=0)

    @cached_property
    def columns(self) -> NDArray:
        """(N, 6) screw of each unknown, in the axes of its frame."""
        return self._blocks[self.frame, :, np.arange(len(self.frame))]

    @cached_property
    def motion(self) -> NDArray:
        """(N,) index of the frame's motion to which each unknown belongs."""
        links, (nu, nq) = self.joints.links, (len(self.joints.group), self._free)
        kind = np.where(links, LINK, SPRING)
        kind = np.concatenate([kind, np.full(nu + nq, CLEARANCE)])
        for i in range(len(links), len(kind)):
            frame = self.posture.robot.frames[self.frame[i]]
            own = frame.passive and not frame.compliant
            if own and self.columns[i, frame.own_axis]:
                kind[i] = OWN
        return kind

    @property
    def _free(self) -> int:
        """Number of free joint motions, which have no bound."""
        return self.joints.free.shape[1]

    @property
    def springs(self) -> slice:
        """Slice of the springs among the unknowns."""
        return slice(0, len(self.joints.links))

    @property
    def bounded(self) -> slice:
        """Slice of the clearances among the unknowns."""
        return slice(self.springs.stop, self.springs.stop + len(self.joints.group))

    @cached_property
    def units(self) -> NDArray:
        """(N,) scale of the unknowns: 1 for springs, unit screws for motions."""
        units = np.ones(len(self.frame))
        units[self.bounded.stop :] /= np.linalg.norm(
            self.columns[self.bounded.stop :] * self.scale, axis=1
        )
        return units

    @cached_property
    def size(self) -> float:
        """[m] reference length by which translations are divided."""
        return size_of(self.posture.robot)

    @cached_property
    def scale(self) -> NDArray:
        """(6,) factors on a screw: translations are divided by the reference length."""
        return np.array([1.0, 1.0, 1.0, *[1 / self.size] * 3])

    @cached_property
    def metric(self) -> NDArray:
        """(N, N) scalar products of the screws of the unknowns, in rad and lengths."""
        together = self.same_motion & (self.frame[:, None] == self.frame)
        scaled = self.columns * self.scale
        return (scaled @ scaled.T) * together

    @cached_property
    def same_motion(self) -> NDArray:
        """(N, N) bool, True if two unknowns are parts of one screw."""
        return self._order[:, None] == self._order

    @cached_property
    def _order(self) -> NDArray:
        """(N,) rank of each unknown's motion in the order of any chain with it."""
        return 4 * self.frame + self.motion

    @cached_property
    def signs(self) -> NDArray:
        """(K, N) +1 on the first chain of a closure, -1 on the second, otherwise 0."""
        return closure_signs(self.posture.robot)[:, self.frame]

    @cached_property
    def chains(self) -> tuple[NDArray, NDArray]:
        """(K, N) bool for each chain of a closure: unknowns on that chain."""
        robot = self.posture.robot
        ends = self.closed_frames
        first, second = (robot.on_path[ends[:, k]][:, self.frame] for k in (0, 1))
        return first, second

    @cached_property
    def closed_frames(self) -> NDArray:
        """(K, 2) indices of the frames that each closure joins."""
        robot = self.posture.robot
        rows = [[robot.index(name) for name in pair] for pair in robot.closures]
        return np.array(rows, dtype=int).reshape(-1, 2)

    @cached_property
    def on_platform(self) -> NDArray:
        """(N,) bool, True for unknowns that move the platform."""
        robot = self.posture.robot
        return robot.on_path[robot.index(robot.platform)][self.frame]

    @cached_property
    def precedence(self) -> NDArray:
        """(K, N, N) +1 if the second unknown acts later around the loop, else -1.

        The order is outward along the first chain and back along the second chain.
        """
        along = np.where(self.signs > 0, self._order, 1e6 - self._order)
        return np.sign(along[:, None, :] - along[:, :, None])

    @cached_property
    def comes_before(self) -> NDArray:
        """(N, N) 1 if the first unknown moves the second, 1/2 in the same motion."""
        above = self.posture.robot.on_path[self.frame][:, self.frame].T
        return above * (1.0 - np.sign(self._order[:, None] - self._order)) / 2

    @cached_property
    def erring_bodies(self) -> NDArray:
        """(n, 4, 4) bodies with geometric errors, in the frame of the parent."""
        robot = self.posture.robot
        errors = robot.errors
        off = transform(errors[:, 3:], rotation_matrix(errors[:, :3]))
        return robot.fixed_transforms @ off

    @cached_property
    def nominal_closures(self) -> NDArray:
        """(K, 4, 4) nominal second frame of each closure relative to the first."""
        first, second = self.posture.transforms[self.closed_frames.T]
        # close to the identity, but not exactly, because robot files are rounded
        return inverse(first) @ second


def along_own(robot: Robot, coordinates: NDArray) -> NDArray:
    """Return (..., n, 4, 4) motions about or along each joint's z axis."""
    return exponential(coordinates[..., None] * own_screws(robot))


def nominally_carried(posture: Posture) -> NDArray:
    """Return the (..., n, 4, 4) nominal frames after the coordinate of their joint."""
    return posture.transforms @ along_own(posture.robot, posture.coordinates)
