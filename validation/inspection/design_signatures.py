"""Compute how library effects change the readings of a campaign."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.effects.registration import BASE
from forcefit.inputs.table import BadInput
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.derivatives import Derivatives
from forcefit.validation.diagnosis.hypotheses import Hypothesis, hypotheses
from forcefit.validation.diagnosis.registration import register
from forcefit.validation.diagnosis.signatures import (
    Tangents,
    conditions_of,
    loaded_components,
)
from forcefit.validation.inspection.repeats import slow_changes

# Finite motions are omitted, because their computation is slow.
_NOT_COMPARED = tuple(name for name, effect in LIBRARY.items() if effect.finite)


@dataclass(frozen=True, eq=False)
class DesignSignatures:
    """Changes of the readings due to plausible effects, divided by sigma.

    Attributes:
        columns: mapping from each effect to the changes (N, k) due to its k unknowns.
        nuisance: (N, p) changes due to an unknown pose of the measuring device.
        untestable: mapping from each effect that cannot be tested to the reason.
        unregistered: reason why the pose of the device cannot be estimated, otherwise
            empty.
    """

    columns: dict[str, NDArray]
    nuisance: NDArray
    untestable: dict[str, str]
    unregistered: str


def design_signatures(
    campaign: Campaign, progress: Callable[[int, int], None] = lambda done, total: None
) -> DesignSignatures:
    """Return the signatures of all library effects for a campaign.

    Signatures are expressed in the axes of the measuring device.  An unknown pose of
    the device is therefore estimated first.  If this is impossible, base axes are used.

    Args:
        campaign: campaign with N readings.
        progress: function called with the number of finished effects and the total
            number.
    """
    conditions, unregistered = conditions_of(campaign), ""
    if campaign.registration == "unknown":
        try:
            conditions = register(campaign, conditions)
        except BadInput as error:
            unregistered = str(error)
    tangents = Tangents(campaign, Derivatives(conditions))
    shown = _one_each(hypotheses(conditions, loaded_components(campaign)))
    columns, untestable = {}, {}
    for done, name in enumerate(LIBRARY):
        progress(done, len(LIBRARY))
        if name in _NOT_COMPARED:
            untestable[name] = "only a diagnosis tests finite motions"
        elif name not in shown:
            needs = LIBRARY[name].needs
            lacking = [f"cov.{n}" for n in needs if not _given(campaign, n)]
            if LIBRARY[name].weighs and not conditions.gravity.any():
                lacking.append("cov.gravity.z")
            untestable[name] = (
                f"requires {', '.join(lacking)}, not 0 in all rows"
                if lacking
                else "the robot has no frame on which this effect acts"
            )
        else:
            column = _at_plausible_sizes(tangents, shown[name])
            if np.isfinite(column).all():
                columns[name] = column
            else:
                untestable[name] = "the model has no solution in some rows"
    progress(len(LIBRARY), len(LIBRARY))
    nuisance = np.zeros((int(campaign.cells.sum()), 0))
    if campaign.registration == "unknown":
        names = [n for slot in shown["registration"].slots for n in slot.names]
        base = [k for k, n in enumerate(names) if n in BASE]
        nuisance = columns["registration"][:, base]
        columns["registration"] = np.delete(columns["registration"], base, axis=1)
    return DesignSignatures(columns, nuisance, untestable, unregistered)


def changes_between_repeats(
    campaign: Campaign, signatures: DesignSignatures
) -> dict[str, NDArray]:
    """Return the changes that can occur between repeated measurements.

    Args:
        campaign: campaign with N readings.
        signatures: signatures of the library effects for the campaign.

    Returns:
        Mapping from the name of each change to its design matrix.  The changes are
        those of :func:`forcefit.validation.inspection.repeats.slow_changes`, thermal
        expansion and friction.
    """
    slow = slow_changes(campaign)
    acts = {"temperature": "thermal_expansion", "approach": "friction_hysteresis"}
    for covariate, effect in acts.items():
        if covariate in slow and effect in signatures.columns:
            slow[covariate] = np.hstack([slow[covariate], signatures.columns[effect]])
    return slow


def _one_each(every: list[Hypothesis]) -> dict[str, Hypothesis]:
    """Return one hypothesis for each effect.

    If several hypotheses have the most parameters, the middle one of these is selected.
    """
    hypotheses: dict[str, Hypothesis] = {}
    for name in dict.fromkeys(h.effect for h in every):
        of = [h for h in every if h.effect == name]
        most = max(len(h.slots) for h in of)
        full = [h for h in of if len(h.slots) == most]
        if LIBRARY[name].clearance:
            wide = max(len(h.where) for h in of)
            alike = [h for h in of if len(h.where) == wide]
            full = [min(alike, key=lambda h: len(h.slots))]
        hypotheses[name] = full[len(full) // 2]
    return hypotheses


def _at_plausible_sizes(tangents: Tangents, hypothesis: Hypothesis) -> NDArray:
    """Return the changes (N, k) caused by a plausible value of each unknown."""
    effect = LIBRARY[hypothesis.effect]
    shapes = {n: s.start for s in hypothesis.slots if s.shape for n in s.names}
    rest = {
        n: 0.0
        for s in hypothesis.slots
        if not s.shape and s.start == 0.0
        for n in s.names
    }
    columns = []
    for slot in hypothesis.slots:
        if not slot.shape:
            scale = slot.unknown.scale
            size = slot.start + scale if effect.linear else scale
            values = {**rest, **shapes, **dict.fromkeys(slot.names, size)}
            public = effect.public(tangents.derivatives.conditions.robot, values)
            columns.append(tangents.model({effect.name: public}) - tangents.declared)
    return np.column_stack(columns)


def _given(campaign: Campaign, covariate: str) -> bool:
    """Return whether a covariate is recorded and nonzero in at least one row."""
    return bool(np.any(campaign.covariates.get(covariate, 0.0)))
