r"""Exact equilibrium equations of many measurements, at the current unknowns.

======  =============  ===========  ==================================================
symbol  code           shape        meaning
======  =============  ===========  ==================================================
e b     ``screws``     (2, R, n, 6) deformation of bodies and of joints, logarithms
q       ``motions``    (R, q)       free motions of passive joints
lambda  multipliers    (R, 6K)      multipliers of the scaled closures
d       deflections    (R, s)       deflections of contacts
======  =============  ===========  ==================================================
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exact.dead_load import (
    DeadLoads,
    dead_loads_of_rows,
    drive_wrenches,
    resultants,
)
from forcefit.assembly.exact.finite_robot import along_own
from forcefit.assembly.kinematics.closure_rates import closure_signs
from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.kinematics.se3 import (
    exponential,
    inverse,
    left_jacobian,
    logarithm,
    turn_jacobian,
)
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.without_clearance import (
    Flexibility,
    at_postures,
    pseudo_inverse,
)
from forcefit.assembly.model.links import own_screw
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, transform

_LINEAR_BELOW = 1e-9  # [rad or m] deflection below which a contact law is linear


@dataclass(frozen=True, eq=False)
class Rows:
    """Measurements and all quantities that do not change in the iteration.

    Attributes:
        conditions: conditions of R measurements.
        flexible: linear model at the distinct postures.
        posture_of_row: (R,) index of each measurement's posture among the distinct
            postures.
        linear_deflections: (R, s) [rad or m] deflections of contacts in the linear
            model.
    """

    conditions: Conditions
    flexible: Flexibility
    posture_of_row: NDArray
    linear_deflections: NDArray

    @cached_property
    def loads(self) -> DeadLoads:
        """Loads of all measurements, including weights."""
        c = self.conditions
        return dead_loads_of_rows(c.postures, c.errors, c.load, c.gravity, c.point)

    @cached_property
    def elastic_frames(self) -> tuple[NDArray, NDArray]:
        """Indices of frames with elastic bodies, and of frames with elastic joints."""
        with_contact = [
            self.conditions.robot.index(law.frame) for law in self.conditions.laws
        ]
        bodies = np.flatnonzero(self.flexible.body_compliances.any(axis=(1, 2)))
        joints = np.flatnonzero(self.flexible.joint_compliances.any(axis=(1, 2)))
        return bodies, np.union1d(joints, with_contact).astype(int)

    @cached_property
    def free_frames(self) -> NDArray:
        """Indices of the frames whose joints have free motions."""
        moved = self.flexible.free.any(axis=1).reshape(-1, 6)
        return np.flatnonzero(moved.any(axis=1))

    @cached_property
    def contacts(self) -> NDArray:
        """Unit screws of the joints with a contact, (6n, s)."""
        columns = np.zeros((
            6 * len(self.conditions.robot.frames),
            len(self.conditions.laws),
        ))
        for k, law in enumerate(self.conditions.laws):
            i = self.conditions.robot.index(law.frame)
            columns[6 * i : 6 * i + 6, k] = own_screw(self.conditions.robot.frames[i])
        return columns

    @cached_property
    def law_constants(self) -> tuple[NDArray, NDArray]:
        """Coefficients (s,) and exponents (s,) of the contacts."""
        laws = self.conditions.laws
        return (
            np.array([law.coefficient for law in laws]),
            np.array([law.exponent for law in laws]),
        )

    @cached_property
    def contact_compliance(self) -> NDArray:
        """Tangent compliances of the contacts, (R, s) [rad/(N m), m/N]."""
        c, n = self.law_constants
        size = np.abs(self.linear_deflections)
        return (
            np.where(size > _LINEAR_BELOW, 1 / n, 1.0)
            * np.maximum(size, _LINEAR_BELOW) ** (1 - n)
            / c
        )

    def tangent_deflection(self, w: NDArray) -> NDArray:
        """Return contact deflections under loads w by linearised laws, (R, s)."""
        c, n = self.law_constants
        load = (
            c
            * np.maximum(np.abs(self.linear_deflections), _LINEAR_BELOW) ** (n - 1)
            * self.linear_deflections
        )
        return self.linear_deflections + self.contact_compliance * (w - load)

    def deflection(self, w: NDArray) -> NDArray:
        """Return contact deflections under loads w, (R, s) [rad or m]."""
        c, n = self.law_constants
        least = c * _LINEAR_BELOW**n
        large = np.maximum(np.abs(w), least)
        return (large / c) ** (1 / n) * w / large

    @cached_property
    def times(self) -> Callable[[NDArray, NDArray], NDArray]:
        """Function that multiplies each vector by the matrix of its posture."""
        return at_postures(self.posture_of_row)

    def corrected(self, right_side: NDArray) -> NDArray:
        """Return the solutions of the linear model for right-hand sides (R, m)."""
        if not self.conditions.laws:
            return self.times(self.flexible.inverse, right_side)
        return np.einsum("rij,rj->ri", self._with_contacts, right_side)

    @cached_property
    def _with_contacts(self) -> NDArray:
        """Inverse of the scaled system with linearised contacts, (R, m, m)."""
        flexible = self.flexible
        contact_rows = np.einsum("cki,is->cks", flexible.rows, self.contacts)[
            self.posture_of_row
        ]
        M = flexible.system[self.posture_of_row].copy()
        count = contact_rows.shape[1]
        compliance = self.contact_compliance / flexible.softness
        M[:, :count, :count] += np.einsum(
            "rks,rs,rls->rkl", contact_rows, compliance, contact_rows
        )
        return pseudo_inverse(M)[0]

    @cached_property
    def bodies(self) -> NDArray:
        """Pose of each body with its error, in the parent frame, (R, n, 4, 4)."""
        errors = self.conditions.errors
        error_motion = transform(errors[..., 3:], rotation_matrix(errors[..., :3]))
        return self.conditions.robot.fixed_transforms @ error_motion

    @cached_property
    def commanded(self) -> NDArray:
        """Joint motions for the commanded coordinates, (R, n, 4, 4)."""
        return along_own(self.conditions.robot, self.conditions.coordinates)

    @cached_property
    def scale(self) -> NDArray:
        """Factors on a screw that divide translations by the reference length, (6,)."""
        return np.array([1.0, 1.0, 1.0, *[1 / size_of(self.conditions.robot)] * 3])

    @cached_property
    def closure_frames(self) -> NDArray:
        """Indices of the frames that the closures connect, (2, K)."""
        robot = self.conditions.robot
        pairs = [[robot.index(a), robot.index(b)] for a, b in robot.closures]
        return np.array(pairs, dtype=int).reshape(-1, 2).T

    @cached_property
    def nominal_closures(self) -> NDArray:
        """Nominal pose of a closure's second frame in its first, (R, K, 4, 4)."""
        first, second = self.closure_frames
        T = self.conditions.transforms
        return inverse(T[:, first]) @ T[:, second]


@dataclass(frozen=True, eq=False)
class RowState:
    """Current values of the unknowns in R measurements.

    Attributes:
        rows: measurements with their constant quantities.
        screws: (2, R, n, 6) deformations of bodies and of joints.
        motions: (R, q) free motions.
        multipliers: (R, 6K) multipliers of the scaled closures.
    """

    rows: Rows
    screws: NDArray
    motions: NDArray
    multipliers: NDArray

    @cached_property
    def passive_motion(self) -> NDArray:
        """Motions of passive joints from the nominal posture, (R, n) [rad or m]."""
        moved = self.motions @ self.rows.flexible.free.T
        own = [f.own_axis for f in self.rows.conditions.robot.frames]
        return moved.reshape(*self.screws.shape[1:])[..., np.arange(len(own)), own]

    @cached_property
    def poses(self) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Poses before and after body deformation, then after joint motions."""
        rows = self.rows
        partial = [rows.bodies]
        for frames, screws in zip(rows.elastic_frames, self.screws, strict=True):
            T = partial[-1].copy()
            T[:, frames] = T[:, frames] @ exponential(screws[:, frames])
            partial.append(T)
        partial.append(
            partial[-1] @ along_own(rows.conditions.robot, self.passive_motion)
        )
        relative = partial[-1] @ rows.commanded
        after = np.empty_like(relative)
        before = np.broadcast_to(np.eye(4), relative.shape).copy()
        for i, parent in enumerate(rows.conditions.robot.parents):
            if parent >= 0:
                before[:, i] = after[:, parent]
            after[:, i] = before[:, i] @ relative[:, i]
        return tuple(before @ T for T in partial)

    @property
    def platform(self) -> NDArray:
        """Pose of the platform, (R, 4, 4)."""
        robot = self.rows.conditions.robot
        return self.poses[3][:, robot.index(robot.platform)]

    @cached_property
    def platform_screw(self) -> NDArray:
        """Rotation vector of R R_nominal^T and translation of the origin, (R, 6)."""
        nominal = self.rows.conditions.postures.platform
        back = np.swapaxes(nominal[:, :3, :3], 1, 2)
        turn = rotation_vector(self.platform[:, :3, :3] @ back)
        return np.concatenate([turn, self.platform[:, :3, 3] - nominal[:, :3, 3]], 1)

    @cached_property
    def residual(self) -> NDArray:
        """Closure residuals [rad, reference lengths], (R, 6K)."""
        first, second = self.rows.closure_frames
        T, origin = (
            self.poses[3],
            self.rows.conditions.postures.platform[:, None, :3, 3],
        )
        G = T[:, first] @ self.rows.nominal_closures @ inverse(T[:, second])
        turn = G[..., :3, :3] - np.eye(3)
        G[..., :3, 3] += (turn @ origin[..., None])[..., 0]
        return (logarithm(G) * self.rows.scale).reshape(len(G), -1)

    @cached_property
    def total_wrenches(self) -> NDArray:
        """Wrenches through bodies and through joints, base axes, (2, R, n, 6).

        The wrenches act at the platform's nominal origin.
        """
        conditions, loads = self.rows.conditions, self.rows.loads
        posture, robot = conditions.postures, conditions.robot
        last = robot.index(robot.platform)
        closing = self.multipliers.reshape(len(conditions), -1, 6) * self.rows.scale
        closing = np.einsum("kn,rkj->rnj", closure_signs(robot), closing)
        J = turn_jacobian(self.platform_screw[:, :3])
        moment = np.linalg.solve(np.swapaxes(J, 1, 2), loads.load[:, :3, None])[..., 0]
        moment += np.cross(self.platform_screw[:, 3:], loads.load[:, 3:])
        platform = np.concatenate([moment, loads.load[:, 3:]], axis=1)[:, None]
        on_body = robot.on_path[last][:, None] * platform
        on_joint = on_body.copy()
        on_joint[:, last] = 0.0  # The load acts on the body of the platform.
        total = np.stack([on_body, on_joint]) + closing
        if loads.beyond_platform:
            carried = self.poses[3] @ self.rows.commanded
            total += resultants(posture, loads, self.poses[1], carried)[:2]
        if loads.drives.any():
            carried = self.poses[3] @ self.rows.commanded
            total[1] += drive_wrenches(posture, loads, carried)
        return total

    def wrenches(self, total: NDArray, poses: NDArray, frames: NDArray) -> NDArray:
        """Transform wrenches (R, k, 6) from the platform's origin to frames."""
        origin = self.rows.conditions.postures.platform[:, None, :3, 3]
        T, w = poses[:, frames], total[:, frames]
        moment = w[..., :3] - np.cross(T[..., :3, 3] - origin, w[..., 3:])
        parts = np.stack([moment, w[..., 3:]], axis=-2) @ T[..., :3, :3]
        return parts.reshape(w.shape)

    def imbalance(self) -> tuple[NDArray, NDArray, NDArray]:
        """Return the residuals of the constitutive laws and of the equilibrium.

        Returns:
            (2, R, n, 6) deformations due to the wrenches minus current deformations,
            (R, q) forces along free motions, and (R, s) loads of contacts.
        """
        rows, flexible = self.rows, self.rows.flexible
        screw_residual = -self.screws
        generalised = np.zeros_like(self.screws)
        for k, frames in enumerate(rows.elastic_frames):
            w = self.wrenches(self.total_wrenches[k], self.poses[k], frames)
            J = left_jacobian(self.screws[k][:, frames])
            w = (w[..., None, :] @ J)[..., 0, :]
            generalised[k][:, frames] = w
            C = (flexible.body_compliances, flexible.joint_compliances)[k][frames]
            screw_residual[k][:, frames] += np.einsum("kij,rkj->rki", C, w)
        joint_wrenches = np.zeros_like(self.screws[0])
        frames = rows.free_frames
        joint_wrenches[:, frames] = self.wrenches(
            self.total_wrenches[1], self.poses[2], frames
        )
        free = joint_wrenches.reshape(len(joint_wrenches), -1) @ flexible.free
        w = generalised[1].reshape(len(joint_wrenches), -1) @ rows.contacts
        return screw_residual, free, w
