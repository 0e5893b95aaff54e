"""What a model may consist of beside geometry and springs: effects and functions.

An element adds ``offset + columns d`` to the whitened readings, d its unknowns in units
in which columns of one kind have norm one.  One size is asked for all of them.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.effects.functions import AXES
from assembly.model.robot import Robot
from validation.diagnosis.candidates import Candidate
from validation.diagnosis.gaussian import Taken, averaged_gains, likeness
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.signatures import Signature

_PLAUSIBLE = 1e3  # times its plausible size: no effect is larger
_NO_OFFSET = 1e-9  # [sigma]


@dataclass(frozen=True, eq=False)
class Element:
    """An effect of the library at certain frames, or a function.

    Attributes:
        name: the effect's; ``""`` of a function.
        columns: (N, m) whitened change of the readings per unit of an unknown.
        scale: (m,) the unit.
        offset: (N,) what no unknown scales; None if there is nothing.
        lower, upper: (m,) bounds, in units.
        given: (m,) standard deviation in units where it is known, else NaN.
        most: [units] largest size that is plausible.
        log_prior: ln of the probability before the readings are looked at.
        what: the hypothesis or candidate.
        slots: (m,) which of the hypothesis's slots; columns of a function.
        begin: values of all slots where the unknowns are zero.
        first: the same as it was scored at first, where it was taken again since.
    """

    name: str
    columns: NDArray
    scale: NDArray
    offset: NDArray | None
    lower: NDArray
    upper: NDArray
    given: NDArray
    most: float
    log_prior: float
    what: Hypothesis | Candidate
    slots: NDArray
    begin: NDArray
    first: "Element | None" = None

    @property
    def origin(self) -> "Element":
        """The same where its unknowns begin."""
        return self.first or self

    @property
    def hypothesis(self) -> Hypothesis:
        """Of an effect of the library."""
        assert isinstance(self.what, Hypothesis)
        return self.what

    @property
    def candidate(self) -> Candidate:
        """Of a function."""
        assert isinstance(self.what, Candidate)
        return self.what

    @property
    def bounded(self) -> NDArray:
        """(m,) whether an unknown begins at its lower bound."""
        return np.abs(self.lower) < 1e-12

    def values(self, d: NDArray) -> NDArray:
        """Values of all slots, or of a function's unknowns, within their bounds."""
        x = self.begin.copy()
        x[self.slots] += np.clip(d, self.lower, self.upper) * self.scale
        return x


def effect_element(
    signature: Signature, robot: Robot, log_prior: float, shapes: NDArray | None = None
) -> Element:
    """An effect of the library to first order.

    Args:
        signature: of the hypothesis.
        robot: whose frames it names.
        log_prior: of it.
        shapes: (k,) values about which it was taken; absent where it begins.

    Returns:
        The element; unknowns that do not show are left at their start.
    """
    h = signature.hypothesis
    shape = np.array([slot.shape for slot in h.slots], dtype=bool)
    begin = h.start if shapes is None else np.where(shape, shapes, h.start)
    shown = signature.columns.any(axis=0)
    used = shown if shapes is not None else shown & ~shape
    slots = np.flatnonzero(used)
    plausible = np.array([h.slots[k].unknown.scale for k in slots])
    # a shape may be wrong by about half of what it is
    plausible = np.where(shape[slots], 0.5 * np.abs(begin[slots]), plausible)
    columns = signature.columns[:, slots] * plausible
    kinds = [_kind(robot, h, k) for k in slots.tolist()]
    norm = _norms(columns, kinds)
    norm = np.where(shape[slots], 1.0, norm)
    # what is added at the start: nothing, but for effects that no unknown scales
    held = np.zeros(len(begin)) if shapes is None else begin
    held = np.where(shape, held, begin)
    offset = signature.offset + signature.columns @ held
    scale = plausible / norm
    low, high = h.bounds
    free = norm[~shape[slots]]
    return Element(
        name=h.effect,
        columns=columns / norm,
        scale=scale,
        offset=offset if np.abs(offset).max(initial=0.0) > _NO_OFFSET else None,
        lower=(low - begin)[slots] / scale,
        upper=(high - begin)[slots] / scale,
        given=np.where(shape[slots], 1.0, np.nan),
        most=float(free.max(initial=0.0)) * _PLAUSIBLE,
        log_prior=log_prior,
        what=h,
        slots=slots,
        begin=begin,
    )


def _kind(robot: Robot, h: Hypothesis, slot: int) -> tuple[object, ...]:
    """Unknowns of one kind share a unit."""
    name, unknown = h.slots[slot].names[0], h.slots[slot].unknown
    last = name.rpartition(".")[2]
    joints = [f.joint for f in robot.frames if name.startswith(f"{f.name}.")]
    return unknown.scale, last[0] if last in AXES else "", *joints


def _norms(columns: NDArray, kinds: Iterable[object]) -> NDArray:
    """(m,) root mean square of the norms of all columns of a column's kind."""
    names = list(kinds)
    squares = (columns**2).sum(axis=0)
    own = [[k for k, other in enumerate(names) if other == kind] for kind in names]
    return np.array([np.sqrt(max(squares[o].mean(), 1e-300)) for o in own])


def function_element(
    candidate: Candidate, columns: NDArray, axes: NDArray, falling: NDArray,
    most: float, log_prior: float,
) -> Element | None:  # fmt: skip
    """A function.

    Args:
        candidate: of m unknowns.
        columns: (N, m) whitened change of the readings per unknown.
        axes: (m,) component that each acts in.
        falling: (m,) prior size of each beside the others'.
        most: [rad or m] displacement that is plausible, for an unknown of one.
        log_prior: of it.

    Returns:
        The element; None where the readings see nothing of it.
    """
    scaled = columns * falling
    norm = _norms(scaled, axes // 3)
    if not np.isfinite(norm).all() or norm.max() < 1e-100:
        return None
    m = len(norm)
    return Element(
        "", scaled / norm, falling / norm, None, np.full(m, -np.inf),
        np.full(m, np.inf), np.full(m, np.nan), float(norm.max() * most), log_prior,
        candidate, np.arange(m), np.zeros(m),
    )  # fmt: skip


class Dense:
    """Elements whose columns stand side by side, to be scored at once."""

    def __init__(self, elements: list[Element], cells: NDArray, root: NDArray) -> None:
        """Sort by number of columns.

        Args:
            elements: any.
            cells: which of their rows count.
            root: (n,) of the weights of these.
        """
        self.elements = elements
        self._offsets: list[tuple[int, NDArray]] = []
        self._groups: list[tuple[NDArray, NDArray, NDArray, NDArray, NDArray]] = []
        by_count: dict[int, list[int]] = {}
        for i, e in enumerate(elements):
            if e.columns.shape[1]:
                by_count.setdefault(e.columns.shape[1], []).append(i)
            elif e.offset is not None:
                self._offsets.append((i, e.offset[cells] * root))
        for m, own in by_count.items():
            B = np.concatenate([elements[i].columns[cells] for i in own], axis=1)
            B *= root[:, None]
            each = B.reshape(len(root), len(own), m)
            gram = np.einsum("nck,ncl->ckl", each, each, optimize=True)
            most = np.array([elements[i].most for i in own])
            bounded = np.array([m == 1 and elements[i].bounded[0] for i in own])
            self._groups.append((np.array(own), B, gram, most, bounded))

    def gains(self, taken: Taken, freedom: float) -> NDArray:
        """(len(elements),) log evidence ratio of each beside what was taken out."""
        gains = np.full(len(self.elements), -np.inf)
        for own, B, gram, most, bounded in self._groups:
            m = gram.shape[1]
            shown = (taken.across.T @ B).reshape(-1, len(own), m).transpose(1, 0, 2)
            left = gram - shown.transpose(0, 2, 1) @ shown
            along = (taken.held @ B).reshape(len(own), m)
            gains[own] = averaged_gains(left, along, most, bounded, taken, freedom)
        n = len(taken.held)
        for i, o in self._offsets:
            across = taken.across.T @ o
            Q = taken.squares - 2 * float(taken.held @ o) + float(o @ o)
            Q -= float(across @ across)
            change = likeness(taken.squares, n, freedom) - likeness(Q, n, freedom)
            gains[i] = 0.5 * float(change)
        return gains


def effect_prior(effects: int, ways: int) -> float:
    """Ln of the prior of a way in which one of so many effects may act."""
    return -math.log(2.0) - math.log(max(effects, 1)) - math.log(max(ways, 1))


def label(one: Candidate) -> str:
    """A function in words."""
    where = " and ".join(f"{p.where} {', '.join(p.components)}" for p in one.parts)
    of = ", ".join(one.parts[0].variables)
    given = "".join(f" {k} {v:.3g}" for k, v in one.shape.given)
    kind = "" if one.kind == "screw" else "compliance of "
    return (
        f"{kind}{where}: {one.shape.form} ({', '.join(one.shape.names)}{given}) of {of}"
    )
