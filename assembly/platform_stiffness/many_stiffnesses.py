"""The classical stiffness of the platform at many postures at once, with its shares."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.nominal import size_of
from assembly.kinematics.posture import Posture
from assembly.linear.lanes import compliances_side_by_side
from assembly.linear.robot_structure import structure_of
from assembly.linear.solutions import SOLVED
from assembly.model.robot import Robot
from assembly.platform_stiffness.linear_tangent import owners, without_clearance
from assembly.platform_stiffness.matrices import Part, PlatformStiffness
from assembly.solvers.method import Method, check_method
from forcefit.inputs.display import html_table, short_repr

_RANK = 1e-10  # relative size of a compliance's root that counts as rigid


@dataclass(frozen=True, eq=False)
class Stiffnesses:
    """The platform's stiffness at k postures, clearances held at zero.

    Attributes:
        robot: of n frames.
        length: [m] characteristic length.
        springs: (k, ny, 6) [sqrt(2 J) per N m and N] deformation of every spring under
            unit wrenches at the platform's origin, base axes; NaN where a motion of
            the platform is free.
        parts: (ny,) whose springs they are.
        method: (k,) which gave it: ``"compiled"``, or ``"reference"``, numpy.
        singular: those where a motion of the platform is free, by their row.
    """

    robot: Robot
    length: float
    springs: NDArray
    parts: tuple[Part, ...]
    method: NDArray
    singular: dict[int, PlatformStiffness]

    __repr__, _repr_html_ = short_repr, html_table

    @cached_property
    def compliance(self) -> NDArray:
        """(k, 6, 6) [rad/(N m) .. m/N]; NaN in what a free motion touches."""
        compliance = np.swapaxes(self.springs, 1, 2) @ self.springs
        for row, one in self.singular.items():
            compliance[row] = one.compliance
        return compliance

    @cached_property
    def _roots(self) -> tuple[NDArray, NDArray]:
        """Singular values (k, 6) and vectors (k, 6, 6) of the scaled roots."""
        scale = np.repeat([self.length, 1.0], 3)
        # a triangle of six rows first: there may be many springs
        known = np.isfinite(self.springs).all(axis=(1, 2))
        values = np.full((len(self.springs), 6), np.nan)
        vectors = np.full((len(self.springs), 6, 6), np.nan)
        if known.any():
            R = np.linalg.qr(self.springs[known] * scale, mode="r")
            _, S, Vt = np.linalg.svd(R, full_matrices=False)
            values[known, : S.shape[1]] = S
            values[known, S.shape[1] :] = 0.0
            vectors[known, :, : S.shape[1]] = np.swapaxes(Vt, 1, 2)
        return values, vectors

    @cached_property
    def eigen_stiffnesses(self) -> NDArray:
        """(k, 6) [N/m] softest first, rotations times the length.

        inf where rigid, 0 where a motion is free.
        """
        values, _ = self._roots
        rigid = values <= _RANK * values[:, :1]
        stiffness = np.full(values.shape, np.inf)
        np.divide(1.0, values**2, out=stiffness, where=~rigid)
        for row, one in self.singular.items():
            stiffness[row] = one.eigen.values
        return stiffness

    @cached_property
    def eigen_screws(self) -> NDArray:
        """(k, 6, 6) [rad, m] their screws in columns."""
        screws = self._roots[1] / np.repeat([self.length, 1.0], 3)[:, None]
        for row, one in self.singular.items():
            screws[row] = one.eigen.screws
        return screws

    @property
    def condition(self) -> NDArray:
        """(k,) [-] stiffest over softest."""
        with np.errstate(divide="ignore"):
            return self.eigen_stiffnesses[:, -1] / self.eigen_stiffnesses[:, 0]

    def along(self, direction: ArrayLike) -> NDArray:
        """(k,) [N m/rad or N/m] stiffness along a direction, the others free.

        Args:
            direction: (6,) unit, of a wrench.

        Returns:
            1 / (d . C d); inf where nothing gives way, 0 along a free motion.
        """
        d, scale = np.asarray(direction), np.repeat([self.length, 1.0], 3)
        compliance = np.sum((self.springs @ d) ** 2, axis=1)
        largest = np.sum((self.springs * scale) ** 2, axis=(1, 2))
        # rounding of a motion that nothing makes
        still = compliance <= _RANK**2 * largest * np.sum((d / scale) ** 2)
        with np.errstate(divide="ignore"):
            K = 1.0 / np.where(still, 0.0, compliance)
        for row, one in self.singular.items():
            K[row] = one.along(direction)[0]
        return K

    def shares(self, direction: ArrayLike) -> dict[Part, NDArray]:
        """(k,) share of every link and joint in the compliance along a direction.

        Args:
            direction: (6,) of a wrench.

        Returns:
            By part; together they are 1, or NaN at postures with a free motion.
        """
        energies = (self.springs @ np.asarray(direction)) ** 2
        with np.errstate(invalid="ignore"):
            energies = energies / energies.sum(axis=1, keepdims=True)
        shares: dict[Part, NDArray] = {}
        for k, part in enumerate(self.parts):
            shares[part] = shares.get(part, 0.0) + energies[:, k]
        return shares


def platform_stiffnesses(
    robot: Robot, transforms: ArrayLike, mismatch: ArrayLike = 0.0,
    method: Method = "compiled",
) -> Stiffnesses:  # fmt: skip
    """The classical K_C at many postures.

    Args:
        robot: of n frames.
        transforms: (k, n, 4, 4) frames seen from the base.
        mismatch: (k,) or one number [rad, m], nominal closure error of the frames.
        method: ``"compiled"``, and the reference where that does not cover a posture;
            or ``"reference"``, numpy, one by one.

    Returns:
        Compliances and shares in the order given.

    Raises:
        ValueError: no such method.
    """
    check_method(method)
    T = np.require(transforms, dtype=float, requirements=["C", "W"])
    off = np.broadcast_to(np.asarray(mismatch, dtype=float), (len(T),)).copy()
    joints, structure = structure_of(robot)
    inner = np.zeros((len(T), 6, len(structure.springs)))
    status = np.zeros(len(T), dtype=np.int64)
    if method == "compiled":
        compliances_side_by_side(structure, T, off, inner, status)
    left = (status != SOLVED) | (method == "reference")
    size = size_of(robot)
    springs = np.zeros((len(T), joints.elastic.shape[1], 6))
    # the kernel's forces act on translations in reference lengths
    unit = np.repeat([1.0, size], 3)
    springs[:, structure.spring_order] = np.swapaxes(inner, 1, 2) * unit
    singular = {}
    for i in np.flatnonzero(left).tolist():
        q = np.full(len(robot.frames), np.nan)
        one = without_clearance(Posture(robot, q, T[i], float(off[i])))
        springs[i] = np.nan if one.free.size else one.springs @ one.root.T
        if one.free.size:
            singular[i] = one
    gave = np.where(left, "reference", "compiled").astype(object)
    return Stiffnesses(robot, size, springs, tuple(owners(joints)), gave, singular)
