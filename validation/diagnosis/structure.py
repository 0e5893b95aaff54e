"""What a residual that no effect explains looks like: against what does it vary?

Each candidate is a handful of functions of one thing that was varied (a component of
the pose, the load, the temperature, a covariate).  All six components of the reading
follow each function with a coefficient of their own; the F test says whether they do.

Sources:
    Draper, Smith, Applied Regression Analysis, 3rd ed., section 6.1 (extra sum of
    squares).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f

from assembly.kinematics.posture import POSE, pose_components
from assembly.measurement.conditions import Conditions
from validation.campaign.campaign import LOAD, Campaign
from validation.diagnosis.lack_of_fit import UNLIKELY
from validation.diagnosis.separability import orthonormal_basis

_MOST = 6


@dataclass(frozen=True)
class Trend:
    """What a residual varies with.

    Attributes:
        against: in words.
        share: [-] of the squared whitened residual that it takes away.
        probability: that noise takes away as much, over all trends tried.
    """

    against: str
    share: float
    probability: float


def trends(
    campaign: Campaign, conditions: Conditions, residual: NDArray
) -> list[Trend]:
    """What a residual varies with, the strongest first.

    Args:
        campaign: of R rows.
        conditions: its conditions.
        residual: (R, 6) [rad, m]; NaN where not measured.

    Returns:
        At most six trends that noise would hardly show.
    """
    z = residual / campaign.sigma
    tried = list(_candidates(campaign, conditions))
    tested = [_test(name, X, z, len(tried)) for name, X in tried]
    seen = [t for t in tested if t is not None and t.probability < UNLIKELY]
    return sorted(seen, key=lambda t: -t.share)[:_MOST]


def _candidates(
    campaign: Campaign, conditions: Conditions
) -> Iterator[tuple[str, NDArray]]:
    """Names, and functions (R, p) without the constant."""
    loads = campaign.loads
    force = loads[:, 3:]
    size = np.linalg.norm(force, axis=1)
    yield "load, linearly", loads
    yield "square of the load's size", size[:, None] ** 2
    yield "size of the load", size[:, None]
    for name, w in zip(LOAD, loads.T, strict=True):
        yield f"load.{name}", w[:, None]
    pose = pose_components(conditions.postures.platform)
    yield "pose, linearly", pose
    for name, p in zip(POSE, pose.T, strict=True):
        yield f"pose.{name} and its square", _powers(p)
    for i, frame in enumerate(conditions.robot.frames):
        if not frame.actuated:
            continue
        q = conditions.coordinates[:, i]
        yield f"q.{frame.name} and its square", _powers(q)
        if frame.joint == "revolute":
            for n in (1, 2):
                wave = np.column_stack([np.sin(n * q), np.cos(n * q)])
                yield f"q.{frame.name}, {'once' if n == 1 else 'twice'} a turn", wave
    for name, values in campaign.covariates.items():
        yield f"cov.{name}", values[:, None]
        yield f"cov.{name} and its square", _powers(values)
        span = float(np.ptp(values))
        if name == "time" and span:
            w = 2 * np.pi * np.outer(values / span, [1, 2])
            yield "cov.time, slow waves", np.hstack([np.sin(w), np.cos(w)])


def _powers(x: NDArray) -> NDArray:
    """(R, 2) a quantity about its mean, and its square."""
    centred = x - x.mean()
    return np.column_stack([centred, centred**2])


def _test(name: str, X: NDArray, z: NDArray, tried: int) -> Trend | None:
    """F test of functions beside a constant, in every component of the reading."""
    before = after = 0.0
    extra = freedom = 0
    for column in z.T:
        known = np.isfinite(column)
        if known.sum() < X.shape[1] + 3:
            continue
        varied = X[known] - X[known].mean(axis=0)
        u = orthonormal_basis(varied, floor=1e-12 * np.abs(X).max(axis=0))
        if not u.shape[1]:
            continue
        y = column[known] - column[known].mean()
        left = y - u @ (u.T @ y)
        before += float(y @ y)
        after += float(left @ left)
        extra += u.shape[1]
        freedom += len(y) - 1 - u.shape[1]
    if not extra or not after:
        return None
    ratio = ((before - after) / extra) / (after / freedom)
    chance = min(1.0, tried * float(f.sf(ratio, extra, freedom)))
    return Trend(name, 1 - after / before, chance)
