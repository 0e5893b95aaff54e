"""Compiled billiard walk: a random walk over joint positions within clearances.

Sources:
    Gryazina, Polyak (2014), Random sampling: billiard walk algorithm.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kernels.choice import kernels


@dataclass(frozen=True, eq=False)
class Positions:
    """Set of joint positions u within clearances, for the billiard walk.

    Attributes:
        M: (nu, n) axes of the Dikin ellipsoid of the set, as columns.
        starts: (cones + 1,) index of the first clearance of each cone, then nu.
        to_screw: (6, nu) [rad, m] map from u to the platform's screw.
    """

    M: NDArray
    starts: NDArray
    to_screw: NDArray

    @cached_property
    def gram(self) -> NDArray:
        """Product M M^T of the ellipsoid's axes, (nu, nu)."""
        return self.M @ self.M.T

    def start_chains(
        self, u: NDArray, rng: np.random.Generator, walks: NDArray
    ) -> None:
        """Generate initial points in random directions near the boundary.

        Args:
            u: (nu,) centre of the ellipsoid.
            rng: generator of random numbers.
            walks: (chains, nu) start points, overwritten.
        """
        bits = rng.bit_generator
        with bits.lock:
            kernels.start_chains(self.M, self.gram, self.starts, u, bits.capsule, walks)

    def walk(
        self, u: NDArray, every: int, rng: np.random.Generator, trace: NDArray
    ) -> None:
        """Advance a random chain and record its platform screw at regular intervals.

        Args:
            u: (nu,) current point of the chain; overwritten.
            every: number of trajectories between two recorded screws.
            rng: generator of random numbers.
            trace: (kept, 6) [rad, m] array to fill with the recorded screws.
        """
        bits = rng.bit_generator
        with bits.lock:
            kernels.billiard_walk(
                self.M, self.gram, self.starts, self.to_screw, every, bits.capsule, u,
                trace,
            )  # fmt: skip
