"""Places at which a function may act, with what each does to the readings.

A place is a component of a screw at a frame, at the base, in the reading or of the
load, or several components at one place.  Those that do the same count once.
"""

from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from assembly.effects.functions import AXES
from assembly.kinematics.nominal import size_of
from assembly.measurement.variables import LOADS
from validation.campaign.campaign import Campaign
from validation.diagnosis.candidates import (
    Sensitivities,
    is_turn,
    places_of,
)
from validation.diagnosis.gaussian import SIZES
from validation.diagnosis.small_terms import LARGEST_SHIFT, LARGEST_TURN

Where = tuple[str, str, str]  # place, component, kind
_PROBES = 3  # random directions by which equal places are known
_DIGITS = 6
_HEAVY = 10.0  # times the largest load: an unknown one is smaller
_FORCE = 1000.0  # [N] likewise, where none is recorded
_REMEMBERED = 8  # columns of forms whose products are kept


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


class Places:
    """Places of a campaign's robot that the readings see.

    Attributes:
        names: components of each.
        members: S single components, by number, of each.
        equal: of each single component, others that do the same.
        most: largest plausible unknown of each.
        sizes: of each number of components: which places, members, and which turn.
    """

    def __init__(self, campaign: Campaign, sensitivities: Sensitivities) -> None:
        """List them.

        Args:
            campaign: of which commands, loads and sigma are read.
            sensitivities: of its rows.
        """
        self._campaign, self._sensitivities = campaign, sensitivities
        self._plausible = LARGEST_TURN, LARGEST_SHIFT * size_of(campaign.robot)
        self.names: list[tuple[Where, ...]] = []
        self.equal: list[list[tuple[Where, ...]]] = []
        self.members: list[tuple[int, ...]] = []
        singles, combined = self._listed()
        self._list_singles(singles)
        self._list_combinations(combined)
        self.most = np.array([min(self.plausible(w) for w in p) for p in self.names])
        self.sizes: list[tuple[NDArray, NDArray, NDArray]] = []
        for size in sorted({len(m) for m in self.members}):
            which = [i for i, m in enumerate(self.members) if len(m) == size]
            members = np.array([self.members[i] for i in which])
            turns = [
                [is_turn(self.names[i][0][1]) for i in m] for m in members.tolist()
            ]
            self.sizes.append((np.array(which), members, np.array(turns)))
        pairs = {pair for m in self.members for pair in combinations(m, 2)}
        self._pairs = {pair: k for k, pair in enumerate(sorted(pairs))}

    def __len__(self) -> int:
        return len(self.names)

    def _listed(self) -> tuple[list[Where], list[tuple[Where, ...]]]:
        """Components at places, and several at one."""
        singles: list[Where] = [("load", force, "screw") for force in LOADS[3:]]
        combined = [tuple(singles)]
        for kind, (part, *others) in places_of(self._campaign.robot, [""]):
            own = [(part.where, c, kind) for c in part.components]
            if len(own) == 1 and not others:
                singles += own
            elif not others:
                combined.append(tuple(own))
        return sorted(singles, key=self._preference), combined

    def _list_singles(self, singles: list[Where]) -> None:
        """Components that show, each once."""
        over_sigma = np.where(self._campaign.cells, 1 / self._campaign.sigma, 0.0)
        rng = np.random.default_rng(0)
        probes = rng.normal(size=(_PROBES, *over_sigma.shape))
        answers: list[NDArray] = []
        known: dict[tuple[float, ...], int] = {}
        self.number: dict[Where, int] = {}
        for where in singles:
            a = self._sensitivities.sensitivity(*where) * over_sigma
            size = float(np.linalg.norm(a))
            if not np.isfinite(size) or size * self.plausible(where) < SIZES[0]:
                continue
            seen = np.einsum("prc,rc->p", probes, a) / size
            key = tuple(np.round(seen * np.sign(seen[0]), _DIGITS).tolist())
            self.number[where] = known.setdefault(key, len(self.names))
            if known[key] < len(self.names):
                self.equal[known[key]].append((where,))
                continue
            self.names.append((where,))
            self.members.append((len(answers),))
            self.equal.append([])
            answers.append(a)
        self._answers = np.array(answers).reshape(len(answers), *over_sigma.shape)

    def _list_combinations(self, combined: list[tuple[Where, ...]]) -> None:
        """Several components at one place, those that the readings see."""
        known = {frozenset(members) for members in self.members}
        for own in combined:
            shown = [w for w in own if w in self.number]
            members = tuple(dict.fromkeys(self.number[w] for w in shown))
            if len(members) > 1 and frozenset(members) not in known:
                known.add(frozenset(members))
                self.names.append(tuple(shown))
                self.members.append(members)
                self.equal.append([])

    def _preference(self, where: Where) -> tuple[bool, bool, bool]:
        """Drives' own motions first, then other frames, then base and reading."""
        name, component, kind = where
        frames = {f.name: f for f in self._campaign.robot.frames}
        frame = frames.get(name)
        own = bool(frame and frame.actuated and AXES[frame.own_axis] == component)
        return kind != "screw", not own, frame is None

    def plausible(self, where: Where) -> float:
        """Plausible size of an unknown: displacement, or per wrench there."""
        name, component, kind = where
        conditions = self._sensitivities.conditions
        if name == "load":
            forces = np.abs(conditions.load[:, 3:])
            return _HEAVY * float(forces.max()) or _FORCE
        axis = AXES.index(component)
        most = self._plausible[axis // 3]
        if kind == "screw":
            return most
        row = conditions.robot.index(name)
        w = self._sensitivities.wrenches[:, row, axis]
        size = float(np.sqrt(np.mean(w**2)))
        return most / size if size > 0 else 0.0

    def weighted(self, cells: NDArray, root: NDArray) -> Weighted:
        """Places in some cells.

        Args:
            cells: (N,) mask over the measured cells.
            root: (n,) of the weights of these.

        Returns:
            What each does to the readings there.
        """
        row, component = (axis[cells] for axis in np.nonzero(self._campaign.cells))
        rows, row = np.unique(row, return_inverse=True)
        weight = np.zeros((len(rows), 6))
        weight[row, component] = root
        answers = self._answers[:, rows] * weight
        squares = np.einsum("src,src->sr", answers, answers)
        beside = np.zeros((len(self._pairs), len(rows)))
        for (i, j), k in self._pairs.items():
            beside[k] = np.einsum("rc,rc->r", answers[i], answers[j])
        return Weighted(rows, answers, squares, beside, (row, component))

    def joined(self, members: NDArray, whole: NDArray, cross: NDArray) -> NDArray:
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
