"""Probability distributions of geometric errors, and reproducible random draws.

Each error source is one component of delta l at one frame, equal to
``centre + scale s``:

=========== ======================================================================
uniform     magnitudes from ``least`` to ``most``, with random signs or all positive
            (``signs = "literal"``, the interval as printed in the paper)
normal      s ~ N(0, 1); the scale is the standard deviation
truncated   normal, truncated where abs(s) exceeds ``limit`` standard deviations
=========== ======================================================================

The random numbers of a draw depend on the seed and on the index of the draw, because
the generator is counter-based.  A run can therefore be interrupted, resumed or
distributed over processes without a change of its results.

Sources:
    Salmon, Moraes, Dror, Shaw (2011), Parallel random numbers: as easy as 1, 2, 3
    (Philox).
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from forcefit.assembly.model.joint_names import error_label, error_rows
from forcefit.assembly.model.random_errors import SIGNS, frames_named
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, Table, nearest, quoted, read_toml
from forcefit.results.display import html_table, short_repr

KINDS = ("uniform", "normal", "truncated")
_LARGEST = 1e3  # [rad, m] largest number in a file of error distributions
# names of the properties that _rows returns for each error source
_COLUMNS = (
    "frame", "component", "kind", "centre", "scale", "least", "limit", "signed",
)  # fmt: skip
_WORDS = 4  # number of random numbers in one step of the Philox generator


@dataclass(frozen=True, eq=False)
class ErrorSources:
    """Independent random components of the geometric errors, m in total.

    Attributes:
        robot: robot to which the frames belong.
        frame: index of the frame of each error (m,).
        component: component of the error screw at the frame (m,).
        kind: index into :data:`KINDS` (m,).
        centre: value at s = 0 (m,) [rad or m].
        scale: nonnegative factor by which s is multiplied (m,) [rad or m].
        least: minimum absolute value of s (m,) [-], below 1; only for uniform sources.
        limit: maximum absolute value of s (m,) [-]; only for truncated sources.
        signed: whether s can be negative (m,).
        fixed: errors (n, 6) [rad, m] that are added to each draw, for example to close
            the loops; None for zero.
        labels: name of each error, for example ``ball.TX``.
    """

    robot: Robot
    frame: NDArray
    component: NDArray
    kind: NDArray
    centre: NDArray
    scale: NDArray
    least: NDArray
    limit: NDArray
    signed: NDArray
    fixed: NDArray | None = None
    labels: tuple[str, ...] = field(init=False)

    __repr__, _repr_html_ = short_repr, html_table

    def __post_init__(self) -> None:
        names = [
            error_label(self.robot, i, c)
            for i, c in zip(self.frame, self.component, strict=True)
        ]
        object.__setattr__(self, "labels", tuple(names))

    def __len__(self) -> int:
        return len(self.frame)

    def standard(self, uniform: NDArray) -> NDArray:
        """Transform uniform random numbers (..., m) in [0, 1) to values s (..., m)."""
        v = 2.0 * uniform - 1.0
        size = self.least + (1.0 - self.least) * np.where(self.signed, abs(v), uniform)
        uniform_values = np.where(self.signed, np.copysign(size, v), size)
        if not (self.kind > 0).any():
            return uniform_values
        # The normal distribution is truncated at the limits.
        tail = np.where(self.kind == 2, ndtr(-self.limit), 0.0)
        normal_values = ndtri(tail + np.maximum(uniform, 2.0**-54) * (1.0 - 2.0 * tail))
        return np.where(self.kind == 0, uniform_values, normal_values)

    def values(self, standard: NDArray) -> NDArray:
        """Return the errors (..., m) [rad or m] for given values s."""
        return self.centre + self.scale * standard

    def uniforms(self, first: int, count: int, seed: int, stream: int = 0) -> NDArray:
        """Return the uniform random numbers that belong to a range of draws.

        Args:
            first: index of the first draw.
            count: number of draws.
            seed: random seed, below 2^64.
            stream: index of the random stream; different streams are independent.

        Returns:
            Random numbers (count, m) in [0, 1), one row per draw.  Each row depends
            only on the index of the draw, the seed and the stream.
        """
        steps = -(-max(1, len(self)) // _WORDS)
        philox = np.random.Philox(key=np.array([seed, stream], dtype=np.uint64))
        philox.advance(first * steps)
        uniform = np.random.Generator(philox).random((count, steps * _WORDS))
        return uniform[:, : len(self)]

    def draw(self, first: int, count: int, seed: int, stream: int = 0) -> NDArray:
        """Draw errors (count, m) [rad or m]; see :meth:`uniforms`."""
        return self.values(self.standard(self.uniforms(first, count, seed, stream)))

    def errors(self, values: NDArray) -> NDArray:
        """Return delta l of all frames (..., n, 6) [rad, m] for values (..., m)."""
        full = np.zeros((*values.shape[:-1], len(self.robot.frames), 6))
        full[..., self.frame, self.component] = values
        return full if self.fixed is None else full + self.fixed

    @property
    def mean(self) -> NDArray:
        """Expected value of each error (m,) [rad or m]."""
        one_sided = (self.kind == 0) & ~self.signed
        return self.centre + self.scale * np.where(one_sided, (1 + self.least) / 2, 0.0)

    @property
    def variance(self) -> NDArray:
        """Variance of each error (m,) [rad^2 or m^2]."""
        a = self.least
        uniform = np.where(self.signed, (1 + a + a**2) / 3, (1 - a) ** 2 / 12)
        cut = np.where(self.kind == 2, self.limit, 8.0)
        density = np.exp(-(cut**2) / 2) / np.sqrt(2 * np.pi)
        inside = 1.0 - 2.0 * ndtr(-cut)
        normal = np.where(self.kind == 2, 1.0 - 2.0 * cut * density / inside, 1.0)
        return self.scale**2 * np.where(self.kind == 0, uniform, normal)

    def of_numbers(self, slopes: NDArray) -> NDArray:
        """Select the derivatives (..., m) with respect to the errors of the sources."""
        return np.asarray(slopes[..., self.frame, self.component])

    @property
    def units(self) -> list[str]:
        """Unit of each error."""
        return ["rad" if c < 3 else "m" for c in self.component.tolist()]

    @property
    def identity(self) -> list[NDArray]:
        """Arrays that, together with the seed, determine the draws."""
        return [
            self.frame, self.component, self.kind, self.centre, self.scale,
            self.least, self.limit, self.signed,
            *([] if self.fixed is None else [self.fixed]),
        ]  # fmt: skip

    def scaled(self, scale: NDArray) -> "ErrorSources":
        """Return the same error sources with new scales (m,) [rad or m]."""
        return replace(self, scale=np.asarray(scale, dtype=float))


def draw_generator(seed: int, draw: int, stream: int) -> np.random.Generator:
    """Return a random generator for a single draw.

    Args:
        seed: random seed, below 2^64.
        draw: index of the draw.
        stream: index of a stream that is not used by :meth:`ErrorSources.uniforms`.

    Returns:
        Generator that depends only on these three arguments.
    """
    philox = np.random.Philox(
        key=np.array([seed, stream], dtype=np.uint64),
        counter=np.array([0, draw, 0, 0], dtype=np.uint64),
    )
    return np.random.Generator(philox)


def tolerance_sources(
    robot: Robot, tolerances: NDArray, frames: tuple[str, ...] | None = None,
    distribution: str = "uniform", deviations: float = 3.0,
) -> ErrorSources:  # fmt: skip
    """Return error sources for symmetric tolerances.

    Args:
        robot: robot with n frames.
        tolerances: half widths of the tolerance intervals (6,) [rad, m]; 0 for
            components without error.
        frames: names of the frames and joints with errors.  The default is all frames
            whose bodies have a geometric error or an elastic link.
        distribution: ``"uniform"`` over the tolerance interval, or ``"truncated"`` for
            a normal distribution truncated at its ends.
        deviations: half width of the tolerance interval in standard deviations.

    Returns:
        Error sources, ordered by frame.

    Raises:
        BadInput: the robot has no frame with one of the given names.
    """
    names = frames_named(robot, frames) if frames is not None else tuple(
        f.name for f in robot.frames if f.link is not None or f.geometric_error.any()
    )  # fmt: skip
    given = np.asarray(tolerances, dtype=float)
    widths = {
        (row, order[c]): given[c]
        for name in names for row, order in error_rows(robot, name)
        for c in np.flatnonzero(given > 0)
    }  # fmt: skip
    frame, component = np.array(list(widths), dtype=int).reshape(-1, 2).T
    count, cut = len(frame), distribution == "truncated"
    width = np.array(list(widths.values()), dtype=float)
    return ErrorSources(
        robot=robot,
        frame=frame,
        component=component,
        kind=np.full(count, KINDS.index(distribution)),
        centre=np.zeros(count),
        scale=width / deviations if cut else width,
        least=np.zeros(count),
        limit=np.full(count, deviations),
        signed=np.ones(count, dtype=bool),
    )


def read_sources(
    path: Path | str, robot: Robot, fixed: NDArray | None = None
) -> ErrorSources:
    """Read error sources from a file; see ``docs/statistics.md``.

    Args:
        path: TOML file with ``[[errors]]`` tables.
        robot: robot with the frames named in the file.
        fixed: errors (n, 6) [rad, m] that are added to each draw.

    Returns:
        Error sources in the order of the file; within a table, in the frame order of
        the robot.

    Raises:
        BadInput: the file contains invalid data.
    """
    root = read_toml(path)
    tables = root.tables("errors")
    root.finish()
    if not tables:
        raise BadInput(f"{path}: errors: missing; expected tables [[errors]]")
    rows: list[tuple] = []
    for table in tables:
        rows += _rows(table, robot)
    seen: dict[tuple[int, int], str] = {}
    for (i, c, *_), table in rows:
        if (i, c) in seen:
            name = quoted(error_label(robot, i, c))
            raise table.bad("", f"found {name} a second time, first in {seen[i, c]}")
        seen[i, c] = table.place
    columns = zip(*(row for row, _ in rows), strict=True)
    return ErrorSources(
        robot, **dict(zip(_COLUMNS, map(np.array, columns), strict=True)), fixed=fixed
    )


def _rows(table: Table, robot: Robot) -> list[tuple]:
    """Return the properties of each error source in an ``[[errors]]`` table."""
    names = table.require("frames", "a list of frame names")
    if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
        raise table.bad("frames", "expected a list of frame names")
    try:
        frames = frames_named(robot, names)
    except BadInput as error:
        raise table.bad("frames", str(error)) from None
    kind = table.text("distribution", "uniform")
    if kind not in KINDS:
        raise table.bad("distribution", f"found {quoted(kind)}{nearest(kind, KINDS)}")
    zero = np.zeros(6)
    centre = table.array("centre", (6,), "rad, m", zero, largest=_LARGEST)
    least, limit, signed = zero, np.full(6, np.inf), True
    if kind == "uniform":
        scale = table.array("most", (6,), "rad, m", largest=_LARGEST)
        least = table.array("least", (6,), "rad, m", zero)
        if not ((0 <= least) & (least <= scale)).all():
            raise table.bad("least", "expected 0 <= least <= most in every component")
        signs = table.text("signs", "signed")
        if signs not in SIGNS:
            raise table.bad("signs", f"found {quoted(signs)}{nearest(signs, SIGNS)}")
        signed = signs == "signed"
        least = least / np.where(scale > 0, scale, 1.0)
    else:
        scale = table.array("deviation", (6,), "rad, m", largest=_LARGEST)
        if kind == "truncated":
            most = table.array("most", (6,), "rad, m")
            if not (most[scale > 0] > 0).all():
                raise table.bad(
                    "most",
                    "expected a bound > 0 for each component with a deviation > 0",
                )
            limit = most / np.where(scale > 0, scale, 1.0)
    if not (scale >= 0).all():
        key = "most" if kind == "uniform" else "deviation"
        raise table.bad(key, "expected numbers >= 0")
    table.finish()
    kept = np.flatnonzero((scale > 0) | (centre != 0))
    code = KINDS.index(kind)
    return [
        ((row, order[c], code, centre[c], scale[c], least[c], limit[c], signed), table)
        for name in frames for row, order in error_rows(robot, name) for c in kept
    ]  # fmt: skip
