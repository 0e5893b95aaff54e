"""Screens of a campaign's hypotheses, small terms and nuisances taken out of them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from validation.diagnosis.background import background
from validation.diagnosis.evidence import Evidence, Prior
from validation.diagnosis.scoring import Scored, Screen
from validation.diagnosis.signatures import Signature
from validation.diagnosis.small_terms import SmallTerm

BETTER = 1.0  # in score: sizes of small terms that are looked at again
_PRIORS = 4  # such sizes tried, at most


class Screens:
    """Screens of the same hypotheses behind which small terms stand or do not."""

    def __init__(
        self, terms: Sequence[SmallTerm], project: "Projector", residual: NDArray
    ) -> None:
        self.terms = tuple(terms)
        self._project, self._residual = project, project(residual)
        self._projected = [replace(t, columns=project(t.columns)) for t in terms]
        self.evidence = Evidence(self._projected, len(residual))
        # the signatures last asked for, nuisances taken out
        self._signatures: Sequence[Signature] = ()
        self._columns = np.zeros((len(residual), 0))

    def screen(self, signatures: Sequence[Signature], prior: Prior) -> Screen:
        """The screen of signatures with small terms of a prior behind them."""
        behind = background(self._projected, prior)
        if self._signatures is not signatures:
            every = [
                part for s in signatures for part in (s.columns, s.offset[:, None])
            ]
            nothing = np.zeros((len(self._residual), 0))
            self._signatures = signatures
            self._columns = self._project(np.hstack([nothing, *every]))
        # all together: small terms have many columns to be read
        seen = behind.whitened(self._columns)
        ends = np.cumsum([s.columns.shape[1] + 1 for s in signatures])[:-1]
        parts = np.split(seen, ends, axis=1) if signatures else []
        return Screen(
            behind.whitened(self._residual),
            [
                Signature(s.hypothesis, part[:, -1], part[:, :-1])
                for s, part in zip(signatures, parts, strict=True)
            ],
        )

    def first(self, signatures: Sequence[Signature]) -> Prior:
        """The prior with which the best set scores best, all to first order.

        Small terms may be all there is, or come beside the best set: both are tried,
        each with the sizes asked for anew once its best set is known.

        Args:
            signatures: of all hypotheses.

        Returns:
            The prior, of nothing where nothing small is asked for.
        """
        nothing = self.evidence.none()
        waiting = [self.evidence.best(self._residual)]
        if not self.evidence.always:
            waiting.append(nothing)
        tried: list[tuple[float, Prior]] = []
        while waiting:
            prior = waiting.pop(0)
            screen = self.screen(signatures, prior)
            best = screen.search()[0]
            tried.append((best.score + prior.cost, prior))
            shown = background(self._projected, prior).raw(screen.shown(best))
            again = self.evidence.best(self._residual - shown)
            most = max(score for score, _ in tried)
            better = again.evidence + score_beside_squares(best) > most + BETTER
            if better and len(tried) < _PRIORS:
                waiting.append(again)
        return max(tried, key=lambda one: one[0])[1]


def score_beside_squares(one: Scored) -> float:
    """What a set's score takes off for being one, beside its squared residual."""
    return one.score + one.rss / 2


class Projector:
    """Takes nuisances out of columns."""

    def __init__(self, nuisances: list[Signature]) -> None:
        self._q = None
        if nuisances:
            A = np.hstack([s.columns for s in nuisances])
            norm = np.linalg.norm(A, axis=0)
            u, size, _ = np.linalg.svd(A / np.where(norm > 0, norm, 1.0), False)
            self._q = u[:, size > 1e-10 * size[0]]

    def __call__(self, columns: NDArray) -> NDArray:
        """Columns without what the nuisances can do."""
        if self._q is None:
            return columns
        return columns - self._q @ (self._q.T @ columns)
