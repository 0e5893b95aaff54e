"""What follows the recorded temperature with a time constant."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from validation.synthetic.effects import Row


def behind(time_constant: float) -> str:
    """Name of what follows the temperature [K] with a time constant."""
    return f"behind {time_constant!r}"


def with_delays(rows: Sequence[Row], time_constants: Iterable[float]) -> list[Row]:
    """Return rows with what follows the temperature, which is straight between them.

    Args:
        rows: in the order of time.
        time_constants: [s] each.

    Returns:
        Rows with a covariate more for each; in the first row it is the temperature.
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
            else:  # behind a ramp, once what was there at its start has gone
                lag = (now - before["temperature"]) / step
                start = warm - before["temperature"] + lag
                warm = now - lag + start * math.exp(-step)
            more = {**row.covariates, behind(late): warm}
            rows[k] = replace(row, covariates=more)
    return rows
