"""All functions that may act, scored together: places times forms of variables.

A column of a function is what a component does to the readings of a row times a number
of that row, B_(rc)q = a_rc P_rq.  So its products take one pass over the readings for
each component at a place, and one over the rows for each number:

======  ===============  ===========  ================================================
symbol  code             shape        meaning
======  ===============  ===========  ================================================
a       ``answers``      (S, R, 6)    whitened change per unit of a component at a place
W       ``squares``      (S, R)       sum of a^2 over the cells of a row
P       ``numbers``      (R, q)       columns of all forms of a variable
T       ``through``      (R, S, p)    sum over the cells of a row of a U
======  ===============  ===========  ================================================

    B'B = P' W P,    U'B = T' P,    B'C^-1 z = P' (sum of a C^-1 z).
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from assembly.effects.functions import AXES
from assembly.kinematics.nominal import size_of
from validation.campaign.campaign import Campaign
from validation.diagnosis import shapes as forms
from validation.diagnosis.candidates import (
    Candidate,
    CandidatePart,
    Sensitivities,
    in_cells,
    places_of,
    variables_of,
)
from validation.diagnosis.elements import Element, function_element
from validation.diagnosis.forms_tried import CandidateShape, is_angle
from validation.diagnosis.gaussian import SIZES, Taken, averaged_gains
from validation.diagnosis.small_terms import LARGEST_SHIFT, LARGEST_TURN

Where = tuple[str, str, str]  # place, component, kind
Variables = tuple[str, ...]
Asked = tuple[Variables, tuple[CandidateShape, ...]]  # variables, and their forms
_PROBES = 3  # random directions by which equal places are known
_DIGITS = 6
_REMEMBERED = 8  # columns of forms whose products are kept
_WIDEST = 36  # columns of a function of several components
_LISTED = 2000  # functions that are ordered


@dataclass(frozen=True)
class Found:
    """A function that was scored.

    Attributes:
        worth: log evidence ratio and log prior together.
        where: number of its place.
        variables: one or two.
        shape: the form.
        log_prior: of it.
    """

    worth: float
    where: int
    variables: Variables
    shape: CandidateShape
    log_prior: float


@dataclass(frozen=True, eq=False)
class Weighted:
    """Places in some of the cells, weighted.

    Attributes:
        rows: those that have such a cell.
        answers: (S, R, 6) zero in other cells.
        squares: (S, R).
        beside: (pairs, R) products of components of one combination.
        cells: their rows and components.
        known: products of columns of a form at all places, and of pairs of these.
    """

    rows: NDArray
    answers: NDArray
    squares: NDArray
    beside: NDArray
    cells: tuple[NDArray, NDArray]
    known: dict[object, tuple[NDArray, NDArray]] = field(default_factory=dict)

    def products(self, key: object, columns: NDArray) -> tuple[NDArray, NDArray]:
        """(S, m, m) B'B at all places and (pairs, m, m), of columns P (R, m)."""
        if key in self.known:
            return self.known[key]
        m = columns.shape[1]
        outer = (columns[:, :, None] * columns[:, None, :]).reshape(-1, m * m)
        whole = (self.squares @ outer).reshape(-1, m, m)
        cross = (self.beside @ outer).reshape(-1, m, m)
        if m <= _REMEMBERED:
            self.known[key] = whole, cross
        return whole, cross


@dataclass(frozen=True, eq=False)
class _Scored:
    """Products of one form at c places, columns scaled to norm about one."""

    number: int
    shape: int
    where: NDArray
    gram: NDArray
    along: NDArray
    most: NDArray
    prior: float


def _likeliest(
    parts: Mapping[int, Sequence[_Scored]], taken: Taken, freedom: float
) -> list[tuple[float, int, int, int]]:
    """Worth, and which variables, form and place, of all that show; best first."""
    worths, whose = [np.zeros(0)], [np.zeros((0, 3), dtype=int)]
    for own in parts.values():
        gains = averaged_gains(
            np.concatenate([p.gram for p in own]), np.concatenate([p.along for p in own]),
            np.concatenate([p.most for p in own]), False, taken, freedom,
        )  # fmt: skip
        sizes = [len(p.where) for p in own]
        worths.append(gains + np.repeat([p.prior for p in own], sizes))
        numbers = np.repeat([(p.number, p.shape) for p in own], sizes, axis=0)
        whose.append(np.column_stack([numbers, np.concatenate([p.where for p in own])]))
    worth, names = np.concatenate(worths), np.concatenate(whose)
    order = [i for i in np.argsort(-worth).tolist()[:_LISTED] if np.isfinite(worth[i])]
    return [(float(worth[i]), *map(int, names[i])) for i in order]


def _by_kind(turns: NDArray, gram: NDArray) -> NDArray:
    """(c, m) root of the mean squared norm of columns, of turns and of shifts."""
    diagonal = np.einsum("skk->sk", gram)
    squares = np.zeros_like(diagonal)
    for kind in (turns, ~turns):
        mean = (diagonal * kind).sum(axis=1) / np.maximum(kind.sum(axis=1), 1)
        squares += kind * mean[:, None]
    return np.sqrt(squares)


class Functions:
    """Places, variables and forms of a campaign's functions."""

    def __init__(
        self, campaign: Campaign, sensitivities: Sensitivities, some: bool = True
    ) -> None:
        """List them; what does the same to the readings counts once.

        Args:
            campaign: of which commands, loads, covariates and sigma are read.
            sensitivities: of its rows.
            some: whether any function may act.
        """
        self.campaign, self.sensitivities = campaign, sensitivities
        self.conditions = sensitivities.conditions
        self._over_sigma = np.where(campaign.cells, 1 / campaign.sigma, 0.0)
        self.variables = variables_of(self.conditions) if some else []
        self.plausible = LARGEST_TURN, LARGEST_SHIFT * size_of(campaign.robot)
        self._list_places()
        self.shapes_of = lru_cache(maxsize=None)(self._shapes_of)
        self.prior = lru_cache(maxsize=None)(self._prior)

    def _list_places(self) -> None:
        """Components at places, and combinations of some at one place."""
        singles: list[Where] = []
        combined: list[tuple[str, CandidatePart]] = []
        self.together: list[tuple[str, tuple[CandidatePart, ...]]] = []
        asked = self.variables[:1]
        for kind, parts in places_of(self.campaign.robot, asked):
            part = parts[0]
            if len(parts) > 1:
                self.together.append((kind, parts))
            elif len(part.components) > 1:
                combined.append((kind, part))
            else:
                singles.append((part.where, part.components[0], kind))
        singles.sort(key=self._preference)
        self.places: list[tuple[Where, ...]] = []
        self.equal: list[list[tuple[Where, ...]]] = []
        answers, known = [], {}
        rng = np.random.default_rng(0)
        probes = rng.normal(size=(_PROBES, *self._over_sigma.shape))
        probes *= rng.normal(size=(_PROBES, 1, 1))
        for where in singles:
            a = self.sensitivities.sensitivity(*where) * self._over_sigma
            size = float(np.linalg.norm(a))
            if not np.isfinite(size) or size * self._most(where) < SIZES[0]:
                continue
            seen = np.einsum("prc,rc->p", probes, a) / size
            key = tuple(np.round(seen * np.sign(seen[0]), _DIGITS))
            if key in known:
                self.equal[known[key]].append((where,))
                continue
            known[key] = len(self.places)
            self.places.append((where,))
            self.equal.append([])
            answers.append(a)
        rows = self._over_sigma.shape
        self._answers = np.array(answers).reshape(len(answers), *rows)
        number = {p[0]: i for i, p in enumerate(self.places)}
        self.members: list[tuple[int, ...]] = [(i,) for i in range(len(self.places))]
        for kind, part in combined:
            own = [(part.where, c, kind) for c in part.components]
            seen_ones = tuple(number[w] for w in own if w in number)
            if len(seen_ones) > 1:
                self.places.append(tuple(w for w in own if w in number))
                self.equal.append([])
                self.members.append(seen_ones)
        self.most = np.array([min(self._most(w) for w in p) for p in self.places])
        self._groups: list[tuple[NDArray, NDArray, NDArray]] = []
        for size in sorted({len(m) for m in self.members}):
            where = np.array([i for i, m in enumerate(self.members) if len(m) == size])
            mem = np.array([self.members[i] for i in where])
            turns = [[AXES.index(self.places[i][0][1]) < 3 for i in m] for m in mem]
            self._groups.append((where, mem, np.array(turns)))
        pairs = {pair for m in self.members for pair in combinations(m, 2)}
        self._pairs = {pair: k for k, pair in enumerate(sorted(pairs))}

    def _preference(self, where: Where) -> tuple[bool, bool, bool]:
        """Drives' own motions first, then other frames, then base and reading."""
        name, component, kind = where
        frames = {f.name: f for f in self.campaign.robot.frames}
        frame = frames.get(name)
        own = bool(frame and frame.actuated and AXES[frame.own_axis] == component)
        return kind != "screw", not own, frame is None

    def _most(self, where: Where) -> float:
        """Plausible size of an unknown: displacement, or per wrench there."""
        name, component, kind = where
        axis = AXES.index(component)
        most = self.plausible[axis // 3]
        if kind == "screw":
            return most
        row = self.conditions.robot.index(name)
        w = self.sensitivities.wrenches[:, row, axis]
        size = float(np.sqrt(np.mean(w**2)))
        return most / size if size > 0 else 0.0

    def weighted(self, cells: NDArray, root: NDArray) -> Weighted:
        """Places in some cells.

        Args:
            cells: (N,) mask over the measured cells.
            root: (n,) of the weights of these.
        """
        row, component = (axis[cells] for axis in np.nonzero(self.campaign.cells))
        rows, row = np.unique(row, return_inverse=True)
        weight = np.zeros((len(rows), 6))
        weight[row, component] = root
        answers = self._answers[:, rows] * weight
        squares = np.einsum("src,src->sr", answers, answers)
        beside = np.zeros((len(self._pairs), len(rows)))
        for (i, j), k in self._pairs.items():
            beside[k] = np.einsum("rc,rc->r", answers[i], answers[j])
        return Weighted(rows, answers, squares, beside, (row, component))

    def _shapes_of(self, variables: Variables) -> dict[CandidateShape, float]:
        """All forms of one variable or two, with ln of the prior at one place."""
        if len(variables) == 1:
            shapes = forms.every(self.conditions, variables[0], "compliance")
        else:
            both = forms.of_two(self.conditions, *variables)
            shapes = [] if both is None else both[1]
        count, places = len(self.variables), len(self.places) + len(self.together)
        prior = -math.log(2.0) - math.log(max(count, 1)) - math.log(max(places, 1))
        if len(variables) > 1:
            prior -= math.log(2.0 * max(count - 1, 1))
        logs = forms.log_priors(shapes)
        return {s: prior + float(p) for s, p in zip(shapes, logs, strict=True)}

    def _prior(self, variables: Variables, shape: CandidateShape) -> float:
        """ln of the prior of a form of variables, at one place."""
        known = self.shapes_of(variables)
        return known.get(shape, min(known.values(), default=-math.inf))

    def first_look(self) -> list[Asked]:
        """Variables, and forms that show whether they count."""
        return [
            ((name,), tuple(forms.first(self.conditions, name)))
            for name in self.variables
        ]

    def products(
        self, names: Iterable[str]
    ) -> list[Asked]:
        """Products of some variables with any others."""
        asked: dict[Variables, tuple[CandidateShape, ...]] = {}
        for name in names:
            for other in self.variables:
                both = None
                if other != name:
                    both = forms.of_two(self.conditions, name, other)
                if both is not None and both[0] not in asked:
                    asked[both[0]] = tuple(both[1])
            if is_angle(self.campaign.robot, name):
                asked[(name,)] = (forms.of_direction(name),)
        return list(asked.items())

    def look(
        self, taken: Taken, weighted: Weighted, freedom: float,
        asked: Sequence[Asked], most: int,
    ) -> list[Found]:  # fmt: skip
        """The best functions of some variables and forms beside what is known.

        Args:
            taken: what is known, and what is left, in the cells of ``weighted``.
            weighted: places.
            freedom: of the noise's scale.
            asked: variables with their forms.
            most: functions of each variable or pair.

        Returns:
            Functions, best first.
        """
        if not len(self.places) or not asked:
            return []
        row, component = weighted.cells
        count = taken.across.shape[1]
        U = np.zeros((len(weighted.rows), 6, count))
        U[row, component] = taken.across
        held = np.zeros((len(weighted.rows), 6))
        held[row, component] = taken.held
        through = weighted.answers.transpose(1, 0, 2) @ U
        on = np.einsum("src,rc->sr", weighted.answers, held)
        parts: dict[int, list[_Scored]] = {}
        for number, (variables, shapes) in enumerate(asked):
            for one in self._blocks(number, weighted, variables, shapes, through, on):
                parts.setdefault(one.along.shape[1], []).append(one)
        best: list[Found] = []
        each: dict[int, int] = {}
        for worth, number, k, where in _likeliest(parts, taken, freedom):
            each[number] = each.get(number, 0) + 1
            if each[number] <= most:
                variables, shapes = asked[number]
                prior = self.prior(variables, shapes[k])
                best.append(Found(worth, where, variables, shapes[k], prior))
        return best

    def _blocks(
        self, number: int, weighted: Weighted, variables: Variables,
        shapes: Sequence[CandidateShape], through: NDArray, on: NDArray,
    ) -> Iterator[_Scored]:  # fmt: skip
        """Products of all forms of variables at all places."""
        columns = [self._numbers(variables, s)[weighted.rows] for s in shapes]
        ends = np.cumsum([0, *(c.shape[1] for c in columns)])
        P = np.hstack(columns)
        S = len(weighted.answers)
        shown = (through.reshape(len(P), -1).T @ P).reshape(S, -1, P.shape[1])
        along = on @ P
        for k, own in enumerate(columns):
            part = slice(ends[k], ends[k + 1])
            m = own.shape[1]
            whole, cross = weighted.products((variables, shapes[k]), own)
            prior = self.prior(variables, shapes[k])
            for where, mem, turns in self._groups:
                c, size = mem.shape
                if size > 1 and size * m > _WIDEST:
                    continue
                B = whole[mem[:, 0]] if size == 1 else self._joined(mem, whole, cross)
                y = shown[mem, :, part].transpose(0, 2, 1, 3).reshape(c, -1, size * m)
                b = along[mem, part].reshape(c, size * m)
                norm = _by_kind(np.repeat(turns, m, axis=1), B)
                scale = np.where(norm > 0, 1 / np.maximum(norm, 1e-300), 0.0)
                left = B - y.transpose(0, 2, 1) @ y
                left *= scale[:, :, None] * scale[:, None, :]
                most = self.most[where] * norm.max(axis=1)
                yield _Scored(number, k, where, left, b * scale, most, prior)

    def _joined(self, members: NDArray, whole: NDArray, cross: NDArray) -> NDArray:
        """(c, s m, s m) products of combinations of s components."""
        c, s = members.shape
        m = whole.shape[1]
        B = np.zeros((c, s, m, s, m))
        for i in range(s):
            B[:, i, :, i] = whole[members[:, i]]
            for j in range(i + 1, s):
                pair = [self._pairs[a, b] for a, b in members[:, [i, j]].tolist()]
                B[:, i, :, j] = cross[pair]
                B[:, j, :, i] = cross[pair].transpose(0, 2, 1)
        return B.reshape(c, s * m, s * m)

    @lru_cache(maxsize=None)  # noqa: B019  one campaign at a time
    def _numbers(self, variables: Variables, shape: CandidateShape) -> NDArray:
        """(R, q) columns of a form, falling as their prior does."""
        columns = self.sensitivities.basis(variables, shape)[0]
        return columns * forms.falling(shape, columns.shape[1])

    def candidate(self, found: Found) -> Candidate:
        """The function that was scored."""
        return self._at(self.places[found.where], found.variables, found.shape)

    @staticmethod
    def _at(
        place: tuple[Where, ...], variables: Variables, shape: CandidateShape
    ) -> Candidate:
        part = CandidatePart(place[0][0], tuple(w[1] for w in place), *variables)
        return Candidate((part,), place[0][2], shape)

    def equivalents(self, one: Candidate) -> list[tuple[CandidatePart, ...]]:
        """Parts of candidates at other places that do the same to the readings."""
        if len(one.parts) > 1:
            return []
        part = one.parts[0]
        own = tuple((part.where, c, one.kind) for c in part.components)
        same = self.equal[self.places.index(own)] if own in self.places else []
        return [self._at(p, part.variables, one.shape).parts for p in same]

    def element(self, one: Candidate, log_prior: float) -> Element | None:
        """A candidate with its columns."""
        columns = in_cells(self.sensitivities, one, self.campaign)
        axes = self.sensitivities.axes(one)
        each = columns.shape[1] // sum(len(p.components) for p in one.parts)
        fall = np.tile(forms.falling(one.shape, each), columns.shape[1] // each)
        wheres = [(p.where, c, one.kind) for p in one.parts for c in p.components]
        most = min(self._most(w) for w in wheres)
        return function_element(one, columns, axes, fall, most, log_prior)

    def explicit(self) -> list[Element]:
        """Functions at several places at once, and cubic laws of a joint's wrench."""
        listed: list[tuple[Candidate, float]] = []
        count = max(len(self.variables), 1)
        base = -math.log(2.0 * count)
        for kind, parts in self._parts_together():
            name = parts[0].variable
            tried = forms.first(self.conditions, name)
            if kind == "compliance":
                tried += forms.uneven(self.conditions, name)
            listed += [(Candidate(parts, kind, s), self.prior((name,), s)) for s in tried]
        cubic = CandidateShape("powers", ("2",))
        joints = [
            w for p in self.places for w in p[:1] if len(p) == 1 and w[2] == "compliance"
        ]
        for name, component, kind in joints:
            wrench = f"wrench.{name}.{'mf'[component[0] == 't']}{component[1]}"
            one = CandidatePart(name, (component,), wrench)
            prior = base - math.log(len(joints)) - math.log(2.0)
            listed.append((Candidate((one,), kind, cubic), prior))
        made = [self.element(one, prior) for one, prior in listed]
        return [e for e in made if e is not None and e.most > SIZES[0]]

    def _parts_together(self) -> list[tuple[str, tuple[CandidatePart, ...]]]:
        """Beams together and drives together, of every variable."""
        every = places_of(self.campaign.robot, self.variables)
        return [(kind, parts) for kind, parts in every if len(parts) > 1]
