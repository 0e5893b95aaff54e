"""A set of hypotheses fitted in the full model, with the uncertainty of its numbers.

Sources:
    Nocedal, Wright, Numerical Optimization, chapters 10 (least squares) and 11
    (Broyden's update of slopes).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly.effects import LIBRARY, apply_effects
from assembly.effects.effect import Values
from assembly.linear.closure import virtual_joints
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict, with_rest_positions
from assembly.measurement.settled_clearance import with_clearances_taken_up
from assembly.model.robot import Robot
from validation.campaign.campaign import Campaign
from validation.diagnosis.background import NOTHING, Background
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.least_squares import least_squares
from validation.diagnosis.scoring import FINITE
from validation.diagnosis.signatures import UNSEEN, whiten

_STEP = 1e-4  # of an unknown's size, for derivatives
_MOST_ROUNDS = 8  # times that slopes are taken anew
_FAINT = 0.01  # [sigma] over all readings, of unknowns that may as well be zero
_CONVERGED = 0.1  # of the mean square that is left: a third of a standard deviation
_MOST_DEFECTS = 5
_SAME_DEFECT = 0.1  # [sigma] largest change of what finite motions add to a reading
_LOST = 1e3  # [sigma] a reading that the model has no answer for


@dataclass(frozen=True, eq=False)
class Fit:
    """Hypotheses with fitted numbers.

    Attributes:
        hypotheses: the set.
        values: fitted unknowns, one hypothesis after the other.
        covariance: of the unknowns.
        residual: (N,) whitened, what is left; by the covariance of small terms too,
            where there are any (:meth:`.evidence.Background.left`, ``raw``).
        conditions: the campaign's, with the effects fitted.
        slopes: (N, k) change of that residual per unknown, its sign turned.
    """

    hypotheses: tuple[Hypothesis, ...]
    values: NDArray
    covariance: NDArray
    residual: NDArray
    conditions: Conditions
    slopes: NDArray

    @property
    def rss(self) -> float:
        """[-] squared whitened residual."""
        return float(self.residual @ self.residual)

    @cached_property
    def effects(self) -> dict[str, dict[str, float]]:
        """Parameters by their public names, by effect."""
        return self.at(self.values)

    def at(self, values: NDArray) -> dict[str, dict[str, float]]:
        """Parameters by their public names, at other values of the unknowns.

        Args:
            values: one for each slot, one hypothesis after the other.

        Returns:
            By effect.
        """
        return _public(self.hypotheses, values, self.conditions.robot)

    def parameters(self, k: int) -> list[tuple[str, float, float]]:
        """Name, value and standard deviation of one hypothesis's parameters.

        Args:
            k: which hypothesis.

        Returns:
            Parameters by their public names.
        """
        begin = sum(len(h.slots) for h in self.hypotheses[:k])
        h = self.hypotheses[k]
        own = slice(begin, begin + len(h.slots))
        x, C = self.values[own], self.covariance[own, own]
        robot = self.conditions.robot
        value = h.public(robot, x)
        J = np.zeros((len(value), len(x)))
        for i, slot in enumerate(h.slots):
            step = _STEP * max(abs(x[i]), 1e-3 * slot.unknown.scale)
            ends = []
            for sign in (1.0, -1.0):
                moved_values = x.copy()
                moved_values[i] += sign * step
                moved = h.public(robot, moved_values)
                ends.append(np.array([moved.get(name, np.nan) for name in value]))
            change = _difference(
                ends[0], ends[1], [n.endswith(".phase") for n in value]
            )
            J[:, i] = change / (2 * step)
        std = np.sqrt(np.maximum(np.einsum("pi,ij,pj->p", J, C, J), 0.0))
        return [(n, v, float(s)) for (n, v), s in zip(value.items(), std, strict=True)]


def _difference(end: NDArray, begin: NDArray, phase: Sequence[bool]) -> NDArray:
    """(p,) end minus begin; of phases the shorter way around."""
    way = end - begin
    return np.where(phase, np.remainder(way + np.pi, 2 * np.pi) - np.pi, way)


def _public(
    members: Sequence[Hypothesis], values: NDArray, robot: Robot
) -> dict[str, dict[str, float]]:
    """Parameters of all members by effect; those of one effect join."""
    fitted: dict[str, dict[str, float]] = {}
    at = 0
    for h in members:
        own = h.public(robot, values[at : at + len(h.slots)])
        fitted.setdefault(h.effect, {}).update(own)
        at += len(h.slots)
    return fitted


def adds_clearance(conditions: Conditions, members: Sequence[Hypothesis]) -> bool:
    """Whether a set puts clearances into closed chains, whose rest is found by row."""
    added = any(LIBRARY[h.effect].clearance for h in members)
    return added and bool(conditions.robot.closures) and conditions.rest is None


def resting(
    conditions: Conditions, members: Sequence[Hypothesis], x: NDArray
) -> NDArray:
    """Where clearances rest by the least energy with hypotheses at some values.

    Args:
        conditions: conditions without the effects.
        members: the hypotheses.
        x: their unknowns, one after the other.

    Returns:
        (R, n, 6) in units of its bounds; a foundation's frame is left out.
    """
    return rest_under(conditions, dict(_public(members, x, conditions.robot)))


def rest_under(conditions: Conditions, effects: Mapping[str, Values]) -> NDArray:
    """(R, n, 6) of its bounds: where clearances rest under effects, by least energy."""
    loose = with_rest_positions(apply_effects(conditions, effects))
    assert loose.rest is not None
    # effects may add frames, as the foundation's
    own = [loose.robot.index(frame.name) for frame in conditions.robot.frames]
    return loose.rest[:, own]


def with_clearance_held(conditions: Conditions, fit: Fit) -> Conditions:
    """Conditions in which clearances that a fit adds to closed chains are held at rest.

    Args:
        conditions: without the fit's effects.
        fit: any.

    Returns:
        The same where the fit adds no such clearances.
    """
    if not adds_clearance(conditions, fit.hypotheses):
        return conditions
    return replace(conditions, rest=resting(conditions, fit.hypotheses, fit.values))


def in_full(
    campaign: Campaign, conditions: Conditions, fit: Fit, behind: Background = NOTHING
) -> Fit:
    """A fit whose residual has clearances where the least energy puts them now.

    Args:
        campaign: what was measured.
        conditions: its conditions without the effects.
        fit: made with clearances held.
        behind: small terms that are there too.

    Returns:
        The same numbers with the full model's residual.
    """
    settled = apply_effects(conditions, fit.effects)
    model = whiten(campaign, predict(settled).deviation)
    left = whiten(campaign, campaign.measured) - model
    left = np.where(np.isfinite(left), left, _LOST)
    return replace(fit, conditions=settled, residual=behind.whitened(left))


def refit(
    campaign: Campaign, conditions: Conditions, members: Sequence[Hypothesis],
    start: NDArray, defect: NDArray | float = 0.0, behind: Background = NOTHING,
    earlier: NDArray | None = None,
) -> Fit:  # fmt: skip
    """Fit a set of hypotheses in the full model.

    Args:
        campaign: what was measured.
        conditions: without the effects; with ``rest``, clearances are held there.
        members: hypotheses of different effects.
        start: where to begin, one unknown after the other.
        defect: (N,) whitened, what finite motions add about there, where it is known.
        behind: small terms that are there too.
        earlier: unknowns of a fit of nearly the same rows, from where the search goes
            on if they leave less.

    Returns:
        The fit.
    """
    linear = [h for h in members if h.effect != FINITE]
    if not linear or len(linear) == len(members):
        return _refit(
            campaign, conditions, members, start, behind=behind, earlier=earlier
        )
    # finite motions take a hundred times longer: their defect is fitted, not they
    for _ in range(_MOST_DEFECTS):
        fit = _refit(campaign, conditions, linear, start, defect, behind, earlier)
        exact = replace(fit.conditions, exact=True)
        together = replace(_with_clearance_at_rest(fit.conditions), exact=True)
        read = [
            whiten(campaign, predict(at).deviation) for at in (fit.conditions, together)
        ]
        last, defect = defect, np.nan_to_num(read[1] - read[0])
        start = fit.values
        if np.abs(defect - last).max() < _SAME_DEFECT:
            break
    left = whiten(campaign, campaign.measured) - read[1]
    left = behind.whitened(np.where(np.isfinite(left), left, _LOST))
    return replace(fit, hypotheses=tuple(members), residual=left, conditions=exact)


def _with_clearance_at_rest(conditions: Conditions) -> Conditions:
    """Conditions with an open chain's clearances where the linear model has them.

    Finite motions of all rows are then found together; where a clearance rests, they
    change to second order.

    Returns:
        The same where there is no such clearance.
    """
    loose = bool(virtual_joints(conditions.robot).cones.shape[1])
    if not loose or conditions.robot.closures or conditions.rest is not None:
        return conditions
    return with_clearances_taken_up(conditions)[0]


def _refit(
    campaign: Campaign, conditions: Conditions, members: Sequence[Hypothesis],
    start: NDArray, defect: NDArray | float = 0.0, behind: Background = NOTHING,
    earlier: NDArray | None = None,
) -> Fit:  # fmt: skip
    """The fit of a model to which a constant ``defect`` (N,) is added."""
    slots = [slot for h in members for slot in h.slots]
    lower = np.array([slot.unknown.lower for slot in slots])
    upper = np.array([slot.unknown.upper for slot in slots])
    measured = whiten(campaign, campaign.measured) - defect

    def there(x: NDArray) -> Conditions:
        effects: dict[str, Values] = dict(_public(members, x, conditions.robot))
        return apply_effects(conditions, effects)

    def raw_by(x: NDArray) -> NDArray:
        model = whiten(campaign, predict(there(x)).deviation)
        return np.where(np.isfinite(model), measured - model, _LOST)

    x0 = np.clip(start, lower, upper)
    if earlier is not None:
        ways = [x0, np.clip(earlier, lower, upper)]
        with np.errstate(over="ignore", invalid="ignore"):
            lost = [np.sum(behind.whitened(raw_by(x)) ** 2) for x in ways]
        x0 = ways[int(np.argmin(lost))]
    size = np.array([
        max(slot.unknown.scale, abs(x)) for slot, x in zip(slots, x0, strict=True)
    ])

    def raw_at(scaled: NDArray) -> NDArray:
        return raw_by(scaled * size)

    @lru_cache(maxsize=2)  # for the slopes, which are taken where the residual was
    def both_at(scaled: bytes) -> tuple[NDArray, NDArray]:
        raw = raw_at(np.frombuffer(scaled))
        return raw, behind.whitened(raw)

    def left_at(scaled: NDArray) -> NDArray:
        return both_at(scaled.tobytes())[1]

    def slopes(scaled: NDArray, asked: Sequence[int]) -> NDArray:
        middle, _ = both_at(scaled.tobytes())
        columns = np.empty((len(middle), len(asked)))
        for column, k in zip(columns.T, asked, strict=True):
            moved = scaled.copy()
            step = _STEP if (moved[k] + _STEP) * size[k] <= upper[k] else -_STEP
            moved[k] += step
            column[:] = (raw_at(moved) - middle) / step
        return behind.whitened(columns)  # all at once: it reads many columns

    scaled = np.clip(x0 / size, lower / size, upper / size)
    with np.errstate(over="ignore", invalid="ignore"):
        J = slopes(scaled, range(len(scaled)))
        # what the readings do not see stays where it is
        seen = np.flatnonzero(np.linalg.norm(J, axis=0) > UNSEEN)
        bounds = lower[seen] / size[seen], upper[seen] / size[seen]

        def with_seen(x: NDArray) -> NDArray:
            moved = scaled.copy()
            moved[seen] = x
            return moved

        # the first step is as long as the way from zero to where a fit begins: one that
        # begins there but for rounding would end there
        if np.linalg.norm(J[:, seen] * scaled[seen]) < _FAINT:
            scaled[seen] = np.clip(0.0, *bounds)
        if len(seen):
            least = least_squares(
                lambda x: left_at(with_seen(x)),
                lambda x: slopes(with_seen(x), seen.tolist()),
                (scaled[seen], J[:, seen]), bounds,
                _CONVERGED / len(measured), _MOST_ROUNDS,
            )  # fmt: skip
            scaled, J[:, seen] = with_seen(least.x), least.slopes
    J /= size
    scale = np.sqrt(np.einsum("ij,ij->j", J, J))
    scale[scale == 0] = 1.0
    C = np.linalg.pinv((J / scale).T @ (J / scale), rcond=1e-12, hermitian=True)
    x, residual = scaled * size, left_at(scaled)
    C = C / np.outer(scale, scale)
    return Fit(tuple(members), x, C, residual, there(x), -J)
