"""Results of one point, or of many points with a leading point axis in every array."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from forcefit.results.display import html_table, short_repr

if TYPE_CHECKING:
    import pandas
    import xarray

Numbers = Any  # a number for one point, or an array (k,) for k points
N = TypeVar("N", float, NDArray)  # type variable: number for one point, array for many


@dataclass(frozen=True, eq=False, repr=False)
class PointResults:
    """A result of one point, or of many points with a leading axis in its arrays.

    Attributes:
        AXES: for each field that can have a leading point axis, its number of axes for
            one point.  An array with only this number of axes applies to all points.
        VARIABLES: name of the array that each column of the table of many points
            contains; columns are named as in :mod:`forcefit.assembly.model.tables`.
    """

    AXES: ClassVar[Mapping[str, int]]
    VARIABLES: ClassVar[Mapping[str, str]]

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def of_many(self) -> bool:
        """Whether the object contains the results of many points."""
        name, axes = next(iter(self.AXES.items()))
        return np.ndim(getattr(self, name)) > axes

    def __len__(self) -> int:
        if not self.of_many:
            raise TypeError(f"{type(self).__name__} of one point has no length")
        return len(getattr(self, next(iter(self.AXES))))

    def __bool__(self) -> bool:
        return True

    def __getitem__(self, rows: Any) -> Self:
        """Return one point by its number, or a selection by slice, numbers or mask."""
        taken = {}
        for name, axes in self.AXES.items():
            values = getattr(self, name)
            many = np.ndim(values) > axes
            taken[name] = plain(values[rows]) if many else values
        return replace(self, **taken)

    def __iter__(self) -> Iterator[Self]:
        return (self[i] for i in range(len(self)))

    def to_xarray(self) -> "xarray.Dataset":
        """Return a data set with dimension ``point``; see ``assembly.model.tables``."""
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
    """Return an array unchanged, or as a number if it has no axes."""
    if isinstance(values, np.ndarray):
        return values if values.ndim else values.item()
    return values.item() if isinstance(values, np.generic) else values
