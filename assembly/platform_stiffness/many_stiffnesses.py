"""Platform stiffness at many postures, with the contribution of each part."""

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

# relative size below which a singular value of the compliance root denotes rigidity
_RANK = 1e-10


@dataclass(frozen=True, eq=False)
class Stiffnesses:
    """Stiffness of the platform at k postures; ``[i]`` returns posture i.

    The shapes of the arrays of :class:`PlatformStiffness` (modes, free motions, rigid
    directions) vary between postures.  This class therefore stores only arrays of
    constant shape: compliances, eigen-stiffnesses and shares.

    Attributes:
        posture: the robot's nominal configuration, k postures.
        state: state, see :class:`PlatformStiffness`.
        point: (k, 3) [m] reference point of screws and wrenches, base axes.
        length: [m] characteristic length.
        springs: (k, ny, 6) [sqrt(2 J) per N m and N] deformation of every spring under
            unit wrenches at that point, base axes; NaN for postures in ``apart``.
        parts: (ny,) owner of each spring.
        method: (k,) method used to solve for the stiffness or its equilibrium:
            ``"compiled"`` or ``"reference"``.
        apart: stiffnesses stored with their modes, by posture number: those with a free
            platform motion, and all stiffnesses in states other than ``"nominal"``.
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
        """Return posture i; its modes are at most six combinations of the springs."""
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
        """Return a table with one row per point and columns (variable, component)."""
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
        """(k, 6, 6) [rad/(N m) .. m/N]; NaN in components along a free motion."""
        compliance = np.swapaxes(self.springs, 1, 2) @ self.springs
        for row, one in self.apart.items():
            compliance[row] = one.compliance
        return compliance

    @cached_property
    def _roots(self) -> tuple[NDArray, NDArray]:
        """Singular values (k, 6), vectors (k, 6, 6) of the scaled compliance roots."""
        scale = np.repeat([self.length, 1.0], 3)
        # a triangular factor reduces the many rows of springs to six
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
        """(k, 6) [N/m] eigen-stiffnesses, softest first, rotations times the length.

        Values are inf for rigid directions and 0 for free motions.
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
        """(k, 6, 6) [rad, m] screws of the eigen-stiffnesses, in columns."""
        screws = self._roots[1] / np.repeat([self.length, 1.0], 3)[:, None]
        for row, one in self.apart.items():
            screws[row] = one.eigen.screws
        return screws

    @property
    def condition(self) -> NDArray:
        """(k,) [-] ratio of the stiffest to the softest eigen-stiffness."""
        with np.errstate(divide="ignore"):
            return self.eigen_stiffnesses[:, -1] / self.eigen_stiffnesses[:, 0]

    def along(self, direction: ArrayLike) -> NDArray:
        """Return (k,) [N m/rad or N/m] stiffness along a direction, other motions free.

        Args:
            direction: (6,) unit direction of a wrench.

        Returns:
            1 / (d . C d); inf for a rigid direction, 0 along a free motion.
        """
        d, scale = np.asarray(direction), np.repeat([self.length, 1.0], 3)
        compliance = np.sum((self.springs @ d) ** 2, axis=1)
        largest = np.sum((self.springs * scale) ** 2, axis=(1, 2))
        # along a motion that no part allows, the compliance is only round-off
        still = compliance <= _RANK**2 * largest * np.sum((d / scale) ** 2)
        with np.errstate(divide="ignore"):
            K = 1.0 / np.where(still, 0.0, compliance)
        for row, one in self.apart.items():
            K[row] = one.along(direction)[0]
        return K

    def shares(self, direction: ArrayLike) -> dict[Part, NDArray]:
        """Return the (k,) share of each part in the compliance along a direction.

        Args:
            direction: (6,) direction of a wrench.

        Returns:
            Shares by part, which add up to 1, or NaN at postures with a free motion.
            Clearances and forces are treated as in :meth:`PlatformStiffness.shares`.
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
        method: ``"compiled"``, which falls back on the reference for postures that the
            compiled method does not cover; or ``"reference"``, in numpy, one posture at
            a time.

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
    # the translations in the kernel are divided by the reference length
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
    """Collect stiffnesses that have already been computed.

    Args:
        posture: k postures.
        each: k stiffnesses of the same state.

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
