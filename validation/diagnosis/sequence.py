"""Test a sequence of models, from the declared to the fitted robot.

The unknowns are added in this order: device pose, geometric errors, springs, library
effects, learned functions.  All unknowns of each model are fitted together, and the
errors are computed on held-out rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.fit import MachineFit, fit_machine
from forcefit.validation.diagnosis.nuisance import GEOMETRY, SPRINGS
from forcefit.validation.diagnosis.prediction import residual_of
from forcefit.validation.diagnosis.unknowns import Unknowns

LEARNED = "learned effects"
_TERMS = (
    "declared", "registration", GEOMETRY, SPRINGS, "library effects", LEARNED,
)  # fmt: skip
# Indices in the list of the terms of the sequence.
_DECLARED, _REGISTRATION, _LIBRARY, _LEARNED = 0, 1, 4, 5
# A model in the sequence is identified by the index of its last term and its number of
# learned functions.
Place = tuple[int, int]


@dataclass(frozen=True)
class Errors:
    """Root-mean-square errors over selected rows.

    Attributes:
        position: [m] error of the measured translations.
        rotation: [rad] error of the measured rotations.
        normalised: [-] error of all measured components, divided by sigma.
    """

    position: float
    rotation: float
    normalised: float


def errors_of(
    campaign: Campaign, residual: NDArray, rows: NDArray | slice = slice(None)
) -> Errors:
    """Return the rms errors of a residual in selected rows.

    Args:
        campaign: campaign of R rows.
        residual: (R, 6) [rad, m] residual.
        rows: mask (R,) or slice of the selected rows.

    Returns:
        The errors, NaN if there are no residuals.
    """
    z = np.where(campaign.cells, residual, np.nan)[rows]
    return Errors(rms(z[:, 3:]), rms(z[:, :3]), rms(z / campaign.sigma[rows]))


def rms(values: NDArray) -> float:
    """Return the root mean square of the finite values, or NaN if there are none."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


@dataclass(frozen=True)
class Step:
    """A model of the sequence and its errors.

    Attributes:
        term: name of the added unknowns, which is ``"declared"``, ``"registration"``,
            ``"geometry"``, ``"springs"``, ``"library effects"`` or ``"learned
            effects"``.
        unknowns: [-] number of added unknowns that the readings determine.
        error: error on the held-out rows.
    """

    term: str
    unknowns: float
    error: Errors


def stages(
    campaign: Campaign, fit: MachineFit, rows: NDArray, held: NDArray
) -> dict[Place, tuple[float, NDArray]]:
    """Fit the models of the sequence and compute their residuals on held-out rows.

    Args:
        campaign: campaign of R rows.
        fit: the last model of the sequence.
        rows: (R,) mask of the fitted rows.
        held: (R,) mask of the held-out rows.

    Returns:
        Mapping from the position of each model in the sequence to two values: the
        number of added unknowns, and the residual (R, 6) [rad, m]. The residual is NaN
        in rows that are not held out.
    """
    shown, known = dict[Place, tuple[float, NDArray]](), 0.0
    finite = _has_finite_motions(fit.unknowns)
    for place, unknowns in _models(fit.unknowns).items():
        robot, told = unknowns.robot, 0.0
        if shown:
            one = fit
            if len(unknowns) != len(fit.unknowns):
                one = fit_machine(campaign, unknowns, rows, _start(unknowns, fit))
            robot, told, unknowns = one.robot, float(one.determined.sum()), one.unknowns
        residual = np.full(campaign.measured.shape, np.nan)
        linear = finite and not _has_finite_motions(unknowns)
        residual[held] = residual_of(campaign, robot, linear=linear)[held]
        shown[place] = max(0.0, told - known), residual
        known = told
    return shown


def _has_finite_motions(unknowns: Unknowns) -> bool:
    """Return whether the effects include finite motions."""
    return any(LIBRARY[one.hypothesis.effect].finite for one in unknowns.effects)


def _models(unknowns: Unknowns) -> dict[Place, Unknowns]:
    """Return the unknowns of each model in the sequence."""
    device = tuple(one for one in unknowns.effects if one.device)
    now = replace(unknowns, effects=(), small=(), functions=())
    models = {(_DECLARED, 0): now}
    if device:
        models[_REGISTRATION, 0] = now = replace(now, effects=device)
    for part in sorted(unknowns.small, key=lambda part: _TERMS.index(part.name)):
        now = replace(now, small=(*now.small, part))
        models[_TERMS.index(part.name), 0] = now
    if len(device) < len(unknowns.effects):
        models[_LIBRARY, 0] = now = replace(now, effects=unknowns.effects)
    for k in range(1, len(unknowns.functions) + 1):
        models[_LEARNED, k] = replace(now, functions=unknowns.functions[:k])
    return models


def _start(unknowns: Unknowns, fit: MachineFit) -> NDArray:
    """Return start values (k,) for the fit of a smaller model."""
    start = unknowns.mean
    for one in unknowns.effects:
        start[unknowns.place(one)] = fit.x[fit.unknowns.place(one)]
    return start


def pooled(
    campaign: Campaign, folds: list[dict[Place, tuple[float, NDArray]]], rows: NDArray
) -> list[Step]:
    """Return the models of the sequence with errors on the held-out rows of all folds.

    If a model is missing in a fold, the preceding model is used.
    """
    steps = []
    for place in sorted(set().union(*folds)):
        last = [max(own for own in fold if own <= place) for fold in folds]
        reached = [fold[own] for fold, own in zip(folds, last, strict=True)]
        unknowns = [
            added if own[0] == place[0] else 0.0
            for own, (added, _) in zip(last, reached, strict=True)
        ]
        error = errors_of(campaign, joined([left for _, left in reached]), rows)
        steps.append(Step(_TERMS[place[0]], float(np.mean(unknowns)), error))
    return steps


def joined(residuals: Sequence[NDArray]) -> NDArray:
    """Combine the residuals of one model in all folds, (R, 6) [rad, m]."""
    residual = residuals[0]
    for other in residuals[1:]:
        residual = np.where(np.isnan(other), residual, other)
    return residual
