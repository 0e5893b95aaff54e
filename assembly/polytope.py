"""A convex body in three dimensions, cut plane by plane: its corners at all times."""

import numpy as np
from numpy.typing import NDArray


class Polytope:
    """The points of a box below a growing number of planes.

    A cut drops the corners above the plane and puts new ones where it meets an edge;
    an edge is two corners with two planes in common.  Nearly parallel cuts, which a
    thin body gets, only add corners that lie together.

    Attributes:
        corners: (k, 3) all corners; some may be there more than once.
        cuts: planes so far, the box's six among them.
    """

    def __init__(self, low: NDArray, high: NDArray) -> None:
        """Begin with the box from ``low`` (3,) to ``high`` (3,)."""
        signs = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
        self.corners = np.where(signs == 1, high, low)
        # planes through each corner, as bits
        self._planes = [
            sum(1 << (2 * axis + sign) for axis, sign in enumerate(row))
            for row in signs.tolist()
        ]
        self.cuts = 6

    def cut(self, normal: NDArray, height: float) -> None:
        """Keep the points x with normal . x <= height.

        Args:
            normal: (3,) unit vector.
            height: of the plane along it.
        """
        above = self.corners @ normal - height
        out = above > 1e-14 * np.abs(self.corners).max()
        bit = 1 << self.cuts
        self.cuts += 1
        if not out.any():
            return
        inside = np.flatnonzero(~out)
        points, planes = list(self.corners[inside]), [self._planes[i] for i in inside]
        for i in np.flatnonzero(out):
            for j in inside:
                common = self._planes[i] & self._planes[j]
                if common.bit_count() >= 2:
                    share = above[i] / (above[i] - above[j])
                    edge = self.corners[j] - self.corners[i]
                    points.append(self.corners[i] + share * edge)
                    planes.append(common | bit)
        if points:
            self.corners, self._planes = np.array(points), planes

    def farthest(self) -> NDArray:
        """(3,) the corner farthest from the origin."""
        return self.corners[np.argmax(np.linalg.norm(self.corners, axis=1))]
