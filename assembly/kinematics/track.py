"""Where a continuation ends, target by target."""

from dataclasses import dataclass

from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Track:
    """End of the continuation to each target.

    Attributes:
        coordinates: (k, n) joint coordinates where it ends.
        transforms: (k, n, 4, 4) frames there.
        progress: (k,) part of the way; 1 where the target was reached.
        closure_mismatch: (k, closures) [rad, m] largest component left open.
    """

    coordinates: NDArray
    transforms: NDArray
    progress: NDArray
    closure_mismatch: NDArray

    @property
    def reached(self) -> NDArray:
        """(k,) bool."""
        return self.progress == 1.0

    @property
    def mismatch(self) -> NDArray:
        """(k,) [rad, m] largest component left open in any closure."""
        return self.closure_mismatch.max(axis=1, initial=0.0)
