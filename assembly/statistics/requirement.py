"""What tolerances must meet: limits at every posture, always or with a yield."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from assembly.batch.many_margins import prepare_margins
from assembly.kinematics.posture import Posture
from assembly.linear.zone import MARGIN_READINGS
from assembly.model.error_distributions import ErrorSources
from assembly.statistics.experiment import Experiment
from assembly.statistics.quantities import POSE_ERRORS, UNITS
from assembly.statistics.replay import Replay
from assembly.statistics.responses import respond
from assembly.statistics.worst_case import Corner, worst_corner
from forcefit.inputs.display import html_table, short_repr
from forcefit.inputs.table import BadInput

CONVEX = ("margin", "margin_free", "energy")
COSTS = ("reciprocal", "logarithm")
_SHARP = 1e-4  # of a limit on a pose error: how far its bounds may be apart
_CHUNK = 512  # draws solved and kept together
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
        play: what is assumed of it where a pose error is limited, one of
            :data:`assembly.statistics.play.PLAY`.
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
    play: str = "worst"

    @property
    def limits_pose(self) -> bool:
        """Whether a pose error is limited, so that it matters where play sits."""
        return bool(set(POSE_ERRORS) & set(self.limits))

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
        replay: keeps what was computed.
    """

    postures: Sequence[Posture]
    plan: Plan
    replay: Replay = field(default_factory=Replay)

    __repr__, _repr_html_ = short_repr, html_table

    @cached_property
    def experiments(self) -> list[Experiment]:
        """Everything but the margins, at each posture."""
        plan = self.plan
        rotation, translation = (
            _SHARP * plan.limits.get(key, np.inf) for key in POSE_ERRORS
        )
        found = [
            Experiment(
                p, plan.sources, margins=False, stress="stress" in plan.limits,
                play=plan.play if plan.limits_pose else "least",
                precision=(rotation, translation),
            )
            for p in self.postures
        ]  # fmt: skip
        for key in self.plan.limits:
            if not key.startswith("margin"):
                found[0].check_limits([key])
        return found

    @cached_property
    def ready(self) -> dict[str, list]:
        """By limit, the postures prepared for it."""
        return {
            key: [prepare_margins(p, MARGIN_READINGS[key]) for p in self.postures]
            if key in MARGIN_READINGS else [e.energies for e in self.experiments]
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

    def shares(self, values: NDArray) -> tuple[NDArray, NDArray]:
        """Every limited quantity over its limit, for given errors.

        Args:
            values: (k, m) [rad or m].

        Returns:
            (limits x postures, k) lower and upper bounds, see :attr:`places`; they
            differ for pose errors with the worst play only, inf without an answer.
        """
        chunks = [self._some_shares(values, i) for i in range(0, len(values), _CHUNK)]
        lower, upper = (np.concatenate(c, axis=1) for c in zip(*chunks, strict=True))
        return lower, upper

    def _some_shares(self, values: NDArray, first: int) -> tuple[NDArray, NDArray]:
        """A chunk of them, posture by posture."""
        some = values[first : first + _CHUNK]
        rows = np.arange(first, first + len(some))
        keys = list(self.plan.limits)
        limits = np.array([[self.plan.limits[key]] for key in keys])
        both = [
            self.replay.recall(partial(self._quantities, i, some, rows), some, rows, i)
            for i in range(len(self.postures))
        ]
        # (bounds, limits, postures, k) with the postures of a limit side by side
        shares = np.stack([np.array(b) / limits for b in both], axis=2)
        shares = np.where(np.isnan(shares), np.inf, shares)
        lower, upper = shares.reshape(2, -1, len(some))
        return lower, upper

    def _quantities(
        self, i: int, values: NDArray, rows: NDArray
    ) -> tuple[NDArray, NDArray]:
        """(limits, k) lower and upper bounds of what is limited, at posture i."""
        keys = list(self.plan.limits)
        drawn = None
        if any(not key.startswith("margin") for key in keys):
            drawn = self.experiments[i].answer(values, rows)
        bounds = np.empty((2, len(keys), len(values)))
        for k, key in enumerate(keys):
            if drawn is None or key.startswith("margin"):
                bounds[:, k] = respond(self.ready[key][i], self.plan.sources, values)[0]
                continue
            found = drawn[key].max(axis=1) if key == "stress" else drawn[key]
            lower = f"{key}_lower"
            known = drawn.dtype.names or ()
            bounds[:, k] = drawn[lower] if lower in known else found, found
        return bounds[0], bounds[1]

    def share_slopes(self, place: int, values: NDArray) -> NDArray:
        """(k, m) slopes of a row of :meth:`shares` with each error."""
        key, i = self.places[place]
        return self.respond(key, i, values)[1] / self.plan.limits[key]

    def respond(self, key: str, i: int, values: NDArray) -> tuple[NDArray, NDArray]:
        """A limited quantity at posture i and its slopes with each error."""
        size, slopes = self.replay.recall(
            lambda: respond(
                self.ready[key][i], self.plan.sources, values, key, self.plan.play
            ),
            values, key, i,
        )  # fmt: skip
        return size, slopes

    def worst_corner(self, key: str, i: int, t: NDArray, corners: NDArray) -> Corner:
        """The worst corner of tolerances (G,) that is found at posture i."""
        spread = self.plan.spread(t)

        def climb() -> tuple:
            found = worst_corner(
                self.ready[key][i], self.plan.sources, spread, corners, key,
                self.plan.play,
            )  # fmt: skip
            return found.value, found.signs, found.slopes

        value, signs, slopes = self.replay.recall(climb, spread, corners, key, i)
        return Corner(float(value), signs, slopes)

    def check_perfect_parts(self) -> None:
        """Refuse limits on pose errors that play alone exceeds, without any error.

        Raises:
            BadInput: there is one; it says how far the worst play reaches.
        """
        if self.plan.play != "worst" or not self.plan.limits_pose:
            return
        lower, _ = self.shares(np.zeros((1, len(self.plan.sources))))
        worst = int(lower[:, 0].argmax())
        key, i = self.places[worst]
        if lower[worst, 0] > 1.0 and key in POSE_ERRORS:
            limit, unit = self.plan.limits[key], UNITS[key]
            at = self.postures[i].pose().items()
            where = ", ".join(f"{k} = {v:.4g}" for k, v in at if abs(v) > 1e-9)
            raise BadInput(
                f"limit {key}: even perfect parts reach {limit * lower[worst, 0]:.4g} "
                f"{unit} by play alone at {where or 'the origin'}; expected at most "
                f"{limit:g} {unit} (or --play least, if play stays as it is solved)"
            )

    def check_taken_up(self) -> None:
        """Refuse errors that neither play nor springs take up anywhere.

        Raises:
            BadInput: there is one; it is named.
        """
        sources = self.plan.sources
        columns = 6 * sources.frame + sources.component
        for key, ready in self.convex.items():
            for one in ready:
                left = np.abs(one.infeasible[:, columns]).max(axis=0, initial=0.0)
                if left.max(initial=0.0) > 1e-9:
                    name = sources.labels[int(left.argmax())]
                    raise BadInput(
                        f"limit {key}: no play or spring takes up an error {name}; "
                        "leave it out, or limit the energy of a robot that "
                        "gives way there"
                    )
