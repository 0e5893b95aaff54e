"""End points of motions to many targets."""

from dataclasses import dataclass

from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Track:
    """Postures at the ends of motions to many targets.

    Attributes:
        coordinates: (k, n) joint coordinates at the end points.
        transforms: (k, n, 4, 4) frames at the end points.
        progress: (k,) [-] fraction of the path; 1 if the target was reached.
        closure_mismatch: (k, closures) [rad, m] largest component of each closure
            error.
    """

    coordinates: NDArray
    transforms: NDArray
    progress: NDArray
    closure_mismatch: NDArray

    @property
    def reached(self) -> NDArray:
        """True for targets that were reached, (k,)."""
        return self.progress == 1.0

    @property
    def mismatch(self) -> NDArray:
        """Largest component of all closure errors of each target, (k,) [rad, m]."""
        return self.closure_mismatch.max(axis=1, initial=0.0)
