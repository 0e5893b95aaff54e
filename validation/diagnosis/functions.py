"""Candidate functions, scored in batches: places times forms of variables.

A column of a function is the response of a row's readings to a component, times a
number of that row: B_(rc)q = a_rc P_rq.  Inner products therefore factor:

======  ===============  ===========  ================================================
symbol  code             shape        meaning
======  ===============  ===========  ================================================
a       ``answers``      (S, R, 6)    whitened change per unit of a component at a place
W       ``squares``      (S, R)       sum of a^2 over the cells of a row
P       ``numbers``      (R, q)       columns of all forms of a variable
T       ``through``      (R, S, p)    sum over the cells of a row of a U
======  ===============  ===========  ================================================

    B'B = P' W P,    U'B = T' P,    B'C^-1 z = P' (sum of a C^-1 z).
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.conditions import Conditions
from validation.campaign.campaign import Campaign
from validation.diagnosis import function_forms as forms
from validation.diagnosis.candidates import (
    Candidate,
    CandidatePart,
    is_known,
    variables_of,
)
from validation.diagnosis.elements import Element, function_element
from validation.diagnosis.function_forms import CandidateShape
from validation.diagnosis.gaussian import Marginal, evidence_gains
from validation.diagnosis.places import Places, Weighted, Where
from validation.diagnosis.sensitivities import Sensitivities, in_cells

Variables = tuple[str, ...]
Request = tuple[Variables, tuple[CandidateShape, ...]]  # variables, and their forms
_WIDEST = 36  # most columns of a function of several components
_LISTED = 2000  # best functions that are sorted
_BATCH = 2_000_000  # numbers that a batch of functions may occupy at once


@dataclass(frozen=True)
class ScoredFunction:
    """A scored function.

    Attributes:
        score: log evidence ratio plus log prior.
        where: index of its place.
        variables: one or two.
        shape: form.
        log_prior: ln of the prior probability.
    """

    score: float
    where: int
    variables: Variables
    shape: CandidateShape
    log_prior: float


@dataclass(frozen=True, eq=False)
class _Scored:
    """Inner products of c functions of equally many columns, scaled to norm about 1.

    Attributes:
        whose: (c, 3) number of the request, of its form, and of the place.
        gram: (c, m, m) B'C^-1 B.
        along: (c, m) B'C^-1 z.
        most: (c,) largest plausible prior standard deviation.
        prior: (c,) log prior.
    """

    whose: NDArray
    gram: NDArray
    along: NDArray
    most: NDArray
    prior: NDArray


def _likeliest(
    parts: Mapping[int, Sequence[_Scored]], marginal: Marginal
) -> list[tuple[float, int, int, int]]:
    """Return score, request, form and place of the functions, best first."""
    scores, whose = [np.zeros(0)], [np.zeros((0, 3), dtype=int)]
    for own in parts.values():
        gains = evidence_gains(
            np.concatenate([p.gram for p in own]),
            np.concatenate([p.along for p in own]),
            np.concatenate([p.most for p in own]), False, marginal,
        )  # fmt: skip
        scores.append(gains + np.concatenate([p.prior for p in own]))
        whose += [p.whose for p in own]
    score, names = np.concatenate(scores), np.concatenate(whose)
    order = [i for i in np.argsort(-score).tolist()[:_LISTED] if np.isfinite(score[i])]
    return [(float(score[i]), *names[i].tolist()) for i in order]


def _by_kind(turns: NDArray, gram: NDArray) -> NDArray:
    """Return (f, c, m) rms norms of columns, of rotations and of translations."""
    diagonal = np.einsum("...kk->...k", gram)
    squares = np.zeros_like(diagonal)
    for kind in (turns, ~turns):
        mean = (diagonal * kind).sum(axis=-1) / np.maximum(kind.sum(axis=-1), 1)
        squares += kind * mean[..., None]
    return np.sqrt(squares)


class Functions:
    """Candidate functions of a campaign."""

    def __init__(
        self, campaign: Campaign, sensitivities: Sensitivities, some: bool = True
    ) -> None:
        """List places and variables.

        Args:
            campaign: design; no measured value is used.
            sensitivities: of its rows.
            some: whether any function may act.
        """
        self.campaign, self.sensitivities = campaign, sensitivities
        self.conditions = sensitivities.conditions
        self.variables = variables_of(self.conditions) if some else []
        self.places = Places(campaign, sensitivities)
        self._keep()

    def _keep(self) -> None:
        """Make each answer once."""
        self.shapes_of = cache(self._shapes_of)
        self.prior = cache(self._prior)
        self._numbers = cache(self._columns)

    def of(self, variables: list[str]) -> "Functions":
        """The same of some of the variables."""
        other = copy(self)
        other.variables = variables
        other._keep()
        return other

    def at_rows(self, rows: NDArray) -> "Functions":
        """The same whose elements have columns of some rows only."""
        other = copy(self)
        other.campaign = self.campaign.take(rows)
        other.sensitivities = self.sensitivities.take(rows)
        return other

    def known(self, *names: str) -> Conditions:
        """Return the rows in which variables are known."""
        rows = is_known(self.conditions, *names)
        return self.conditions if rows.all() else self.conditions.take(rows)

    def _shapes_of(self, variables: Variables) -> dict[CandidateShape, float]:
        """Return all forms of one or two variables with their log priors."""
        known = self.known(*variables)
        if len(variables) == 1:
            shapes = forms.every(known, variables[0])
        else:
            both = forms.of_two(known, *variables)
            shapes = [] if both is None else both[1]
        count, places = len(self.variables), len(self.places)
        prior = -math.log(2.0) - math.log(max(count, 1)) - math.log(max(places, 1))
        if len(variables) > 1:
            prior -= math.log(2.0 * max(count - 1, 1))
        logs = forms.log_priors(shapes)
        if variables[0].removeprefix("cov.") in self.campaign.motion_units:
            # a measured motion most likely moves something in proportion
            straight = np.array([shape == forms.STRAIGHT for shape in shapes])
            logs = np.log((np.exp(logs) + straight) / 2)
        return {s: prior + float(p) for s, p in zip(shapes, logs, strict=True)}

    def _prior(self, variables: Variables, shape: CandidateShape) -> float:
        """Return the log prior of a form at one place."""
        known = self.shapes_of(variables)
        if shape in known:
            return known[shape]
        alike = {
            float(np.abs(np.log(s.bends / shape.bends)).sum()): prior
            for s, prior in known.items()
            if (s.form, s.names) == (shape.form, shape.names) and len(shape.bends)
        }
        return alike[min(alike)] if alike else min(known.values(), default=-math.inf)

    def first_look(self) -> list[Request]:
        """Return requests for general forms of every variable."""
        requests: list[Request] = []
        for name in self.variables:
            shapes = forms.first(self.known(name), name)
            shapes += forms.screw(self.known(name), name)
            requests.append(((name,), tuple(shapes)))
        return requests

    def products(self, names: Iterable[str]) -> list[Request]:
        """Return requests for products of given variables with all others."""
        requests: dict[Variables, tuple[CandidateShape, ...]] = {}
        for name in names:
            for other in self.variables:
                both, known = None, self.known(name, other)
                if other != name and len(known):
                    both = forms.of_two(known, name, other)
                if both is not None and both[0] not in requests:
                    requests[both[0]] = tuple(both[1])
            turned = forms.of_direction(self.conditions, name)
            if turned:
                requests[(name,)] = tuple(turned)
        return list(requests.items())

    def look(
        self, marginal: Marginal, weighted: Weighted,
        requests: Sequence[Request], most: int,
    ) -> list[ScoredFunction]:  # fmt: skip
        """Return the functions that improve a model most.

        Args:
            marginal: model, in the cells of ``weighted``.
            weighted: responses at all places.
            requests: variables with their forms.
            most: number of functions for each request.

        Returns:
            Scored functions, best first.
        """
        if not len(self.places):
            return []
        row, component = weighted.cells
        count = marginal.factor_columns.shape[1]
        U = np.zeros((len(weighted.rows), 6, count))
        U[row, component] = marginal.factor_columns
        held = np.zeros((len(weighted.rows), 6))
        held[row, component] = marginal.held
        through = weighted.answers.transpose(1, 0, 2) @ U
        on = np.einsum("src,rc->sr", weighted.answers, held)
        parts: dict[int, list[_Scored]] = {}
        for own in self._by_width(requests, through[0].size):
            for one in self._scored(own, requests, weighted, through, on):
                parts.setdefault(one.along.shape[1], []).append(one)
        best: list[ScoredFunction] = []
        each: dict[int, int] = {}
        for score, number, k, where in _likeliest(parts, marginal):
            each[number] = each.get(number, 0) + 1
            if each[number] <= most:
                variables, shapes = requests[number]
                prior = self.prior(variables, shapes[k])
                best.append(ScoredFunction(score, where, variables, shapes[k], prior))
        return best

    def _by_width(
        self, requests: Sequence[Request], size: int
    ) -> Iterator[list[tuple[int, int]]]:
        """Yield request and form of functions with equally many columns, in batches.

        Args:
            requests: variables with their forms.
            size: numbers that one column of one function occupies.
        """
        by_width: dict[int, list[tuple[int, int]]] = {}
        for number, (variables, shapes) in enumerate(requests):
            for k, shape in enumerate(shapes):
                m = self._numbers(variables, shape).shape[1]
                by_width.setdefault(m, []).append((number, k))
        for m, own in by_width.items():
            count = max(1, _BATCH // max(1, size * m))
            yield from (own[i : i + count] for i in range(0, len(own), count))

    def _scored(
        self, own: list[tuple[int, int]], requests: Sequence[Request],
        weighted: Weighted, through: NDArray, on: NDArray,
    ) -> Iterator[_Scored]:  # fmt: skip
        """Compute inner products of f forms of m columns at all places."""
        named = [(requests[number][0], requests[number][1][k]) for number, k in own]
        each = [self._numbers(*name)[weighted.rows] for name in named]
        f, m, S = len(own), each[0].shape[1], len(weighted.answers)
        P = np.hstack(each)
        shown = (through.reshape(len(P), -1).T @ P).reshape(S, -1, f, m)
        shown = shown.transpose(2, 0, 3, 1)
        along = (on @ P).reshape(S, f, m).transpose(1, 0, 2)
        made = [
            weighted.products(name, columns)
            for name, columns in zip(named, each, strict=True)
        ]
        whole, cross = (np.array(part) for part in zip(*made, strict=True))
        priors = np.array([self.prior(*name) for name in named])
        for where, mem, turns in self.places.sizes:
            c, size = mem.shape
            if size > 1 and size * m > _WIDEST:
                continue
            B = whole[:, mem[:, 0]]
            if size > 1:
                B = self.places.joined(mem, whole, cross)
            y = shown[:, mem].reshape(f, c, size * m, -1)
            norm = _by_kind(np.repeat(turns, m, axis=1), B)
            scale = np.where(norm > 0, 1 / np.maximum(norm, 1e-300), 0.0)
            left = B - y @ y.transpose(0, 1, 3, 2)
            left *= scale[..., None] * scale[..., None, :]
            b = along[:, mem].reshape(f, c, size * m) * scale
            most = self.places.most[where] * norm.max(axis=2)
            names = np.repeat(own, c, axis=0)
            whose = np.column_stack([names, np.tile(where, f)])
            yield _Scored(
                whose, left.reshape(f * c, size * m, size * m), b.reshape(f * c, -1),
                most.ravel(), np.repeat(priors, c),
            )  # fmt: skip

    def _columns(self, variables: Variables, shape: CandidateShape) -> NDArray:
        """Return (R, q) columns of a form, scaled by their relative prior."""
        columns = self.sensitivities.basis(variables, shape)[0]
        return columns * forms.falling(shape, columns.shape[1])

    def candidate(self, found: ScoredFunction) -> Candidate:
        """Return the candidate of a scored function."""
        return self._at(self.places.names[found.where], found.variables, found.shape)

    @staticmethod
    def _at(
        place: tuple[Where, ...], variables: Variables, shape: CandidateShape
    ) -> Candidate:
        part = CandidatePart(place[0][0], tuple(w[1] for w in place), *variables)
        return Candidate((part,), place[0][2], shape)

    def equivalents(self, one: Candidate) -> list[tuple[CandidatePart, ...]]:
        """Return the parts of candidates at other places with equal columns."""
        if len(one.parts) > 1:
            return []
        part = one.parts[0]
        own = tuple((part.where, c, one.kind) for c in part.components)
        names = self.places.names
        same = self.places.equal[names.index(own)] if own in names else []
        return [self._at(p, part.variables, one.shape).parts for p in same]

    def element(self, one: Candidate, log_prior: float) -> Element | None:
        """Return the element of a candidate; None if it is not visible."""
        columns = in_cells(self.sensitivities, one, self.campaign)
        axes = self.sensitivities.axes(one)
        each = columns.shape[1] // sum(len(p.components) for p in one.parts)
        fall = np.tile(forms.falling(one.shape, each), columns.shape[1] // each)
        wheres = [(p.where, c, one.kind) for p in one.parts for c in p.components]
        most = min(self.places.plausible(w) for w in wheres)
        return function_element(one, columns, axes, fall, most, log_prior)
