"""Compare the poses of two models without clearances by slopes and limits.

The virtual-joint model is linear in the errors, whereas the simulation is nonlinear.
If the linear model is correct, the difference between the models is of second order.
If errors and load are multiplied by s, this difference is proportional to s^2. Its
slope in a log-log plot is 2. Each quantity of the simulation is divided by the power of
s to which the quantity is proportional in the linear model, and extrapolated to s = 0.
The limit must equal the quantity of the linear model.

Passive joints move freely about or along their z axis in both models.

======  ===============  =============================================================
symbol  code             meaning
======  ===============  =============================================================
s       ``scale``        factor on geometric errors and load
slope   ``slopes``       slope of log difference over log scale, first two orders
limit   ``limits``       quantity / s^p extrapolated to s = 0, relative difference
======  ===============  =============================================================
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Robot
from forcefit.validation.crosscheck.limits import (
    FLOOR,
    HALVES,
    difference_slope,
    limit_difference,
    slope_check,
    spring_limits,
)
from forcefit.validation.crosscheck.pair import Pair
from forcefit.validation.crosscheck.verdict import Check

# Largest accepted deviation of the slope from 2.
SLOPE_TOLERANCE = 0.1
# [-] Largest accepted pose difference from the exact model if links are springs,
# relative to the pose difference from the linear model.
EXPLAINED_TOLERANCE = 0.02
# [-] Relative first-order pose difference between K_E of a mesh and the simulated
# solid, due to round-off.
_ROUNDING = 2e-5


@dataclass(frozen=True, eq=False)
class PoseMetric:
    """Differences in platform pose, spring deformations and energy.

    Attributes:
        robot: robot without clearances.
        pairs: both solutions at each scale, largest scale first.
        springs: whether the simulation also models all links as springs.
        gravity: whether gravity acts.
    """

    robot: Robot
    pairs: tuple[Pair, ...]
    springs: bool
    gravity: bool

    @property
    def scales(self) -> NDArray:
        """Scales of the imperfections, largest first, (k,)."""
        return np.array([pair.scale for pair in self.pairs])

    @cached_property
    def components(self) -> dict[str, NDArray]:
        """Pose differences ``rotation`` [rad] and ``translation`` [m], (k, 3) each."""
        screws = np.array([pair.screw_difference for pair in self.pairs])
        return {name: screws[:, half] for name, half in HALVES.items()}

    @cached_property
    def differences(self) -> dict[str, NDArray]:
        """Norms of the ``rotation`` [rad] and ``translation`` [m] differences, (k,)."""
        return {k: np.linalg.norm(v, axis=1) for k, v in self.components.items()}

    @cached_property
    def slopes(self) -> dict[str, float]:
        """Slope of each difference; NaN if the difference is below the noise."""
        return {
            name: difference_slope(self.scales, values, FLOOR[name])
            for name, values in self.components.items()
        }

    @property
    def slope(self) -> float:
        """Slope that deviates most from 2; NaN without a significant difference."""
        known = [s for s in self.slopes.values() if not math.isnan(s)]
        return max(known, key=lambda s: abs(s - 2.0)) if known else math.nan

    @cached_property
    def unexplained(self) -> dict[str, float]:
        """Difference from the exact model over the difference from the linear model.

        The differences of platform poses at the largest scale are used.  If links are
        beams, the exact model still differs from the simulation, because a single
        spring replaces each beam.  The value is NaN without a pose difference.
        """
        first = self.pairs[0]
        if first.exact is None:
            return dict.fromkeys(HALVES, math.nan)
        remaining = first.simulated.platform_screw - first.exact.platform_screw
        shares = {}
        for name, half in HALVES.items():
            whole = float(self.differences[name][0])
            share = float(np.linalg.norm(remaining[half])) / max(whole, FLOOR[name])
            shares[name] = share if whole > FLOOR[name] else math.nan
        return shares

    @cached_property
    def limits(self) -> dict[str, Check]:
        """Relative difference of both models by quantity, extrapolated to scale 0.

        Rotations and translations are compared separately, and so are moments and
        forces.  Each difference is relative to the largest value of all frames with
        such a spring.  Differences below :data:`FLOOR` are noise.
        """
        ours = np.array([p.linear.platform_screw for p in self.pairs])
        theirs = np.array([p.simulated.platform_screw for p in self.pairs])
        limits = {}
        for name, half in HALVES.items():
            value = limit_difference(
                self.scales, ours[:, half], theirs[:, half], 1, FLOOR[name]
            )
            limits[f"platform {name}"] = value
        spread = self.gravity and not self.springs
        return limits | spring_limits(self.robot, self.pairs, spread)

    @cached_property
    def checks(self) -> dict[str, Check]:
        """Checks of the comparison, by name."""
        slopes = {}
        for name, values in self.components.items():
            slope = slope_check(self.scales, values, FLOOR[name], SLOPE_TOLERANCE)
            rounding = self.limits[f"platform {name}"].value < _ROUNDING
            if slope.value > slope.bound and rounding:
                slope = Check(math.nan, slope.bound, signal=False)
            slopes[f"slope of {name} from 2"] = slope
        limits = {f"limit of {name}": check for name, check in self.limits.items()}
        shares = {
            f"{name} that finite rotations do not explain": Check(
                share, EXPLAINED_TOLERANCE, signal=not math.isnan(share)
            )
            for name, share in self.unexplained.items()
            if self.springs
        }
        return slopes | limits | shares

    def table(self) -> dict[str, Any]:
        """Return the results of this comparison by JSON key."""
        return {
            "clearances": "left out on both sides",
            "slope": self.slope,
            "slopes": self.slopes,
            "limits": {name: check.value for name, check in self.limits.items()},
            "unexplained": self.unexplained,
        }

    def header(self) -> list[str]:
        """Return the column headings of :meth:`rows`."""
        return [
            "scale of the errors",
            "rotation difference [rad]",
            "translation difference [m]",
            "energy, simulated [J]",
            "energy, linear [J]",
        ]

    def rows(self) -> list[list[str]]:
        """Return one table row per scale."""
        differences = zip(*self.differences.values(), strict=True)
        return [
            [
                f"{pair.scale:.4g}",
                f"{turn:.3e}",
                f"{shift:.3e}",
                f"{pair.simulated.energy:.6g}",
                f"{pair.linear_energy:.6g}",
            ]
            for pair, (turn, shift) in zip(self.pairs, differences, strict=True)
        ]

    def notes(self) -> list[str]:
        """Return the lines of text above the table of scales."""
        lines = ["without clearances: simulation minus virtual-joint model"]
        known = {k: v for k, v in self.unexplained.items() if not math.isnan(v)}
        shares = [f"{100 * share:.2g} % of {half}" for half, share in known.items()]
        if shares:
            remaining = ", ".join(shares)
            lines.append(
                f"difference that the exact model does not explain: {remaining}"
            )
        if self.pairs[0].simulated.held:
            lines.append("free motions have springs of 0.01 N m/rad in all models")
        return lines
