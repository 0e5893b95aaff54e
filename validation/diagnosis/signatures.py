"""Compute signatures, which are first-order changes of the readings due to effects.

======  ============  ======  ========================================================
symbol  code          shape   meaning
======  ============  ======  ========================================================
z       ``residual``  (N,)    (measured - predicted reading) / sigma
A       ``columns``   (N, k)  derivatives of the model by the unknowns / sigma
o       ``offset``    (N,)    change of the model / sigma if all unknowns are zero
======  ============  ======  ========================================================
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import apply_effects, apply_known
from forcefit.assembly.effects.effect import Values
from forcefit.assembly.effects.functions import covariates_of
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.measurement.conditions import Conditions, as_declared
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.measurement.variables import with_history
from forcefit.inputs.errors import BadInput
from forcefit.validation.campaign.campaign import LOAD, Campaign
from forcefit.validation.diagnosis.derivatives import STEP, Derivatives
from forcefit.validation.diagnosis.hypotheses import (
    Hypothesis,
    Slot,
    in_one_session,
    sessions_of,
)

_PROBES = 3  # number of random projections used to find parallel columns
_DIGITS = 6  # number of decimal places of the projections that are compared
# Number of tested rows with the largest loads, and with the largest rotations.
_PROBED = 4
# Smallest visible change, as a sum of squares over all whitened readings.
_HARDLY = 2.0
# [sigma] Smallest visible change caused by a plausible unknown, as a norm over all
# readings.
UNSEEN = 1e-3


@dataclass(frozen=True, eq=False)
class Signature:
    """Linearised contribution of a hypothesis to the readings, in units of sigma.

    Attributes:
        hypothesis: the contributing hypothesis.
        offset: (N,) contribution if all unknowns are zero.
        columns: (N, k) contribution per unit of each of the k unknowns.
    """

    hypothesis: Hypothesis
    offset: NDArray
    columns: NDArray

    @property
    def finite(self) -> bool:
        """Whether all values are finite, that is, the model has a solution."""
        return bool(np.isfinite(self.columns).all() and np.isfinite(self.offset).all())


def conditions_of(campaign: Campaign) -> Conditions:
    """Return the conditions of a campaign for the machine in the robot file.

    Args:
        campaign: campaign of R rows.

    Returns:
        Conditions of R rows.  Covariates are NaN in sessions in which they were not
        recorded.

    Raises:
        BadInput: a function of the robot depends on a covariate that is missing.
    """
    session, whole = campaign.session, campaign.covariates
    known = {**whole, **campaign.partial}
    for name, function in covariates_of(campaign.robot, campaign.sessions).items():
        if name not in known and name != "approach":
            raise BadInput(
                f'{campaign.name}: effect "{function}" depends on {name}; expected a '
                f"column cov.{name}"
            )
    gravity = np.zeros((len(campaign), 3))
    for k, axis in enumerate("xyz"):
        gravity[:, k] = whole.get(f"gravity.{axis}", 0.0)
    worst = float(np.max(campaign.mismatch, initial=0.0))
    robot = campaign.robot.without_effects()
    declared = as_declared(
        Posture(robot, campaign.coordinates, campaign.transforms, worst),
        campaign.loads,
        mismatch=campaign.mismatch,
        point=campaign.reference_point,
        gravity=gravity,
        covariates=known if session is None else {**known, "session": session},
        target=None if campaign.point is None else campaign.targets,
    )
    return apply_known(with_history(declared), campaign.robot)


def loaded_components(campaign: Campaign) -> list[str]:
    """Return the load components that are nonzero in at least one row."""
    return [name for name, w in zip(LOAD, campaign.loads.T, strict=True) if w.any()]


def whiten(campaign: Campaign, deviation: NDArray) -> NDArray:
    """Select the measured values of an array (R, 6, ...), and divide them by sigma."""
    some = deviation[campaign.cells]
    return some / campaign.sigma[campaign.cells].reshape(-1, *[1] * (some.ndim - 1))


def fingerprints(columns: NDArray) -> list[tuple[float, ...]]:
    """Return a key for each column of a matrix; parallel columns have equal keys."""
    probes = np.random.default_rng(0).normal(size=(_PROBES, len(columns)))
    seen = probes @ columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    seen *= np.sign(seen[0])
    return [tuple(key) for key in np.round(seen, _DIGITS).T.tolist()]


class Tangents:
    """First derivatives of the readings with respect to the unknowns of effects.

    Attributes:
        campaign: campaign of R rows with N readings.
        derivatives: derivatives of the readings in these rows.
        declared: (N,) whitened readings of the declared model.
    """

    def __init__(self, campaign: Campaign, derivatives: Derivatives) -> None:
        """Compute the readings that the declared model predicts."""
        self.campaign, self.derivatives = campaign, derivatives
        self.declared = whiten(campaign, derivatives.declared)

    def model(self, effects: Mapping[str, Values], *, finite: bool = False) -> NDArray:
        """Return the whitened readings (N,) that the model predicts with given effects.

        The arguments are the same as for :meth:`.Derivatives.model`.
        """
        return whiten(self.campaign, self.derivatives.model(effects, finite=finite))

    def rows_of(self, session: str | None) -> NDArray:
        """Return an array (N, 1) that is 1 for the readings of a session, otherwise 0.

        If the session is None, all values are 1.
        """
        row = np.nonzero(self.campaign.cells)[0]
        if session is None or self.campaign.session is None:
            return np.ones((len(row), 1))
        return (self.campaign.session[row] == session)[:, None].astype(float)

    def at_start(self, hypothesis: Hypothesis) -> Signature:
        """Return the contribution of a hypothesis, linearised at its start values.

        Values are NaN in rows for which the model has no solution.
        """
        sessions = sessions_of(hypothesis)
        one = self._at_start(in_one_session(hypothesis, sessions[0])[0])
        columns = np.hstack([one.columns * self.rows_of(name) for name in sessions])
        return Signature(hypothesis, one.offset, columns)

    def _at_start(self, hypothesis: Hypothesis) -> Signature:
        """Return the contribution of a hypothesis that applies to all rows."""
        if not hypothesis.slots:
            offset = np.zeros_like(self.declared)
            if not self._invisible(hypothesis):
                offset = self.model({hypothesis.effect: {}}) - self.declared
            return Signature(hypothesis, offset, np.zeros((len(offset), 0)))
        shapes = {
            name: slot.start for slot in hypothesis.slots if slot.shape
            for name in slot.names
        }  # fmt: skip
        columns = np.zeros((len(self.declared), len(hypothesis.slots)))
        for k, slot in enumerate(hypothesis.slots):
            if not slot.shape:
                columns[:, k] = self._column(hypothesis.effect, slot, shapes)
        begin = np.where([s.shape for s in hypothesis.slots], 0.0, hypothesis.start)
        return Signature(hypothesis, -columns @ begin, columns)

    def _invisible(self, hypothesis: Hypothesis) -> bool:
        """Return whether an effect is invisible even in the most sensitive rows."""
        # The finite model is slow, so it is evaluated only in a few rows.
        conditions = self.derivatives.conditions
        load = np.linalg.norm(conditions.load, axis=1)
        size = np.linalg.norm(self.derivatives.declared[:, :3], axis=1)
        read = np.asarray(self.campaign.cells.any(axis=1))
        load, size = np.where(read, load, -1.0), np.where(read, size, -1.0)
        rows = np.unique([*np.argsort(-load)[:_PROBED], *np.argsort(-size)[:_PROBED]])
        rows = rows[read[rows]]
        some, part = self.campaign.take(rows), conditions.take(rows)
        changed = apply_effects(part, {hypothesis.effect: {}})
        change = predict(changed).deviation - predict(part).deviation
        size = whiten(some, change)
        if not np.isfinite(size).all():
            return True
        return bool(np.mean(size**2) * len(self.declared) < _HARDLY)

    def _column(self, effect: str, slot: Slot, shapes: dict[str, float]) -> NDArray:
        """Return the derivative (N,) with respect to one unknown at its start value."""
        begun = whiten(self.campaign, self.derivatives.begun(effect, slot, shapes))
        return _seen((begun - self.declared) / (STEP * slot.unknown.scale), slot)

    def about(
        self, hypothesis: Hypothesis, x: NDArray, others: Mapping[str, Values]
    ) -> Signature:
        """Return the contribution of a hypothesis, linearised at x (k,)."""
        robot = self.derivatives.conditions.robot

        def model(values: NDArray) -> NDArray:
            own = {hypothesis.effect: hypothesis.public(robot, values)}
            return self.model({**others, **own})

        middle = model(x)
        without = self.model(others) if others else self.declared
        columns = np.zeros((len(middle), len(x)))
        for k, slot in enumerate(hypothesis.slots):
            moved = x.copy()
            step = STEP * max(slot.unknown.scale, abs(x[k]))
            moved[k] += step if moved[k] + step <= slot.unknown.upper else -step
            column = (model(moved) - middle) / (moved[k] - x[k])
            columns[:, k] = _seen(column, slot)
        return Signature(hypothesis, middle - without - columns @ x, columns)


def _seen(column: NDArray, slot: Slot) -> NDArray:
    """Return a derivative (N,), set to zero if its unknown has no visible effect."""
    size = np.linalg.norm(column) * slot.unknown.scale
    return np.zeros_like(column) if size < UNSEEN else column
