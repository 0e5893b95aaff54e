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
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
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
_PROBES = 3  # random directions by which equal places are known
_DIGITS = 6


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
    """

    rows: NDArray
    answers: NDArray
    squares: NDArray
    beside: NDArray
    cells: tuple[NDArray, NDArray]


class Functions:
    """Places, variables and forms of a campaign's functions."""

    def __init__(self, campaign: Campaign, sensitivities: Sensitivities) -> None:
        """List them; what does the same to the readings counts once.

        Args:
            campaign: of which commands, loads, covariates and sigma are read.
            sensitivities: of its rows.
        """
        self.campaign, self.sensitivities = campaign, sensitivities
        self.conditions = sensitivities.conditions
        self._over_sigma = np.where(campaign.cells, 1 / campaign.sigma, 0.0)
        self.variables = variables_of(self.conditions)
        self.plausible = LARGEST_TURN, LARGEST_SHIFT * size_of(campaign.robot)
        self._list_places()
        self.priors = lru_cache(maxsize=None)(self._priors)

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

    def _priors(
        self, variables: Variables, listed: tuple[CandidateShape, ...]
    ) -> dict[CandidateShape, float]:
        """Ln of the prior of each form of variables at one place."""
        count, places = len(self.variables), len(self.places) + len(self.together)
        prior = -math.log(2.0) - math.log(max(count, 1)) - math.log(max(places, 1))
        if len(variables) > 1:
            prior -= math.log(2.0 * max(count - 1, 1))
        logs = forms.log_priors(listed)
        return {s: prior + float(p) for s, p in zip(listed, logs, strict=True)}

    def shapes_of(self, variables: Variables) -> tuple[CandidateShape, ...]:
        """All forms of one variable or two."""
        if len(variables) == 1:
            return tuple(forms.every(self.conditions, variables[0], "compliance"))
        both = forms.of_two(self.conditions, *variables)
        return () if both is None else tuple(both[1])

    def first_look(self) -> list[tuple[Variables, tuple[CandidateShape, ...]]]:
        """Variables, and forms that show whether they count."""
        return [
            ((name,), tuple(forms.first(self.conditions, name)))
            for name in self.variables
        ]

    def products(
        self, names: Iterable[str]
    ) -> list[tuple[Variables, tuple[CandidateShape, ...]]]:
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
        asked: Sequence[tuple[Variables, tuple[CandidateShape, ...]]], most: int,
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
        if not len(self.places):
            return []
        row, component = weighted.cells
        count = taken.across.shape[1]
        U = np.zeros((len(weighted.rows), 6, count))
        U[row, component] = taken.across
        held = np.zeros((len(weighted.rows), 6))
        held[row, component] = taken.held
        through = weighted.answers.transpose(1, 0, 2) @ U
        on = np.einsum("src,rc->sr", weighted.answers, held)
        found: list[Found] = []
        for variables, shapes in asked:
            worth = self._worths(
                taken, weighted, freedom, variables, shapes, through, on
            )
            priors = self._prior_of(variables)
            worth += np.array([priors(s) for s in shapes])[:, None]
            for flat in np.argsort(-worth, axis=None)[:most].tolist():
                k, where = divmod(flat, worth.shape[1])
                if np.isfinite(worth[k, where]):
                    prior = priors(shapes[k])
                    found.append(
                        Found(
                            float(worth[k, where]), where, variables, shapes[k], prior
                        )
                    )
        return sorted(found, key=lambda one: -one.worth)

    def _prior_of(self, variables: Variables):
        """Ln prior of a form of variables."""
        known = self.priors(variables, self.shapes_of(variables))
        other = min(known.values(), default=0.0)
        return lambda shape: known.get(shape, other)

    def _worths(
        self, taken: Taken, weighted: Weighted, freedom: float, variables: Variables,
        shapes: Sequence[CandidateShape], through: NDArray, on: NDArray,
    ) -> NDArray:  # fmt: skip
        """(forms, places) log evidence ratios."""
        columns = [self._numbers(variables, s)[weighted.rows] for s in shapes]
        ends = np.cumsum([0, *(c.shape[1] for c in columns)])
        P = np.hstack(columns)
        S = len(weighted.answers)
        flat = through.reshape(len(P), -1)
        shown = (flat.T @ P).reshape(S, -1, P.shape[1])
        along = on @ P
        worths = np.full((len(shapes), len(self.places)), -np.inf)
        for k, own in enumerate(columns):
            part = slice(ends[k], ends[k + 1])
            m = own.shape[1]
            outer = (own[:, :, None] * own[:, None, :]).reshape(len(own), m * m)
            whole = (weighted.squares @ outer).reshape(S, m, m)
            cross = (weighted.beside @ outer).reshape(-1, m, m)
            for size in sorted({len(mem) for mem in self.members}):
                where = [i for i, mem in enumerate(self.members) if len(mem) == size]
                mem = np.array([self.members[i] for i in where])
                B = whole[mem[:, 0]] if size == 1 else self._joined(mem, whole, cross)
                y = shown[mem, :, part].transpose(0, 2, 1, 3)
                y = y.reshape(len(mem), -1, size * m)
                b = along[mem, part].reshape(len(mem), size * m)
                diagonal = np.einsum("skk->sk", B)
                norm = np.sqrt(self._by_kind(mem, diagonal, m))
                most = self.most[where] * norm.max(axis=1)
                left = B - y.transpose(0, 2, 1) @ y
                scale = np.where(norm > 0, 1 / np.maximum(norm, 1e-300), 0.0)
                left = left * scale[:, :, None] * scale[:, None, :]
                worths[k, where] = averaged_gains(
                    left, b * scale, most, False, taken, freedom
                )
        return worths

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

    def _by_kind(self, members: NDArray, diagonal: NDArray, m: int) -> NDArray:
        """(c, s m) mean squared norm of columns, of turns and of shifts."""
        turns = np.array([
            [AXES.index(self.places[i][0][1]) < 3 for i in own] for own in members
        ])
        turns = np.repeat(turns, m, axis=1)
        squares = np.zeros_like(diagonal)
        for kind in (turns, ~turns):
            mean = (diagonal * kind).sum(axis=1) / np.maximum(kind.sum(axis=1), 1)
            squares += kind * mean[:, None]
        return squares

    @cache  # noqa: B019  one campaign at a time
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
            shapes = self.shapes_of((name,))
            tried = forms.first(self.conditions, name)
            logs = dict(zip(shapes, forms.log_priors(shapes), strict=True))
            share = base - math.log(len(self.places) + len(self.together) + 1)
            listed += [
                (Candidate(parts, kind, s), share + float(logs[s])) for s in tried
            ]
        cubic = CandidateShape("powers", ("2",))
        joints = [
            w
            for p in self.places
            for w in p[:1]
            if len(p) == 1 and w[2] == "compliance"
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
