r"""Small unknowns taken out of a fit by their prior, its size found by the evidence.

With unknowns g of covariance S^2 and readings z = model + J g + noise, the covariance
of z - model is C = I + J S^2 J'.  Everything is scored with that covariance, so that no
other effect is claimed for what small unknowns may do.

======  ===============  ======  =====================================================
symbol  code             shape   meaning
======  ===============  ======  =====================================================
J       ``columns``      (N, k)  change of the whitened readings per small unknown
S       ``size``         (k,)    standard deviations of the prior
U, l    ``axes, gains``  (N, r)  J S = U sqrt(l) V', so that C = I + U l U'
W                        (N, N)  C^-1/2 = I - U (1 - 1/sqrt(1 + l)) U'
======  ===============  ======  =====================================================

Sources:
    MacKay (1992), Bayesian interpolation, Neural Computation 4, 415.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from validation.diagnosis.small_terms import SmallTerm

_FAINT = 1e-8  # a gain below it changes nothing
_PASSES = 6  # of leaving out springs that would be stiffer than declared
_LEAST, _MOST = -6.0, 14.0  # logarithms of sizes over those that show as noise does
_FIRST = 1.5  # from which they are looked for
_RANK = 1e-12  # of the largest eigenvalue: directions below it are rounding
_FURTHER = np.log(10.0)  # of each term: a tenth as likely


@dataclass(frozen=True, eq=False)
class Background:
    """Small terms with the sizes of their priors.

    Attributes:
        terms: those in use, each with the unknowns in use.
        size: (k,) [rad, m, rad/(N m), m/N] standard deviations of all priors.
        scales: of rotations and of translations that were asked for, by term.
        axes: (N, r) orthonormal.
        gains: (r,) variances along them, of noise 1.
        turn: (k, r) orthonormal: unknowns over their size along those axes.
        score: what the terms cost, to be added to a score: -ln det C / 2 - penalties.
    """

    terms: tuple[SmallTerm, ...]
    size: NDArray
    scales: dict[str, tuple[float, float]]
    axes: NDArray
    gains: NDArray
    turn: NDArray
    score: float

    def __bool__(self) -> bool:
        return bool(self.terms)

    @property
    def unknowns(self) -> float:
        """How many combinations of the unknowns the readings say, and not the prior."""
        return float(self.known.sum())

    def whitened(self, columns: NDArray) -> NDArray:
        """W times columns (N,) or (N, m)."""
        if not len(self.gains):
            return columns
        shrink = 1 - 1 / np.sqrt(1 + self.gains)
        return columns - self.axes @ (shrink * (self.axes.T @ columns).T).T

    def raw(self, whitened: NDArray) -> NDArray:
        """A residual r (N,) from W r."""
        if not len(self.gains):
            return whitened
        grow = np.sqrt(1 + self.gains) - 1
        return whitened + self.axes @ (grow * (self.axes.T @ whitened))

    def left(self, whitened: NDArray) -> NDArray:
        """What the most probable small unknowns leave of a residual r.

        Args:
            whitened: (N,) W r.

        Returns:
            (N,) r - J g.
        """
        return self.whitened(whitened)

    def values(self, whitened: NDArray) -> list[NDArray]:
        """The most probable unknowns of every term, from W r (N,)."""
        if not self.terms:
            return []
        along = self.axes.T @ whitened * np.sqrt(self.gains / (1 + self.gains))
        return self._by_term(self.size * (self.turn @ along))

    def lost(self, raw: NDArray, values: Sequence[NDArray]) -> float:
        """Twice the negative logarithm of how likely unknowns are, but for a constant.

        Args:
            raw: (N,) residual without the small unknowns.
            values: (k,) of every term.

        Returns:
            Squares of what they leave and of themselves over their prior.
        """
        moved = np.concatenate([np.zeros(0), *values])
        known = self.size > 0.0
        left = raw.copy()
        for term, x in zip(self.terms, values, strict=True):
            left -= term.columns @ x
        return float(left @ left + np.sum((moved[known] / self.size[known]) ** 2))

    def deviations(self) -> list[NDArray]:
        """Standard deviations of the unknowns of every term."""
        kept = 1 - np.einsum("kr,r->k", self.turn**2, self.known)
        return self._by_term(self.size * np.sqrt(np.maximum(kept, 0.0)))

    @property
    def known(self) -> NDArray:
        """(r,) share of each combination that the readings and not the prior say."""
        return self.gains / (1 + self.gains)

    def identified(self) -> list[NDArray]:
        """(k,) of every term, the share of each unknown that the readings say."""
        return self._by_term(np.einsum("kr,r->k", self.turn**2, self.known))

    def _by_term(self, values: NDArray) -> list[NDArray]:
        ends = np.cumsum([len(term) for term in self.terms])
        return np.split(values, ends[:-1]) if self.terms else []


NOTHING = Background(
    terms=(),
    size=np.zeros(0),
    scales={},
    axes=np.zeros((0, 0)),
    gains=np.zeros(0),
    turn=np.zeros((0, 0)),
    score=0.0,
)


@dataclass(frozen=True, eq=False)
class Prior:
    """Which small unknowns are in use, and how large they are thought to be.

    Attributes:
        used: a mask over each term's unknowns.
        scales: [rad, m] or [rad/(N m), m/N] of rotations and of translations, by term
            in use; where a frame's own tolerance says it, that is used instead.
        cost: -ln det C / 2 minus what choosing terms and sizes costs.
        evidence: logarithm of the probability of the readings, that cost included.
    """

    used: tuple[NDArray, ...]
    scales: dict[str, tuple[float, float]]
    cost: float
    evidence: float


def background(terms: Sequence[SmallTerm], prior: Prior) -> Background:
    """Terms with the sizes of a prior.

    Args:
        terms: those that the prior was found for, in any cells.
        prior: their sizes.

    Returns:
        The background.
    """
    kept = [t.take(used) for t, used in zip(terms, prior.used, strict=True)]
    kept = [term for term in kept if len(term)]
    if not kept:
        return NOTHING
    size = np.concatenate([_sizes(term, prior.scales[term.name]) for term in kept])
    scaled = np.hstack([term.columns for term in kept]) * size
    gains, turn = np.linalg.eigh(scaled.T @ scaled)
    shown = gains > _FAINT
    gains, turn = gains[shown], turn[:, shown]
    axes = scaled @ turn / np.sqrt(gains)
    return Background(
        terms=tuple(kept),
        size=size,
        scales=prior.scales,
        axes=axes,
        gains=gains,
        turn=turn,
        score=prior.cost,
    )


def _sizes(term: SmallTerm, scales: Sequence[float]) -> NDArray:
    """(k,) standard deviations of a term's unknowns."""
    asked = np.array(scales)[term.axis // 3]
    return np.where(np.isfinite(term.given), term.given, asked)


class Evidence:
    """What residuals say about the sizes of small terms."""

    def __init__(self, terms: Sequence[SmallTerm], cells: int) -> None:
        """Take inner products once.

        Args:
            terms: with their columns as they are to be scored.
            cells: number of readings N.
        """
        self.terms = tuple(terms)
        self._sure = [term.sure for term in terms]
        self._penalty = 0.5 * np.log(max(cells, 2))  # of each size asked for
        self._begin = np.cumsum([0, *(len(term) for term in terms)])
        group = [
            np.where(t.group < 0, -1, 2 * i + t.group) for i, t in enumerate(terms)
        ]
        self._group = np.concatenate([np.zeros(0, int), *group])
        self._most = np.array([size for t in terms for size in t.most])
        self._given = np.concatenate([np.zeros(0), *(t.given for t in terms)])
        J = np.hstack([np.zeros((cells, 0)), *(term.columns for term in terms)])
        norm = np.linalg.norm(J, axis=0)
        norm[norm == 0.0] = 1.0  # what others imitate wholly shows nothing
        values, V = np.linalg.eigh((J / norm).T @ (J / norm))
        shown = values > _RANK * values.max(initial=1.0)
        root = np.sqrt(values[shown])
        # J = basis @ inner: the same in as few dimensions as the readings can tell
        self._basis = J / norm @ V[:, shown] / root
        self._inner = root[:, None] * V[:, shown].T * norm

    def best(self, residual: NDArray) -> Prior:
        """The terms that a residual asks for, with their likeliest sizes.

        Springs that would have to be stiffer than declared are left out.

        Args:
            residual: (N,) whitened, of readings minus what other effects do.

        Returns:
            The prior; terms with tolerances of their own are always in it.
        """
        along = self._basis.T @ residual
        rest = -float(residual @ residual) / 2
        choices = product(*((True,) if s else (False, True) for s in self._sure))
        priors = [self._fitted(chosen, along, rest) for chosen in choices]
        return max(priors, key=lambda prior: prior.evidence)

    @property
    def always(self) -> bool:
        """Whether a term is there whatever the readings say."""
        return any(self._sure)

    def none(self) -> Prior:
        """The prior of a machine made exactly as declared."""
        return Prior(tuple(np.zeros(len(t), bool) for t in self.terms), {}, 0.0, 0.0)

    def _fitted(self, chosen: Sequence[bool], y: NDArray, rest: float) -> Prior:
        """The likeliest sizes of chosen terms."""
        used = [np.full(len(t), on) for t, on in zip(self.terms, chosen, strict=True)]
        logs = np.full(2 * len(self.terms), _FIRST)
        for _ in range(_PASSES):
            prior, values, logs = self._sized(used, y, rest, logs)
            parts = np.split(values, self._begin[1:-1])
            wrong = [x < t.lower for t, x in zip(self.terms, parts, strict=True)]
            if not any(w.any() for w in wrong):
                break
            used = [u & ~w for u, w in zip(used, wrong, strict=True)]
        return prior

    def _sized(
        self, used: Sequence[NDArray], y: NDArray, rest: float, start: NDArray
    ) -> tuple[Prior, NDArray, NDArray]:
        """The likeliest sizes of the unknowns in use.

        Returns:
            The prior, (k,) values of all unknowns, and the logarithms of all sizes.
        """
        mask = np.concatenate([np.zeros(0, bool), *used])
        R, group, given = self._inner[:, mask], self._group[mask], self._given[mask]
        norm = np.einsum("rk,rk->k", R, R)
        asked = np.unique(group[group >= 0])
        shows = np.ones(2 * len(self.terms))  # sizes that show as much as noise does
        for g in asked:
            shown = float(np.mean(norm[group == g]))
            shows[g] = 1 / np.sqrt(shown) if shown else 1.0

        def sizes(logs: NDArray) -> NDArray:
            return np.where(group < 0, given, (shows * np.exp(logs))[group])

        def against(some: NDArray) -> tuple[float, NDArray]:
            logs = np.zeros(len(shows))
            logs[asked] = some
            scaled = R * sizes(logs)
            L = np.linalg.cholesky(np.eye(len(y)) + scaled @ scaled.T)
            a = solve_triangular(L, y, lower=True, check_finite=False)
            B = solve_triangular(L, scaled, lower=True, check_finite=False)
            value = 0.5 * float(np.sum(a**2)) + float(np.log(np.diag(L)).sum())
            slope = (a @ B) ** 2 - np.einsum("rk,rk->k", B, B)
            return value, -np.array([slope[group == g].sum() for g in asked])

        logs = start.copy()
        if len(asked):
            most = np.log(self._most[asked] / shows[asked])
            bounds = [(_LEAST, float(np.clip(m, _LEAST, _MOST))) for m in most]
            options = {"ftol": 1e-7, "maxiter": 40}
            begin = np.clip(start[asked], *np.transpose(bounds))
            logs[asked] = minimize(
                against, begin, jac=True, method="L-BFGS-B", bounds=bounds,
                options=options,
            ).x  # fmt: skip
        s = sizes(logs)
        C = np.eye(len(y)) + (R * s**2) @ R.T
        a = np.linalg.solve(C, y)
        values = np.zeros(len(mask))
        values[mask] = s**2 * (R.T @ a)
        cost = 0.5 * float(np.linalg.slogdet(C)[1])
        cost += self._penalty * float(np.sum(logs[asked] > _LEAST + 1e-3))
        scales = {}
        for i, (term, u) in enumerate(zip(self.terms, used, strict=True)):
            own = [2 * i, 2 * i + 1]
            if u.any():
                size = np.where(np.isin(own, asked), (shows * np.exp(logs))[own], 0.0)
                scales[term.name] = (float(size[0]), float(size[1]))
                cost += 0.0 if term.sure else _FURTHER
        evidence = rest - 0.5 * float(y @ a - y @ y) - cost
        return Prior(tuple(used), scales, -cost, evidence), values, logs
