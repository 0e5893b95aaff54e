"""Problem (22) for many right sides h at one posture, several side by side, compiled.

The reduction is shared: only h differs from draw to draw.  The certificate is from
matrices made once of the columns before any elimination: y proves
``f gain - f^2 cost / 2`` for every factor f.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.kernels.choice import kernels


class Reduced(NamedTuple):
    """What all draws at a posture share.

    Attributes:
        Gt: (nu, r) columns of G as rows [sqrt(2 J)].
        starts: (cones + 1,) first clearance of each cone, and nu.
        inverse: (nu, r) pseudoinverse of G.
        cones: (nu, r) generalised force of y on each clearance, before elimination.
        gram: (r, r) the springs' complementary energy is y.gram y / 2.
        d: (nu,) [J] what each clearance carries in the tight robot under its loads;
            None without loads.
        slip: [per size of y] how much the free motions may gain by rounding ..
        slack: [J] .. whatever y is.
        stored: [J] energy that loads alone bend.
    """

    Gt: NDArray
    starts: NDArray
    inverse: NDArray
    cones: NDArray
    gram: NDArray
    d: NDArray | None
    slip: float
    slack: float
    stored: float


class Energies(NamedTuple):
    """Arrays filled by :func:`least_energies`, one row a draw.

    Attributes:
        u: (k, nu) clearances in units of their cones.
        y: (k, r) multipliers, scaled to the best proof.
        energy: (k,) [J].
        bound: (k,) [J], certified lower bound.
        outcome: (k,) 0 solved, 1 its certificate falls short.
    """

    u: NDArray
    y: NDArray
    energy: NDArray
    bound: NDArray
    outcome: NDArray


def least_energies(reduced: Reduced, h: NDArray, out: Energies) -> None:
    """Minimise |G u + h|^2 / 2 - d.u for every row of h.

    Args:
        reduced: of the posture.
        h: (k, r) [sqrt(2 J)].
        out: arrays to fill.
    """
    shared = (
        None if part is None else np.ascontiguousarray(part) for part in reduced[:6]
    )
    kernels.least_energies(*shared, *reduced[6:], np.ascontiguousarray(h), *out)
