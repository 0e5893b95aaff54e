"""Search over models: a beam search with exchange of elements.

Steps:

1. Score every effect of the library and every function, given each model of the beam.
2. Add the best ones, and optimise the prior standard deviations.
3. Try all forms of an added function; linearise effects again at their estimates.
4. Repeat until no added element increases the log posterior.
5. Exchange each element of the best model for any other until the model is stable.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from validation.diagnosis import function_forms as forms
from validation.diagnosis.candidates import Candidate
from validation.diagnosis.elements import Dense, Element
from validation.diagnosis.functions import Request, ScoredFunction
from validation.diagnosis.places import Weighted
from validation.diagnosis.relinearise import MOVED, Relinearisation
from validation.diagnosis.states import MORE, Models, State
from validation.diagnosis.weighted_readings import WeightedReadings
from validation.diagnosis.whitening import Whitening

Update = Callable[[str, int, int], None]
Tried = tuple[tuple[Element, ...], State]  # elements; model that gives start values
_MOST = 5  # elements of a model, the limit that the docs state
_BEAM = 6  # candidates per model of the beam: trials, as the widths below
_KEPT = 3  # width of the beam
_OF_NAME = 2  # models in the beam with the same names
_LOOKED = 2  # models of the beam for which functions are scored
_FORMS = 4  # models whose function is tried in all forms
_VARIABLES = 4  # variables whose products with others are scored
_WIDEST = 600  # most columns of a function at several places, for memory
_DROP = 1.0  # log posterior by which a larger model may be worse, if two need it
_NEAR = 15.0  # log posterior: error of an estimate at fixed standard deviations
_HALVINGS = 6  # of the step of a number in which a form is not linear; the fit ends it


class Search:
    """Models of one set of readings and weights, and the search over them."""

    def __init__(self, readings: WeightedReadings) -> None:
        """Fit the models without elements."""
        self.readings, self.columns = readings, readings.columns
        self.functions = readings.columns.functions
        self.models = Models(readings)
        self.empty = [self.models.state((), mode) for mode in self.models.modes()]
        self.begin = max(self.empty, key=lambda s: s.score)
        self.relinearisation = Relinearisation(self.columns.tangents, self.models)
        self.seen: dict[object, State] = {}
        self._made: dict[object, Element | None] = {}

    def run(self, update: Update) -> list[State]:
        """Run the search and return all visited models, best first."""
        self._keep(self.empty)
        front = [self.begin]
        for level in range(_MOST):
            update("elements", level, _MOST)
            new = self._grow(front, products=level == 0)
            best = self._best()
            if not new or new[0].score < best.score - _DROP:
                break
            front = new
        for _ in range(_MOST):  # each element may be exchanged
            before = self._best()
            self._exchange(before)
            best = self._best()
            if best.score < before.score + MOVED:
                break
            self._grow([best], products=False)
        return sorted(self.seen.values(), key=lambda s: -s.score)

    @cached_property
    def _whiten_sample(self) -> tuple[NDArray, Whitening]:
        """(N,) mask of the sampled cells, and their map to independent noise."""
        cells, some = self.readings.cells.copy(), self.readings.sampled
        cells[cells] = some
        root, common = self.readings.root[some], self.readings.common
        return cells, self.columns.whitening(cells, root, common)

    @cached_property
    def weighted(self) -> Weighted:
        """Responses at all places in the sampled cells."""
        return self.functions.places.weighted(*self._whiten_sample)

    @cached_property
    def _library(self) -> Dense:
        """Effects of the library."""
        return self._dense(self.columns.library)

    @cached_property
    def _explicit(self) -> Dense:
        """Functions at several places, in the sampled cells."""
        own = self.readings.cells[self.columns.sampled]
        return Dense(self.columns.explicit, own, self._whiten_sample[1])

    def _dense(self, elements: list[Element]) -> Dense:
        """Return elements to be scored in the fitted cells."""
        return Dense(elements, self.readings.cells, self.readings.whiten)

    def _gain(self, e: Element, base: State) -> float:
        """Return the log evidence ratio of adding an element to a model."""
        return float(self._dense([e]).gains(base.marginal)[0])

    def _keep(self, states: Iterable[State]) -> None:
        """Store models whose estimates support their claims."""
        for state in states:
            if state.supported:
                self.seen[frozenset(origins(state.elements)), state.mode] = state

    def _grow(self, sources: Sequence[State], *, products: bool) -> list[State]:
        """Return the best models with one element added, best first."""
        tried: dict[object, tuple[float, tuple[Element, ...], State]] = {}
        for state in self._without_nuisance(sources):
            looked, first = state in sources[:_LOOKED], state is sources[0]
            listed = self._candidates(
                state, functions=looked, products=products and first
            )
            for score, element in listed:
                elements = (*state.elements, element)
                key = frozenset(elements)
                if key not in tried or tried[key][0] < score:
                    tried[key] = score, elements, state
        ordered = sorted(tried.values(), key=lambda one: -one[0])
        most = _BEAM + 2 * len(sources)
        new = self._refined((e, state) for _, e, state in ordered[:most])
        for state in new[:_FORMS]:
            new += self._reformed(state)
        self._keep(new)
        kept: list[State] = []
        for state in sorted(new, key=lambda s: -s.score):
            alike = [s for s in kept if s.names == state.names]
            if len(alike) < _OF_NAME and len(kept) < _KEPT and state.supported:
                kept.append(state)
        for state in kept[:1]:
            self._keep(self._with_one_removed(state))
        return kept

    def _without_nuisance(self, states: Sequence[State]) -> list[State]:
        """Return the models, and each with fewer groups of nuisance parameters."""
        less = [
            self.models.state(s.elements, mode, s)
            for s in states
            for mode in self.models.modes()
            if mode != s.mode and mode[0] <= s.mode[0] and mode[1] <= s.mode[1]
        ]
        return [*states, *less]

    def _candidates(
        self, state: State, *, functions: bool = True, products: bool = False
    ) -> list[tuple[float, Element]]:
        """Return the best elements to add, with estimates of the log posterior."""
        listed = [*self._library.elements, *self._explicit.elements]
        some = self._explicit.gains(state.sample_marginal)
        gains = [self._library.gains(state.marginal), self._more * some]
        score = np.concatenate(gains) + np.array([e.log_prior for e in listed])
        have = {e.name for e in state.elements if e.name}
        counts: Counter[str] = Counter()
        best: list[tuple[float, Element]] = []
        for i in np.argsort(-score).tolist():
            e = listed[i]
            if not np.isfinite(score[i]) or (e.name and e.name in have):
                continue
            counts[e.name] += 1
            whole = e if e.name else self._element(e.candidate, e.log_prior)
            if counts[e.name] <= _OF_NAME and whole is not None:
                best.append((float(score[i]), whole))
            if len(best) >= _BEAM:
                break
        found: list[ScoredFunction] = []
        if functions:
            found = self.look(state, self.functions.first_look())
        if products:
            found += self.look(state, self._products(found))
        found.sort(key=lambda one: -one.score)
        for one in found[:_BEAM]:
            made = self._element(one.candidate, one.log_prior)
            if made is not None and made not in state.elements:
                best.append((one.score, made))
        best.sort(key=lambda one: -one[0])
        state.forget()
        begin = state.score - MORE
        return [(begin + w, e) for w, e in best[: _BEAM + 2]]

    def _products(self, found: Sequence[ScoredFunction]) -> list[Request]:
        """Return requests for products of the best functions' variables."""
        names = list(dict.fromkeys(f.candidate.parts[0].variable for f in found))
        names = names[:_VARIABLES]
        if "approach" in self.functions.variables:
            names.append("approach")
        return self.functions.products(dict.fromkeys(names))

    def look(
        self, state: State, requests: Sequence[Request], most: int = 3
    ) -> list[ScoredFunction]:
        """Return the best functions to add; scores are scaled to all rows."""
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
        """Readings of all rows for one of the sampled rows."""
        return len(self.readings.sampled) / max(int(self.readings.sampled.sum()), 1)

    def _element(self, one: Candidate, log_prior: float) -> Element | None:
        """Return the cached element of a function, with columns of all cells."""
        if one not in self._made:
            self._made[one] = self.functions.element(one, log_prior)
        return self._made[one]

    def _reformed(self, state: State) -> list[State]:
        """Return the model with its last function replaced by other forms."""
        last = state.elements[-1]
        if last.name:
            return []
        rest = state.elements[:-1]
        base = self.models.state(rest, state.mode, state)
        made = [last]
        if not last.candidate.parts[0].variable.startswith("wrench."):
            made = [e for e in self._forms_of(last, base) if e]
        made += [self._sharper(e, base) for e in made[:1]]
        new = [self.models.state((*rest, e), state.mode, base) for e in made]
        return [s for s in new if s.elements != state.elements]

    def _forms_of(self, last: Element, base: State) -> list[Element | None]:
        """Return the best forms of a function's variables."""
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
        for candidate in tried:  # one by one: each may have hundreds of columns
            e = self._made.get(candidate)
            e = e or self.functions.element(candidate, priors[candidate.shape])
            if e is not None:
                best.append((self._gain(e, base) + e.log_prior, e))
                best = sorted(best, key=lambda scored: -scored[0])[:4]
        base.forget()
        self._made |= {e.candidate: e for _, e in best}
        return [e for _, e in best]

    def _sharper(self, e: Element, base: State) -> Element:
        """Return a function with the number in which its form is not linear refined."""
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

    def _with_one_removed(self, state: State) -> list[State]:
        """Return the models that result from removing one element."""
        if len(state.elements) < 2:
            return []
        own = origins(state.elements)
        return [self._fitted(_without(own, out), state) for out in own]

    def _fitted(self, elements: tuple[Element, ...], start: State) -> State:
        """Return a model in its best mode, linearised at its estimates."""
        return self.relinearisation.relinearised(self.models.best(elements, start))

    def _best(self) -> State:
        """Return the model of largest log posterior."""
        return max(self.seen.values(), key=lambda s: s.score)

    def _exchange(self, best: State) -> None:
        """Remove each element of a model, or exchange it for another."""
        own = origins(best.elements)
        self._keep(self._with_one_removed(best))
        curved = any(e.first for e in best.elements)
        for out in own:
            base = (self._fitted if curved else self.models.best)(
                _without(own, out), best
            )
            listed = self._candidates(base, functions=not out.name)
            for less in self._without_nuisance([base])[1:]:
                listed += self._candidates(less, functions=False)
            listed.sort(key=lambda one: -one[0])
            # other ways in which the same effect may act are always tried: estimates
            # err alike for all of them
            near = {
                e.origin: e
                for w, e in listed
                if w > best.score - _NEAR or (e.name and e.name == out.name)
            }
            near.pop(out, None)
            tried = [(*base.elements, e) for e in [*near.values()][:_BEAM]]
            if not out.name and out.candidate.shape.given:
                tried.append((*base.elements, self._sharper(out, base)))
            self._keep(self._refined((elements, base) for elements in tried))

    def _refined(self, tried: Iterable[Tried]) -> list[State]:
        """Fit models; optimise modes and linearise again for the best ones."""
        new = [self.models.state(elements, s.mode, s) for elements, s in tried]
        new.sort(key=lambda s: -s.score)
        best = [self._fitted(s.elements, s) for s in new[:_KEPT]]
        return sorted([*best, *new[_KEPT:]], key=lambda s: -s.score)


def origins(elements: Iterable[Element]) -> tuple[Element, ...]:
    """Return the elements as linearised at their start values."""
    return tuple(e.origin for e in elements)


def _without(elements: Iterable[Element], out: Element) -> tuple[Element, ...]:
    return tuple(e for e in elements if e is not out)
