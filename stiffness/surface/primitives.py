"""Planes, cones, spheres and tori, and their fits to points.

The corners of facets are on the exact surface of a part, but the facets deviate from a
curved surface. If all corners of a patch are on a plane, cone, sphere or torus, this
shape is therefore used in place of the facets. A cylinder is a cone without slope.

The method ``signed(points)`` of each shape returns the signed distances of points, (n,)
[m], and their gradients, (n, 3).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

S = TypeVar("S", bound="Shape")
# maximum numbers of residual evaluations: of every fit, and of a fit with a small
# residual
_CALLS = (25, 100)
# residual below which a fit is continued, relative to the extent of the points
_MAY_FIT = 0.02
_FITS = 1e-9  # largest residual of a successful fit, relative to the extent
_TINY = 1e-300  # prevents a division by zero on the axis of a shape


class Shape(Protocol):
    """A surface onto which points can be projected."""

    def signed(self, points: NDArray) -> tuple[NDArray, NDArray]:
        """Return signed distances of points, (n,) [m], and their gradients, (n, 3)."""
        ...


@dataclass(frozen=True, eq=False)
class Plane:
    """Plane of all points x with normal . (x - point) = 0."""

    point: NDArray
    normal: NDArray

    def signed(self, points: NDArray) -> tuple[NDArray, NDArray]:
        """Return signed distances of points, (n,) [m], and their gradients, (n, 3)."""
        distances = (points - self.point) @ self.normal
        return distances, np.broadcast_to(self.normal, points.shape)


@dataclass(frozen=True, eq=False)
class Cone:
    """Cone whose radius is ``radius + slope * t`` at the position t on its axis."""

    point: NDArray
    axis: NDArray
    radius: float
    slope: float = 0.0

    def signed(self, points: NDArray) -> tuple[NDArray, NDArray]:
        """Return signed distances of points, (n,) [m], and their gradients, (n, 3)."""
        offset = points - self.point
        along = offset @ self.axis
        across = offset - along[:, None] * self.axis
        radius = np.linalg.norm(across, axis=1)
        cosine = 1 / np.sqrt(1 + self.slope**2)
        outward = across / np.maximum(radius, _TINY)[:, None]
        gradients = (outward - self.slope * self.axis) * cosine
        return (radius - self.radius - self.slope * along) * cosine, gradients


@dataclass(frozen=True, eq=False)
class Sphere:
    """Sphere with a centre and a radius."""

    point: NDArray
    radius: float

    def signed(self, points: NDArray) -> tuple[NDArray, NDArray]:
        """Return signed distances of points, (n,) [m], and their gradients, (n, 3)."""
        offset = points - self.point
        radius = np.linalg.norm(offset, axis=1)
        return radius - self.radius, offset / np.maximum(radius, _TINY)[:, None]


@dataclass(frozen=True, eq=False)
class Torus:
    """Torus of all points at the distance ``tube`` from a circle."""

    point: NDArray
    axis: NDArray
    radius: float
    tube: float

    def signed(self, points: NDArray) -> tuple[NDArray, NDArray]:
        """Return signed distances of points, (n,) [m], and their gradients, (n, 3)."""
        offset = points - self.point
        along = offset @ self.axis
        across = offset - along[:, None] * self.axis
        outward = across / np.maximum(np.linalg.norm(across, axis=1), _TINY)[:, None]
        spoke = offset - self.radius * outward
        length = np.linalg.norm(spoke, axis=1)
        return length - self.tube, spoke / np.maximum(length, _TINY)[:, None]


def project(points: NDArray, shapes: tuple[Shape, ...]) -> NDArray:
    """Project points onto a shape or onto the intersection of several shapes.

    Args:
        points: (n, 3) [m] points near the shapes.
        shapes: shapes that intersect.

    Returns:
        (n, 3) [m] projected points. They are computed by Newton's method with steps of
        minimal length.
    """
    points = points.copy()
    for _ in range(12):
        pairs = [shape.signed(points) for shape in shapes]
        distances = np.stack([d for d, _ in pairs], axis=1)
        gradients = np.stack([g for _, g in pairs], axis=1)
        # small singular values are truncated, because the equations of tangent shapes
        # are inconsistent
        inverse = np.linalg.pinv(gradients, rcond=0.05)
        step = np.einsum("nij,nj->ni", inverse, distances)
        points -= step
        if np.abs(step).max(initial=0.0) < 1e-14 * (1 + np.abs(points).max(initial=0)):
            break
    return points


def fit_plane(points: NDArray, normals: NDArray) -> Plane:
    """Fit a plane to points.

    Args:
        points: (n, 3) [m] points.
        normals: (k, 3) normals of the facets, which determine the orientation of the
            plane.

    Returns:
        The plane.
    """
    center = points.mean(axis=0)
    normal = np.linalg.svd(points - center, full_matrices=False)[2][2]
    agrees = normal @ normals.sum(axis=0) >= 0
    return Plane(center, normal if agrees else -normal)


def fit_sphere(points: NDArray, normals: NDArray) -> Sphere:
    """Fit a sphere to points.

    Args:
        points: (n, 3) [m] points.
        normals: not used.

    Returns:
        The sphere.
    """
    origin = points.mean(axis=0)
    center, radius = _circle(points - origin)
    return Sphere(origin + center, radius)


def _circle(points: NDArray) -> tuple[NDArray, float]:
    """Fit a circle or a sphere to points, and return its centre and its radius."""
    # |x|^2 = 2 x . c + (r^2 - |c|^2) is linear in c and in r^2 - |c|^2
    system = np.column_stack([2 * points, np.ones(len(points))])
    squares = np.sum(points**2, axis=1)
    center = np.linalg.lstsq(system, squares, rcond=None)[0][:-1]
    return center, float(np.sqrt(np.mean(np.sum((points - center) ** 2, axis=1))))


def fit_cone(points: NDArray, normals: NDArray) -> Cone:
    """Fit a cone or a cylinder to points.

    Args:
        points: (n, 3) [m] points.
        normals: (k, 3) normals of the facets, from which an initial axis is estimated.

    Returns:
        The cone.
    """
    axis = np.linalg.svd(normals - normals.mean(axis=0), full_matrices=False)[2][2]
    center = points.mean(axis=0)
    size = float(np.ptp(points, axis=0).max())
    frame = np.linalg.svd(axis[None])[2]
    circle, radius = _circle((points - center) / size @ frame[1:].T)

    def shape(p: NDArray) -> Cone:
        direction = np.r_[1.0, p[2:4]] @ frame
        point = center + size * p[:2] @ frame[1:]
        return Cone(point, direction / np.linalg.norm(direction), size * p[4], p[5])

    return _refined_fit(shape, np.r_[circle, 0.0, 0.0, radius, 0.0], points, size)


def fit_torus(points: NDArray, normals: NDArray) -> Torus:
    """Fit a torus to points.

    Args:
        points: (n, 3) [m] points.
        normals: (k, 3) normals of the facets, which determine the orientation.

    Returns:
        The torus with the smallest residual of three fits with different initial axes.
    """
    center = points.mean(axis=0)
    size = float(np.ptp(points, axis=0).max())
    directions = np.linalg.svd(points - center, full_matrices=False)[2]
    candidates = []
    for axis in directions:
        frame = np.linalg.svd(axis[None])[2]
        across = (points - center) / size @ frame[1:].T
        circle, radius = _circle(across)
        tube = float(np.std(np.linalg.norm(across - circle, axis=1)) + 0.05)

        def shape(p: NDArray, frame: NDArray = frame) -> Torus:
            direction = np.r_[1.0, p[3:5]] @ frame
            point = center + size * p[:3] @ frame
            unit = direction / np.linalg.norm(direction)
            return Torus(point, unit, size * p[5], size * p[6])

        start = np.r_[0.0, circle, 0.0, 0.0, radius, tube]
        candidates.append(_refined_fit(shape, start, points, size))
        if np.abs(candidates[-1].signed(points)[0]).max() < _FITS * size:
            break
    return min(candidates, key=lambda t: float(np.abs(t.signed(points)[0]).max()))


def _refined_fit(
    shape: Callable[[NDArray], S], start: NDArray, points: NDArray, size: float
) -> S:
    """Fit a shape by nonlinear least squares."""
    from scipy.optimize import least_squares

    if len(points) < len(start):
        return shape(start)
    p = start
    for calls in _CALLS:
        result = least_squares(
            lambda p: shape(p).signed(points)[0] / size,
            p,
            method="lm",
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
            max_nfev=calls,
        )
        p, off = result.x, float(np.abs(result.fun).max())
        if not _FITS < off < _MAY_FIT:
            break
    return shape(p)
