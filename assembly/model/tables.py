"""Results as labelled arrays (xarray) and tables (pandas).

Names, dimensions and units are the same as in the NetCDF file of a sweep.  Each
variable has the attributes ``units`` and ``long_name``.  Both packages are imported on
first use.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Robot
from forcefit.results.quantities import LABELS, QUANTITIES

if TYPE_CHECKING:
    import pandas
    import xarray

# name of the variable for each quantity whose variable has a different name
_RENAMED = {
    "clearance_screw": "clearance", "link_screw": "link", "joint_screw": "joint",
    "stiffness": "axis_stiffness", "stiffness_matrix": "stiffness", "read_at": "point",
}  # fmt: skip
NO_LABELS: Mapping[str, Sequence[Any]] = {}


class PlacedRobot(Protocol):
    """Protocol of a robot in a nominal posture."""

    @property
    def robot(self) -> Robot:
        """The robot."""

    def pose(self) -> dict[str, float]:
        """Return the nominal platform pose by component."""


class ForcedAssembly(Protocol):
    """Protocol of an assembly, computed with small or finite motions."""

    @property
    def posture(self) -> PlacedRobot:
        """Nominal posture of the robot."""

    @property
    def clearance_screws(self) -> NDArray:
        """Displacements within the clearances (n, 6) [rad, m]."""

    @property
    def link_screws(self) -> NDArray:
        """Link deformations (n, 6) [rad, m]."""

    @property
    def joint_screws(self) -> NDArray:
        """Joint deformations (n, 6) [rad, m]."""

    @property
    def tip_wrenches(self) -> NDArray:
        """Wrenches transmitted by the bodies (n, 6) [N m, N]."""

    @property
    def joint_wrenches(self) -> NDArray:
        """Wrenches transmitted by the joints (n, 6) [N m, N]."""

    @property
    def closure_wrenches(self) -> NDArray:
        """Wrenches transmitted by the closures (closures, 6) [N m, N]."""


def assembly_dataset(assembly: ForcedAssembly) -> "xarray.Dataset":
    """Return the results of an assembly as a dataset, by frame and by closure.

    Args:
        assembly: assembly computed with the linear model or with finite motions.

    Returns:
        Dataset with dimensions ``frame``, ``screw``, ``wrench_component`` and
        ``closure``; the pose components are scalar coordinates.
    """
    robot = assembly.posture.robot
    frames = {
        "geometric_error": robot.errors,
        "clearance_screw": assembly.clearance_screws,
        "link_screw": assembly.link_screws,
        "joint_screw": assembly.joint_screws,
        "wrench": assembly.tip_wrenches,
        "joint_wrench": assembly.joint_wrenches,
    }
    single = {
        name: getattr(assembly, name)
        for name in ("energy", "potential", "platform_screw", "load")
    }
    data = labelled(frames, "frame", [f.name for f in robot.frames])
    pose = {
        name: ((), value, {"units": "m" if name[0] == "t" else "rad"})
        for name, value in assembly.posture.pose().items()
    }
    data = data.merge(labelled(single)).assign_coords(pose)
    about = QUANTITIES["closure_wrench"]
    data["closure_wrench"] = (
        ("closure", *about.dims), assembly.closure_wrenches, about.attributes
    )  # fmt: skip
    data = data.assign_coords(closure=[" - ".join(pair) for pair in robot.closures])
    return data.assign_attrs(robot=robot.name)


def points_dataset(values: Mapping[str, NDArray]) -> "xarray.Dataset":
    """Return results at many points as a dataset with the dimension ``point``.

    Args:
        values: array (k, ...) of each sweep variable, by name.

    Returns:
        Dataset with units.
    """
    count = len(next(iter(values.values())))
    return labelled(values, "point", np.arange(count))


def frame_table(data: "xarray.Dataset", *rows: str) -> "pandas.DataFrame":
    """Convert a dataset to a table with one column per component.

    Args:
        data: dataset; variables without all of the dimensions ``rows`` are omitted.
        rows: dimensions that become the index of the table.

    Returns:
        Table whose columns are pairs (variable, component).  The component contains the
        labels along the remaining dimensions, joined by dots.  ``attrs["units"]``
        contains the unit of each variable and dimension.
    """
    import pandas

    columns: dict[tuple[str, str], NDArray] = {}
    sizes = {row: data.sizes[row] for row in rows}
    # coordinates of the rows, for example the pose components
    kept = {
        str(name): v.variable.set_dims(sizes) for name, v in data.coords.items()
        if name not in data.dims and v.dims and {*v.dims} <= {*rows}
    }  # fmt: skip
    kept |= {
        str(name): v.variable for name, v in data.data_vars.items()
        if {*rows} <= {*v.dims}
    }  # fmt: skip
    for name, variable in kept.items():
        further = [d for d in variable.dims if d not in rows]
        labels = [".".join(map(str, one)) for one in product(
            *(data[d].values for d in further)
        )]  # fmt: skip
        ordered = variable.transpose(*rows, *further).values
        flat = ordered.reshape(math.prod(sizes.values()), len(labels))
        columns |= {(name, c): flat[:, k] for k, c in enumerate(labels)}
    axes = [data[row].values for row in rows]
    index = (
        pandas.Index(axes[0], name=rows[0]) if len(rows) == 1
        else pandas.MultiIndex.from_product(axes, names=rows)
    )  # fmt: skip
    table = pandas.DataFrame(columns, index=index)
    table.columns.names = ["variable", "component"]
    kept |= {row: data[row].variable for row in rows}
    table.attrs["units"] = {n: v.attrs.get("units", "") for n, v in kept.items()}
    return table


def component_unit(unit: str, component: str) -> str:
    """Return the unit of one component of a variable with mixed units.

    Args:
        unit: unit of the variable, for example ``"rad, m"``.
        component: component as in :func:`frame_table`, for example ``RX``, ``FZ`` or
            ``rotation``.

    Returns:
        Unit of the component.
    """
    kinds = [label[:1].upper() for label in component.split(".")]
    if unit.count(", ") == 1:
        return unit.split(", ")[kinds[-1] in {"T", "F"}]
    if " .. " in unit and len(kinds) == 2:
        turns, moments = kinds[0] == "R", kinds[1] == "M"
        return f"{'rad' if turns else 'm'}/{'(N m)' if moments else 'N'}"
    return unit


def labelled(
    values: Mapping[str, Any],
    axis: str = "",
    points: Sequence[Any] | NDArray = (),
    labels: Mapping[str, Sequence[Any]] = NO_LABELS,
) -> "xarray.Dataset":
    """Combine arrays into a dataset with units and descriptions.

    Args:
        values: array of each variable by name, or a pair of a
            :class:`~forcefit.results.quantities.Quantity` and its array.
        axis: name of a common first dimension of all arrays, or empty.
        points: labels along this dimension.
        labels: labels along dimensions without standard labels.

    Returns:
        Labelled dataset.
    """
    import xarray

    data: dict[str, Any] = {}
    coords: dict[str, Any] = {axis: points} if axis else {}
    for name, value in values.items():
        known, array = (
            value if isinstance(value, tuple)
            else (QUANTITIES[_RENAMED.get(name, name)], value)
        )  # fmt: skip
        dims = (axis, *known.dims) if axis else known.dims
        data[name] = (dims, np.asarray(array), known.attributes)
        coords |= {dim: list({**LABELS, **labels}[dim]) for dim in known.dims}
    return xarray.Dataset(data, coords)
