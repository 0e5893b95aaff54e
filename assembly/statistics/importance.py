"""Which errors matter: the share of a result's variance that each source explains.

The first index is the share a source explains alone, the total one what would be left
without all others.  Sobol's indices by Saltelli's design take (groups + 2) times the
draws; where a result is linear in the errors they are known in closed form,
``a_i^2 var_i / sum_j a_j^2 var_j``, and both are the same.

Sources:
    Saltelli et al. (2010), Variance based sensitivity analysis of model output, table 2
    (b for the first index, f for the total one: Jansen's).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.statistics.distributions import ErrorSources
from assembly.statistics.monte_carlo import Experiment

if TYPE_CHECKING:
    import xarray

_STREAMS = (2, 3)  # of random numbers, see assembly.statistics.distributions
_CHUNK = 4096  # rows evaluated at a time
_RESAMPLES = 200
QUANTITIES = ("energy", "margin_free", "rotation", "translation", "force", "stress")


@dataclass(frozen=True, eq=False)
class Importance:
    """Sobol's indices of s results and d groups of sources.

    Attributes:
        groups: names of the groups.
        first: (s, d, 3) share explained alone: value, lower, upper.
        total: (s, d, 3) share that involves the group: likewise.
        variance: (s,) of the results.
    """

    groups: tuple[str, ...]
    first: NDArray
    total: NDArray
    variance: NDArray


def sobol_importance(
    evaluate: Callable[[NDArray], NDArray],
    sample: Callable[[int, int], NDArray],
    groups: Sequence[tuple[str, NDArray]],
    count: int,
    level: float = 0.95,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Importance:
    """Sobol's indices of any function of independent numbers.

    Args:
        evaluate: (k, m) numbers to (k, s) results.
        sample: stream and count to (count, m) independent draws of the numbers.
        groups: name and columns of each group of numbers.
        count: base draws; (groups + 2) times as many are evaluated.
        level: of confidence of the bootstrap intervals.
        progress: called with evaluations done and their number.

    Returns:
        The indices; NaN for a result that does not vary.
    """
    A, B = (sample(stream, count) for stream in _STREAMS)
    mixed = [A, B]
    for _, columns in groups:
        part = A.copy()
        part[:, columns] = B[:, columns]
        mixed.append(part)
    total, done, found = len(mixed) * count, 0, []
    for rows in mixed:
        pieces = []
        for first in range(0, count, _CHUNK):
            pieces.append(evaluate(rows[first : first + _CHUNK]))
            done += len(pieces[-1])
            progress(done, total)
        found.append(np.concatenate(pieces).T)
    names = tuple(name for name, _ in groups)
    return _indices(names, np.array(found), level)


def _indices(groups: tuple[str, ...], f: NDArray, level: float) -> Importance:
    """Estimates and bootstrap intervals from results f (d + 2, s, k) of A, B, mixed."""
    count = f.shape[-1]
    spread = f[:2].transpose(1, 0, 2).reshape(f.shape[1], -1).var(axis=1)
    varies = spread > 1e-24 * (f[0] ** 2).mean(axis=1)
    g = f - f[:2].mean(axis=(0, 2))[:, None]
    alone = (g[1] * (g[2:] - g[0])).reshape(-1, count)
    left = (0.5 * (g[2:] - g[0]) ** 2).reshape(-1, count)
    squares, means = 0.5 * (g[0] ** 2 + g[1] ** 2), 0.5 * (g[0] + g[1])
    rng = np.random.default_rng(1)
    weights = rng.multinomial(count, np.full(count, 1 / count), _RESAMPLES) / count
    weights = np.vstack([np.full(count, 1 / count), weights])
    variance = weights @ squares.T - (weights @ means.T) ** 2
    tail = [(1 - level) / 2, (1 + level) / 2]
    answers = []
    for products in (alone, left):
        sums = (weights @ products.T).reshape(len(weights), len(groups), -1)
        with np.errstate(invalid="ignore", divide="ignore"):
            shares = np.moveaxis(sums / variance[:, None], 2, 0)
        shares[~varies] = np.nan
        bounds = np.quantile(shares[:, 1:], tail, axis=1)
        answers.append(np.stack([shares[:, 0], *bounds], axis=-1))
    return Importance(groups, answers[0], answers[1], spread)


def linear_importance(
    slopes: NDArray, sources: ErrorSources, groups: Sequence[tuple[str, NDArray]]
) -> NDArray:
    """Closed-form indices of results that are linear in the errors.

    Args:
        slopes: (s, m) of the results with each source.
        sources: m of them.
        groups: name and columns of each group.

    Returns:
        (s, d) shares of the variance, first and total alike.
    """
    parts = slopes**2 * sources.variance
    shares = np.stack([parts[:, columns].sum(axis=1) for _, columns in groups], axis=1)
    return shares / parts.sum(axis=1, keepdims=True)


def source_groups(sources: ErrorSources, by: str) -> list[tuple[str, NDArray]]:
    """Groups of sources: each by itself, by frame, or by kind of error.

    Args:
        sources: of a robot.
        by: ``"source"``; ``"frame"``; or ``"kind"``: the same component of the frame
            of the same name in every leg.

    Returns:
        Name and columns of each.

    Raises:
        ValueError: ``by`` is something else.
    """
    if by not in {"source", "frame", "kind"}:
        raise ValueError(f"by is {by!r}, expected 'source', 'frame' or 'kind'")
    keys = []
    for label in sources.labels:
        frame, _, component = label.rpartition(".")
        leg, dot, rest = frame.partition(".")
        kind = f"{rest if dot else leg}.{component}"
        keys.append({"source": label, "frame": frame, "kind": kind}[by])
    names = list(dict.fromkeys(keys))
    return [(n, np.flatnonzero([k == n for k in keys])) for n in names]


def importance_dataset(
    experiment: Experiment,
    count: int,
    by: str = "source",
    level: float = 0.95,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> "xarray.Dataset":
    """Which sources the results of an experiment owe their variance to.

    Args:
        experiment: what is drawn and asked.
        count: base draws; (groups + 2) times as many are solved.
        by: see :func:`source_groups`.
        level: of confidence of the intervals.
        progress: called with draws done and their number.

    Returns:
        Data set ``first_index``, ``total_index`` over ``quantity``, ``group`` and
        ``estimate`` (value, lower, upper), to be merged with the draws'.
    """
    import xarray

    sources = experiment.sources
    names = [q for q in QUANTITIES if q != "margin_free" or experiment.margins]
    if not experiment.links:
        names.remove("stress")

    def evaluate(values: NDArray) -> NDArray:
        rows = experiment.answer(values, range(len(values)))
        screws = rows["platform_screw"]
        sizes = {
            "rotation": np.sqrt((screws[:, :3] ** 2).sum(axis=1)),
            "translation": np.sqrt((screws[:, 3:] ** 2).sum(axis=1)),
        }
        columns = [
            sizes[n] if n in sizes
            else rows[n].max(axis=1) if rows[n].ndim == 2 else rows[n]
            for n in names
        ]  # fmt: skip
        return np.stack(columns, axis=1)

    found = sobol_importance(
        evaluate, lambda stream, k: sources.draw(0, k, experiment.seed, stream),
        source_groups(sources, by), count, level, progress,
    )  # fmt: skip
    dims = ("quantity", "group", "estimate")
    meaning = {
        "first_index": "share of the variance that a group explains alone",
        "total_index": "share of the variance that involves a group",
    }
    data = {
        key: (dims, values, {"units": "1", "long_name": meaning[key]})
        for key, values in (("first_index", found.first), ("total_index", found.total))
    }
    labels = {
        "quantity": names, "group": list(found.groups),
        "estimate": ["value", "lower", "upper"],
    }  # fmt: skip
    return xarray.Dataset(data, labels, {"importance_draws": count})
