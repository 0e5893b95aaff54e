r"""Functions learned from what the library leaves, one after the other.

Geometry, springs, effects and functions found so far are taken out of residual and
candidates by their priors.  A candidate of m columns is then worth what
:mod:`.remainder` says, less (ln n)/2 + ln(candidates).  The noise is what a candidate
leaves where that is more than sigma says, so that scatter teaches nothing.  The best
block must foretell configurations it was not fitted to before it is believed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from validation.campaign.campaign import Campaign
from validation.diagnosis.candidates import (
    Candidate,
    CandidatePart,
    Sensitivities,
    places_of,
    variables_of,
)
from validation.diagnosis.evidence import Evidence, Prior
from validation.diagnosis.forms_tried import all_shapes, first_shapes
from validation.diagnosis.holdout import SPANS, blocks_of
from validation.diagnosis.remainder import (
    Remainder,
    Unexplained,
    function_term,
    in_cells,
)
from validation.diagnosis.small_terms import SmallTerm
from validation.diagnosis.spans import simplest

MOST = 4  # functions that are learned
_LOOKED = 1200  # readings that a first look takes
_JUDGED = 12000  # readings by which forms are compared
_REFINED = 16  # places and variables for which every form is tried
_SURE = 3.0  # in score: what a function must be worth
_SPLINE = 3.0  # in score: by which a form without a name must be better
_EQUAL = 3.0  # in score: places that do as well
_LARGE = 100  # unknowns of one size, from which turning them pays
_NOISE = 0.05  # probability above which what is left is noise


@dataclass(frozen=True, eq=False)
class Learned:
    """A function that was learned.

    Attributes:
        candidate: where, of what, in which form.
        equivalent: places and variables that do as well.
        gain: logarithm of how much likelier it makes the readings.
    """

    candidate: Candidate
    equivalent: tuple[tuple[CandidatePart, ...], ...]
    gain: float


@dataclass(frozen=True, eq=False)
class Lesson:
    """Functions learned beside a set of effects.

    Attributes:
        learned: in the order found.
        terms: small terms of the rows fitted, those of the functions last.
        prior: of all of them.
        left: [-] squared whitened residual that stays.
        unknowns: [-] that the readings say, effects among them.
        forecast: [-] cost of what is foretold of other spans of time, where rows
            follow one another: their errors are not independent, and a fit tells less.
    """

    learned: tuple[Learned, ...]
    terms: tuple[SmallTerm, ...]
    prior: Prior
    left: float
    unknowns: float
    forecast: float | None

    @property
    def cost(self) -> float:
        """[-] least is best."""
        if self.forecast is not None:
            return self.forecast
        return cost(len(self.terms[0].columns), self.left, self.unknowns)


def cost(count: int, left: float, unknowns: float) -> float:
    """What n readings and unknowns cost as in BIC: n ln(noise left) + k ln n."""
    return count * np.log(max(left / count, 1.0)) + unknowns * np.log(count)


class _School:
    """What is known while functions are looked for."""

    def __init__(
        self, campaign: Campaign, used: NDArray, sensitivities: Sensitivities,
        left: Unexplained,
    ) -> None:  # fmt: skip
        self.fitting = campaign.take(used)
        self.sensitivities = sensitivities.take(np.flatnonzero(used))
        self.residual, self.effects = left.residual, left.effects
        self._Q = np.linalg.qr(left.effects)[0]
        self._free = self.without_effects(left.residual)
        self.terms: list[SmallTerm] = []
        self.learned: list[Learned] = []
        # inner products of all columns without effects, and of the residual with them;
        # many unknowns of one size are turned so that their own are diagonal
        self._turns: list[NDArray | None] = []
        self._gram, self._along = np.zeros((0, 0)), np.zeros(0)
        for term in left.terms:
            self._add(term)
        self.noise = 1.0
        self.prior = Prior((), {}, 0.0, 0.0)
        self.update()

    def without_effects(self, columns: NDArray) -> NDArray:
        """Columns without what effects can do."""
        shown = self._Q @ (self._Q.T @ columns)
        return np.subtract(columns, shown, out=shown)

    def _add(self, term: SmallTerm) -> None:
        """One small term more."""
        own = self.without_effects(term.columns)
        across = [
            _turned(turn, other.columns.T @ own)
            for other, turn in zip(self.terms, self._turns, strict=True)
        ]
        beside = np.vstack([np.zeros((0, len(term))), *across])
        gram, along, turn = own.T @ own, own.T @ self._free, None
        if np.isneginf(term.lower) and (term.group >= 0).all():
            gram, turn = _diagonal(gram, term.group)
        beside = _turned(turn, beside.T).T
        self._gram = np.block([[self._gram, beside], [beside.T, gram]])
        self._along = np.append(self._along, _turned(turn, along))
        self._turns.append(turn)
        self.terms.append(term)

    def update(self) -> None:
        """Sizes of all small terms, and the noise that is left, found anew."""
        squares = float(self._free @ self._free)
        for _ in range(2):
            v = self.noise**2
            evidence = Evidence(self.terms, len(self._free), self._gram / v)
            start = self._with_new(self.prior) if self.prior.used else None
            self.prior = evidence.best_of(self._along / v, squares / v, start)
            values, self.unknowns = evidence.posterior(self.prior, self._along / v)
            ends = np.cumsum([len(term) for term in self.terms])
            parts = np.split(values, ends[:-1]) if self.terms else []
            shown = np.zeros_like(self._free)
            for term, x, turn in zip(self.terms, parts, self._turns, strict=True):
                shown += term.columns @ (x if turn is None else turn @ x)
            left = self._free - self.without_effects(shown)
            freedom = len(left) - self.effects.shape[1] - self.unknowns
            self.left = float(left @ left)
            self.freedom = max(1, round(freedom))
            self.noise = max(1.0, np.sqrt(self.left / self.freedom))

    def _with_new(self, prior: Prior) -> Prior:
        """A prior in whose terms all that were added since are in use."""
        new = self.terms[len(prior.used) :]
        used = [*prior.used, *(np.ones(len(term), bool) for term in new)]
        return replace(prior, used=tuple(used))

    def believe(self, functions: Sequence[Learned]) -> None:
        """Functions are among the small terms from now on."""
        for one in functions:
            self.learned.append(one)
            columns = in_cells(self.sensitivities, one.candidate, self.fitting)
            axis = self.sensitivities.axes(one.candidate)
            self._add(function_term(term_name(len(self.learned)), axis, columns))
        if functions:
            self.update()

    def part(self, most: int) -> Remainder:
        """What is left in some of the rows, with about so many readings at most."""
        count, total = len(self.fitting), len(self.residual)
        rows = np.arange(count)
        if total > most:
            rows = np.linspace(0, count - 1, count * most // total).astype(int)
        cells = np.isin(np.nonzero(self.fitting.cells)[0], rows)
        left = Unexplained(self.terms, self.residual, self.effects)
        return Remainder(
            self.fitting.take(rows), self.sensitivities.take(rows), left, cells,
            self.prior, self.noise,
        )  # fmt: skip

    @property
    def done(self) -> bool:
        """Whether what is left is noise."""
        return float(chi2.sf(self.left, self.freedom)) > _NOISE


def _turned(turn: NDArray | None, columns: NDArray) -> NDArray:
    """Products (k,) or (k, m) with columns that are turned, from those with columns."""
    return columns if turn is None else turn.T @ columns


def _diagonal(gram: NDArray, group: NDArray) -> tuple[NDArray, NDArray | None]:
    """Products (k, k) of columns turned so that those of large groups are diagonal.

    Returns:
        Products, and by what (k, k) columns are turned; none where groups are small.
    """
    own = [np.flatnonzero(group == g) for g in np.unique(group)]
    large = [rows for rows in own if len(rows) >= _LARGE]
    if not large:
        return gram, None
    turn = np.eye(len(gram))
    for rows in large:
        turn[np.ix_(rows, rows)] = np.linalg.eigh(gram[np.ix_(rows, rows)])[1]
    turned = turn.T @ gram @ turn
    for rows in large:
        turned[np.ix_(rows, rows)] = np.diag(np.diag(turned)[rows])
    return turned, turn


def learn(
    campaign: Campaign, used: NDArray, sensitivities: Sensitivities,
    left: Unexplained, update: Callable[[str, int, int], None],
    known: Sequence[Learned] | None = None,
) -> Lesson:  # fmt: skip
    """Learn what the library leaves.

    Args:
        campaign: of R rows.
        used: mask (R,) of the rows fitted.
        sensitivities: of all rows, and their conditions.
        left: by the best set of effects, in the rows fitted.
        update: told how many functions were looked for.
        known: functions found before, beside which none is looked for; absent if none
            was looked for before.

    Returns:
        The lesson; no function where nothing can be shown.
    """
    school = _School(campaign, used, sensitivities, left)
    names = variables_of(sensitivities.conditions.take(used))
    every = list(places_of(campaign.robot, names))
    school.believe(known or ())
    while known is None and len(school.learned) < MOST and not school.done:
        update("functions learned", len(school.learned), MOST)
        functions = _best(school, school.part(_JUDGED), every)
        if not functions:
            break
        school.believe(functions[: MOST - len(school.learned)])
    update("functions learned", MOST, MOST)
    successive = blocks_of(school.fitting)[1] == SPANS
    return Lesson(
        learned=tuple(school.learned),
        terms=tuple(school.terms),
        prior=school.prior,
        left=school.left,
        unknowns=school.effects.shape[1] + school.unknowns,
        forecast=school.part(_JUDGED).forecast() if successive else None,
    )


def term_name(number: int) -> str:
    """Name of the term of the function learned as the first, second .."""
    return f"function {number}"


def _best(
    school: _School,
    judged: Remainder,
    every: Sequence[tuple[str, tuple[CandidatePart, ...]]],
) -> list[Learned]:
    """The likeliest function, of those worth it; where rows follow one another, two."""
    sensitivities = school.sensitivities
    looked = [
        Candidate(parts, kind, shape)
        for kind, parts in every
        for shape in first_shapes(sensitivities.robot, parts[0].variable)
    ]
    worth = school.part(_LOOKED).worths(looked)
    first = [looked[i] for i in np.argsort(-worth, kind="stable")]
    chosen = list(dict.fromkeys((c.kind, c.parts) for c in first))[:_REFINED]
    own = judged.sensitivities
    fitted = own.conditions.take(own.rows)
    refined = [
        Candidate(parts, kind, shape)
        for kind, parts in chosen
        for shape in all_shapes(fitted, parts[0].variable, kind)
    ]
    if not refined:
        return []
    unnamed = np.array([one.shape.form == "spline" for one in refined])
    worth = judged.worths(refined) - _SPLINE * unnamed
    tried = len(looked) * (len(refined) // len(chosen))
    gains = worth - np.log(tried) - 0.5 * np.log(judged.count)
    sure = np.flatnonzero(gains >= _SURE)
    if not len(sure):
        return []
    if judged.successive:
        some = simplest(judged, [refined[i] for i in sure], worth[sure])
        best = sure[list(some)].tolist()
    else:
        most = int(np.argmax(worth))
        best = [most] if judged.foretells([refined[most]]) else []
    return [
        Learned(refined[i], _equivalent(refined, worth, i), float(gains[i]))
        for i in best
    ]


def _equivalent(
    refined: Sequence[Candidate], worth: NDArray, best: int
) -> tuple[tuple[CandidatePart, ...], ...]:
    """Places and variables that do as well as a candidate's own."""
    near = np.flatnonzero(np.abs(worth - worth[best]) < _EQUAL)
    others = dict.fromkeys(refined[i].parts for i in near[np.argsort(-worth[near])])
    return tuple(parts for parts in others if parts != refined[best].parts)
