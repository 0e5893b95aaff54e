"""The search of a diagnosis: effects and functions together, in one currency.

A model is a set of elements beside geometry and springs (:mod:`.states`); the search
(:mod:`.search`) sees many.  All that were seen have their weights: the likeliest is
described, and every name has the probability of the models that contain it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from assembly.effects import LIBRARY
from assembly.effects.forms import FORMS
from validation.diagnosis.columns import Columns
from validation.diagnosis.elements import label
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.noise import (
    Noise,
    findings,
    good_readings,
    scale,
    scatter_of_repeats,
)
from validation.diagnosis.search import Search, Update, names_of
from validation.diagnosis.selected import Learned, Model, Selected, SmallPrior
from validation.diagnosis.states import State, foretold

_EQUAL = 3.0  # log posterior: functions that do as well
_SAME = 1.0  # squared whitened difference of models that say the same
_LISTED = 20  # models
_HEARD = 60  # models that are compared
_FEWEST = 5  # blocks, from which functions must foretell
_SURE = 2.0  # standard errors by which one must foretell blocks left out


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


def _selected(search: Search, states: list[State], good: NDArray) -> Selected:
    """The answer from all models seen."""
    states = _confirmed(search, _unlike(states))
    weights = np.array([s.score for s in states])
    weights = np.exp(weights - logsumexp(weights))
    best, fit = states[0], search.fit
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
        noise=Noise(tau, tau_std, _findings(search, best, (tau, tau_std), good)),
        weights=good,
        models=_models(states, weights),
        probability={n: _probability(n, states, weights) for n in sorted(effects)},
        unknowns=float(best.sizes.determined.sum()) + fit.flat.shape[1],
        blocks=blocks,
        gain=best.score - search.begin.score,
        states=tuple(states),
    )


def _findings(
    search: Search, best: State, scale: tuple[float, float], good: NDArray
) -> tuple[str, ...]:
    """What repeats, memory and the scale say of the noise."""
    columns, fit = search.columns, search.fit
    row, component = (axis[fit.cells] for axis in np.nonzero(columns.campaign.cells))
    repeat = columns.campaign.repeat[row]
    point = np.zeros(len(row), dtype=int)
    if columns.campaign.point is not None:
        point = np.unique(columns.campaign.point, return_inverse=True)[1][row]
    group = (repeat * (point.max(initial=0) + 1) + point) * 6 + component
    kept = good > 0.5
    repeats = scatter_of_repeats(best.left[kept], group[kept])
    forms = {e.candidate.shape.form for e in best.elements if not e.name}
    memory = any(FORMS[form].remembers for form in forms)
    return findings(*scale, repeats, memory=memory)


def _probability(name: str, states: Sequence[State], weights: NDArray) -> float:
    """Of an effect; finite motions beside others are part of these, and no claim."""
    has = [
        any(e.name == name for e in s.elements)
        and (len(s.elements) == 1 or not LIBRARY[name].finite)
        for s in states
    ]
    return float(weights[has].sum())


def _confirmed(search: Search, states: list[State]) -> list[State]:
    """Models without the likeliest whose functions foretell nothing."""
    blocks = search.columns.block[search.fit.cells]
    while len(np.unique(blocks)) >= _FEWEST and len(states) > 1:
        best = states[0]
        learned = [e for e in best.elements if not e.name]
        # one by one, and all of them: two may hide one another's faults
        rests = [tuple(x for x in best.elements if x is not e) for e in learned]
        rests.append(tuple(x for x in best.elements if x.name))
        gains = [
            foretold(best, search.fit.state(rest, best.mode, best), blocks)
            for rest in rests
            if learned
        ]
        if all(gain >= _SURE * error for gain, error in gains):
            break
        sure = [gain / max(error, 1e-300) for gain, error in gains[: len(learned)]]
        rest = rests[int(np.argmin(sure))]
        known = {frozenset(s.elements) for s in states}
        pruned = [] if frozenset(rest) in known else [search.fit.best(rest, best)]
        states = sorted([*states[1:], *pruned], key=lambda s: -s.score)
    return states


def _unlike(states: Sequence[State]) -> list[State]:
    """Models without those that say of the readings what a likelier one says.

    A function that does what an effect does is that effect: the one with fewer
    functions stays.

    Returns:
        Models, best first.
    """
    every = sorted(states, key=lambda s: -s.score)
    bare = [s for s in every if not _functions(s)]  # what stays if none is confirmed
    ordered = [*every[:_HEARD], *(s for s in bare[:_LISTED] if s not in every[:_HEARD])]
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
        elif names_of(state) != names_of(kept[twin]):
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
    return tuple(sorted(models, key=lambda m: -m.probability)[:_LISTED])


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
