r"""Where finite screws take a robot, how closures open, and their two derivatives.

At a frame, in its axes, motions act one after the other, each a screw's exponential:

    T_i = T_parent  F_i  exp(dl)^  exp(de)  exp(dc)  exp(db),   then the joint's own,

where F_i is the nominal body, exp(dl)^ the geometric error (rotation vector and
translation, both in the frame's axes) and the joint's own motion a turn about z, or a
slide along it, by its coordinate plus what a passive joint adds.

======  =================  ==========  =============================================
symbol  code               shape       meaning
======  =================  ==========  =============================================
x       ``x``              (N,)        unknowns: springs y, clearances u, motions q
r       ``residual``       (6 K,)      logarithms of the open closures, scaled
A       ``rows``           (6 K, N)    derivative of r
P       ``platform_rows``  (6, N)      derivative of the platform screw
V       ``moves``          (6, N)      small motion that each unknown makes
======  =================  ==========  =============================================

The logarithm of a product of motions exp(V_1 h_1) exp(V_2 h_2) ... is, to second
order, the sum of V_i h_i plus half of the brackets [V_i h_i, V_j h_j] of each pair in
its order: that, with the curvature of each exponential, is the second derivative.

Sources:
    Selig (2005), Geometric Fundamentals of Robotics, chapter 4 (brackets of screws,
    Campbell-Baker-Hausdorff).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.nominal import size_of
from assembly.kinematics.posture import Posture
from assembly.kinematics.se3 import (
    bracket_form,
    exponential,
    inverse,
    left_jacobian,
    logarithm,
    second_form,
    turn_jacobian,
)
from assembly.linear.closure import VirtualJoints, closure_signs
from assembly.model.robot import Robot
from stiffness.screws import (
    rotation_matrix,
    rotation_vector,
    screw_map,
    skew,
    transform,
)

LINK, PLAY, SPRING, OWN = range(4)  # the motions at a frame, in the order they act


@dataclass(frozen=True, eq=False)
class FiniteRobot:
    """A robot at a posture, ready to be moved by finite screws.

    Attributes:
        posture: where it stands nominally.
        joints: what may move; its columns are the unknowns y, u, q in this order.
    """

    posture: Posture
    joints: VirtualJoints

    @cached_property
    def _blocks(self) -> NDArray:
        """(n, 6, N) every column, by frame and component."""
        j = self.joints
        every = np.hstack([j.elastic, j.cones, j.free])
        return every.reshape(len(self.posture.robot.frames), 6, every.shape[1])

    @cached_property
    def frame(self) -> NDArray:
        """(N,) row of the frame each unknown acts at."""
        return np.argmax(np.abs(self._blocks).max(axis=1), axis=0)

    @cached_property
    def columns(self) -> NDArray:
        """(N, 6) screw of each unknown, in its frame's axes."""
        return self._blocks[self.frame, :, np.arange(len(self.frame))]

    @cached_property
    def motion(self) -> NDArray:
        """(N,) which of a frame's motions each unknown belongs to."""
        links, (nu, nq) = self.joints.links, (len(self.joints.group), self._free)
        kind = np.where(links, LINK, SPRING)
        kind = np.concatenate([kind, np.full(nu + nq, PLAY)])
        for i in range(len(links), len(kind)):
            frame = self.posture.robot.frames[self.frame[i]]
            own = frame.passive and not frame.compliant
            if own and self.columns[i, frame.own_axis]:
                kind[i] = OWN
        return kind

    @property
    def _free(self) -> int:
        """Number of motions without bound."""
        return self.joints.free.shape[1]

    @property
    def springs(self) -> slice:
        """Where the springs are among the unknowns."""
        return slice(0, len(self.joints.links))

    @property
    def bounded(self) -> slice:
        """Where the clearances are among the unknowns."""
        return slice(self.springs.stop, self.springs.stop + len(self.joints.group))

    @cached_property
    def units(self) -> NDArray:
        """(N,) scale of the unknowns: springs as they are, free motions in metric 1."""
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
        """(6,) of a screw: translations by the reference length."""
        return np.array([1.0, 1.0, 1.0, *[1 / self.size] * 3])

    @cached_property
    def metric(self) -> NDArray:
        """(N, N) squared size of the screws that unknowns make, rad and lengths."""
        together = self.same_motion & (self.frame[:, None] == self.frame)
        scaled = self.columns * self.scale
        return (scaled @ scaled.T) * together

    @cached_property
    def same_motion(self) -> NDArray:
        """(N, N) bool, whether two unknowns are parts of one screw."""
        return self._order[:, None] == self._order

    @cached_property
    def _order(self) -> NDArray:
        """(N,) place of each unknown's motion along any chain that holds it."""
        return 4 * self.frame + self.motion

    @cached_property
    def signs(self) -> NDArray:
        """(K, N) +1 on a closure's first chain, -1 on its second, 0 where shared."""
        return closure_signs(self.posture.robot)[:, self.frame]

    @cached_property
    def chains(self) -> tuple[NDArray, NDArray]:
        """(K, N) bool each: unknowns on a closure's first and second whole chain."""
        robot = self.posture.robot
        ends = self.closed_frames
        first, second = (robot.on_path[ends[:, k]][:, self.frame] for k in (0, 1))
        return first, second

    @cached_property
    def closed_frames(self) -> NDArray:
        """(K, 2) rows of the frames that each closure joins."""
        robot = self.posture.robot
        rows = [[robot.index(name) for name in pair] for pair in robot.closures]
        return np.array(rows, dtype=int).reshape(-1, 2)

    @cached_property
    def on_platform(self) -> NDArray:
        """(N,) bool, unknowns that move the platform."""
        robot = self.posture.robot
        return robot.on_path[robot.index(robot.platform)][self.frame]

    @cached_property
    def precedence(self) -> NDArray:
        """(K, N, N) +1 where the second unknown acts later round the loop, else -1.

        Round a loop means out along the first chain and back along the second.
        """
        along = np.where(self.signs > 0, self._order, 1e6 - self._order)
        return np.sign(along[:, None, :] - along[:, :, None])

    @cached_property
    def comes_before(self) -> NDArray:
        """(N, N) 1 where the second unknown moves by the first's, 1/2 in one motion."""
        above = self.posture.robot.on_path[self.frame][:, self.frame].T
        return above * (1.0 - np.sign(self._order[:, None] - self._order)) / 2

    @cached_property
    def bodies(self) -> NDArray:
        """(n, 4, 4) bodies with their geometric errors, seen from after the parent."""
        robot = self.posture.robot
        errors = robot.errors
        off = transform(errors[:, 3:], rotation_matrix(errors[:, :3]))
        return robot.fixed_transforms @ off

    @cached_property
    def shut(self) -> NDArray:
        """(K, 4, 4) a closure's second frame seen from its first, nominally."""
        first, second = self.posture.transforms[self.closed_frames.T]
        return inverse(first) @ second  # rounded files: not quite 1

    def place(self, x: NDArray) -> "Placement":
        """The robot moved by finite screws.

        Args:
            x: (N,) the unknowns.

        Returns:
            Where everything is then.
        """
        return Placement(self, np.array(x, dtype=float))


@dataclass(frozen=True, eq=False)
class Placement:
    """A robot moved by finite screws; closures may be open.

    Attributes:
        model: the robot.
        x: (N,) the unknowns.
    """

    model: FiniteRobot
    x: NDArray

    @cached_property
    def screws(self) -> NDArray:
        """(3, n, 6) screws of link, play and joint spring at each frame."""
        m = self.model
        s = np.zeros((4, len(m.posture.robot.frames), 6))
        np.add.at(s, (m.motion, m.frame), self.x[:, None] * m.columns)
        return s[:OWN]

    @cached_property
    def own(self) -> NDArray:
        """(n,) [rad or m] what passive joints move beyond their coordinate."""
        m = self.model
        rows = m.motion == OWN
        values = (self.x[:, None] * m.columns).sum(axis=1)
        return np.bincount(
            m.frame[rows], weights=values[rows], minlength=len(m.posture.coordinates)
        )

    @cached_property
    def _poses(self) -> NDArray:
        """(5, n, 4, 4) before each of a frame's motions, and after all small ones."""
        robot = self.model.posture.robot
        link, play, spring = exponential(self.screws)
        local = [self.model.bodies, link, play, spring, along_own(robot, self.own)]
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
    def bodies(self) -> NDArray:
        """(n, 4, 4) ends of the bodies, before their joint's play and springs."""
        return self._poses[1]

    @cached_property
    def carried(self) -> NDArray:
        """(n, 4, 4) what the joints carry: frames after their joint's coordinate."""
        posture = self.model.posture
        return self.transforms @ along_own(posture.robot, posture.coordinates)

    @property
    def transforms(self) -> NDArray:
        """(n, 4, 4) frames seen from the base, before their joint's coordinate."""
        return self._poses[4]

    @property
    def platform(self) -> NDArray:
        """(4, 4) where the platform is."""
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
        """(K, 4, 4) motions that closures lack, read at the platform's origin."""
        first, second = self.transforms[self.model.closed_frames.T]
        G = first @ self.model.shut @ inverse(second)
        origin = self.model.posture.platform[:3, 3]
        G[:, :3, 3] += (G[:, :3, :3] - np.eye(3)) @ origin
        return G

    @cached_property
    def _open_screws(self) -> NDArray:
        """(K, 6) [rad, m] their logarithms."""
        return logarithm(self._open)

    @cached_property
    def residual(self) -> NDArray:
        """(6 K,) how closures are open: [rad], translations per reference length."""
        return (self._open_screws * self.model.scale).ravel()

    @cached_property
    def largest_gap(self) -> float:
        """[rad, reference lengths] largest component of the residual."""
        return float(np.abs(self.residual).max(initial=0.0))

    @cached_property
    def _readings(self) -> NDArray:
        """(N, 6, 6) from each unknown's screw, as it acts, to the platform's origin."""
        m = self.model
        before = self._poses[m.motion, m.frame]
        offset = before[:, :3, 3] - m.posture.platform[:3, 3]
        return screw_map(offset, before[:, :3, :3])

    @cached_property
    def moves(self) -> NDArray:
        """(6, N) small motion of what follows, at the platform's nominal origin."""
        m = self.model
        sprung = np.concatenate([left_jacobian(self.screws), self._identity])
        local = sprung[m.motion, m.frame] @ m.columns[:, :, None]
        return (self._readings @ local)[..., 0].T

    @property
    def _identity(self) -> NDArray:
        """(1, n, 6, 6) for own motions, which are straight in their coordinate."""
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
        """(6, N) moves of the platform, read at its present origin."""
        away = self.model.posture.platform[:3, 3] - self.platform[:3, 3]
        return screw_map(away) @ (self.moves * self.model.on_platform)

    @cached_property
    def platform_rows(self) -> NDArray:
        """(6, N) derivative of the platform screw."""
        W = self._at_origin
        turn = np.linalg.solve(turn_jacobian(self.platform_screw[:3]), W[:3])
        return np.concatenate([turn, W[3:]])

    def curvature(self, multipliers: NDArray, load: NDArray) -> NDArray:
        """Second derivative of multipliers . residual + load . platform screw.

        Exact where the closures hold; elsewhere off by the order of the residual, and
        of the square of the platform's turn if the load has a moment.

        Args:
            multipliers: (6 K,) of the scaled residual.
            load: (6,) [N m, N] on the platform at its origin, base axes.

        Returns:
            (N, N) symmetric.
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
            here = self.load_wrench(load)
            through = through + m.on_platform[:, None] * here
            H += self._load_curvature(load)
        return H + self.bent(through)

    def bent(self, through: NDArray) -> NDArray:
        """Part of the curvature that comes from each exponential by itself.

        Args:
            through: (N, 6) wrench on what each unknown moves, at the platform's nominal
                origin, base axes.

        Returns:
            (N, N) symmetric.
        """
        m = self.model
        local = np.einsum("nji,nj->ni", self._readings, through)
        wrenches = np.zeros((4, len(self.own), 6))
        wrenches[m.motion, m.frame] = local
        forms = np.zeros((4, len(self.own), 6, 6))
        forms[:OWN] = second_form(self.screws, wrenches[:OWN])
        bent = (forms[m.motion, m.frame] @ m.columns[:, :, None])[..., 0]
        return (bent @ m.columns.T) * m.same_motion

    def load_wrench(self, load: NDArray) -> NDArray:
        """(6,) what does the load's work: read at the nominal origin, base axes."""
        moment = np.linalg.solve(turn_jacobian(self.platform_screw[:3]).T, load[:3])
        arm = self.platform_screw[3:]
        return np.concatenate([moment + np.cross(arm, load[3:]), load[3:]])

    def _load_curvature(self, load: NDArray) -> NDArray:
        """Part of the curvature that the load has beside its wrench's brackets."""
        W, turn = self._at_origin, self.platform_screw[:3]
        order = self.model._order
        V = self.moves * self.model.on_platform
        later = np.sign(order - order[:, None])
        H = (V.T @ bracket_form(self.load_wrench(load)) @ V) * later / 2
        # a turn by w moves the origin, itself moving by v, by w x v / 2
        pull = -W[:3].T @ skew(load[3:]) @ W[3:]
        # log(exp(w) exp(turn)) has w x (w x turn) / 12 beside what is linear in w
        outer = np.outer(load[:3], turn)
        round_ = (outer + outer.T) / 2 - (load[:3] @ turn) * np.eye(3)
        return H + (pull + pull.T) / 2 + W[:3].T @ round_ @ W[:3] / 6


def along_own(robot: Robot, coordinates: NDArray) -> NDArray:
    """(..., n, 4, 4) motions about or along each joint's z by (..., n) coordinates."""
    screws = np.zeros((*coordinates.shape, 6))
    axes = [frame.own_axis for frame in robot.frames]
    screws[..., np.arange(len(axes)), axes] = coordinates
    return exponential(screws)


def carried_nominally(posture: Posture) -> NDArray:
    """(..., n, 4, 4) what the joints carry where nothing is wrong."""
    return posture.transforms @ along_own(posture.robot, posture.coordinates)
