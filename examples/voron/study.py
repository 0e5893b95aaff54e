"""A printer's frame expands, and so does its bed: thermal effects, one by one.

    python -m examples.voron.study [--data DIR] [-o voron_study]

Fitted on run b, scored on run a; rms about the mean, as the zero of a run is arbitrary.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from assembly.effects import apply_effects
from assembly.kinematics.posture import Posture
from assembly.measurement.conditions import as_declared
from assembly.measurement.predict import predict
from examples.study_output import arguments, print_table, run, write_results
from examples.voron.convert import convert
from validation.campaign.campaign import Campaign
from validation.campaign.campaign_file import read_campaign

DECLARED = 23.4e-6  # [1/K] that the printer's own compensation uses
BLOCKS = 5  # of time, to choose among models on run b alone


@dataclass(frozen=True)
class Step:
    """One model: columns that are fitted, some of them behind first-order lags.

    Attributes:
        name: of the model.
        columns: ``frame`` is thermal expansion of the frame; else a covariate.
        lags: numbers of columns that lag; each has a time constant of its own.
        start: [s] where the search for the time constants begins, several.
    """

    name: str
    columns: tuple[str, ...]
    lags: tuple[int, ...] = ()
    start: tuple[tuple[float, ...], ...] = field(default=((),))


BED = "bed_temperature"
LADDER = (
    Step("frame coefficient fitted", ("frame",)),
    Step("+ bed temperature", ("frame", BED)),
    Step("+ what the bed warms slowly", ("frame", BED, BED), (2,),
         ((300.0,), (1500.0,), (5000.0,))),
    Step("+ frame lags its sensor", ("frame", BED, BED), (0, 2),
         ((100.0, 1500.0), (300.0, 3000.0))),
)  # fmt: skip


def frame_expansion(campaign: Campaign, coefficient: float) -> NDArray:
    """(k,) [m] rise of the nozzle, by the library's effect.

    Args:
        campaign: with ``cov.temperature``.
        coefficient: [1/K] of the frame.

    Returns:
        What the device would read along z.
    """
    q, T = campaign.coordinates, campaign.transforms
    warm = campaign.covariates["temperature"]
    here = as_declared(
        Posture(campaign.robot, q, T, 0.0), covariates={"temperature": warm}
    )
    grown = apply_effects(here, {"thermal_expansion": {"frame": coefficient}})
    return predict(grown).deviation[:, 5]


def lagged(time: NDArray, x: NDArray, constant: float) -> NDArray:
    """x behind a first-order lag, from rest at its first value.

    Exact for x linear between its samples.

    Args:
        time: (k,) [s] increasing.
        x: (k,) any unit.
        constant: [s] the lag's time constant.

    Returns:
        (k,) in the unit of x.
    """
    y = x.copy()
    for i in range(1, len(x)):
        h = time[i] - time[i - 1]
        slope = (x[i] - x[i - 1]) / h
        start = y[i - 1] - x[i - 1] + slope * constant
        y[i] = x[i] - slope * constant + start * np.exp(-h / constant)
    return y


@dataclass(frozen=True, eq=False)
class Run:
    """A run as columns [m] or [K], and what was measured [m]."""

    time: NDArray
    height: NDArray
    columns: dict[str, NDArray]

    def design(self, step: Step, constants: NDArray) -> NDArray:
        """(k, columns + 1) of a model; the last column is its zero."""
        made = [self.columns[name] for name in step.columns]
        for column, constant in zip(step.lags, constants, strict=True):
            made[column] = lagged(self.time, made[column], constant)
        return np.column_stack([*made, np.ones(len(self.time))])


def as_run(campaign: Campaign) -> Run:
    """Columns of a campaign; ``frame`` per unit of its coefficient."""
    columns = {k: v for k, v in campaign.covariates.items() if k != "time"}
    columns["frame"] = frame_expansion(campaign, 1e-6) / 1e-6
    return Run(campaign.covariates["time"], campaign.measured[:, 5], columns)


def fit(step: Step, run: Run, rows: NDArray) -> tuple[NDArray, NDArray]:
    """Time constants [s] and coefficients of a model, fitted to some rows."""

    def left(logarithms: NDArray) -> NDArray:
        A = run.design(step, np.exp(logarithms))[rows]
        c = np.linalg.lstsq(A, run.height[rows], rcond=None)[0]
        return (run.height[rows] - A @ c) * 1e6

    constants = np.zeros(0)
    if step.lags:
        tries = [least_squares(left, np.log(s)) for s in step.start]
        constants = np.exp(min(tries, key=lambda t: t.cost).x)
    A = run.design(step, constants)[rows]
    return constants, np.linalg.lstsq(A, run.height[rows], rcond=None)[0]


def residual(step: Step, run: Run, found: tuple[NDArray, NDArray]) -> NDArray:
    """(k,) [m] measured minus modelled."""
    return run.height - run.design(step, found[0]) @ found[1]


def spread(x: NDArray) -> float:
    """Rms about the mean."""
    return float(np.std(x))


def by_blocks(step: Step, run: Run) -> float:
    """[m] rms on blocks of time, each left out of its fit in turn."""
    block = np.arange(len(run.time)) * BLOCKS // len(run.time)
    errors = []
    for one in range(BLOCKS):
        found = fit(step, run, block != one)
        errors.append(residual(step, run, found)[block == one])
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def repeat_noise(campaign: Campaign) -> float:
    """[m] one sigma from triples of homings seconds apart, their trend taken out."""
    sample, z = campaign.covariates["sample"], campaign.measured[:, 5]
    triple = np.flatnonzero(sample[2:] == sample[:-2])
    bend = z[triple] - 2 * z[triple + 1] + z[triple + 2]
    return float(np.sqrt(np.mean(bend**2) / 6))


def main() -> None:
    """Convert, fit, score, draw."""
    options = arguments(__doc__, "voron_study")
    folders = convert(options.output, options.data)
    campaigns = {name: read_campaign(folder) for name, folder in folders.items()}
    runs = {name: as_run(c) for name, c in campaigns.items()}
    a, b = runs["run_a"], runs["run_b"]
    nothing, expected = (
        {n: spread(r.height - f * r.columns["frame"]) for n, r in runs.items()}
        for f in (0.0, DECLARED)
    )
    rows: list[tuple] = [
        ("no thermal model", nothing["run_b"], np.nan, nothing["run_a"]),
        (f"declared, {DECLARED * 1e6:g}e-6 /K", expected["run_b"], np.nan,
         expected["run_a"]),
    ]  # fmt: skip
    steps, left = [], {"declared": a.height - DECLARED * a.columns["frame"]}
    for step in LADDER:
        found = fit(step, b, np.ones(len(b.time), dtype=bool))
        left[step.name] = residual(step, a, found)
        blocks = by_blocks(step, b)
        own = spread(residual(step, b, found))
        rows.append((step.name, own, blocks, spread(left[step.name])))
        steps.append({
            "model": step.name, "run_b": own, "run_b_block_out": blocks,
            "run_a": spread(left[step.name]), "columns": step.columns,
            "coefficients": found[1][:-1], "time_constants": found[0],
        })  # fmt: skip
    noise = repeat_noise(campaigns["run_b"])
    print_table(
        "rms height [um]",
        ("model", "run b (fitted)", "run b, block out", "run a"),
        [(name, *(x * 1e6 for x in values)) for name, *values in rows],
    )
    print(f"\nnoise of repeats, run b: {noise * 1e6:.2f} um")
    for s in steps:
        print(s["model"], s["columns"], s["coefficients"], s["time_constants"])
    write_results(options.output, {"unit": "m, 1/K, m/K, s", "noise": noise,
                                   "no_model": nothing, "declared": expected,
                                   "steps": steps})  # fmt: skip
    from examples.voron.figure import draw

    draw(campaigns["run_a"], left, options.output)


if __name__ == "__main__":
    run(main)
