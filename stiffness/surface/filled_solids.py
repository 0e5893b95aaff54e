"""The solids of a STEP file that one link is made of, and the faces between them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class FilledSolids:
    """Solids that touch, with the triangles around each.

    Attributes:
        names: of the solids.
        points: (n, 3) [m].
        triangles: (m, 3) indices of points; two solids that touch have the same ones.
        sides: (m, 2) the solids on both sides, by their place in ``names``; -1 outside.
        overlaps: pairs of them that fill the same place, one line each.
    """

    names: tuple[str, ...]
    points: NDArray
    triangles: NDArray
    sides: NDArray
    overlaps: tuple[str, ...] = ()

    def around(self, members: Sequence[str]) -> tuple[NDArray, NDArray]:
        """Bound some of the solids.

        Args:
            members: their names.

        Returns:
            (k, 3) triangles around them, and (k,) which of these are inside the link.
        """
        chosen = [number for number, name in enumerate(self.names) if name in members]
        one, other = (np.isin(side, chosen) for side in self.sides.T)
        bound = np.asarray(one != other)
        within = np.asarray((self.sides >= 0).all(axis=1))
        return self.triangles[bound], within[bound]
