"""Requirements on tolerances: limits at several postures and a yield."""

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
# required precision of pose error bounds, relative to a limit
_PRECISION = 1e-4
_BATCH = 512  # number of draws per stored result
# random number streams; repeated verifications use the streams after FRESH
TRAINING, SCALING, FRESH = 10, 11, 12


@dataclass(frozen=True, eq=False)
class Plan:
    """Costs of tolerances, and limits on the results.

    Attributes:
        sources: m random errors, scaled to tolerances of 1 rad or 1 m and to callout
            zones with a width of 1 m.
        group: (m,) index of the class to which each error belongs.
        names: names of the G classes.
        costs: (G,) cost coefficients, > 0.
        least: (G,) [rad or m] smallest tolerances.
        most: (G,) [rad or m] largest tolerances.
        cost: cost law, ``"reciprocal"`` or ``"logarithm"``.
        limits: limits by quantity: margin, margin_free, energy [J], force [N], moment
            [N m], stress [Pa], rotation [rad], translation [m].
        asked_yield: required fraction of robots that satisfy every limit at every
            posture.
        draws: number of training draws per posture.
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
        """Whether there is a limit on a pose error."""
        return bool(set(POSE_ERRORS) & set(self.limits))

    __repr__, _repr_html_ = short_repr, html_table

    def spread(self, tolerances: NDArray) -> NDArray:
        """Return the tolerance of each error, (m,), from the tolerances of classes."""
        return tolerances[self.group]

    def gather(self, slopes: NDArray) -> NDArray:
        """Return the sum of derivatives over the errors of each class, (G,)."""
        return np.bincount(self.group, weights=slopes, minlength=len(self.names))

    def price(self, tolerances: NDArray) -> float:
        """Return the total cost of tolerances."""
        if self.cost == "reciprocal":
            return float((self.costs / tolerances).sum())
        return float(-(self.costs * np.log(tolerances)).sum())

    def draws_of(self, stream: int, count: int) -> NDArray:
        """Return random errors relative to the tolerances, (count, m)."""
        return self.sources.draw(0, count, self.seed, stream)


@dataclass(frozen=True, eq=False)
class Requirement:
    """Limits of a plan at several postures of one robot.

    Attributes:
        postures: postures of the workspace.
        plan: costs and limits.
        replay: stored results of an interrupted computation.
    """

    postures: Sequence[Posture]
    plan: Plan
    replay: Replay = field(default_factory=Replay)

    __repr__, _repr_html_ = short_repr, html_table

    @cached_property
    def experiments(self) -> list[Experiment]:
        """Experiment at each posture, for all quantities except margins."""
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
        """For each quantity, problem (21) or the linear response at each posture."""
        return {
            key: [prepare_margins(p, MARGINS[key]) for p in self.postures]
            if key in MARGINS else [e.energies for e in self.experiments]
            for key in self.plan.limits
        }  # fmt: skip

    @cached_property
    def convex(self) -> dict[str, list]:
        """Values of ``prepared`` for the quantities that are convex in the errors.

        If a joint is bolted, no quantity is convex, because the clearance that the bolt
        fixes is not linear in the errors.
        """
        if any(frame.locked_at for frame in self.postures[0].robot.frames):
            return {}
        return {key: self.prepared[key] for key in CONVEX if key in self.prepared}

    @property
    def is_convex(self) -> bool:
        """Whether the yield is 1 and all limited quantities are convex."""
        return self.plan.asked_yield == 1.0 and len(self.convex) == len(self.prepared)

    @property
    def cases(self) -> list[tuple[str, int]]:
        """Quantity and posture index for each row of :meth:`utilisations`."""
        return [(key, i) for key in self.plan.limits for i in range(len(self.postures))]

    def utilisations(self, values: NDArray) -> tuple[NDArray, NDArray]:
        """Return each limited quantity divided by its limit.

        Args:
            values: (k, m) [rad or m] errors.

        Returns:
            Lower and upper bounds on the quotients, (limits x postures, k); inf without
            a solution. For the rows see :attr:`cases`. Both bounds are equal except
            for pose errors in the worst clearance model.
        """
        chunks = [
            self._batch_utilisations(values, i) for i in range(0, len(values), _BATCH)
        ]
        lower, upper = (np.concatenate(c, axis=1) for c in zip(*chunks, strict=True))
        return lower, upper

    def _batch_utilisations(
        self, values: NDArray, first: int
    ) -> tuple[NDArray, NDArray]:
        """Return the quotients of quantities and limits for one batch of draws."""
        some = values[first : first + _BATCH]
        rows = np.arange(first, first + len(some))
        keys = list(self.plan.limits)
        limits = np.array([[self.plan.limits[key]] for key in keys])
        bounds = [
            self.replay.recall(partial(self._quantities, i, some, rows), some, rows, i)
            for i in range(len(self.postures))
        ]
        # The array has the shape (bounds, limits, postures, k).
        utilisations = np.stack([np.array(b) / limits for b in bounds], axis=2)
        utilisations = np.where(np.isnan(utilisations), np.inf, utilisations)
        lower, upper = utilisations.reshape(2, -1, len(some))
        return lower, upper

    def _quantities(
        self, i: int, values: NDArray, rows: NDArray
    ) -> tuple[NDArray, NDArray]:
        """Return lower and upper bounds on the limited quantities, each (limits, k)."""
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
        """Return the derivatives of a row of :meth:`utilisations`, (k, m)."""
        key, i = self.cases[case]
        return self.respond(key, i, values)[1] / self.plan.limits[key]

    def respond(self, key: str, i: int, values: NDArray) -> tuple[NDArray, NDArray]:
        """Return a quantity at posture i, (k,), and derivatives by error, (k, m)."""
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
        """Search for the worst corner of the tolerance box at posture i."""
        spread, sources = self.plan.spread(t), self.plan.sources
        assert isinstance(sources, ErrorSources)  # callout zones have no corners

        def search() -> tuple:
            corner = worst_corner(
                self.prepared[key][i], sources, spread, corners, key,
                self.plan.clearance, self.plan.contact_length,
            )  # fmt: skip
            return corner.value, corner.signs, corner.slopes

        value, signs, slopes = self.replay.recall(search, spread, corners, key, i)
        return Corner(float(value), signs, slopes)

    def perfect_parts(self) -> dict[str, tuple[float, str]]:
        """Return the pose errors that clearances cause without geometric errors.

        Returns:
            For each limited pose error, a lower bound on its maximum over all postures
            [rad or m], and the posture. Empty unless the clearance model is "worst".

        Raises:
            BadInput: a pose error exceeds its limit.
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
        """Raise an error if a robot without geometric errors exceeds a limit."""
        limits = self.plan.limits
        for key in sorted(reached, key=lambda k: -reached[k][0] / limits[k]):
            value, where = reached[key]
            if value > limits[key]:
                unit = UNITS[key]
                raise BadInput(
                    f"limit {key}: even without geometric errors, clearances cause "
                    f"{value:.4g} {unit} at {where}; expected at most "
                    f"{limits[key]:g} {unit}; tighten the clearances, loosen "
                    "the limit, or use --clearance least"
                )

    def check_taken_up(self) -> None:
        """Raise an error if no clearance or spring can compensate an error.

        Raises:
            BadInput: there is such an error.
        """
        sources, n = self.plan.sources, len(self.postures[0].robot.frames)
        for key, prepared in self.convex.items():
            for posture in prepared:
                rows = posture.infeasible.reshape(-1, n, 6)
                residual = np.abs(sources.of_numbers(rows)).max(axis=0, initial=0.0)
                if residual.max(initial=0.0) > 1e-9:
                    name = sources.labels[int(residual.argmax())]
                    raise BadInput(
                        f"limit {key}: found the error {name}, which no clearance "
                        "or spring can compensate; omit this error, or add a "
                        "spring and limit the energy"
                    )
