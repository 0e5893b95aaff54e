"""Solids in a STEP file that form one link."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class FilledSolids:
    """Solids that touch, and their triangles.

    Attributes:
        names: names of the solids.
        points: (n, 3) [m] corners.
        triangles: (m, 3) indices of points. A triangle between two solids belongs to
            both.
        sides: (m, 2) index in ``names`` of the solid on each side of a triangle, or -1.
        overlaps: descriptions of pairs of solids that overlap.
    """

    names: tuple[str, ...]
    points: NDArray
    triangles: NDArray
    sides: NDArray
    overlaps: tuple[str, ...] = ()

    def around(self, members: Sequence[str]) -> tuple[NDArray, NDArray]:
        """Return the boundary of given solids.

        Args:
            members: names of the solids.

        Returns:
            Triangles on the boundary of the union, (k, 3), and (k,) bool, True for
            triangles inside the link.
        """
        chosen = [number for number, name in enumerate(self.names) if name in members]
        one, other = (np.isin(side, chosen) for side in self.sides.T)
        bound = np.asarray(one != other)
        within = np.asarray((self.sides >= 0).all(axis=1))
        return self.triangles[bound], within[bound]
