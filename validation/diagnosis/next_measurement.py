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

from assembly.effects import apply_effects
from assembly.kinematics.posture import POSE, place_many_joints, pose_components
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict
from validation.campaign.campaign import LOAD, Campaign
from validation.diagnosis.refit import Fit

_TRIED = 240  # conditions looked at
_FURTHER = 1.5  # of the range of loads and covariates used so far
_STEP = 1e-3
_AS_GOOD = 0.97
_DECIDES = 1.0  # [-] least non-centrality worth a measurement


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
    campaign: Campaign, conditions: Conditions, fit: Fit, rivals: Sequence[Fit]
) -> NextMeasurement | None:
    """The measurement that would decide between a fit and its likeliest rival.

    Looked for over the configurations measured so far and others between any two of
    them that the robot can reach, with loads and covariates within half as much again
    of their ranges.  A rival that nothing tells from the fit (a longer bar and a turned
    encoder may be the same) leaves the question to the next.

    Args:
        campaign: what was measured.
        conditions: its conditions, as declared and registered.
        fit: the best explanation.
        rivals: others, likeliest first.

    Returns:
        The measurement, None if none of those tried tells any rival from the fit.
    """
    tried = _conditions_tried(conditions)
    sigma = np.nanmedian(campaign.sigma, axis=0)
    size = np.abs(tried.load).sum(axis=1)
    a, Ja = _model(tried, fit, sigma)
    for rival in rivals:
        b, Jb = _model(tried, rival, sigma)
        powers = np.minimum(
            _power(a - b, Jb, rival.covariance), _power(b - a, Ja, fit.covariance)
        )
        powers = np.where(np.isfinite(powers), powers, 0.0)
        # among conditions as good as the best, the one that asks for the least load
        good = powers >= _AS_GOOD * powers.max()
        best = int(np.argmin(np.where(good, size, np.inf)))
        if powers[best] >= _DECIDES:
            return _measurement(campaign, tried, best, float(powers[best]), fit, rival)
    return None


def _measurement(
    campaign: Campaign, tried: Conditions, best: int, power: float, fit: Fit, rival: Fit
) -> NextMeasurement:
    """One of the conditions tried, in words and numbers."""
    names = [" + ".join(sorted(one.effects)) for one in (fit, rival)]
    covariates = {
        name: float(getattr(tried, name)[best])
        for name in ("temperature", "approach")
        if np.isfinite(getattr(tried, name)[best])
    }
    why = (
        f"{names[0]} and {names[1]} then differ by {np.sqrt(power):.1f} "
        "standard deviations in one reading"
    )
    return NextMeasurement(
        why, _configuration(campaign, tried, best),
        tuple(tried.load[best].tolist()), covariates, power,
    )  # fmt: skip


def _conditions_tried(conditions: Conditions) -> Conditions:
    """Conditions to choose from: within reach, loads and covariates wider."""
    rng = np.random.default_rng(0)
    tried = _between(conditions.take(rng.integers(0, len(conditions), _TRIED)), rng)
    largest = np.abs(conditions.load).max(axis=0)
    corner = rng.choice([-1.0, 0.0, 1.0], (_TRIED, 6))
    temperature = tried.temperature
    if np.isfinite(temperature).all():
        low, high = conditions.temperature.min(), conditions.temperature.max()
        # a campaign at one temperature: ten kelvin are within reach of a workshop
        span = max(_FURTHER * (high - low), 10.0)
        temperature = rng.choice([low, (low + high) / 2, low + span], _TRIED)
    approach = tried.approach
    if np.isfinite(approach).all():
        approach = rng.choice([-1.0, 1.0], _TRIED)
    return replace(
        tried,
        load=_FURTHER * corner * largest,
        temperature=temperature,
        approach=approach,
    )


def _between(measured: Conditions, rng: np.random.Generator) -> Conditions:
    """Half of the configurations moved towards others, where the robot can follow."""
    if measured.rest is not None:  # it is known for measured configurations only
        return measured
    actuated = np.array([frame.actuated for frame in measured.robot.frames])
    q = np.where(actuated, measured.coordinates, np.nan)
    count = len(measured) // 2
    part = rng.uniform(0.0, 1.0, (count, 1))
    q[:count] += part * (q[-count:] - q[:count])
    postures, _ = place_many_joints(measured.robot, q[:count])
    coordinates, transforms = measured.coordinates.copy(), measured.transforms.copy()
    for i, posture in enumerate(postures):
        if posture is not None:
            coordinates[i], transforms[i] = posture.coordinates, posture.transforms
    # second orders of the declared errors are in both models, and not known elsewhere
    return replace(
        measured, coordinates=coordinates, transforms=transforms, second_order=0.0
    )


def _model(tried: Conditions, fit: Fit, sigma: NDArray) -> tuple[NDArray, NDArray]:
    """(S, 6) whitened predictions of a fit, and (S, 6, k) their derivatives."""

    def read(values: NDArray, finite: bool) -> NDArray:
        conditions = apply_effects(tried, fit.at(values))
        return predict(replace(conditions, exact=finite)).deviation / sigma

    model = read(fit.values, fit.conditions.exact)
    # finite motions hardly change the slopes, and take a hundred times longer
    middle = read(fit.values, False) if fit.conditions.exact else model
    J = np.zeros((*middle.shape, len(fit.values)))
    deviation = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    for k, size in enumerate(deviation):
        moved = fit.values.copy()
        moved[k] += _STEP * size
        if size > 0:
            J[:, :, k] = (read(moved, False) - middle) / (_STEP * size)
    known = np.isfinite(sigma)
    return model[:, known], J[:, known]


def _power(d: NDArray, J: NDArray, C: NDArray) -> NDArray:
    """(S,) non-centrality of missing by d with J C J' still open."""
    S = np.eye(d.shape[1]) + np.einsum("sik,kl,sjl->sij", J, C, J)
    return np.einsum("si,si->s", d, np.linalg.solve(S, d[..., None])[..., 0])


def _configuration(campaign: Campaign, tried: Conditions, row: int) -> dict[str, float]:
    """The command of some conditions, by the columns of the campaign."""
    if campaign.commanded == "joints":
        return {
            f"q.{frame.name}": float(tried.coordinates[row, i])
            for i, frame in enumerate(campaign.robot.frames)
            if frame.actuated
        }
    pose = tried.take([row]).postures.platform[0]
    return {
        f"pose.{name}": float(v)
        for name, v in zip(POSE, pose_components(pose), strict=True)
    }


def load_text(load: Sequence[float]) -> str:
    """A load as on the command line."""
    parts = [f"{name}={w:g}" for name, w in zip(LOAD, load, strict=True) if w]
    return ",".join(parts) or "none"
