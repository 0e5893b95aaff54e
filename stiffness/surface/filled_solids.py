"""Solids of a STEP file that form one link, and the faces between them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class FilledSolids:
    """Touching solids, with the triangles around each.

    Attributes:
        names: names of the solids.
        points: (n, 3) [m].
        triangles: (m, 3) indices of points; two solids that touch have the same ones.
        sides: (m, 2) the solids on both sides, by their index in ``names``; -1 outside.
        overlaps: pairs of solids that overlap, one line each.
    """

    names: tuple[str, ...]
    points: NDArray
    triangles: NDArray
    sides: NDArray
    overlaps: tuple[str, ...] = ()

    def around(self, members: Sequence[str]) -> tuple[NDArray, NDArray]:
        """Return the boundary of some of the solids.

        Args:
            members: their names.

        Returns:
            (k, 3) triangles around them, and (k,) whether each is inside the link.
        """
        chosen = [number for number, name in enumerate(self.names) if name in members]
        one, other = (np.isin(side, chosen) for side in self.sides.T)
        bound = np.asarray(one != other)
        within = np.asarray((self.sides >= 0).all(axis=1))
        return self.triangles[bound], within[bound]
