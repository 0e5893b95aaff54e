"""The sequence of models that leads to a fitted robot, each judged on held-out rows.

Models in the order in which a machine is understood: as declared, where the device
stands, geometric errors, springs, effects of the library, learned functions.  Each has
the unknowns of those before it and is fitted as a whole; the last is the fitted robot.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.effects import LIBRARY
from validation.campaign.campaign import Campaign
from validation.diagnosis.fit import MachineFit, fit_machine
from validation.diagnosis.prediction import residual_of
from validation.diagnosis.small_terms import GEOMETRY, SPRINGS
from validation.diagnosis.unknowns import Unknowns

DECLARED, REGISTRATION = "declared", "registration"
LIBRARY_EFFECTS, LEARNED = "library effects", "learned effects"


@dataclass(frozen=True)
class Errors:
    """Root mean squares over some rows.

    Attributes:
        position: [m] of the components measured.
        rotation: [rad] likewise.
        normalised: [-] of residual over sigma.
    """

    position: float
    rotation: float
    normalised: float


def errors_of(campaign: Campaign, residual: NDArray, rows: NDArray) -> Errors:
    """Root mean squares of a residual.

    Args:
        campaign: of R rows.
        residual: (R, 6) [rad, m].
        rows: mask (R,).

    Returns:
        Over the measured cells of those rows; NaN where nothing was measured.
    """
    z = np.where(campaign.cells, residual, np.nan)[rows]

    def rms(values: NDArray) -> float:
        known = values[np.isfinite(values)]
        return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")

    return Errors(rms(z[:, 3:]), rms(z[:, :3]), rms(z / campaign.sigma[rows]))


@dataclass(frozen=True)
class Step:
    """A model of the sequence and its errors.

    Attributes:
        term: what it adds: ``"declared"``, ``"registration"``, ``"geometry"``,
            ``"springs"``, ``"library effects"`` or, for each function, ``"learned
            effects"``.
        unknowns: [-] numbers added; of many with a prior, how many the readings say.
        error: on the rows held out.
    """

    term: str
    unknowns: float
    error: Errors


@dataclass(frozen=True, eq=False)
class Stage:
    """A model of the sequence on the rows of one fold.

    Attributes:
        term: what it adds.
        unknowns: as in :class:`Step`.
        residual: (R, 6) [rad, m] of the fold's rows, NaN elsewhere.
    """

    term: str
    unknowns: float
    residual: NDArray


def stages(
    campaign: Campaign, fit: MachineFit, rows: NDArray, held: NDArray
) -> list[Stage]:
    """Fit the models that lead to a fitted robot; judge each on held-out rows.

    Args:
        campaign: of R rows.
        fit: where the sequence ends.
        rows: (R,) bool, rows that were fitted.
        held: (R,) bool, rows that judge.

    Returns:
        One for each step that the fitted robot has; the last is ``fit`` itself.
    """
    every = _models(fit.unknowns, campaign)
    found = [(every[0][0], MachineFit(every[0][1], *_nothing()))]
    for term, unknowns in every[1:]:
        last = len(unknowns) == len(fit.unknowns)
        start = _start(unknowns, fit)
        fitted = fit if last else fit_machine(campaign, unknowns, rows, start)
        found.append((term, fitted))
    shown, known = [], 0.0
    finite = _has_finite_motions(fit.unknowns)
    for term, one in found:
        residual = np.full(campaign.measured.shape, np.nan)
        linear = finite and not _has_finite_motions(one.unknowns)
        residual[held] = residual_of(campaign, one.robot, linear=linear)[held]
        told = float(one.determined.sum())
        shown.append(Stage(term, max(0.0, told - known), residual))
        known = told
    return shown


def _has_finite_motions(unknowns: Unknowns) -> bool:
    """Whether finite motions are among the effects that are added."""
    return any(LIBRARY[one.hypothesis.effect].finite for one in unknowns.effects)


def _nothing() -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """x, covariance, slopes and residual of a model without unknowns."""
    return np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0)


def _models(unknowns: Unknowns, campaign: Campaign) -> list[tuple[str, Unknowns]]:
    """Terms and unknowns of the models up to a robot's; steps it lacks left out."""
    nothing = replace(unknowns, effects=(), small=(), functions=())
    device = tuple(one for one in unknowns.effects if one.device)
    models = [(DECLARED, nothing)]
    now = nothing
    if device:
        now = replace(now, effects=device)
        models.append((REGISTRATION, now))
    for name in (GEOMETRY, SPRINGS):
        own = tuple(part for part in unknowns.small if part.name == name)
        if own:
            now = replace(now, small=(*now.small, *own))
            models.append((name, now))
    if len(device) < len(unknowns.effects):
        now = replace(now, effects=unknowns.effects)
        models.append((LIBRARY_EFFECTS, now))
    for k in range(len(unknowns.functions)):
        now = replace(now, functions=unknowns.functions[: k + 1])
        models.append((LEARNED, now))
    return models


def _start(unknowns: Unknowns, fit: MachineFit) -> NDArray:
    """(k,) where a smaller model begins: the fitted robot's effects, else the mean."""
    start = unknowns.mean
    places = zip(fit.unknowns.parts, fit.unknowns.slices, strict=True)
    values = {id(part): fit.x[own] for part, own in places}
    for part, own in zip(unknowns.parts, unknowns.slices, strict=True):
        if part in unknowns.effects:
            start[own] = values[id(part)]
    return start


def pooled(campaign: Campaign, folds: list[list[Stage]], rows: NDArray) -> list[Step]:
    """The sequence judged on the rows of all folds together.

    Args:
        campaign: of R rows.
        folds: stages of each fold; a fold without a step has the one before it there.
        rows: (R,) bool, rows that are counted.

    Returns:
        The steps, in order; the last is the error of the diagnosis.
    """
    order = _steps_of(folds)
    steps = []
    for k, term in order:
        residual = np.full(campaign.measured.shape, np.nan)
        unknowns = []
        for fold in folds:
            last, own = fold[0], 0
            for stage in fold:
                own = own + 1 if stage.term == LEARNED else own
                if _place(stage.term, own) > _place(term, k):
                    break
                last = stage
            same = last.term == term
            unknowns.append(last.unknowns if same else 0.0)
            residual = np.where(np.isnan(last.residual), residual, last.residual)
        error = errors_of(campaign, residual, rows)
        steps.append(Step(term, float(np.mean(unknowns)), error))
    return steps


_ORDER = (DECLARED, REGISTRATION, GEOMETRY, SPRINGS, LIBRARY_EFFECTS, LEARNED)


def _place(term: str, function: int) -> tuple[int, int]:
    """Where a step is in the sequence; functions by their number."""
    return _ORDER.index(term), function if term == LEARNED else 0


def _steps_of(folds: list[list[Stage]]) -> list[tuple[int, str]]:
    """Number (of functions) and term of every step that any fold has."""
    places = set()
    for fold in folds:
        own = 0
        for stage in fold:
            own = own + 1 if stage.term == LEARNED else own
            places.add(_place(stage.term, own))
    return [(function, _ORDER[index]) for index, function in sorted(places)]
