"""Which measurement would decide between two explanations.

Where explanation A is true, explanation B fitted to the same readings misses a further
measurement by d, known up to the covariance J C J' of what B could still adapt.  The
measurement with the greatest non-centrality

    d' (I + J C J')^-1 d     (whitened)

tells them apart best; the smaller of that of A against B and of B against A counts.

Sources:
    Atkinson, Fedorov (1975), The design of experiments for discriminating between two
    rival models, Biometrika 62, 57.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.conditions import Conditions
from assembly.effects import apply_effects
from assembly.predict import predict
from validation.campaign.campaign import LOAD, Campaign
from validation.diagnosis.refit import Fit

_TRIED = 240  # situations looked at
_FURTHER = 1.5  # of the range of loads and covariates used so far
_STEP = 1e-3
_AS_GOOD = 0.97


@dataclass(frozen=True)
class NextMeasurement:
    """A measurement that would decide.

    Attributes:
        why: in words.
        configuration: commanded coordinates or pose by column name.
        load: (6,) [N m, N] at the reference point, base axes.
        covariates: such as a temperature to be reached.
        power: [-] non-centrality of one such reading; 10 decides nearly always.
    """

    why: str
    configuration: dict[str, float]
    load: tuple[float, ...]
    covariates: dict[str, float]
    power: float


def next_measurement(
    campaign: Campaign, here: Conditions, rivals: Sequence[Fit]
) -> NextMeasurement | None:
    """The measurement that would decide between two fits.

    Looked for over the configurations measured so far (they can be reached), with loads
    and covariates within half as much again of their ranges.

    Args:
        campaign: what was measured.
        here: its conditions, as declared and registered.
        rivals: two explanations, fitted.

    Returns:
        The measurement, None if none of those tried tells them apart.
    """
    there = _situations(here)
    sigma = np.nanmedian(campaign.sigma, axis=0)
    models = [_model(there, fit, sigma) for fit in rivals[:2]]
    if any(not np.isfinite(m[0]).all() for m in models):
        return None
    (a, Ja), (b, Jb) = models
    powers = np.minimum(
        _power(a - b, Jb, rivals[1].covariance), _power(b - a, Ja, rivals[0].covariance)
    )
    # among situations as good as the best, the one that asks for the least load
    good = powers >= _AS_GOOD * powers.max()
    size = np.abs(there.load).sum(axis=1)
    best = int(np.argmin(np.where(good, size, np.inf)))
    if powers[best] < 1.0:
        return None
    names = [" + ".join(sorted(fit.effects)) for fit in rivals[:2]]
    covariates = {
        name: float(getattr(there, name)[best])
        for name in ("temperature", "approach")
        if np.isfinite(getattr(there, name)[best])
    }
    why = (
        f"{names[0]} and {names[1]} then differ by {np.sqrt(powers[best]):.1f} "
        "standard deviations in one reading"
    )
    return NextMeasurement(
        why, _configuration(campaign, there, best),
        tuple(there.load[best].tolist()), covariates, float(powers[best]),
    )  # fmt: skip


def _situations(here: Conditions) -> Conditions:
    """Situations to choose from: reached configurations, wider loads and covariates."""
    rng = np.random.default_rng(0)
    rows = rng.integers(0, len(here), _TRIED)
    there = here.take(rows)
    largest = np.abs(here.load).max(axis=0)
    corner = rng.choice([-1.0, 0.0, 1.0], (_TRIED, 6))
    temperature = there.temperature
    if np.isfinite(temperature).all():
        low, high = here.temperature.min(), here.temperature.max()
        # a campaign at one temperature: ten kelvin are within reach of a workshop
        span = max(_FURTHER * (high - low), 10.0)
        temperature = rng.choice([low, (low + high) / 2, low + span], _TRIED)
    approach = there.approach
    if np.isfinite(approach).all():
        approach = rng.choice([-1.0, 1.0], _TRIED)
    return replace(
        there,
        load=_FURTHER * corner * largest,
        temperature=temperature,
        approach=approach,
    )


def _model(there: Conditions, fit: Fit, sigma: NDArray) -> tuple[NDArray, NDArray]:
    """(S, 6) whitened predictions of a fit, and (S, 6, k) their derivatives."""

    def read(values: NDArray) -> NDArray:
        return predict(apply_effects(there, fit.at(values))).deviation / sigma

    middle = read(fit.values)
    J = np.zeros((*middle.shape, len(fit.values)))
    deviation = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    for k, size in enumerate(deviation):
        moved = fit.values.copy()
        moved[k] += _STEP * size
        if size > 0:
            J[:, :, k] = (read(moved) - middle) / (_STEP * size)
    known = np.isfinite(sigma)
    return middle[:, known], J[:, known]


def _power(d: NDArray, J: NDArray, C: NDArray) -> NDArray:
    """(S,) non-centrality of missing by d with J C J' still open."""
    S = np.eye(d.shape[1]) + np.einsum("sik,kl,sjl->sij", J, C, J)
    return np.einsum("si,si->s", d, np.linalg.solve(S, d[..., None])[..., 0])


def _configuration(campaign: Campaign, there: Conditions, row: int) -> dict[str, float]:
    """A situation's command, by the columns of the campaign."""
    if campaign.commanded == "joints":
        return {
            f"q.{frame.name}": float(there.coordinates[row, i])
            for i, frame in enumerate(campaign.robot.frames)
            if frame.actuated
        }
    pose = there.take([row]).postures.platform[0]
    from assembly.posture import POSE, pose_components

    return {
        f"pose.{name}": float(v)
        for name, v in zip(POSE, pose_components(pose), strict=True)
    }


def load_text(load: Sequence[float]) -> str:
    """A load as on the command line."""
    parts = [f"{name}={w:g}" for name, w in zip(LOAD, load, strict=True) if w]
    return ",".join(parts) or "none"
