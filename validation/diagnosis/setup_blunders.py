"""Set-up blunders: signs, quarter turns, units, exchanged columns; before any search.

They move readings by decimetres where effects move them by micrometres, so that rigid
motions and the declared springs are enough to tell them.  Several may act together.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from assembly.kinematics.posture import place_many, place_many_joints
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict
from assembly.measurement.settled_clearance import without_joint_clearances
from stiffness.screws import rotation_matrix, rotation_vector
from validation.campaign.campaign import Campaign
from validation.diagnosis.setup_corrections import (
    Correction,
    SetUp,
    as_given,
    corrections,
)

_ROWS = 40  # by which corrections are judged
_TRIMMED = 0.9  # of the cells, the smallest: blunders of single readings do not count
_MOST = 3  # blunders that act together
_BEAM = 4  # sets of corrections that are followed
_CLEAR = 0.1  # of the residual left: only this set of corrections is followed
_LESS = 0.9  # of the residual must be left for a further correction to be followed
_DECISIVE = 0.5  # of the residual must be left for blunders to be reported
_NEEDED = 1.5  # times the residual that is left without one of them
_FAR = 10.0  # times the spread of the readings: no unit that places could have
_NOISE = 3.0  # [sigma] of residual, below which nothing is looked for
_LEAST = 100.0  # by which chi-square must fall for each blunder


@dataclass(frozen=True)
class SetupBlunder:
    """Something that is set up wrongly.

    Attributes:
        kind: ``sign``, ``quarter_turn``, ``exchanged``, ``unit``, ``transposed`` or
            ``quaternion``.
        columns: of the campaign's table, by name.
        before: [sigma] residual without its correction, all others made.
        after: [sigma] residual with all corrections.
        sentence: what to look at.
    """

    kind: str
    columns: tuple[str, ...]
    before: float
    after: float
    sentence: str


def setup_blunders(
    campaign: Campaign, conditions: Conditions
) -> tuple[SetupBlunder, ...]:
    """Set-up blunders whose correction reduces the residual decisively.

    Args:
        campaign: measured deviations.
        conditions: its R rows as the robot's file declares the machine.

    Returns:
        The blunders, none where the residual falls to no half; residuals are the root
        mean square over the smaller nine tenths of the cells, in sigma, after the
        device's place is fitted where it is not known.
    """
    rows = _sample(campaign)
    if not len(rows):
        return ()
    judged = _Judge(campaign.take(rows), conditions.take(rows))
    given = judged.given
    start = judged.residual(given)
    if not _NOISE < start < np.inf:
        return ()
    chosen, left = _search(judged, given, start)
    chosen, left = _needed(judged, given, chosen, left)
    gain = int(judged.cells.sum()) * (start**2 - left**2) / max(left, 1.0) ** 2
    if not chosen or left > _DECISIVE * start or gain < _LEAST * len(chosen):
        return ()
    # in the sentence sigma is the one stated
    stated = [
        judged.residual(replace(_made(given, made), sigma=given.sigma))
        for made in (chosen, *(_without(chosen, one) for one in chosen))
    ]
    return tuple(
        _blunder(one, before, stated[0])
        for one, before in zip(chosen, stated[1:], strict=True)
    )


def _blunder(correction: Correction, before: float, after: float) -> SetupBlunder:
    """A blunder with its sentence."""
    columns = correction.columns
    names = ", ".join(columns)
    fit = "fits" if len(columns) == 1 else "fit"
    sentence = (
        f"{names} {fit} {correction.what}: the residual is then {after:.3g} sigma, "
        f"otherwise {before:.3g}; look at the column"
        f"{'s' if len(columns) > 1 else ''} and at the robot's file"
    )
    return SetupBlunder(correction.kind, columns, before, after, sentence)


def _search(
    judged: "_Judge", given: SetUp, start: float
) -> tuple[tuple[Correction, ...], float]:
    """The corrections that leave least, by a beam search, and what they leave."""
    tried = corrections(judged.campaign)
    best: tuple[tuple[Correction, ...], float] = ((), start)
    beam = [best]
    for _ in range(_MOST):
        further = []
        for made, left in beam:
            for one in tried:
                if all(one is not other for other in made):
                    now = judged.residual(_made(given, (*made, one)))
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
    judged: "_Judge", given: SetUp, chosen: tuple[Correction, ...], left: float
) -> tuple[tuple[Correction, ...], float]:
    """The corrections without those that hardly change what is left."""
    for one in chosen:
        fewer = _without(chosen, one)
        without = judged.residual(_made(given, fewer))
        rivals = [without]
        if one.rival is not None:
            rivals.append(judged.residual(one.rival(_made(given, fewer))))
        if min(rivals) < _NEEDED * left:
            chosen, left = fewer, without
    return chosen, left


def _without(chosen: Sequence[Correction], one: Correction) -> tuple[Correction, ...]:
    """All corrections but one."""
    return tuple(other for other in chosen if other is not one)


def _made(given: SetUp, made: Sequence[Correction]) -> SetUp:
    """A set-up with corrections made."""
    for correction in made:
        given = correction.apply(given)
    return given


def _sample(campaign: Campaign) -> NDArray:
    """Rows spread evenly over those by which a set-up can be judged."""
    cells = campaign.cells
    enough = np.any if campaign.registration == "known" else np.all
    usable = cells[:, :3].all(axis=1) | enough(cells[:, 3:], axis=1)
    rows: NDArray = np.flatnonzero(usable)
    return rows[np.linspace(0, len(rows) - 1, min(_ROWS, len(rows))).astype(int)]


class _Judge:
    """What a set-up leaves of the readings of some rows."""

    def __init__(self, campaign: Campaign, conditions: Conditions) -> None:
        self.campaign, self.given = campaign, as_given(campaign)
        robot = without_joint_clearances(conditions.robot)
        self.conditions = replace(conditions, robot=robot, rest=None, second_order=0.0)
        self.cells = np.array(campaign.cells)
        self.cells[:, :3] = self.cells[:, :3].all(axis=1, keepdims=True)

    def residual(self, setup: SetUp) -> float:
        """[sigma] trimmed rms of what is left, infinite where it cannot be placed."""
        moved = self._moved(setup)
        if moved is None:
            return np.inf
        with np.errstate(all="ignore"):
            deviation = predict(moved).deviation
        platform = moved.postures.platform[:, :3, :3]
        points = moved.measured_points + deviation[:, 3:]
        turns = rotation_matrix(deviation[:, :3]) @ platform
        left = np.full((len(points), 6), np.nan)
        for rows in self._sessions():
            R, shift = self._device(setup, points, turns, rows)
            left[rows, 3:] = setup.points[rows] - points[rows] @ R.T - shift
            seen = np.isfinite(setup.turns[rows]).all(axis=(1, 2))
            at = rows[seen & np.isfinite(turns[rows]).all(axis=(1, 2))]
            gap = setup.turns[at] @ np.swapaxes(R @ turns[at], 1, 2)
            left[at, :3] = rotation_vector(gap)
        sizes = np.sort(np.abs(left / setup.sigma)[self.cells])
        if not np.isfinite(sizes).all():
            return np.inf
        kept = sizes[: max(1, round(_TRIMMED * len(sizes)))]
        return float(np.sqrt(np.mean(kept**2)))

    def _moved(self, setup: SetUp) -> Conditions | None:
        """Conditions of a set-up; None where too few of its commands can be reached."""
        moved = replace(self.conditions, load=setup.loads)
        robot = moved.robot
        if not np.array_equal(setup.poses, self.given.poses):
            wide = np.nanstd(setup.points, axis=0).max()
            if np.std(setup.poses[:, :3], axis=0).max() > _FAR * wide:
                return None  # and it may take long to find that it is out of reach
            postures, _ = place_many(robot, setup.poses)
        elif not np.array_equal(setup.coordinates, self.given.coordinates):
            actuated = np.array([frame.actuated for frame in robot.frames])
            held = np.where(actuated, setup.coordinates, np.nan)
            postures, _ = place_many_joints(robot, held)
        else:
            return moved
        if any(posture is None for posture in postures):
            return None
        placed = [posture for posture in postures if posture is not None]
        return replace(
            moved,
            coordinates=np.array([p.coordinates for p in placed]),
            transforms=np.array([p.transforms for p in placed]),
        )

    def _sessions(self) -> list[NDArray]:
        """Rows that share where the device stood."""
        session = self.campaign.session
        if session is None:
            return [np.arange(len(self.campaign))]
        return [np.flatnonzero(session == name) for name in self.campaign.sessions]

    def _device(
        self, setup: SetUp, points: NDArray, turns: NDArray, rows: NDArray
    ) -> tuple[NDArray, NDArray]:
        """Rotation (3, 3) and shift (3,) [m] of the device, fitted where not known."""
        R, shift = np.eye(3), np.zeros(3)
        if self.campaign.registration == "known":
            return R, shift
        placed = rows[np.isfinite(setup.points[rows] + points[rows]).all(axis=1)]
        both = np.isfinite(setup.turns[rows] + turns[rows]).all(axis=(1, 2))
        turned = rows[both]
        a, b = points[placed], setup.points[placed]
        if len(turned):
            gap = setup.turns[turned] @ np.swapaxes(turns[turned], 1, 2)
            R = Rotation.from_matrix(gap).mean().as_matrix()
        elif len(placed) > 2:
            U, _, Vt = np.linalg.svd((a - a.mean(axis=0)).T @ (b - b.mean(axis=0)))
            sign = np.sign(np.linalg.det(Vt.T @ U.T))
            R = Vt.T @ np.diag([1.0, 1.0, sign]) @ U.T
        if len(placed):
            shift = np.median(b - a @ R.T, axis=0)
        return R, shift
