"""Platform stiffness at many postures, with the contribution of each component."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.lanes import COMPILED, compliances_side_by_side
from forcefit.assembly.linear.robot_structure import structure_of
from forcefit.assembly.platform_stiffness.linear_tangent import (
    owners,
    without_clearance,
)
from forcefit.assembly.platform_stiffness.matrices import Part, PlatformStiffness
from forcefit.assembly.solvers.method import Method, log_reference
from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.screws import screw_map

if TYPE_CHECKING:
    import pandas
    import xarray

_RANK = 1e-10  # [-] tolerance for zero singular values, relative to the largest


@dataclass(frozen=True, eq=False)
class Stiffnesses:
    """Stiffness of the platform at k postures; ``[i]`` returns posture i.

    The number of modes, free motions and rigid directions varies between postures.
    This class therefore stores only arrays that have the same shape for all postures.

    Attributes:
        posture: the robot's nominal configuration, k postures.
        state: state, see :class:`PlatformStiffness`.
        point: (k, 3) [m] reference point of screws and wrenches, base axes.
        length: [m] characteristic length.
        springs: (k, ny, 6) [sqrt(2 J) per N m and N] deformations of the springs under
            unit wrenches at this point, base axes; NaN for postures in ``apart``.
        parts: (ny,) link or joint to which each spring belongs.
        method: (k,) method used for the stiffness or its equilibrium, ``"compiled"`` or
            ``"reference"``.
        apart: stiffnesses that are stored as :class:`PlatformStiffness`, by index of
            the posture.  Either the platform can move freely, or the state is not
            ``"nominal"``.
    """

    posture: Posture
    state: str
    point: NDArray
    length: float
    springs: NDArray
    parts: tuple[Part, ...]
    method: NDArray
    apart: dict[int, PlatformStiffness]

    __repr__, _repr_html_ = short_repr, html_table

    def __len__(self) -> int:
        return len(self.springs)

    def __getitem__(self, i: int) -> PlatformStiffness:
        """Return the stiffness at posture i."""
        i = range(len(self))[i]
        if i in self.apart:
            return self.apart[i]
        modes, root = np.linalg.qr(self.springs[i])
        return PlatformStiffness(
            posture=self.posture[i],
            state=self.state,
            point=self.point[i],
            length=self.length,
            root=root.T,
            signs=np.ones(len(root)),
            springs=modes,
            parts=self.parts,
            free=np.zeros((6, 0)),
            method=self.method[i],
        )

    def to_xarray(self) -> "xarray.Dataset":
        """Return a data set with the dimension ``point``, as in the file of a sweep."""
        from forcefit.assembly.platform_stiffness.tables import stiffnesses_dataset

        return stiffnesses_dataset(self)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a pandas table with a row for each posture."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "point")

    def at(self, points: NDArray) -> "Stiffnesses":
        """Return the stiffnesses at other points of the platforms.

        Args:
            points: (k, 3) [m] points, base axes.

        Returns:
            The stiffnesses at these points.
        """
        move = np.swapaxes(screw_map(self.point - points), 1, 2)
        apart = {i: one.at(points[i]) for i, one in self.apart.items()}
        return replace(self, point=points, springs=self.springs @ move, apart=apart)

    @cached_property
    def compliance(self) -> NDArray:
        """Compliance, (k, 6, 6) [rad/(N m) .. m/N]; NaN along free motions."""
        compliance = np.swapaxes(self.springs, 1, 2) @ self.springs
        for row, one in self.apart.items():
            compliance[row] = one.compliance
        return compliance

    @cached_property
    def _roots(self) -> tuple[NDArray, NDArray]:
        """Singular values (k, 6) and vectors (k, 6, 6) of the scaled ``springs``."""
        scale = np.repeat([self.length, 1.0], 3)
        # a QR factorisation reduces the number of rows to six
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
        """Principal stiffnesses in ascending order, (k, 6) [N/m].

        Rotations are multiplied by the characteristic length.  Values are inf for rigid
        directions and 0 for free motions.
        """
        values, _ = self._roots
        rigid = values <= _RANK * values[:, :1]
        stiffness = np.full(values.shape, np.inf)
        np.divide(1.0, values**2, out=stiffness, where=~rigid)
        for row, one in self.apart.items():
            stiffness[row] = one.eigen.values
        return stiffness

    @cached_property
    def eigen_screws(self) -> NDArray:
        """Screws of the principal stiffnesses, in columns, (k, 6, 6) [rad, m]."""
        screws = self._roots[1] / np.repeat([self.length, 1.0], 3)[:, None]
        for row, one in self.apart.items():
            screws[row] = one.eigen.screws
        return screws

    @property
    def condition(self) -> NDArray:
        """Ratio of the largest to the smallest principal stiffness, (k,)."""
        with np.errstate(divide="ignore"):
            return self.eigen_stiffnesses[:, -1] / self.eigen_stiffnesses[:, 0]

    def along(self, direction: ArrayLike) -> NDArray:
        """Return the stiffness along a direction, with all other motions free.

        Args:
            direction: (6,) unit direction d of a wrench.

        Returns:
            1 / (d . C d), (k,) [N m/rad or N/m]; inf for a rigid direction and 0 along
            a free motion.
        """
        d, scale = np.asarray(direction), np.repeat([self.length, 1.0], 3)
        compliance = np.sum((self.springs @ d) ** 2, axis=1)
        largest = np.sum((self.springs * scale) ** 2, axis=(1, 2))
        # the compliance along a rigid direction is round-off
        still = compliance <= _RANK**2 * largest * np.sum((d / scale) ** 2)
        with np.errstate(divide="ignore"):
            K = 1.0 / np.where(still, 0.0, compliance)
        for row, one in self.apart.items():
            K[row] = one.along(direction)[0]
        return K

    def shares(self, direction: ArrayLike) -> dict[Part, NDArray]:
        """Return the compliance share of each component along a direction.

        Args:
            direction: (6,) direction of a wrench.

        Returns:
            Shares (k,) of each component, which add up to 1.  They are NaN at postures
            with a free motion.  See :meth:`PlatformStiffness.shares`.
        """
        energies = (self.springs @ np.asarray(direction)) ** 2
        with np.errstate(invalid="ignore"):
            energies = energies / energies.sum(axis=1, keepdims=True)
        shares: dict[Part, NDArray] = {}
        for k, part in enumerate(self.parts):
            shares[part] = shares.get(part, 0.0) + energies[:, k]
        for row, one in self.apart.items():
            for part, share in one.shares(direction).items():
                own = shares.setdefault(part, np.zeros(len(self)))
                own[row] = np.nan if one.free.size else share
        return shares


def many_without_clearance(posture: Posture, method: Method) -> Stiffnesses:
    """Return the stiffnesses of the classical model, with clearances fixed at zero.

    Args:
        posture: k postures.
        method: ``"compiled"`` or ``"reference"``.  The compiled method uses the
            reference method for postures that it does not support.

    Returns:
        The stiffnesses at the platform's origin.
    """
    T = np.require(posture.transforms, requirements=["C", "W"])
    joints, structure = structure_of(posture.robot)
    inner = np.zeros((len(T), 6, len(structure.springs)))
    status = np.zeros(len(T), dtype=np.int64)
    if method == "compiled":
        off = np.full(len(T), posture.mismatch, dtype=float)
        compliances_side_by_side(structure, T, off, inner, status)
    left = (status != COMPILED) | (method == "reference")
    if left.any() and method == "compiled":
        count = int(left.sum())
        log_reference(posture.robot.name, "platform stiffness", count, len(left))
    size = size_of(posture.robot)
    springs = np.zeros((len(T), joints.elastic.shape[1], 6))
    # the C++ function divides translations by the reference length
    unit = np.repeat([1.0, size], 3)
    springs[:, structure.spring_order] = np.swapaxes(inner, 1, 2) * unit
    apart = {}
    for i in np.flatnonzero(left).tolist():
        one = without_clearance(posture[i])
        springs[i] = np.nan if one.free.size else one.springs @ one.root.T
        if one.free.size:
            apart[i] = one
    return Stiffnesses(
        posture=posture,
        state="nominal",
        point=posture.platform[:, :3, 3],
        length=size,
        springs=springs,
        parts=tuple(owners(joints)),
        method=np.where(left, "reference", "compiled").astype(object),
        apart=apart,
    )


def many_of_each(posture: Posture, each: Sequence[PlatformStiffness]) -> Stiffnesses:
    """Return an object that contains stiffnesses at many postures.

    Args:
        posture: k postures.
        each: k stiffnesses with the same state.

    Returns:
        All stiffnesses in one object.
    """
    return Stiffnesses(
        posture=posture,
        state=each[0].state,
        point=np.array([one.point for one in each]),
        length=each[0].length,
        springs=np.zeros((len(each), 0, 6)),
        parts=(),
        method=np.array([one.method for one in each], dtype=object),
        apart=dict(enumerate(each)),
    )
