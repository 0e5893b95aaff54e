"""Create the report section with maps over the grid of poses."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.tables import component_unit
from forcefit.page.charts import Axis, Layer, value_map
from forcefit.page.page import paragraph, section
from forcefit.page.tables import Cell, Value, table
from forcefit.results.quantities import unit_of
from forcefit.stiffness.screws import WRENCH
from forcefit.validation.study.drawn_tolerances import DRAWN_ERRORS

# Quantities shown as maps, with their names in the results and descriptions.
MAPPED = {
    "translation_error": "largest translation, eq. (27), over all clearances",
    "rotation_error": "largest rotation, eq. (27), over all clearances",
    "energy": "energy, eq. (22)",
    "margin_free": "zone margin, compliant joints free",
    "margin": "zone margin, eq. (21)",
}
_UNITS = {"tx": "m", "ty": "m", "tz": "m", "rx": "rad", "ry": "rad", "rz": "rad"}


class Mapped(NamedTuple):
    """Values of a quantity at the points of a grid of poses.

    Attributes:
        key: name of the quantity in the results.
        words: name of the quantity on the page.
        unit: SI unit.
        values: values at the grid points; NaN without a solution.
    """

    key: str
    words: str
    unit: str
    values: Any


def mapped(maps: Any) -> Iterator[Mapped]:
    """Yield the quantities of the maps of a study. Pose errors are upper bounds."""
    for key, words in MAPPED.items():
        one = maps[key].sel(bound="upper") if "bound" in maps[key].dims else maps[key]
        yield Mapped(key, words, unit_of(key), one)
    for part, unit in (("translation", "m"), ("rotation", "rad")):
        key = DRAWN_ERRORS[part]
        if key in maps:
            words = f"largest {part} over all parts within tolerance"
            yield Mapped(key, words, unit, maps[key])
    if "deflection" in maps:
        for part, name, half, unit in (
            ("shift", "translation", slice(3, 6), "m"),
            ("turn", "rotation", slice(0, 3), "rad"),
        ):
            size = np.sqrt((maps["deflection"].isel(screw=half) ** 2).sum(
                "screw", skipna=False
            ))  # fmt: skip
            words = f"{name} by load and weight, minimum-energy solution"
            yield Mapped(f"deflection_{part}", words, unit, size)
    if "stiffness" in maps:
        for name in WRENCH:
            unit = component_unit(maps["stiffness"].attrs["units"], name)
            one = maps["stiffness"].sel(wrench_component=name)
            words = f"stiffness along {name}, the other axes free"
            yield Mapped(f"stiffness.{name}", words, unit, one)
    if "frequency" in maps:
        for k, mode in enumerate(maps["frequency"]["mode"].values):
            one = maps["frequency"].isel(mode=k)
            yield Mapped(f"frequency.{mode}", f"natural frequency {mode}", "Hz", one)


def finite(one: Mapped) -> NDArray:
    """Return the known values of a map, which may be infinite for pose errors."""
    values = np.asarray(one.values, dtype=float).ravel()
    if one.key.endswith("_error"):
        return values[~np.isnan(values)]
    return values[np.isfinite(values)]


def maps_section(maps: Any, summary: dict[str, Any]) -> str:
    """Return the report section with the maps over the grid.

    Args:
        maps: data set over the grid.
        summary: result of :func:`forcefit.validation.study.report.map_summary`.

    Returns:
        HTML with counts, a table of smallest, median and largest values, and the map.
        If the grid has more than two axes, the map shows two of them at fixed values of
        the other axes.
    """
    title = "Over the workspace"
    counts = ", ".join(f"{k}: {v}" for k, v in summary["status"].items())
    share = summary["share_assemblable_free"]
    if share is None:
        return section(title, paragraph(f"{counts}. No point has a solution."))
    known = [one for one in mapped(maps) if one.key in summary]
    rows: list[list[Cell]] = [
        [one.words, *(Value(v, one.unit) for v in summary[one.key]),
         _where(maps, one)]
        for one in known
    ]  # fmt: skip
    return section(
        title,
        paragraph(
            f"{counts}. If compliant joints rotate freely, the robot assembles "
            f"without force at {100 * share:.1f} % of the points with a solution."
        ),
        table(["quantity", "least", "median", "largest", "largest at"], rows, "maps"),
        _drawn(maps, known[0]) if known else "",
    )


def _drawn(maps: Any, first: Mapped) -> str:
    """Return the map over two axes, and a paragraph on the values along other axes."""
    names = [str(d) for d in maps["energy"].dims if maps.sizes[d] > 1]
    if not names:
        return ""
    # The map shows the two axes with the most values.
    axes = sorted(sorted(names, key=lambda n: -maps.sizes[n])[:2], key=names.index)
    at = {name: i for name, i in _largest(first).items() if name not in axes}
    held = {name: i for name, i in at.items() if name in names}
    view = maps.isel(at, drop=True).transpose(*axes, ...)
    layers = [
        Layer(one.key, one.words, one.unit, np.asarray(one.values, dtype=float))
        for one in mapped(view)
    ]
    drawn = value_map(
        [(Axis(n, _UNITS.get(n, "")), view[n].values) for n in axes], layers,
        view["status"].values.astype(str), "Over the grid.",
    )  # fmt: skip
    if not held:
        return drawn
    return paragraph(
        f"The grid has {len(names)} axes: the map is drawn over {axes[0]} and "
        f"{axes[1]}, with {_place(maps, held)}, where the {first.words} is largest. "
        "The table contains all points."
    ) + drawn  # fmt: skip


def _largest(one: Mapped) -> dict[str, int]:
    """Return the grid index of the maximum of a map."""
    values = np.nan_to_num(np.asarray(one.values, dtype=float), nan=-np.inf)
    if not one.key.endswith("_error"):
        values = np.where(np.isposinf(values), -np.inf, values)
    at = np.unravel_index(int(values.argmax()), values.shape)
    return {str(d): int(i) for d, i in zip(one.values.dims, at, strict=True)}


def _where(maps: Any, one: Mapped) -> str:
    """Format the coordinates of the maximum of a map."""
    known = finite(one)
    bounded = bool(np.isfinite(known).all())
    if bounded and np.ptp(known) <= 1e-9 * np.abs(known).max():
        return "the same everywhere"
    return _place(maps, _largest(one))


def _place(maps: Any, at: dict[str, int]) -> str:
    """Format the coordinates of a grid point."""
    return ", ".join(
        f"{name} = {float(maps[name].values[i]):.6g} {_UNITS.get(name, '')}".rstrip()
        for name, i in at.items()
    )
