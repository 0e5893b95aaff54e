"""The importance of errors as a data set, plain values and a table for people.

Beside the shares of the variance stand two sizes.  A group's *part* is the root of the
variance of the platform's screw that involves it: how far its errors move the platform
where they are as large as they are said to be.  Over the deviation of these errors it
is their *gain*: micrometres of the platform for each micrometre of error.  Both are of
the platform's vector, so a platform that follows an error has a gain of 1.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly.model.error_distributions import ErrorSources
from assembly.statistics.experiment import Experiment
from assembly.statistics.importance import (
    MOST_FAILED,
    STREAMS,
    Design,
    sobol_indices,
    source_groups,
)

if TYPE_CHECKING:
    import xarray

QUANTITIES = ("energy", "margin_free", "rotation", "translation", "force", "stress")
_ROWS = 15  # of the table
_MEANINGS = {
    "first_index": "share of the variance that a group explains alone",
    "total_index": "share of the variance that involves a group",
    "failed_share": "base draws left out, for a draw compared has no answer",
    "part": "deviation of the platform's screw that involves a group, by component",
    "gain": "the same for each rad or m of the group's errors; NaN if it has both",
}


def importance_design(experiment: Experiment, count: int, by: str) -> Design:
    """What is drawn to find the importance of an experiment's errors.

    Args:
        experiment: what is drawn and asked.
        count: base draws; (groups + 2) times as many are solved.
        by: see :func:`assembly.statistics.importance.source_groups`.

    Returns:
        The design.
    """
    sources = experiment.sources
    A, B = (sources.draw(0, count, experiment.seed, stream) for stream in STREAMS)
    return Design(A, B, source_groups(sources, by))


def importance_rows(
    experiment: Experiment, design: Design, first: int, count: int
) -> NDArray:
    """Answers to some rows of a design.

    Random play is not the errors' doing, and would drown what is: it is then left
    where the solution leaves it.

    Args:
        experiment: what is asked.
        design: what is drawn.
        first: row of it.
        count: how many.

    Returns:
        (count,) of the experiment's record type.
    """
    asked = replace(experiment, play=importance_play(experiment))
    found = asked.answer(design.rows(first, count), range(count))
    rows = np.zeros(count, dtype=experiment.record_type)
    for name in found.dtype.names or ():
        rows[name] = found[name]
    return rows


def importance_play(experiment: Experiment) -> str:
    """What the importance of an experiment's errors assumes of play."""
    return "worst" if experiment.play == "worst" else "least"


def importance_dataset(
    experiment: Experiment, design: Design, rows: NDArray, level: float = 0.95
) -> "xarray.Dataset":
    """Which sources the results of an experiment owe their variance to.

    Args:
        experiment: what is drawn and asked.
        design: what was drawn.
        rows: of the experiment's record type, its answers to all rows of the design.
        level: of confidence of the intervals.

    Returns:
        Data set ``first_index``, ``total_index`` over ``quantity``, ``group`` and
        ``estimate`` (value, lower, upper), ``failed_share``, and ``part`` and ``gain``
        over ``component`` (rotation, translation), to be merged with the draws'.
    """
    import xarray

    names = [q for q in QUANTITIES if q in (rows.dtype.names or ())]
    if not experiment.links:
        names.remove("stress")
    columns = [rows[n].max(axis=1) if rows[n].ndim == 2 else rows[n] for n in names]
    results = np.column_stack([*columns, rows["platform_screw"]])
    found = sobol_indices(design, results, level)
    part, gain = _parts(found.total[-6:, :, 0] * found.variance[-6:, None],
                        experiment.sources, design)  # fmt: skip
    indices, moves = ("quantity", "group", "estimate"), ("component", "group")
    kept = slice(0, len(names))
    values = {
        "first_index": (indices, found.first[kept], "1"),
        "total_index": (indices, found.total[kept], "1"),
        "failed_share": (("quantity", "group"), found.failed[kept], "1"),
        "part": (moves, part, "rad, m"),
        "gain": (moves, gain, "rad or m for each rad or m"),
    }
    data = {
        key: (dims, value, {"units": unit, "long_name": _MEANINGS[key]})
        for key, (dims, value, unit) in values.items()
    }
    labels = {
        "quantity": names, "group": list(found.groups),
        "estimate": ["value", "lower", "upper"],
        "component": ["rotation", "translation"],
        "error_unit": ("group", _units(experiment.sources, design)),
    }  # fmt: skip
    said = {
        "importance_draws": len(design.A),
        "importance_play": importance_play(experiment),
    }
    return xarray.Dataset(data, labels, said)


def _parts(
    variances: NDArray, sources: ErrorSources, design: Design
) -> tuple[NDArray, NDArray]:
    """(2, d) parts and gains from the variance (6, d) of the screw that groups make."""
    lost = np.isnan(variances).all(axis=0)
    # a component that does not vary has no index, and no part in the platform's motion
    variances = np.maximum(np.nan_to_num(variances), 0.0)
    part = np.sqrt(np.stack([variances[:3].sum(axis=0), variances[3:].sum(axis=0)]))
    part[:, lost] = np.nan
    spread = np.array([sources.variance[columns].sum() for _, columns in design.groups])
    alike = np.array([u != "rad, m" for u in _units(sources, design)])
    return part, np.where(alike, part / np.sqrt(spread), np.nan)


def _units(sources: ErrorSources, design: Design) -> list[str]:
    """Units of the errors of each group."""
    angles = [sources.component[columns] < 3 for _, columns in design.groups]
    return ["rad" if a.all() else "rad, m" if a.any() else "m" for a in angles]


def importance_report(data: "xarray.Dataset") -> dict[str, Any]:
    """What :func:`importance_dataset` says, as plain values.

    Args:
        data: with it, or merged with the draws.

    Returns:
        Base draws, the indices of each quantity, and by group part and gain; the share
        of draws left out and, where that is too much for indices, a reason.
    """
    groups = [str(g) for g in data["group"].values]
    quantities: dict[str, Any] = {}
    for q in map(str, data["quantity"].values):
        one = data.sel(quantity=q)
        most = float(one["failed_share"].max())
        said: dict[str, Any] = {"largest_share_left_out": most}
        if most > MOST_FAILED:
            said["reason"] = (
                f"no indices where more than {MOST_FAILED:.0%} of the draws have no "
                f"answer: up to {most:.1%} were left out, and the errors of the others "
                "are not independent"
            )
        elif np.isnan(one["total_index"]).all():
            said["reason"] = "it does not vary"
        for key in ("first_index", "total_index"):
            said[key] = dict(zip(groups, one[key].values, strict=True))
        quantities[q] = said
    moved = {
        group: {
            "error_unit": str(data["error_unit"].values[g]),
            **{
                f"{name}_{key}": float(data[key].sel(component=name).values[g])
                for key in ("part", "gain") for name in ("rotation", "translation")
            },
        }
        for g, group in enumerate(groups)
    }  # fmt: skip
    return {
        "base_draws": int(data.attrs["importance_draws"]),
        "play": str(data.attrs["importance_play"]), "quantities": quantities,
        "platform": moved,
    }  # fmt: skip


def importance_text(report: Mapping[str, Any]) -> str:
    """The same as a table: errors that move the platform most come first."""
    said = report["quantities"]
    lines = [
        f"importance of the errors, {report['base_draws']} base draws, play "
        f"{report['play']} in the shares, least in what moves the platform:"
    ]
    for name, one in said.items():
        if "reason" in one:
            lines.append(f"{name}: {one['reason']}")
        elif one["largest_share_left_out"] > 0:
            lines.append(
                f"{name}: up to {one['largest_share_left_out']:.1%} of the draws have "
                "no answer and are left out"
            )
    total = said["translation"]["total_index"]
    moved = report["platform"]
    order = sorted(moved, key=lambda g: -np.nan_to_num(moved[g]["translation_part"]))
    width = max(map(len, ("error", *order[:_ROWS])))
    head = f"{'error':{width}}  platform [um]  for each um  for each mrad"
    lines.append(f"{head}  [mrad]  share of translation's variance")
    for group in order[:_ROWS]:
        one = moved[group]
        gain = {
            "m": (f"{one['translation_gain']:11.3g}", " " * 13),
            "rad": (" " * 11, f"{1e3 * one['translation_gain']:13.4g}"),
        }.get(one["error_unit"], (" " * 11, " " * 13))
        value, low, high = total[group]
        lines.append(
            f"{group:{width}}  {1e6 * one['translation_part']:13.3g}  {gain[0]}  "
            f"{gain[1]}  {1e3 * one['rotation_part']:6.3g}  "
            f"{value:.3f} ({low:.3f} to {high:.3f})"
        )
    if len(order) > _ROWS:
        lines.append(f"and {len(order) - _ROWS} more, see --json")
    return "\n".join(lines)
