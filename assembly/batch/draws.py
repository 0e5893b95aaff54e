"""Least energies of many draws of the errors at one posture."""

from dataclasses import dataclass, fields

from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Draws:
    """Least energies of k draws at one posture, each with its certificate.

    Attributes:
        errors: (k, n, 6) [rad, m] delta l of every draw.
        energy: (k,) [J]; NaN where there is no solution.
        bound: (k,) [J] certified lower bound.
        clearances: (k, nu) in units of the cones; NaN where the bound of a passive
            joint's own motion is active that is no cone here.
        multipliers: (k, 6 closures) of the scaled closure rows.
        platform_screw: (k, 6) [rad, m] at the platform's origin, base axes.
        fallback: (k,) bool, solved by
            :func:`assembly.linear.energy.minimise_energies`, or, under loads, by
            :func:`assembly.linear.energy.solve_assembly`.
    """

    errors: NDArray
    energy: NDArray
    bound: NDArray
    clearances: NDArray
    multipliers: NDArray
    platform_screw: NDArray
    fallback: NDArray

    def taken(self, rows: NDArray) -> "Draws":
        """Some of the draws.

        Args:
            rows: indices of them, or which they are.

        Returns:
            These, in that order.
        """
        return Draws(*(getattr(self, one.name)[rows] for one in fields(self)))
