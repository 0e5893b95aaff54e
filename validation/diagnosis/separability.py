"""Determine which effects can be distinguished with the design of a campaign.

An effect changes the readings by a linear combination of the columns A of its
signature.  Nuisance parameters, such as an unknown device pose, can imitate part of
this change.  Their columns are therefore projected out first.  With the projection P_f
onto the signature of effect f, the fraction of effect e that f can imitate is |P_f A_e|
/ |A_e|.

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
# Relative singular value below which a column is linearly dependent.
ROUNDING = 1e-9
# Relative singular value below which a direction of a signature is treated as zero.  It
# exceeds round-off, because signatures are finite differences.
_RANK = 1e-3


@dataclass(frozen=True, eq=False)
class Separability:
    """Visibility of each effect and its similarity to other effects.

    Attributes:
        names: names of the m effects.
        strength: (m,) [sigma] norm of the signature of each effect with plausible
            unknowns.
        left: (m,) fraction of this norm that remains after nuisance parameters are
            projected out.
        unknowns: (m,) number of unknowns.
        rank: (m,) number of unknowns that the design can distinguish.
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
        """Mask (m,) of effects that exceed the noise for plausible parameters."""
        return self.strength * self.left >= SEEN

    @property
    def traced(self) -> NDArray:
        """Mask (m,) of effects that can be detected if they are sufficiently large."""
        return (self.strength * self.left >= UNSEEN) & (self.rank > 0)

    @property
    def shows_at(self) -> NDArray:
        """Factors (m,) on plausible parameters for effects that equal the noise.

        The factor of an undetectable effect is infinite.
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
        """Return pairs (a, b) for which b can imitate a, but not vice versa."""
        one_way = (self.shared > LIKE) & (self.shared.T <= LIKE)
        one_way &= np.outer(self.traced, self.traced)
        return [(self.names[i], self.names[j]) for i, j in np.argwhere(one_way)]

    def overlapping(self) -> list[tuple[str, str]]:
        """Return pairs of effects that can partly imitate each other."""
        part = (self.cosine > LIKE) & (self.shared <= LIKE) & (self.shared.T <= LIKE)
        part &= np.outer(self.visible, self.visible)
        return [(self.names[i], self.names[j]) for i, j in np.argwhere(part) if i < j]


def compare_signatures(
    columns: Mapping[str, NDArray], nuisance: NDArray | None = None
) -> Separability:
    """Return a comparison of the signatures of effects.

    Args:
        columns: mapping from each effect to the changes (N, k) of the readings caused
            by plausible unknowns, divided by sigma.
        nuisance: (N, p) columns of nuisance parameters, divided by sigma.
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

    ``whole`` is the norm of the signature.
    """
    return orthonormal_basis(columns, _RANK, _RANK * whole)


def orthonormal_basis(
    columns: NDArray, rank: float = ROUNDING, floor: ArrayLike = 0.0
) -> NDArray:
    """Return an orthonormal basis (N, r) of columns, independent of their units.

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
