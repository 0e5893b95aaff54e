"""Signatures: how each hypothesis would show in the readings, to first order.

======  =============  =========  ================================================
symbol  code           shape      meaning
======  =============  =========  ================================================
z       ``residual``   (N,)       (reading - model) / sigma, measured cells only
A       ``columns``    (N, k)     change of the model per unknown, / sigma
o       ``offset``     (N,)       change of the model that no unknown scales
======  =============  =========  ================================================
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.conditions import Conditions, as_declared
from assembly.effects import apply_effects
from assembly.posture import Posture
from assembly.predict import predict
from validation.campaign import LOAD, Campaign
from validation.diagnosis.hypotheses import Hypothesis

_STEP = 1e-3  # of an unknown's plausible size, for its first derivative


@dataclass(frozen=True, eq=False)
class Signature:
    """What one hypothesis adds to the model, in units of sigma.

    Attributes:
        hypothesis: whose.
        offset: (N,) at unknowns zero, on the tangent.
        columns: (N, k) per unknown.
    """

    hypothesis: Hypothesis
    offset: NDArray
    columns: NDArray


def conditions_of(campaign: Campaign) -> Conditions:
    """The situations of a campaign, as its robot's file declares the machine.

    Args:
        campaign: of R rows.

    Returns:
        R conditions.  Covariates ``gravity.x``, ``.y``, ``.z`` [m/s^2], where given,
        are the weight's known direction in each row.
    """
    known = campaign.covariates
    gravity = np.zeros((len(campaign), 3))
    for k, axis in enumerate("xyz"):
        gravity[:, k] = known.get(f"gravity.{axis}", 0.0)
    worst = float(np.max(campaign.mismatch, initial=0.0))
    return as_declared(
        Posture(campaign.robot, campaign.coordinates, campaign.transforms, worst),
        campaign.loads,
        mismatch=campaign.mismatch,
        point=campaign.reference_point,
        gravity=gravity,
        temperature=known.get("temperature", np.nan),
        time=known.get("time", np.nan),
        approach=known.get("approach", np.nan),
    )


def loaded_components(campaign: Campaign) -> list[str]:
    """Components of the load that are not zero in every row."""
    return [name for name, w in zip(LOAD, campaign.loads.T, strict=True) if w.any()]


def whiten(campaign: Campaign, deviation: NDArray) -> NDArray:
    """(N,) deviations (R, 6) of the measured cells in units of their sigma."""
    cells = campaign.cells
    return deviation[cells] / campaign.sigma[cells]


def signature(
    campaign: Campaign, here: Conditions, declared: NDArray, hypothesis: Hypothesis,
    x: NDArray | None = None,
) -> Signature | None:  # fmt: skip
    """A hypothesis to first order about some values of its unknowns.

    Args:
        campaign: of R rows, N measured cells.
        here: its conditions as declared.
        declared: (N,) what they predict, whitened.
        hypothesis: which.
        x: (k,) where the tangent is taken; the hypothesis's start if absent.

    Returns:
        The tangent, None if the model has no answer there.
    """
    x = hypothesis.start if x is None else np.asarray(x, dtype=float)
    robot = here.robot

    def model(values: NDArray) -> NDArray:
        effects = {hypothesis.effect: hypothesis.public(robot, values)}
        return whiten(campaign, predict(apply_effects(here, effects)).deviation)

    middle = model(x)
    if not np.isfinite(middle).all():
        return None
    columns = np.zeros((len(middle), len(x)))
    for k, slot in enumerate(hypothesis.slots):
        if slot.shape:
            continue
        step = _STEP * slot.unknown.scale
        there = x.copy()
        there[k] += step
        columns[:, k] = (model(there) - middle) / step
        if not np.isfinite(columns[:, k]).all():
            return None
    tangent = np.where([s.shape for s in hypothesis.slots], 0.0, x)
    return Signature(hypothesis, middle - declared - columns @ tangent, columns)
