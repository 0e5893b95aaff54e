"""From model to model: which effects and functions make the readings likelier.

From the empty model every effect of the library and every function is scored given the
models kept so far; the best are taken in, their sizes found anew, functions tried in
all forms, effects taken again about what was found.  Where nothing more makes the
readings likelier, each element of the likeliest model is held against all others in
its place, until it stays.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from validation.diagnosis.candidates import Candidate
from validation.diagnosis.columns import Columns
from validation.diagnosis.elements import Dense, Element
from validation.diagnosis.functions import Asked, Found
from validation.diagnosis.noise import FREEDOM, weights_of
from validation.diagnosis.places import Weighted
from validation.diagnosis.settled import Settling
from validation.diagnosis.states import MORE, Fitting, State

Update = Callable[[str, int, int], None]
Tried = tuple[tuple[Element, ...], State]  # elements, and the model they grew from
_MOST = 5  # elements
_BEAM = 6  # models that are refined at a time
_KEPT = 3  # models from which the search goes on
_OF_NAME = 2  # of them with the same effects
_LOOKED = 2  # of them, beside which functions are looked for
_FORMS = 4  # models whose function is tried in other forms
_VARIABLES = 4  # whose products with others are looked at
_DROP = 1.0  # log posterior by which a larger model may be behind
_NEAR = 15.0  # log posterior by which an estimate may be wrong
_ROUNDS = 3  # of exchanging elements
_MOVED = 0.3  # log posterior: a model is better than another


class Search:
    """States seen of one set of readings and weights."""

    def __init__(
        self, columns: Columns, z: NDArray, cells: NDArray, good: NDArray
    ) -> None:
        """Weight readings, and fit the model without elements.

        Args:
            columns: of all N cells.
            z: (n,) whitened residual of those fitted.
            cells: (N,) mask of these.
            good: (n,) probability that each is no blunder.
        """
        self.columns, self.functions = columns, columns.functions
        self.fit = Fitting(columns, z, cells, weights_of(good))
        self.empty = [self.fit.state((), mode) for mode in self.fit.modes()]
        self.begin = max(self.empty, key=lambda s: s.score)
        self.settling = Settling(columns, self.fit)
        self.seen: dict[object, State] = {}
        self._made: dict[object, Element | None] = {}

    def run(self, update: Update) -> list[State]:
        """All models seen, best first."""
        self.prepare()
        self._keep(self.empty)
        front = [self.begin]
        for level in range(_MOST):
            update("elements", level, _MOST)
            new = self._grown(front, products=level == 0)
            best = self._likeliest()
            if not new or new[0].score < best.score - _DROP:
                break
            front = new
        for _ in range(_ROUNDS):
            before = self._likeliest()
            self._exchange(before)
            best = self._likeliest()
            if best.score < before.score + _MOVED:
                break
            self._grown([best], products=False)
        return sorted(self.seen.values(), key=lambda s: -s.score)

    def prepare(self) -> None:
        """Products of all candidates with one another, once for all models."""
        cells = self.fit.cells.copy()
        cells[cells] = self.fit.glanced
        root = self.fit.root[self.fit.glanced]
        self.weighted: Weighted = self.functions.places.weighted(cells, root)
        pool = [*self.columns.library, *self.columns.explicit]
        self.dense = Dense(pool, self.fit.cells, self.fit.root)

    def _keep(self, states: Iterable[State]) -> None:
        """Remember models that support what they claim."""
        for state in states:
            if supported(state):
                self.seen[frozenset(origins(state.elements)), state.mode] = state

    def _grown(self, sources: Sequence[State], *, products: bool) -> list[State]:
        """The best models with one element more, kept and in order."""
        tried: dict[object, tuple[float, tuple[Element, ...], State]] = {}
        for state in self._with_less(sources):
            for worth, element in self._candidates(
                state,
                functions=state in sources[:_LOOKED],
                products=products and state is sources[0],
            ):
                elements = (*state.elements, element)
                key = frozenset(elements)
                if key not in tried or tried[key][0] < worth:
                    tried[key] = worth, elements, state
        ordered = sorted(tried.values(), key=lambda one: -one[0])
        most = _BEAM + 2 * len(sources)
        new = self._refined((e, state) for _, e, state in ordered[:most])
        for state in new[:_FORMS]:
            new += self._reformed(state)
        self._keep(new)
        kept: list[State] = []
        for state in sorted(new, key=lambda s: -s.score):
            alike = [s for s in kept if names_of(s) == names_of(state)]
            if len(alike) < _OF_NAME and len(kept) < _KEPT and supported(state):
                kept.append(state)
        for state in kept[:1]:
            self._keep(self._reduced(state))
        return kept

    def _with_less(self, states: Sequence[State]) -> list[State]:
        """Models, also without geometry or springs: these may stand for more."""
        less = [
            self.fit.state(s.elements, mode, s)
            for s in states
            for mode in self.fit.modes()
            if mode != s.mode and mode[0] <= s.mode[0] and mode[1] <= s.mode[1]
        ]
        return [*states, *less]

    def _candidates(
        self, state: State, *, functions: bool = True, products: bool = False
    ) -> list[tuple[float, Element]]:
        """The best elements beside a model, with what it is then worth about."""
        gains = self.dense.gains(state.taken, FREEDOM)
        priors = np.array([e.log_prior for e in self.dense.elements])
        worth = gains + priors
        have = {e.name for e in state.elements if e.name}
        counts: dict[str, int] = {}
        best: list[tuple[float, Element]] = []
        for i in np.argsort(-worth).tolist():
            e = self.dense.elements[i]
            if not np.isfinite(worth[i]) or (e.name and e.name in have):
                continue
            counts[e.name] = counts.get(e.name, 0) + 1
            if counts[e.name] <= _OF_NAME:
                best.append((float(worth[i]), e))
            if len(best) >= _BEAM:
                break
        found: list[Found] = []
        if functions:
            found = self.look(state, self.functions.first_look())
        if products:
            found += self.look(state, self._products(found))
        found.sort(key=lambda one: -one.worth)
        made = [(one.worth, self._element(one)) for one in found[:_BEAM]]
        best += [(w, e) for w, e in made if e is not None and e not in state.elements]
        best.sort(key=lambda one: -one[0])
        begin = state.score - MORE
        return [(begin + w, e) for w, e in best[: _BEAM + 2]]

    def _products(self, found: Sequence[Found]) -> list[Asked]:
        """Products of the variables of the best functions, and of directions."""
        names = list(dict.fromkeys(one.variables[0] for one in found))
        names = names[:_VARIABLES]
        if "approach" in self.functions.variables:
            names.append("approach")
        return self.functions.products(dict.fromkeys(names))

    def look(self, state: State, asked: Sequence[Asked], most: int = 3) -> list[Found]:
        """The best functions beside a model, by their worth in all rows."""
        found = self.functions.look(state.glance, self.weighted, FREEDOM, asked, most)
        more = len(self.fit.glanced) / self.fit.glanced.sum()
        scaled = [
            replace(f, worth=more * (f.worth - f.log_prior) + f.log_prior)
            for f in found
        ]
        return sorted(scaled, key=lambda one: -one.worth)

    def _element(self, found: Found) -> Element | None:
        """A function's element, made once."""
        one = self.functions.candidate(found)
        if one not in self._made:
            self._made[one] = self.functions.element(one, found.log_prior)
        return self._made[one]

    def _reformed(self, state: State) -> list[State]:
        """A model with its last function in all forms, at the likeliest places."""
        last = state.elements[-1]
        if last.name or last.candidate.parts[0].variable.startswith("wrench."):
            return []
        rest = state.elements[:-1]
        base = self.fit.state(rest, state.mode, state)
        made = self._forms_of(last, base)
        new = [self.fit.state((*rest, e), state.mode, base) for e in made if e]
        return [s for s in new if s.elements != state.elements]

    def _forms_of(self, last: Element, base: State) -> list[Element | None]:
        """The likeliest forms of a function's variables, at any single place."""
        one = last.candidate
        variables = one.parts[0].variables
        priors = self.functions.shapes_of(variables)
        if len(one.parts) == 1:
            found = self.look(base, [(variables, tuple(priors))], most=4)
            return [self._element(f) for f in found]
        tried = [Candidate(one.parts, one.kind, shape) for shape in priors]
        made = [
            self._made.setdefault(c, self.functions.element(c, priors[c.shape]))
            for c in tried
        ]
        shown = [e for e in made if e is not None]
        dense = Dense(shown, self.fit.cells, self.fit.root)
        worth = dense.gains(base.taken, FREEDOM) + [e.log_prior for e in shown]
        return [shown[i] for i in np.argsort(-worth)[:4].tolist()]

    def _reduced(self, state: State) -> list[State]:
        """A model without each of its elements."""
        if len(state.elements) < 2:
            return []
        own = origins(state.elements)
        rest = [tuple(e for e in own if e is not out) for out in own]
        return [self.settling.settled(self.fit.best(some, state)) for some in rest]

    def _likeliest(self) -> State:
        return max(self.seen.values(), key=lambda s: s.score)

    def _exchange(self, best: State) -> None:
        """Look at a model with an element less, or with another in its place."""
        own = origins(best.elements)
        self._keep(self._reduced(best))
        curved = any(e.first for e in best.elements)
        for out in own:
            rest = tuple(e for e in own if e is not out)
            base = self.fit.best(rest, best)
            base = self.settling.settled(base) if curved else base
            listed = self._candidates(base, functions=not out.name)
            for less in self._with_less([base])[1:]:
                listed += self._candidates(less, functions=False)
            listed.sort(key=lambda one: -one[0])
            near = {e.origin: e for w, e in listed if w > best.score - _NEAR}
            near.pop(out, None)
            tried = [(*base.elements, e) for e in [*near.values()][:_BEAM]]
            self._keep(self._refined((elements, base) for elements in tried))

    def _refined(self, tried: Iterable[Tried]) -> list[State]:
        """Models, the likeliest in their best mode and about their values."""
        new = [self.fit.state(elements, s.mode, s) for elements, s in tried]
        new.sort(key=lambda s: -s.score)
        best = [
            self.settling.settled(self.fit.best(s.elements, s)) for s in new[:_KEPT]
        ]
        return sorted([*best, *new[_KEPT:]], key=lambda s: -s.score)


def origins(elements: Iterable[Element]) -> tuple[Element, ...]:
    """Elements where their unknowns begin."""
    return tuple(e.origin for e in elements)


def names_of(state: State) -> tuple[str, ...]:
    """Names of a model's effects, and variables of its functions."""
    names = [
        e.name or "of " + ", ".join(e.candidate.parts[0].variables)
        for e in state.elements
    ]
    return tuple(sorted(names))


def supported(state: State) -> bool:
    """Whether the effects of a model differ from what is declared, within bounds."""
    for k, e in enumerate(state.elements):
        if not e.name or not e.columns.shape[1]:
            continue
        mean = state.sizes.mean[state.own(k)]
        shapes = np.isfinite(e.given)
        if np.all((mean <= e.lower)[~shapes] | (mean >= e.upper)[~shapes]):
            return False
        x = e.values(mean)
        for j, slot in enumerate(e.hypothesis.slots):
            low, high = slot.unknown.lower, slot.unknown.upper
            if slot.shape and not low * 1.001 < x[j] < high * 0.999:
                return False
    return True
