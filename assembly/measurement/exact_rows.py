r"""The exact equilibrium of a robot without play, in many situations at once.

The equations are those of :mod:`assembly.exact.exact`: closures hold on SE(3), every
body and spring gives by its compliance times what goes through it, free motions carry
nothing.  All rows are corrected together by the linear model's inverse at the nominal
posture (:mod:`assembly.linear.without_clearance`), so the first correction is the
linear answer and each further one shrinks the error by the size of the motions (a chord
method).  Rows that do not come to rest are left to
:func:`assembly.exact.exact.solve_exact`.

======  =============  ===========  ==================================================
symbol  code           shape        meaning
======  =============  ===========  ==================================================
e b     ``screws``     (2, R, n, 6) deformation of bodies and of joints, logarithms
q       ``motions``    (R, q)       free motions of passive joints
lambda  multipliers    (R, 6K)      of the scaled closures
d       ``give``       (R, s)       deflections of contacts
======  =============  ===========  ==================================================

Sources:
    Ortega, Rheinboldt, Iterative Solution of Nonlinear Equations in Several Variables,
    section 7.1 (chord methods).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly.exact.dead_load import DeadLoads, resultants, row_loads
from assembly.exact.placement import along_own
from assembly.kinematics.nominal import size_of
from assembly.kinematics.pieces import cut_beams
from assembly.kinematics.se3 import (
    exponential,
    inverse,
    left_jacobian,
    logarithm,
    turn_jacobian,
)
from assembly.linear.closure import closure_signs
from assembly.linear.without_clearance import (
    Flexibility,
    at_postures,
    flexibility,
    in_groups,
    pseudo_inverse,
)
from assembly.measurement.conditions import Conditions
from stiffness.screws import rotation_matrix, rotation_vector, transform

_CORRECTIONS = 60  # at most; 5 to 12 are usual
_STILL = 1e-12  # [rad, reference lengths] largest change of a screw at the end
_CLOSED = 1e-11  # [rad, reference lengths] what an answer may leave open
_FREE = 1e-5  # of the largest wrench: what may push on a motion that stays where it is
_MISFIT = 1e-9  # [rad, reference lengths] whose wrench counts as none
_SHRINKS = 0.8  # by which every correction but the first few must be smaller
_TRUSTED = 3  # corrections that may grow
_TINY = 1e-9  # [rad or m] deflections of a contact below which it is linear
_AT_ONCE = 100  # rows, so that memory stays small


def solve_rows(here: Conditions, give: NDArray) -> tuple[NDArray, NDArray]:
    """Where finite motions take the platform under every row's loads.

    Args:
        here: R situations of a robot without play; ``exact`` is taken for granted.
        give: (R, s) [rad or m] deflections of the s contacts in the linear model.

    Returns:
        (R, 6) [rad, m] rotation vector of R R_nominal^T and shift of the origin, base
        axes, and (R,) where they are found; elsewhere nothing is claimed.
    """
    here = _in_pieces(here)
    screws, found = np.full((len(here), 6), np.nan), np.zeros(len(here), dtype=bool)
    distinct, which = in_groups(here.postures)
    flexible = flexibility(distinct)
    own = [6 * i + f.own_axis for i, f in enumerate(here.robot.frames) if f.passive]
    moved = np.flatnonzero(flexible.free.any(axis=1))
    if not np.isin(moved, own).all():
        return screws, found  # a fixed joint that is free to move: row by row
    for begin in range(0, len(here), _AT_ONCE):
        rows = slice(begin, begin + _AT_ONCE)
        some = here.take(np.arange(len(here))[rows])
        batch = _Rows(some, flexible, which[rows], give[rows])
        screws[rows], found[rows] = _come_to_rest(batch)
    return screws, found


def _in_pieces(here: Conditions) -> Conditions:
    """The same situations with a frame for every piece of a beam."""
    cut = cut_beams(here.robot)
    if cut.robot is here.robot:
        return here
    there = cut.cut(here.postures)
    return replace(
        here, robot=cut.robot, coordinates=there.coordinates,
        transforms=there.transforms, errors=cut.spread(here.errors),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows to be solved, and what does not change while they are.

    Attributes:
        here: R situations.
        flexible: the linear model at the distinct postures.
        which: (R,) which of them a row has.
        give: (R, s) [rad or m] deflections of contacts in the linear model.
    """

    here: Conditions
    flexible: Flexibility
    which: NDArray
    give: NDArray

    @cached_property
    def loads(self) -> DeadLoads:
        """All that acts."""
        h = self.here
        return row_loads(h.postures, h.errors, h.load, h.gravity, h.point)

    @cached_property
    def soft(self) -> tuple[NDArray, NDArray]:
        """Frames whose bodies, and whose joints, give."""
        own = [self.here.robot.index(law.frame) for law in self.here.laws]
        bodies = np.flatnonzero(self.flexible.bodies.any(axis=(1, 2)))
        joints = np.flatnonzero(self.flexible.joints.any(axis=(1, 2)))
        return bodies, np.union1d(joints, own).astype(int)

    @cached_property
    def loose(self) -> NDArray:
        """Frames whose joints move freely."""
        moved = self.flexible.free.any(axis=1).reshape(-1, 6)
        return np.flatnonzero(moved.any(axis=1))

    @cached_property
    def contacts(self) -> NDArray:
        """(6n, s) unit screws of the joints with a contact."""
        columns = np.zeros((6 * len(self.here.robot.frames), len(self.here.laws)))
        for k, law in enumerate(self.here.laws):
            i = self.here.robot.index(law.frame)
            columns[6 * i + self.here.robot.frames[i].own_axis, k] = 1.0
        return columns

    @cached_property
    def law(self) -> tuple[NDArray, NDArray]:
        """(s,) coefficients and exponents of contacts."""
        laws = self.here.laws
        return (
            np.array([law.coefficient for law in laws]),
            np.array([law.exponent for law in laws]),
        )

    @cached_property
    def slope(self) -> NDArray:
        """(R, s) [rad/(N m), m/N] how much more contacts give per load."""
        c, n = self.law
        size = np.abs(self.give)
        return (
            np.where(size > _TINY, 1 / n, 1.0) * np.maximum(size, _TINY) ** (1 - n) / c
        )

    def tangent(self, w: NDArray) -> NDArray:
        """(R, s) [rad or m] deflections under loads, on the linear answer's tangent."""
        c, n = self.law
        load = c * np.maximum(np.abs(self.give), _TINY) ** (n - 1) * self.give
        return self.give + self.slope * (w - load)

    def deflection(self, w: NDArray) -> NDArray:
        """(R, s) [rad or m] of the contacts under loads."""
        c, n = self.law
        least = c * _TINY**n
        large = np.maximum(np.abs(w), least)
        return (large / c) ** (1 / n) * w / large

    @cached_property
    def times(self) -> Callable[[NDArray, NDArray], NDArray]:
        """What multiplies vectors of the rows by matrices of their postures."""
        return at_postures(self.which)

    def corrected(self, b: NDArray) -> NDArray:
        """(R, m) what the linear model makes of right sides (R, m)."""
        if not self.here.laws:
            return self.times(self.flexible.inverse, b)
        return np.einsum("rij,rj->ri", self._with_contacts, b)

    @cached_property
    def _with_contacts(self) -> NDArray:
        """(R, m, m) inverse of the scaled system, contacts springs of their slope."""
        flexible = self.flexible
        through = np.einsum("cki,is->cks", flexible.rows, self.contacts)[self.which]
        M = flexible.system[self.which].copy()
        count = through.shape[1]
        softer = self.slope / flexible.softness
        M[:, :count, :count] += np.einsum("rks,rs,rls->rkl", through, softer, through)
        return pseudo_inverse(M)[0]

    @cached_property
    def bodies(self) -> NDArray:
        """(R, n, 4, 4) bodies with their errors, seen from after the parent."""
        errors = self.here.errors
        off = transform(errors[..., 3:], rotation_matrix(errors[..., :3]))
        return self.here.robot.fixed_transforms @ off

    @cached_property
    def commanded(self) -> NDArray:
        """(R, n, 4, 4) motions of the joints as commanded."""
        return along_own(self.here.robot, self.here.coordinates)

    @cached_property
    def scale(self) -> NDArray:
        """(6,) of a screw: translations by the reference length."""
        return np.array([1.0, 1.0, 1.0, *[1 / size_of(self.here.robot)] * 3])

    @cached_property
    def closed(self) -> NDArray:
        """(2, K) frames that closures join."""
        robot = self.here.robot
        pairs = [[robot.index(a), robot.index(b)] for a, b in robot.closures]
        return np.array(pairs, dtype=int).reshape(-1, 2).T

    @cached_property
    def shut(self) -> NDArray:
        """(R, K, 4, 4) a closure's second frame seen from its first, nominally."""
        first, second = self.closed
        T = self.here.transforms
        return inverse(T[:, first]) @ T[:, second]


@dataclass(frozen=True, eq=False)
class _State:
    """Where R rows are.

    Attributes:
        rows: which.
        screws: (2, R, n, 6) deformations of bodies and of joints.
        motions: (R, q) free motions.
        multipliers: (R, 6K) of the scaled closures.
    """

    rows: _Rows
    screws: NDArray
    motions: NDArray
    multipliers: NDArray

    @cached_property
    def own(self) -> NDArray:
        """(R, n) [rad or m] what passive joints move beyond their coordinate."""
        moved = self.motions @ self.rows.flexible.free.T
        return moved.reshape(*self.screws.shape[1:]).sum(axis=-1)

    @cached_property
    def poses(self) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """(R, n, 4, 4) before a body's deformation, after it, the joint's, all."""
        rows = self.rows
        local = [rows.bodies]
        for frames, screws in zip(rows.soft, self.screws, strict=True):
            T = local[-1].copy()
            T[:, frames] = T[:, frames] @ exponential(screws[:, frames])
            local.append(T)
        local.append(local[-1] @ along_own(rows.here.robot, self.own))
        step = local[-1] @ rows.commanded
        after = np.empty_like(step)
        before = np.broadcast_to(np.eye(4), step.shape).copy()
        for i, parent in enumerate(rows.here.robot.parents):
            if parent >= 0:
                before[:, i] = after[:, parent]
            after[:, i] = before[:, i] @ step[:, i]
        return tuple(before @ T for T in local)

    @property
    def platform(self) -> NDArray:
        """(R, 4, 4) where the platform is."""
        robot = self.rows.here.robot
        return self.poses[3][:, robot.index(robot.platform)]

    @cached_property
    def platform_screw(self) -> NDArray:
        """(R, 6) rotation vector of R R_nominal^T and shift of the origin."""
        nominal = self.rows.here.postures.platform
        back = np.swapaxes(nominal[:, :3, :3], 1, 2)
        turn = rotation_vector(self.platform[:, :3, :3] @ back)
        return np.concatenate([turn, self.platform[:, :3, 3] - nominal[:, :3, 3]], 1)

    @cached_property
    def residual(self) -> NDArray:
        """(R, 6K) how closures are open: [rad], translations per reference length."""
        first, second = self.rows.closed
        T, origin = self.poses[3], self.rows.here.postures.platform[:, None, :3, 3]
        G = T[:, first] @ self.rows.shut @ inverse(T[:, second])
        turn = G[..., :3, :3] - np.eye(3)
        G[..., :3, 3] += (turn @ origin[..., None])[..., 0]
        return (logarithm(G) * self.rows.scale).reshape(len(G), -1)

    @cached_property
    def through(self) -> NDArray:
        """(2, R, n, 6) on all that bodies hold and on all that joints hold, base axes.

        At the platform's nominal origin.
        """
        here, loads = self.rows.here, self.rows.loads
        posture, robot = here.postures, here.robot
        last = robot.index(robot.platform)
        closing = self.multipliers.reshape(len(here), -1, 6) * self.rows.scale
        closing = np.einsum("kn,rkj->rnj", closure_signs(robot), closing)
        J = turn_jacobian(self.platform_screw[:, :3])
        moment = np.linalg.solve(np.swapaxes(J, 1, 2), loads.load[:, :3, None])[..., 0]
        moment += np.cross(self.platform_screw[:, 3:], loads.load[:, 3:])
        platform = np.concatenate([moment, loads.load[:, 3:]], axis=1)[:, None]
        on_body = robot.on_path[last][:, None] * platform
        on_joint = on_body.copy()
        on_joint[:, last] = 0.0  # the load acts on the platform's body
        through = np.stack([on_body, on_joint]) + closing
        if loads.beyond_platform:
            carried = self.poses[3] @ self.rows.commanded
            through += resultants(posture, loads, self.poses[1], carried)[:2]
        return through

    def wrenches(self, through: NDArray, place: NDArray, frames: NDArray) -> NDArray:
        """(R, k, 6) wrenches at the platform's origin, read at some frames' places."""
        origin = self.rows.here.postures.platform[:, None, :3, 3]
        T, w = place[:, frames], through[:, frames]
        moment = w[..., :3] - np.cross(T[..., :3, 3] - origin, w[..., 3:])
        both = np.stack([moment, w[..., 3:]], axis=-2) @ T[..., :3, :3]
        return both.reshape(w.shape)

    def misfit(self) -> tuple[NDArray, NDArray, NDArray]:
        """(2, R, n, 6) what springs lack; forces on motions (R, q), contacts (R, s)."""
        rows, flexible = self.rows, self.rows.flexible
        lack = -self.screws
        generalised = np.zeros_like(self.screws)
        for k, frames in enumerate(rows.soft):
            w = self.wrenches(self.through[k], self.poses[k], frames)
            J = left_jacobian(self.screws[k][:, frames])
            w = (w[..., None, :] @ J)[..., 0, :]
            generalised[k][:, frames] = w
            C = (flexible.bodies, flexible.joints)[k][frames]
            lack[k][:, frames] += np.einsum("kij,rkj->rki", C, w)
        own = np.zeros_like(self.screws[0])
        frames = rows.loose
        own[:, frames] = self.wrenches(self.through[1], self.poses[2], frames)
        free = own.reshape(len(own), -1) @ flexible.free
        w = generalised[1].reshape(len(own), -1) @ rows.contacts
        return lack, free, w


def _come_to_rest(rows: _Rows) -> tuple[NDArray, NDArray]:
    """(R, 6) platform screws after corrections, and (R,) whether they came to rest."""
    flexible, count = rows.flexible, len(rows.here)
    n, K = len(rows.here.robot.frames), 6 * len(rows.here.robot.closures)
    q = flexible.free.shape[1]
    state = _State(
        rows, np.zeros((2, count, n, 6)), np.zeros((count, q)), np.zeros((count, K))
    )
    size, going = np.full(count, np.inf), ~flexible.doubt[rows.which]
    going &= np.isfinite(rows.slope).all(axis=1)
    for turn in range(_CORRECTIONS):
        screws, motions, multipliers = _correction(state, first=turn == 0)
        moves = screws.sum(axis=0) * rows.scale
        moves = moves.reshape(count, -1) + motions @ flexible.free.T
        last, size = size, np.abs(moves).max(axis=1, initial=0.0)
        growing = size > (_SHRINKS if turn > _TRUSTED else 1e3) * last
        going &= np.isfinite(size) & (size < 1.0) & ~(growing & (size > _STILL))
        if np.all(~going | (size <= _STILL)):
            break
        still = ~going
        for part in (screws.swapaxes(0, 1), motions, multipliers):
            part[still] = 0.0
        state = _State(
            rows, state.screws + screws, state.motions + motions,
            state.multipliers + multipliers,
        )  # fmt: skip
    found = going & (size <= _STILL)
    found &= np.abs(state.residual).max(axis=1, initial=0.0) <= _CLOSED
    found &= np.all(np.abs(state.motions) <= flexible.limit, axis=1)
    _, pushed, _ = state.misfit()
    least = _MISFIT / flexible.softness  # without load there is but rounding
    largest = np.abs(state.through / rows.scale).max(axis=(0, 2, 3), initial=least)
    found &= np.all(np.abs(pushed) * _lever(rows) <= _FREE * largest[:, None], axis=1)
    return state.platform_screw, found


def _lever(rows: _Rows) -> NDArray:
    """(q,) [1 or m] by which forces on free motions become moments."""
    free = rows.flexible.free
    return np.abs(free).T @ np.tile(1 / rows.scale, len(free) // 6)


def _correction(state: _State, first: bool) -> tuple[NDArray, NDArray, NDArray]:
    """Changes of screws, motions and multipliers that the linear model asks for."""
    rows, flexible = state.rows, state.rows.flexible
    lack, free, w = state.misfit()
    count, shape = len(rows.here), (len(rows.here), -1, 6)
    if rows.here.laws:
        give = rows.tangent(w) if first else rows.deflection(w)
        lack[1] += (give @ rows.contacts.T).reshape(shape)
    J, softness, times = flexible.rows, flexible.softness, rows.times
    left = state.residual + times(J, lack.sum(axis=0).reshape(count, -1))
    b = -np.concatenate([left, free * softness], axis=1)
    x = rows.corrected(b)
    multipliers, motions = x[:, : J.shape[1]] / softness, x[:, J.shape[1] :]
    closing = times(np.swapaxes(J, 1, 2), multipliers)
    if rows.here.laws:
        further = (closing @ rows.contacts) * rows.slope @ rows.contacts.T
        lack[1] += further.reshape(shape)
    lack[0] += np.einsum("nij,rnj->rni", flexible.bodies, closing.reshape(shape))
    lack[1] += np.einsum("nij,rnj->rni", flexible.joints, closing.reshape(shape))
    return lack, motions, multipliers
