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
Y       ``known``        (N, p)     of what is taken out, by P = 1 - Y Y'
======  ===============  =========  ==================================================

    Y'B = (sum over c of Y_(rc) a_rc)' P,    B'B = P' diag(sum over c of a_rc^2) P.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.campaign.campaign import Campaign
from validation.diagnosis.candidates import Candidate, CandidatePart, Sensitivities
from validation.diagnosis.forms_tried import CandidateShape

_Key = tuple[str, tuple[CandidateShape, ...]]  # a variable and its forms
_Where = tuple[str, str, str]  # place, component, kind


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


class _Forms:
    """All forms of a variable that are looked at together.

    Attributes:
        columns: (R, q) of all, those that several have once.
        taken: of each form, which columns it has.
    """

    def __init__(
        self, sensitivities: Sensitivities, variable: str,
        shapes: Sequence[CandidateShape],
    ) -> None:  # fmt: skip
        place: dict[object, int] = {}
        columns: list[NDArray] = []
        taken: dict[CandidateShape, list[int]] = {}
        for shape in sorted(shapes, key=lambda shape: -len(shape.names)):
            own = sensitivities.basis((variable,), shape)[0][sensitivities.rows].T
            # a wave of one order is the same in every form that has it
            keys: Sequence[object] = shape.names
            if shape.form != "waves":
                keys = [(shape, k) for k in range(len(own))]
            for name, column in zip(keys, own, strict=True):
                if name not in place:
                    place[name] = len(columns)
                    columns.append(column)
            taken[shape] = [place[name] for name in keys]
        self.columns = np.array(columns).T
        self.taken = [taken[shape] for shape in shapes]


@dataclass(frozen=True, eq=False)
class _PlaceProducts:
    """What a component at a place does, and its products for some forms.

    Attributes:
        answer: (R, 6).
        known: (p, q) with what is known, by forms.
        along: (q,) with what is left, by forms.
    """

    answer: NDArray
    known: Mapping[_Key, NDArray]
    along: Mapping[_Key, NDArray]


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
            known: columns (N, p), Y side by side.
            left: (N,) to which candidates are held.
        """
        cells = campaign.cells
        self._sensitivities = sensitivities
        self._over_sigma = np.where(cells, 1 / campaign.sigma, 0.0)
        self._known = [_by_row(columns.T, cells) for columns in known]
        self._left = _by_row(left[None], cells)[0]

    def of(self, candidates: Sequence[Candidate]) -> Iterator[tuple[int, Block]]:
        """Blocks of candidates, place by place: what a place does is made once.

        Args:
            candidates: any number; forms at one place are taken together.

        Yields:
            Which candidate, and its block.
        """
        alike: dict[tuple[str, tuple[CandidatePart, ...]], list[int]] = {}
        for i, one in enumerate(candidates):
            alike.setdefault((one.kind, one.parts), []).append(i)
        forms: dict[_Key, _Forms] = {}
        asked: dict[_Where, dict[_Key, None]] = {}
        for (kind, parts), own in alike.items():
            shapes = tuple(candidates[i].shape for i in own)
            for part in parts:
                key = part.variable, shapes
                if key not in forms:
                    forms[key] = _Forms(self._sensitivities, *key)
                for component in part.components:
                    asked.setdefault((part.where, component, kind), {})[key] = None
        places: dict[_Where, _PlaceProducts] = {}
        last = None
        for kind, parts in sorted(alike, key=lambda at: (at[0], at[1][0].where)):
            own = alike[kind, parts]
            shapes = tuple(candidates[i].shape for i in own)
            if (kind, parts[0].where) != last:
                places.clear()
                last = kind, parts[0].where
            strips = []
            for part in parts:
                key = part.variable, shapes
                for component in part.components:
                    where = part.where, component, kind
                    if where not in places:
                        known = {key: forms[key] for key in asked[where]}
                        places[where] = self._place(where, known)
                    strips.append((forms[key], places[where], key))
            yield from zip(own, _blocks(strips, len(own)), strict=True)

    def _place(self, where: _Where, forms: Mapping[_Key, _Forms]) -> _PlaceProducts:
        """Products of all forms looked at there."""
        answer = self._sensitivities.sensitivity(*where) * self._over_sigma
        on = np.einsum("rc,rc->r", self._left, answer)
        through = np.vstack([np.einsum("prc,rc->pr", Y, answer) for Y in self._known])
        every = np.hstack([form.columns for form in forms.values()])
        known, along = through @ every, every.T @ on
        ends = np.cumsum([form.columns.shape[1] for form in forms.values()])[:-1]
        return _PlaceProducts(
            answer,
            dict(zip(forms, np.split(known, ends, axis=1), strict=True)),
            dict(zip(forms, np.split(along, ends), strict=True)),
        )


def _blocks(
    strips: Sequence[tuple[_Forms, _PlaceProducts, _Key]], count: int
) -> Iterator[Block]:
    """Blocks of so many forms, unknowns part by part, component by component."""
    ends = np.cumsum([0, *(form.columns.shape[1] for form, _, _ in strips)])
    gram = np.zeros((ends[-1], ends[-1]))
    for i, (form, place, _) in enumerate(strips):
        for j, (other, beside, _) in enumerate(strips[: i + 1]):
            weight = np.einsum("rc,rc->r", place.answer, beside.answer)
            if weight.any():
                own = slice(ends[i], ends[i + 1]), slice(ends[j], ends[j + 1])
                gram[own] = (form.columns * weight[:, None]).T @ other.columns
                gram[own[::-1]] = gram[own].T
    size = np.sqrt(np.diag(gram))
    known = np.hstack([place.known[key] for _, place, key in strips])
    gram -= known.T @ known
    along = np.concatenate([place.along[key] for _, place, key in strips])
    for k in range(count):
        picked = zip(ends[:-1], strips, strict=True)
        some = [int(at) + c for at, (form, _, _) in picked for c in form.taken[k]]
        block = gram.take(some, axis=0).take(some, axis=1)
        yield Block(block, along[some], float(size[some].max(initial=0.0)))


def _by_row(columns: NDArray, cells: NDArray) -> NDArray:
    """(p, R, 6) of columns (p, N), zero where nothing was measured."""
    if cells.all():
        return columns.reshape(len(columns), *cells.shape)
    spread = np.zeros((len(columns), *cells.shape))
    spread[:, cells] = columns
    return spread
