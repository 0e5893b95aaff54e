"""Robot at a posture in array form, for assembly in steps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.closure_rates import closure_signs
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.kinematics.ranks import RANK, rank_tolerance
from forcefit.assembly.linear.closure import (
    VirtualJoints,
    checked_size,
    in_reference_lengths,
    virtual_joints,
)
from forcefit.assembly.linear.load import FrameLoads
from forcefit.assembly.model.joint_names import closing_names, names_of, row_of
from forcefit.assembly.steps.equilibrium import Equilibrium, Movable

Part = tuple[str, str] | str


@dataclass(frozen=True, eq=False)
class Machine:
    """A robot with n frames at a posture.

    Attributes:
        posture: pose at which the robot is assembled.
        joints: virtual joints: springs, clearances and free motions.
        size: [m] reference length.
    """

    posture: Posture
    joints: VirtualJoints
    size: float

    @property
    def springs(self) -> NDArray:
        """Screws of links and joint springs, (6n, ny)."""
        return self.joints.elastic

    @property
    def cones(self) -> NDArray:
        """Screws of motions within clearances, for the full clearance, (6n, nu)."""
        return self.joints.cones

    @cached_property
    def free_size(self) -> NDArray:
        """Unit of each free motion, 1 rad or the reference length [m], (nq,)."""
        angles = np.tile(np.repeat([True, False], 3), len(self.joints.free) // 6)
        turns = self.joints.free[angles].any(axis=0)
        return np.where(turns, 1.0, self.size)

    @cached_property
    def free(self) -> NDArray:
        """Screws of free motions, with lengths in reference lengths, (6n, nq)."""
        return self.joints.free * self.free_size

    @property
    def scale(self) -> NDArray:
        """Factors that divide translations by the reference length, (6,)."""
        return in_reference_lengths(self.size)

    @property
    def tolerance(self) -> float:
        """Threshold of a zero singular value, relative to the largest."""
        return rank_tolerance(float(self.posture.mismatch))

    def rows(self, part: Part) -> NDArray:
        """Return the matrix that converts all frame screws to one screw or opening.

        Args:
            part: name of a frame, or names of the two frames of a closure.

        Returns:
            (6, 6n) matrix, with lengths in reference lengths.  The result is in the
            axes of the frame or of the closure's first frame, at its origin.  In a
            robot file of format 2, it is in the axes of the joint, at its point.
        """
        robot, paths = self.posture.robot, self.posture.paths
        if isinstance(part, str):
            row = robot.index(part)
            signs = robot.on_path[row].astype(float)
        else:
            ends = closing_names([part], names_of(robot))
            row = row_of(robot, ends.get(part[0], part[0]))
            signs = closure_signs(robot)[robot.closures.index(part)].astype(float)
        at_platform = np.swapaxes(signs[:, None, None] * paths, 0, 1).reshape(6, -1)
        return self.scale[:, None] * np.linalg.solve(paths[row], at_platform)

    def movable(
        self, loads: Sequence[FrameLoads], bolted: Sequence[int], count: int
    ) -> tuple[Movable, NDArray, NDArray]:
        """Return the motions that are not bolted, and the loads on them.

        Args:
            loads: loads that act on frames.
            bolted: indices of frames whose joints are bolted.
            count: number of machines.

        Returns:
            The motions and loads, and whether each clearance (nu,) and each free motion
            (nq,) is included.
        """
        frames = np.repeat(~np.isin(np.arange(len(self.springs) // 6), bolted), 6)
        cones = np.abs(self.cones)[frames].any(axis=0)
        motions = np.abs(self.free)[frames].any(axis=0)
        body, joint = np.zeros((2, len(self.springs)))
        for load in loads:
            body, joint = body + load.body, joint + load.joint
        springs, free = self.springs, self.free[:, motions]
        on = np.where(self.joints.links, body @ springs, joint @ springs)
        group = np.unique(self.joints.group[cones], return_inverse=True)[1]
        acting = (on, joint @ self.cones[:, cones], joint @ free)
        movable = Movable(
            springs, self.cones[:, cones], group, free,
            *(np.repeat(row[None], count, axis=0) for row in acting),
        )  # fmt: skip
        return movable, cones, motions

    def values(self, rows: NDArray, errors: NDArray, found: Equilibrium) -> NDArray:
        """Return the product of a matrix and the screws of all frames.

        Args:
            rows: (m, 6n) matrix from :meth:`rows`.
            errors: (k, 6n) [rad, m] geometric errors.
            found: equilibrium.

        Returns:
            (k, m) values, with lengths in reference lengths.
        """
        value = errors @ rows.T + found.springs @ (rows @ self.springs).T
        value += found.clearances @ (rows @ self.cones).T
        return value + found.motions @ (rows @ self.free).T

    def platform_screw(self, errors: NDArray, found: Equilibrium) -> NDArray:
        """Return the platform screw at its origin, base axes, (k, 6) [rad, m]."""
        robot = self.posture.robot
        row = robot.index(robot.platform)
        own = self.values(self.rows(robot.platform), errors, found) / self.scale
        return own @ self.posture.paths[row].T

    def opening(
        self, errors: NDArray, found: Equilibrium, holds: Mapping[str, Any], hold: Any
    ) -> NDArray:
        """Return the opening of a closure that free motions cannot close.

        Args:
            errors: (k, 6n) geometric errors.
            found: equilibrium.
            holds: active constraints.
            hold: constraints of the closure.

        Returns:
            (k, m) opening, with lengths in reference lengths.
        """
        open_ = hold.right - self.values(hold.rows, errors, found)
        rows = [other.rows @ self.free for other in holds.values()]
        held = np.vstack([np.zeros((1, self.free.shape[1])), *rows])
        _, S, Vt = np.linalg.svd(held)
        moving = Vt[np.sum(S > self.tolerance * S[:1].clip(1e-300)) :].T
        columns = hold.rows @ self.free @ moving
        return open_ - open_ @ np.linalg.pinv(columns, rcond=RANK).T @ columns.T

    def work(self, loads: Sequence[FrameLoads], state: Any) -> NDArray:
        """Return the work of loads in a state, (k,) [J]."""
        if not loads:
            return np.zeros(len(state.errors))
        found, links = state.found, self.joints.links
        of_links = found.springs * links @ self.springs.T + state.errors
        of_joints = found.springs * ~links @ self.springs.T
        of_joints += found.clearances @ self.cones.T + found.motions @ self.free.T
        work = np.zeros(len(state.errors))
        for load in loads:
            work += of_links @ load.body + of_joints @ load.joint
        return work


def machine_at(posture: Posture) -> Machine:
    """Return a robot at a posture in array form.

    Args:
        posture: pose at which the robot is assembled.

    Returns:
        The machine.

    Raises:
        BadInput: a geometric error exceeds 1e6 rad or m.
    """
    robot = posture.robot
    return Machine(posture, virtual_joints(robot), checked_size(robot))
