"""What compiled functions say of many points, one row each."""

from typing import NamedTuple

from numpy.typing import NDArray

from assembly.linear.robot_structure import Structure

# whether a margin (21), or a bound of a pose error (27), is solved
SOLVED, FALLBACK = range(2)


class ClearanceLoads(NamedTuple):
    """Loads and slack of the clearances of k points, from the solution of (22).

    Attributes:
        structure: the robot of (22).
        multipliers: (k, 6 closures) of the scaled closures.
        clearances: (k, nu) in units of these cones.
        energy: (k,) [J].
        without_clearance: (k,) [J] energy if every clearance stayed at zero.
        cone_of: (cones,) the cone of (22) of each cone of the reading.
    """

    structure: Structure
    multipliers: NDArray
    clearances: NDArray
    energy: NDArray
    without_clearance: NDArray
    cone_of: NDArray


class Centres(NamedTuple):
    """Where the solution of (22) leaves k points.

    Attributes:
        screws: (k, 6) [rad, m] of the platform at its origin.
        clearances: (k, nu) in the cones of the reading.
        motions: (k, nq) [rad, m] where they have a bound, else anything.
    """

    screws: NDArray
    clearances: NDArray
    motions: NDArray


class Bounds(NamedTuple):
    """Rows of arrays filled by problem (27), one row a point.

    Attributes:
        rotation: (k, 2) [rad] lower and upper.
        translation: (k, 2) [m] likewise.
        rotation_screw: (k, 6) [rad, m] attains the lower bound.
        translation_screw: (k, 6) likewise.
        supports: (k,) support functions computed.
        outcome: (k,) SOLVED or FALLBACK.
    """

    rotation: NDArray
    translation: NDArray
    rotation_screw: NDArray
    translation_screw: NDArray
    supports: NDArray
    outcome: NDArray
