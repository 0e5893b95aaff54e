"""Select the library effects and functions that explain the deviations.

A model is a set of effects and functions, with or without geometric errors and springs
(:mod:`.states`). The search (:mod:`.search`) computes the posterior weights of many
models, and the best model is selected.  The probability of an effect is the sum of the
weights of all models that contain the effect.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.effects.forms import FORMS
from forcefit.validation.diagnosis.columns import Columns
from forcefit.validation.diagnosis.common_noise import common_sizes, stable
from forcefit.validation.diagnosis.elements import Element, label
from forcefit.validation.diagnosis.gaussian import scale
from forcefit.validation.diagnosis.noise import (
    Noise,
    cell_weights,
    findings,
    probability_good,
    repeat_scatter,
)
from forcefit.validation.diagnosis.nuisance import GEOMETRY, SPRINGS
from forcefit.validation.diagnosis.range_parts import range_error
from forcefit.validation.diagnosis.search import Search, Update
from forcefit.validation.diagnosis.selected import Learned, Model, Selected
from forcefit.validation.diagnosis.states import State, prediction_gain
from forcefit.validation.diagnosis.unknowns import Small
from forcefit.validation.diagnosis.weighted_readings import NONE, WeightedReadings

# Smallest relevant difference of two log posteriors, equivalent to odds of 20 to 1.
_EQUAL = 3.0
# If the total probability of all models with functions exceeds this value, the selected
# model must contain a function.
_CLAIMED = 0.9
# Squared whitened difference below which two predictions are treated as equal.
_SAME = 1.0
_LISTED = 20  # largest number of listed models
_COMPARED = 60  # number of models whose predictions are compared
_FEWEST = 5  # smallest number of blocks for cross-validation of functions
# Maximum number of searches with updated common noise.
_AGAIN = 3
# Required predictive gain of a function, in standard errors.
_SURE = 2.0


def select(
    columns: Columns, z: NDArray, cells: NDArray,
    update: Update = lambda what, done, total: None,
    common: tuple[float, float] | None = None,
) -> Selected:  # fmt: skip
    """Select the effects and functions that are missing in the declared model.

    Args:
        columns: design matrices for all N readings.
        z: (n,) whitened residual of the readings used in the fit.
        cells: (N,) mask of the readings used in the fit.
        update: function called with the stage, the number of finished steps and the
            number of all steps.
        common: [rad, m] standard deviations of the noise that is common to all readings
            of a measurement, divided by tau.  None if they are unknown.

    Returns:
        The best model and the posterior probabilities.
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
        states.clear()  # release memory
        good, shared = again, sizes
        search = search_of(good, shared)
        states = search.run(update)
    selected = _selected(search, states, good)
    search.models.forget()
    return selected


def _selected(search: Search, states: list[State], good: NDArray) -> Selected:
    """Return the best model, and the probabilities of effects and functions."""
    states = _confirmed(search, _merged(states))
    weights = np.array([s.score for s in states])
    weights = np.exp(weights - logsumexp(weights))
    learned = np.array([_functions(s) > 0 for s in states])
    if learned[0] and not learned.all() and weights[learned].sum() < _CLAIMED:
        # If functions are not sufficiently probable, the best model without functions
        # is selected.
        first = int(np.argmin(learned))
        order = [first, *(k for k in range(len(states)) if k != first)]
        states, weights = [states[k] for k in order], weights[order]
    best, readings, device = states[0], search.readings, search.columns.device
    own = [(k, e) for k, e in enumerate(best.elements) if e.name]
    hypotheses = [e.hypothesis for _, e in own]
    values = [e.values(best.sizes.mean[best.own(k)]) for k, e in own]
    if device is not None:
        hypotheses, values = [device, *hypotheses], [device.start, *values]
    effects = {e.name for s in states for e in s.elements if e.name}
    noise = _noise(search, best, good)
    return Selected(
        hypotheses=tuple(hypotheses),
        values=np.concatenate([np.zeros(0), *values]),
        functions=tuple(
            _learned(search, states, weights, k)
            for k, e in enumerate(best.elements)
            if not e.name
        ),
        small=_small(search, best, noise.tau),
        noise=noise,
        weights=good,
        models=_models(states, weights),
        probability={n: _probability(n, states, weights) for n in sorted(effects)},
        unknowns=float(best.sizes.determined.sum()) + readings.flat.shape[1],
        states=tuple(states[:_LISTED]),
    )


def _small(search: Search, best: State, tau: float) -> tuple[Small, ...]:
    """Return the nuisance parameters of a model with their priors."""
    small = search.columns.nuisance.take(best.used)
    std = best.sizes.std[: len(small.frame)] * tau
    return tuple(
        Small(name, small.frame[own], small.axis[own], std[own])
        for name, own in ((GEOMETRY, ~small.spring), (SPRINGS, small.spring))
        if own.any()
    )


def _noise(search: Search, best: State, good: NDArray) -> Noise:
    """Return the estimated noise, with sentences about it for the user."""
    campaign, readings = search.columns.campaign, search.readings
    row, component = (axis[readings.cells] for axis in np.nonzero(campaign.cells))
    point = np.zeros(len(row), dtype=int)
    if campaign.point is not None:
        point = np.unique(campaign.point, return_inverse=True)[1][row]
    group = campaign.repeat[row] * (point.max(initial=0) + 1) + point
    kept = good > 0.5
    repeats = repeat_scatter(best.left[kept], (group * 6 + component)[kept])
    forms = {e.candidate.shape.form for e in best.elements if not e.name}
    memory = any(FORMS[form].remembers for form in forms)
    tau, tau_std = scale(best.sizes.squares, readings.count)
    common = tau * readings.common[0], tau * readings.common[1]
    said = findings(tau, tau_std, repeats, memory=memory, common=common)
    return Noise(tau, tau_std, said, common)


def _probability(name: str, states: Sequence[State], weights: NDArray) -> float:
    """Return the probability of an effect.

    For an effect with finite motions, only models without other effects contribute to
    the probability.
    """
    has = [
        any(e.name == name for e in s.elements)
        and (len(s.elements) == 1 or not LIBRARY[name].finite)
        for s in states
    ]
    return float(weights[has].sum())


def _confirmed(search: Search, states: list[State]) -> list[State]:
    """Remove the best model as long as its functions fail cross-validation."""
    blocks, models = search.columns.block[search.readings.cells], search.models
    while len(np.unique(blocks)) >= _FEWEST and len(states) > 1:
        best = states[0]
        learned = [e for e in best.elements if not e.name]
        # Functions are tested one by one and all together, because two functions may
        # compensate each other.
        rests = [best.without([e]) for e in learned]
        sure = [
            prediction_gain(best, models.state(rest, best.mode, best), blocks)
            for rest in [*rests, best.without(learned)]
            if learned
        ]
        if all(one >= _SURE for one in sure):
            break
        rest = rests[int(np.argmin(sure[: len(learned)]))]
        known = {frozenset(s.elements) for s in states}
        pruned = [] if frozenset(rest) in known else [models.best(rest, best)]
        states = _best_first([*states[1:], *pruned])
    return states


def _merged(states: Sequence[State]) -> list[State]:
    """Return models with distinct predictions, best first.

    Of several models with equal predictions, the model with the fewest functions is
    returned. Effects of the measuring device rank behind functions.
    """
    every = _best_first(states)
    # Models without functions are needed if no function is confirmed.
    bare = [s for s in every if not _functions(s)][:_LISTED]
    compared = every[:_COMPARED]
    kept: list[State] = []
    for state in [*compared, *(s for s in bare if s not in compared)]:
        twin = next((k for k, s in enumerate(kept) if _same(s, state)), None)
        if twin is None:
            kept.append(state)
        elif _rank(state) != _rank(kept[twin]):
            kept[twin] = _joined(*sorted((kept[twin], state), key=_rank))
        elif state.names != kept[twin].names:
            kept.append(state)
    return _without_refinements(kept)


def _without_refinements(states: Sequence[State]) -> list[State]:
    """Merge each model with a refined effect into a model with the simpler effect."""
    kept: list[State] = []
    for state in sorted(_best_first(states), key=_is_refined):
        plain = sorted(_refined(e) or e.name for e in state.elements)
        alike = [
            k for k, other in enumerate(kept)
            if _is_refined(state) and plain == sorted(e.name for e in other.elements)
            and other.score > state.score - _EQUAL
        ]  # fmt: skip
        if alike:
            kept[alike[0]] = _joined(kept[alike[0]], state)
        else:
            kept.append(state)
    return _best_first(kept)


def _best_first(states: Sequence[State]) -> list[State]:
    return sorted(states, key=lambda s: -s.score)


def _joined(one: State, other: State) -> State:
    """Add the weight of a model to the weight of another model."""
    return replace(one, score=float(np.logaddexp(one.score, other.score)))


def _is_refined(state: State) -> bool:
    return any(map(_refined, state.elements))


def _refined(e: Element) -> str:
    """Return the name of the simpler effect that an effect refines, or ``""``."""
    return LIBRARY[e.name].refines if e.name else ""


def _rank(state: State) -> int:
    """Return the rank of a model among models with equal predictions."""
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
    """Return the effects, functions and probability of each model, best first."""
    total: dict[tuple[tuple[str, ...], tuple[str, ...]], float] = {}
    for state, weight in zip(states, weights, strict=True):
        effects = tuple(sorted(e.name for e in state.elements if e.name))
        labels = tuple(sorted(label(e.candidate) for e in state.elements if not e.name))
        total[effects, labels] = total.get((effects, labels), 0.0) + float(weight)
    models = [Model(*names, weight) for names, weight in total.items()]
    return tuple(sorted(models, key=lambda m: -m.probability)[:_LISTED])


def _learned(
    search: Search, states: Sequence[State], weights: NDArray, k: int
) -> Learned:
    """Return the k-th function of the best model, with its equivalent locations."""
    best, e = states[0], states[0].elements[k]
    rest = best.without([e])
    equal = list(search.columns.functions.equivalents(e.candidate))
    for s in states:
        others = [x for x in s.elements if x not in rest]
        if len(others) == 1 and len(s.elements) > len(rest) and not others[0].name:
            parts = others[0].candidate.parts
            if parts != e.candidate.parts and s.score > best.score - _EQUAL:
                equal.append(parts)
    own = replace(best, elements=(e,)).names[0]
    return Learned(
        candidate=e.candidate,
        equivalent=tuple(dict.fromkeys(equal)),
        std=best.sizes.std[best.own(k)] * e.scale * best.tau,
        probability=float(weights[[own in s.names for s in states]].sum()),
        range_error=range_error(
            e.candidate, best, search.models.state(rest, best.mode, best),
            search.columns.row[search.readings.cells],
        ),
    )  # fmt: skip
