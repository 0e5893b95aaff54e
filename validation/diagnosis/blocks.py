"""Inner products of candidates' columns, row by row of the campaign.

A column of a candidate is what a component does to the readings of a row times a
number of that row.  So its products with any columns take one pass over the readings
for each component, and another over the rows, a sixth of them, for each number:

======  ===============  =========  ==================================================
symbol  code             shape      meaning
======  ===============  =========  ==================================================
a       ``answer``       (R, 6)     whitened change of the readings per unit of a
                                    component at a place
P       ``numbers``      (R, q)     columns of forms of a variable
B                        (N, q)     of the candidate, B_(rc)q = a_rc P_rq
Y       ``known``        (N, p)     orthonormal basis of what is taken out
======  ===============  =========  ==================================================

    Y'B = (sum over c of Y_(rc) a_rc)' P,    B'B = P' diag(sum over c of a_rc^2) P.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.campaign.campaign import Campaign
from validation.diagnosis.candidates import CandidatePart, Sensitivities
from validation.diagnosis.forms_tried import CandidateShape

_PLACES = 6  # components whose products are kept: those of one place
_FORMS = 32  # variables whose forms are kept


@dataclass(frozen=True, eq=False)
class Block:
    """A candidate of m columns B beside what is known, P = 1 - Y Y'.

    Attributes:
        gram: (m, m) B'P B.
        along: (m,) of B with what is left.
        size: largest norm of a column of B.
    """

    gram: NDArray
    along: NDArray
    size: float


class Blocks:
    """Products of candidates with one another, with what is known and what is left."""

    def __init__(
        self, campaign: Campaign, sensitivities: Sensitivities,
        known: Iterable[NDArray], left: NDArray,
    ) -> None:  # fmt: skip
        """Sort columns by row.

        Args:
            campaign: of R rows, N measured cells.
            sensitivities: of these rows.
            known: columns (N, p), orthonormal all together.
            left: (N,) to which candidates are held.
        """
        cells = campaign.cells
        self._sensitivities = sensitivities
        self._over_sigma = np.where(cells, 1 / campaign.sigma, 0.0)
        self._known = [_by_row(columns.T, cells) for columns in known]
        self._left = _by_row(left[None], cells)[0]
        self._places: dict[object, tuple[NDArray, NDArray, NDArray]] = {}
        self._forms: dict[object, tuple[NDArray, list[list[int]]]] = {}

    def at(
        self, kind: str, parts: Sequence[CandidatePart],
        shapes: Sequence[CandidateShape],
    ) -> list[Block]:  # fmt: skip
        """Candidates that differ in their form alone.

        Args:
            kind: of all.
            parts: where they act, and of what.
            shapes: their forms.

        Returns:
            A block for each form; unknowns part by part, component by component.
        """
        strips, picked, begin = [], [np.zeros((len(shapes), 0), int)], 0
        for part in parts:
            numbers, taken = self._numbers(part.variable, tuple(shapes))
            for component in part.components:
                strips.append((numbers, *self._place(part.where, component, kind)))
                picked.append([[begin + k for k in one] for one in taken])
                begin += numbers.shape[1]
        gram = _gram(strips)
        size = np.sqrt(np.diag(gram))
        known = np.hstack([through @ numbers for numbers, _, through, _ in strips])
        gram -= known.T @ known
        along = np.concatenate([numbers.T @ on for numbers, _, _, on in strips])
        blocks = []
        for k in range(len(shapes)):
            own = [column for places in picked[1:] for column in places[k]]
            block = gram.take(own, axis=0).take(own, axis=1)
            blocks.append(Block(block, along[own], float(size[own].max(initial=0.0))))
        return blocks

    def _place(
        self, where: str, component: str, kind: str
    ) -> tuple[NDArray, NDArray, NDArray]:
        """Of a component: a (R, 6), Y a (p, R), and what is left times a (R,)."""
        key = where, component, kind
        if key not in self._places:
            if len(self._places) >= _PLACES:
                self._places.clear()
            answer = self._sensitivities.sensitivity(*key) * self._over_sigma
            through = [np.einsum("prc,rc->pr", Y, answer) for Y in self._known]
            on = np.einsum("rc,rc->r", self._left, answer)
            self._places[key] = answer, np.vstack(through), on
        return self._places[key]

    def _numbers(
        self, variable: str, shapes: tuple[CandidateShape, ...]
    ) -> tuple[NDArray, list[list[int]]]:
        """(R, q) columns of all forms of a variable, and which of them each form has."""
        key = variable, shapes
        if key not in self._forms:
            if len(self._forms) >= _FORMS:
                self._forms.clear()
            self._forms[key] = _columns(self._sensitivities, variable, shapes)
        return self._forms[key]


def _columns(
    sensitivities: Sensitivities, variable: str, shapes: Sequence[CandidateShape]
) -> tuple[NDArray, list[list[int]]]:
    """All forms' columns, each once: waves of one order are the same in every form."""
    place: dict[object, int] = {}
    columns, taken = [], {}
    for shape in sorted(shapes, key=lambda shape: -len(shape.names)):
        own = sensitivities.basis(variable, shape)[0][sensitivities.rows].T
        keys: list[object] = list(shape.names)
        if shape.form != "waves":
            keys = [(shape, k) for k in range(len(own))]
        for name, column in zip(keys, own, strict=True):
            if name not in place:
                place[name] = len(columns)
                columns.append(column)
        taken[shape] = [place[name] for name in keys]
    return np.array(columns).T, [taken[shape] for shape in shapes]


def _gram(strips: Sequence[tuple[NDArray, NDArray, NDArray, NDArray]]) -> NDArray:
    """B'B of the columns of all strips."""
    ends = np.cumsum([0, *(numbers.shape[1] for numbers, *_ in strips)])
    gram = np.zeros((ends[-1], ends[-1]))
    for i, (P, a, _, _) in enumerate(strips):
        for j, (other, b, _, _) in enumerate(strips[: i + 1]):
            weight = np.einsum("rc,rc->r", a, b)
            if weight.any():
                own = slice(ends[i], ends[i + 1]), slice(ends[j], ends[j + 1])
                gram[own] = (P * weight[:, None]).T @ other
                gram[own[::-1]] = gram[own].T
    return gram


def _by_row(columns: NDArray, cells: NDArray) -> NDArray:
    """(p, R, 6) of columns (p, N), zero where nothing was measured."""
    if cells.all():
        return columns.reshape(len(columns), *cells.shape)
    spread = np.zeros((len(columns), *cells.shape))
    spread[:, cells] = columns
    return spread
