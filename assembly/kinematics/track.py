"""End points of a continuation to many targets."""

from dataclasses import dataclass

from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Track:
    """Postures at which the continuation to each of many targets ended.

    Attributes:
        coordinates: (k, n) joint coordinates at the end points.
        transforms: (k, n, 4, 4) frames at the end points.
        progress: (k,) [-] fraction of the path that was followed; 1 if the target was
            reached.
        closure_mismatch: (k, closures) [rad, m] largest component of each closure
            error.
    """

    coordinates: NDArray
    transforms: NDArray
    progress: NDArray
    closure_mismatch: NDArray

    @property
    def reached(self) -> NDArray:
        """(k,) bool, True if the target was reached."""
        return self.progress == 1.0

    @property
    def mismatch(self) -> NDArray:
        """(k,) [rad, m] largest component of all closure errors."""
        return self.closure_mismatch.max(axis=1, initial=0.0)
