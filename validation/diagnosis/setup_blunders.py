"""Detect blunders in the set-up of a campaign, such as wrong signs or units.

Blunders are searched for before any effects. Blunders change readings much more than
effects do, so the declared model is sufficient to identify them. Several blunders may
occur together.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import place_many, place_many_joints
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.measurement.settled_clearance import without_joint_clearances
from forcefit.stiffness.screws import rotation_matrix, rotation_vector
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.registration import device_rotation, off_one_line
from forcefit.validation.diagnosis.setup_corrections import (
    Correction,
    SetUp,
    as_given,
    corrections,
)

_ROWS = 40  # largest number of rows used to compare corrections
# Fraction of the readings that is used. The readings with the largest residuals are
# omitted.
_TRIMMED = 0.9
_MOST = 3  # largest number of simultaneous blunders
_BEAM = 4  # width of the beam search
# If a set of corrections reduces the residual below this fraction of the initial
# residual, further corrections are added only to this set.
_CLEAR = 0.1
# Largest accepted ratio of the residuals with and without an additional correction.
_LESS = 0.9
# Largest residual with which blunders are reported, relative to the initial residual.
_DECISIVE = 0.5
# Smallest accepted ratio of the residuals without and with a reported correction.
_NEEDED = 1.5
# Largest accepted standard deviation of the corrected positions, relative to the
# standard deviation of the readings.
_FAR = 10.0
_NOISE = 3.0  # [sigma] residual below which the search for blunders ends
_LEAST = 100.0  # smallest decrease of chi-square for each reported blunder

Corrections = tuple[Correction, ...]


@dataclass(frozen=True)
class SetupBlunder:
    """A blunder in the set-up of a campaign.

    Attributes:
        kind: ``sign``, ``quarter_turn``, ``exchanged``, ``unit``, ``transposed`` or
            ``quaternion``.
        columns: names of the table columns that contain the blunder.
        before: [sigma] residual with the corrections of all other blunders.
        after: [sigma] residual with the corrections of all blunders.
        sentence: sentence about what the user should check.
    """

    kind: str
    columns: tuple[str, ...]
    before: float
    after: float
    sentence: str


def setup_blunders(
    campaign: Campaign, conditions: Conditions
) -> tuple[SetupBlunder, ...]:
    """Return the set-up blunders whose correction strongly reduces the residual.

    Args:
        campaign: measured deviations.
        conditions: declared conditions of its R rows.

    Returns:
        The blunders.  If their correction does not reduce the residual to less than
        half, the result is empty.
    """
    rows = _sample(campaign)
    if not len(rows):
        return ()
    judge = _Judge(campaign.take(rows), conditions.take(rows))
    start = judge.residual(())
    if not _NOISE < start < np.inf:
        return ()
    chosen, left = _needed(judge, *_search(judge, start))
    gain = int(judge.cells.sum()) * (start**2 - left**2) / max(left, 1.0) ** 2
    if not chosen or left > _DECISIVE * start or gain < _LEAST * len(chosen):
        return ()
    after = judge.residual(chosen, stated=True)
    return tuple(
        _blunder(one, judge.residual(_without(chosen, one), stated=True), after)
        for one in chosen
    )


def _blunder(correction: Correction, before: float, after: float) -> SetupBlunder:
    """Describe a blunder, including a sentence for the user."""
    columns = correction.columns
    fit, s = ("fits", "") if len(columns) == 1 else ("fit", "s")
    sentence = (
        f"{', '.join(columns)} {fit} {correction.what}: the residual is then "
        f"{after:.3g} sigma instead of {before:.3g} sigma; check the column{s} and the "
        "robot file"
    )
    return SetupBlunder(correction.kind, columns, before, after, sentence)


def _search(judge: "_Judge", start: float) -> tuple[Corrections, float]:
    """Find the corrections with the smallest residual by a beam search."""
    tried = corrections(judge.campaign)
    best: tuple[Corrections, float] = ((), start)
    beam = [best]
    for _ in range(_MOST):
        further = []
        for made, left in beam:
            for one in tried:
                if all(one is not other for other in made):
                    now = judge.residual((*made, one))
                    further += [((*made, one), now)] if now < _LESS * left else []
        beam = sorted(further, key=lambda pair: pair[1])[:_BEAM]
        if not beam or beam[0][1] >= _LESS * best[1]:
            break
        best = beam[0]
        if best[1] < _NOISE:
            break
        if best[1] < _CLEAR * start:
            beam = [best]
    return best


def _needed(
    judge: "_Judge", chosen: Corrections, left: float
) -> tuple[Corrections, float]:
    """Remove the corrections that hardly reduce the residual."""
    for one in chosen:
        fewer = _without(chosen, one)
        without = judge.residual(fewer)
        rivals = [without]
        # A correction of loads must reduce the residual more than omitting all loads.

        if one.array == "loads":
            rivals.append(judge.residual(fewer, loads=0.0))
        if min(rivals) < _NEEDED * left:
            chosen, left = fewer, without
    return chosen, left


def _without(chosen: Sequence[Correction], one: Correction) -> Corrections:
    """Return a set of corrections with one correction removed."""
    return tuple(other for other in chosen if other is not one)


def _sample(campaign: Campaign) -> NDArray:
    """Return evenly spaced rows among those with sufficient readings."""
    cells = campaign.cells
    enough = np.any if campaign.registration == "known" else np.all
    usable = cells[:, :3].all(axis=1) | enough(cells[:, 3:], axis=1)
    rows: NDArray = np.flatnonzero(usable)
    return rows[np.linspace(0, len(rows) - 1, min(_ROWS, len(rows))).astype(int)]


class _Judge:
    """Computes the residuals of selected rows for assumed set-ups."""

    def __init__(self, campaign: Campaign, conditions: Conditions) -> None:
        self.campaign, self.given = campaign, as_given(campaign)
        robot = without_joint_clearances(conditions.robot)
        self.conditions = replace(conditions, robot=robot, rest=None, second_order=0.0)
        self.cells = np.array(campaign.cells)
        self.cells[:, :3] = self.cells[:, :3].all(axis=1, keepdims=True)

    def residual(
        self, made: Corrections, *, loads: float = 1.0, stated: bool = False
    ) -> float:
        """Return the trimmed rms [sigma] of the residual for corrected data.

        Args:
            made: corrections that are applied to the campaign.
            loads: factor by which all loads are multiplied.
            stated: whether to divide by the declared sigma, even if a correction
                changes the unit of length.

        Returns:
            The residual, inf if a command is unreachable.
        """
        setup = self.given
        for correction in made:
            setup = correction.apply(setup)
        moved = self._moved(replace(setup, loads=loads * setup.loads))
        if moved is None:
            return np.inf
        with np.errstate(all="ignore"):
            deviation = predict(moved).deviation
        points = moved.measured_points + deviation[:, 3:]
        platform = moved.postures.platform[:, :3, :3]
        turns = rotation_matrix(deviation[:, :3]) @ platform
        left = np.full((len(points), 6), np.nan)
        for session in self.campaign.sessions or (None,):
            own = self.campaign.in_session(session)
            R, shift = self._device(setup, points, turns, own)
            left[own, 3:] = setup.points[own] - points[own] @ R.T - shift
            gap = setup.turns[own] @ np.swapaxes(R @ turns[own], 1, 2)
            known = np.isfinite(gap).all(axis=(1, 2))
            left[np.flatnonzero(own)[known], :3] = rotation_vector(gap[known])
        sigma = self.given.sigma if stated else setup.sigma
        sizes = np.sort(np.abs(left / sigma)[self.cells])
        if not np.isfinite(sizes).all():
            return np.inf
        kept = sizes[: max(1, round(_TRIMMED * len(sizes)))]
        return float(np.sqrt(np.mean(kept**2)))

    def _moved(self, setup: SetUp) -> Conditions | None:
        """Return the conditions of a set-up, or None if a command is unreachable."""
        moved, given = replace(self.conditions, load=setup.loads), self.given
        if setup.places is not given.places or setup.axes is not given.axes:
            wide = np.nanstd(setup.points, axis=0).max()
            if np.std(setup.places, axis=0).max() > _FAR * wide:
                return None  # the solver is slow for unreachable targets
            poses = np.hstack([setup.places, rotation_vector(setup.axes)])
            postures, _ = place_many(moved.robot, poses)
        elif setup.coordinates is not given.coordinates:
            actuated = np.array([frame.actuated for frame in moved.robot.frames])
            held = np.where(actuated, setup.coordinates, np.nan)
            postures, _ = place_many_joints(moved.robot, held)
        else:
            return moved
        placed = [posture for posture in postures if posture is not None]
        if len(placed) < len(postures):
            return None
        return replace(
            moved,
            coordinates=np.array([p.coordinates for p in placed]),
            transforms=np.array([p.transforms for p in placed]),
        )

    def _device(
        self, setup: SetUp, points: NDArray, turns: NDArray, own: NDArray
    ) -> tuple[NDArray, NDArray]:
        """Fit the rotation (3, 3) and translation (3,) [m] of the measuring device."""
        if self.campaign.registration == "known":
            return np.eye(3), np.zeros(3)
        read, seen = points[own], setup.points[own]
        placed = np.isfinite(seen + read).all(axis=1)
        read, seen = read[placed], seen[placed]
        turned = np.isfinite(setup.turns[own] + turns[own]).all(axis=(1, 2))
        both = turns[own][turned], setup.turns[own][turned]
        R = np.eye(3)
        if turned.any() or off_one_line(read):
            R = device_rotation(read, seen, *both)
        shift = np.median(seen - read @ R.T, axis=0) if len(seen) else np.zeros(3)
        return R, shift
