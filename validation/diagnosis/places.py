"""List the locations at which functions can act, and the changes of the readings.

A location is a screw component at a frame, at the base or of the reading, or a
component of the load. A location can also consist of several components at one frame.
Locations with equal changes of the readings are listed only once.
"""

from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.functions import along
from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.measurement.variables import LOADS
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.candidates import is_turn, own_component, places_of
from forcefit.validation.diagnosis.gaussian import SIZES
from forcefit.validation.diagnosis.nuisance import LARGEST_SHIFT, LARGEST_TURN
from forcefit.validation.diagnosis.sensitivities import Sensitivities
from forcefit.validation.diagnosis.signatures import fingerprints
from forcefit.validation.diagnosis.whitening import Whitening

Where = tuple[str, str, str]  # location, screw component, kind of candidate function
# Largest plausible unrecorded force, relative to the largest recorded force.
_HEAVY = 10.0
_FORCE = 1000.0  # [N] largest plausible unrecorded force if no load is recorded
# Inner products are cached for functional forms with at most this number of columns.
_REMEMBERED = 8


@dataclass(frozen=True, eq=False)
class Weighted:
    """Weighted changes of selected readings per unit displacement at all locations.

    Attributes:
        rows: (R,) rows that contain selected readings.
        answers: (S, R, 6) changes of the readings for S screw components, zero for
            readings that are not selected.
        squares: (S, R) sums of squares of ``answers`` over each row.
        pair_products: (pairs, R) sums of products of ``answers`` for two components at
            one location.
        cells: row and component of the selected readings.
        known: cache of the inner products for each functional form.
    """

    rows: NDArray
    answers: NDArray
    squares: NDArray
    pair_products: NDArray
    cells: tuple[NDArray, NDArray]
    known: dict[object, tuple[NDArray, NDArray]] = field(default_factory=dict)

    def products(self, key: object, columns: NDArray) -> tuple[NDArray, NDArray]:
        """Return inner products for the basis functions (R, m) of a functional form.

        Returns:
            (S, m, m) inner products for each component, and (pairs, m, m) inner
            products for each pair of components at one location.
        """
        if key in self.known:
            return self.known[key]
        m = columns.shape[1]
        outer = (columns[:, :, None] * columns[:, None, :]).reshape(-1, m * m)
        whole = (self.squares @ outer).reshape(-1, m, m)
        cross = (self.pair_products @ outer).reshape(-1, m, m)
        if m <= _REMEMBERED:
            self.known[key] = whole, cross
        return whole, cross


class Places:
    """Locations at which functions would change the readings of a campaign.

    Attributes:
        names: screw components of each location.
        members: indices of the screw components in the list of S single components.
        equal: other components that change the readings equally.
        most: largest plausible displacement, compliance or force at each location.
        sizes: mapping from the number of components to the locations with this number,
            their members, and a mask of the rotations.
    """

    def __init__(self, campaign: Campaign, sensitivities: Sensitivities) -> None:
        """List the locations at which functions can act in a campaign."""
        self._campaign, self._sensitivities = campaign, sensitivities
        self._plausible = LARGEST_TURN, LARGEST_SHIFT * size_of(campaign.robot)
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
        """Return all single components and all combinations of components."""
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
        """List the single screw components that change the readings differently."""
        over_sigma = np.where(self._campaign.cells, 1 / self._campaign.sigma, 0.0)
        shown, answers = [], []
        for where in singles:
            a = self._sensitivities.sensitivity(*where) * over_sigma
            size = float(np.linalg.norm(a))
            if np.isfinite(size) and size * self.plausible(where) >= SIZES[0]:
                shown.append(where)
                answers.append(a)
        every = np.array(answers).reshape(len(shown), *over_sigma.shape)
        alike: dict[tuple[float, ...], list[int]] = {}
        for k, key in enumerate(
            fingerprints(every.reshape(len(shown), over_sigma.size).T)
        ):
            alike.setdefault(key, []).append(k)
        self._answers = every[[own[0] for own in alike.values()]]
        same: list[list[tuple[Where, ...]]]
        same = [[(shown[k],) for k in own] for own in alike.values()]
        self.names = [own[0] for own in same]
        self.equal = [own[1:] for own in same]
        self.members: list[tuple[int, ...]] = [(k,) for k in range(len(same))]
        self.number = {own[0]: k for k, each in enumerate(same) for own in each}

    def _list_combinations(self, combined: list[tuple[Where, ...]]) -> None:
        """List the combinations of several components at one frame."""
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
        """Return a sort key that puts drives first, then other frames."""
        name, component, kind = where
        frames = {f.name: f for f in self._campaign.robot.frames}
        frame = frames.get(name)
        own = bool(frame and frame.actuated and own_component(frame) == component)
        return kind != "screw", not own, frame is None

    def plausible(self, where: Where) -> float:
        """Return the largest plausible displacement, compliance or force."""
        name, component, kind = where
        conditions = self._sensitivities.conditions
        if name == "load":
            forces = np.abs(conditions.load[:, 3:])
            return _HEAVY * float(forces.max()) or _FORCE
        most = self._plausible[not is_turn(component)]
        if kind == "screw":
            return most
        row = conditions.robot.index(name)
        wrenches = self._sensitivities.wrenches[:, row]
        w = along(conditions.robot, name, component, wrenches)
        size = float(np.sqrt(np.mean(w**2)))
        return most / size if size > 0 else 0.0

    def weighted(self, cells: NDArray, whiten: Whitening) -> Weighted:
        """Return the weighted changes of selected readings for all locations."""
        row, component = (axis[cells] for axis in np.nonzero(self._campaign.cells))
        rows, row = np.unique(row, return_inverse=True)
        answers = np.zeros((len(self._answers), len(rows), 6))
        each = self._answers[:, rows[row], component]
        answers[:, row, component] = whiten(each.T).T
        squares = np.einsum("src,src->sr", answers, answers)
        pair_products = np.zeros((len(self._pairs), len(rows)))
        for (i, j), k in self._pairs.items():
            pair_products[k] = np.einsum("rc,rc->r", answers[i], answers[j])
        return Weighted(rows, answers, squares, pair_products, (row, component))

    def joined(self, members: NDArray, whole: NDArray, cross: NDArray) -> NDArray:
        """Return inner products for combinations of s components, (f, c, s m, s m)."""
        c, s = members.shape
        f, _, m, _ = whole.shape
        B = np.zeros((f, c, s, m, s, m))
        for i in range(s):
            B[:, :, i, :, i] = whole[:, members[:, i]]
            for j in range(i + 1, s):
                pair = [self._pairs[a, b] for a, b in members[:, [i, j]].tolist()]
                B[:, :, i, :, j] = cross[:, pair]
                B[:, :, j, :, i] = cross[:, pair].transpose(0, 1, 3, 2)
        return B.reshape(f, c, s * m, s * m)
