"""Score candidate effects and functions for given prior standard deviations."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.diagnosis import function_forms as forms
from forcefit.validation.diagnosis.candidates import Candidate
from forcefit.validation.diagnosis.elements import Dense, Element
from forcefit.validation.diagnosis.functions import Request, ScoredFunction
from forcefit.validation.diagnosis.places import Weighted
from forcefit.validation.diagnosis.states import MORE, State
from forcefit.validation.diagnosis.weighted_readings import WeightedReadings
from forcefit.validation.diagnosis.whitening import Whitening

BEAM = 6  # number of candidate effects and functions that are added to a model
OF_NAME = 2  # largest number of tried candidates with the same name
_VARIABLES = 4  # number of variables that are combined with other variables
# Largest number of columns of a function at several locations, to limit memory.
_WIDEST = 600
# Number of times the step of a nonlinear parameter is halved in its optimisation.
_HALVINGS = 6


class Scores:
    """Scores of all candidates for models of given readings."""

    def __init__(self, readings: WeightedReadings) -> None:
        """Store the readings.  Scores are computed when they are first used."""
        self.readings, self.columns = readings, readings.columns
        self.functions = readings.columns.functions
        self._made: dict[object, Element | None] = {}

    @cached_property
    def _whiten_sample(self) -> tuple[NDArray, Whitening]:
        """Mask (N,) of the sampled readings, and their whitening transformation."""
        cells, some = self.readings.cells.copy(), self.readings.sampled
        cells[cells] = some
        root, common = self.readings.root[some], self.readings.common
        return cells, self.columns.whitening(cells, root, common)

    @cached_property
    def weighted(self) -> Weighted:
        """Weighted changes of the sampled readings for all locations."""
        return self.functions.places.weighted(*self._whiten_sample)

    @cached_property
    def _library(self) -> Dense:
        """Library effects, prepared for scoring."""
        return self._dense(self.columns.library)

    @cached_property
    def _explicit(self) -> Dense:
        """Functions that act at several locations, prepared for scoring."""
        own = self.readings.cells[self.columns.sampled]
        return Dense(self.columns.explicit, own, self._whiten_sample[1])

    def _dense(self, elements: list[Element]) -> Dense:
        """Prepare linear models of effects or functions for scoring."""
        return Dense(elements, self.readings.cells, self.readings.whiten)

    def _gain(self, e: Element, base: State) -> float:
        """Return the log evidence ratio of adding an effect or function to a model."""
        return float(self._dense([e]).gains(base.marginal)[0])

    def best_to_add(
        self, state: State, *, functions: bool, products: bool = False
    ) -> list[tuple[float, Element]]:
        """Return the best additions to a model, with estimated log posteriors."""
        listed = [*self._library.elements, *self._explicit.elements]
        some = self._explicit.gains(state.sample_marginal)
        gains = [self._library.gains(state.marginal), self._more * some]
        score = np.concatenate(gains) + np.array([e.log_prior for e in listed])
        counts = Counter({e.name: OF_NAME for e in state.elements if e.name})
        best: list[tuple[float, Element]] = []
        for i in np.argsort(-score).tolist():
            e = listed[i]
            counts[e.name] += 1
            if np.isfinite(score[i]) and counts[e.name] <= OF_NAME:
                whole = e if e.name else self._element(e.candidate, e.log_prior)
                best += [(float(score[i]), whole)] if whole else []
            if len(best) >= BEAM:
                break
        found: list[ScoredFunction] = []
        if functions:
            found = self.look(state, self.functions.first_look())
        if products:
            found += self.look(state, self._products(found))
        found.sort(key=lambda one: -one.score)
        for one in found[:BEAM]:
            made = self._element(one.candidate, one.log_prior)
            if made is not None and made not in state.elements:
                best.append((one.score, made))
        best.sort(key=lambda one: -one[0])
        state.forget()
        begin = state.score - MORE
        return [(begin + w, e) for w, e in best[: BEAM + 2]]

    def _products(self, found: Sequence[ScoredFunction]) -> list[Request]:
        """Return functions of two variables to score next."""
        names = list(dict.fromkeys(f.candidate.parts[0].variable for f in found))
        names = names[:_VARIABLES]
        if "approach" in self.functions.variables:
            names.append("approach")
        return self.functions.products(dict.fromkeys(names))

    def look(
        self, state: State, requests: Sequence[Request], most: int = 3
    ) -> list[ScoredFunction]:
        """Return the best functions to add to a model."""
        found = self.functions.look(
            state.sample_marginal, self.weighted, requests, most
        )
        scaled = [
            replace(f, score=self._more * (f.score - f.log_prior) + f.log_prior)
            for f in found
        ]
        return sorted(scaled, key=lambda one: -one.score)

    @property
    def _more(self) -> float:
        """Number of readings divided by the number of sampled readings."""
        return len(self.readings.sampled) / max(int(self.readings.sampled.sum()), 1)

    def _element(self, one: Candidate, log_prior: float) -> Element | None:
        """Return the linear model of a function for all readings."""
        if one not in self._made:
            self._made[one] = self.functions.element(one, log_prior)
        return self._made[one]

    def forms_of(self, last: Element, base: State) -> list[Element | None]:
        """Return functions at the same location with other forms, best first."""
        one = last.candidate
        variables = one.parts[0].variables
        priors = self.functions.shapes_of(variables)
        if len(one.parts) == 1:
            found = self.look(base, [(variables, tuple(priors))], most=4)
            return [self._element(f.candidate, f.log_prior) for f in found]
        count = sum(len(part.components) for part in one.parts)
        tried = [
            Candidate(one.parts, one.kind, shape)
            for shape in priors
            if len(shape.names) * count <= _WIDEST and not forms.is_screw(shape)
        ]
        best: list[tuple[float, Element]] = []
        for candidate in tried:  # one at a time to limit memory
            e = self._made.get(candidate)
            e = e or self.functions.element(candidate, priors[candidate.shape])
            if e is not None:
                best.append((self._gain(e, base) + e.log_prior, e))
                best = sorted(best, key=lambda scored: -scored[0])[:4]
        base.forget()
        self._made |= {e.candidate: e for _, e in best}
        return [e for _, e in best]

    def sharper(self, e: Element, base: State) -> Element:
        """Optimise the nonlinear parameter of a function."""
        one = e.candidate
        if not len(one.shape.bends):
            return e
        best = self._gain(e, base)
        variables, conditions = one.parts[0].variables, self.functions.conditions
        for k in range(_HALVINGS):
            for shape in forms.near(conditions, variables, e.candidate.shape, 0.5**k):
                near = self.functions.element(replace(one, shape=shape), e.log_prior)
                if near is not None and (gain := self._gain(near, base)) > best:
                    best, e = gain, near
        return e
