"""Results of one point, or of many with a leading axis in every array."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from forcefit.inputs.display import html_table, short_repr

if TYPE_CHECKING:
    import pandas
    import xarray

# a number of one point, or an array (k,) of many
Numbers = Any


class PointResults(ABC):
    """A result whose arrays have a leading axis where it is of many points.

    Attributes:
        VARIABLES: the array of each variable of the table of many points, by the names
            of :mod:`assembly.model.tables`.
    """

    VARIABLES: ClassVar[dict[str, str]]

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def of_many(self) -> bool:
        """Whether there is a leading axis."""
        return np.ndim(self._first) > 0

    @property
    def _first(self) -> Numbers:
        """One of the numbers that every point has."""
        return getattr(self, next(iter(self.VARIABLES.values())))

    def __len__(self) -> int:
        if not self.of_many:
            raise TypeError(f"{type(self).__name__} of one point has no length")
        return len(self._first)

    def __bool__(self) -> bool:
        return True

    @abstractmethod
    def __getitem__(self, rows: Any) -> Self:
        """One point, by a whole number; or some, by a slice, numbers or a mask."""

    def __iter__(self) -> Iterator[Self]:
        return (self[i] for i in range(len(self)))

    def to_xarray(self) -> "xarray.Dataset":
        """Over ``point``; see :mod:`assembly.model.tables`."""
        from assembly.model.tables import points_dataset

        arrays = {name: getattr(self, own) for name, own in self.VARIABLES.items()}
        return points_dataset(arrays)

    def to_pandas(self) -> "pandas.DataFrame":
        """A row for each point, columns (variable, component)."""
        from assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "point")
