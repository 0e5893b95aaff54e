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
from assembly.statistics.responses import respond
from stiffness.display import html_table, short_repr
from stiffness.reading import BadInput

CONVEX = ("margin", "margin_free", "energy")
COSTS = ("reciprocal", "logarithm")
TRAINING, SCALING, FRESH = 10, 11, 12  # streams of random numbers; more from 12 on


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

    __repr__, _repr_html_ = short_repr, html_table

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

    __repr__, _repr_html_ = short_repr, html_table

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
    def ready(self) -> dict[str, list]:
        """By limit, the postures prepared for it."""
        readings = {"margin": "rigid", "margin_free": "free"}
        return {
            key: [prepare_margins(p, readings[key]) for p in self.postures]
            if key in readings else [e.energies for e in self.experiments]
            for key in self.plan.limits
        }  # fmt: skip

    @cached_property
    def convex(self) -> dict[str, list]:
        """Those of the limits that are convex in the errors."""
        return {key: self.ready[key] for key in CONVEX if key in self.ready}

    @property
    def is_convex(self) -> bool:
        """Whether all limits are convex in the tolerances: none may ever be failed."""
        return self.plan.asked_yield == 1.0 and len(self.convex) == len(self.ready)

    @property
    def places(self) -> list[tuple[str, int]]:
        """Limit and posture of every row of :meth:`shares`."""
        return [(key, i) for key in self.plan.limits for i in range(len(self.postures))]

    def shares(self, values: NDArray) -> NDArray:
        """Every limited quantity over its limit, for given errors.

        Args:
            values: (k, m) [rad or m].

        Returns:
            (limits x postures, k), see :attr:`places`; inf where there is no answer.
        """
        found = {}
        for key, ready in self.ready.items():
            if key.startswith("margin"):
                for i, one in enumerate(ready):
                    found[key, i] = respond(one, self.plan.sources, values)[0]
        others = any(not key.startswith("margin") for key in self.plan.limits)
        for i, one in enumerate(self.experiments if others else ()):
            rows = one.answer(values, range(len(values)))
            screws = rows["platform_screw"]
            found |= {
                ("rotation", i): np.linalg.norm(screws[:, :3], axis=1),
                ("translation", i): np.linalg.norm(screws[:, 3:], axis=1),
                ("stress", i): rows["stress"].max(axis=1, initial=0.0),
            }
            found |= {(key, i): rows[key] for key in ("energy", "force", "moment")}
        shares = np.array([found[p] / self.plan.limits[p[0]] for p in self.places])
        return np.where(np.isnan(shares), np.inf, shares)

    def share_slopes(self, place: int, values: NDArray) -> NDArray:
        """(k, m) slopes of a row of :meth:`shares` with each error."""
        key, i = self.places[place]
        slopes = respond(self.ready[key][i], self.plan.sources, values, key)[1]
        return slopes / self.plan.limits[key]

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
