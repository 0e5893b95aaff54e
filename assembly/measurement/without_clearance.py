"""Minimum energy (22) of a robot without clearances in many measurements.

Without clearances, all unknowns of (22) are unbounded, and the optimality conditions
are a linear system in the closure multipliers and the free motions,

    [ J C J'   J F ] [lambda]      [ J (dl + C f) ]
    [ F' J'     0  ] [  q   ]  = - [    F' f      ].

Here C contains the compliances of bodies and joints, f the loads on them, J the
closures, and F the free motions.  The matrix is factorised once for each posture.

======  ====================  ===========  ===========================================
symbol  code                  shape        meaning
======  ====================  ===========  ===========================================
J       ``rows``              (c,6K,6n)    closures at c postures, scaled
P       ``platform``          (c,6,6n)     from frame screws to platform screw, eq. (8)
lambda  ``multipliers``       (R,6K)       multipliers of the scaled closures
w       ``joint_wrenches``    (R,6n)       wrenches through all joints
======  ====================  ===========  ===========================================
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.kinematics.posture import Content, Posture, Unchanged, content_of
from forcefit.assembly.kinematics.ranks import RANK
from forcefit.assembly.linear.closure import (
    closure_signs,
    in_reference_lengths,
    virtual_joints,
)
from forcefit.assembly.linear.load import FrameLoads
from forcefit.assembly.model.clearance import clearance_bounds, component_bounds
from forcefit.assembly.model.links import (
    joint_compliances,
    link_compliances,
    own_screws,
)

# Relative size below which an eigenvalue is round-off. The rank is ambiguous if an
# eigenvalue is above this size and below RANK.
_ROUNDING = 1e-13
# largest ratio of padded rows to rows in a batch
_PADDING = 4
_CLOSED = 1e-9  # largest relative residual of a solved system
_CLOSED_ABSOLUTE = 1e-12  # [rad, reference lengths] residual that is only round-off


@dataclass(frozen=True, eq=False)
class Flexibility:
    """Robot without clearances at c postures, with factorised closures.

    Attributes:
        rows: (c, 6K, 6n) scaled closure rows.
        platform: (c, 6, 6n) map from the screws of all frames to the platform screw.
        body_compliances: (n, 6, 6) compliances of bodies in the frames' axes.
        joint_compliances: (n, 6, 6) compliances of joints in the frames' axes.
        free: (6n, q) unit columns of the free motions.
        limit: (q,) [rad, m] bounds of the free motions, inf without a bound.
        inverse: (c, m, m) inverse of the scaled system, m = 6K + q.
        system: (c, m, m) the scaled system.
        softness: factor that divides the compliances in the scaled system, so that its
            entries are of order 1.
        ambiguous: (c,) bool, True if the numerical rank at the posture is ambiguous.
    """

    rows: NDArray
    platform: NDArray
    body_compliances: NDArray
    joint_compliances: NDArray
    free: NDArray
    limit: NDArray
    inverse: NDArray
    system: NDArray
    softness: float
    ambiguous: NDArray

    @cached_property
    def compliance(self) -> NDArray:
        """Sum of the compliances of each body and its joint, (n, 6, 6)."""
        return self.body_compliances + self.joint_compliances

    def solve(
        self, posture: NDArray, errors: NDArray, loads: FrameLoads
    ) -> "FlexibleAssembly":
        """Solve for the assemblies in R measurements.

        Args:
            posture: (R,) index of the posture of each measurement.
            errors: (R, 6n) [rad, m] stress-free screws.
            loads: (R, 6n) loads on every small screw.

        Returns:
            The assemblies, which are invalid where :attr:`FlexibleAssembly.solved` is
            False.
        """
        under_load = _under_load(self, loads)
        unclosed = errors if under_load is None else errors + under_load
        J, size, times = self.rows, self.softness, at_postures(posture)
        if not self.system.size:  # open chain
            return FlexibleAssembly(
                platform_screw=times(self.platform, unclosed),
                joint_wrenches=loads.joint,
                multipliers=np.zeros((len(errors), 0)),
                solved=~self.ambiguous[posture],
            )
        on_free = loads.joint @ self.free * size
        b = -np.concatenate([times(J, unclosed), on_free], axis=1)
        x = times(self.inverse, b)
        x -= times(self.inverse, times(self.system, x) - b)  # iterative refinement
        count = J.shape[1]
        multipliers, motions = x[:, :count] / size, x[:, count:]
        residual = np.abs(times(self.system, x) - b).max(axis=1)
        scale = np.abs(b).max(axis=1)
        closed = residual <= np.maximum(_CLOSED * scale, _CLOSED_ABSOLUTE)
        within = np.all(np.abs(motions) <= self.limit, axis=1)
        closing = times(J.mT, multipliers)
        screws = unclosed + _each(self.compliance, closing) + motions @ self.free.T
        return FlexibleAssembly(
            platform_screw=times(self.platform, screws),
            joint_wrenches=closing + loads.joint,
            multipliers=multipliers,
            solved=closed & within & ~self.ambiguous[posture],
        )

    def self_stress(self, columns: NDArray, read: NDArray | None = None) -> NDArray:
        """Compute the self-stress of the closed structure due to stress-free screws.

        Args:
            columns: (6n, s) screws at the frames.
            read: (6n, t) screws along which forces are evaluated; by default
                ``columns``.

        Returns:
            (c, t, s) generalised force along each column of ``read`` per unit of each
            column of ``columns``; negative semidefinite if both are equal.
        """
        through = self.rows @ columns
        met = through if read is None else self.rows @ read
        count = self.rows.shape[1]
        inner = self.inverse[:, :count, :count] / self.softness
        return -(met.mT @ (inner @ through))

    def platform_of(self, columns: NDArray) -> NDArray:
        """Compute the platform screw due to stress-free screws at the frames.

        Args:
            columns: (6n, s) screws at the frames.

        Returns:
            (c, 6, s) [rad, m] platform screw per unit of each column.
        """
        count = self.rows.shape[1]
        if not count:
            return self.platform @ columns
        x = -(self.inverse[:, :, :count] @ (self.rows @ columns))
        closing = self.rows.mT @ (x[:, :count] / self.softness)
        n = len(self.compliance)
        bent = self.compliance @ closing.reshape(len(x), n, 6, -1)
        screws = columns + bent.reshape(closing.shape) + self.free @ x[:, count:]
        return self.platform @ screws


@lru_cache(maxsize=4)
def responses_to(
    flexible: Flexibility, columns: bytes, shape: tuple[int, int]
) -> tuple[NDArray, NDArray, NDArray]:
    """Compute the responses to stress-free screws at the frames.

    Args:
        flexible: factorised model at c postures.
        columns: (6n, s) screws as bytes, so that results can be cached.
        shape: the shape (6n, s).

    Returns:
        (c, 6, s) platform screws, (c, s, s) generalised reaction forces, and (c, 6n, s)
        wrenches at every joint, per unit of each screw.
    """
    screws = np.frombuffer(columns).reshape(shape)
    everywhere = flexible.self_stress(screws, np.eye(shape[0]))
    return flexible.platform_of(screws), screws.T @ everywhere, everywhere


@dataclass(frozen=True, eq=False)
class FlexibleAssembly:
    """R assemblies of a robot without clearances.

    Attributes:
        platform_screw: (R, 6) [rad, m] screws at the platform's origin, base axes.
        joint_wrenches: (R, 6n) [N m, N] wrenches through all joints, in the frames'
            axes.
        multipliers: (R, 6K) multipliers of the scaled closures.
        solved: (R,) bool, False where the assembly is invalid.
    """

    platform_screw: NDArray
    joint_wrenches: NDArray
    multipliers: NDArray
    solved: NDArray


@lru_cache(maxsize=4)
def _under_load(flexible: Flexibility, loads: FrameLoads) -> NDArray | None:
    """Return the deformations of an open chain under the loads, (R, 6n)."""
    # The result is cached, because it does not depend on the errors.
    if not loads:
        return None
    screws = _each(flexible.body_compliances, loads.body)
    screws += _each(flexible.joint_compliances, loads.joint)
    return screws


def at_postures(posture: NDArray) -> Callable[[NDArray, NDArray], NDArray]:
    """Return a function that multiplies each vector by the matrix of its posture.

    Args:
        posture: (R,) index of the posture of each vector.

    Returns:
        A function of matrices (c, a, b) and vectors (R, b) that returns products (R,
        a).
    """
    return _at_postures(Unchanged(posture))


@lru_cache(maxsize=8)
def _at_postures(unchanged: Unchanged) -> Callable[[NDArray, NDArray], NDArray]:
    """Return the cached function of :func:`at_postures`."""
    posture = unchanged.numbers
    names, own, count = np.unique(posture, return_inverse=True, return_counts=True)
    order = np.argsort(own, kind="stable")
    place = np.empty_like(order)  # index among the rows of the same posture
    place[order] = np.arange(len(order)) - np.repeat(np.cumsum(count) - count, count)
    most = int(count.max(initial=0))

    def times(matrices: NDArray, vectors: NDArray) -> NDArray:
        if len(names) * most > _PADDING * len(own):
            return np.einsum("rij,rj->ri", matrices[posture], vectors)
        used = matrices if len(names) == len(matrices) else matrices[names]
        if most == 1:
            products = np.empty((len(own), matrices.shape[1]))
            products[order] = (used @ vectors[order][:, :, None])[..., 0]
            return products
        together = np.zeros((len(names), most, vectors.shape[1]))
        together[own, place] = vectors
        return (together @ used.mT)[own, place]

    return times


def flexibility(postures: Posture) -> Flexibility:
    """Factorise the closures of a robot without clearances.

    Args:
        postures: c postures with transforms (c, n, 4, 4).

    Returns:
        The factorised model at these postures.

    Raises:
        ValueError: the robot has clearances.
    """
    robot = postures.robot
    # The factorisation is cached. It does not depend on errors and loads.
    springs = link_compliances(robot), joint_compliances(robot)
    arrays = *springs, clearance_bounds(robot), own_screws(robot)
    return _factorise(content_of(postures, arrays, (robot.closures, robot.platform)))


@lru_cache(maxsize=4)
def _factorise(content: Content) -> Flexibility:
    """Assemble and invert the system at every posture."""
    postures, (C_body, C_joint, *_) = content.postures, content.arrays
    robot = postures.robot
    joints = virtual_joints(robot)
    if joints.cones.shape[1]:
        raise ValueError(
            f"{robot.name}: found a clearance, expected a robot without "
            "clearance, whose model is linear"
        )
    n, count = len(robot.frames), len(postures.transforms)
    size = size_of(robot)
    scale = in_reference_lengths(size)
    paths = postures.paths
    J = np.einsum("kn,cnij,i->ckinj", closure_signs(robot), paths, scale)
    J = J.reshape(count, 6 * len(robot.closures), 6 * n)
    on_path = robot.on_path[robot.index(robot.platform)]
    P = np.einsum("n,cnij->cinj", on_path, paths).reshape(count, 6, 6 * n)
    through = np.einsum("cknj,nij->ckni", J.reshape(count, -1, n, 6), C_body + C_joint)
    S = np.einsum("cki,cli->ckl", through.reshape(J.shape), J)
    softness = float(np.abs(S).max(initial=0.0)) or 1.0
    JF = J @ joints.free
    nothing = np.zeros((count, *JF.shape[2:] * 2))
    M = np.block([[S / softness, JF], [JF.mT, nothing]])
    inverse, ambiguous = pseudo_inverse(M)
    return Flexibility(
        rows=J,
        platform=P,
        body_compliances=C_body,
        joint_compliances=C_joint,
        free=joints.free,
        limit=_limits(postures, joints.free),
        inverse=inverse,
        system=M,
        softness=softness,
        ambiguous=ambiguous,
    )


def pseudo_inverse(M: NDArray) -> tuple[NDArray, NDArray]:
    """Return pseudoinverses, (c, m, m), and a mask of ambiguous ranks, (c,)."""
    if not M.size:
        return M, np.zeros(len(M), dtype=bool)
    values, vectors = np.linalg.eigh(M)
    size = np.abs(values)
    # Without closures, the largest value is zero.
    largest = size.max(axis=1, keepdims=True)
    kept = size > RANK * largest
    ambiguous = np.any((size > _ROUNDING * largest) & ~kept, axis=1)
    inverted = np.divide(1.0, values, out=np.zeros_like(values), where=kept)
    return np.einsum("cij,cj,ckj->cik", vectors, inverted, vectors), ambiguous


def _limits(postures: Posture, free: NDArray) -> NDArray:
    """Return the bounds of the free motions, (q,)."""
    bounds = component_bounds(clearance_bounds(postures.robot)).ravel()
    return bounds[np.abs(free).argmax(axis=0)]


def _each(matrices: NDArray, screws: NDArray) -> NDArray:
    """Return products of each frame's matrix and its screws or wrenches, (R, 6n)."""
    blocks = np.swapaxes(screws.reshape(len(screws), -1, 6), 0, 1)
    products = blocks @ matrices.mT
    return np.swapaxes(products, 0, 1).reshape(screws.shape)
