"""What tolerances must meet: limits at every posture, always or with a yield."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly.posture import Posture
from assembly.solvers.posture_margins import prepare_margins
from assembly.statistics.distributions import ErrorSources
from assembly.statistics.monte_carlo import Experiment
from assembly.statistics.worst_case import respond
from stiffness.reading import BadInput

CONVEX = ("margin", "margin_free", "energy")
COSTS = ("reciprocal", "logarithm")
TRAINING, FRESH = 10, 11  # streams of random numbers


@dataclass(frozen=True, eq=False)
class Plan:
    """What is asked of the tolerances.

    Attributes:
        sources: m errors within tolerances of 1 [rad or m].
        group: (m,) class of each.
        names: of the G classes.
        costs: (G,) > 0.
        least: (G,) [rad or m] no tolerance is tighter.
        most: (G,) [rad or m] and none looser.
        cost: ``"reciprocal"`` or ``"logarithm"``.
        limits: by quantity: margin, margin_free, energy [J], force [N], moment [N m],
            stress [Pa], rotation [rad], translation [m].
        asked_yield: 1 means always; else the share of robots that must meet every
            limit at every posture.
        draws: training draws at every posture.
        seed: of all draws.
    """

    sources: ErrorSources
    group: NDArray
    names: tuple[str, ...]
    costs: NDArray
    least: NDArray
    most: NDArray
    limits: Mapping[str, float]
    cost: str = "reciprocal"
    asked_yield: float = 1.0
    draws: int = 1000
    seed: int = 1

    def spread(self, tolerances: NDArray) -> NDArray:
        """(m,) the tolerance of every source."""
        return tolerances[self.group]

    def gather(self, slopes: NDArray) -> NDArray:
        """(G,) sums over the sources of each class."""
        return np.bincount(self.group, weights=slopes, minlength=len(self.names))

    def price(self, tolerances: NDArray) -> float:
        """What tolerances cost."""
        if self.cost == "reciprocal":
            return float((self.costs / tolerances).sum())
        return float(-(self.costs * np.log(tolerances)).sum())

    def draws_of(self, stream: int, count: int) -> NDArray:
        """(count, m) errors within tolerances of 1."""
        return self.sources.draw(0, count, self.seed, stream)


@dataclass(frozen=True, eq=False)
class Requirement:
    """A plan at postures of one robot, made ready for what is limited.

    Attributes:
        postures: the workspace.
        plan: what is asked.
    """

    postures: Sequence[Posture]
    plan: Plan

    @cached_property
    def experiments(self) -> list[Experiment]:
        """Everything but the margins, at each posture."""
        sources, stress = self.plan.sources, "stress" in self.plan.limits
        found = [
            Experiment(p, sources, margins=False, stress=stress) for p in self.postures
        ]
        for key in self.plan.limits:
            if not key.startswith("margin"):
                found[0].check_limits([key])
        return found

    @cached_property
    def convex(self) -> dict[str, list]:
        """By convex limit, the postures prepared for it."""
        readings = {"margin": "rigid", "margin_free": "free"}
        return {
            key: [prepare_margins(p, readings[key]) for p in self.postures]
            if key in readings else [e.energies for e in self.experiments]
            for key in CONVEX if key in self.plan.limits
        }  # fmt: skip

    def shares(self, values: NDArray) -> NDArray:
        """(k,) largest quantity over its limit, of all limits and postures."""
        worst = np.zeros(len(values))
        others = [key for key in self.plan.limits if not key.startswith("margin")]
        for key, ready in self.convex.items():
            if key.startswith("margin"):
                for one in ready:
                    found = respond(one, self.plan.sources, values)[0]
                    share = found / self.plan.limits[key]
                    worst = np.maximum(worst, np.where(np.isnan(share), np.inf, share))
        for one in self.experiments if others else ():
            rows = one.answer(values, range(len(values)))
            screws = rows["platform_screw"]
            sizes = {
                "rotation": np.linalg.norm(screws[:, :3], axis=1),
                "translation": np.linalg.norm(screws[:, 3:], axis=1),
                "stress": rows["stress"].max(axis=1, initial=0.0),
            }
            for key in others:
                found = sizes[key] if key in sizes else rows[key]
                share = found / self.plan.limits[key]
                worst = np.maximum(worst, np.where(np.isnan(share), np.inf, share))
        return worst

    def check_taken_up(self) -> None:
        """Refuse errors that neither play nor springs take up anywhere.

        Raises:
            BadInput: there is one; it is named.
        """
        sources = self.plan.sources
        columns = 6 * sources.frame + sources.component
        for key, ready in self.convex.items():
            for one in ready:
                left = np.abs(one.unanswered[:, columns]).max(axis=0, initial=0.0)
                if left.max(initial=0.0) > 1e-9:
                    name = sources.labels[int(left.argmax())]
                    raise BadInput(
                        f"limit {key}: no play or spring takes up an error {name}; "
                        "leave it out, or limit the energy of a robot that "
                        "gives way there"
                    )
