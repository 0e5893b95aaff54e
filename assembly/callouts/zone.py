"""Convex zones of small screws: support function, random draws, covariance.

A zone is a set of screws d [RX RY RZ TX TY TZ] of a feature, in the feature's axes. It
contains all d with ``|bound @ d| <= 1`` for each bound. Components to which no bound
refers are zero.  A bound with one row is an interval, with two rows a disc, with three
rows a ball.  Linearly independent bounds can reach their limits simultaneously, so
their set is d = columns u, |u_k| <= 1.  Linearly dependent bounds exclude a part of
this set. Double cones ``|s @ d| + |S @ d| <= 1``, the zones of round faces, also
exclude a part.

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
_SAMPLE = 1 << 17  # number of draws for the covariance of a zone without closed form
_RANK = 1e-9  # least accepted singular value of independent bounds, over the largest
_MOST_ATTEMPTS = 10_000  # largest number of draws for one part inside the zone
Numbers = Callable[[int], NDArray]  # attempt -> (k, words) uniform numbers


@dataclass(frozen=True, eq=False)
class Zone:
    """A convex zone of small screws, as defined at the beginning of this module.

    Attributes:
        bounds: matrices (k, 6), k = 1, 2, 3: rows on the screw [1/rad, 1/m].
        bonus: largest relative growth of the zone with the size of the feature (maximum
            material condition); 0 for no growth.
        cones: matrices (3, 6): the row s along the axis of a double cone, and the two
            rows S across it.  The bounds must limit the same components.
        from_zero: whether the zone grows with a size from a point to the bounds, as for
            the shift of a datum at maximum material.
    """

    bounds: tuple[NDArray, ...]
    bonus: float = 0.0
    cones: tuple[NDArray, ...] = ()
    from_zero: bool = False

    @cached_property
    def _split(self) -> tuple[list[int], list[int]]:
        """Indices of the linearly independent bounds, and of the other bounds."""
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
        """(6, m) [rad, m] map from the coordinates u to the screw."""
        rows = np.vstack([self.bounds[i] for i in self._split[0]])
        scale = _scale(rows)
        return np.asarray(np.linalg.pinv(rows / scale) / scale[:, None])

    @cached_property
    def cuts(self) -> tuple[NDArray, ...]:
        """Matrices (k, m): the linearly dependent bounds, as conditions on u."""
        return tuple(self.bounds[i] @ self.columns for i in self._split[1])

    @cached_property
    def cones_on_u(self) -> tuple[NDArray, ...]:
        """Matrices (3, m): the double cones as conditions on the coordinates u."""
        return tuple(cone @ self.columns for cone in self.cones)

    @property
    def is_cut(self) -> bool:
        """Whether further bounds or cones restrict the product of unit balls."""
        return bool(self.cuts or self.cones)

    @property
    def grows(self) -> bool:
        """Whether the zone grows with the size of a feature."""
        return self.bonus > 0 or self.from_zero

    @property
    def words(self) -> int:
        """Uniform random numbers per draw: one per coordinate, one for hole size."""
        return sum(self.dimensions) + self.grows

    def growth(self, size: NDArray) -> NDArray:
        """Return the zone's scale factors for sizes from 0 (least) to 1 (largest)."""
        return size if self.from_zero else 1.0 + self.bonus * size

    def inside(self, u: NDArray, grown: NDArray | float = 1.0) -> NDArray:
        """Return (k,) bool, True for coordinates (k, m) inside the scaled zone."""
        limits = [(part, grown) for part in self._balls(u)]
        limits += [(u @ cut.T, 1.0) for cut in self.cuts]
        marks = [np.linalg.norm(x, axis=-1) <= g * (1 + 1e-12) for x, g in limits]
        marks += [gauge <= 1 + 1e-12 for gauge in self._cone_gauges(u)]
        return np.asarray(np.all(marks, axis=0))

    def _cone_gauges(self, u: NDArray) -> list[NDArray]:
        """Return the gauge (k,) of each double cone, which is 1 on its surface."""
        return [
            abs(u @ c[0]) + np.linalg.norm(u @ c[1:].T, axis=-1)
            for c in self.cones_on_u
        ]

    def _balls(self, u: NDArray) -> list[NDArray]:
        """Return the coordinates u, split into one array per ball."""
        ends = np.cumsum(self.dimensions)
        return np.split(u, ends[:-1], axis=-1)

    @cached_property
    def bounds_on_u(self) -> tuple[NDArray, ...]:
        """Matrices (k, m): the zone at its largest is |bound @ u| <= 1 for all."""
        rows = np.split(np.eye(sum(self.dimensions)), np.cumsum(self.dimensions)[:-1])
        return (*(row / (1.0 + self.bonus) for row in rows), *self.cuts)

    def support(self, direction: NDArray) -> float:
        """Return the largest ``direction @ d`` over the screws of the zone.

        Args:
            direction: (6,) coefficients.

        Returns:
            The largest value. For independent bounds it has a closed form; otherwise it
            is a certified upper bound, larger by about 3e-8 relative.
        """
        return self.farthest_u(np.asarray(direction, dtype=float) @ self.columns)[1]

    def farthest(self, direction: NDArray) -> NDArray:
        """Return the screw (6,) [rad, m] of the zone farthest in a direction (6,)."""
        w = np.asarray(direction, dtype=float) @ self.columns
        return np.asarray(self.columns @ self.farthest_u(w)[0])

    def farthest_u(self, w: NDArray) -> tuple[NDArray, float]:
        """Return the coordinates u (m,) that maximise w @ u, and an upper bound."""
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
        """Return coordinates u of random parts.

        Args:
            numbers: function from the number of the attempt, 0, 1, .., to independent
                uniform numbers (k, :attr:`words`).  A part outside the zone is drawn
                again; the size of its feature is kept from attempt 0.
            distribution: ``"uniform"`` in the zone; ``"normal"``, see
                :meth:`deviation`; or ``"truncated"``, the normal distribution without
                parts outside the zone.
            cp: capability index of the normal distributions.

        Returns:
            (k, m) coordinates.

        Raises:
            RuntimeError: no draw of a part was within the zone, whose volume is almost
                zero.
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
        raise RuntimeError("tolerance zone: found no random draw inside it")

    def _attempt(
        self, uniform: NDArray, distribution: str, s: float, grown: NDArray
    ) -> tuple[NDArray, NDArray]:
        """Return coordinates of one attempt, and whether they are in the zone."""
        u = self._in_balls(uniform, distribution, s) * grown[:, None]
        if distribution == "normal":
            return u, np.ones(len(u), dtype=bool)
        if distribution == "uniform" and self.is_cut and not self.grows:
            dimensions, to_u = self._tightest
            u = in_balls(uniform, dimensions) @ to_u.T
        return u, self.inside(u, grown)

    def _in_balls(self, uniform: NDArray, distribution: str, s: float) -> NDArray:
        """Return coordinates (k, m) in the unit balls, before parts are rejected."""
        return in_balls(uniform, self.dimensions, distribution, s)

    @cached_property
    def _tightest(self) -> tuple[tuple[int, ...], NDArray]:
        """Set of independent bounds with the least volume, used for drawing.

        The set is described by the dimensions of its balls, and the matrix from
        coordinates in the balls to u.
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
        """Return the standard deviation of each u for a normal distribution.

        The probability outside the zone is as in one dimension, 2 Phi(-3 cp).

        Args:
            cp: capability index > 0.

        Returns:
            [-] standard deviation relative to the radii of the balls. It is exact for
            independent bounds, otherwise a quantile of fixed draws (1 % accurate).
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
            cp: capability index of the normal distributions.

        Returns:
            (6, 6) [rad^2 .. m^2] covariance, in closed form for independent bounds,
            otherwise from 131 072 fixed draws (1 % accurate).
        """
        return np.asarray(
            self.columns @ self.variance_of_u(distribution, cp) @ self.columns.T
        )

    def variance_of_u(self, distribution: str = "uniform", cp: float = 1.0) -> NDArray:
        """Return the covariance (m, m) of the coordinates; see :meth:`covariance`."""
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
    """Return the intersection of zones, with the bonus of the first zone."""
    bounds = tuple(bound for zone in zones for bound in zone.bounds)
    cones = tuple(cone for zone in zones for cone in zone.cones)
    return Zone(bounds, zones[0].bonus, cones)


def _scale(rows: NDArray) -> NDArray:
    """Return the largest entries (6,) [1/rad, 1/m], which scale rad and m equally."""
    sizes = [np.abs(rows[:, part]).max() for part in (slice(0, 3), slice(3, 6))]
    return np.repeat([size if size > 0 else 1.0 for size in sizes], 3)


def _sample(words: int, attempt: int = 0) -> NDArray:
    """Return uniform random numbers of a fixed seed, equal at each call."""
    return np.random.default_rng([words, attempt]).random((_SAMPLE, words))
