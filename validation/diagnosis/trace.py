"""Search for effects that the model lacks, and fit the parameters of the machine.

Steps:

1. Estimate the pose of the measuring frame if it is unknown.
2. Select effects and functions (:mod:`.select`).
3. Fit the machine with these effects (:mod:`.fit`).
4. Add second-order terms of its geometric errors to the model, and repeat from step 2.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import predict
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.claims import supported
from forcefit.validation.diagnosis.columns import FUNCTION, Columns
from forcefit.validation.diagnosis.declared import Declared, at_rest
from forcefit.validation.diagnosis.derivatives import Derivatives
from forcefit.validation.diagnosis.fit import MachineFit, fit_machine
from forcefit.validation.diagnosis.holdout import drawn, hidden
from forcefit.validation.diagnosis.hypotheses import (
    Hypothesis,
    in_one_session,
    sessions_of,
)
from forcefit.validation.diagnosis.lack_of_fit import OUTLIERS, outlying
from forcefit.validation.diagnosis.noise import cell_weights
from forcefit.validation.diagnosis.plausible import impossible_rows
from forcefit.validation.diagnosis.prediction import residual_of
from forcefit.validation.diagnosis.registration import register
from forcefit.validation.diagnosis.select import select
from forcefit.validation.diagnosis.selected import Selected
from forcefit.validation.diagnosis.signatures import whiten
from forcefit.validation.diagnosis.states import prediction_gain
from forcefit.validation.diagnosis.unknowns import Acting, LearnedFunction, Unknowns
from forcefit.validation.diagnosis.weighted_readings import NONE

Update = Callable[[str, int, int], None]
FINITE = next(name for name, effect in LIBRARY.items() if effect.finite)
# Largest number of rows for model selection.
_SEARCHED = 2000
# Maximum number of searches, each of which excludes further blunders.
_TURNS = 6
_BENDS = 1  # maximum number of updates of the second-order terms
# Smallest rms residual of a row with a gross blunder, relative to the median row.
_GROSS = 30.0
# Required predictive gain of functions of time, in standard errors.
_CLEARLY = 2.0
# [sigma] Smallest relevant second-order change of a reading.
_BENT = 0.3
_RIVALS = 3  # largest number of rival machines to compare


@dataclass(frozen=True, eq=False)
class Traced:
    """Result of the search for effects and functions.

    Attributes:
        campaign: campaign of R rows with the estimated noise.
        conditions: conditions of all rows, with the pose of the device and second-order
            terms of geometric errors.
        used: (R,) mask of the fitted rows.
        outliers: (R,) mask of the rows that were excluded because of a blunder.
        selected: models with their probabilities.
        columns: design matrices of all candidate effects.
    """

    campaign: Campaign
    conditions: Conditions
    used: NDArray
    outliers: NDArray
    selected: Selected
    columns: Columns

    @property
    def fitting(self) -> Campaign:
        """Campaign that contains only the fitted rows."""
        return self.campaign.take(self.used)

    @cached_property
    def unknowns(self) -> Unknowns:
        """Unknown parameters of the machine, with their priors."""
        found, effects, at = self.selected, [], 0
        unknown = self.campaign.registration == "unknown"
        for k, h in enumerate(found.hypotheses):
            own = slice(at, at := at + len(h.slots))
            if unknown and k == 0:
                effects += self._device_frames(h)
            elif h.effect != FINITE or self._alone:
                effects += _acting(h, found.values[own])
        functions = [LearnedFunction(f.candidate, f.std) for f in found.functions]
        return Unknowns(
            self.campaign.robot, tuple(effects), found.small, tuple(functions),
            self.columns.sensitivities if functions else None,
        )  # fmt: skip

    @property
    def _alone(self) -> bool:
        """Whether the best model contains exactly one effect or function."""
        found = self.selected
        device = self.campaign.registration == "unknown"
        return len(found.hypotheses) - device + len(found.functions) == 1

    def rivals(self) -> list[Unknowns]:
        """Return up to three machines with other effects, most probable first."""
        states = self.selected.states
        own = frozenset(e.name for e in states[0].elements if e.name)
        found: dict[frozenset[str], Unknowns] = {}
        for state in states[1:]:
            other = frozenset(e.name for e in state.elements if e.name)
            if own <= other or other <= own or other in found or len(found) == _RIVALS:
                continue
            elements = [(k, e) for k, e in enumerate(state.elements) if e.name]
            effects = [
                one
                for k, e in elements
                for one in _acting(
                    e.hypothesis, e.values(state.sizes.mean[state.own(k)])
                )
            ]
            device = [e for e in self.unknowns.effects if e.device]
            found[other] = replace(
                self.unknowns, effects=(*device, *effects), functions=()
            )
        return list(found.values())

    def _device_frames(self, hypothesis: Hypothesis) -> list[Acting]:
        """Return the estimated pose of the device for each session."""
        base = np.broadcast_to(self.conditions.base, (len(self.campaign), 6))
        own = {}
        for session in self.campaign.sessions or (None,):
            row = 0
            if session is not None:
                row = int(np.flatnonzero(self.campaign.session == session)[0])
            own[session] = base[row]
        return [Acting(hypothesis, start, s, True) for s, start in own.items()]


def _acting(hypothesis: Hypothesis, values: NDArray) -> list[Acting]:
    """Return the effects of a hypothesis, one for each session."""
    own = [(in_one_session(hypothesis, s), s) for s in sessions_of(hypothesis)]
    return [Acting(there, values[places], s) for (there, places), s in own]


def trace(
    campaign: Campaign, fitted: NDArray, declared: Declared, update: Update, *,
    odds: Mapping[str, float] = MappingProxyType({}),
) -> tuple[Traced, MachineFit]:  # fmt: skip
    """Search for the effects and functions that are missing in a declared model.

    Args:
        campaign: campaign of R rows.
        fitted: (R,) mask of the rows to which models are fitted.
        declared: declared model of all rows.
        update: function called with the name of the step, the number of finished parts,
            and the number of all parts.
        odds: factors on the prior odds of effects and functions, see
            :class:`.columns.Columns`.

    Returns:
        The search result, and the machine fitted with the identified effects.

    Raises:
        BadInput: the pose of the measuring frame is unknown, and the readings do not
            determine it.
    """
    fitted = fitted & ~impossible_rows(campaign) & campaign.cells.any(axis=1)
    if campaign.registration == "unknown":
        registered = register(campaign.take(fitted), declared.conditions)
        derivatives = Derivatives(at_rest(registered))
    else:
        derivatives = declared.derivatives
    sample = hidden(campaign, ~_searched_rows(campaign, fitted))
    derivatives = _with_its_errors(sample, declared, derivatives, fitted)
    conditions = derivatives.conditions
    columns = Columns(sample, derivatives, update, odds)
    blunders, bends = np.zeros(len(campaign), dtype=bool), 0
    seen = hidden(campaign, ~fitted)
    for turn in range(_TURNS):
        good = fitted & ~blunders
        cells = good[columns.row]
        z = whiten(sample, sample.measured - predict(conditions).deviation)
        cells &= np.isfinite(z)
        selected = _searched(columns, z[cells], cells, update)
        traced = _traced(campaign, conditions, good, cells, selected, columns)
        traced = replace(traced, outliers=traced.outliers | blunders)
        fit = _fitted(traced)
        gross = _gross(campaign, fit, traced.used)
        few = OUTLIERS * (gross | blunders).sum() <= fitted.sum()
        if gross.any() and few and turn < _TURNS - 1:
            blunders = blunders | gross
            continue
        bent = declared.bent(seen, conditions, _errors(fit), _BENT)
        if bent is None or bends == _BENDS:
            break
        conditions, bends = bent, bends + 1
    return _without_outlying(traced, fit)


def _searched_rows(campaign: Campaign, fitted: NDArray) -> NDArray:
    """Return a mask (R,) of the rows for model selection, at most 2000 rows."""
    chosen = np.zeros(len(campaign), dtype=bool)
    chosen[fitted] = drawn(campaign.measured_at_once[fitted], _SEARCHED)
    return chosen


def _without_outlying(traced: Traced, fit: MachineFit) -> tuple[Traced, MachineFit]:
    """Find outliers in the remaining rows, and refit the machine without them."""
    others = traced.used & ~np.isin(np.arange(len(traced.used)), traced.columns.row)
    if not others.any():
        return traced, fit
    some = traced.campaign.take(others)
    left = whiten(some, residual_of(traced.campaign, fit.robot)[others])
    far = np.zeros(len(traced.used), dtype=bool)
    far[others] = outlying(some, np.nan_to_num(left))
    used = traced.used & ~far
    traced = replace(traced, used=used, outliers=traced.outliers | far)
    return traced, fit_machine(traced.campaign, fit.unknowns, used, fit.x)


def _with_its_errors(
    campaign: Campaign, declared: Declared, derivatives: Derivatives, fitted: NDArray
) -> Derivatives:
    """Return the derivatives, including second-order terms of geometric errors."""
    conditions, seen = derivatives.conditions, hidden(campaign, ~fitted)
    alone = dict.fromkeys([*LIBRARY, FUNCTION], 0.0)
    columns = Columns(campaign, derivatives, odds=alone)
    cells = fitted[columns.row]
    for _ in range(_BENDS + 1):
        z = whiten(campaign, campaign.measured - predict(conditions).deviation)
        known = cells & np.isfinite(z)
        selected = select(columns, z[known], known, common=NONE)
        # A fit is slow, so the linear estimate of the geometric errors is tested first.
        near = selected.states[0].errors
        if declared.bent(seen, conditions, near, _BENT / 3) is None:
            break
        traced = _traced(campaign, conditions, fitted, known, selected, columns)
        fit = fit_machine(traced.campaign, traced.unknowns, traced.used)
        bent = declared.bent(seen, conditions, _errors(fit), _BENT)
        if bent is None:
            break
        conditions = bent
    same = conditions is derivatives.conditions
    return derivatives if same else Derivatives(conditions)


def _errors(fit: MachineFit) -> NDArray:
    """Return estimated minus declared geometric errors (n, 6) [rad, m]."""
    return np.asarray(fit.robot.errors - fit.unknowns.robot.errors)


def _gross(campaign: Campaign, fit: MachineFit, used: NDArray) -> NDArray:
    """Return a mask (R,) of the fitted rows with gross blunders."""
    left = residual_of(campaign, fit.robot) / campaign.sigma
    left = np.where(campaign.cells & used[:, None], left, 0.0)
    count = np.maximum((campaign.cells & used[:, None]).sum(axis=1), 1)
    rms = np.sqrt(np.nan_to_num(left**2).sum(axis=1) / count)
    return np.asarray(rms > _GROSS * max(float(np.median(rms[used])), 1.0))


def _searched(columns: Columns, z: NDArray, cells: NDArray, update: Update) -> Selected:
    """Select a model; functions of time must clearly improve predictions."""
    # A function of time can describe every slow change. It is therefore accepted only
    # if it clearly improves predictions. If there are no candidates, common noise is
    # not estimated, because it would include the change due to absent effects.
    whole = select(columns, z, cells, update, None if columns.candidates else NONE)
    if not columns.has_clocks:
        return whole
    common = whole.states[0].readings.common  # both models must use the same noise
    timeless = select(columns.without_clocks(), z, cells, update, common)
    blocks = columns.block[cells]
    sure = prediction_gain(whole.states[0], timeless.states[0], blocks)
    return whole if sure > _CLEARLY else timeless


def _traced(
    campaign: Campaign, conditions: Conditions, fitted: NDArray, cells: NDArray,
    selected: Selected, columns: Columns,
) -> Traced:  # fmt: skip
    """Return the search result, including the estimated noise and outliers."""
    weights = np.ones(len(columns.row))
    weights[cells] = cell_weights(selected.weights)
    sigma = campaign.sigma.copy()
    sigma[campaign.cells] *= selected.noise.tau
    sigma[columns.campaign.cells] /= np.sqrt(weights)
    common = None
    if any(selected.noise.common):
        common = columns.motions * np.repeat(selected.noise.common, 3)
    good = np.ones(len(columns.row))
    good[cells] = selected.weights
    # A blunder in one reading excludes the whole row.
    blunders = np.bincount(columns.row, good < 0.5, minlength=len(campaign))
    outliers = (blunders > 0) | impossible_rows(campaign)
    return Traced(
        campaign=replace(campaign, sigma=sigma, common=common),
        conditions=conditions,
        used=fitted & ~outliers,
        outliers=outliers,
        selected=selected,
        columns=columns,
    )


def _fitted(traced: Traced) -> MachineFit:
    """Return the fitted machine without effects that the readings do not support."""
    fit = fit_machine(traced.campaign, traced.unknowns, traced.used)
    while True:
        weak = [one for one in fit.unknowns.effects if not supported(fit, one)]
        if not weak:
            return fit
        # Effects are removed one by one, because if two effects are similar, both have
        # a large uncertainty.

        one = min(weak, key=lambda e: _size(fit, e))
        fit = fit_machine(traced.campaign, fit.unknowns.without(one), traced.used)


def _size(fit: MachineFit, one: Acting) -> float:
    """Return the sum of squared changes [sigma^2] of the readings by an effect."""
    x, _, slopes = fit.own(one)
    return float(np.sum((slopes @ x) ** 2))
