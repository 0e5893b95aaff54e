"""Corrections of set-up blunders: a sign, a unit, an exchanged column.

A campaign gives what was read as deviations from the commanded pose.  A correction acts
on the absolute readings (deviation and commanded pose put together), since the device
saw these, or on the deviations themselves, where it says so.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from assembly.model.robot import Robot
from stiffness.screws import rotation_vector
from validation.campaign.campaign import LOAD, Campaign

_INCH = 25.4
_GRAVITY = 9.81  # kg taken for N
_MISREAD: tuple[tuple[str, str, Callable[[Rotation], Rotation]], ...] = (
    ("transposed", "transposed", lambda turn: turn.inv()),
    # of x y z w read as w x y z, the parts x y z w hold y z w x
    ("quaternion", "with the quaternion's w taken last, not first",
     lambda turn: Rotation.from_quat(np.roll(turn.as_quat(), 1, axis=-1))),
    ("quaternion", "with the quaternion's w taken first, not last",
     lambda turn: Rotation.from_quat(np.roll(turn.as_quat(), -1, axis=-1))),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class SetUp:
    """What was commanded and read, as it is taken to be.

    Attributes:
        coordinates: (R, n) [rad or m] commanded, of every joint.
        poses: (R, 6) [m, rad] tx ty tz rx ry rz commanded, where poses are.
        loads: (R, 6) [N m, N].
        nominal_points: (R, 3) [m] of the commands as the file gives them.
        nominal_turns: (R, 3, 3) likewise the platform's axes.
        points: (R, 3) [m] as read, base axes; NaN where not read.
        turns: (R, 3, 3) the platform's axes as read; NaN where not read.
        sigma: (R, 6) [rad, m] of the readings.
    """

    coordinates: NDArray
    poses: NDArray
    loads: NDArray
    nominal_points: NDArray
    nominal_turns: NDArray
    points: NDArray
    turns: NDArray
    sigma: NDArray


@dataclass(frozen=True, eq=False)
class Correction:
    """One thing set right.

    Attributes:
        kind: in one word.
        columns: of the campaign's table that it changes.
        what: what is done to them, for a sentence.
        apply: the set-up corrected.
        rival: a simpler set-up that must fit clearly worse; None without one.
    """

    kind: str
    columns: tuple[str, ...]
    what: str
    apply: Callable[[SetUp], SetUp]
    rival: Callable[[SetUp], SetUp] | None = None


def as_given(campaign: Campaign) -> SetUp:
    """The set-up of a campaign as its files give it.

    Args:
        campaign: of R rows.

    Returns:
        The set-up.
    """
    T = campaign.transforms[:, campaign.robot.index(campaign.robot.platform)]
    points = T[:, :3, 3] + np.einsum("rij,rj->ri", T[:, :3, :3], campaign.targets)
    turned = np.isfinite(campaign.measured[:, :3]).all(axis=1)
    turns = np.full((len(T), 3, 3), np.nan)
    deviation = Rotation.from_rotvec(campaign.measured[turned, :3]).as_matrix()
    turns[turned] = deviation @ T[turned, :3, :3]
    return SetUp(
        coordinates=np.array(campaign.coordinates),
        poses=np.hstack([T[:, :3, 3], rotation_vector(T[:, :3, :3])]),
        loads=np.array(campaign.loads),
        nominal_points=points,
        nominal_turns=T[:, :3, :3],
        points=points + campaign.measured[:, 3:],
        turns=turns,
        sigma=np.array(campaign.sigma),
    )


def corrections(campaign: Campaign) -> list[Correction]:
    """All corrections that a campaign's columns allow.

    Args:
        campaign: of R rows.

    Returns:
        The corrections.
    """
    tried = []
    if campaign.commanded == "joints":
        tried += [*_of_joints(campaign.robot)]
    else:
        tried += [*_of_poses()]
    tried += [*_of_loads(campaign)]
    if np.isfinite(campaign.measured[:, 3:]).all(axis=1).any():
        tried += [*_of_lengths()]
    if np.isfinite(campaign.measured[:, :3]).all(axis=1).any():
        tried += [*_of_rotations()]
    return tried


def _of_joints(robot: Robot) -> Iterator[Correction]:
    """Signs, quarter turns, exchanges and units of commanded coordinates."""
    driven = [i for i, frame in enumerate(robot.frames) if frame.actuated]
    kinds: dict[str, list[int]] = {}
    for i in driven:
        kinds.setdefault(robot.frames[i].joint, []).append(i)
        name = f"q.{robot.frames[i].name}"
        yield Correction("sign", (name,), "with its sign reversed", _scaled([i], -1.0))
        for quarters in (1, 2, 3) if robot.frames[i].joint == "revolute" else ():
            what = f"with {(90, 180, -90)[quarters - 1]} degrees added"
            turn = (np.pi / 2, np.pi, -np.pi / 2)[quarters - 1]
            yield Correction("quarter_turn", (name,), what, _added(i, turn))
    for joint, columns in kinds.items():
        names = tuple(f"q.{robot.frames[i].name}" for i in columns)
        for i, j in combinations(range(len(columns)), 2):
            pair = names[i], names[j]
            apply = _exchanged(columns[i], columns[j])
            yield Correction("exchanged", pair, "exchanged", apply)
        factors = (_INCH, 1e3) if joint == "prismatic" else (180 / np.pi,)
        for factor in (f for one in factors for f in (one, 1 / one)):
            what = f"times {factor:.4g}"
            yield Correction("unit", names, what, _scaled(columns, factor))


def _of_poses() -> Iterator[Correction]:
    """Units of commanded places, and commanded rotations misread."""
    names = ("pose.tx", "pose.ty", "pose.tz")
    for factor in (f for one in (_INCH, 1e3) for f in (one, 1 / one)):

        def scaled(given: SetUp, factor: float = factor) -> SetUp:
            return replace(given, poses=given.poses * np.repeat([factor, 1.0], 3))

        yield Correction("unit", names, f"times {factor:.4g}", scaled)
    for kind, what, change in _MISREAD:

        def turned(
            given: SetUp, change: Callable[[Rotation], Rotation] = change
        ) -> SetUp:
            turns = change(Rotation.from_rotvec(given.poses[:, 3:])).as_rotvec()
            return replace(given, poses=np.hstack([given.poses[:, :3], turns]))

        yield Correction(kind, ("pose.rx", "pose.ry", "pose.rz"), what, turned)


def _scaled(columns: list[int], factor: float) -> Callable[[SetUp], SetUp]:
    """Some coordinates times a factor."""

    def apply(given: SetUp) -> SetUp:
        q = given.coordinates.copy()
        q[:, columns] *= factor
        return replace(given, coordinates=q)

    return apply


def _added(column: int, turn: float) -> Callable[[SetUp], SetUp]:
    """An angle added to a coordinate."""

    def apply(given: SetUp) -> SetUp:
        q = given.coordinates.copy()
        q[:, column] += turn
        return replace(given, coordinates=q)

    return apply


def _exchanged(i: int, j: int) -> Callable[[SetUp], SetUp]:
    """Two coordinates exchanged."""

    def apply(given: SetUp) -> SetUp:
        q = given.coordinates.copy()
        q[:, [i, j]] = q[:, [j, i]]
        return replace(given, coordinates=q)

    return apply


def _of_loads(campaign: Campaign) -> Iterator[Correction]:
    """Loads that are reactions, or in another unit."""
    names = tuple(
        f"load.{n}" for n, w in zip(LOAD, campaign.loads.T, strict=True) if w.any()
    )
    units = [factor for one in (_GRAVITY, 1e3) for factor in (one, 1 / one)]
    for factor in (-1.0, *units) if names else ():

        def apply(given: SetUp, factor: float = factor) -> SetUp:
            return replace(given, loads=factor * given.loads)

        kind = "sign" if factor < 0 else "unit"
        what = "with their signs reversed" if factor < 0 else f"times {factor:.4g}"
        yield Correction(kind, names, what, apply, _without_loads)


def _without_loads(given: SetUp) -> SetUp:
    """No loads: where springs hardly respond, small loads are no better."""
    return replace(given, loads=0.0 * given.loads)


def _of_lengths() -> Iterator[Correction]:
    """Lengths read in another unit: of the positions, or of the deviations alone."""
    names = ("meas.tx", "meas.ty", "meas.tz")
    for factor in (f for one in (_INCH, 1e3) for f in (one, 1 / one)):

        def absolute(given: SetUp, factor: float = factor) -> SetUp:
            sigma = _cautious(given.sigma, factor)
            return replace(given, points=factor * given.points, sigma=sigma)

        def relative(given: SetUp, factor: float = factor) -> SetUp:
            points = given.nominal_points
            points = points + factor * (given.points - points)
            sigma = _cautious(given.sigma, factor)
            return replace(given, points=points, sigma=sigma)

        what = f"times {factor:.4g}"
        yield Correction("unit", names, f"{what}, as positions", absolute)
        yield Correction("unit", names, f"{what}, as deviations", relative)


def _cautious(sigma: NDArray, factor: float) -> NDArray:
    """Sigma of lengths times a factor: smaller with them, or any division would fit."""
    return sigma * np.repeat([1.0, min(factor, 1.0)], 3)


def _of_rotations() -> Iterator[Correction]:
    """Rotations read inverted, or from a quaternion whose w is in the wrong place."""
    names = ("meas.rx", "meas.ry", "meas.rz")
    for kind, what, change in _MISREAD:

        def absolute(
            given: SetUp, change: Callable[[Rotation], Rotation] = change
        ) -> SetUp:
            return replace(given, turns=_changed(given.turns, change))

        def relative(
            given: SetUp, change: Callable[[Rotation], Rotation] = change
        ) -> SetUp:
            gap = given.turns @ np.swapaxes(given.nominal_turns, 1, 2)
            return replace(given, turns=_changed(gap, change) @ given.nominal_turns)

        yield Correction(kind, names, f"{what}, as orientations", absolute)
        yield Correction(kind, names, f"{what}, as deviations", relative)


def _changed(turns: NDArray, change: Callable[[Rotation], Rotation]) -> NDArray:
    """(R, 3, 3) rotations changed; NaN stays."""
    read = np.isfinite(turns).all(axis=(1, 2))
    changed = turns.copy()
    changed[read] = change(Rotation.from_matrix(turns[read])).as_matrix()
    return changed
