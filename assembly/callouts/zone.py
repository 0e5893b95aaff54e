"""Convex tolerance zones: support function, random draws and covariance.

A zone is a set of small screws d [RX RY RZ TX TY TZ] of a feature in feature axes.  It
contains all d with ``|bound @ d| <= 1`` for each bound.  Components without a bound are
zero.  A bound with one, two or three rows is an interval, a disc or a ball.

Linearly independent bounds define a product of unit balls, d = columns u with
|u_k| <= 1.  Linearly dependent bounds and the double cones ``|s @ d| + |S @ d| <= 1``
of round faces restrict this set.

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
_SAMPLE = 1 << 17  # number of draws for a covariance without a closed form
_RANK = 1e-9  # smallest relative singular value of linearly independent bounds
_MOST_ATTEMPTS = 10_000  # maximum number of attempts of rejection sampling
Numbers = Callable[[int], NDArray]  # returns uniform random numbers for an attempt


@dataclass(frozen=True, eq=False)
class Zone:
    """Convex tolerance zone of small screws.

    Attributes:
        bounds: matrices (k, 6) [1/rad, 1/m] with k = 1, 2 or 3, which are multiplied by
            the screw.
        bonus: maximum relative growth of the zone with the hole size due to a maximum
            material condition; 0 without growth.
        cones: matrices (3, 6) of double cones, with the row s along the axis and two
            rows S normal to it.  The bounds must limit the same components.
        from_zero: whether the zone is a point for the smallest hole, as for the shift
            of a datum with maximum material condition.
    """

    bounds: tuple[NDArray, ...]
    bonus: float = 0.0
    cones: tuple[NDArray, ...] = ()
    from_zero: bool = False

    @cached_property
    def _split(self) -> tuple[list[int], list[int]]:
        """Indices of the linearly independent bounds and of the remaining bounds."""
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
        """Matrix that maps the coordinates u to the screw, (6, m) [rad, m]."""
        rows = np.vstack([self.bounds[i] for i in self._split[0]])
        scale = _scale(rows)
        return np.asarray(np.linalg.pinv(rows / scale) / scale[:, None])

    @cached_property
    def cuts(self) -> tuple[NDArray, ...]:
        """Linearly dependent bounds on u, as matrices (k, m)."""
        return tuple(self.bounds[i] @ self.columns for i in self._split[1])

    @cached_property
    def cones_on_u(self) -> tuple[NDArray, ...]:
        """Double cones in u, as matrices (3, m)."""
        return tuple(cone @ self.columns for cone in self.cones)

    @property
    def is_cut(self) -> bool:
        """Whether dependent bounds or double cones restrict the product of balls."""
        return bool(self.cuts or self.cones)

    @property
    def grows(self) -> bool:
        """Whether the zone grows with the hole size."""
        return self.bonus > 0 or self.from_zero

    @property
    def words(self) -> int:
        """Number of uniform random numbers for one draw, including the hole size."""
        return sum(self.dimensions) + self.grows

    def growth(self, size: NDArray) -> NDArray:
        """Return scale factors of the zone for relative hole sizes from 0 to 1."""
        return size if self.from_zero else 1.0 + self.bonus * size

    def inside(self, u: NDArray, grown: NDArray | float = 1.0) -> NDArray:
        """Return whether coordinates u, (k, m), are inside the scaled zone."""
        limits = [(part, grown) for part in self._balls(u)]
        limits += [(u @ cut.T, 1.0) for cut in self.cuts]
        marks = [np.linalg.norm(x, axis=-1) <= g * (1 + 1e-12) for x, g in limits]
        marks += [gauge <= 1 + 1e-12 for gauge in self._cone_gauges(u)]
        return np.asarray(np.all(marks, axis=0))

    def _cone_gauges(self, u: NDArray) -> list[NDArray]:
        """Return the gauge of each double cone, (k,), which is 1 on its surface."""
        return [
            abs(u @ c[0]) + np.linalg.norm(u @ c[1:].T, axis=-1)
            for c in self.cones_on_u
        ]

    def _balls(self, u: NDArray) -> list[NDArray]:
        """Split the coordinates u into an array for each ball."""
        ends = np.cumsum(self.dimensions)
        return np.split(u, ends[:-1], axis=-1)

    @cached_property
    def bounds_on_u(self) -> tuple[NDArray, ...]:
        """Bounds on u for the largest hole, as matrices (k, m)."""
        rows = np.split(np.eye(sum(self.dimensions)), np.cumsum(self.dimensions)[:-1])
        return (*(row / (1.0 + self.bonus) for row in rows), *self.cuts)

    def support(self, direction: NDArray) -> float:
        """Return the support function of the zone, the maximum of ``direction @ d``.

        Args:
            direction: coefficients, (6,).

        Returns:
            Maximum for independent bounds; otherwise an upper bound with a relative
            error of about 3e-8.
        """
        return self.farthest_u(np.asarray(direction, dtype=float) @ self.columns)[1]

    def farthest(self, direction: NDArray) -> NDArray:
        """Return the screw in the zone that maximises direction @ d, (6,) [rad, m]."""
        w = np.asarray(direction, dtype=float) @ self.columns
        return np.asarray(self.columns @ self.farthest_u(w)[0])

    def farthest_u(self, w: NDArray) -> tuple[NDArray, float]:
        """Return the coordinates that maximise w @ u, (m,), and an upper bound."""
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
        """Draw random coordinates u by rejection sampling.

        Args:
            numbers: function that returns uniform random numbers (k, :attr:`words`) for
                attempt 0, 1, ...  Draws outside the zone are repeated with the hole
                size of attempt 0.
            distribution: ``"uniform"`` in the zone, ``"normal"`` (see
                :meth:`deviation`), or ``"truncated"``, which is the normal distribution
                restricted to the zone.
            cp: process capability index of the normal distributions.

        Returns:
            Coordinates, (k, m).

        Raises:
            RuntimeError: no draw was inside the zone, because its volume is almost
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
        """Return the coordinates of one attempt, and whether they are accepted."""
        u = self._in_balls(uniform, distribution, s) * grown[:, None]
        if distribution == "normal":
            return u, np.ones(len(u), dtype=bool)
        if distribution == "uniform" and self.is_cut and not self.grows:
            dimensions, to_u = self._tightest
            u = in_balls(uniform, dimensions) @ to_u.T
        return u, self.inside(u, grown)

    def _in_balls(self, uniform: NDArray, distribution: str, s: float) -> NDArray:
        """Draw coordinates in the product of unit balls, (k, m)."""
        return in_balls(uniform, self.dimensions, distribution, s)

    @cached_property
    def _tightest(self) -> tuple[tuple[int, ...], NDArray]:
        """Set of independent bounds with minimum volume, for rejection sampling.

        The tuple contains the dimensions of the balls and the matrix that maps the
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
        """Return the standard deviation of the coordinates for a normal distribution.

        The probability that a draw is outside the zone is 2 Phi(-3 cp), as in one
        dimension.

        Args:
            cp: process capability index, > 0.

        Returns:
            Standard deviation relative to the radii of the balls [-]. It is exact for
            independent bounds.  Otherwise, it is estimated from random draws with an
            accuracy of 1 %.
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
            cp: process capability index of the normal distributions.

        Returns:
            Covariance, (6, 6) [rad^2 .. m^2]. It is exact for independent bounds.
            Otherwise, it is estimated from random draws with an accuracy of 1 %.
        """
        return np.asarray(
            self.columns @ self.variance_of_u(distribution, cp) @ self.columns.T
        )

    def variance_of_u(self, distribution: str = "uniform", cp: float = 1.0) -> NDArray:
        """Return the covariance of the coordinates u, (m, m)."""
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
    """Return the intersection of zones, with the ``bonus`` of the first zone."""
    bounds = tuple(bound for zone in zones for bound in zone.bounds)
    cones = tuple(cone for zone in zones for cone in zone.cones)
    return Zone(bounds, zones[0].bonus, cones)


def _scale(rows: NDArray) -> NDArray:
    """Return the largest bound entries for rotations and translations, (6,)."""
    sizes = [np.abs(rows[:, part]).max() for part in (slice(0, 3), slice(3, 6))]
    return np.repeat([size if size > 0 else 1.0 for size in sizes], 3)


def _sample(words: int, attempt: int = 0) -> NDArray:
    """Return uniform random numbers, which are the same in each call."""
    return np.random.default_rng([words, attempt]).random((_SAMPLE, words))
