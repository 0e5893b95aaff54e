"""Summarise the rows, loads, readings and covariates of a campaign."""

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.campaign.campaign import LOAD, READING, Campaign


def row_counts(kinds: NDArray) -> dict:
    """Return the number of distinct rows, and how often they are repeated.

    The numbers of repetitions are given by their minimum, median and maximum.
    """
    _, rows = np.unique(kinds, return_counts=True)
    return {"count": len(rows), "rows_each": [rows.min(), np.median(rows), rows.max()]}


def load_counts(c: Campaign) -> dict:
    """Summarise the number, magnitudes and components of the loads."""
    force = np.linalg.norm(c.loads[:, 3:], axis=1)
    moment = np.linalg.norm(c.loads[:, :3], axis=1)
    pairs = np.unique(np.column_stack([c.configuration, c.repeat]), axis=0)
    return {
        "levels": len(np.unique(c.loads.round(9), axis=0)),
        "unloaded_rows": int((~c.loads.any(axis=1)).sum()),
        "force": [force.min(), force.max()],
        "moment": [moment.min(), moment.max()],
        "components": [n for n, w in zip(LOAD, c.loads.T, strict=True) if w.any()],
        "configurations_under_several": int((np.bincount(pairs[:, 0]) > 1).sum()),
    }


def reading_counts(c: Campaign) -> dict:
    """Summarise the readings of each component and their sigma."""
    counts = {}
    for k, name in enumerate(READING):
        cells = c.cells[:, k]
        entry: dict = {"measured": int(cells.sum()), "missing": int((~cells).sum())}
        if cells.any():
            values, sigma = c.measured[cells, k], c.sigma[cells, k]
            entry |= {
                "rms": np.sqrt(np.mean(values**2)),
                "largest": np.abs(values).max(),
                "sigma": [sigma.min(), sigma.max()],
            }
        counts[name] = entry
    return counts


def covariate_counts(c: Campaign) -> dict:
    """Summarise the range, number of values and correlations of each covariate."""
    return {
        name: {
            "range": [x.min(), x.max()],
            "std": x.std(),
            "levels": len(np.unique(x)),
            "correlation": {
                other: correlation(x, y)
                for other, y in c.covariates.items()
                if other != name
            },
        }
        for name, x in c.covariates.items()
    }


def correlation(x: NDArray, y: NDArray) -> float:
    """Return the correlation of two variables, or 0 if one of them is constant."""
    x, y = x - x.mean(), y - y.mean()
    size = float(np.linalg.norm(x) * np.linalg.norm(y))
    return float(x @ y) / size if size > 0 else 0.0
