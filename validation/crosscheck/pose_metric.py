"""Poses of two models without clearances: slopes, limits, explained differences.

The virtual-joint model is linear in the errors, the simulation is not.  If the linear
model is right, their difference is of second order: as the errors and the load are
scaled by s, the pose difference falls as s^2, a slope of 2 in a log-log plot, and every
quantity of the simulation, divided by its power of s and extrapolated to s = 0, is the
linear model's.  A wrong term of first order, even of a thousandth, changes the slope
and the limit.  Passive joints move freely along their z on both sides.

======  ===============  =============================================================
symbol  code             meaning
======  ===============  =============================================================
s       ``scale``        factor on geometric errors and load
slope   ``slopes``       of log difference over log scale, first two orders
limit   ``limits``       quantity / s^p extrapolated to s = 0, relative difference
======  ===============  =============================================================
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.model.robot import Robot
from validation.crosscheck.limits import (
    FLOOR,
    HALVES,
    difference_slope,
    limit_difference,
    slope_check,
    spring_limits,
)
from validation.crosscheck.pair import Pair
from validation.crosscheck.verdict import Check

SLOPE_TOLERANCE = 0.1  # of the pose difference, around 2
EXPLAINED_TOLERANCE = 0.02  # of the pose difference, with springs as links
# relative, of the pose: a first-order difference that a mesh's K_E may have against the
# solid by rounding; it says nothing where second orders are as small
_ROUNDING = 2e-5


@dataclass(frozen=True, eq=False)
class PoseMetric:
    """Differences of the platform's pose, of springs and energy.

    Attributes:
        robot: without clearances.
        pairs: both solutions at each scale, largest first.
        springs: whether all links are springs in the simulation too.
        gravity: whether there is any.
    """

    robot: Robot
    pairs: tuple[Pair, ...]
    springs: bool
    gravity: bool

    @property
    def scales(self) -> NDArray:
        """(k,) factors, largest first."""
        return np.array([pair.scale for pair in self.pairs])

    @cached_property
    def components(self) -> dict[str, NDArray]:
        """(k, 3) pose difference, ``rotation`` [rad], ``translation`` [m]."""
        screws = np.array([pair.screw_difference for pair in self.pairs])
        return {name: screws[:, half] for name, half in HALVES.items()}

    @cached_property
    def differences(self) -> dict[str, NDArray]:
        """(k,) norm of the pose difference, ``rotation`` [rad], ``translation`` [m]."""
        return {k: np.linalg.norm(v, axis=1) for k, v in self.components.items()}

    @cached_property
    def slopes(self) -> dict[str, float]:
        """Slope of each difference; NaN where only the solver's noise is left."""
        return {
            name: difference_slope(self.scales, values, FLOOR[name])
            for name, values in self.components.items()
        }

    @property
    def slope(self) -> float:
        """The slope farther from 2; NaN where there is no difference."""
        known = [s for s in self.slopes.values() if not math.isnan(s)]
        return max(known, key=lambda s: abs(s - 2.0)) if known else math.nan

    @cached_property
    def unexplained(self) -> dict[str, float]:
        """Share of the pose difference left against the exact virtual-joint model.

        At the largest scale.  With springs as links nothing but rounding is left; with
        beams, what an end-point spring misses of a beam's own finite bending.  NaN
        where there is nothing to explain.
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
        """Difference of each quantity, extrapolated to no error, relative to its size.

        Screws and wrenches are compared by halves, each relative to the largest among
        all frames that have such a spring; differences below :data:`FLOOR`, and the
        wrench they cause in the stiffest spring, are noise.
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
        """What must hold, by name."""
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
        """Its own keys of the public format."""
        return {
            "clearances": "left out on both sides",
            "slope": self.slope,
            "slopes": self.slopes,
            "limits": {name: check.value for name, check in self.limits.items()},
            "unexplained": self.unexplained,
        }

    def header(self) -> list[str]:
        """Return the names of the columns of :meth:`rows`."""
        return [
            "scale of the errors",
            "rotation difference [rad]",
            "translation difference [m]",
            "energy, simulated [J]",
            "energy, linear [J]",
        ]

    def rows(self) -> list[list[str]]:
        """One row for each scale, as text."""
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
        """Return the lines of text before the table of scales."""
        lines = ["without clearances: simulation minus virtual-joint model"]
        known = {k: v for k, v in self.unexplained.items() if not math.isnan(v)}
        shares = [f"{100 * share:.2g} % of {half}" for half, share in known.items()]
        if shares:
            remaining = ", ".join(shares)
            lines.append(f"left against the model with finite rotations: {remaining}")
        if self.pairs[0].simulated.held:
            lines.append("held in all models by 0.01 N m/rad: motions that are free")
        return lines
