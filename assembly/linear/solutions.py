"""What compiled functions say of many points, one row each."""

from typing import NamedTuple

from assembly.solvers.layouts import Indices, Matrix, Vector

# whether a margin (21), or a bound of a pose error (27), is solved
SOLVED, FALLBACK = range(2)


class Solutions(NamedTuple):
    """Problem (22), as arrays that compiled functions fill.

    Attributes:
        outcome: (k,) NEWTON or INTERIOR, or the reason for the fallback.
        energy: (k,) [J].
        bound: (k,) [J] certified lower bound of it.
        without_clearance: (k,) [J] energy if every clearance stayed at zero.
        platform_screw: (k, 6) [rad, m].
        clearances: (k, nu) in units of their cones.
        motions: (k, nq) [rad, m].
        multipliers: (k, 6 closures) of the scaled closures.
        residual: (k,) [rad, reference lengths] largest of the closures.
        elastic: (k, ny) [sqrt(2 J)] scaled deformation of the springs; no rows where
            nobody asks.
    """

    outcome: Indices
    energy: Vector
    bound: Vector
    without_clearance: Vector
    platform_screw: Matrix
    clearances: Matrix
    motions: Matrix
    multipliers: Matrix
    residual: Vector
    elastic: Matrix
