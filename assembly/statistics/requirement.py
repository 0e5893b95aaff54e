"""Requirements on tolerances: limits at every posture and a required yield."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.zone import MARGINS
from forcefit.assembly.model.error_distributions import ErrorSources
from forcefit.assembly.statistics.callout_sources import Sources
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.posture_margins import prepare_margins
from forcefit.assembly.statistics.quantities import POSE_ERRORS, UNITS
from forcefit.assembly.statistics.replay import Replay
from forcefit.assembly.statistics.responses import respond
from forcefit.assembly.statistics.worst_case import Corner, worst_corner
from forcefit.inputs.table import BadInput
from forcefit.results.display import html_table, short_repr

CONVEX = ("margin", "margin_free", "energy")
COSTS = ("reciprocal", "logarithm")
# required difference of upper and lower bound, relative to the limit on a pose error
_PRECISION = 1e-4
_BATCH = 512  # number of draws that are solved and stored together
# random number streams; additional verifications use higher numbers
TRAINING, SCALING, FRESH = 10, 11, 12


@dataclass(frozen=True, eq=False)
class Plan:
    """Costs and limits of tolerances.

    Attributes:
        sources: m errors, scaled to tolerances of 1 [rad or m]; callout zones are
            scaled to a width of 1 m.
        group: (m,) class of each error.
        names: names of the G classes.
        costs: (G,) cost coefficient of each class, > 0.
        least: (G,) [rad or m] smallest tolerances.
        most: (G,) [rad or m] largest tolerances.
        cost: cost law, ``"reciprocal"`` or ``"logarithm"``.
        limits: limits by quantity: margin, margin_free, energy [J], force [N], moment
            [N m], stress [Pa], rotation [rad], translation [m].
        asked_yield: 1 if all robots must meet the limits; otherwise the fraction of
            robots that must meet every limit at every posture.
        draws: number of training draws at every posture.
        seed: seed of all draws.
        clearance: clearance model for limits on pose errors, one of
            :data:`forcefit.assembly.statistics.clearance_positions.CLEARANCE_MODELS`.
        contact_length: [m] length of the contact model, see
            :class:`forcefit.assembly.statistics.experiment.Experiment`.
    """

    sources: Sources
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
    clearance: str = "worst"
    contact_length: float | None = None

    @property
    def limits_pose(self) -> bool:
        """Whether a pose error is limited; without one, no clearance model is used."""
        return bool(set(POSE_ERRORS) & set(self.limits))

    __repr__, _repr_html_ = short_repr, html_table

    def spread(self, tolerances: NDArray) -> NDArray:
        """Return the tolerance (m,) of every source."""
        return tolerances[self.group]

    def gather(self, slopes: NDArray) -> NDArray:
        """Sum slopes over the sources of each class; return (G,)."""
        return np.bincount(self.group, weights=slopes, minlength=len(self.names))

    def price(self, tolerances: NDArray) -> float:
        """Return the cost of tolerances."""
        if self.cost == "reciprocal":
            return float((self.costs / tolerances).sum())
        return float(-(self.costs * np.log(tolerances)).sum())

    def draws_of(self, stream: int, count: int) -> NDArray:
        """Draw errors (count, m), relative to the tolerances."""
        return self.sources.draw(0, count, self.seed, stream)


@dataclass(frozen=True, eq=False)
class Requirement:
    """A plan at several postures of one robot, prepared for the limited quantities.

    Attributes:
        postures: postures of the workspace.
        plan: costs and limits.
        replay: stored results of an earlier, interrupted computation.
    """

    postures: Sequence[Posture]
    plan: Plan
    replay: Replay = field(default_factory=Replay)

    __repr__, _repr_html_ = short_repr, html_table

    @cached_property
    def experiments(self) -> list[Experiment]:
        """Experiments for all quantities except the margins, one at each posture."""
        plan = self.plan
        rotation, translation = (
            _PRECISION * plan.limits.get(key, np.inf) for key in POSE_ERRORS
        )
        experiments = [
            Experiment(
                p, plan.sources, margins=False, stress="stress" in plan.limits,
                clearance=plan.clearance if plan.limits_pose else "least",
                contact_length=plan.contact_length, precision=(rotation, translation),
            )
            for p in self.postures
        ]  # fmt: skip
        for key in self.plan.limits:
            if not key.startswith("margin"):
                experiments[0].check_limits([key])
        return experiments

    @cached_property
    def prepared(self) -> dict[str, list]:
        """Prepared postures by the name of the limited quantity."""
        return {
            key: [prepare_margins(p, MARGINS[key]) for p in self.postures]
            if key in MARGINS else [e.energies for e in self.experiments]
            for key in self.plan.limits
        }  # fmt: skip

    @cached_property
    def convex(self) -> dict[str, list]:
        """Prepared postures by limited quantity, for quantities convex in the errors.

        If a joint is bolted, no quantity is convex, because the locked-in clearance is
        not linear in the errors.
        """
        if any(frame.locked_at for frame in self.postures[0].robot.frames):
            return {}
        return {key: self.prepared[key] for key in CONVEX if key in self.prepared}

    @property
    def is_convex(self) -> bool:
        """Whether all limited quantities are convex; True only for a yield of 1."""
        return self.plan.asked_yield == 1.0 and len(self.convex) == len(self.prepared)

    @property
    def cases(self) -> list[tuple[str, int]]:
        """Limit and posture of each row of :meth:`utilisations`."""
        return [(key, i) for key in self.plan.limits for i in range(len(self.postures))]

    def utilisations(self, values: NDArray) -> tuple[NDArray, NDArray]:
        """Return the utilisation of the limits: each quantity divided by its limit.

        Args:
            values: (k, m) [rad or m] errors.

        Returns:
            (limits x postures, k) lower and upper bounds, with rows as in
            :attr:`cases`. The two differ only for pose errors of the worst clearance
            model. The utilisation of a draw without a solution is inf.
        """
        chunks = [
            self._batch_utilisations(values, i) for i in range(0, len(values), _BATCH)
        ]
        lower, upper = (np.concatenate(c, axis=1) for c in zip(*chunks, strict=True))
        return lower, upper

    def _batch_utilisations(
        self, values: NDArray, first: int
    ) -> tuple[NDArray, NDArray]:
        """Return the utilisations of one batch of errors at all postures."""
        some = values[first : first + _BATCH]
        rows = np.arange(first, first + len(some))
        keys = list(self.plan.limits)
        limits = np.array([[self.plan.limits[key]] for key in keys])
        bounds = [
            self.replay.recall(partial(self._quantities, i, some, rows), some, rows, i)
            for i in range(len(self.postures))
        ]
        # (bounds, limits, postures, k): the postures of a limit are adjacent
        utilisations = np.stack([np.array(b) / limits for b in bounds], axis=2)
        utilisations = np.where(np.isnan(utilisations), np.inf, utilisations)
        lower, upper = utilisations.reshape(2, -1, len(some))
        return lower, upper

    def _quantities(
        self, i: int, values: NDArray, rows: NDArray
    ) -> tuple[NDArray, NDArray]:
        """Return lower and upper bounds (limits, k) of the quantities at posture i."""
        keys = list(self.plan.limits)
        rows_of_draws = None
        if any(not key.startswith("margin") for key in keys):
            rows_of_draws = self.experiments[i].evaluate(values, rows)
        bounds = np.empty((2, len(keys), len(values)))
        for k, key in enumerate(keys):
            if rows_of_draws is None or key.startswith("margin"):
                bounds[:, k] = respond(
                    self.prepared[key][i], self.plan.sources, values
                )[0]
                continue
            values_of_key = (
                rows_of_draws[key].max(axis=1)
                if key == "stress"
                else rows_of_draws[key]
            )
            lower = f"{key}_lower"
            names = rows_of_draws.dtype.names or ()
            bounds[:, k] = (
                rows_of_draws[lower] if lower in names else values_of_key,
                values_of_key,
            )
        return bounds[0], bounds[1]

    def utilisation_slopes(self, case: int, values: NDArray) -> NDArray:
        """Return derivatives (k, m) of a row of :meth:`utilisations` by each error."""
        key, i = self.cases[case]
        return self.respond(key, i, values)[1] / self.plan.limits[key]

    def respond(self, key: str, i: int, values: NDArray) -> tuple[NDArray, NDArray]:
        """Return a limited quantity at posture i, and its derivatives by each error."""
        size, slopes = self.replay.recall(
            lambda: respond(
                self.prepared[key][i],
                self.plan.sources,
                values,
                key,
                self.plan.clearance,
                self.plan.contact_length,
            ),
            values,
            key,
            i,
        )
        return size, slopes

    def worst_corner(self, key: str, i: int, t: NDArray, corners: NDArray) -> Corner:
        """Search for the worst corner of the tolerance box (G,) at posture i."""
        spread, sources = self.plan.spread(t), self.plan.sources
        assert isinstance(sources, ErrorSources)  # callouts have no corners

        def search() -> tuple:
            corner = worst_corner(
                self.prepared[key][i], sources, spread, corners, key,
                self.plan.clearance, self.plan.contact_length,
            )  # fmt: skip
            return corner.value, corner.signs, corner.slopes

        value, signs, slopes = self.replay.recall(search, spread, corners, key, i)
        return Corner(float(value), signs, slopes)

    def perfect_parts(self) -> dict[str, tuple[float, str]]:
        """Return the limited pose errors that clearances alone cause.

        Returns:
            By quantity: a lower bound on the largest pose error [rad or m] without
            errors over all postures, and its posture. The result is empty for clearance
            models other than the worst.

        Raises:
            BadInput: one of the pose errors exceeds its limit.
        """
        if self.plan.clearance != "worst" or not self.plan.limits_pose:
            return {}
        lower, _ = self.utilisations(np.zeros((1, len(self.plan.sources))))
        reached = {}
        for key in POSE_ERRORS:
            rows = [row for row, (k, _) in enumerate(self.cases) if k == key]
            if not rows:
                continue
            row = rows[int(lower[rows, 0].argmax())]
            limit, share = self.plan.limits[key], float(lower[row, 0])
            at = self.postures[self.cases[row][1]].pose().items()
            where = ", ".join(f"{k} = {v:.4g}" for k, v in at if abs(v) > 1e-9)
            reached[key] = limit * share, where or "the origin"
        self._refuse_broken(reached)
        return reached

    def _refuse_broken(self, reached: Mapping[str, tuple[float, str]]) -> None:
        """Reject the limit that a robot without errors exceeds by the most, if any."""
        limits = self.plan.limits
        for key in sorted(reached, key=lambda k: -reached[k][0] / limits[k]):
            value, where = reached[key]
            if value > limits[key]:
                unit = UNITS[key]
                raise BadInput(
                    f"limit {key}: even perfect parts reach {value:.4g} {unit} "
                    f"by clearances alone at {where}; expected at most "
                    f"{limits[key]:g} {unit}; tighten the clearances, loosen "
                    "the limit, or use --clearance least"
                )

    def check_taken_up(self) -> None:
        """Reject errors that neither a clearance nor a spring can take up.

        Raises:
            BadInput: such an error exists; the message names the error.
        """
        sources, n = self.plan.sources, len(self.postures[0].robot.frames)
        for key, prepared in self.convex.items():
            for posture in prepared:
                rows = posture.infeasible.reshape(-1, n, 6)
                residual = np.abs(sources.of_numbers(rows)).max(axis=0, initial=0.0)
                if residual.max(initial=0.0) > 1e-9:
                    name = sources.labels[int(residual.argmax())]
                    raise BadInput(
                        f"limit {key}: found an error {name} that no clearance "
                        "or spring can close; leave this error out, or limit "
                        "the energy of a robot with a spring there"
                    )
