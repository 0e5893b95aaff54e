"""Score candidate functions for all combinations of locations and functional forms.

The design matrix of a function has the elements B_(rc)q = a_rc P_rq. Here a_rc is the
response of reading c in row r to a screw component, and P_rq is basis function q of the
functional form in row r. Inner products are therefore computed from products over rows,
with the columns U of :mod:`.gaussian`:

======  ===============  ===========  ================================================
symbol  code             shape        meaning
======  ===============  ===========  ================================================
a       ``answers``      (S, R, 6)    whitened response to a unit screw component
W       ``squares``      (S, R)       sum of a^2 over the readings of a row
P       ``numbers``      (R, q)       basis functions of all forms of a variable
T       ``through``      (R, S, p)    sum of a U over the readings of a row
======  ===============  ===========  ================================================

    B'B = P' W P,    U'B = T' P,    B'C^-1 z = P' (sum of a C^-1 z).
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.measurement.conditions import Conditions
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis import function_forms as forms
from forcefit.validation.diagnosis.candidates import (
    Candidate,
    CandidatePart,
    is_known,
)
from forcefit.validation.diagnosis.elements import Element, function_element
from forcefit.validation.diagnosis.function_forms import CandidateShape
from forcefit.validation.diagnosis.gaussian import Marginal, evidence_gains
from forcefit.validation.diagnosis.places import Places, Weighted, Where
from forcefit.validation.diagnosis.sensitivities import Sensitivities, in_cells

Variables = tuple[str, ...]
# A request contains the variables of a function and the functional forms to score.
Request = tuple[Variables, tuple[CandidateShape, ...]]
# Largest number of columns of a function with six components.
_WIDEST = 36
# Number of functions of highest score that are retained.
_LISTED = 2000
_BATCH = 2_000_000  # number of values computed together, to limit memory


@dataclass(frozen=True)
class ScoredFunction:
    """A candidate function with its score and prior probability."""

    score: float
    candidate: Candidate
    log_prior: float


def _by_kind(turns: NDArray, gram: NDArray) -> NDArray:
    """Return rms norms (f, c, m), separately for rotations and translations."""
    diagonal = np.einsum("...kk->...k", gram)
    squares = np.zeros_like(diagonal)
    for kind in (turns, ~turns):
        mean = (diagonal * kind).sum(axis=-1) / np.maximum(kind.sum(axis=-1), 1)
        squares += kind * mean[..., None]
    return np.sqrt(squares)


class Functions:
    """Candidate functions of a campaign, each at a single location."""

    def __init__(
        self, campaign: Campaign, sensitivities: Sensitivities, variables: list[str]
    ) -> None:
        """List the locations at which functions can act."""
        self.campaign, self.sensitivities = campaign, sensitivities
        self.conditions = sensitivities.conditions
        self.places = Places(campaign, sensitivities)
        self._depend_on(variables)

    def _depend_on(self, variables: list[str]) -> None:
        """Set the variables of the functions."""
        self.variables = variables
        self.shapes_of = cache(self._shapes_of)
        self.prior = cache(self._prior)
        self._numbers = cache(self._columns)

    def of(self, variables: list[str]) -> "Functions":
        """Return the functions that depend on the given variables."""
        other = copy(self)
        other._depend_on(variables)
        return other

    def at_rows(self, rows: NDArray) -> "Functions":
        """Restrict the design matrices of the candidate functions to selected rows."""
        other = copy(self)
        other.campaign = self.campaign.take(rows)
        other.sensitivities = self.sensitivities.take(rows)
        return other

    def known(self, *names: str) -> Conditions:
        """Return the conditions of rows in which all variables are known."""
        rows = is_known(self.conditions, *names)
        return self.conditions if rows.all() else self.conditions.take(rows)

    def _shapes_of(self, variables: Variables) -> dict[CandidateShape, float]:
        """Return all functional forms of given variables with their log priors."""
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
            # A measured motion probably causes a proportional motion of the platform.
            straight = np.array([shape == forms.STRAIGHT for shape in shapes])
            logs = np.log((np.exp(logs) + straight) / 2)
        return {s: prior + float(p) for s, p in zip(shapes, logs, strict=True)}

    def _prior(self, variables: Variables, shape: CandidateShape) -> float:
        """Return the log prior probability of a functional form at one location."""
        known = self.shapes_of(variables)
        return known.get(shape, min(known.values(), default=-math.inf))

    def first_look(self) -> list[Request]:
        """Return the functional forms to score first for each variable."""
        requests: list[Request] = []
        for name in self.variables:
            shapes = forms.first(self.known(name), name)
            shapes += forms.screw(self.known(name), name)
            requests.append(((name,), tuple(shapes)))
        return requests

    def products(self, names: Iterable[str]) -> list[Request]:
        """Return the functional forms of two variables to score.

        One of the two variables is among ``names``.
        """
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
        """Return the functions that most increase the evidence of a model, best first.

        Args:
            marginal: model, which was fitted to the same readings as ``weighted``.
            weighted: weighted responses.
            requests: variables and functional forms to score.
            most: largest number of functions to return for each request.
        """
        if not len(self.places):
            return []
        row, component = weighted.cells
        U = np.zeros((len(weighted.rows), 6, marginal.factor_columns.shape[1]))
        U[row, component] = marginal.factor_columns
        held = np.zeros((len(weighted.rows), 6))
        held[row, component] = marginal.held
        through = weighted.answers.transpose(1, 0, 2) @ U
        on = np.einsum("src,rc->sr", weighted.answers, held)
        scores, whose = [np.zeros(0)], [np.zeros((0, 3), dtype=int)]
        for own in self._by_width(requests, through[0].size):
            made = self._products(own, requests, weighted, through, on)
            for names, gram, along, largest, priors in made:
                gains = evidence_gains(gram, along, largest, False, marginal)
                scores.append(gains + priors)
                whose.append(names)
        score, names = np.concatenate(scores), np.concatenate(whose)
        best: list[ScoredFunction] = []
        each: Counter[int] = Counter()
        for i in np.argsort(-score)[:_LISTED].tolist():
            number, k, where = names[i].tolist()
            if np.isfinite(score[i]) and each[number] < most:
                each[number] += 1
                variables, shapes = requests[number]
                candidate = _at(self.places.names[where], variables, shapes[k])
                prior = self.prior(variables, shapes[k])
                best.append(ScoredFunction(float(score[i]), candidate, prior))
        return best

    def _by_width(
        self, requests: Sequence[Request], size: int
    ) -> Iterator[list[tuple[int, int]]]:
        """Yield batches of functions that have equal numbers of columns.

        Each function is given by the index of its request and the index of its
        functional form. A column occupies ``size`` values in memory.
        """
        by_width: dict[int, list[tuple[int, int]]] = {}
        for number, (variables, shapes) in enumerate(requests):
            for k, shape in enumerate(shapes):
                m = self._numbers(variables, shape).shape[1]
                by_width.setdefault(m, []).append((number, k))
        for m, own in by_width.items():
            count = max(1, _BATCH // max(1, size * m))
            yield from (own[i : i + count] for i in range(0, len(own), count))

    def _products(
        self, own: list[tuple[int, int]], requests: Sequence[Request],
        weighted: Weighted, through: NDArray, on: NDArray,
    ) -> Iterator[tuple[NDArray, NDArray, NDArray, NDArray, NDArray]]:  # fmt: skip
        """Compute inner products of the columns of f functional forms at all locations.

        Yields:
            Arrays for c functions with m columns each: (c, 3) indices of request,
            functional form and location; (c, m, m) B'C^-1 B; (c, m) B'C^-1 z; (c,)
            largest plausible prior standard deviation; (c,) log prior.  Columns B are
            scaled to a norm of about 1.
        """
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
            yield (
                np.column_stack([np.repeat(own, c, axis=0), np.tile(where, f)]),
                left.reshape(f * c, size * m, size * m), b.reshape(f * c, -1),
                most.ravel(), np.repeat(priors, c),
            )  # fmt: skip

    def _columns(self, variables: Variables, shape: CandidateShape) -> NDArray:
        """Return the basis functions times their relative prior deviations, (R, q)."""
        columns = self.sensitivities.basis(variables, shape)[0]
        return columns * forms.falling(shape, columns.shape[1])

    def equivalents(self, one: Candidate) -> list[tuple[CandidatePart, ...]]:
        """Return other locations at which a function changes the readings equally."""
        if len(one.parts) > 1:
            return []
        part = one.parts[0]
        own = tuple((part.where, c, one.kind) for c in part.components)
        names = self.places.names
        same = self.places.equal[names.index(own)] if own in names else []
        return [_at(p, part.variables, one.shape).parts for p in same]

    def element(self, one: Candidate, log_prior: float) -> Element | None:
        """Return the linear model of a candidate, or None if it affects no reading."""
        columns = in_cells(self.sensitivities, one, self.campaign)
        axes = self.sensitivities.axes(one)
        each = columns.shape[1] // sum(len(p.components) for p in one.parts)
        fall = np.tile(forms.falling(one.shape, each), columns.shape[1] // each)
        wheres = [(p.where, c, one.kind) for p in one.parts for c in p.components]
        most = min(self.places.plausible(w) for w in wheres)
        return function_element(one, columns, axes, fall, most, log_prior)


def _at(
    place: tuple[Where, ...], variables: Variables, shape: CandidateShape
) -> Candidate:
    """Return a candidate function of given variables at a location."""
    part = CandidatePart(place[0][0], tuple(w[1] for w in place), *variables)
    return Candidate((part,), place[0][2], shape)
