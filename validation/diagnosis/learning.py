r"""Functions learned from what the library leaves, one after the other.

Geometry, springs, effects and functions found so far are taken out of residual and
candidates by their priors; a block B of m columns with a prior of one size t is then
worth, in logarithms of probability,

    (z'z - L/v - n ln v - sum ln(1 + t^2 l_i) - ln n)/2 - ln(candidates),
    L = z'z - sum b_i^2 t^2/(1 + t^2 l_i),

l, b the eigenvalues of B'B and the residual z along its eigenvectors.  The noise v is
what is left, L/n, where that is more than sigma says, so that scatter teaches nothing.
The best block must foretell configurations it was not fitted to before it is believed.

Sources:
    MacKay (1992), Bayesian interpolation, Neural Computation 4, 415.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular
from scipy.stats import chi2

from validation.campaign.campaign import Campaign
from validation.diagnosis.candidates import (
    Candidate,
    CandidatePart,
    Sensitivities,
    all_shapes,
    first_shapes,
    places_of,
    variables_of,
)
from validation.diagnosis.evidence import Evidence, Prior, background
from validation.diagnosis.holdout import blocks_of, gain_over_blocks
from validation.diagnosis.small_terms import SmallTerm

MOST = 4  # functions that are learned
_LOOKED = 1200  # readings that a first look takes
_JUDGED = 12000  # readings by which forms are compared
_REFINED = 16  # places and variables for which every form is tried
_SURE = 3.0  # in score: what a function must be worth
_SPLINE = 3.0  # in score: by which a form without a name must be better
_EQUAL = 3.0  # in score: places that do as well
_FOLDS = 5
_PROVEN = 2.0  # standard errors by which a fold's rows must be foretold better
_NOISE = 0.05  # probability above which what is left is noise
_FLAT = 1e4  # [sigma] size of unknowns of effects in a fold
_SIZES = 10.0 ** np.arange(-0.5, 4.1, 0.5)  # of a block, where its columns have norm 1


@dataclass(frozen=True, eq=False)
class Learned:
    """A function that was learned.

    Attributes:
        candidate: where, of what, in which form.
        changes: (R, 6, m) what every row of the campaign reads per unknown.
        axis: (m,) component each unknown acts in.
        equivalent: places and variables that do as well.
        gain: logarithm of how much likelier it makes the readings.
    """

    candidate: Candidate
    changes: NDArray
    axis: NDArray
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
    """

    learned: tuple[Learned, ...]
    terms: tuple[SmallTerm, ...]
    prior: Prior
    left: float
    unknowns: float

    @property
    def cost(self) -> float:
        """[-] least is best: n ln(noise left) and the unknowns, as in BIC."""
        n = len(self.terms[0].columns)
        return n * np.log(max(self.left / n, 1.0)) + self.unknowns * np.log(n)


@dataclass(frozen=True, eq=False)
class Unexplained:
    """What a set of effects leaves in the N cells fitted.

    Attributes:
        terms: small terms, with all their unknowns.
        residual: (N,) whitened readings minus the set of effects.
        effects: (N, k) whitened change per unknown of that set and the device's frame.
    """

    terms: Sequence[SmallTerm]
    residual: NDArray
    effects: NDArray


class _School:
    """What is known while functions are looked for."""

    def __init__(
        self, campaign: Campaign, used: NDArray, sensitivities: Sensitivities,
        left: Unexplained,
    ) -> None:  # fmt: skip
        self.campaign, self.used, self.sensitivities = campaign, used, sensitivities
        self.fitting = campaign.take(used)
        self.residual, self.effects = left.residual, left.effects
        self.terms = list(left.terms)
        self.learned: list[Learned] = []
        self._Q = np.linalg.qr(left.effects)[0]
        self.noise = 1.0
        self.update()

    def without_effects(self, columns: NDArray) -> NDArray:
        """Columns without what effects can do."""
        return columns - self._Q @ (self._Q.T @ columns)

    def update(self) -> None:
        """Sizes of all small terms, and the noise that is left, found anew."""
        for _ in range(2):
            scaled = [
                replace(t, columns=self.without_effects(t.columns) / self.noise)
                for t in self.terms
            ]
            z = self.without_effects(self.residual) / self.noise
            self.prior = Evidence(scaled, len(z)).best(z)
            self.behind = background(scaled, self.prior)
            self.whitened = self.behind.whitened(z)
            left = self.behind.left(self.whitened) * self.noise
            freedom = len(z) - self.effects.shape[1] - self.behind.unknowns
            self.left = float(left @ left)
            self.freedom = max(1, round(freedom))
            self.noise = max(1.0, np.sqrt(self.left / self.freedom))

    def believe(self, one: Learned) -> None:
        """A function is one of the small terms from now on."""
        self.learned.append(one)
        self.terms.append(_term(self, one, len(self.learned)))
        self.update()

    def part(self, most: int) -> "_School":
        """The same of fewer rows, with about so many readings at most."""
        rows, total = np.flatnonzero(self.used), len(self.residual)
        if total <= most:
            return self
        count = len(rows) * most // total
        kept = rows[np.linspace(0, len(rows) - 1, count).astype(int)]
        used = np.isin(np.arange(len(self.used)), kept)
        cells = used[rows[np.nonzero(self.fitting.cells)[0]]]
        terms = [t.take(np.ones(len(t), bool), cells) for t in self.terms]
        left = Unexplained(terms, self.residual[cells], self.effects[cells])
        return _School(self.campaign, used, self.sensitivities, left)

    @property
    def done(self) -> bool:
        """Whether what is left is noise."""
        return float(chi2.sf(self.left, self.freedom)) > _NOISE

    def columns(self, changes: NDArray) -> NDArray:
        """(N, m) of changes (R, 6, m) of all rows, in the cells fitted, over sigma."""
        cells = self.fitting.cells
        return changes[self.used][cells] / self.fitting.sigma[cells][:, None]

    def seen(self, columns: NDArray) -> NDArray:
        """Columns without effects, by the covariance of all small terms."""
        return self.behind.whitened(self.without_effects(columns)) / self.noise


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
    for one in known or ():
        school.believe(one)
    for turn in range(MOST if known is None else 0):
        update("functions learned", turn, MOST)
        if school.done:
            break
        judged = school.part(_JUDGED)
        function = _best(judged, every)
        if function is None or not _foretells(judged, function):
            break
        school.believe(function)
    update("functions learned", MOST, MOST)
    unknowns = school.effects.shape[1] + school.behind.unknowns
    return Lesson(
        tuple(school.learned), tuple(school.terms), school.prior, school.left, unknowns
    )


def term_name(number: int) -> str:
    """Name of the term of the function learned as the first, second .."""
    return f"function {number}"


def _term(school: _School, one: Learned, number: int) -> SmallTerm:
    """A learned function as a small term."""
    m = len(one.axis)
    return SmallTerm(
        term_name(number), np.zeros(m, int), one.axis, school.columns(one.changes),
        np.full(m, np.nan), -np.inf, sure=True,
    )  # fmt: skip


def _best(
    school: _School,
    every: Sequence[tuple[str, tuple[CandidatePart, ...]]],
) -> Learned | None:
    """The likeliest function, of those worth it."""
    robot = school.campaign.robot
    looked, few = [], school.part(_LOOKED)
    for kind, parts in every:
        for shape in first_shapes(robot, parts[0].variable):
            looked.append(Candidate(parts, kind, shape))
    first = sorted(((_worth(few, c), c) for c in looked), key=lambda one: -one[0])
    chosen = list(dict.fromkeys((c.kind, c.parts) for _, c in first))[:_REFINED]
    refined = []
    fitted = school.sensitivities.conditions.take(school.used)
    for kind, parts in chosen:
        for shape in all_shapes(fitted, parts[0].variable, kind):
            one = Candidate(parts, kind, shape)
            worth = _worth(school, one) - _SPLINE * (shape.form == "spline")
            refined.append((worth, one))
    if not refined:
        return None
    refined.sort(key=lambda one: -one[0])
    worth, best = refined[0]
    tried = len(looked) * max(1, len(refined) // len(chosen))
    gain = worth - np.log(tried) - 0.5 * np.log(len(school.residual))
    if gain < _SURE:
        return None
    others = dict.fromkeys(c.parts for w, c in refined if w > worth - _EQUAL)
    same = tuple(parts for parts in others if parts != best.parts)
    changes, axis = school.sensitivities.changes(best)
    return Learned(best, changes, axis, same, float(gain))


def _worth(school: _School, one: Candidate) -> float:
    """Logarithm of how much likelier a candidate makes the readings."""
    changes, _ = school.sensitivities.changes(one)
    raw = school.columns(changes)
    size = np.linalg.norm(raw, axis=0).max(initial=0.0)
    if size == 0.0:
        return -np.inf
    B = school.seen(raw / size)
    values, vectors = np.linalg.eigh(B.T @ B)
    along = (vectors.T @ (B.T @ school.whitened)) ** 2
    t = (_SIZES[:, None] * school.noise) ** 2
    grown = 1 + t * np.maximum(values, 0.0)
    before = float(school.whitened @ school.whitened)
    left = before - (along * t / grown).sum(axis=1)
    # the noise is what this candidate leaves, and no less than sigma says
    count = len(school.whitened)
    noise = np.clip(left / count, school.noise**-2.0, 1.0)
    gains = before - left / noise - count * np.log(noise) - np.log(grown).sum(axis=1)
    return float(gains.max() / 2)


def _foretells(school: _School, one: Learned) -> bool:
    """Whether a function foretells rows that it was not fitted to."""
    B = school.columns(one.changes)
    term = replace(_term(school, one, 0), columns=school.seen(B))
    prior = Evidence([term], len(school.residual)).best(school.whitened)
    block = background([term], prior)
    if not block:
        return False
    norm = np.linalg.norm(school.effects, axis=0)
    flat = school.effects * (_FLAT / np.where(norm > 0, norm, 1.0))
    used = zip(school.terms, school.prior.used, strict=True)
    small = np.hstack([flat[:, :0], *(t.columns[:, u] for t, u in used)])
    known = np.hstack([flat, small * school.behind.size])
    rows = np.nonzero(school.fitting.cells)[0]
    where = blocks_of(school.fitting)[0][rows]
    names = np.random.default_rng(1).permutation(np.unique(where))
    if len(names) < 2:
        return False
    less = np.zeros(len(where))
    for fold in np.array_split(names, min(_FOLDS, len(names))):
        kept = np.isin(where, fold)
        lost = [
            _foretold(X, school.residual, kept) / school.noise**2
            for X in (known, np.hstack([known, B * block.size]))
        ]
        less[kept] = lost[0] - lost[1]
    gain, error = gain_over_blocks(less, where)
    return gain > _PROVEN * error


def _foretold(X: NDArray, z: NDArray, kept: NDArray) -> NDArray:
    """Squared errors of the cells kept out of a fit with unknowns of size one."""
    # the prior as rows: products of columns would lose what nearly equal ones tell
    count = X.shape[1]
    A = np.vstack([X[~kept], np.eye(count)])
    R = qr(np.column_stack([A, np.append(z[~kept], np.zeros(count))]), mode="r")[0]
    x = solve_triangular(R[:count, :count], R[:count, count])
    return (z[kept] - X[kept] @ x) ** 2
