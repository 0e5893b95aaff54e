r"""Plan a measurement campaign that discriminates between effects.

An exchange algorithm selects rows from a set of candidate rows to maximise

    sum over e, f of ln(1 + l_ef),
    l_ef = tr(S_ee - S_ef (S_ff + I)^-1 S_fe) / k_e.

Here l_ef is the mean non-centrality if effect e with k_e unknowns is true and effect f
is fitted. This is the criterion of Atkinson and Fedorov, averaged over a normal prior
of the unknowns. The matrices S contain inner products of the changes of the readings
due to the effects.  In each step, rows with a small derivative of the criterion with
respect to their weight are exchanged for rows with a large derivative.

Sources:
    Atkinson, Fedorov (1975), The design of experiments for discriminating between two
    rival models, Biometrika 62, 57.
    Fedorov (1972), Theory of Optimal Experiments, section 3.2 (exchange).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import Target, follow
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.measurement.settled_clearance import without_joint_clearances
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.errors import BadInput
from forcefit.validation.campaign.campaign import Campaign, number_rows
from forcefit.validation.inspection.design_signatures import design_signatures
from forcefit.validation.synthetic.design import (
    CampaignDesign,
    CampaignPlan,
    plan_campaign,
)
from forcefit.validation.synthetic.generator import Synthetic

_POOL = 600  # smallest number of candidate rows
# Number of rows that are tried for removal, and for addition, in each step.
_TRIED = 4
_BETTER = 1e-3  # smallest increase of the criterion for an exchange of rows
_AVERAGE = 20  # number of random plans for comparison with the chosen plan
_PACE = 60.0  # [s] assumed time to measure one row
_SWING = 2400.0  # [s] assumed period of the temperature oscillation
_FEWEST = 8  # smallest number of rows of a plan


@dataclass(frozen=True, eq=False)
class Planned:
    """A plan of measurements.

    Attributes:
        robot: declared robot.
        plan: rows in measuring order.
        design: varied quantities and their ranges.
        sigma: [rad, m] noise of the measuring device.
        effects: names of the compared effects.
        apart: (e, e) [-] mean non-centrality if effect i is true and effect j is
            fitted, in element [i, j]. Each effect is scaled to an rms change of one
            sigma.
        random: (e, e) mean of ``apart`` over random plans of the same size.
    """

    robot: Robot
    plan: CampaignPlan
    design: CampaignDesign
    sigma: tuple[float, float]
    effects: tuple[str, ...]
    apart: NDArray
    random: NDArray


def plan_rows(
    robot: Robot, rows: int, design: CampaignDesign, sigma: tuple[float, float],
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Planned:  # fmt: skip
    """Choose rows that discriminate between library effects.

    Args:
        robot: declared robot.
        rows: number of rows to choose.
        design: varied quantities and their ranges.
        sigma: [rad, m] noise of the measuring device.
        seed: random seed of the candidate rows.
        progress: function called with the number of finished effects and the total
            number.

    Returns:
        The plan.

    Raises:
        BadInput: there are too few rows, the loops can be closed in too few
            configurations, or no effect changes the readings.
    """
    if rows < _FEWEST:
        raise BadInput(f"--rows: found {rows}, expected at least {_FEWEST}")
    rng = np.random.default_rng(seed)
    count = max(_POOL, 4 * rows)
    pool = _pool(robot, replace(design, rows=count, corners=True), rows, rng)
    # Clearances are omitted, because they hardly affect the plan.
    tight = without_joint_clearances(robot)
    campaign = rows_as_campaign(tight, pool, design, sigma)
    columns = {
        name: _alike(X)
        for name, X in design_signatures(campaign, progress).columns.items()
        if np.any(X)
    }
    if not columns:
        raise BadInput(
            f"{robot.name}: found no effect that changes the readings if all "
            "clearances are zero, which a plan assumes; expected geometric errors "
            "with which the loops can be closed without clearances"
        )
    names = tuple(columns)
    criterion = _Criterion([columns[name] for name in names], count)
    chosen = criterion.exchanged(rng.permutation(count)[:rows])
    draws = [rng.permutation(count)[:rows] for _ in range(_AVERAGE)]
    return Planned(
        robot=robot,
        plan=_ordered(pool, chosen),
        design=design,
        sigma=sigma,
        effects=names,
        apart=criterion.apart(chosen),
        random=np.mean([criterion.apart(drawn) for drawn in draws], axis=0),
    )


def _pool(
    robot: Robot, design: CampaignDesign, wanted: int, rng: np.random.Generator
) -> CampaignPlan:
    """Return the candidate rows with times and temperatures."""
    # The temperature is a slow function of time.
    plan = plan_campaign(robot, design, rng)
    time = np.array([row.covariates["time"] for row in plan.rows])
    time = (time % (_PACE * wanted)).round(1)
    temperature = np.array([row.covariates["temperature"] for row in plan.rows])
    low, high = temperature.min(), temperature.max()
    turns = 0.5 + np.round(wanted * _PACE / _SWING)
    swing = 0.5 - 0.5 * np.cos(2 * np.pi * turns * time / (_PACE * wanted))
    warm = (low + (high - low) * swing).round(2)
    rows = tuple(
        replace(row, covariates={**row.covariates, "time": t, "temperature": T})
        for row, t, T in zip(plan.rows, time.tolist(), warm.tolist(), strict=True)
    )
    return replace(plan, rows=rows)


def rows_as_campaign(
    robot: Robot, plan: CampaignPlan, design: CampaignDesign,
    sigma: tuple[float, float],
) -> Campaign:  # fmt: skip
    """Return a plan as a campaign with zero readings.

    Args:
        robot: declared robot.
        plan: rows of the campaign.
        design: design from which the rows were drawn.
        sigma: [rad, m] noise of the measuring device.
    """
    asked = np.array([list(row.coordinates.values()) for row in plan.rows])
    target = Target(coordinates=asked)
    track = follow(robot, home_posture(robot).coordinates, target)
    count, loads = len(plan.rows), np.array([row.load for row in plan.rows])
    return Campaign(
        name="plan", robot=robot, ids=tuple(f"m{i + 1:03d}" for i in range(count)),
        coordinates=track.coordinates, transforms=track.transforms,
        mismatch=track.mismatch, commanded=design.command, loads=loads,
        covariates={
            name: np.array([row.covariates[name] for row in plan.rows])
            for name in plan.rows[0].covariates
        },
        measured=np.zeros((count, 6)), sigma=np.tile(np.repeat(sigma, 3), (count, 1)),
        reference_point=np.array(design.reference_point), registration="known",
        configuration=plan.configuration,
        repeat=number_rows(plan.configuration, loads),
    )  # fmt: skip


def _alike(columns: NDArray) -> NDArray:
    """Scale the changes of the readings due to an effect to an rms of one sigma."""
    size = np.sqrt(np.mean(np.sum(columns**2, axis=1)))
    return columns / size


def _ordered(plan: CampaignPlan, chosen: NDArray) -> CampaignPlan:
    """Return the chosen rows in measuring order."""
    time = [plan.rows[i].covariates["time"] for i in chosen]
    order = chosen[np.argsort(time, kind="stable")]
    return CampaignPlan(
        tuple(plan.rows[i] for i in order), plan.configuration[order],
        plan.commands[order], plan.columns,
    )  # fmt: skip


class _Criterion:
    """Design criterion and its derivatives with respect to the row weights."""

    def __init__(self, blocks: list[NDArray], rows: int) -> None:
        begin = np.cumsum([0, *(X.shape[1] for X in blocks)])
        self._own = [slice(a, b) for a, b in zip(begin, begin[1:], strict=False)]
        self._X = np.hstack(blocks).reshape(rows, -1, begin[-1])

    def apart(self, chosen: NDArray) -> NDArray:
        """Return the mean non-centrality (e, e) for true and fitted effects."""
        return self._value(chosen)[0]

    def _value(self, chosen: NDArray) -> tuple[NDArray, NDArray]:
        """Return ``apart`` and the derivatives (rows,) of the criterion."""
        X = self._X[chosen].reshape(-1, self._X.shape[2])
        S = X.T @ X
        G, apart = np.zeros_like(S), np.full((len(self._own),) * 2, np.nan)
        for j, f in enumerate(self._own):
            inverse = np.linalg.inv(S[f, f] + np.eye(f.stop - f.start))
            for i, e in enumerate(self._own):
                if i == j:
                    continue
                B = inverse @ S[f, e]
                k = e.stop - e.start
                apart[i, j] = (np.trace(S[e, e]) - np.sum(S[f, e] * B)) / k
                weight = 1 / (1 + apart[i, j]) / k
                G[e, e] += weight * np.eye(k)
                G[f, f] += weight * B @ B.T
                G[f, e] -= weight * B
                G[e, f] -= weight * B.T
        slope = np.einsum("rck,rck->r", self._X @ G, self._X)
        return apart, slope

    def exchanged(self, start: NDArray) -> NDArray:
        """Exchange rows one by one until the criterion no longer increases."""
        chosen = start.copy()
        apart, slope = self._value(chosen)
        best, going = _told(apart), True
        while going:
            going = False
            outside = np.setdiff1d(np.arange(len(slope)), chosen)
            new = outside[np.argsort(-slope[outside])[:_TRIED]]
            old = np.argsort(slope[chosen])[:_TRIED]
            for place, row in product(old, new):
                other = chosen.copy()
                other[place] = row
                trial = self._value(other)
                if _told(trial[0]) > best + _BETTER:
                    chosen, slope, best = other, trial[1], _told(trial[0])
                    going = True
                    break
        return chosen


def _told(apart: NDArray) -> float:
    """Return the design criterion for given non-centralities."""
    return float(np.nansum(np.log1p(apart)))


def table(planned: Planned) -> dict[str, Any]:
    """Convert a plan to plain values, least distinguishable pairs first."""
    names = planned.effects
    pairs = [
        {
            "effect": names[i], "fitted": names[j],
            "planned": float(planned.apart[i, j]),
            "random": float(planned.random[i, j]),
        }
        for i in range(len(names)) for j in range(len(names)) if i != j
    ]  # fmt: skip
    return {
        "rows": len(planned.plan.rows),
        "configurations": len(set(planned.plan.configuration.tolist())),
        "pairs": sorted(pairs, key=lambda pair: pair["planned"]),
    }


def text(planned: Planned) -> str:
    """Format a plan as text with the five least distinguishable pairs."""
    shown = table(planned)
    lines = [f"{shown['rows']} rows of {shown['configurations']} configurations"]
    lines.append(
        "least distinguishable pairs [sigma], with values for random rows in brackets:"
    )
    for pair in shown["pairs"][:5]:
        sizes = [np.sqrt(pair[key]) for key in ("planned", "random")]
        lines.append(
            f"  {pair['effect']} if {pair['fitted']} is fitted: "
            f"{sizes[0]:.2g} ({sizes[1]:.2g})"
        )
    return "\n".join(lines)


def unmeasured(planned: Planned) -> Synthetic:
    """Convert a plan to a campaign without readings, which the user fills in."""
    missing = np.full((len(planned.plan.rows), 6), np.nan)
    return Synthetic(
        robot=planned.robot, plan=planned.plan,
        reference_point=np.array(planned.design.reference_point),
        registration="known", sigma=np.repeat(planned.sigma, 3),
        readings=missing, exact=missing, added=missing, effects=(), strength={},
    )  # fmt: skip
