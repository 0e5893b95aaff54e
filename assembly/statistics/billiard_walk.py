"""The billiard walk through the set of clearance positions, compiled.

Sources:
    Gryazina, Polyak (2014), Random sampling: billiard walk algorithm.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly.kernels.choice import kernels


@dataclass(frozen=True, eq=False)
class Positions:
    """The set of clearance positions.

    Attributes:
        M: (nu, n) axes of Dikin's ellipsoid.
        starts: (cones + 1,) first column of each cone, and nu.
        to_screw: (6, nu) [rad, m] from u to the platform's screw.
    """

    M: NDArray
    starts: NDArray
    to_screw: NDArray

    @cached_property
    def gram(self) -> NDArray:
        """(nu, nu) M M^T."""
        return self.M @ self.M.T

    def start_chains(
        self, u: NDArray, rng: np.random.Generator, walks: NDArray
    ) -> None:
        """Compute the chains' starts: close to the boundary, in random directions.

        Args:
            u: (nu,) the ellipsoid's centre.
            rng: generator of random numbers.
            walks: (chains, nu) the starts, overwritten.
        """
        bits = rng.bit_generator
        with bits.lock:
            kernels.start_chains(self.M, self.gram, self.starts, u, bits.capsule, walks)

    def walk(
        self, u: NDArray, every: int, rng: np.random.Generator, trace: NDArray
    ) -> None:
        """Continue a chain; keep its platform screw at regular intervals.

        Args:
            u: (nu,) the chain's point, overwritten.
            every: number of trajectories between two screws.
            rng: generator of random numbers.
            trace: (kept, 6) [rad, m] overwritten with the screws.
        """
        bits = rng.bit_generator
        with bits.lock:
            kernels.billiard_walk(
                self.M, self.gram, self.starts, self.to_screw, every, bits.capsule, u,
                trace,
            )  # fmt: skip
