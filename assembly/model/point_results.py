"""Results of many points: a sequence of single ones, and a table of them all."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar, Generic, TypeVar

from forcefit.inputs.display import html_table, short_repr

if TYPE_CHECKING:
    import pandas
    import xarray

One = TypeVar("One")


class PointResults(ABC, Generic[One]):
    """Arrays with a row for each of k points; ``[i]`` is one of them.

    Attributes:
        VARIABLES: the array of each variable of the table, by the names of
            :mod:`assembly.model.tables`.
    """

    VARIABLES: ClassVar[dict[str, str]]

    __repr__, _repr_html_ = short_repr, html_table

    def __len__(self) -> int:
        return len(getattr(self, next(iter(self.VARIABLES.values()))))

    @abstractmethod
    def __getitem__(self, i: int) -> One:
        """Point i."""

    def __iter__(self) -> Iterator[One]:
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
