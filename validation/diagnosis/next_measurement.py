"""Find the measurement that best discriminates between two candidate models.

Two models A and B were fitted to the same readings.  For an additional measurement, d
is the whitened difference between their predictions, and J C J' is the covariance of
the prediction of B.  If A is true, the best measurement has the largest non-centrality

    d' (I + J C J')^-1 d.

Because the true model is unknown, the smaller of the values for A and B is used.

Sources:
    Atkinson, Fedorov (1975), The design of experiments for discriminating between two
    rival models, Biometrika 62, 57.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY, apply_effects
from forcefit.assembly.kinematics.posture import (
    POSE,
    place_many_joints,
    pose_components,
)
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import predict
from forcefit.validation.campaign.campaign import LOAD, Campaign
from forcefit.validation.diagnosis.fit import MachineFit

_TRIED = 240  # number of compared measuring conditions
# Range of tested loads and temperatures, relative to the measured range.
_FURTHER = 1.5
# Step of numerical derivatives, relative to the standard deviation of a parameter.
_STEP = 1e-3
# Smallest accepted non-centrality, relative to the largest non-centrality.
_AS_GOOD = 0.97
_DECIDES = 1.0  # [-] smallest non-centrality of a useful measurement


@dataclass(frozen=True)
class NextMeasurement:
    """A measurement that discriminates between models.

    Attributes:
        why: the reason for the measurement as a sentence.
        configuration: mapping from column names to commanded coordinates or pose
            components.
        load: (6,) [N m, N] load at the reference point, base axes.
        covariates: temperature and direction of approach, if recorded.
        power: [-] non-centrality of one measurement.  With a value of 10, the
            measurement nearly always decides between the models.
    """

    why: str
    configuration: dict[str, float]
    load: tuple[float, ...]
    covariates: dict[str, float]
    power: float


def next_measurement(
    campaign: Campaign,
    conditions: Conditions,
    fit: MachineFit,
    rivals: Sequence[MachineFit],
) -> NextMeasurement | None:
    """Return the measurement that best discriminates between two models.

    A tested configuration is a measured configuration or lies between two measured
    configurations.  Loads and temperatures may exceed their measured ranges by half.
    If no measurement distinguishes a rival model from the best model, the next rival is
    tested.

    Args:
        campaign: the measurements.
        conditions: declared conditions of the campaign.
        fit: the best model.
        rivals: other models, most probable first.

    Returns:
        The measurement, or None if no tested measurement distinguishes the models.
    """
    tried = _conditions_tried(conditions)
    sigma = np.nanmedian(campaign.sigma, axis=0)
    size = np.abs(tried.load).sum(axis=1)
    a, Ja, Ca = _model(tried, fit, sigma)
    for rival in rivals:
        b, Jb, Cb = _model(tried, rival, sigma)
        powers = np.minimum(_power(a - b, Jb, Cb), _power(b - a, Ja, Ca))
        # Among nearly equivalent conditions, choose the one with the smallest load.
        good = powers >= _AS_GOOD * powers.max()
        best = int(np.argmin(np.where(good, size, np.inf)))
        if powers[best] >= _DECIDES:
            power = float(powers[best])
            return _measurement(campaign, tried, best, power, (fit, rival))
    return None


def _measurement(
    campaign: Campaign, tried: Conditions, best: int, power: float,
    fits: Sequence[MachineFit],
) -> NextMeasurement:  # fmt: skip
    """Convert one of the tested measuring conditions to a measurement."""
    sets = [sorted({e.hypothesis.effect for e in one.effects}) for one in fits]
    names = [" + ".join(effects) or "nothing" for effects in sets]
    why = (
        f"the predictions of {names[0]} and {names[1]} differ by {np.sqrt(power):.1f} "
        "standard deviations"
    )
    known = {name: getattr(tried, name)[best] for name in ("temperature", "approach")}
    covariates = {name: float(v) for name, v in known.items() if np.isfinite(v)}
    load = tuple(tried.load[best].tolist())
    configuration = _configuration(campaign, tried, best)
    return NextMeasurement(why, configuration, load, covariates, power)


def _conditions_tried(conditions: Conditions) -> Conditions:
    """Return random measuring conditions to be tested."""
    rng = np.random.default_rng(0)
    tried = _between(conditions.take(rng.integers(0, len(conditions), _TRIED)), rng)
    largest = np.abs(conditions.load).max(axis=0)
    corner = rng.choice([-1.0, 0.0, 1.0], (_TRIED, 6))
    temperature = tried.temperature
    if np.isfinite(temperature).all():
        low, high = conditions.temperature.min(), conditions.temperature.max()
        # A temperature change of 10 K is assumed to be possible.
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
    """Replace half of the configurations by intermediate ones."""
    # Rest positions of joints are known only for the measured configurations.
    if measured.rest is not None:
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
    # Second-order terms of the declared errors are equal in both models.
    return replace(
        measured, coordinates=coordinates, transforms=transforms, second_order=0.0
    )


def _model(
    tried: Conditions, fit: MachineFit, sigma: NDArray
) -> tuple[NDArray, NDArray, NDArray]:
    """Return whitened predictions, their derivatives, and the parameter covariance.

    Args:
        tried: S measuring conditions.
        fit: fitted machine with k parameters.
        sigma: (6,) [rad, m] standard deviations of the readings.

    Returns:
        (S, 6) predictions, (S, 6, k) derivatives and (k, k) covariance.  Components
        without sigma are omitted.
    """
    # Parameters of a single session do not apply to a new measurement.
    parts = [one for one in fit.effects if one.session is None]
    places = [fit.unknowns.place(one) for one in parts]
    chosen = np.concatenate([np.arange(len(fit.x))[own] for own in [slice(0), *places]])
    C = fit.covariance[np.ix_(chosen, chosen)]
    finite = any(LIBRARY[one.hypothesis.effect].finite for one in parts)

    def read(x: NDArray, finite: bool) -> NDArray:
        effects = {
            one.hypothesis.effect: one.hypothesis.public(tried.robot, x[own])
            for one, own in zip(parts, places, strict=True)
        }
        conditions = replace(apply_effects(tried, effects), exact=finite)
        return predict(conditions).deviation / sigma

    model = read(fit.x, finite)
    # The derivatives neglect finite motions, which are slow to compute.
    middle = read(fit.x, False) if finite else model
    J = np.zeros((*middle.shape, len(chosen)))
    for k, place in enumerate(chosen):
        step = _STEP * fit.std[place]
        if step > 0.0:
            moved = fit.x.copy()
            moved[place] += step
            J[:, :, k] = (read(moved, False) - middle) / step
    known = np.isfinite(sigma)
    return model[:, known], J[:, known], C


def _power(d: NDArray, J: NDArray, C: NDArray) -> NDArray:
    """Return the non-centralities (S,) of differences d, 0 if d is not finite."""
    S = np.eye(d.shape[1]) + np.einsum("sik,kl,sjl->sij", J, C, J)
    good = np.isfinite(d).all(axis=1) & np.isfinite(S).all(axis=(1, 2))
    powers = np.zeros(len(d))
    # Without round-off errors, all eigenvalues of S would be at least 1.
    values, vectors = np.linalg.eigh(S[good])
    along = np.einsum("sij,si->sj", vectors, d[good])
    powers[good] = np.sum(along**2 / np.maximum(values, 1.0), axis=1)
    return powers


def _configuration(campaign: Campaign, tried: Conditions, row: int) -> dict[str, float]:
    """Return the commanded configuration by column name."""
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
    """Format a load as a command-line option."""
    parts = [f"{name}={w:g}" for name, w in zip(LOAD, load, strict=True) if w]
    return ",".join(parts) or "none"
