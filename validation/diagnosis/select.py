"""The search of a diagnosis: effects and functions together, in one currency.

A model is a set of elements beside geometry and springs (:mod:`.states`).  From the
empty one, every effect of the library and every function is scored given the models
kept so far; the best are taken in, their sizes found anew, functions tried in all
forms, nonlinear effects taken again about what was found.  It ends where one more
element makes nothing likelier, and every model that was seen has its weight.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from assembly.effects import LIBRARY
from validation.diagnosis.candidates import Candidate, CandidatePart
from validation.diagnosis.columns import Columns
from validation.diagnosis.elements import Dense, Element
from validation.diagnosis.functions import Asked, Found, Weighted
from validation.diagnosis.gaussian import leave_block_out
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.noise import (
    FREEDOM,
    Noise,
    good_readings,
    scale,
    weights_of,
)
from validation.diagnosis.states import MORE, Fitting, State

Update = Callable[[str, int, int], None]

MOST = 5  # elements
_BEAM = 6  # models that are refined at a time
_KEPT = 3  # models from which the search goes on
_OF_NAME = 2  # of them with the same effects
_FORMS = 4  # models whose function is tried in other forms
_DROP = 1.0  # log posterior by which a larger model may be behind
_ROUNDS = 3  # of taking nonlinear effects again
_MOVED = 0.3  # log posterior
_LOOKED = 2  # of them, beside which functions are looked for
_NEAR = 15.0  # log posterior by which an estimate may be wrong
_EQUAL = 3.0  # log posterior: functions that do as well
_SAME = 1.0  # squared whitened difference of models that say the same
_LINEAR = 0.5  # squared whitened difference from a model that is linear enough
_SHIFT = 3.0  # times that a shape may change in a round


@dataclass(frozen=True, eq=False)
class Learned:
    """A function that was found.

    Attributes:
        candidate: where, of what, in which form.
        equivalent: places and variables that do as well.
        gain: logarithm of how much likelier it makes the readings.
        std: (m,) prior size of its unknowns, as :class:`.Sensitivities` counts them.
        probability: that some function of this variable acts.
    """

    candidate: Candidate
    equivalent: tuple[tuple[CandidatePart, ...], ...]
    gain: float
    std: NDArray
    probability: float


@dataclass(frozen=True, eq=False)
class SmallPrior:
    """Geometry and springs in use.

    Attributes:
        spring: (k,) bool.
        frame, axis: (k,) row of the frame in the campaign's robot, component there.
        std: (k,) [rad, m, or per wrench] prior standard deviation.
    """

    spring: NDArray
    frame: NDArray
    axis: NDArray
    std: NDArray


@dataclass(frozen=True)
class Model:
    """A model by its names.

    Attributes:
        effects: of the library.
        functions: each in words.
        probability: after the readings were looked at.
    """

    effects: tuple[str, ...]
    functions: tuple[str, ...]
    probability: float


@dataclass(frozen=True, eq=False)
class Selected:
    """What a search found.

    Attributes:
        hypotheses: of the best model, the measuring frame first where it is not known.
        values: (k,) of their unknowns, one hypothesis after the other.
        functions: of the best model.
        prior: geometry and springs in use.
        noise: its scale.
        weights: (n,) probability of every cell that it is no blunder.
        models: the likely ones, best first.
        probability: of every effect of the library that some model has.
        unknowns: [-] well determined, the measuring frame's among them.
        blocks: configurations, or spans of time.
        gain: log posterior of the best model over the model without elements.
        states: models that were seen, best first.
    """

    hypotheses: tuple[Hypothesis, ...]
    values: NDArray
    functions: tuple[Learned, ...]
    prior: SmallPrior
    noise: Noise
    weights: NDArray
    models: tuple[Model, ...]
    probability: dict[str, float]
    unknowns: float
    blocks: int
    gain: float
    states: tuple[State, ...]

    @property
    def enough(self) -> bool:
        """Whether there are more blocks of rows than a model needs unknowns."""
        return self.blocks >= self.unknowns + 2


def select(
    columns: Columns, z: NDArray, cells: NDArray,
    update: Update = lambda what, done, total: None,
) -> Selected:  # fmt: skip
    """Find what the declared model lacks.

    Args:
        columns: of all N measured cells.
        z: (n,) whitened residual of the cells fitted.
        cells: (N,) mask of these; no other readings are known here.
        update: told what is done, how much of it and of how much.

    Returns:
        The best model, and how likely it and the others are.
    """
    good = np.ones(len(z))
    search = Search(columns, z, cells, good)
    begin = good_readings(search.begin.expected_squares(), clearly=True)
    if (begin < 1).any():
        good, search = begin, Search(columns, z, cells, begin)
    states = search.run(update)
    again = good_readings(states[0].expected_squares())
    if not np.array_equal(again, good):
        good, search = again, Search(columns, z, cells, again)
        states = search.run(update)
    return _selected(search, states, good)


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
        self.seen: dict[object, State] = {}
        self._about: dict[object, list[Element] | None] = {}
        self._made: dict[object, Element | None] = {}

    def run(self, update: Update) -> list[State]:
        """All models seen, best first."""
        self.prepare()
        self._keep(self.empty)
        front = [self.begin]
        for level in range(MOST):
            update("elements", level, MOST)
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
        self.weighted: Weighted = self.functions.weighted(cells, root)
        pool = [*self.columns.library, *self.columns.explicit]
        self.dense = Dense(pool, self.fit.cells, self.fit.root)

    def _keep(self, states: Iterable[State]) -> None:
        """Remember models that support what they claim."""
        for state in states:
            if _supported(state):
                self.seen[frozenset(_origins(state.elements)), state.mode] = state

    def _grown(self, sources: Sequence[State], *, products: bool) -> list[State]:
        """The best models with one element more, kept and in order."""
        tried: dict[object, tuple[float, tuple[Element, ...], State]] = {}
        for state in self._with_less(sources):
            for worth, element in self._candidates(
                state, functions=state in sources[:_LOOKED], products=products and state is sources[0]
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
            alike = [s for s in kept if _names(s) == _names(state)]
            if len(alike) < _OF_NAME and len(kept) < _KEPT and _supported(state):
                kept.append(state)
        for state in kept[:1]:
            self._keep(self._reduced(state))
        return kept

    def _with_less(self, states: Sequence[State]) -> list[State]:
        """Models, and the same without geometry or springs: these may stand for more."""
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
        names = list(dict.fromkeys(one.variables[0] for one in found))[:4]
        if "approach" in self.functions.variables:
            names.append("approach")
        return self.functions.products(dict.fromkeys(names))

    def look(
        self, state: State, asked: Sequence[Asked], most: int = 3
    ) -> list[Found]:
        """The best functions beside a model, by what they would be worth in all rows."""
        found = self.functions.look(state.glance, self.weighted, FREEDOM, asked, most)
        more = len(self.fit.glanced) / self.fit.glanced.sum()
        scaled = [
            replace(f, worth=more * (f.worth - f.log_prior) + f.log_prior) for f in found
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

    def _settled(self, state: State) -> State:
        """A model about its own values, where that differs from what was assumed."""
        for _ in range(_ROUNDS):
            elements = self._again(state)
            if elements is None:
                break
            before, state = state.score, self.fit.state(elements, state.mode, state)
            if abs(state.score - before) < _MOVED:
                break
        return state

    def _again(self, state: State) -> tuple[Element, ...] | None:
        """Elements about a model's values; None where they add up to them already."""
        own = [
            (k, e)
            for k, e in enumerate(state.elements)
            if e.name and e.columns.shape[1]
        ]
        if not own:
            return None
        means = [state.sizes.mean[state.own(k)] for k, _ in own]
        xs = [_within(e, e.values(d)) for (_, e), d in zip(own, means, strict=True)]
        effects = [e for _, e in own]
        key = tuple(e.origin for e in effects), tuple(
            float(f"{v:.3g}") for x in xs for v in x
        )
        if key not in self._about:
            settled = all(_has_shapes(e) for e in effects)
            if settled:
                d = [(x - e.begin)[e.slots] / e.scale for e, x in zip(effects, xs, strict=True)]
                linear = sum(
                    (e.columns @ y for e, y in zip(effects, d, strict=True)),
                    start=np.zeros(len(self.fit.cells)),
                )
                linear += sum(e.offset for e in effects if e.offset is not None)
                exact = self.columns.together(effects, xs)
                miss = (exact - linear)[self.fit.cells]
                settled = not float(miss @ miss) > _LINEAR
            again = None if settled else self.columns.again(effects, xs)
            self._about[key] = again
        made = self._about[key]
        if made is None:
            return None
        elements = list(state.elements)
        for (k, _), new in zip(own, made, strict=True):
            elements[k] = new
        return tuple(elements)

    def _reduced(self, state: State) -> list[State]:
        """A model without each of its elements."""
        if len(state.elements) < 2:
            return []
        own = _origins(state.elements)
        rest = [tuple(e for e in own if e is not out) for out in own]
        return [self._settled(self.fit.best(some, state)) for some in rest]

    def _likeliest(self) -> State:
        return max(self.seen.values(), key=lambda s: s.score)

    def _exchange(self, best: State) -> None:
        """Look at a model with an element less, or with another in its place."""
        own = _origins(best.elements)
        self._keep(self._reduced(best))
        curved = any(e.first for e in best.elements)
        for out in own:
            rest = tuple(e for e in own if e is not out)
            base = self.fit.best(rest, best)
            base = self._settled(base) if curved else base
            listed = self._candidates(base, functions=not out.name)
            for less in self._with_less([base])[1:]:
                listed += self._candidates(less, functions=False)
            listed.sort(key=lambda one: -one[0])
            near = {e.origin: e for w, e in listed if w > best.score - _NEAR}
            near.pop(out, None)
            tried = [(*base.elements, e) for e in [*near.values()][:_BEAM]]
            self._keep(self._refined((elements, base) for elements in tried))

    def _refined(
        self, tried: Iterable[tuple[tuple[Element, ...], State]]
    ) -> list[State]:
        """Models, the likeliest in their best mode and about their values."""
        new = [self.fit.state(elements, s.mode, s) for elements, s in tried]
        new.sort(key=lambda s: -s.score)
        best = [self._settled(self.fit.best(s.elements, s)) for s in new[:_KEPT]]
        return sorted([*best, *new[_KEPT:]], key=lambda s: -s.score)


def _has_shapes(e: Element) -> bool:
    """Whether an effect's shapes are among its unknowns."""
    return all(j in e.slots for j, slot in enumerate(e.hypothesis.slots) if slot.shape)


def _within(e: Element, x: NDArray) -> NDArray:
    """Values of an effect, its shapes no farther than a round may take them."""
    for j, slot in enumerate(e.hypothesis.slots):
        if slot.shape:
            x[j] = np.clip(x[j], e.begin[j] / _SHIFT, e.begin[j] * _SHIFT)
            x[j] = np.clip(x[j], slot.unknown.lower, slot.unknown.upper)
    return x


def _origins(elements: Iterable[Element]) -> tuple[Element, ...]:
    """Elements where their unknowns begin."""
    return tuple(e.origin for e in elements)


def _names(state: State) -> tuple[str, ...]:
    """Names of a model's effects, and variables of its functions."""
    names = [
        e.name or "of " + ", ".join(e.candidate.parts[0].variables)
        for e in state.elements
    ]
    return tuple(sorted(names))


def _supported(state: State) -> bool:
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


def _selected(search: Search, states: list[State], good: NDArray) -> Selected:
    """The answer from all models seen."""
    states = _unlike(states)
    weights = np.array([s.score for s in states])
    weights = np.exp(weights - logsumexp(weights))
    best, fit = states[0], search.fit
    hypotheses: list[Hypothesis] = []
    values: list[NDArray] = []
    functions: list[Learned] = []
    names = [_names(s) for s in states]
    if search.columns.device is not None:
        hypotheses.append(search.columns.device)
        values.append(search.columns.device.start)
    for k, e in enumerate(best.elements):
        mean = best.sizes.mean[best.own(k)]
        if e.name:
            hypotheses.append(e.hypothesis)
            values.append(e.values(mean))
            continue
        own = _names(replace(best, elements=(e,)))[0]
        share = sum(w for w, n in zip(weights, names, strict=True) if own in n)
        functions.append(_learned(search, states, best, k, float(share)))
    effects = {e.name for s in states for e in s.elements if e.name}
    small, kept = search.columns.nuisance, np.flatnonzero(best.used)
    blocks = len(np.unique(search.columns.block[fit.cells]))
    tau, tau_std = scale(best.sizes.squares, fit.count)
    return Selected(
        hypotheses=tuple(hypotheses),
        values=np.concatenate([np.zeros(0), *values]),
        functions=tuple(functions),
        prior=SmallPrior(
            small.spring[kept], small.frame[kept], small.axis[kept],
            best.sizes.std[: len(kept)] * tau,
        ),  # fmt: skip
        noise=Noise(tau, tau_std),
        weights=good,
        models=_models(states, weights),
        probability={n: _probability(n, states, weights) for n in sorted(effects)},
        unknowns=float(best.sizes.determined.sum()) + fit.flat.shape[1],
        blocks=blocks,
        gain=best.score - search.begin.score,
        states=tuple(states),
    )


def _probability(name: str, states: Sequence[State], weights: NDArray) -> float:
    """Of an effect; finite motions beside others are part of these, and no claim."""
    has = [
        any(e.name == name for e in s.elements)
        and (len(s.elements) == 1 or not LIBRARY[name].finite)
        for s in states
    ]
    return float(weights[has].sum())


def _unlike(states: Sequence[State]) -> list[State]:
    """Models without those that say of the readings what a likelier one says.

    A function that does what an effect does is that effect: the one with fewer
    functions stays.
    """
    ordered = sorted(states, key=lambda s: -s.score)[:60]
    kept: list[State] = []
    for state in ordered:
        twin = next((k for k, s in enumerate(kept) if _same(s, state)), None)
        if twin is None:
            kept.append(state)
        elif _functions(state) < _functions(kept[twin]):
            both = np.logaddexp(state.score, kept[twin].score)
            kept[twin] = replace(state, score=float(both))
        elif _functions(state) > _functions(kept[twin]):
            both = np.logaddexp(state.score, kept[twin].score)
            kept[twin] = replace(kept[twin], score=float(both))
        elif _names(state) != _names(kept[twin]):
            kept.append(state)
    return sorted(kept, key=lambda s: -s.score)


def _functions(state: State) -> int:
    return sum(not e.name for e in state.elements)


def _same(one: State, other: State) -> bool:
    """Whether two models differ by nothing that the readings could show."""
    if not one.elements or not other.elements:
        return one.elements == other.elements
    difference = one.fitted - other.fitted
    return float(difference @ difference) < _SAME * one.tau**2


def _models(states: Sequence[State], weights: NDArray) -> tuple[Model, ...]:
    """Models by their names, likeliest first."""
    total: dict[tuple[tuple[str, ...], tuple[str, ...]], float] = {}
    for state, weight in zip(states, weights, strict=True):
        effects = tuple(sorted(e.name for e in state.elements if e.name))
        labels = tuple(sorted(label(e.candidate) for e in state.elements if not e.name))
        total[effects, labels] = total.get((effects, labels), 0.0) + float(weight)
    models = [Model(*names, weight) for names, weight in total.items()]
    return tuple(sorted(models, key=lambda m: -m.probability)[:20])


def label(one: Candidate) -> str:
    """A function in words."""
    where = " and ".join(f"{p.where} {', '.join(p.components)}" for p in one.parts)
    of = ", ".join(one.parts[0].variables)
    given = "".join(f" {k} {v:.3g}" for k, v in one.shape.given)
    kind = "" if one.kind == "screw" else "compliance of "
    return f"{kind}{where}: {one.shape.form} ({', '.join(one.shape.names)}{given}) of {of}"


def _learned(
    search: Search, states: Sequence[State], best: State, k: int, probability: float
) -> Learned:
    """A function of the best model, and what does as well."""
    e = best.elements[k]
    rest = set(best.elements) - {e}
    equal = list(search.functions.equivalents(e.candidate))
    for s in states:
        other = set(s.elements) - rest
        if rest <= set(s.elements) and len(other) == 1 and not next(iter(other)).name:
            parts = next(iter(other)).candidate.parts
            if parts != e.candidate.parts and s.score > best.score - _EQUAL:
                equal.append(parts)
    without = search.fit.state(
        tuple(x for x in best.elements if x is not e), best.mode, best
    )
    std = best.sizes.std[best.own(k)] * e.scale * best.tau
    return Learned(
        e.candidate, tuple(dict.fromkeys(equal)), best.score - without.score, std,
        probability,
    )  # fmt: skip


def folds(state: State, blocks: NDArray) -> NDArray:
    """(number of blocks,) ln densities of each block by a fit to all others."""
    return leave_block_out(state.taken, blocks)[1]
