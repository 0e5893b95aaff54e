r"""Robot displaced by finite screws, with first and second derivatives.

======  =================  ==========  =============================================
symbol  code               shape       meaning
======  =================  ==========  =============================================
x       ``x``              (N,)        unknowns: springs y, clearances u, motions q
r       ``residual``       (6 K,)      scaled logarithm of the gap in each loop
A       ``rows``           (6 K, N)    derivative of r
P       ``platform_rows``  (6, N)      derivative of the platform screw
V       ``moves``          (6, N)      small motion due to each unknown
======  =================  ==========  =============================================

To second order, the logarithm of a product exp(V_1 h_1) exp(V_2 h_2) ... is the sum of
all V_i h_i plus half the sum of the Lie brackets [V_i h_i, V_j h_j] with i < j.  The
second derivative consists of these brackets and the curvature of each exponential.

Sources:
    Selig (2005), Geometric Fundamentals of Robotics, chapter 4 (brackets of screws,
    Campbell-Baker-Hausdorff).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exact.finite_robot import OWN, FiniteRobot, along_own
from forcefit.assembly.kinematics.se3 import (
    bracket_form,
    exponential,
    inverse,
    left_jacobian,
    logarithm,
    second_form,
    turn_jacobian,
)
from forcefit.stiffness.screws import rotation_vector, screw_map, skew


@dataclass(frozen=True, eq=False)
class Placement:
    """Robot displaced by finite screws.  Its loops can be open.

    Attributes:
        model: the robot with its unknowns.
        x: (N,) values of the unknowns.
    """

    model: FiniteRobot
    x: NDArray

    @cached_property
    def screws(self) -> NDArray:
        """Screws of link, clearance and joint spring at each frame, (3, n, 6)."""
        m = self.model
        s = np.zeros((4, len(m.posture.robot.frames), 6))
        np.add.at(s, (m.motion, m.frame), self.x[:, None] * m.columns)
        return s[:OWN]

    @cached_property
    def own(self) -> NDArray:
        """Motion of each passive joint from its nominal posture, (n,) [rad or m]."""
        m = self.model
        rows = m.motion == OWN
        axes = np.array([frame.own_axis for frame in m.posture.robot.frames])
        values = self.x * m.columns[np.arange(len(m.frame)), axes[m.frame]]
        return np.bincount(
            m.frame[rows], weights=values[rows], minlength=len(m.posture.coordinates)
        )

    @cached_property
    def _poses(self) -> NDArray:
        """Poses of each frame before and after each of its motions, (5, n, 4, 4)."""
        robot = self.model.posture.robot
        link, clearance, spring = exponential(self.screws)
        local = [
            self.model.erring_bodies, link, clearance, spring,
            along_own(robot, self.own),
        ]  # fmt: skip
        for k in range(1, 5):
            local[k] = local[k - 1] @ local[k]
        step = local[4] @ along_own(robot, self.model.posture.coordinates)
        after = np.empty_like(step)
        before = np.empty_like(step)
        for i, parent in enumerate(robot.parents):
            before[i] = after[parent] if parent >= 0 else np.eye(4)
            after[i] = before[i] @ step[i]
        return np.stack([before @ T for T in local])

    @property
    def body_ends(self) -> NDArray:
        """Poses of the bodies' ends, before clearance and joint motions, (n, 4, 4)."""
        return self._poses[1]

    @cached_property
    def carried(self) -> NDArray:
        """Frames after the motion of their joint, (n, 4, 4)."""
        posture = self.model.posture
        return self.transforms @ along_own(posture.robot, posture.coordinates)

    @property
    def transforms(self) -> NDArray:
        """Frames in the base frame, before the motion of their joint, (n, 4, 4)."""
        return self._poses[4]

    @property
    def platform(self) -> NDArray:
        """Pose of the platform, (4, 4)."""
        robot = self.model.posture.robot
        return self.transforms[robot.index(robot.platform)]

    @cached_property
    def platform_screw(self) -> NDArray:
        """Rotation vector of R R_nominal^T and shift of the origin, base axes, (6,)."""
        nominal = self.model.posture.platform
        turn = rotation_vector(self.platform[:3, :3] @ nominal[:3, :3].T)
        return np.concatenate([turn, self.platform[:3, 3] - nominal[:3, 3]])

    @cached_property
    def _open(self) -> NDArray:
        """Transform of the gap in each loop, at the platform's origin, (K, 4, 4)."""
        first, second = self.transforms[self.model.closed_frames.T]
        G = first @ self.model.nominal_closures @ inverse(second)
        origin = self.model.posture.platform[:3, 3]
        G[:, :3, 3] += (G[:, :3, :3] - np.eye(3)) @ origin
        return G

    @cached_property
    def _open_screws(self) -> NDArray:
        """Logarithm of the gap in each loop, (K, 6) [rad, m]."""
        return logarithm(self._open)

    @cached_property
    def residual(self) -> NDArray:
        """Loop-closure residual, (6 K,) [rad, reference lengths]."""
        return (self._open_screws * self.model.scale).ravel()

    @cached_property
    def largest_gap(self) -> float:
        """Largest component of the residual [rad, reference lengths]."""
        return float(np.abs(self.residual).max(initial=0.0))

    @cached_property
    def _readings(self) -> NDArray:
        """Matrices that transform screws to the platform's origin, (N, 6, 6).

        There is a matrix for each unknown, from the axes of its frame to base axes.
        """
        m = self.model
        before = self._poses[m.motion, m.frame]
        offset = before[:, :3, 3] - m.posture.platform[:3, 3]
        return screw_map(offset, before[:, :3, :3])

    @cached_property
    def moves(self) -> NDArray:
        """Small motion due to each unknown, (6, N).

        The reference point is the nominal origin of the platform; base axes.
        """
        m = self.model
        sprung = np.concatenate([left_jacobian(self.screws), self._identity])
        local = sprung[m.motion, m.frame] @ m.columns[:, :, None]
        return (self._readings @ local)[..., 0].T

    @property
    def _identity(self) -> NDArray:
        """Identity matrices for the motions of the joints, (1, n, 6, 6)."""
        return np.broadcast_to(np.eye(6), (1, len(self.own), 6, 6))

    @cached_property
    def rows(self) -> NDArray:
        """Derivative of the residual, (6 K, N)."""
        first, second = self.model.chains
        G = self._open
        back = screw_map(G[:, :3, 3], G[:, :3, :3])
        V = self.moves
        difference = first[:, None] * V - (back @ V) * second[:, None]
        rows = np.linalg.solve(left_jacobian(self._open_screws), difference)
        rows = rows * self.model.scale[:, None]
        return rows.reshape(rows.shape[0] * rows.shape[1], V.shape[1])

    @cached_property
    def _at_origin(self) -> NDArray:
        """Small motion of the platform at its displaced origin, (6, N)."""
        away = self.model.posture.platform[:3, 3] - self.platform[:3, 3]
        return screw_map(away) @ (self.moves * self.model.on_platform)

    @cached_property
    def platform_rows(self) -> NDArray:
        """Derivative of the platform screw, (6, N)."""
        W = self._at_origin
        turn = np.linalg.solve(turn_jacobian(self.platform_screw[:3]), W[:3])
        return np.concatenate([turn, W[3:]])

    def curvature(self, multipliers: NDArray, load: NDArray) -> NDArray:
        """Return the Hessian of multipliers . residual + load . platform screw.

        The result is exact if all loops are closed.  Otherwise, its error is
        proportional to the residual.

        Args:
            multipliers: (6 K,) multipliers of the scaled residual.
            load: (6,) [N m, N] wrench on the platform at its origin, base axes.

        Returns:
            (N, N) symmetric matrix.
        """
        m = self.model
        wrenches = multipliers.reshape(-1, 6) * m.scale
        V = self.moves
        H = np.zeros((V.shape[1], V.shape[1]))
        for wrench, sign, later in zip(wrenches, m.signs, m.precedence, strict=True):
            W = V * sign
            H += (W.T @ bracket_form(wrench) @ W) * later / 2
        through = m.signs.T @ wrenches
        if load.any():
            through = through + m.on_platform[:, None] * self.load_wrench(load)
            H += self._load_curvature(load)
        return H + self.exponential_curvature(through)

    def exponential_curvature(self, through: NDArray) -> NDArray:
        """Return the second derivative of each exponential, multiplied by a wrench.

        Args:
            through: (N, 6) wrench on all bodies that each unknown moves, at the
                platform's nominal origin, base axes.

        Returns:
            (N, N) symmetric matrix.
        """
        m = self.model
        local = np.einsum("nji,nj->ni", self._readings, through)
        wrenches = np.zeros((4, len(self.own), 6))
        wrenches[m.motion, m.frame] = local
        forms = np.zeros((4, len(self.own), 6, 6))
        forms[:OWN] = second_form(self.screws, wrenches[:OWN])
        rows = (forms[m.motion, m.frame] @ m.columns[:, :, None])[..., 0]
        return (rows @ m.columns.T) * m.same_motion

    def load_wrench(self, load: NDArray) -> NDArray:
        """Return the equivalent wrench of a load at the nominal origin, (6,)."""
        moment = np.linalg.solve(turn_jacobian(self.platform_screw[:3]).T, load[:3])
        arm = self.platform_screw[3:]
        return np.concatenate([moment + np.cross(arm, load[3:]), load[3:]])

    def _load_curvature(self, load: NDArray) -> NDArray:
        """Return the second derivative of the load's work without Lie brackets."""
        W, turn = self._at_origin, self.platform_screw[:3]
        order = self.model._order
        V = self.moves * self.model.on_platform
        later = np.sign(order - order[:, None])
        H = (V.T @ bracket_form(self.load_wrench(load)) @ V) * later / 2
        # to second order, a screw (w, v) moves the origin by v + w x v / 2
        of_force = -W[:3].T @ skew(load[3:]) @ W[3:]
        H += (of_force + of_force.T) / 2
        # exp(turn + h) = exp(J h + D(h, h) / 2) exp(turn) for a small h
        along, zero = np.linalg.solve(turn_jacobian(turn), W[:3]), np.zeros(3)
        moment = np.linalg.solve(turn_jacobian(turn).T, load[:3])
        form = second_form(np.append(turn, zero), np.append(moment, zero))
        return H - along.T @ form[:3, :3] @ along


def place(model: FiniteRobot, x: NDArray) -> Placement:
    """Return a robot displaced by finite screws.

    Args:
        model: the robot with its unknowns.
        x: (N,) values of the unknowns.

    Returns:
        The displaced robot.
    """
    return Placement(model, np.array(x, dtype=float))
