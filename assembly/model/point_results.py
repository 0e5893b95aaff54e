"""Base class of results at one or many points."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from forcefit.results.display import html_table, short_repr

if TYPE_CHECKING:
    import pandas
    import xarray

Numbers = Any  # number for one point, or array (k,) for k points
N = TypeVar("N", float, NDArray)  # number for one point, array for many


@dataclass(frozen=True, eq=False, repr=False)
class PointResults:
    """Result at one point, or at many points along the first axis of its arrays.

    Attributes:
        AXES: number of array axes for one point, by field.  In a result at many points,
            an array with this number of axes applies to all points.
        VARIABLES: name of the field for each variable in :meth:`to_xarray`.
    """

    AXES: ClassVar[Mapping[str, int]]
    VARIABLES: ClassVar[Mapping[str, str]]

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def of_many(self) -> bool:
        """Whether the object contains results at many points."""
        name, axes = next(iter(self.AXES.items()))
        return np.ndim(getattr(self, name)) > axes

    def __len__(self) -> int:
        if not self.of_many:
            raise TypeError(f"{type(self).__name__} of one point has no length")
        return len(getattr(self, next(iter(self.AXES))))

    def __bool__(self) -> bool:
        return True

    def __getitem__(self, rows: Any) -> Self:
        """Return the results at one point or at a selection of points."""
        taken = {}
        for name, axes in self.AXES.items():
            values = getattr(self, name)
            many = np.ndim(values) > axes
            taken[name] = plain(values[rows]) if many else values
        return replace(self, **taken)

    def __iter__(self) -> Iterator[Self]:
        return (self[i] for i in range(len(self)))

    def to_xarray(self) -> "xarray.Dataset":
        """Return a dataset with dimension ``point``; see ``assembly.model.tables``."""
        from forcefit.assembly.model.tables import points_dataset

        arrays = {name: getattr(self, own) for name, own in self.VARIABLES.items()}
        if not self.of_many:
            arrays = {name: np.asarray(value)[None] for name, value in arrays.items()}
        return points_dataset(arrays)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a table with one row per point and columns (variable, component)."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "point")


def plain(values: Any) -> Any:
    """Convert an array without axes to a number; return other values unchanged."""
    if isinstance(values, np.ndarray):
        return values if values.ndim else values.item()
    return values.item() if isinstance(values, np.generic) else values
