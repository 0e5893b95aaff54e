"""Importance of errors as a data set, as a dictionary and as a text table.

For each group of errors, the Sobol indices and two further values are reported. The
*part* of a group is the standard deviation of the platform screw due to this group.
The *gain* is the platform motion per unit of error, see
:mod:`forcefit.assembly.statistics.importance_slopes`. Both are norms over the
components of the rotation or of the translation.

Indices are estimates, so the rank of a group is a range if its confidence interval
overlaps others, see :mod:`forcefit.assembly.statistics.ranking`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.importance import (
    MOST_FAILED,
    STREAMS,
    SaltelliDesign,
    sobol_indices,
    source_groups,
)
from forcefit.assembly.statistics.importance_slopes import error_units, platform_gains
from forcefit.assembly.statistics.ranking import (
    NOT_DISTINGUISHED,
    leaders,
    named_together,
    possible_ranks,
    rank_text,
)
from forcefit.results.quantities import QUANTITIES

if TYPE_CHECKING:
    import xarray

EXPLAINED = ("energy", "margin_free", "rotation", "translation", "force", "stress")
_ROWS = 15  # largest number of rows in the text table


@dataclass(frozen=True)
class ImportanceOptions:
    """Options for computing the importance of errors.

    Attributes:
        draws: number of base draws; (groups + 2) x ``draws`` problems are solved.
        by: grouping of errors, see
            :func:`forcefit.assembly.statistics.importance.source_groups`.
        level: confidence level of the intervals.
    """

    draws: int
    by: str = "kind"
    level: float = 0.95


def importance_design(
    experiment: Experiment, asked: ImportanceOptions
) -> SaltelliDesign:
    """Return the Saltelli design for the errors of an experiment.

    Args:
        experiment: error distributions and quantities.
        asked: number of base draws, and grouping of errors.

    Returns:
        The Saltelli design.
    """
    sources = experiment.sources
    A, B = (sources.draw(0, asked.draws, experiment.seed, k) for k in STREAMS)
    return SaltelliDesign(A, B, source_groups(sources, asked.by))


def importance_rows(
    experiment: Experiment, design: SaltelliDesign, first: int, count: int
) -> NDArray:
    """Return the records of consecutive rows of a design.

    The clearance positions are not random, because random positions would add variance
    that is not due to the errors.

    Args:
        experiment: error distributions and quantities.
        design: design of the draws.
        first: first row of the design.
        count: number of rows.

    Returns:
        Records of the experiment's record type, (count,).
    """
    asked = replace(
        experiment, clearance=importance_clearance_model(experiment), stiffness=""
    )
    evaluated = asked.evaluate(design.rows(first, count), range(count))
    rows = np.zeros(count, dtype=experiment.record_type)
    for name in evaluated.dtype.names or ():
        rows[name] = evaluated[name]
    return rows


def importance_clearance_model(experiment: Experiment) -> str:
    """Return the clearance model with which the importance of errors is computed."""
    return "worst" if experiment.clearance == "worst" else "least"


def importance_dataset(
    experiment: Experiment, design: SaltelliDesign, rows: NDArray, level: float = 0.95
) -> "xarray.Dataset":
    """Compute the importance of errors for the results of an experiment.

    Args:
        experiment: error distributions and quantities.
        design: design of the draws.
        rows: records of all rows of the design.
        level: confidence level of the intervals.

    Returns:
        Data set with the dimensions ``quantity``, ``group``, ``estimate`` (value,
        lower, upper) and ``component`` (rotation, translation). It can be merged with
        the data set of the draws.
    """
    import xarray

    names = [q for q in EXPLAINED if q in (rows.dtype.names or ())]
    if not experiment.links:
        names.remove("stress")
    columns = [rows[n].max(axis=1) if rows[n].ndim == 2 else rows[n] for n in names]
    results = np.column_stack([*columns, rows["platform_screw"]])
    importance = sobol_indices(design, results, level)
    part = _parts(importance.total[-6:, :, 0] * importance.variance[-6:, None])
    gain = platform_gains(experiment, design)
    indices, moves = ("quantity", "group", "estimate"), ("component", "group")
    kept = slice(0, len(names))
    values = {
        "first_index": (indices, importance.first[kept]),
        "total_index": (indices, importance.total[kept]),
        "failed_share": (("quantity", "group"), importance.failed[kept]),
        "part": (moves, part),
        "gain": (moves, gain),
    }
    data = {
        key: (dims, value, QUANTITIES[key].attributes)
        for key, (dims, value) in values.items()
    }
    labels = {
        "quantity": names, "group": list(importance.groups),
        "estimate": ["value", "lower", "upper"],
        "component": ["rotation", "translation"],
        "error_unit": ("group", error_units(experiment.sources, design)),
    }  # fmt: skip
    attributes = {
        "importance_draws": len(design.A),
        "importance_clearance_model": importance_clearance_model(experiment),
    }
    return xarray.Dataset(data, labels, attributes)


def _parts(variances: NDArray) -> NDArray:
    """Compute the parts of d groups, (2, d), from screw variances, (6, d)."""
    lost = np.isnan(variances).all(axis=0)
    # The Sobol indices of a constant component are NaN.
    variances = np.maximum(np.nan_to_num(variances), 0.0)
    part = np.sqrt(np.stack([variances[:3].sum(axis=0), variances[3:].sum(axis=0)]))
    part[:, lost] = np.nan
    return part


def importance_report(data: "xarray.Dataset") -> dict[str, Any]:
    """Convert the data of :func:`importance_dataset` to a dictionary.

    Args:
        data: result of :func:`importance_dataset`, possibly merged with the draws.

    Returns:
        For each quantity, the indices, possible ranks and fraction of discarded draws,
        and a reason if there are no indices. For each group, part and gain. The
        number of base draws.
    """
    groups = [str(g) for g in data["group"].values]
    quantities: dict[str, Any] = {}
    for q in map(str, data["quantity"].values):
        of_quantity = data.sel(quantity=q)
        most = float(of_quantity["failed_share"].max())
        results: dict[str, Any] = {"largest_share_left_out": most}
        if most > MOST_FAILED:
            results["reason"] = (
                f"no indices are computed if more than {MOST_FAILED:.0%} of the "
                f"draws have no solution: up to {most:.1%} were omitted, and the "
                "errors of the remaining draws are not independent"
            )
        elif np.isnan(of_quantity["total_index"]).all():
            results["reason"] = "it does not vary"
        for key in ("first_index", "total_index"):
            results[key] = dict(zip(groups, of_quantity[key].values, strict=True))
        results["rank"] = possible_ranks(results["total_index"])
        quantities[q] = results
    platform = {
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
        "clearance": str(data.attrs["importance_clearance_model"]),
        "quantities": quantities, "platform": platform,
    }  # fmt: skip


def importance_text(report: Mapping[str, Any]) -> str:
    """Format the importance as a text table, sorted by index."""
    quantities = report["quantities"]
    lines = [
        f"importance of the errors, {report['base_draws']} base draws; clearance model "
        f"{report['clearance']} for the shares, least for the platform motion "
        "(exact derivatives):"
    ]
    for name, one in quantities.items():
        if "reason" in one:
            lines.append(f"{name}: {one['reason']}")
        elif one["largest_share_left_out"] > 0:
            lines.append(
                f"{name}: up to {one['largest_share_left_out']:.1%} of the draws have "
                "no solution and are left out"
            )
    translation, platform = quantities["translation"], report["platform"]
    total, rank = translation["total_index"], translation.get("rank", {})
    order = sorted(
        platform,
        key=lambda g: (-np.nan_to_num(total[g][0]),
                       -np.nan_to_num(platform[g]["translation_part"])),
    )  # fmt: skip
    width = max(map(len, ("error", *order[:_ROWS])))
    head = f"{'error':{width}}  platform [um]  for each um  for each mrad"
    lines.append(f"{head}  [mrad]  share of translation's variance  rank")
    lines += [
        f"{group:{width}}  {_moves_text(platform[group])}  "
        f"{_interval_text(total[group]):31}  {rank_text(rank.get(group))}".rstrip()
        for group in order[:_ROWS]
    ]
    if len(order) > _ROWS:
        lines.append(f"and {len(order) - _ROWS} more, see --json")
    if any(first < last for first, last in rank.values()):
        lines.append(NOT_DISTINGUISHED)
    if rank:
        largest = [name for name in order if name in leaders(rank)]
        lines.append(f"largest: {', '.join(named_together(largest, rank))}")
    return "\n".join(lines)


def _moves_text(one: Mapping[str, Any]) -> str:
    """Format the part and the gain of a group as columns of a text table."""
    gain = {
        "m": (f"{one['translation_gain']:11.4g}", " " * 13),
        "rad": (" " * 11, f"{1e3 * one['translation_gain']:13.4g}"),
    }.get(one["error_unit"], (" " * 11, " " * 13))
    return (
        f"{1e6 * one['translation_part']:13.3g}  {gain[0]}  {gain[1]}  "
        f"{1e3 * one['rotation_part']:6.3g}"
    )


def _interval_text(share: NDArray) -> str:
    """Format an index and its confidence interval as text."""
    value, low, high = share
    return f"{value:.3f} ({low:.3f} to {high:.3f})"
