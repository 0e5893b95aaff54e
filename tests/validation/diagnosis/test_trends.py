"""Test trends of a residual against F tests with a different solver."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import f

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.validation.diagnosis import lack_of_fit as module
from forcefit.validation.diagnosis.lack_of_fit import trends
from forcefit.validation.diagnosis.signatures import conditions_of
from tests.bar_for_tests import bar
from tests.campaigns_for_tests import campaign_at
from tests.planar_arm_for_tests import SIGMA

ROWS = 30


@pytest.fixture
def varied(rng):
    """Campaign with a revolute and a prismatic drive, loads and temperatures."""
    robot = Robot("crane", "tip", (
        Frame("turn", joint="revolute", actuated=True),
        Frame("slide", "turn", [0.3, 0, 0.1], joint="prismatic", actuated=True),
        Frame("tip", "slide", [0.2, 0.1, 0]),
    ))  # fmt: skip
    q = rng.uniform(-1, 1, (ROWS, 2))
    placed = [place_robot(robot, joints={"turn": a, "slide": b}) for a, b in q]
    loads, humidity = rng.normal(size=(ROWS, 6)), rng.normal(size=ROWS)
    shown = humidity + loads[:, 3] + 1.5 * np.sin(q[:, 0])
    seen = rng.normal(size=(ROWS, 6)) + shown[:, None]
    seen[rng.random((ROWS, 6)) < 0.2] = np.nan
    seen[4:, 5] = np.nan
    given = {"time": rng.uniform(0, 500, ROWS), "humidity": humidity}
    return campaign_at(robot, placed, seen, SIGMA, loads=loads, covariates=given)


def functions(campaign):
    """Return the regression columns of each trend by name."""
    loads, (turn, slide) = campaign.loads, campaign.coordinates.T[:2]
    T = campaign.transforms[:, -1]
    turned = Rotation.from_matrix(T[:, :3, :3]).as_rotvec()
    pose = np.hstack([T[:, :3, 3], turned])
    size = np.sqrt((loads[:, 3:] ** 2).sum(axis=1))
    every = {
        "load, linearly": loads, "square of the load's size": size**2,
        "size of the load": size, "pose, linearly": pose,
        "q.turn, once a turn": np.array([np.sin(turn), np.cos(turn)]).T,
        "q.turn, twice a turn": np.array([np.sin(2 * turn), np.cos(2 * turn)]).T,
    }  # fmt: skip
    for k, name in enumerate(("mx", "my", "mz", "fx", "fy", "fz")):
        every[f"load.{name}"] = loads[:, k]
    squares = {f"pose.{n}": p for n, p in zip(module.POSE, pose.T, strict=True)}
    squares |= {"q.turn": turn, "q.slide": slide}
    for name, values in campaign.covariates.items():
        every[f"cov.{name}"] = values
        squares[f"cov.{name}"] = values
    for name, x in squares.items():
        every[f"{name} and its square"] = np.array([x, x**2]).T
    time = campaign.covariates["time"]
    turns = 2 * np.pi * time / (time.max() - time.min())
    every["cov.time, slow waves"] = np.array([
        np.sin(turns), np.sin(2 * turns), np.cos(turns), np.cos(2 * turns)
    ]).T  # fmt: skip
    return {name: X.reshape(ROWS, -1) for name, X in every.items()}


def by_least_squares(X, z):
    """Return the explained fraction and the p-value of functions."""
    squares, unknowns = np.zeros(2), np.zeros(2)
    for column in z.T:
        known = np.isfinite(column)
        if known.sum() < X.shape[1] + 3:
            continue
        y, one = column[known], np.ones((known.sum(), 1))
        for k, A in enumerate((one, np.hstack([one, X[known]]))):
            A = A / np.linalg.norm(A, axis=0).clip(1e-9)
            x, _, rank, _ = np.linalg.lstsq(A, y, rcond=1e-9)
            squares[k] += np.sum((y - A @ x) ** 2)
            unknowns[k] += rank if k else len(y) - 1
    extra = unknowns[1] - np.sum([
        1 for c in z.T if np.isfinite(c).sum() >= X.shape[1] + 3
    ])
    freedom = unknowns[0] - extra
    ratio = (squares[0] - squares[1]) / extra / (squares[1] / freedom)
    return 1 - squares[1] / squares[0], f.sf(ratio, extra, freedom)


def test_p_values_of_trends_equal_those_of_f_tests(varied, monkeypatch):
    monkeypatch.setattr(module, "UNLIKELY", 2.0)
    monkeypatch.setattr(module, "_MOST", 100)
    found = trends(varied, conditions_of(varied), varied.measured * varied.sigma)
    every = functions(varied)
    # Constant variables are not tested.
    moving = {n: X for n, X in every.items() if np.any(np.ptp(X, axis=0) > 1e-12)}
    assert {t.against for t in found} == moving.keys()
    for trend in found:
        share, chance = by_least_squares(every[trend.against], varied.measured)
        assert trend.share == pytest.approx(share, rel=1e-6)
        assert trend.probability == pytest.approx(
            min(1.0, len(every) * chance), rel=1e-6
        )
    shares = [t.share for t in found]
    assert shares == sorted(shares, reverse=True)


def test_quadratic_trend_of_large_values_is_found(rng):
    """The temperatures are between 1e6 and 1e6 + 1."""
    x = rng.uniform(0, 1, 40)
    hot = bar(rows=40, heat=1e6 + x)
    rest = ((x - 0.5) ** 2)[:, None] * hot.sigma
    found = {t.against: t for t in trends(hot, conditions_of(hot), rest)}
    assert found["cov.heat and its square"].share > 1 - 1e-6
    campaign = bar(rows=40, time=0.5 * x)
    rest = np.sin(2 * np.pi * x)[:, None] * campaign.sigma
    found = trends(campaign, conditions_of(campaign), rest)
    assert "cov.time, slow waves" in [t.against for t in found]
