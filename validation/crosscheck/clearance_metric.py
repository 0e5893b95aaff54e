"""Compare two models with clearances by their energies and spring deformations.

If a joint with clearance is not loaded, the minimum-energy pose is not unique.
Therefore the minimum energy and the deformations and wrenches of the springs are
compared, but not the poses.  In addition, the linear model is evaluated at the
simulated motions within the clearances.  The difference between the energy at these
motions and the minimum energy is called the optimality gap.  If links are springs in
the simulation, its energy must also equal the energy of the exact virtual-joint model
at full scale.

Errors, clearances and load are multiplied by the same scale s.  The energy of the
linear model is proportional to s^2. The relative optimality gap is also proportional to
s^2, until the compliance of the contacts dominates.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.closure import linearise
from forcefit.assembly.linear.reference.reduction import reduce_problem
from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.solvers.cones import into_cones
from forcefit.validation.crosscheck.limits import (
    extrapolate,
    limit_difference,
    limit_of,
)
from forcefit.validation.crosscheck.pair import Pair
from forcefit.validation.crosscheck.verdict import Check

TOLERANCE = 0.02  # [-] largest accepted relative difference
FLOOR_ENERGY = 1e-4  # [J] energy of the centring springs of joints, at scale 1


@dataclass(frozen=True, eq=False)
class ClearanceMetric:
    """Differences in energies and spring deformations, and the optimality gap.

    Attributes:
        robot: robot with its clearances.
        pairs: both solutions at each scale, largest scale first.
        springs: whether the simulation also models all links as springs.
    """

    robot: Robot
    pairs: tuple[Pair, ...]
    springs: bool

    @property
    def slope(self) -> float:
        """NaN, because poses are not compared."""
        return math.nan

    @property
    def scales(self) -> NDArray:
        """Scales of the imperfections, largest first, (k,)."""
        return np.array([pair.scale for pair in self.pairs])

    @cached_property
    def gaps(self) -> NDArray:
        """Relative optimality gaps of the simulated motions within clearances, (k,).

        See :func:`optimality_gap`.
        """
        return np.array([optimality_gap(pair) for pair in self.pairs])

    @cached_property
    def signal(self) -> bool:
        """Whether motions within clearances or spring deformations exceed the noise.

        If the robot assembles without force, the energies of both models are zero. This
        agreement is significant only if the assembly without clearances requires
        energy.
        """
        linear, s = self.pairs[0].linear, self.pairs[0].scale
        return (
            max(linear.energy_without_clearance, linear.energy) >= FLOOR_ENERGY * s**2
        )

    @cached_property
    def limits(self) -> dict[str, Check]:
        """Relative difference of each quantity, extrapolated to scale 0."""
        ours = np.array([pair.linear_energy for pair in self.pairs])
        theirs = np.array([pair.simulated.rigid_energy for pair in self.pairs])
        gap = limit_of(self.scales**2, self.gaps)
        energy = limit_difference(
            self.scales, ours, theirs, 2, 0.0, TOLERANCE, FLOOR_ENERGY
        )
        limits = {
            "energy": energy,
            "spring deformation": self._strain_limit(),
            "optimality gap": Check(gap[0], TOLERANCE, gap[1]),
        }
        return {k: replace(check, signal=self.signal) for k, check in limits.items()}

    def _strain_limit(self) -> Check:
        """Return the energy norm of the difference between spring deformations."""
        frames = self.robot.frames
        K = {"link_screws": np.zeros((len(frames), 6, 6))}
        K["joint_screws"] = np.zeros((len(frames), 6, 6))
        for i, frame in enumerate(frames):
            if frame.link is not None:
                K["link_screws"][i] = np.linalg.inv(link_compliance(frame))
            if frame.joint_stiffness is not None:
                given = frame.joint_stiffness
                K["joint_screws"][i] = np.where(np.isfinite(given), given, 0.0)
        first = self.pairs[0]
        energy = max(first.linear.energy / first.scale**2, FLOOR_ENERGY)

        def size(screws: dict[str, NDArray]) -> float:
            cost = sum(
                np.einsum("ni,nij,nj", s, K[kind], s) / 2 for kind, s in screws.items()
            )
            return float(np.sqrt(cost / energy))

        differences = {
            kind: np.array([
                (getattr(p.simulated, kind) - getattr(p.linear, kind)) / p.scale
                for p in self.pairs
            ])
            for kind in K
        }
        limit = {kind: extrapolate(self.scales, v) for kind, v in differences.items()}
        fewer = {
            kind: extrapolate(self.scales[1:], v[1:]) for kind, v in differences.items()
        }
        change = {kind: limit[kind] - fewer[kind] for kind in K}
        return Check(size(limit), TOLERANCE, 2 * size(change))

    @cached_property
    def energies(self) -> dict[str, NDArray]:
        """Relative differences of the energy from the linear and exact models, (k,).

        The values are NaN if the exact model has no solution.
        """
        relative: dict[str, list[float]] = {"linear": [], "exact": []}
        for pair in self.pairs:
            least = FLOOR_ENERGY * pair.scale**2
            for name, model in (("linear", pair.linear), ("exact", pair.exact)):
                known = math.nan if model is None else model.energy + pair.between
                difference = pair.simulated.rigid_energy - known
                relative[name].append(difference / max(known, least))
        return {name: np.array(values) for name, values in relative.items()}

    @cached_property
    def checks(self) -> dict[str, Check]:
        """Checks of the comparison, by name."""
        checks = {f"limit of {name}": check for name, check in self.limits.items()}
        exact = abs(float(self.energies["exact"][0]))
        if self.springs:
            compared = self.signal and not math.isnan(exact)
            checks["energy against finite rotations"] = Check(
                exact, TOLERANCE, signal=compared
            )
        return checks

    def table(self) -> dict[str, Any]:
        """Return the results of this comparison by JSON key."""
        return {
            "clearances": "on both sides; poses are not unique and not judged",
            "slope": None,
            "optimality_gaps": self.gaps,
            "relative_energy_differences": self.energies,
            "limits": {name: check.value for name, check in self.limits.items()},
        }

    def header(self) -> list[str]:
        """Return the column headings of :meth:`rows`."""
        return [
            "scale of imperfections",
            "energy, simulated [J]",
            "minus linear [%]",
            "minus exact [%]",
            "optimality gap [-]",
        ]

    def rows(self) -> list[list[str]]:
        """Return one table row per scale."""
        return [
            [
                f"{pair.scale:.4g}",
                f"{pair.simulated.rigid_energy:.6g}",
                f"{100 * linear:.3g}",
                f"{100 * exact:.3g}",
                f"{gap:.2e}",
            ]
            for pair, linear, exact, gap in zip(
                self.pairs, *self.energies.values(), self.gaps, strict=True
            )
        ]

    def notes(self) -> list[str]:
        """Return the lines of text above the table of scales."""
        return ["with clearances"]


def optimality_gap(pair: Pair) -> float:
    """Return the optimality gap of the simulated motions within clearances.

    Args:
        pair: both solutions of a robot with clearances.

    Returns:
        Difference of the linear model's potential energy from its minimum, divided by a
        reference energy.  The model is evaluated at the simulated motions, projected
        onto their cones.  The reference is the largest of the energy without
        clearances, the energy with clearances under load, and :data:`FLOOR_ENERGY`.
    """
    best = pair.linear
    small = reduce_problem(linearise(best.posture), best.joints, best.frame_loads)
    cones = best.joints.cones
    # Each column of ``cones`` has a single nonzero entry, the inverse of a bound.
    u = cones.T @ pair.simulated.clearance_screws.ravel() / (cones**2).sum(axis=0)
    u = into_cones(u, best.joints.group)
    strain, least = small.G @ u + small.h, small.G @ best.clearances + small.h
    cost = (strain @ strain - least @ least) / 2 - small.d @ (u - best.clearances)
    least_reference = FLOOR_ENERGY * pair.scale**2
    reference = max(small.energy_without_clearance, best.energy, least_reference)
    return float(cost / reference)
