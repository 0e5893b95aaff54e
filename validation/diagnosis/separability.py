"""Determine which effects can be distinguished with the design of a campaign.

The signature A of an effect is the matrix of derivatives of the readings with respect
to its unknowns. Nuisance parameters, such as an unknown device pose, can cause similar
changes of the readings. The derivatives with respect to nuisance parameters are
therefore projected out of A.  With the projection P_f onto the signature of effect f,
the fraction of effect e that f can imitate is |P_f A_e| / |A_e|.

Sources:
    Bjoerck, Golub (1973), Numerical methods for computing angles between linear
    subspaces, Math. Comp. 27, 579: cosines are singular values of Q_e^T Q_f.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.validation.diagnosis.signatures import UNSEEN

LIKE = 0.98  # cosine above which a design cannot distinguish two signatures
SEEN = 3.0  # [sigma] smallest norm of a detectable signature
# Relative singular value below which columns are treated as linearly dependent.
ROUNDING = 1e-9
# Relative singular value of a signature that is treated as zero. This tolerance exceeds
# round-off errors, because signatures are computed by finite differences.
_RANK = 1e-3


@dataclass(frozen=True, eq=False)
class Separability:
    """Size of the change of the readings by each effect, and similarity of the effects.

    Attributes:
        names: names of the m effects.
        strength: (m,) [sigma] norm of the change of the readings by each effect with
            plausible parameters.
        left: (m,) fraction of ``strength`` that remains after nuisance parameters are
            projected out.
        unknowns: (m,) number of unknowns of each effect.
        rank: (m,) number of unknowns of each effect that the design can distinguish.
        cosine: (m, m) cosine of the smallest angle between the spans of two signatures.
        shared: (m, m) fraction of effect i that effect j can imitate, in element [i,
            j].
    """

    names: tuple[str, ...]
    strength: NDArray
    left: NDArray
    unknowns: NDArray
    rank: NDArray
    cosine: NDArray
    shared: NDArray

    @property
    def visible(self) -> NDArray:
        """Mask (m,) of effects that change the readings by more than the noise."""
        return self.strength * self.left >= SEEN

    @property
    def traced(self) -> NDArray:
        """Mask (m,) of effects that can be detected if they are sufficiently large."""
        return (self.strength * self.left >= UNSEEN) & (self.rank > 0)

    @property
    def shows_at(self) -> NDArray:
        """Factors (m,) by which plausible parameters become just detectable.

        The factor is infinite for an effect that cannot be detected.
        """
        size = np.where(self.traced, self.strength * self.left, 0.0)
        return np.divide(SEEN, size, out=np.full(len(size), np.inf), where=size > 0)

    def classes(self) -> list[tuple[str, ...]]:
        """Return classes of at least two effects that the design cannot distinguish."""
        alike = (self.shared > LIKE) & (self.shared.T > LIKE)
        alike &= np.outer(self.traced, self.traced)
        waiting = list(range(len(self.names)))
        groups = []
        while waiting:
            group, edge = set(), {waiting[0]}
            while edge:
                group |= edge
                near = np.flatnonzero(alike[list(edge)].any(axis=0))
                edge = set(near.tolist()) - group
            waiting = [i for i in waiting if i not in group]
            if len(group) > 1:
                groups.append(tuple(self.names[i] for i in sorted(group)))
        return groups

    def imitated(self) -> list[tuple[str, str]]:
        """Return pairs (a, b) of effects: b can imitate a, but not vice versa."""
        one_way = (self.shared > LIKE) & (self.shared.T <= LIKE)
        one_way &= np.outer(self.traced, self.traced)
        return [(self.names[i], self.names[j]) for i, j in np.argwhere(one_way)]

    def overlapping(self) -> list[tuple[str, str]]:
        """Return pairs of effects with partly similar changes of the readings."""
        part = (self.cosine > LIKE) & (self.shared <= LIKE) & (self.shared.T <= LIKE)
        part &= np.outer(self.visible, self.visible)
        return [(self.names[i], self.names[j]) for i, j in np.argwhere(part) if i < j]


def compare_signatures(
    columns: Mapping[str, NDArray], nuisance: NDArray | None = None
) -> Separability:
    """Return a comparison of the signatures of effects.

    Args:
        columns: signature (N, k) of each effect, scaled to plausible unknowns and
            divided by sigma.
        nuisance: (N, p) derivatives with respect to nuisance parameters, divided by
            sigma.
    """
    names, left = tuple(columns), dict(columns)
    if nuisance is not None:
        out = _basis(nuisance, np.linalg.norm(nuisance, axis=0).max(initial=0.0))
        left = {e: A - out @ (out.T @ A) for e, A in columns.items()}
    sizes = np.array([np.linalg.norm(columns[e]) for e in names])
    rest = np.array([np.linalg.norm(left[e]) for e in names])
    bases = [_basis(left[e], size) for e, size in zip(names, sizes, strict=True)]
    cosine, shared = np.eye(len(names)), np.eye(len(names))
    for i, j in permutations(range(len(names)), 2):
        if bases[i].shape[1] and bases[j].shape[1]:
            cosine[i, j] = np.linalg.norm(bases[i].T @ bases[j], 2)
            shared[i, j] = np.linalg.norm(bases[j].T @ left[names[i]]) / rest[i]
    return Separability(
        names=names,
        strength=sizes,
        left=np.divide(rest, sizes, out=np.zeros(len(names)), where=sizes > 0),
        unknowns=np.array([columns[e].shape[1] for e in names], dtype=int),
        rank=np.array([basis.shape[1] for basis in bases], dtype=int),
        cosine=np.minimum(cosine, 1.0),
        shared=np.minimum(shared, 1.0),
    )


def _basis(columns: NDArray, whole: float) -> NDArray:
    """Return an orthonormal basis (N, r) of the columns of a signature.

    ``whole`` is the norm of the signature before nuisance parameters are projected out.
    """
    return orthonormal_basis(columns, _RANK, _RANK * whole)


def orthonormal_basis(
    columns: NDArray, rank: float = ROUNDING, floor: ArrayLike = 0.0
) -> NDArray:
    """Return an orthonormal basis (N, r) of columns, which are normalised first.

    Args:
        columns: (N, k) columns.
        rank: relative singular value below which normalised columns are dependent.
        floor: norm up to which a column is treated as zero, one value or (k,).
    """
    size = np.linalg.norm(columns, axis=0)
    kept = columns[:, size > floor] / size[size > floor]
    if not kept.size:
        return np.zeros((len(columns), 0))
    U, s, _ = np.linalg.svd(kept, full_matrices=False)
    return U[:, s > rank * s[0]]
