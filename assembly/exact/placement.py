r"""Robot displaced by finite screws, with derivatives of its closures up to order two.

======  =================  ==========  =============================================
symbol  code               shape       meaning
======  =================  ==========  =============================================
x       ``x``              (N,)        unknowns: springs y, clearances u, motions q
r       ``residual``       (6 K,)      scaled logarithms of the open closures
A       ``rows``           (6 K, N)    derivative of r
P       ``platform_rows``  (6, N)      derivative of the platform screw
V       ``moves``          (6, N)      small motion that each unknown makes
======  =================  ==========  =============================================

To second order, the logarithm of a product of motions exp(V_1 h_1) exp(V_2 h_2) ... is
the sum of V_i h_i plus half of the brackets [V_i h_i, V_j h_j] of all ordered pairs.
The second derivative consists of these brackets and the curvature of each exponential.

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
    """Robot displaced by finite screws; its closures can be open.

    Attributes:
        model: the prepared robot.
        x: (N,) values of the unknowns.
    """

    model: FiniteRobot
    x: NDArray

    @cached_property
    def screws(self) -> NDArray:
        """(3, n, 6) screws of link, clearance and joint spring at each frame."""
        m = self.model
        s = np.zeros((4, len(m.posture.robot.frames), 6))
        np.add.at(s, (m.motion, m.frame), self.x[:, None] * m.columns)
        return s[:OWN]

    @cached_property
    def own(self) -> NDArray:
        """(n,) [rad or m] additional motion of passive joints."""
        m = self.model
        rows = m.motion == OWN
        axes = np.array([frame.own_axis for frame in m.posture.robot.frames])
        values = self.x * m.columns[np.arange(len(m.frame)), axes[m.frame]]
        return np.bincount(
            m.frame[rows], weights=values[rows], minlength=len(m.posture.coordinates)
        )

    @cached_property
    def _poses(self) -> NDArray:
        """(5, n, 4, 4) poses before each motion of a frame, and after the last one."""
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
        """(n, 4, 4) ends of the bodies, before clearance and springs of the joint."""
        return self._poses[1]

    @cached_property
    def carried(self) -> NDArray:
        """(n, 4, 4) frames after the coordinate of their joint."""
        posture = self.model.posture
        return self.transforms @ along_own(posture.robot, posture.coordinates)

    @property
    def transforms(self) -> NDArray:
        """(n, 4, 4) frames in the base frame, before the coordinate of their joint."""
        return self._poses[4]

    @property
    def platform(self) -> NDArray:
        """(4, 4) pose of the platform."""
        robot = self.model.posture.robot
        return self.transforms[robot.index(robot.platform)]

    @cached_property
    def platform_screw(self) -> NDArray:
        """(6,) rotation vector of R R_nominal^T and shift of the origin, base axes."""
        nominal = self.model.posture.platform
        turn = rotation_vector(self.platform[:3, :3] @ nominal[:3, :3].T)
        return np.concatenate([turn, self.platform[:3, 3] - nominal[:3, 3]])

    @cached_property
    def _open(self) -> NDArray:
        """(K, 4, 4) motion by which each closure is open, at the platform's origin."""
        first, second = self.transforms[self.model.closed_frames.T]
        G = first @ self.model.nominal_closures @ inverse(second)
        origin = self.model.posture.platform[:3, 3]
        G[:, :3, 3] += (G[:, :3, :3] - np.eye(3)) @ origin
        return G

    @cached_property
    def _open_screws(self) -> NDArray:
        """(K, 6) [rad, m] screws by which the closures are open (logarithms)."""
        return logarithm(self._open)

    @cached_property
    def residual(self) -> NDArray:
        """(6 K,) residual of the closures: [rad], translations per reference length."""
        return (self._open_screws * self.model.scale).ravel()

    @cached_property
    def largest_gap(self) -> float:
        """[rad, reference lengths] largest component of the residual."""
        return float(np.abs(self.residual).max(initial=0.0))

    @cached_property
    def _readings(self) -> NDArray:
        """(N, 6, 6) maps from each unknown's screw to the platform's origin."""
        m = self.model
        before = self._poses[m.motion, m.frame]
        offset = before[:, :3, 3] - m.posture.platform[:3, 3]
        return screw_map(offset, before[:, :3, :3])

    @cached_property
    def moves(self) -> NDArray:
        """(6, N) small motion due to each unknown, at the platform's nominal origin."""
        m = self.model
        sprung = np.concatenate([left_jacobian(self.screws), self._identity])
        local = sprung[m.motion, m.frame] @ m.columns[:, :, None]
        return (self._readings @ local)[..., 0].T

    @property
    def _identity(self) -> NDArray:
        """(1, n, 6, 6) identities: joint motions are linear in their coordinate."""
        return np.broadcast_to(np.eye(6), (1, len(self.own), 6, 6))

    @cached_property
    def rows(self) -> NDArray:
        """(6 K, N) derivative of the residual."""
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
        """(6, N) motions of the platform, at its current origin."""
        away = self.model.posture.platform[:3, 3] - self.platform[:3, 3]
        return screw_map(away) @ (self.moves * self.model.on_platform)

    @cached_property
    def platform_rows(self) -> NDArray:
        """(6, N) derivative of the platform screw."""
        W = self._at_origin
        turn = np.linalg.solve(turn_jacobian(self.platform_screw[:3]), W[:3])
        return np.concatenate([turn, W[3:]])

    def curvature(self, multipliers: NDArray, load: NDArray) -> NDArray:
        """Return the Hessian of multipliers . residual + load . platform screw.

        The result is exact if the closures hold; otherwise its error is of the order of
        the residual.

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
        """Return the curvature due to the individual exponentials.

        Args:
            through: (N, 6) wrench on all parts that each unknown moves, at the
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
        """Return the (6,) equivalent wrench of a load at the nominal origin."""
        moment = np.linalg.solve(turn_jacobian(self.platform_screw[:3]).T, load[:3])
        arm = self.platform_screw[3:]
        return np.concatenate([moment + np.cross(arm, load[3:]), load[3:]])

    def _load_curvature(self, load: NDArray) -> NDArray:
        """Return the load's curvature without the bracket terms of its wrench."""
        W, turn = self._at_origin, self.platform_screw[:3]
        order = self.model._order
        V = self.moves * self.model.on_platform
        later = np.sign(order - order[:, None])
        H = (V.T @ bracket_form(self.load_wrench(load)) @ V) * later / 2
        # to second order, a rotation w also moves the origin, translated by v, by w x v
        # / 2
        of_force = -W[:3].T @ skew(load[3:]) @ W[3:]
        H += (of_force + of_force.T) / 2
        # exp(turn + h) = exp(J h + D(h, h) / 2) exp(turn), for a given rotation
        # exp(turn) and a small rotation h after it
        along, zero = np.linalg.solve(turn_jacobian(turn), W[:3]), np.zeros(3)
        moment = np.linalg.solve(turn_jacobian(turn).T, load[:3])
        form = second_form(np.append(turn, zero), np.append(moment, zero))
        return H - along.T @ form[:3, :3] @ along


def place(model: FiniteRobot, x: NDArray) -> Placement:
    """Place a robot that is moved by finite screws.

    Args:
        model: robot with its unknowns.
        x: (N,) values of the unknowns.

    Returns:
        The placement, which evaluates the positions of all frames on demand.
    """
    return Placement(model, np.array(x, dtype=float))
