"""Random geometric errors from drawing callouts, joint fits and an errors file.

The shift and the tilt of a bore within its position zone depend on each other, so all
errors of one callout are drawn together. A draw depends only on its index and the seed,
as in :mod:`forcefit.assembly.model.error_distributions`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.fits import FittedEnd
from forcefit.assembly.callouts.zone import DISTRIBUTIONS
from forcefit.assembly.kinematics.callout_maps import place_callouts
from forcefit.assembly.kinematics.placed_callout import PlacedCallout
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.error_distributions import ErrorSources, read_sources
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.statistics.joint_fits import (
    JointFit,
    fits_of,
    kind_of_fit,
    with_clearance,
)
from forcefit.assembly.statistics.ranking import group_of, kind_of
from forcefit.inputs.table import BadInput

_SAMPLE = 1 << 14  # number of draws for estimating the variance of a fit
_WORDS = 4  # number of random numbers per step of the Philox generator


@dataclass(frozen=True, eq=False)
class CalloutSources:
    """Random errors from callouts, an errors file and fits.

    Each draw consists of m random numbers, in this order: the independent errors [rad
    or m], the coordinates in the callout zones relative to the radius of each ball [-],
    and the deviations of the fits' radial clearances from their means [m].

    Attributes:
        robot: robot with the callouts.
        placed: callouts of the robot with their zones.
        independent: independent errors, which are added to the errors of the callouts,
            or None.
        fixed: (n, 6) [rad, m] errors that are added to every draw; zero if None.
        fits: fits of the robot's joints.
    """

    robot: Robot
    placed: tuple[PlacedCallout, ...]
    independent: ErrorSources | None = None
    fixed: NDArray | None = None
    fits: tuple[JointFit, ...] = ()

    @property
    def _independent_count(self) -> int:
        """Number of independent errors."""
        return 0 if self.independent is None else len(self.independent)

    @cached_property
    def columns(self) -> list[NDArray]:
        """Column indices of each callout's random numbers."""
        widths = [sum(placed.zone.dimensions) for placed in self.placed]
        ends = self._independent_count + np.cumsum(widths)
        return [np.arange(e - w, e) for e, w in zip(ends, widths, strict=True)]

    @cached_property
    def maps(self) -> NDArray:
        """Errors delta l per unit of each random number, (n, 6, m) [rad, m]."""
        n = len(self.robot.frames)
        maps = np.zeros((n, 6, len(self)))
        if self.independent is not None:
            columns = np.arange(len(self.independent))
            maps[self.independent.frame, self.independent.component, columns] = 1.0
        for columns, placed in zip(self.columns, self.placed, strict=True):
            maps[:, :, columns] = placed.errors
        return maps

    def __len__(self) -> int:
        of_zones = sum(sum(placed.zone.dimensions) for placed in self.placed)
        return self._independent_count + of_zones + len(self.fits)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Name of each random number."""
        own = () if self.independent is None else self.independent.labels
        return (
            *own,
            *(
                f"{placed.name} ({i + 1})"
                for placed in self.placed
                for i in range(sum(placed.zone.dimensions))
            ),
            *(fit.name for fit in self.fits),
        )

    def groups_by(self, by: str) -> list[str]:
        """Return the group name of each random number.

        Args:
            by: ``"source"``, ``"frame"`` or ``"kind"``.

        Returns:
            Names, (m,). All numbers of a callout are in one group. With ``"kind"``,
            callouts with the same name in all legs are in one group. All numbers that
            depend on the size of the same hole are in one group.
        """
        labels = () if self.independent is None else self.independent.labels
        names, holes, counts = list[str](), list[str](), list[int]()
        for placed in self.placed:
            name = placed.callout.name
            names.append(f"{placed.words} of {kind_of(name) if by == 'kind' else name}")
            holes.append(placed.hole_of if placed.hole else "")
            counts.append(sum(placed.zone.dimensions))
        for fit in self.fits:
            short = kind_of_fit(self.robot, fit) if by == "kind" else fit.frame
            names.append(f"fit {fit.fit.text} of {short}")
            holes.append(fit.frame)
            counts.append(1)
        own = [group_of(label, by) for label in labels]
        for name, hole, count in zip(names, holes, counts, strict=True):
            of_hole = [n for n, h in zip(names, holes, strict=True) if h == hole]
            whole = " and ".join(dict.fromkeys(of_hole)) if hole else name
            own += [whole] * count
        return own

    def draw(self, first: int, count: int, seed: int, stream: int = 0) -> NDArray:
        """Return the random numbers of ``count`` draws, (count, m)."""
        words = [self._independent_count, *(p.zone.words for p in self.placed)]
        words += [2] * len(self.fits)
        ends = np.cumsum(words)

        @cache
        def uniforms(attempt: int) -> list[NDArray]:
            rows = _uniforms(first, count, seed, stream, int(ends[-1]), attempt)
            parts = np.split(rows, ends[:-1], axis=1)
            self._share_sizes(parts)
            return parts

        parts = []
        if self.independent is not None:
            own = self.independent
            parts.append(own.values(own.standard(uniforms(0)[0])))
        for i, placed in enumerate(self.placed, 1):
            of_callout = _nth(uniforms, i)
            parts.append(
                placed.zone.draw(
                    of_callout, placed.callout.distribution, placed.callout.cp
                )
            )
        for i, one in enumerate(self.fits, 1 + len(self.placed)):
            radial = one.fit.draw(uniforms(0)[i])
            parts.append(radial[:, None] - one.fit.mean_radial)
        return np.hstack(parts)

    def _share_sizes(self, parts: list[NDArray]) -> None:
        """Use the same random number for all callouts and fits of a hole."""
        sizes: dict[str, NDArray] = {}
        for part, placed in zip(parts[1:], self.placed, strict=False):
            if placed.hole:
                part[:, -1] = sizes.setdefault(placed.hole_of, part[:, -1])
        for part, fit in zip(parts[1 + len(self.placed) :], self.fits, strict=True):
            part[:, 0] = sizes.get(fit.frame, part[:, 0])

    def with_clearances(self, values: NDArray) -> Robot:
        """Return the robot with the fit clearances of one draw, (m,)."""
        more = values[len(self) - len(self.fits) :]
        pairs = zip(self.fits, more, strict=True)
        return self._with_radial([f.fit.mean_radial + float(v) for f, v in pairs])

    def with_largest_clearances(self) -> Robot:
        """Return the robot with the largest clearance of every fit."""
        return self._with_radial([one.fit.radial[1] for one in self.fits])

    def _with_radial(self, radial: list[float]) -> Robot:
        """Return the robot with the given radial clearances [m] of its fits."""
        frames = list(self.robot.frames)
        for one, bound in zip(self.fits, radial, strict=True):
            gap = max(0.0, bound)
            for row, end in one.bounds:
                new = {"radial": gap} if end is None else end.bounds(gap)
                frames[row] = with_clearance(frames[row], new)
        return replace(self.robot, frames=tuple(frames))

    def errors(self, values: NDArray) -> NDArray:
        """Return the errors delta l of draws, (..., n, 6) [rad, m]."""
        full = np.einsum("nim,...m->...ni", self.maps, values)
        return full if self.fixed is None else full + self.fixed

    def of_numbers(self, slopes: NDArray) -> NDArray:
        """Return derivatives with respect to the random numbers, (..., m)."""
        return np.einsum("...ni,nim->...m", slopes, self.maps)

    @cached_property
    def variance(self) -> NDArray:
        """Variances of the random numbers, (m,)."""
        own = [] if self.independent is None else [self.independent.variance]
        for p in self.placed:
            C = p.zone.variance_of_u(p.callout.distribution, p.callout.cp)
            own.append(np.diag(C))
        fixed = np.random.default_rng(1).random((_SAMPLE, 2))
        own += [np.array([one.fit.draw(fixed).var()]) for one in self.fits]
        return np.concatenate(own)

    @property
    def units(self) -> list[str]:
        """Unit of each random number; "rad, m" for callouts and fits."""
        own = [] if self.independent is None else self.independent.units
        return own + ["rad, m"] * (len(self) - len(own))

    @property
    def identity(self) -> list[NDArray]:
        """Arrays that are equal for two objects if and only if their draws are."""
        own = [] if self.independent is None else self.independent.identity
        for p in self.placed:
            law = [DISTRIBUTIONS.index(p.callout.distribution), p.callout.cp]
            growth = [p.zone.bonus, *law, *([1.0] if p.zone.from_zero else [])]
            if p.hole:  # find the fit with the same hole
                growth += [float(f.frame == p.hole_of) for f in self.fits]
            own += [*p.zone.bounds, *p.zone.cones, np.array(growth), p.errors]
        for f in self.fits:
            rows = [x for row, end in f.bounds for x in (row, *_length(end))]
            own.append(np.array([*f.fit.hole, *f.fit.shaft, *rows]))
        return own + ([] if self.fixed is None else [self.fixed])


Sources = ErrorSources | CalloutSources


def _length(end: FittedEnd | None) -> list[float]:
    """Return a list with the length of a fitted end, or an empty list."""
    return [] if end is None else [end.length]


def _nth(uniforms: Callable[[int], list[NDArray]], i: int) -> Callable[[int], NDArray]:
    """Return the function for the random numbers of callout i."""
    return lambda attempt: uniforms(attempt)[i]


def _uniforms(
    first: int, count: int, seed: int, stream: int, words: int, attempt: int
) -> NDArray:
    """Return uniform random numbers of draws from ``first``, (count, words)."""
    steps = -(-max(1, words) // _WORDS)
    philox = np.random.Philox(
        key=np.array([seed, stream], dtype=np.uint64),
        counter=np.array([0, 0, attempt, 0], dtype=np.uint64),
    )
    philox.advance(first * steps)
    rows = np.random.Generator(philox).random((count, steps * _WORDS))
    return rows[:, :words]


def sources_of(
    robot: Robot,
    independent: Sources | Path | str | None = None,
    fixed: NDArray | None = None,
) -> Sources:
    """Collect a robot's random errors from its callouts, fits and independent errors.

    Args:
        robot: the robot.
        independent: independent errors, or the path of a TOML file that defines them
            (see docs/statistics.md), or None. A result of this function is returned
            unchanged.
        fixed: (n, 6) [rad, m] errors that are added to every draw.

    Returns:
        The error sources. Without callouts, these are the independent errors.

    Raises:
        BadInput: the file is invalid, or there are neither callouts nor independent
            errors.
    """
    if isinstance(independent, Path | str):
        independent = read_sources(independent, robot, fixed)
    if isinstance(independent, CalloutSources):
        return independent
    fits = fits_of(robot)
    if robot.callouts or fits:
        placed = place_callouts(home_posture(robot))
        return CalloutSources(robot, placed, independent, fixed, fits)
    if independent is None:
        raise BadInput(
            f"{robot.name}: found neither --errors nor a [[tolerance]] table or a fit "
            "in the robot file; expected one of them"
        )
    return independent
