"""The search of a diagnosis: which unknown numbers a machine has.

Steps, each opened once:

1. the measuring frame is found, where it is not known;
2. every hypothesis's signature; all small sets scored; the best refitted in the full
   model, signatures retaken there, and scored again until the best set stays;
3. outlying rows are named, left out, and 2 repeated;
4. functions are learned from the residual;
5. is the residual noise?  Where repeats scatter more than stated, sigma is larger, and
   2 to 4 are repeated.

It is given the rows to be fitted, and reads no others.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count, pairwise

import numpy as np
from numpy.typing import NDArray

from assembly.effects import apply_effects
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict, with_finite_motions, with_second_order
from validation.campaign.campaign import Campaign
from validation.diagnosis.candidates import Sensitivities
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.lack_of_fit import (
    believed_noise,
    lack_of_fit,
    outlying,
)
from validation.diagnosis.learning import Learned
from validation.diagnosis.plausible import impossible_rows
from validation.diagnosis.registration import register
from validation.diagnosis.responses import responses
from validation.diagnosis.selection import Selection, Update, select
from validation.diagnosis.signatures import conditions_of, whiten
from validation.diagnosis.small_terms import GEOMETRY, SMALL, screws_of
from validation.diagnosis.teaching import NOTHING, Taught, cost_of, taught
from validation.diagnosis.unknowns import Acting, LearnedFunction, Small, Unknowns

BLUNDERS = 20  # one row in so many may be called a blunder, in all
_PASSES = 8  # of believing repeats, and finite geometric errors
_TURNS = 6  # of leaving out rows, in each
_LOOSE = 1.25  # [sigma] what may be left before fits are made less sure
_BENDS = 3  # times that what finite geometric errors add is found anew
_SHARES = (1.0, 0.5, 0.25, 0.125)  # of a step towards the errors found
_BENT = 0.1  # of what is left, or of sigma: change of what finite errors add


@dataclass(frozen=True, eq=False)
class Traced:
    """What the search found.

    Attributes:
        campaign: of R rows; its sigma is the stated one times both factors below.
        unregistered: conditions of all rows, before any registration.
        conditions: the same, registered.
        used: (R,) bool, rows that were fitted.
        outliers: (R,) bool, rows left out.
        noise_factor: (6,) by which repeats scatter more than the sigma stated.
        inflation: [-] by which sigma was made larger for what nothing explains.
        selection: sets of effects, the best one fitted.
        learned: functions learned together with it.
        finite: whether motions of the declared model are finite.
    """

    campaign: Campaign
    unregistered: Conditions
    conditions: Conditions
    used: NDArray
    outliers: NDArray
    noise_factor: NDArray
    inflation: float
    selection: Selection
    learned: tuple[Learned, ...]
    finite: bool

    @property
    def fitting(self) -> Campaign:
        """The rows fitted."""
        return self.campaign.take(self.used)

    def unknowns(self) -> Unknowns:
        """The unknown numbers of the machine, with their priors."""
        fit, behind = self.selection.fit, self.selection.behind
        unknown = self.campaign.registration == "unknown"
        effects, at = [], 0
        for k, h in enumerate(fit.hypotheses):
            own = slice(at, at := at + len(h.slots))
            if unknown and k == 0:
                effects += self._device_frames(h)
            else:
                effects.append(Acting(h, fit.values[own]))
        ends = np.cumsum([0, *(len(term) for term in behind.terms)])
        sizes = [behind.size[a:b] for a, b in pairwise(ends.tolist())]
        terms = list(zip(behind.terms, sizes, strict=True))
        small = [Small(t.name, t.frame, t.axis, s) for t, s in terms if t.name in SMALL]
        learned = [size for term, size in terms if term.name not in SMALL]
        functions = [
            LearnedFunction(one.candidate, size)
            for one, size in zip(self.learned, learned, strict=True)
        ]
        sensitivities = None
        if functions:
            response = responses(self.conditions)
            sensitivities = Sensitivities(
                self.conditions, self.campaign.robot, response
            )
        return Unknowns(
            self.campaign.robot, tuple(effects), tuple(small), tuple(functions),
            sensitivities,
        )  # fmt: skip

    def _device_frames(self, hypothesis: Hypothesis) -> list[Acting]:
        """The measuring frame as it was found, one for each session."""
        fitted = {"registration": self.selection.fit.effects["registration"]}
        base = apply_effects(self.conditions, fitted).base
        base = np.broadcast_to(base, (len(self.campaign), 6))
        own = {}
        for session in self.campaign.sessions or (None,):
            row = 0
            if session is not None:
                row = int(np.flatnonzero(self.campaign.session == session)[0])
            own[session] = base[row]
        return [Acting(hypothesis, start, s, True) for s, start in own.items()]


def trace(
    campaign: Campaign, fitted: NDArray, update: Update, *, finite: bool = False
) -> Traced:
    """Search for the effects and functions that a declared model lacks.

    Args:
        campaign: of R rows.
        fitted: (R,) bool, the rows that are read.
        update: told what is done, how much of it and of how much.
        finite: whether motions of the declared model are finite.

    Returns:
        What was found.

    Raises:
        BadInput: the measuring frame is not known and cannot be found.
    """
    declared = conditions_of(campaign)
    finite = finite or declared.exact
    complete = with_finite_motions if finite else with_second_order
    declared = conditions = complete(declared)
    if campaign.registration == "unknown":
        conditions = register(campaign.take(fitted), conditions)
    impossible = impossible_rows(campaign)
    outliers = impossible.copy()
    factor, inflation, bends = np.ones(6), 1.0, 0
    learned = NOTHING
    straight: _Straight | None = None
    earlier: Selection | None = None
    for _ in range(_PASSES):
        some = partial(select, update=update, finite=finite)
        selection, outliers = _without_outliers(
            campaign, conditions, fitted, (outliers, impossible), some, earlier
        )
        earlier = selection
        used = fitted & ~outliers
        fitting = campaign.take(used)
        if bends < _BENDS:
            bent = _with_errors(campaign, conditions, used, selection, complete)
            if bent is not conditions:
                straight = straight or _Straight(conditions, used, selection)
                conditions, bends = bent, bends + 1
                continue
        known = learned if inflation > 1.0 else None
        selection, learned = taught(
            campaign, conditions, used, selection, update, known
        )
        if straight is not None and np.array_equal(used, straight.used):
            conditions, selection = _straighter(
                campaign, straight, conditions, selection, learned, update
            )
        left = selection.behind.left(selection.fit.residual)
        larger = believed_noise(fitting, left)
        lack = lack_of_fit(
            fitting, left, selection.unknowns + round(selection.behind.unknowns)
        )
        if np.any(larger > 1.0):
            factor = factor * larger
        elif inflation == 1.0 and lack.significant and lack.rms > _LOOSE:
            # what nothing explains must not be fitted as if it were known to a sigma
            inflation = lack.rms
            larger = np.full(6, inflation)
        else:
            break
        campaign, straight = replace(campaign, sigma=campaign.sigma * larger), None
    return Traced(
        campaign=campaign,
        unregistered=declared,
        conditions=conditions,
        used=fitted & ~outliers,
        outliers=outliers,
        noise_factor=factor,
        inflation=inflation,
        selection=selection,
        learned=learned.functions,
        finite=finite,
    )


def _without_outliers(
    campaign: Campaign, conditions: Conditions, fitted: NDArray,
    left_out: tuple[NDArray, NDArray], selected: Callable[..., Selection],
    earlier: Selection | None,
) -> tuple[Selection, NDArray]:  # fmt: skip
    """The selection on rows (R,) without those far off, and which these are.

    The farthest are left out first and the others looked at again without them; what is
    far off after some turns, all at once.

    Returns:
        The selection, and (R,) bool.
    """
    outliers, impossible = left_out
    for turn in count():
        used = fitted & ~outliers
        earlier = selection = selected(
            campaign.take(used), conditions.take(used), earlier=earlier
        )
        if turn == _TURNS:
            break
        left = selection.behind.left(selection.fit.residual)
        called = int((outliers & ~impossible).sum())
        most = max(0, len(campaign) // BLUNDERS - called)
        far = outlying(campaign.take(used), left, most, worst=turn < _TURNS - 1)
        if not far.any():
            break
        outliers = outliers.copy()
        outliers[used] = far
    return selection, outliers


@dataclass(frozen=True, eq=False)
class _Straight:
    """What a campaign's rows looked like before finite errors were added.

    Attributes:
        conditions: of all rows.
        used: (R,) bool, the rows fitted.
        selection: on these.
    """

    conditions: Conditions
    used: NDArray
    selection: Selection


def _straighter(
    campaign: Campaign, straight: _Straight, conditions: Conditions,
    selection: Selection, learned: Taught, update: Update,
) -> tuple[Conditions, Selection]:  # fmt: skip
    """The same functions without finite errors, if they cost less there.

    Errors may have stood for what was learned, and finite ones hide it.

    Returns:
        Conditions and selection with them, or those given.
    """
    if not learned.functions:
        return conditions, selection
    other, same = taught(
        campaign, straight.conditions, straight.used, straight.selection, update,
        learned,
    )  # fmt: skip
    if same.functions and cost_of(other) < cost_of(selection):
        return straight.conditions, other
    return conditions, selection


def _with_errors(
    campaign: Campaign, conditions: Conditions, used: NDArray, selection: Selection,
    complete: Callable[[Conditions], Conditions],
) -> Conditions:  # fmt: skip
    """Conditions whose finite part is that of the geometric errors found, too."""
    # the errors change with it, and are followed until it stays; a step so large that
    # what it adds leads away is halved
    behind, fitting = selection.behind, campaign.take(used)
    affected = apply_effects(conditions, selection.fit.effects)
    own = [affected.robot.index(frame.name) for frame in campaign.robot.frames]
    raw = behind.raw(selection.fit.residual)
    was = predict(conditions.take(used)).deviation

    def at(values: Sequence[NDArray]) -> tuple[float, NDArray, Conditions]:
        errors = affected.errors.copy()
        errors[:, own] += screws_of(campaign, behind.terms, values)
        added = complete(replace(affected, errors=errors)).second_order
        bent = replace(conditions, second_order=added)
        change = whiten(fitting, predict(bent.take(used)).deviation - was)
        left = raw - np.nan_to_num(change)
        return behind.lost(left, values), left, bent

    if not any(term.name == GEOMETRY for term in behind.terms):
        return conditions
    stays = behind.left(selection.fit.residual)
    limit = _BENT * max(1.0, float(np.sqrt(np.mean(stays**2))))
    known = [np.zeros(len(term)) for term in behind.terms]
    lost, left = at(known)[0], raw
    for _ in range(_PASSES):
        aim = behind.values(behind.whitened(left))
        for share in _SHARES:
            values = [k + share * (x - k) for k, x in zip(known, aim, strict=True)]
            trial, there, bent = at(values)
            if trial < lost:
                break
        else:
            break
        if np.abs(there - left).max() < limit:
            break
        conditions, known, lost, left = bent, values, trial, there
    return conditions
