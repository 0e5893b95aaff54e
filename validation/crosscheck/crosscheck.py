"""The virtual-joint model against the multibody simulation of the same robot.

The virtual-joint model is linear in the errors, the simulation is not.  If the linear
model is right, what separates them is of second order: as the errors and the load are
scaled by s, the pose difference falls as s^2, a slope of 2 in a log-log plot, and every
quantity of the simulation, divided by its power of s and extrapolated to s = 0, is the
linear model's.  A wrong term of first order, even of a thousandth, bends the slope and
moves the limit.

Joint clearances are left out on both sides: passive joints move freely along their z.

======  ===============  =============================================================
symbol  code             meaning
======  ===============  =============================================================
s       ``scale``        factor on geometric errors and load
slope   ``slopes``       of log difference over log scale, as s goes to 0
limit   ``limits``       quantity / s^p extrapolated to s = 0, relative difference
======  ===============  =============================================================
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.posture import Posture
from assembly.linear.energy import CannotAssemble, solve_assembly
from assembly.linear.reduction import FreeMotion
from assembly.solvers.conic import SolverFailed
from forcefit.inputs.display import html_table, short_repr
from validation.crosscheck.limits import (
    FLOOR,
    HALVES,
    fit_slope,
    limit_difference,
    slope_check,
    spring_limits,
)
from validation.crosscheck.link_models import link_models
from validation.crosscheck.pair import Pair, exact_answer, scaled
from validation.crosscheck.spread_weight import energy_between_ends
from validation.crosscheck.verdict import (
    SCALES,
    Check,
    compare_scales,
    comparison_table,
    comparison_text,
    verdict,
)
from validation.multibody.simulation import (
    TIME_LIMIT,
    SimulationFailed,
    simulate_assembly,
    without_clearance,
)

Answer = TypeVar("Answer")
SLOPE_TOLERANCE = 0.1  # of the pose difference, around 2
EXPLAINED_TOLERANCE = 0.02  # of the pose difference, with springs as links
ELEMENTS = 4  # of each beam in the simulation


@dataclass(frozen=True, eq=False)
class Crosscheck:
    """A robot at one posture, solved twice at several scales of its errors.

    Attributes:
        posture: nominal, of the robot without clearances.
        load: (6,) [N m, N] on the platform at scale 1, base axes.
        links: how the simulation modelled links, ``"beam"`` or ``"spring"``.
        gravity: (3,) [m/s^2] at scale 1, base axes.
        pairs: one for each scale, largest first.
        asked: how many of the scales were asked for; smaller ones were added to tell.
    """

    posture: Posture
    load: NDArray
    links: str
    gravity: NDArray
    pairs: tuple[Pair, ...]
    asked: int

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def scales(self) -> NDArray:
        """(k,) factors, largest first."""
        return np.array([pair.scale for pair in self.pairs])

    @cached_property
    def differences(self) -> dict[str, NDArray]:
        """(k,) norm of the pose difference, ``rotation`` [rad], ``translation`` [m]."""
        screws = np.array([pair.screw_difference for pair in self.pairs])
        return {
            name: np.linalg.norm(screws[:, half], axis=1)
            for name, half in HALVES.items()
        }

    @cached_property
    def slopes(self) -> dict[str, float]:
        """Slope of each difference; NaN where only the solver's noise is left."""
        return {
            name: fit_slope(self.scales, values, FLOOR[name])
            for name, values in self.differences.items()
        }

    @property
    def slope(self) -> float:
        """The slope farther from 2; NaN where nothing separates the two."""
        known = [s for s in self.slopes.values() if not math.isnan(s)]
        return max(known, key=lambda s: abs(s - 2.0)) if known else math.nan

    @cached_property
    def unexplained(self) -> dict[str, float]:
        """Share of the pose difference left against the exact virtual-joint model.

        At the largest scale.  With springs as links nothing but rounding is left; with
        beams, what an end-point spring misses of a beam's own finite bending.  NaN
        where there is nothing to explain, or the simulation held free motions that
        the exact model does not.
        """
        first = self.pairs[0]
        if first.exact is None or first.simulated.held:
            return dict.fromkeys(HALVES, math.nan)
        left = first.simulated.platform_screw - first.exact.platform_screw
        answer = {}
        for name, half in HALVES.items():
            whole = float(self.differences[name][0])
            share = float(np.linalg.norm(left[half])) / max(whole, FLOOR[name])
            answer[name] = share if whole > FLOOR[name] else math.nan
        return answer

    @cached_property
    def limits(self) -> dict[str, Check]:
        """Difference of each quantity, extrapolated to no error, relative to its size.

        Screws and wrenches are compared by halves, each relative to the largest among
        all frames that have such a spring; nothing is asked below :data:`FLOOR` and
        what it does to the stiffest spring.
        """
        ours = np.array([p.linear.platform_screw for p in self.pairs])
        theirs = np.array([p.simulated.platform_screw for p in self.pairs])
        limits = {}
        for name, half in HALVES.items():
            value = limit_difference(
                self.scales, ours[:, half], theirs[:, half], 1, FLOOR[name]
            )
            limits[f"platform {name}"] = value
        spread = self.links != "spring" and bool(self.gravity.any())
        return limits | spring_limits(self.posture.robot, self.pairs, spread)

    @cached_property
    def checks(self) -> dict[str, Check]:
        """What must hold, by name."""
        slopes = {
            f"slope of {name} from 2": slope_check(
                self.scales, values, FLOOR[name], 2.0, SLOPE_TOLERANCE
            )
            for name, values in self.differences.items()
        }
        limits = {f"limit of {name}": check for name, check in self.limits.items()}
        shares = {
            f"{name} that finite rotations do not explain": Check(
                share, EXPLAINED_TOLERANCE, signal=not math.isnan(share)
            )
            for name, share in self.unexplained.items()
            if self.links == "spring"
        }
        return slopes | limits | shares

    @property
    def passed(self) -> bool:
        """Whether every check holds."""
        return verdict(self) == "passed"

    def table(self) -> dict[str, Any]:
        """Everything ``validation crosscheck`` reports, keys of the public format."""
        own = {
            "clearances": "left out on both sides",
            "slope": self.slope,
            "slopes": self.slopes,
            "limits": {name: check.value for name, check in self.limits.items()},
            "unexplained": self.unexplained,
        }
        return comparison_table(self, own)

    def header(self) -> list[str]:
        """Names of the columns of :meth:`rows`."""
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

    def text(self) -> str:
        """A table and the verdict for people, without colours."""
        name = self.posture.robot.name
        lines = [f"{name}, without clearances: simulation minus virtual-joint model"]
        known = {k: v for k, v in self.unexplained.items() if not math.isnan(v)}
        shares = [f"{100 * share:.2g} % of {half}" for half, share in known.items()]
        if shares:
            left = ", ".join(shares)
            lines.append(f"left against the model with finite rotations: {left}")
        if self.pairs[0].simulated.held:
            lines.append(
                "held in the simulation by 0.01 N m/rad: motions that are free"
            )
        return comparison_text(lines, self)


def crosscheck(
    posture: Posture,
    scales: Sequence[float] = SCALES,
    load: ArrayLike | None = None,
    links: str = "beam",
    gravity: ArrayLike | None = None,
    time_limit: float = TIME_LIMIT,
) -> Crosscheck:
    """Solve a robot with both models at several scales of its errors.

    Args:
        posture: where the robot stands; its clearances are left out.
        scales: at least two different factors on errors and load, > 0; smaller ones
            are added where these leave a check undecided.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        links: ``"beam"``: beams bend geometrically exactly; ``"spring"``: every link
            is its K_E in the simulation too, which checks everything but the beams;
            ``"fem"``: meshed links are solids in floating frames.
        gravity: (3,) [m/s^2] base axes; beams with a density and bodies with a mass
            then have weight in all three models.
        time_limit: [s] for each simulation.

    Returns:
        Both answers at every scale, and the verdict.

    Raises:
        BadInput: too few scales, or one that is not positive.
        SimulationFailed: the simulation found no equilibrium.
        CannotAssemble: the virtual-joint model has none.
        FreeMotion: the load drives a motion that nothing resists.
    """
    tight = replace(posture, robot=without_clearance(posture.robot))
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    force = wrench * [0, 0, 0, 1, 1, 1]  # its moment acts as a couple of dead forces
    models = link_models(tight.robot, links)
    g = np.zeros(3) if gravity is None else np.array(gravity, dtype=float)
    between = 0.0
    if links != "spring":
        between = energy_between_ends(tight, g, ELEMENTS)

    held: list[float] = []  # what is held at one scale is so at all smaller ones

    def solve(s: float) -> Pair:
        linear = solve_assembly(scaled(tight, s), s * wrench, gravity=s * g)
        simulated = simulate_assembly(
            tight, s, load=s * force, gravity=s * g, elements=ELEMENTS,
            time_limit=time_limit, couple=s * wrench[:3], hold=bool(held),
            **vars(models),
        )  # fmt: skip
        if simulated.held:
            held.append(s)
        exact = exact_answer(linear, s * g)
        return Pair(s, linear, simulated, exact, s**2 * between)

    def judge(pairs: tuple[Pair, ...], asked: int) -> Crosscheck:
        return Crosscheck(tight, wrench, links, g, pairs, asked)

    return compare_scales(scales, solve, judge)


def attempt(
    robot: str, check: Callable[[], Answer]
) -> tuple[Answer | None, dict[str, Any]]:
    """A check's answer, or why there is none, for sweeps and the command line.

    Args:
        robot: its name.
        check: what to run, without arguments.

    Returns:
        The answer and nothing, or None and ``status``, ``reason``, ``passed`` and a
        null ``slope``.
    """
    try:
        return check(), {}
    except SimulationFailed as error:
        status, reason = "simulation failed", str(error)
    except CannotAssemble as error:
        status, reason = "cannot assemble", str(error)
    except FreeMotion as error:
        status, reason = "no equilibrium", str(error)
    except SolverFailed as error:
        status, reason = "solver failed", str(error)
    failure = {"robot": robot, "status": status, "reason": reason}
    return None, failure | {"scales": [], "slope": None, "passed": False}


def try_crosscheck(
    posture: Posture, scales: Sequence[float] = SCALES, load: ArrayLike | None = None
) -> tuple[Crosscheck | None, dict[str, Any]]:
    """A cross-check, or why there is none; see :func:`attempt` and :func:`crosscheck`.

    Args:
        posture: where the robot stands.
        scales: factors on errors and load.
        load: (6,) [N m, N] on the platform.

    Returns:
        The cross-check or None, and the failure or nothing.
    """
    return attempt(posture.robot.name, lambda: crosscheck(posture, scales, load))
