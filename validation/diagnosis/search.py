"""Find the best model by a beam search and by exchanging effects and functions.

Steps:

1. Score the addition of every library effect and function to each model of the beam.
2. Add the best candidates, and optimise the prior standard deviations.
3. Try all functional forms of an added function, and linearise effects at their
   estimates.
4. Repeat until no additional effect or function increases the log posterior.
5. Exchange effects and functions of the best model until the log posterior no longer
   increases.
"""

from collections.abc import Callable, Iterable, Sequence

from forcefit.validation.diagnosis.elements import Element
from forcefit.validation.diagnosis.relinearise import MOVED, Relinearisation
from forcefit.validation.diagnosis.scores import BEAM, OF_NAME, Scores
from forcefit.validation.diagnosis.states import Models, State
from forcefit.validation.diagnosis.weighted_readings import WeightedReadings

Update = Callable[[str, int, int], None]
# Effects and functions to fit, and the model whose estimates are the start values.
Tried = tuple[tuple[Element, ...], State]
_MOST = 5  # largest number of effects and functions in a model
_KEPT = 3  # width of the beam
_LOOKED = 2  # number of models for which functions are scored
_FORMS = 4  # number of models whose last function is tried in all functional forms
# Largest accepted decrease of the log posterior when an effect or function is added.
_DROP = 1.0
# Maximum number of rounds of exchanges.
_ROUNDS = 3
_NEAR = 15.0  # largest error of an estimated log posterior


class Search:
    """Beam search over models of given readings."""

    def __init__(self, readings: WeightedReadings) -> None:
        """Fit the models without effects and functions."""
        self.readings, self.columns = readings, readings.columns
        self.models, self.scores = Models(readings), Scores(readings)
        self.empty = [self.models.state((), mode) for mode in self.models.modes()]
        self.begin = max(self.empty, key=lambda s: s.score)
        self.relinearisation = Relinearisation(self.columns.tangents, self.models)
        self.seen: dict[object, State] = {}

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
        for _ in range(_ROUNDS):
            before = self._best()
            self._exchange(before)
            best = self._best()
            if best.score < before.score + MOVED:
                break
            self._grow([best], products=False)
        return sorted(self.seen.values(), key=lambda s: -s.score)

    def _keep(self, states: Iterable[State]) -> None:
        """Store all models except those with effects at their bounds."""
        for state in states:
            if state.supported:
                self.seen[frozenset(origins(state.elements)), state.mode] = state

    def _grow(self, sources: Sequence[State], *, products: bool) -> list[State]:
        """Add one effect or function to each model, and return the best results."""
        tried: dict[object, tuple[float, tuple[Element, ...], State]] = {}
        for state in self._without_nuisance(sources):
            looked, first = state in sources[:_LOOKED], state is sources[0]
            listed = self.scores.best_to_add(
                state, functions=looked, products=products and first
            )
            for score, element in listed:
                elements = (*state.elements, element)
                key = frozenset(elements)
                if key not in tried or tried[key][0] < score:
                    tried[key] = score, elements, state
        ordered = sorted(tried.values(), key=lambda one: -one[0])
        most = BEAM + 2 * len(sources)
        new = self._refined((e, state) for _, e, state in ordered[:most])
        for state in new[:_FORMS]:
            new += self._reformed(state)
        self._keep(new)
        kept: list[State] = []
        for state in sorted(new, key=lambda s: -s.score):
            alike = [s for s in kept if s.names == state.names]
            if len(alike) < OF_NAME and len(kept) < _KEPT and state.supported:
                kept.append(state)
        for state in kept[:1]:
            self._keep(self._with_one_removed(state))
        return kept

    def _without_nuisance(self, states: Sequence[State]) -> list[State]:
        """Return models, and variants of the models with fewer nuisance parameters."""
        less = [
            self.models.state(s.elements, mode, s)
            for s in states
            for mode in self.models.modes()
            if mode != s.mode and mode[0] <= s.mode[0] and mode[1] <= s.mode[1]
        ]
        return [*states, *less]

    def _reformed(self, state: State) -> list[State]:
        """Return models in which the last function has a different functional form."""
        last = state.elements[-1]
        if last.name:
            return []
        rest = state.elements[:-1]
        base = self.models.state(rest, state.mode, state)
        made = [last]
        if not last.candidate.parts[0].variable.startswith("wrench."):
            made = [e for e in self.scores.forms_of(last, base) if e]
        made += [self.scores.sharper(e, base) for e in made[:1]]
        new = [self.models.state((*rest, e), state.mode, base) for e in made]
        return [s for s in new if s.elements != state.elements]

    def _with_one_removed(self, state: State) -> list[State]:
        """Return models with one effect or function removed."""
        if len(state.elements) < 2:
            return []
        own = origins(state.elements)
        return [self._fitted(_without(own, out), state) for out in own]

    def _fitted(self, elements: tuple[Element, ...], start: State) -> State:
        """Fit a model with its best nuisance parameters, and relinearise it."""
        return self.relinearisation.relinearised(self.models.best(elements, start))

    def _best(self) -> State:
        """Return the model with the largest log posterior."""
        return max(self.seen.values(), key=lambda s: s.score)

    def _exchange(self, best: State) -> None:
        """Try to improve a model by removing or exchanging each effect or function."""
        own = origins(best.elements)
        self._keep(self._with_one_removed(best))
        curved = any(e.first for e in best.elements)
        for out in own:
            base = (self._fitted if curved else self.models.best)(
                _without(own, out), best
            )
            listed = self.scores.best_to_add(base, functions=not out.name)
            for less in self._without_nuisance([base])[1:]:
                listed += self.scores.best_to_add(less, functions=False)
            listed.sort(key=lambda one: -one[0])
            # Other variants of the same effect are always tried.
            near = {
                e.origin: e
                for w, e in listed
                if w > best.score - _NEAR or (e.name and e.name == out.name)
            }
            near.pop(out, None)
            tried = [(*base.elements, e) for e in [*near.values()][:BEAM]]
            if not out.name and out.candidate.shape.given:
                tried.append((*base.elements, self.scores.sharper(out, base)))
            self._keep(self._refined((elements, base) for elements in tried))

    def _refined(self, tried: Iterable[Tried]) -> list[State]:
        """Fit models, and relinearise the best three."""
        new = [self.models.state(elements, s.mode, s) for elements, s in tried]
        new.sort(key=lambda s: -s.score)
        best = [self._fitted(s.elements, s) for s in new[:_KEPT]]
        return sorted([*best, *new[_KEPT:]], key=lambda s: -s.score)


def origins(elements: Iterable[Element]) -> tuple[Element, ...]:
    """Return the effects and functions linearised at their start values."""
    return tuple(e.origin for e in elements)


def _without(elements: Iterable[Element], out: Element) -> tuple[Element, ...]:
    return tuple(e for e in elements if e is not out)
