"""Select a model of the deviations: effects of the library and functions.

A model is a set of elements with or without geometric errors and springs
(:mod:`.states`).  The search (:mod:`.search`) visits many.  Every visited model has a
posterior weight.  The result describes the best one; the probability of a name is the
sum of the weights of the models that contain it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from assembly.effects import LIBRARY
from assembly.effects.forms import FORMS
from validation.diagnosis.columns import Columns
from validation.diagnosis.common_noise import common_sizes, stable
from validation.diagnosis.elements import Element, label
from validation.diagnosis.gaussian import scale
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.noise import (
    Noise,
    cell_weights,
    findings,
    probability_good,
    repeat_scatter,
)
from validation.diagnosis.range_parts import range_error
from validation.diagnosis.search import Search, Update, names_of
from validation.diagnosis.selected import Learned, Model, Selected, SmallPrior
from validation.diagnosis.states import State, prediction_gain
from validation.diagnosis.weighted_readings import NONE, WeightedReadings

_EQUAL = 3.0  # log posterior: difference of equivalent functions
_CLAIMED = 0.9  # probability of functions from which the best model has them
_SAME = 1.0  # squared whitened difference of models with equal predictions
_LISTED = 20  # models in the result
_COMPARED = 60  # models whose predictions are compared
_FEWEST = 5  # blocks: with fewer, functions are not cross-validated
_AGAIN = 3  # searches with other noise in common, or other blunders
_SURE = 2.0  # standard errors: least gain of a function in cross-validation


def select(
    columns: Columns, z: NDArray, cells: NDArray,
    update: Update = lambda what, done, total: None,
    common: tuple[float, float] | None = None,
) -> Selected:  # fmt: skip
    """Find what the declared model lacks.

    Args:
        columns: of all N measured cells.
        z: (n,) whitened residual of the fitted cells.
        cells: (N,) mask of the fitted cells; no other reading is used.
        update: progress callback: stage, steps done, steps in total.
        common: [rad, m] noise that cells of a measurement share, over tau, if known.

    Returns:
        The best model, and the posterior probabilities.
    """
    good, shared = np.ones(len(z)), common or NONE

    def search_of(good: NDArray, shared: tuple[float, float]) -> Search:
        weights = cell_weights(good)
        return Search(WeightedReadings(columns, z, cells, weights, shared))

    search = search_of(good, shared)
    begin = probability_good(search.begin.expected_squares(), clearly=True)
    if (begin < 1).any():
        good, search = begin, search_of(begin, shared)
    states = search.run(update)
    for _ in range(1 if columns.motions is None else _AGAIN):
        again = probability_good(states[0].expected_squares())
        sizes = common_sizes(states[0]) if common is None else shared
        if np.array_equal(again, good) and stable(sizes, shared):
            break
        states.clear()  # a model may have columns of hundreds of megabytes
        good, shared = again, sizes
        search = search_of(good, shared)
        states = search.run(update)
    selected = _selected(search, states, good)
    search.models.forget()
    return selected


def _selected(search: Search, states: list[State], good: NDArray) -> Selected:
    """Build the result from all visited models."""
    states = _confirmed(search, _merged(states))
    weights = np.array([s.score for s in states])
    weights = np.exp(weights - logsumexp(weights))
    learned = np.array([_functions(s) > 0 for s in states])
    if learned[0] and not learned.all() and weights[learned].sum() < _CLAIMED:
        # a function that may as well not be there is not kept
        first = int(np.argmin(learned))
        order = [first, *(k for k in range(len(states)) if k != first)]
        states, weights = [states[k] for k in order], weights[order]
    best, fit = states[0], search.readings
    hypotheses: list[Hypothesis] = []
    values: list[NDArray] = []
    functions: list[Learned] = []
    names = [names_of(s) for s in states]
    if search.columns.device is not None:
        hypotheses.append(search.columns.device)
        values.append(search.columns.device.start)
    for k, e in enumerate(best.elements):
        mean = best.sizes.mean[best.own(k)]
        if e.name:
            hypotheses.append(e.hypothesis)
            values.append(e.values(mean))
            continue
        own = names_of(replace(best, elements=(e,)))[0]
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
            small.spring[kept],
            small.frame[kept],
            small.axis[kept],
            best.sizes.std[: len(kept)] * tau,
        ),  # fmt: skip
        noise=Noise(
            tau,
            tau_std,
            _findings(search, best, (tau, tau_std), good),
            (tau * fit.common[0], tau * fit.common[1]),
        ),  # fmt: skip
        weights=good,
        models=_models(states, weights),
        probability={n: _probability(n, states, weights) for n in sorted(effects)},
        unknowns=float(best.sizes.determined.sum()) + fit.flat.shape[1],
        blocks=blocks,
        gain=best.score - search.begin.score,
        states=tuple(states[:_LISTED]),
    )


def _findings(
    search: Search, best: State, scale: tuple[float, float], good: NDArray
) -> tuple[str, ...]:
    """Return findings about the noise: scale, repeatability, memory."""
    columns, fit = search.columns, search.readings
    row, component = (axis[fit.cells] for axis in np.nonzero(columns.campaign.cells))
    repeat = columns.campaign.repeat[row]
    point = np.zeros(len(row), dtype=int)
    if columns.campaign.point is not None:
        point = np.unique(columns.campaign.point, return_inverse=True)[1][row]
    group = (repeat * (point.max(initial=0) + 1) + point) * 6 + component
    kept = good > 0.5
    repeats = repeat_scatter(best.left[kept], group[kept])
    forms = {e.candidate.shape.form for e in best.elements if not e.name}
    memory = any(FORMS[form].remembers for form in forms)
    common = scale[0] * fit.common[0], scale[0] * fit.common[1]
    return findings(*scale, repeats, memory=memory, common=common)


def _probability(name: str, states: Sequence[State], weights: NDArray) -> float:
    """Return the probability of an effect; finite motions count only alone."""
    has = [
        any(e.name == name for e in s.elements)
        and (len(s.elements) == 1 or not LIBRARY[name].finite)
        for s in states
    ]
    return float(weights[has].sum())


def _confirmed(search: Search, states: list[State]) -> list[State]:
    """Remove the best models whose functions fail cross-validation."""
    blocks = search.columns.block[search.readings.cells]
    while len(np.unique(blocks)) >= _FEWEST and len(states) > 1:
        best = states[0]
        learned = [e for e in best.elements if not e.name]
        # each one, and all together: two functions can compensate each other
        rests = [tuple(x for x in best.elements if x is not e) for e in learned]
        rests.append(tuple(x for x in best.elements if x.name))
        sure = [
            prediction_gain(best, search.models.state(rest, best.mode, best), blocks)
            for rest in rests
            if learned
        ]
        if all(one >= _SURE for one in sure):
            break
        rest = rests[int(np.argmin(sure[: len(learned)]))]
        known = {frozenset(s.elements) for s in states}
        pruned = [] if frozenset(rest) in known else [search.models.best(rest, best)]
        states = sorted([*states[1:], *pruned], key=lambda s: -s.score)
    return states


def _merged(states: Sequence[State]) -> list[State]:
    """Merge models of equal predictions; the one with fewer functions is kept.

    A function with the same columns as an effect of the library is that effect; but for
    errors of the measuring device, which the machine may have as well.

    Returns:
        Models, best first.
    """
    every = sorted(states, key=lambda s: -s.score)
    bare = [
        s for s in every if not _functions(s)
    ]  # kept in case no function is confirmed
    ordered = [
        *every[:_COMPARED],
        *(s for s in bare[:_LISTED] if s not in every[:_COMPARED]),
    ]
    kept: list[State] = []
    for state in ordered:
        twin = next((k for k, s in enumerate(kept) if _same(s, state)), None)
        if twin is None:
            kept.append(state)
        elif _rank(state) < _rank(kept[twin]):
            both = np.logaddexp(state.score, kept[twin].score)
            kept[twin] = replace(state, score=float(both))
        elif _rank(state) > _rank(kept[twin]):
            both = np.logaddexp(state.score, kept[twin].score)
            kept[twin] = replace(kept[twin], score=float(both))
        elif names_of(state) != names_of(kept[twin]):
            kept.append(state)
    return _without_refinements(sorted(kept, key=lambda s: -s.score))


def _without_refinements(states: Sequence[State]) -> list[State]:
    """Merge models with an effect's refinement that is not clearly better than it."""
    kept: list[State] = []
    for state in sorted(states, key=lambda s: any(map(_refined, s.elements))):
        plain = [_refined(e) or e.name for e in state.elements]
        alike = [
            k for k, other in enumerate(kept)
            if any(map(_refined, state.elements))
            and sorted(plain) == sorted(e.name for e in other.elements)
            and other.score > state.score - _EQUAL
        ]  # fmt: skip
        if alike:
            both = float(np.logaddexp(kept[alike[0]].score, state.score))
            kept[alike[0]] = replace(kept[alike[0]], score=both)
        else:
            kept.append(state)
    return sorted(kept, key=lambda s: -s.score)


def _refined(e: Element) -> str:
    """Return the effect that an element's is a refinement of, or nothing."""
    return LIBRARY[e.name].refines if e.name else ""


def _rank(state: State) -> int:
    """Return the order in which models of equal predictions are preferred."""
    own = [e.name for e in state.elements if e.name]
    return _functions(state) + 2 * sum(LIBRARY[name].device_alone for name in own)


def _functions(state: State) -> int:
    return sum(not e.name for e in state.elements)


def _same(one: State, other: State) -> bool:
    """Return whether two models predict the same readings."""
    if not one.elements or not other.elements:
        return one.elements == other.elements
    difference = one.fitted - other.fitted
    return float(difference @ difference) < _SAME * one.tau**2


def _models(states: Sequence[State], weights: NDArray) -> tuple[Model, ...]:
    """Return the models by their names, best first."""
    total: dict[tuple[tuple[str, ...], tuple[str, ...]], float] = {}
    for state, weight in zip(states, weights, strict=True):
        effects = tuple(sorted(e.name for e in state.elements if e.name))
        labels = tuple(sorted(label(e.candidate) for e in state.elements if not e.name))
        total[effects, labels] = total.get((effects, labels), 0.0) + float(weight)
    models = [Model(*names, weight) for names, weight in total.items()]
    return tuple(sorted(models, key=lambda m: -m.probability)[:_LISTED])


def _learned(
    search: Search, states: Sequence[State], best: State, k: int, probability: float
) -> Learned:
    """Return a function of the best model with its equivalents."""
    e = best.elements[k]
    rest = set(best.elements) - {e}
    equal = list(search.functions.equivalents(e.candidate))
    for s in states:
        other = set(s.elements) - rest
        if rest <= set(s.elements) and len(other) == 1 and not next(iter(other)).name:
            parts = next(iter(other)).candidate.parts
            if parts != e.candidate.parts and s.score > best.score - _EQUAL:
                equal.append(parts)
    without = search.models.state(
        tuple(x for x in best.elements if x is not e), best.mode, best
    )
    std = best.sizes.std[best.own(k)] * e.scale * best.tau
    return Learned(
        e.candidate, tuple(dict.fromkeys(equal)), best.score - without.score, std,
        probability,
        range_error(
            e.candidate, best, without, search.columns.row[search.readings.cells]
        ),
    )  # fmt: skip
