"""Describe library effects and functions by linear models.

A library effect or function adds ``offset + columns d`` to the whitened readings, with
a design matrix ``columns`` and scaled unknowns d. Unknowns with the same unit have the
same prior standard deviation. They are scaled so that their columns have an rms norm of
one.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.functions import AXES
from forcefit.assembly.model.robot import Robot
from forcefit.validation.diagnosis.candidates import Candidate
from forcefit.validation.diagnosis.gaussian import Marginal, deviance, evidence_gains
from forcefit.validation.diagnosis.hypotheses import Hypothesis
from forcefit.validation.diagnosis.signatures import Signature
from forcefit.validation.diagnosis.whitening import Whitening

_PLAUSIBLE = 1e3  # largest prior standard deviation, relative to a plausible value
_NO_OFFSET = 1e-9  # [sigma] offset that is treated as zero


@dataclass(frozen=True, eq=False)
class Element:
    """Linear model of a library effect at certain frames, or of a function.

    Attributes:
        name: name of the effect, ``""`` for a function.
        columns: (N, m) design matrix, which is the whitened change of the readings per
            scaled unknown.
        scale: (m,) factor from a scaled unknown to its value.
        offset: (N,) whitened contribution at d = 0. None if it is zero.
        lower, upper: (m,) bounds of the scaled unknowns.
        given: (m,) fixed prior standard deviation, NaN if it is optimised.
        most: largest plausible prior standard deviation.
        log_prior: logarithm of the prior probability.
        what: the hypothesis if this is a library effect, otherwise the candidate
            function.
        slots: (m,) index of each unknown in the parameters of ``what``.
        begin: parameters of ``what`` at d = 0.
        first: the linear model at the start values of the parameters. None if this is
            the model at the start values.
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
        """The linear model at the start values of the parameters."""
        return self.first or self

    @property
    def hypothesis(self) -> Hypothesis:
        """Hypothesis of a library effect."""
        assert isinstance(self.what, Hypothesis)
        return self.what

    @property
    def candidate(self) -> Candidate:
        """Candidate of a function."""
        assert isinstance(self.what, Candidate)
        return self.what

    @property
    def bounded(self) -> NDArray:
        """Mask (m,), True for an unknown that starts at its lower bound."""
        return np.abs(self.lower) < 1e-12

    def values(self, d: NDArray) -> NDArray:
        """Return the parameters for scaled unknowns d, limited to their bounds."""
        x = self.begin.copy()
        x[self.slots] += np.clip(d, self.lower, self.upper) * self.scale
        return x


def effect_element(
    signature: Signature, robot: Robot, log_prior: float, shapes: NDArray | None = None
) -> Element:
    """Return the linear model of a library effect.

    Args:
        signature: derivatives of the effect.
        robot: robot on which the effect acts.
        log_prior: logarithm of the prior probability.
        shapes: (k,) values of the nonlinear parameters at which the effect is
            linearised. None for their start values.

    Returns:
        The linear model, without unknowns that do not affect the readings.
    """
    h = signature.hypothesis
    shape = np.array([slot.shape for slot in h.slots], dtype=bool)
    begin = h.start if shapes is None else np.where(shape, shapes, h.start)
    shown = signature.columns.any(axis=0)
    used = shown if shapes is not None else shown & ~shape
    slots = np.flatnonzero(used)
    plausible = np.array([h.slots[k].unknown.scale for k in slots])
    # The prior standard deviation of a nonlinear parameter is half its start value.
    plausible = np.where(shape[slots], 0.5 * np.abs(begin[slots]), plausible)
    columns = signature.columns[:, slots] * plausible
    kinds = [_kind(robot, h, k) for k in slots.tolist()]
    norm = _norms(columns, kinds)
    norm = np.where(shape[slots], 1.0, norm)
    # Nonlinear parameters are fixed if the effect is linearised at its start values.
    held = np.where(shape & (shapes is None), 0.0, begin)
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
    """Return a key that is equal for unknowns with the same unit."""
    name, unknown = h.slots[slot].names[0], h.slots[slot].unknown
    last = name.rpartition(".")[2]
    joints = [f.joint for f in robot.frames if name.startswith(f"{f.name}.")]
    return unknown.scale, last[0] if last in AXES else "", *joints


def _norms(columns: NDArray, kinds: Iterable[object]) -> NDArray:
    """Return for each of m columns the rms norm of all columns of the same kind."""
    names = list(kinds)
    squares = (columns**2).sum(axis=0)
    own = [[k for k, other in enumerate(names) if other == kind] for kind in names]
    return np.array([np.sqrt(max(squares[o].mean(), 1e-300)) for o in own])


def function_element(
    candidate: Candidate, columns: NDArray, axes: NDArray, falling: NDArray,
    most: float, log_prior: float,
) -> Element | None:  # fmt: skip
    """Return the linear model of a function, or None if no reading depends on it.

    Args:
        candidate: the function.
        columns: (N, m) whitened change of the readings per unknown.
        axes: (m,) screw component of each unknown.
        falling: (m,) relative prior standard deviations.
        most: largest plausible value of an unknown.
        log_prior: logarithm of the prior probability.
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
    """Linear models with stored design matrices, which are scored in batches."""

    def __init__(
        self, elements: list[Element], cells: NDArray, whiten: Whitening
    ) -> None:
        """Store linear models for selected readings, grouped by number of columns.

        Args:
            elements: the linear models of effects and functions.
            cells: (N,) mask of the selected readings.
            whiten: whitening transformation of these readings.
        """
        self.elements = elements
        self._offsets: list[tuple[int, NDArray]] = []
        self._groups: list[tuple[NDArray, NDArray, NDArray, NDArray, NDArray]] = []
        by_count: dict[int, list[int]] = {}
        for i, e in enumerate(elements):
            if e.columns.shape[1]:
                by_count.setdefault(e.columns.shape[1], []).append(i)
            elif e.offset is not None:
                self._offsets.append((i, whiten(e.offset[cells])))
        for m, own in by_count.items():
            B = np.concatenate([elements[i].columns[cells] for i in own], axis=1)
            B = whiten(B)
            each = B.reshape(len(B), len(own), m)
            gram = np.einsum("nck,ncl->ckl", each, each, optimize=True)
            most = np.array([elements[i].most for i in own])
            bounded = np.array([m == 1 and elements[i].bounded[0] for i in own])
            self._groups.append((np.array(own), B, gram, most, bounded))

    def gains(self, marginal: Marginal) -> NDArray:
        """Return the log evidence ratios for adding each linear model."""
        gains = np.full(len(self.elements), -np.inf)
        for own, B, gram, most, bounded in self._groups:
            m = gram.shape[1]
            shown = (
                (marginal.factor_columns.T @ B)
                .reshape(-1, len(own), m)
                .transpose(1, 0, 2)
            )
            left = gram - shown.transpose(0, 2, 1) @ shown
            along = (marginal.held @ B).reshape(len(own), m)
            gains[own] = evidence_gains(left, along, most, bounded, marginal)
        n = len(marginal.held)
        for i, o in self._offsets:
            factor_columns = marginal.factor_columns.T @ o
            Q = marginal.squares - 2 * float(marginal.held @ o) + float(o @ o)
            Q -= float(factor_columns @ factor_columns)
            change = deviance(marginal.squares, n) - deviance(Q, n)
            gains[i] = 0.5 * float(change)
        return gains


def label(one: Candidate) -> str:
    """Return a description of a function."""
    where = " and ".join(f"{p.where} {', '.join(p.components)}" for p in one.parts)
    of = ", ".join(one.parts[0].variables)
    given = "".join(f" {k} {v:.3g}" for k, v in one.shape.given)
    kind = "" if one.kind == "screw" else "compliance of "
    return (
        f"{kind}{where}: {one.shape.form} ({', '.join(one.shape.names)}{given}) of {of}"
    )
