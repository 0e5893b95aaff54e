r"""Robot at a posture, with finite motions of its frames.

The transform of frame i is a product of finite motions in the axes of the frame,

    T_i = T_parent  F_i  exp(dl)^  exp(de)  exp(dc)  exp(db)  (motion of the joint).

F_i is the nominal body, and exp(dl)^ its geometric error, which consists of a rotation
vector and a translation.  The screws de, dc and db are the deformation of the link, the
motion within the clearance and the deformation of the joint.  The motion of the joint
is a rotation about z or a translation along z.
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

# motions at a frame, in the order of the product; OWN is the motion of the joint
LINK, CLEARANCE, SPRING, OWN = range(4)


@dataclass(frozen=True, eq=False)
class FiniteRobot:
    """Robot at a posture, with the unknowns of the exact equilibrium.

    Attributes:
        posture: nominal posture of the robot.
        joints: virtual joints of the robot.  Their columns are the screws of the
            unknowns y, u and q, in this order.
    """

    posture: Posture
    joints: VirtualJoints

    @cached_property
    def _blocks(self) -> NDArray:
        """Screw of each frame per unit of each unknown, (n, 6, N)."""
        j = self.joints
        every = np.hstack([j.elastic, j.cones, j.free])
        return every.reshape(len(self.posture.robot.frames), 6, every.shape[1])

    @cached_property
    def frame(self) -> NDArray:
        """Index of the frame at which each unknown acts, (N,)."""
        return np.argmax(np.abs(self._blocks).max(axis=1), axis=0)

    @cached_property
    def columns(self) -> NDArray:
        """Screw of each unknown in the axes of its frame, (N, 6)."""
        return self._blocks[self.frame, :, np.arange(len(self.frame))]

    @cached_property
    def motion(self) -> NDArray:
        """Motion that each unknown changes, from ``LINK`` to ``OWN``, (N,)."""
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
        """Number of free joint motions."""
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
        """Unit by which each unknown is scaled, (N,)."""
        units = np.ones(len(self.frame))
        units[self.bounded.stop :] /= np.linalg.norm(
            self.columns[self.bounded.stop :] * self.scale, axis=1
        )
        return units

    @cached_property
    def size(self) -> float:
        """Reference length [m], by which translations are divided."""
        return size_of(self.posture.robot)

    @cached_property
    def scale(self) -> NDArray:
        """Factors that divide translations by the reference length, (6,)."""
        return np.array([1.0, 1.0, 1.0, *[1 / self.size] * 3])

    @cached_property
    def metric(self) -> NDArray:
        """Scalar products of the scaled screws of the unknowns, (N, N)."""
        together = self.same_motion & (self.frame[:, None] == self.frame)
        scaled = self.columns * self.scale
        return (scaled @ scaled.T) * together

    @cached_property
    def same_motion(self) -> NDArray:
        """Whether two unknowns belong to the same motion, (N, N) bool."""
        return self._order[:, None] == self._order

    @cached_property
    def _order(self) -> NDArray:
        """Position of each unknown in the order of motions along its chain, (N,)."""
        return 4 * self.frame + self.motion

    @cached_property
    def signs(self) -> NDArray:
        """Sign of each unknown in each closure, (K, N).

        It is 1 on the first chain of the closure, -1 on the second, and 0 elsewhere.
        """
        return closure_signs(self.posture.robot)[:, self.frame]

    @cached_property
    def chains(self) -> tuple[NDArray, NDArray]:
        """Whether an unknown is in the first and in the second chain, (K, N) bool."""
        robot = self.posture.robot
        ends = self.closed_frames
        first, second = (robot.on_path[ends[:, k]][:, self.frame] for k in (0, 1))
        return first, second

    @cached_property
    def closed_frames(self) -> NDArray:
        """Indices of the two frames of each closure, (K, 2)."""
        robot = self.posture.robot
        rows = [[robot.index(name) for name in pair] for pair in robot.closures]
        return np.array(rows, dtype=int).reshape(-1, 2)

    @cached_property
    def on_platform(self) -> NDArray:
        """Whether an unknown moves the platform, (N,) bool."""
        robot = self.posture.robot
        return robot.on_path[robot.index(robot.platform)][self.frame]

    @cached_property
    def precedence(self) -> NDArray:
        """Order of two unknowns in each loop, (K, N, N).

        It is 1 if the second unknown follows the first, and -1 if it precedes it.  The
        loop leads from the base along the first chain and back along the second chain.
        """
        along = np.where(self.signs > 0, self._order, 1e6 - self._order)
        return np.sign(along[:, None, :] - along[:, :, None])

    @cached_property
    def comes_before(self) -> NDArray:
        """Order of two unknowns in the tree of frames, (N, N).

        It is 1 if the first unknown moves the second, 1/2 if both belong to the same
        motion, and 0 otherwise.
        """
        above = self.posture.robot.on_path[self.frame][:, self.frame].T
        return above * (1.0 - np.sign(self._order[:, None] - self._order)) / 2

    @cached_property
    def erring_bodies(self) -> NDArray:
        """Bodies with geometric errors, as transforms from the parent, (n, 4, 4)."""
        robot = self.posture.robot
        errors = robot.errors
        off = transform(errors[:, 3:], rotation_matrix(errors[:, :3]))
        return robot.fixed_transforms @ off

    @cached_property
    def nominal_closures(self) -> NDArray:
        """Nominal pose of the second frame of each closure in the first, (K, 4, 4)."""
        first, second = self.posture.transforms[self.closed_frames.T]
        # not exactly the identity, because numbers in robot files are rounded
        return inverse(first) @ second


def along_own(robot: Robot, coordinates: NDArray) -> NDArray:
    """Return the motion of each joint about or along its z axis, (..., n, 4, 4)."""
    return exponential(coordinates[..., None] * own_screws(robot))


def nominally_carried(posture: Posture) -> NDArray:
    """Return the nominal frames after the motion of their joint, (..., n, 4, 4)."""
    return posture.transforms @ along_own(posture.robot, posture.coordinates)
