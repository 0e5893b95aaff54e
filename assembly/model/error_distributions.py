"""Probability distributions of geometric errors, and reproducible random draws.

Each source is one component of one frame's delta l, equal to ``centre + scale s``:

=========== ======================================================================
uniform     s between -1 and 1; sizes from ``least`` to ``most`` with random signs,
            or all positive (``signs = "literal"``, the paper's interval as printed)
normal      s ~ N(0, 1), scale the standard deviation
truncated   normal, cut off where abs(s) exceeds ``limit`` standard deviations
=========== ======================================================================

The random numbers of draw i come from one position of a counter-based generator and do
not depend on earlier draws.  A run can therefore be interrupted, resumed or distributed
among processes without a change of its results.

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
_LARGEST = 1e3  # [rad, m] upper limit of the numbers in a file of errors
# names of the columns in the result of _rows
_COLUMNS = (
    "frame", "component", "kind", "centre", "scale", "least", "limit", "signed",
)  # fmt: skip
_WORDS = 4  # number of random numbers that one step of the Philox generator produces


@dataclass(frozen=True, eq=False)
class ErrorSources:
    """Independent random components of the geometric errors; m components in total.

    Attributes:
        robot: the robot of these frames.
        frame: (m,) index of the frame.
        component: (m,) component of the frame's screw.
        kind: (m,) index into :data:`KINDS`.
        centre: (m,) [rad or m] value at s = 0.
        scale: (m,) [rad or m] factor by which s is multiplied, >= 0.
        least: (m,) [-] smallest absolute value of s, below 1; only for uniform sources.
        limit: (m,) [-] largest absolute value of s; only for truncated sources.
        signed: (m,) bool, True if s can be positive or negative.
        fixed: (n, 6) [rad, m] errors that are added to every draw, such as the
            mismatch of the closures; None for zero.
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
        """Return the (..., m) values s for uniform random numbers between 0 and 1."""
        v = 2.0 * uniform - 1.0
        size = self.least + (1.0 - self.least) * np.where(self.signed, abs(v), uniform)
        uniform_values = np.where(self.signed, np.copysign(size, v), size)
        if not (self.kind > 0).any():
            return uniform_values
        # only the part of the normal distribution between the limits is used
        tail = np.where(self.kind == 2, ndtr(-self.limit), 0.0)
        normal_values = ndtri(tail + np.maximum(uniform, 2.0**-54) * (1.0 - 2.0 * tail))
        return np.where(self.kind == 0, uniform_values, normal_values)

    def values(self, standard: NDArray) -> NDArray:
        """Return the (..., m) [rad or m] errors for the values s."""
        return self.centre + self.scale * standard

    def uniforms(self, first: int, count: int, seed: int, stream: int = 0) -> NDArray:
        """Return the (count, m) uniform random numbers in [0, 1) of some draws.

        Args:
            first: number of the first draw.
            count: number of draws.
            seed: seed of all draws, below 2^64.
            stream: number of the stream; streams are independent.

        Returns:
            The random numbers, one row for each draw.  The numbers of one draw do not
            depend on ``first`` or ``count``.
        """
        steps = -(-max(1, len(self)) // _WORDS)
        philox = np.random.Philox(key=np.array([seed, stream], dtype=np.uint64))
        philox.advance(first * steps)
        uniform = np.random.Generator(philox).random((count, steps * _WORDS))
        return uniform[:, : len(self)]

    def draw(self, first: int, count: int, seed: int, stream: int = 0) -> NDArray:
        """Return the (count, m) [rad or m] errors of draws; see :meth:`uniforms`."""
        return self.values(self.standard(self.uniforms(first, count, seed, stream)))

    def errors(self, values: NDArray) -> NDArray:
        """Return (..., n, 6) [rad, m] delta l of every frame from values (..., m)."""
        full = np.zeros((*values.shape[:-1], len(self.robot.frames), 6))
        full[..., self.frame, self.component] = values
        return full if self.fixed is None else full + self.fixed

    @property
    def mean(self) -> NDArray:
        """(m,) [rad or m] expected value of every error."""
        one_sided = (self.kind == 0) & ~self.signed
        return self.centre + self.scale * np.where(one_sided, (1 + self.least) / 2, 0.0)

    @property
    def variance(self) -> NDArray:
        """(m,) [rad^2 or m^2] variance of every error."""
        a = self.least
        uniform = np.where(self.signed, (1 + a + a**2) / 3, (1 - a) ** 2 / 12)
        cut = np.where(self.kind == 2, self.limit, 8.0)
        density = np.exp(-(cut**2) / 2) / np.sqrt(2 * np.pi)
        inside = 1.0 - 2.0 * ndtr(-cut)
        normal = np.where(self.kind == 2, 1.0 - 2.0 * cut * density / inside, 1.0)
        return self.scale**2 * np.where(self.kind == 0, uniform, normal)

    def of_numbers(self, slopes: NDArray) -> NDArray:
        """Return derivatives by source (..., m), given those by error (..., n, 6)."""
        return np.asarray(slopes[..., self.frame, self.component])

    @property
    def units(self) -> list[str]:
        """Unit of each source."""
        return ["rad" if c < 3 else "m" for c in self.component.tolist()]

    @property
    def identity(self) -> list[NDArray]:
        """Arrays that identify the draws: equal arrays mean equal draws."""
        return [
            self.frame, self.component, self.kind, self.centre, self.scale,
            self.least, self.limit, self.signed,
            *([] if self.fixed is None else [self.fixed]),
        ]  # fmt: skip

    def scaled(self, scale: NDArray) -> "ErrorSources":
        """Return the same sources with new scales (m,) [rad or m]."""
        return replace(self, scale=np.asarray(scale, dtype=float))


def draw_generator(seed: int, draw: int, stream: int) -> np.random.Generator:
    """Return the generator of the random numbers of one draw.

    Args:
        seed: seed of all draws, below 2^64.
        draw: number of the draw.
        stream: number of a stream that :meth:`ErrorSources.uniforms` does not use.

    Returns:
        A generator that depends only on these three numbers.
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
    """Return the error sources for symmetric tolerances.

    Args:
        robot: robot of n frames.
        tolerances: (6,) [rad, m] half widths of the tolerance intervals by component; 0
            for a component without error.
        frames: names of the frames and joints with errors.  If None, all frames whose
            bodies have a geometric error or an elastic link.
        distribution: ``"uniform"`` over the tolerance, or ``"truncated"``: normal, cut
            at the tolerance.
        deviations: half width of the tolerance interval in standard deviations.

    Returns:
        The sources, frame by frame.

    Raises:
        BadInput: a frame does not exist in the robot.
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
    """Return the error sources of a file; see ``docs/statistics.md``.

    Args:
        path: TOML file with ``[[errors]]`` tables.
        robot: the robot with the frames named in the file.
        fixed: (n, 6) [rad, m] errors that are added to every draw.

    Returns:
        The sources in the order of the file; frames of a table in the robot's order.

    Raises:
        BadInput: the file violates a rule.
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
    """Return one row per source of an ``[[errors]]`` table."""
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
                    "expected a bound > 0 in every component whose deviation is > 0",
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
