"""Effects that a campaign's design can distinguish, computed before any fit.

An effect changes the readings by a combination of the columns A of its signature.
Nuisance parameters (such as an unknown registration) can imitate a part of it, so they
are projected out first.  With P_f the projection on the signature of effect f, |P_f
A_e| / |A_e| is the share of effect e that f can imitate.

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
SEEN = 3.0  # [sigma] norm from which on a signature is detectable
# relative size of a direction that other columns imitate except for rounding
ROUNDING = 1e-9
# relative size that counts as zero for signatures, because they are secants
_RANK = 1e-3


@dataclass(frozen=True, eq=False)
class Separability:
    """Visibility of each effect, and its similarity to other effects.

    Attributes:
        names: names of the m effects.
        strength: (m,) [sigma] norm of an effect's signature at plausible sizes of its
            unknowns, over all rows, before nuisance parameters are projected out.
        left: (m,) share of the norm that remains after the projection.
        unknowns: (m,) number of unknowns.
        rank: (m,) number of unknowns that the design can distinguish.
        cosine: (m, m) cosine of the smallest angle between two signatures; 1 if a
            combination of one equals a combination of the other.
        shared: (m, m) share of the row's effect that the column's effect can imitate.
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
        """(m,) bool, True if an effect of plausible size exceeds the noise."""
        return self.strength * self.left >= SEEN

    @property
    def traced(self) -> NDArray:
        """(m,) bool, True if an effect of sufficient size would exceed the noise."""
        return (self.strength * self.left >= UNSEEN) & (self.rank > 0)

    @property
    def shows_at(self) -> NDArray:
        """(m,) factor on plausible sizes that exceeds the noise; inf without one."""
        size = np.where(self.traced, self.strength * self.left, 0.0)
        return np.divide(SEEN, size, out=np.full(len(size), np.inf), where=size > 0)

    def classes(self) -> list[tuple[str, ...]]:
        """Return the classes of effects that imitate each other completely.

        Returns:
            Classes of two and more effects; a verdict can only name the class.
        """
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
        """Return pairs (a, b) with the span of a inside the span of b, not reverse."""
        one_way = (self.shared > LIKE) & (self.shared.T <= LIKE)
        one_way &= np.outer(self.traced, self.traced)
        return [(self.names[i], self.names[j]) for i, j in np.argwhere(one_way)]

    def overlapping(self) -> list[tuple[str, str]]:
        """Return pairs of effects that imitate each other only in part."""
        part = (self.cosine > LIKE) & (self.shared <= LIKE) & (self.shared.T <= LIKE)
        part &= np.outer(self.visible, self.visible)
        return [(self.names[i], self.names[j]) for i, j in np.argwhere(part) if i < j]


def compare_signatures(
    columns: Mapping[str, NDArray], nuisance: NDArray | None = None
) -> Separability:
    """Return the comparison of the signatures of effects.

    Args:
        columns: for each effect (N, k), changes of the readings over sigma at plausible
            sizes.
        nuisance: (N, p) columns of nuisance parameters, over sigma.

    Returns:
        Strengths, shares and angles of all signatures.
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
    """Return an (N, r) orthonormal basis; ``whole`` is the size of a large column."""
    return orthonormal_basis(columns, _RANK, _RANK * whole)


def orthonormal_basis(
    columns: NDArray, rank: float = ROUNDING, floor: ArrayLike = 0.0
) -> NDArray:
    """Return an orthonormal basis of columns, independent of the units of the columns.

    Args:
        columns: (N, k) columns.
        rank: relative singular value below which normalised columns count as dependent.
        floor: norm up to which a column counts as zero; one value, or (k,).

    Returns:
        (N, r) orthonormal columns.
    """
    size = np.linalg.norm(columns, axis=0)
    kept = columns[:, size > floor] / size[size > floor]
    if not kept.size:
        return np.zeros((len(columns), 0))
    U, s, _ = np.linalg.svd(kept, full_matrices=False)
    return U[:, s > rank * s[0]]
