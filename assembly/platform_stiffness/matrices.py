r"""Stiffness and compliance matrices of the platform, and derived quantities.

A small wrench w displaces the platform by the screw s = C w, and w = K s.  Both
matrices are computed from the modes of the manipulator, which are motions that keep all
loops closed.  A mode of amplitude a has the energy sigma a^2 / 2, with sigma = +-1.

======  ==============  ========  ====================================================
symbol  code            shape     meaning
======  ==============  ========  ====================================================
L       ``root``        (6, k)    platform screw of each mode: C = L diag(sigma) L^T
sigma   ``signs``       (k,)      -1 for unstable modes, 1 for all others
Y       ``springs``     (m, k)    scaled deformation of the springs in each mode
F       ``free``        (6, f)    unit screws of the platform without resistance
l       ``length``      [m]       characteristic length; multiplies rotations
======  ==============  ========  ====================================================

Free motions make compliances infinite, and rigid directions make stiffnesses infinite.
The affected entries are NaN; all others are valid.

Sources:
    Salisbury (1980), Active stiffness control of a manipulator in Cartesian
    coordinates (the Cartesian stiffness matrix).
    Loncaric (1987), Normal forms of stiffness and compliance matrices (the centre).
    Lipkin, Patterson (1992), Geometrical properties of modelled robot elasticity
    (eigenscrews; choice of a characteristic length).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import null_space

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.solvers.method import Method
from forcefit.inputs.errors import BadInput
from forcefit.inputs.number_arrays import find_fault
from forcefit.results.display import Figures, html_table, numbers, short_repr, show
from forcefit.stiffness.screws import screw_map

if TYPE_CHECKING:
    import pandas
    import xarray

_RANK = 1e-10  # [-] tolerance for zero motions, relative to the largest
_ROUNDING = 1e-12  # [-] relative round-off of platform motions
_UNTOUCHED = 1e-9  # [-] tolerance for zero components of a unit screw


class Part(NamedTuple):
    """Link, joint or clearance that makes a robot compliant.

    Attributes:
        frame: name of the frame, or of a joint that consists of several frames.
        kind: ``"link"``, ``"joint"`` or ``"clearance"``.
    """

    frame: str
    kind: str

    @property
    def words(self) -> str:
        """Name of the component in printed tables, such as ``"leg1.link_a link"``."""
        known = f"{self.frame} {self.kind}"
        return known if self.frame else "internal forces and loads"


@dataclass(frozen=True, eq=False)
class EigenStiffnesses:
    """Principal stiffnesses in ascending order.

    Rotations are multiplied by the characteristic length.

    Attributes:
        values: (6,) [N/m] principal stiffnesses: 0 along free motions, inf along rigid
            directions.
        screws: (6, 6) [rad, m] screws in columns, of unit size if rotations are
            multiplied by the length.
        length: [m] characteristic length.
    """

    values: NDArray
    screws: NDArray
    length: float

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def condition(self) -> float:
        """Ratio of the largest to the smallest principal stiffness.

        It is inf if the platform can move freely or is rigid in a direction.
        """
        least, most = self.values[0], self.values[-1]
        return float(most / least) if least > 0.0 and np.isfinite(most) else np.inf

    @property
    def pitches(self) -> NDArray:
        """Pitch of each screw, (6,) [m]; inf for a translation."""
        turn, shift = self.screws[:3], self.screws[3:]
        squared = np.sum(turn**2, axis=0)
        turns = squared * self.length**2 > _UNTOUCHED**2
        pitch = np.full(6, np.inf)
        np.divide(np.sum(turn * shift, axis=0), squared, out=pitch, where=turns)
        return pitch


@dataclass(frozen=True, eq=False)
class PlatformStiffness:
    """Stiffness of the platform at one point; see the module docstring.

    Attributes:
        posture: the robot's nominal configuration.
        state: ``"nominal"``, ``"contact"`` or ``"exact"``.
        point: (3,) [m] reference point of screws and wrenches, base axes.
        length: [m] characteristic length.
        root: (6, k) [rad, m] platform screw of each mode per sqrt(2 J).
        signs: (k,) sign of each mode's energy, 1 or -1.
        springs: (m, k) [sqrt(2 J)] deformations of the springs in each mode.
        parts: (m,) link or joint to which each spring belongs.
        free: (6, f) [rad, m] unit screws of the free motions.
        method: method used for the stiffness or its equilibrium, ``"compiled"`` or
            ``"reference"`` (numpy and Clarabel).
    """

    posture: Posture
    state: str
    point: NDArray
    length: float
    root: NDArray
    signs: NDArray
    springs: NDArray
    parts: tuple[Part, ...]
    free: NDArray
    method: Method

    __repr__, _repr_html_ = short_repr, html_table
    plot = show

    def _figures(self) -> Figures:
        """Return the quantities that are shown in the short representation."""
        eigen = self.eigen
        return {
            "state": self.state,
            "point": f"{numbers(self.point)} m, base axes",
            "free motions": str(self.free.shape[1]),
            "eigenstiffnesses": f"{numbers(eigen.values)} N/m",
            "length": f"{self.length:g} m",
        }

    def to_xarray(self) -> "xarray.Dataset":
        """Return an xarray data set; see :mod:`.tables`."""
        from forcefit.assembly.platform_stiffness.tables import stiffness_dataset

        return stiffness_dataset(self)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a pandas table with the compliance shares along each axis."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "part")

    def at(self, point: ArrayLike, length: float | None = None) -> "PlatformStiffness":
        """Return the stiffness at another point of the platform.

        Args:
            point: (3,) [m] reference point, base axes.
            length: [m] new characteristic length; unchanged by default.

        Returns:
            The stiffness at this point.
        """
        point, length = numbers_of("point", point, 3, "m"), length or self.length
        move = screw_map(self.point - point)
        return replace(
            self, point=point, length=length, root=move @ self.root,
            free=unit_screws(move @ self.free, length),
        )  # fmt: skip

    @cached_property
    def compliance(self) -> NDArray:
        """Symmetric compliance, (6, 6) [rad/(N m) .. m/N]; NaN along free motions."""
        return _blank((self.root * self.signs) @ self.root.T, self.free)

    @cached_property
    def stiffness(self) -> NDArray:
        """Symmetric stiffness, (6, 6) [N m/rad .. N/m]; NaN in rigid directions."""
        way, core, rigid = self._resisted
        K = way @ core @ way.T
        return _blank((K + K.T) / 2, rigid)

    @property
    def free_text(self) -> str:
        """Description of the platform's free motions, or an empty string."""
        screws = ", ".join(numbers(screw) for screw in self.free.T)
        return f"the platform moves freely along {screws} [rad, m]" * bool(screws)

    @property
    def rigid(self) -> NDArray:
        """Unit wrenches that do not move the platform, (6, r) [N m, N]."""
        return self._resisted[2]

    @property
    def stable(self) -> bool:
        """Whether the potential energy has a minimum at the equilibrium."""
        return bool((self.signs > 0).all())

    @cached_property
    def _scale(self) -> NDArray:
        """Factors that multiply rotations by the characteristic length, (6,)."""
        return np.array([*[self.length] * 3, 1.0, 1.0, 1.0])

    @cached_property
    def _resisted(self) -> tuple[NDArray, NDArray, NDArray]:
        """Basis of elastic wrenches, stiffness in this basis, rigid wrenches."""
        scale = self._scale[:, None]
        basis = null_space((scale * self.free).T) if self.free.size else np.eye(6)
        whole = scale * self.root
        U, S, Vt = np.linalg.svd(basis.T @ whole)
        # springs along free motions cause round-off in other directions
        rounding = _ROUNDING * np.abs(whole).max(initial=0.0)
        rank = int(np.sum(S > max(_RANK * S.max(initial=0.0), rounding)))
        inverse = np.diag(1.0 / S[:rank])
        core = inverse @ inverse
        if not self.stable:
            mixed = (Vt[:rank] * self.signs) @ Vt[:rank].T
            core = inverse @ np.linalg.inv(mixed) @ inverse
        wrenches = scale * (basis @ U)
        return wrenches[:, :rank], (core + core.T) / 2, wrenches[:, rank:]

    @cached_property
    def eigen(self) -> EigenStiffnesses:
        """Principal stiffnesses and their screws for the characteristic length."""
        way, core, rigid = self._resisted
        values, vectors = np.linalg.eigh(core)
        scale = self._scale[:, None]
        # the screws are orthonormal if rotations are multiplied by the characteristic
        # length
        screws = np.hstack([
            np.linalg.qr(scale * self.free)[0],
            way @ vectors / scale,
            rigid / scale,
        ])
        values = np.concatenate([
            np.zeros(self.free.shape[1]), values, np.full(rigid.shape[1], np.inf)
        ])  # fmt: skip
        order = np.argsort(values, kind="stable")
        return EigenStiffnesses(values[order], screws[:, order] / scale, self.length)

    def along(self, direction: ArrayLike) -> tuple[float, float]:
        """Return two stiffnesses along a direction.

        Args:
            direction: (6,) direction of a wrench and of a screw, such as
                ``[0, 0, 0, 0, 0, 1]``.

        Returns:
            [N/m or N m/rad] stiffness with all other motions free, and stiffness with
            all other motions blocked.

        Raises:
            BadInput: the direction is zero or is not six numbers.
        """
        d = _direction(direction)
        with np.errstate(divide="ignore"):
            free = float(np.float64(1.0) / self._compliance_along(d))
        blocked = np.inf if _touches(self.rigid, d) else self._held(d)
        return free, blocked

    def _compliance_along(self, d: NDArray) -> float:
        """Return the compliance d . C d along a unit direction d, or inf if free."""
        if _touches(self.free, d):
            return np.inf
        screws = self.root.T @ d
        largest = np.linalg.norm(self._scale[:, None] * self.root)
        if np.linalg.norm(screws) <= _RANK * largest * np.linalg.norm(d / self._scale):
            return 0.0  # the compliance along a rigid direction is round-off
        return float(self.signs @ screws**2)

    def _held(self, d: NDArray) -> float:
        """Return the stiffness d . K d along a unit direction d."""
        way, core, _ = self._resisted
        return float(d @ way @ core @ way.T @ d)

    @cached_property
    def centre(self) -> NDArray:
        """Centre of stiffness in base axes, (3,) [m]; NaN if it does not exist.

        At this point, the block of K that maps translations to moments is symmetric.
        """
        K = self.stiffness
        turned, shifted = K[:3, 3:], K[3:, 3:]
        spread = np.trace(shifted) * np.eye(3) - shifted
        axial = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0],
                          turned[1, 0] - turned[0, 1]])  # fmt: skip
        size = np.linalg.norm(spread, 2) if np.isfinite(K).all() else 0.0
        if not size or np.linalg.svd(spread, compute_uv=False)[-1] < _RANK * size:
            return np.full(3, np.nan)
        return self.point + np.linalg.solve(spread, axial)

    def contributions(self) -> dict[Part, NDArray]:
        """Return the contribution of each component to the compliance.

        The contributions add up to :attr:`compliance`, except for the geometric
        stiffness in the state ``"exact"``.  In the other states, a contribution is the
        derivative of the compliance with respect to the logarithm of the component's
        own compliance (Castigliano).

        Returns:
            Contribution of each component, (6, 6) [rad/(N m) .. m/N].
        """
        response = self.springs @ (self.signs[:, None] * self.root.T)
        shares: dict[Part, NDArray] = {}
        for part, row in zip(self.parts, response, strict=True):
            shares[part] = shares.get(part, 0.0) + np.outer(row, row)
        return {part: _blank(C, self.free) for part, C in shares.items()}

    def shares(self, direction: ArrayLike) -> dict[Part, float]:
        """Return the compliance share of each component along a direction.

        Args:
            direction: (6,) direction of a wrench, such as ``[0, 0, 0, 0, 0, 1]``.

        Returns:
            Shares in descending order, which add up to 1.  The share ``("", "forces")``
            is due to the geometric stiffness and can be negative.  All shares are NaN
            if the compliance is infinite or zero.

        Raises:
            BadInput: the direction is zero or is not six numbers.
        """
        d = _direction(direction)
        whole = self._compliance_along(d)
        response = self.springs @ (self.signs * (self.root.T @ d))
        energies: dict[Part, float] = {}
        for part, value in zip(self.parts, response, strict=True):
            energies[part] = energies.get(part, 0.0) + float(value) ** 2
        if self.state == "exact":
            energies[Part("", "forces")] = whole - sum(energies.values())
        if not np.isfinite(whole) or whole == 0.0:
            return dict.fromkeys(energies, np.nan)
        order = sorted(energies, key=lambda part: -abs(energies[part]))
        return {part: energies[part] / whole for part in order}


def unit_screws(screws: NDArray, length: float) -> NDArray:
    """Return independent unit screws that span the same motions.

    Args:
        screws: (6, k) [rad, m] screws of the order of 1 rad or 1 length.  Much smaller
            screws are treated as round-off.
        length: [m] length by which rotations are multiplied.

    Returns:
        (6, f) screws of 1 rad, or of 1 m for translations, along the axes if possible.
    """
    scale = np.array([*[length] * 3, 1.0, 1.0, 1.0])[:, None]
    U, S, _ = np.linalg.svd(scale * screws, full_matrices=False)
    basis = U[:, S > _UNTOUCHED * length]
    done = 0
    for row in (3, 4, 5, 0, 1, 2):  # Gauss-Jordan elimination
        size = np.abs(basis[row, done:])
        if size.max(initial=0.0) > _UNTOUCHED:
            pivot = done + int(size.argmax())
            basis[:, [done, pivot]] = basis[:, [pivot, done]]
            basis[:, done] /= basis[row, done]
            others = np.arange(basis.shape[1]) != done
            basis[:, others] -= np.outer(basis[:, done], basis[row, others])
            done += 1
    unit = basis / scale
    turn = np.linalg.norm(unit[:3], axis=0)
    shift = np.linalg.norm(unit[3:], axis=0)
    unit = unit / np.where(turn * length > _UNTOUCHED * shift, turn, shift)
    return np.where(np.abs(unit) > _UNTOUCHED, unit, 0.0)


def numbers_of(name: str, value: ArrayLike, count: int, unit: str) -> NDArray:
    """Return an argument as an array with a given number of finite entries.

    Args:
        name: name of the argument, for error messages.
        value: value of the argument.
        count: expected number of entries.
        unit: unit of the entries, for error messages.

    Returns:
        (count,) numbers.

    Raises:
        BadInput: the value cannot be converted.
    """
    fault = find_fault(np.asarray(value).tolist(), (count,))
    if fault:
        raise BadInput(f"{name}: found {fault}, expected {count} numbers [{unit}]")
    return np.array(value, dtype=float)


def _direction(direction: ArrayLike) -> NDArray:
    """Return a unit vector along a direction, (6,)."""
    d = numbers_of("direction", direction, 6, "N m, N")
    if not d.any():
        raise BadInput("direction: found only zeros, expected a nonzero direction")
    return d / np.linalg.norm(d)


def _touches(vectors: NDArray, d: NDArray) -> bool:
    """Return whether a direction has a component along any of the given vectors."""
    return bool(np.abs(vectors.T @ d).max(initial=0.0) > _UNTOUCHED)


def _blank(matrix: NDArray, unbounded: NDArray) -> NDArray:
    """Return a 6 x 6 matrix with NaN in rows and columns that are infinite."""
    touched = np.abs(unbounded).max(axis=1, initial=0.0) > _UNTOUCHED
    matrix = np.where(touched[:, None] | touched, np.nan, matrix)
    matrix.setflags(write=False)
    return matrix
