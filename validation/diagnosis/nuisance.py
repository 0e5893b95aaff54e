"""Nuisance parameters: geometric errors of frames and springs of joints.

Random springs describe compliance that is spread over many joints.  A spring with the
same column as a single unknown of a library effect is removed: it is that effect.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.diagnosis.small_terms import GEOMETRY, SPRINGS, SmallTerm

_SAME = 1 - 1e-6  # cosine above which two columns are equal


@dataclass(frozen=True, eq=False)
class Nuisance:
    """k unknowns of geometric errors and springs.

    Attributes:
        columns: (N, k) whitened change of the readings per unknown.
        group: (k,) 0 and 1 rotations and translations of frames, 2 and 3 of springs.
        given: (k,) declared standard deviation, or NaN.
        most: (k,) largest plausible standard deviation.
        frame, axis: (k,) row of the frame and component of the screw.
    """

    columns: NDArray
    group: NDArray
    given: NDArray
    most: NDArray
    frame: NDArray
    axis: NDArray

    @property
    def spring(self) -> NDArray:
        """(k,) whether it is a spring; its compliance cannot be negative."""
        return self.group >= 2

    @property
    def declared(self) -> bool:
        """Whether the robot declares tolerances; geometric errors are then in use."""
        return bool(np.isfinite(self.given).any())


def nuisance(terms: Sequence[SmallTerm], named: NDArray) -> Nuisance:
    """Collect the nuisance parameters, without springs that are library effects.

    Args:
        terms: of geometry, of springs, both or none.
        named: (N, c) columns of single unknowns of library effects.

    Returns:
        The parameters in the order of the terms.
    """
    unit = named / np.maximum(np.linalg.norm(named, axis=0), 1e-300)
    kept = []
    for term in terms:
        if term.name == SPRINGS:
            size = np.maximum(np.linalg.norm(term.columns, axis=0), 1e-300)
            same = np.abs(unit.T @ (term.columns / size)) > _SAME
            term = term.take(np.flatnonzero(~same.any(axis=0)))
        kept.append(term)
    kept = [term for term in kept if len(term)]
    numbers = {GEOMETRY: 0, SPRINGS: 2}
    group = [numbers[t.name] + t.axis // 3 for t in kept]
    most = [np.array(t.most)[t.axis // 3] for t in kept]
    return Nuisance(
        columns=np.hstack([np.zeros((len(named), 0)), *(t.columns for t in kept)]),
        group=np.concatenate([np.zeros(0, int), *group]),
        given=np.concatenate([np.zeros(0), *(t.given for t in kept)]),
        most=np.concatenate([np.zeros(0), *most]),
        frame=np.concatenate([np.zeros(0, int), *(t.frame for t in kept)]),
        axis=np.concatenate([np.zeros(0, int), *(t.axis for t in kept)]),
    )
