"""Compute temperatures that lag behind the recorded temperature."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from forcefit.validation.synthetic.effects import Row


def behind(time_constant: float) -> str:
    """Return the name of the covariate that contains a lagged temperature."""
    return f"behind {time_constant!r}"


def with_delays(rows: Sequence[Row], time_constants: Iterable[float]) -> list[Row]:
    """Add lagged temperatures to the rows.

    The recorded temperature varies linearly between rows.

    Args:
        rows: rows in the order of time.
        time_constants: [s] time constant of each lagged temperature.

    Returns:
        The rows with one lagged temperature per time constant.  In the first row, the
        lagged temperatures equal the recorded temperature.
    """
    rows = list(rows)
    for late in dict.fromkeys(time_constants):
        warm = 0.0
        for k, row in enumerate(rows):
            now = row.covariates["temperature"]
            before = rows[max(k - 1, 0)].covariates
            step = (row.covariates["time"] - before["time"]) / late
            if step == 0.0:
                warm = now
            # The exact solution is the response to a temperature ramp, plus the
            # exponential decay of the initial temperature difference.
            else:
                lag = (now - before["temperature"]) / step
                start = warm - before["temperature"] + lag
                warm = now - lag + start * math.exp(-step)
            more = {**row.covariates, behind(late): warm}
            rows[k] = replace(row, covariates=more)
    return rows
