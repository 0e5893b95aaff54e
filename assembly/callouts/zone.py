"""Convex zones of small screws: support function, random draws, covariance.

A zone is the set of screws d [RX RY RZ TX TY TZ] of a feature, in its axes, with
``|bound @ d| <= 1`` for each bound, and no component that no bound sees.  A bound of
one row is an interval, of two rows a disc, of three a ball.  Bounds that are linearly
independent are reached all at once: d = columns u, |u_k| <= 1.  The others cut that
set, as do double cones ``|s @ d| + |S @ d| <= 1``, the zones of round faces.

Sources:
    Mujezinovic, Davidson, Shah (2004), A new mathematical model for geometric
    tolerances as applied to polygonal faces, doi 10.1115/1.1701881 (zones as convex
    sets).
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.largest_product import largest_product
from forcefit.assembly.callouts.unit_balls import VOLUMES, ball_variance, in_balls

DISTRIBUTIONS = ("uniform", "normal", "truncated")
_SAMPLE = 1 << 17  # draws for the covariance of a zone that is cut
_RANK = 1e-9  # smallest singular value over the largest of independent bounds
_MOST_ATTEMPTS = 10_000  # draws of one part until it is in the zone
Numbers = Callable[[int], NDArray]  # attempt -> (k, words) uniform numbers


@dataclass(frozen=True, eq=False)
class Zone:
    """A convex zone; see the head of this module.

    Attributes:
        bounds: (k, 6) each, k = 1, 2, 3: rows on the screw [1/rad, 1/m].
        bonus: largest relative growth of the zone with the size of the feature (maximum
            material condition); 0 for none.
        cones: (3, 6) each: the row s along the axis of a double cone, and the two rows
            S across it.  Bounds must limit the same components.
        from_zero: whether the zone grows with a size from a point to the bounds, such
            as the shift of a datum at maximum material.
    """

    bounds: tuple[NDArray, ...]
    bonus: float = 0.0
    cones: tuple[NDArray, ...] = ()
    from_zero: bool = False

    @cached_property
    def _split(self) -> tuple[list[int], list[int]]:
        """Indices of the independent bounds, and of those that cut."""
        kept: list[int] = []
        cutting: list[int] = []
        for i, bound in enumerate(self.bounds):
            rows = np.vstack([self.bounds[j] for j in kept] + [bound])
            sizes = np.linalg.svd(rows / _scale(rows), compute_uv=False)
            independent = len(rows) <= 6 and sizes[-1] > _RANK * sizes[0]
            (kept if independent else cutting).append(i)
        return kept, cutting

    @cached_property
    def dimensions(self) -> tuple[int, ...]:
        """Dimension of each ball |u_k| <= 1."""
        return tuple(len(self.bounds[i]) for i in self._split[0])

    @cached_property
    def columns(self) -> NDArray:
        """(6, m) [rad, m] the screw of the coordinates u."""
        rows = np.vstack([self.bounds[i] for i in self._split[0]])
        scale = _scale(rows)
        return np.asarray(np.linalg.pinv(rows / scale) / scale[:, None])

    @cached_property
    def cuts(self) -> tuple[NDArray, ...]:
        """(k, m) each: the other bounds as rows on u."""
        return tuple(self.bounds[i] @ self.columns for i in self._split[1])

    @cached_property
    def cones_on_u(self) -> tuple[NDArray, ...]:
        """(3, m) each: the double cones as rows on u."""
        return tuple(cone @ self.columns for cone in self.cones)

    @property
    def is_cut(self) -> bool:
        """Whether the zone is smaller than the product of its balls."""
        return bool(self.cuts or self.cones)

    @property
    def grows(self) -> bool:
        """Whether the zone grows with the size of a feature."""
        return self.bonus > 0 or self.from_zero

    @property
    def words(self) -> int:
        """Uniform numbers of one draw: one for each coordinate, the last for a size."""
        return sum(self.dimensions) + self.grows

    def growth(self, size: NDArray) -> NDArray:
        """Return the factors of the zone for sizes from least (0) to largest (1)."""
        return size if self.from_zero else 1.0 + self.bonus * size

    def inside(self, u: NDArray, grown: NDArray | float = 1.0) -> NDArray:
        """(k,) whether coordinates (k, m) are in the zone, by a factor of its size."""
        limits = [(part, grown) for part in self._balls(u)]
        limits += [(u @ cut.T, 1.0) for cut in self.cuts]
        marks = [np.linalg.norm(x, axis=-1) <= g * (1 + 1e-12) for x, g in limits]
        marks += [gauge <= 1 + 1e-12 for gauge in self._cone_gauges(u)]
        return np.asarray(np.all(marks, axis=0))

    def _cone_gauges(self, u: NDArray) -> list[NDArray]:
        """(k,) for each double cone: 1 on its surface."""
        return [
            abs(u @ c[0]) + np.linalg.norm(u @ c[1:].T, axis=-1)
            for c in self.cones_on_u
        ]

    def _balls(self, u: NDArray) -> list[NDArray]:
        """The coordinates of each ball."""
        ends = np.cumsum(self.dimensions)
        return np.split(u, ends[:-1], axis=-1)

    @cached_property
    def bounds_on_u(self) -> tuple[NDArray, ...]:
        """(k, m) each: |bound @ u| <= 1 for all of them is the zone at its largest."""
        rows = np.split(np.eye(sum(self.dimensions)), np.cumsum(self.dimensions)[:-1])
        return (*(row / (1.0 + self.bonus) for row in rows), *self.cuts)

    def support(self, direction: NDArray) -> float:
        """Return the largest ``direction @ d`` over the screws of the zone.

        Args:
            direction: (6,).

        Returns:
            The largest value: closed form of independent bounds; with others a
            certified upper bound, about 3e-8 relative above the largest value.
        """
        return self.farthest_u(np.asarray(direction, dtype=float) @ self.columns)[1]

    def farthest(self, direction: NDArray) -> NDArray:
        """Return (6,) [rad, m] the screw of the zone farthest in a direction (6,)."""
        w = np.asarray(direction, dtype=float) @ self.columns
        return np.asarray(self.columns @ self.farthest_u(w)[0])

    def farthest_u(self, w: NDArray) -> tuple[NDArray, float]:
        """Return coordinates u (m,) of the largest w @ u, and an upper bound of it."""
        if self.is_cut:
            return largest_product(w, self.bounds_on_u, self.cones_on_u)
        grown, u = 1.0 + self.bonus, []
        for part in self._balls(w):
            size = float(np.linalg.norm(part))
            u.append(grown * part / size if size else part * 0.0)
        return np.concatenate(u), float(w @ np.concatenate(u))

    def draw(
        self, numbers: Numbers, distribution: str = "uniform", cp: float = 1.0
    ) -> NDArray:
        """Return random coordinates u of parts.

        Args:
            numbers: function of the attempt, 0, 1, ..: (k, :attr:`words`) independent
                uniform numbers.  A part outside the zone is drawn again, with the size
                of its feature in attempt 0.
            distribution: ``"uniform"`` in the zone; ``"normal"``, see
                :meth:`deviation`; or ``"truncated"``, the normal one without the parts
                outside the zone.
            cp: capability of the normal distributions.

        Returns:
            (k, m).

        Raises:
            RuntimeError: no draw of a part was in the zone, which has almost no volume.
        """
        s = 0.0 if distribution == "uniform" else self.deviation(cp)
        first = numbers(0)
        grown = np.ones(len(first))
        if self.grows:
            grown = self.growth(first[:, -1])
        u, accepted = self._attempt(first, distribution, s, grown)
        for attempt in range(1, _MOST_ATTEMPTS):
            if accepted.all():
                return u
            again, fits = self._attempt(numbers(attempt), distribution, s, grown)
            taken = ~accepted & fits
            u[taken], accepted = again[taken], accepted | fits
        raise RuntimeError("a zone was not met by random draws")

    def _attempt(
        self, uniform: NDArray, distribution: str, s: float, grown: NDArray
    ) -> tuple[NDArray, NDArray]:
        """Coordinates of one attempt, and whether they are in the zone."""
        u = self._in_balls(uniform, distribution, s) * grown[:, None]
        if distribution == "normal":
            return u, np.ones(len(u), dtype=bool)
        if distribution == "uniform" and self.is_cut and not self.grows:
            dimensions, to_u = self._tightest
            u = in_balls(uniform, dimensions) @ to_u.T
        return u, self.inside(u, grown)

    def _in_balls(self, uniform: NDArray, distribution: str, s: float) -> NDArray:
        """(k, m) coordinates in the unit balls, without the cuts."""
        return in_balls(uniform, self.dimensions, distribution, s)

    @cached_property
    def _tightest(self) -> tuple[tuple[int, ...], NDArray]:
        """Of all sets of independent bounds that with the least volume, for drawing.

        Dimensions of its balls, and the matrix from coordinates in them to u.
        """
        bounds = [bound @ self.columns for bound in self.bounds]
        m, best = sum(self.dimensions), np.inf
        found = self.dimensions, np.eye(m)
        for count in range(1, len(bounds) + 1):
            for chosen in itertools.combinations(bounds, count):
                rows = np.vstack(chosen)
                if len(rows) != m or np.linalg.cond(rows) > 1 / _RANK:
                    continue
                dimensions = tuple(len(bound) for bound in chosen)
                volume = np.prod([VOLUMES[d] for d in dimensions])
                volume /= abs(np.linalg.det(rows))
                if volume < best * (1 - 1e-9):
                    best, found = volume, (dimensions, np.linalg.inv(rows))
        return found

    def deviation(self, cp: float = 1.0) -> float:
        """Return the standard deviation of each u of a normal distribution.

        The share outside the zone is that of one dimension, 2 Phi(-3 cp).

        Args:
            cp: capability > 0.

        Returns:
            [-] in radii of the balls; exact for independent bounds, with others the
            quantile of fixed draws (1 % accurate).
        """
        from scipy.optimize import brentq
        from scipy.special import gammainc, ndtr

        outside = 2 * ndtr(-3 * cp)
        halves = np.array(self.dimensions) / 2

        def excess(s: float) -> float:
            return float(np.prod(gammainc(halves, 0.5 / s**2))) - (1 - outside)

        alone = float(brentq(excess, 1e-3, 50.0, xtol=1e-14))
        if not self.is_cut:
            return alone
        u = self._in_balls(_sample(sum(self.dimensions)), "normal", 1.0)
        sizes = [np.linalg.norm(x, axis=1) for x in self._balls(u)]
        sizes += [np.linalg.norm(u @ cut.T, axis=1) for cut in self.cuts]
        sizes += self._cone_gauges(u)
        return 1.0 / float(np.quantile(np.max(sizes, axis=0), 1 - outside))

    def covariance(self, distribution: str = "uniform", cp: float = 1.0) -> NDArray:
        """Return the covariance of the screw.

        Args:
            distribution: see :meth:`draw`.
            cp: capability of the normal distributions.

        Returns:
            (6, 6) [rad^2 .. m^2], closed form of independent bounds, otherwise of
            131 072 fixed draws (1 % accurate).
        """
        return np.asarray(
            self.columns @ self.variance_of_u(distribution, cp) @ self.columns.T
        )

    def variance_of_u(self, distribution: str = "uniform", cp: float = 1.0) -> NDArray:
        """Return (m, m) the covariance of the coordinates; see :meth:`covariance`."""
        if self.is_cut and distribution != "normal":
            u = self.draw(
                lambda attempt: _sample(self.words, attempt), distribution, cp
            )
            return np.asarray(np.cov(u.T, bias=True)).reshape(u.shape[1], -1)
        s = 0.0 if distribution == "uniform" else self.deviation(cp)
        each = [np.full(d, ball_variance(d, distribution, s)) for d in self.dimensions]
        b = self.bonus
        growth = 1.0 / 3.0 if self.from_zero else 1 + b + b**2 / 3  # mean square
        return np.diag(np.concatenate(each)) * growth


def intersection(zones: Sequence[Zone]) -> Zone:
    """Return the zone that is within each of the zones; the first one's bonus holds."""
    bounds = tuple(bound for zone in zones for bound in zone.bounds)
    cones = tuple(cone for zone in zones for cone in zone.cones)
    return Zone(bounds, zones[0].bonus, cones)


def _scale(rows: NDArray) -> NDArray:
    """(6,) [1/rad, 1/m] the largest entries, so that rad and m weigh alike."""
    sizes = [np.abs(rows[:, part]).max() for part in (slice(0, 3), slice(3, 6))]
    return np.repeat([size if size > 0 else 1.0 for size in sizes], 3)


def _sample(words: int, attempt: int = 0) -> NDArray:
    """Fixed uniform numbers, the same at each call."""
    return np.random.default_rng([words, attempt]).random((_SAMPLE, words))
