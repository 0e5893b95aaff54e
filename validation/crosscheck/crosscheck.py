"""Compare the virtual-joint model of a robot with its multibody simulation.

Both models are solved at several scales.  A scale is a factor on the load, the
geometric errors and the clearances.  Without clearances, the platform poses are
compared (:mod:`forcefit.validation.crosscheck.pose_metric`).  With clearances, energies
and springs are compared (:mod:`forcefit.validation.crosscheck.clearance_metric`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import (
    CannotAssemble,
    failure_status,
    solve_assembly,
)
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.given_load import Load, given_load
from forcefit.assembly.model.statuses import (
    FAILS,
    OK,
    PASSED,
    SIMULATION_FAILED,
    UNDECIDED,
)
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.results.display import html_table, short_repr
from forcefit.validation.crosscheck.clearance_metric import ClearanceMetric
from forcefit.validation.crosscheck.link_models import link_models
from forcefit.validation.crosscheck.pair import (
    Pair,
    exact_solution,
    hold_free_motions,
    scaled,
)
from forcefit.validation.crosscheck.pose_metric import PoseMetric
from forcefit.validation.crosscheck.resolution import (
    Resolution,
    resolution_text,
    resolutions,
)
from forcefit.validation.crosscheck.spread_weight import energy_between_ends
from forcefit.validation.crosscheck.verdict import (
    NOT_CHECKED,
    SCALES,
    Check,
    compare_scales,
    verdict,
    verdict_text,
)
from forcefit.validation.multibody.simulation import (
    TIME_LIMIT,
    SimulationFailed,
    simulate_assembly,
    without_clearance,
)

Result = TypeVar("Result")
ELEMENTS = 4  # number of elements of each beam in the simulation


class Metric(Protocol):
    """Protocol of a comparison between two models at several scales."""

    @property
    def slope(self) -> float:
        """Log-log slope of the pose difference over the scale; NaN if not compared."""

    @property
    def checks(self) -> dict[str, Check]:
        """Checks of the comparison, by name."""

    def notes(self) -> list[str]:
        """Return the lines of text above the table of scales."""

    def header(self) -> list[str]:
        """Return the column headings of :meth:`rows`."""

    def rows(self) -> list[list[str]]:
        """Return one table row per scale."""

    def table(self) -> dict[str, Any]:
        """Return the results of this comparison by JSON key."""


@dataclass(frozen=True, eq=False)
class Crosscheck:
    """Solutions of one posture by two models at several scales.

    Attributes:
        posture: the nominal posture.
        load: (6,) [N m, N] load on the platform at scale 1, base axes.
        links: model of links in the simulation: ``"beam"``, ``"spring"`` or ``"fem"``.
        gravity: (3,) [m/s^2] gravity at scale 1, base axes.
        pairs: solutions at each scale, largest first.
        asked: number of requested scales. Scales that were added are not counted.
        metric: comparison of the solutions.
    """

    posture: Posture
    load: NDArray
    links: str
    gravity: NDArray
    pairs: tuple[Pair, ...]
    asked: int
    metric: Metric

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def scales(self) -> NDArray:
        """Scales of the imperfections, largest first, (k,)."""
        return np.array([pair.scale for pair in self.pairs])

    @property
    def slope(self) -> float:
        """Log-log slope of the pose difference over the scale; NaN if not compared."""
        return self.metric.slope

    @property
    def checks(self) -> dict[str, Check]:
        """Checks of the comparison, by name."""
        return self.metric.checks

    @cached_property
    def resolutions(self) -> list[Resolution]:
        """Smallest detectable change of each robot parameter."""
        assert isinstance(self.metric, PoseMetric | ClearanceMetric)
        return resolutions(
            self.posture, self.pairs, self.metric, self.load, self.gravity
        )

    @property
    def passed(self) -> bool:
        """Whether every check is satisfied."""
        return verdict(self) == PASSED

    def table(self) -> dict[str, Any]:
        """Return all results of ``validation crosscheck`` by JSON key.

        Returns:
            Mapping in which ``scales`` contains the requested scales and
            ``added_scales`` all others.
        """
        robot = self.posture.robot
        tables = [pair.table(robot) for pair in self.pairs]
        outcome = verdict(self)
        return {
            "robot": robot.name,
            "status": OK,
            "pose": self.posture.pose(),
            "load": self.load,
            "gravity": self.gravity,
            "links": self.links,
            "scales": tables[: self.asked],
            "added_scales": tables[self.asked :],
            **self.metric.table(),
            "checks": {
                name: {
                    "value": check.value,
                    "tolerance": check.bound,
                    "uncertainty": check.uncertainty,
                    "verdict": check.verdict,
                    "passed": check.verdict == OK,
                }
                for name, check in self.checks.items()
            },
            "smallest_changes_noticed": [
                {
                    "name": one.name,
                    "kind": one.kind,
                    "value": one.value,
                    "relative": one.smallest,
                    "check": one.by,
                    "unproved": one.unproved,
                }
                for one in self.resolutions
            ],
            "verdict": outcome,
            "passed": outcome == PASSED,
        }

    def text(self) -> str:
        """Format the table of scales and the verdict as plain text."""
        cells = [self.metric.header(), *self.metric.rows()]
        lines = [f"{self.posture.robot.name}, {self.metric.notes()[0]}"]
        lines += self.metric.notes()[1:]
        lines += ["  ".join(f"{cell:>26}" for cell in row) for row in cells]
        words = {OK: "ok", FAILS: "FAILS", UNDECIDED: "NOT DECIDED"}
        for name, check in self.checks.items():
            word = words.get(check.verdict)
            value = f"{check.value:.1e} (bound {check.bound:g})"
            lines.append(
                f"{name}: {NOT_CHECKED if word is None else f'{value} {word}'}"
            )
        added = len(self.pairs) - self.asked
        if added:
            lines.append(f"scales added: {added}")
        lines += resolution_text(self.resolutions)
        return "\n".join([*lines, verdict_text(self)])


def crosscheck(
    posture: Posture,
    scales: Sequence[float] = SCALES,
    load: Load | None = None,
    links: str = "beam",
    gravity: ArrayLike | None = None,
    time_limit: float = TIME_LIMIT,
    clearances: bool = False,
) -> Crosscheck:
    """Cross-check both models of a robot at several scales of its imperfections.

    Args:
        posture: the robot's configuration.
        scales: at least two different factors > 0 on errors, clearances and load.
            Smaller scales are added if a check is undecided.
        load: (6,) [N m, N] load on the platform at its origin, in base axes, or a
            mapping from component to value such as ``{"fz": -50}``.
        links: model of the links in the simulation.  ``"beam"``: geometrically exact
            beams.  ``"spring"``: springs with the stiffness K_E of the links.
            ``"fem"``: solids in floating frames for meshed links.
        gravity: (3,) [m/s^2] gravity in base axes.  Beams with a density and bodies
            with a mass then have weight in all models.
        time_limit: [s] time limit of each simulation.
        clearances: whether both models include clearances.

    Returns:
        Both solutions at every scale and the verdict.

    Raises:
        BadInput: fewer than two scales are given, or a scale is not positive.
        SimulationFailed: the simulation found no equilibrium.
        CannotAssemble: the virtual-joint model has no solution.
        FreeMotion: no joint or link resists the load.
    """
    robot = posture.robot if clearances else without_clearance(posture.robot)
    compared = replace(posture, robot=robot)
    wrench = np.zeros(6) if load is None else given_load(load)
    force = wrench * [0, 0, 0, 1, 1, 1]  # the moment is applied as a couple
    model = replace(link_models(robot, links), elements=ELEMENTS, clearances=clearances)
    g = np.zeros(3) if gravity is None else np.array(gravity, dtype=float)
    springs = links == "spring"
    between = 0.0 if springs else energy_between_ends(compared, g, ELEMENTS)

    # If springs are needed on free motions at a scale, they are used at smaller scales.
    held: list[float] = []

    def solve(s: float) -> Pair:
        models = [compared] if clearances else [compared, hold_free_motions(compared)]
        linear, *held_too = (
            solve_assembly(scaled(p, s), s * wrench, gravity=s * g) for p in models
        )
        holding = held_too[0] if held_too else None
        simulated = simulate_assembly(
            compared, s, replace(model, hold=bool(held) and not clearances),
            load=s * force, gravity=s * g, couple=s * wrench[:3], time_limit=time_limit,
        )  # fmt: skip
        if simulated.held:
            held.append(s)
        # The linear model must contain the same springs as the simulation.
        if simulated.held and holding is not None:
            linear = holding
        exact = exact_solution(linear, s * g)
        return Pair(s, linear, simulated, exact, s**2 * between, holding)

    def judge(pairs: tuple[Pair, ...], asked: int) -> Crosscheck:
        metric = (
            ClearanceMetric(robot, pairs, springs)
            if clearances
            else PoseMetric(robot, pairs, springs, bool(g.any()))
        )
        return Crosscheck(
            posture=compared,
            load=wrench,
            links=links,
            gravity=g,
            pairs=pairs,
            asked=asked,
            metric=metric,
        )

    return compare_scales(scales, solve, judge)


def attempt(
    robot: str, check: Callable[[], Result]
) -> tuple[Result | None, dict[str, Any]]:
    """Run a check and return its result, or the reason for its failure.

    Args:
        robot: name of the robot.
        check: function without arguments that runs the check.

    Returns:
        The result and None, or None and a mapping with ``status``, ``reason``,
        ``passed`` and ``slope`` if the check failed to run.
    """
    try:
        return check(), {}
    except SimulationFailed as error:
        status, reason = SIMULATION_FAILED, str(error)
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        status, reason = failure_status(error), str(error)
    failure = {"robot": robot, "status": status, "reason": reason}
    return None, failure | {"scales": [], "slope": None, "passed": False}
