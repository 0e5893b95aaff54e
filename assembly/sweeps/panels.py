"""Panels of figures: names, units and titles of quantities.

The name of a quantity is a variable of the data set, followed by a component if there
are several: ``energy``, ``stiffness.FX``, ``wrench.leg1.link_a.FZ``. These are the
column names of :func:`forcefit.assembly.sweeps.point_table.point_table`. The quantities
``rotation`` and ``translation`` are the magnitudes of the pose error.
"""

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from forcefit.assembly.model.tables import component_unit
from forcefit.inputs.errors import plot_label
from forcefit.inputs.table import BadInput, nearest, quoted

if TYPE_CHECKING:
    import xarray

_MOST = 12  # largest number of panels in a figure
_HALVES = {"rotation": slice(0, 3), "translation": slice(3, 6)}
# conversion factor and displayed unit for each SI unit
_SHOWN = {
    "rad": (1e3, "mrad"), "m": (1e3, "mm"), "N/m": (1e-6, "N/um"), "Pa": (1e-6, "MPa"),
    "1": (1.0, "-"),
}  # fmt: skip


class Panel(NamedTuple):
    """One panel of a figure.

    Attributes:
        key: name of the quantity.
        scale: factor by which the values are multiplied.
        title: title with the unit.
        colours: colour map.
    """

    key: str
    scale: float
    title: str
    colours: str


# the six panels of figure 5 in the paper; further panels replace the last two if these
# were not computed
_PAPER = (
    Panel("margin_free", 1.0, "zone margin, compliant joints free [-]", "magma_r"),
    Panel("energy", 1.0, "minimum assembly energy [J]", "inferno"),
    Panel("rotation", 1e3, "platform orientation error [mrad]", "viridis"),
    Panel("translation", 1e3, "platform position error [mm]", "viridis"),
    Panel("rotation_error_clearance.upper", 1e3,
          "orientation error by clearances alone [mrad]", "viridis"),
    Panel("translation_error_clearance.upper", 1e3,
          "position error by clearances alone [mm]", "viridis"),
)  # fmt: skip
_RIGID = Panel("margin", 1.0, "zone margin, compliant joints rigid [-]", "magma_r")
_SAFETY = Panel("safety", 1.0, "yield strength over peak stress [-]", "viridis")
_STIFFNESS = (
    Panel("eigen_stiffness.1", 1e-6, "softest eigen-stiffness [N/um]", "viridis"),
    Panel(
        "stiffness_condition", 1.0, "condition number of the stiffness [-]", "magma_r"
    ),
)
_FREQUENCY = Panel("frequency.1", 1.0, "lowest natural frequency [Hz]", "viridis")


def usual_panels(data: "xarray.Dataset") -> tuple[Panel, ...]:
    """Return the default panels for a sweep.

    Args:
        data: data set of a sweep.

    Returns:
        The panels.

    Raises:
        BadInput: the data set contains none of their quantities.
    """
    usual = _usual_panels(data)
    panels = tuple(panel for panel in usual if _is_stored(data, panel.key))
    if not panels:
        raise BadInput(
            "figure: found none of the default quantities, such as energy; select "
            "quantities in the file with assembly plot --quantities"
        )
    return panels


def _is_stored(data: "xarray.Dataset", key: str) -> bool:
    """Return whether a data set contains a quantity."""
    try:
        quantity(data, key)
    except KeyError:
        return False
    return True


def _usual_panels(data: "xarray.Dataset") -> tuple[Panel, ...]:
    """Return the panels of figure 5 in the paper that the data set contains."""
    if "rotation_error_clearance" in data:
        return _PAPER
    middle = _STIFFNESS if "eigen_stiffness" in data else _PAPER[2:4]
    if "frequency" in data:
        middle = (_FREQUENCY, middle[1 if "eigen_stiffness" not in data else 0])
    return (*_PAPER[:2], *middle, _RIGID, _SAFETY)[: 6 if "safety" in data else 5]


def named_panels(data: "xarray.Dataset", names: Sequence[str]) -> tuple[Panel, ...]:
    """Return the panels for the given quantities.

    Args:
        data: data set of a sweep or of draws.
        names: names of the quantities.

    Returns:
        One panel per component. The name of a variable selects all its components.

    Raises:
        BadInput: a quantity is unknown, or there are too many panels.
    """
    known = _quantities(data)
    panels: list[Panel] = []
    for name in names:
        own = [k for k in known if k == name or k.startswith(f"{name}.")]
        if not own:
            variables = dict.fromkeys(k.partition(".")[0] for k in known)
            near = [k for k in known if k.partition(".")[0] == name.partition(".")[0]]
            raise BadInput(
                f"--quantities: no {quoted(name)}{nearest(name, near or variables)}"
            )
        if len(own) > _MOST:
            raise BadInput(
                f"--quantities {quoted(name)}: found {len(own)} components, expected "
                f"at most {_MOST}; name one, such as {own[0]}"
            )
        for key in own:
            scale, unit = _SHOWN.get(known[key], (1.0, known[key]))
            panels.append(Panel(key, scale, f"{plot_label(key)} [{unit}]", "viridis"))
    if len(panels) > _MOST:
        raise BadInput(
            f"--quantities: found {len(panels)} panels, expected at most {_MOST}"
        )
    return tuple(panels)


def quantity(data: "xarray.Dataset", key: str) -> Any:
    """Return the values of a quantity at all points.

    Args:
        data: data set of a sweep or of draws.
        key: name of the quantity. The magnitude of a pose error is its upper bound or,
            without bounds, the norm of the rotation or translation in the platform
            screw.

    Returns:
        Data array with the axes of the points.

    Raises:
        KeyError: the name is unknown.
    """
    if key in _HALVES and key not in data:
        if f"{key}_error" in data:
            return data[f"{key}_error"].sel(bound="upper", drop=True)
        part = data["platform_screw"].isel(screw=_HALVES[key])
        return np.sqrt((part**2).sum("screw", skipna=False))
    name, _, label = key.partition(".")
    if not label:
        return data[name]
    further = _further(data, name)
    for one in product(*(data[d].values for d in further)):
        if ".".join(map(str, one)) == label:
            return data[name].sel(dict(zip(further, one, strict=True)), drop=True)
    raise KeyError(key)


def _quantities(data: "xarray.Dataset") -> dict[str, str]:
    """Return the units of all numeric quantities by name."""
    units: dict[str, str] = {}
    points = set(data["status"].dims)
    for name in map(str, data.data_vars):
        variable = data[name]
        if variable.dtype.kind != "f" or not points <= set(variable.dims):
            continue
        unit = variable.attrs.get("units", "")
        for one in product(*(data[d].values for d in _further(data, name))):
            label = ".".join(map(str, one))
            units[f"{name}.{label}" if label else name] = component_unit(unit, label)
    if "platform_screw" in data:
        units = {"rotation": "rad", "translation": "m"} | units
    return units


def _further(data: "xarray.Dataset", name: str) -> list[str]:
    """Return the axes of a variable that are not axes of the points."""
    return [str(d) for d in data[name].dims if d not in data["status"].dims]
