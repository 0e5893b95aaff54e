"""Decompose a space of screws into translations, rotations and helical motions.

A screw (w, v) at a point c is a translation if w = 0.  It is a rotation about an axis
if w.v = 0.  Otherwise it is a helical motion of pitch 2 pi w.v / w.w, whose axis passes
through c + w x v / w.w (Hunt 1978, Kinematic geometry of mechanisms).  Start with
:func:`pure_motions`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

# Both limits allow for robot files that are rounded to 6 digits.
_TURN = 1e-4  # [rad] largest rotation per reference length of a pure translation
_PITCH = 1e-5  # [reference lengths] largest translation per rad of a pure rotation


@dataclass(frozen=True, eq=False)
class PureMotion:
    """One independent motion of a body.

    Attributes:
        kind: ``"translation"``, ``"turn"`` (rotation) or ``"screw"`` (helical motion).
        direction: (3,) unit vector along the translation, or along the axis.
        point: (3,) [m] point on the axis; None for a translation, or for a rotation
            about an arbitrary axis.
        pitch: [m] translation per turn of a helical motion; None for other kinds.
    """

    kind: str
    direction: NDArray
    point: NDArray | None = None
    pitch: float | None = None


def pure_motions(
    screws: NDArray, at: NDArray, size: float, error: float = 0.0
) -> list[PureMotion]:
    """Return independent motions that span a space of screws.

    Translations come first.  The remaining motions are rotations if their axes can
    intersect at one point, otherwise the principal screws of the system.

    Args:
        screws: (k, 6) [rad, m] independent screws at a point, base axes.
        at: (3,) [m] that point.
        size: [m] reference length used to compare translations with rotations.
        error: [rad, reference lengths] error of the screws; smaller components are
            treated as zero.

    Returns:
        k motions in base axes.
    """
    w, v = screws[:, :3], screws[:, 3:] / size
    zero, exact = max(_TURN, error), max(_PITCH, error)
    U, values, Wt = np.linalg.svd(w, full_matrices=True)
    turning = int((values > zero).sum())
    free = U[:, turning:].T @ v
    slides = [PureMotion("translation", d) for d in _plain_basis(free, zero)]
    if not turning:
        return slides
    axes = _plain_basis(Wt[:turning], zero)
    # velocities at c due to the rotations, without free translations
    across = _complement(free, zero)
    rates = axes @ np.linalg.pinv(w, rcond=zero) @ v @ across.T @ across
    point, anywhere = _common_point(axes, rates, across, exact)
    if point is None:
        return slides + _principal_screws(axes, rates, at, size, exact)
    centre = None if anywhere else at + size * point
    return slides + [PureMotion("turn", axis, centre) for axis in axes]


def _plain_basis(rows: NDArray, zero: float) -> NDArray:
    """Return unit vectors that span the row space, if possible along base axes."""
    rank = int((np.linalg.svd(rows, compute_uv=False) > zero).sum()) if len(rows) else 0
    if rank == 3:
        return np.eye(3)
    P = np.linalg.pinv(rows, rcond=zero) @ rows if rank else np.zeros((3, 3))
    basis: list[NDArray] = []
    for _ in range(rank):
        # Select the base axis that is closest to the space not yet spanned.
        k = int(np.argmax(np.round(np.diag(P), 9)))
        d = P[k] / np.linalg.norm(P[k])
        d = np.where(np.abs(d) < 1e-12, 0.0, d)
        basis.append(d / np.linalg.norm(d))
        P = P - np.outer(d, d)
    order = sorted(basis, key=lambda d: int(np.argmax(np.round(np.abs(d), 9))))
    return np.array(order).reshape(-1, 3)


def _complement(rows: NDArray, zero: float) -> NDArray:
    """Return an orthonormal basis of the vectors orthogonal to all rows."""
    if not len(rows):
        return np.eye(3)
    _, values, Vt = np.linalg.svd(rows)
    return np.asarray(Vt[int((values > zero).sum()) :])


def _common_point(
    axes: NDArray, rates: NDArray, across: NDArray, zero: float
) -> tuple[NDArray | None, bool]:
    """Return a point through which all axes can pass.

    Args:
        axes: (r, 3) unit vectors.
        rates: (r, 3) velocities at the origin, without free translations.
        across: (m, 3) directions in which translations are not free.
        zero: [lengths] velocity difference below which velocities are equal.

    Returns:
        (3,) the point nearest to the origin, or None; and whether it is arbitrary.
    """
    # The product p x axis equals the velocity at the origin up to free translations.
    rows = np.vstack([across @ -_cross(axis) for axis in axes])
    goal = np.concatenate([across @ rate for rate in rates])
    point = np.linalg.lstsq(rows, goal, rcond=zero)[0]
    if np.abs(rows @ point - goal).max(initial=0.0) > zero:
        return None, False
    return point, not np.abs(rows).max(initial=0.0) > zero


def _cross(a: NDArray) -> NDArray:
    """Return the matrix of the cross product a x, (3, 3)."""
    return np.cross(a, np.eye(3)).T


def _principal_screws(
    axes: NDArray, rates: NDArray, at: NDArray, size: float, zero: float
) -> list[PureMotion]:
    """Return the principal screws of a screw system."""
    Q = axes @ rates.T
    pitches, mix = eigh((Q + Q.T) / 2, axes @ axes.T)
    found = []
    for pitch, m in zip(pitches, mix.T, strict=True):
        w, v = m @ axes, m @ rates
        point = at + size * np.cross(w, v) / (w @ w)
        kind = "screw" if abs(pitch) > zero else "turn"
        w = w / np.linalg.norm(w)
        w = w if w[np.argmax(np.round(np.abs(w), 9))] > 0 else -w
        turn = float(2 * np.pi * pitch * size) if kind == "screw" else None
        found.append(PureMotion(kind, w, point, turn))
    return found
