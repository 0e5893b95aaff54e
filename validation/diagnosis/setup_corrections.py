"""Define corrections of set-up blunders, such as wrong signs or units.

The readings of a campaign are deviations from the commanded pose, but a device measures
absolute poses.  Most corrections therefore change the absolute readings, which are the
commanded poses plus the deviations. A correction with ``deviation=True`` changes only
the deviations.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from forcefit.stiffness.screws import rotation_matrix
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.signatures import loaded_components

_UNITS = {  # conversion factors between units that are often confused
    "length": (25.4, 1e3),  # inches or millimetres instead of metres
    "angle": (180 / np.pi,),  # degrees instead of radians
    "load": (9.81, 1e3),  # kilograms-force or kilonewtons instead of newtons
}


def _rolled(turns: Rotation, by: int) -> Rotation:
    """Permute the quaternion components of rotations cyclically."""
    return Rotation.from_quat(np.roll(turns.as_quat(), by, axis=-1))


_MISREAD = (
    ("transposed", "transposed", Rotation.inv),
    # If (x, y, z, w) is read in the order w, x, y, z, the result is (y, z, w, x).

    ("quaternion", "with the quaternion's w taken last, not first",
     partial(_rolled, by=1)),
    ("quaternion", "with the quaternion's w taken first, not last",
     partial(_rolled, by=-1)),
)  # fmt: skip
# Prefix of the column names, array of SetUp, description of the correction, and whether
# only the deviation changes.
_LENGTHS = (
    ("pose.t", "places", "", False),
    ("meas.t", "points", ", as positions", False),
    ("meas.t", "points", ", as deviations", True),
)
_ROTATIONS = (
    ("pose.r", "axes", "", False),
    ("meas.r", "turns", ", as orientations", False),
    ("meas.r", "turns", ", as deviations", True),
)


@dataclass(frozen=True, eq=False)
class SetUp:
    """Commands and readings of a campaign under an assumed set-up.

    Attributes:
        coordinates: (R, n) [rad or m] commanded coordinates of all joints.
        places: (R, 3) [m] commanded platform positions, if poses are commanded.
        axes: (R, 3, 3) commanded axes of the platform.
        loads: (R, 6) [N m, N] loads on the platform.
        points: (R, 3) [m] measured positions, base axes, NaN if not measured.
        turns: (R, 3, 3) measured axes of the platform, NaN if not measured.
        nominal: commanded positions and axes before corrections.
        sigma: (R, 6) [rad, m] standard deviations of the readings.
    """

    coordinates: NDArray
    places: NDArray
    axes: NDArray
    loads: NDArray
    points: NDArray
    turns: NDArray
    nominal: dict[str, NDArray]
    sigma: NDArray


@dataclass(frozen=True, eq=False)
class Correction:
    """Correction of one blunder.

    Attributes:
        kind: kind of the blunder in one word.
        columns: table columns that the correction changes.
        what: description of the correction as part of a sentence.
        array: name of the :class:`SetUp` array to change.
        change: function that returns the corrected array, or its corrected deviation.
        deviation: whether ``change`` is applied to the deviation from the command
            instead of the absolute readings.
        sigma: factor by which the standard deviations of positions are multiplied.
    """

    kind: str
    columns: tuple[str, ...]
    what: str
    array: str
    change: Callable[[NDArray], NDArray]
    deviation: bool = False
    sigma: float = 1.0

    def apply(self, given: SetUp) -> SetUp:
        """Return a set-up with this correction."""
        values, about = getattr(given, self.array), given.nominal.get(self.array)
        if not self.deviation or about is None:
            values = self.change(values)
        elif self.array == "points":
            values = about + self.change(values - about)
        else:
            values = self.change(values @ np.swapaxes(about, 1, 2)) @ about
        sigma = given.sigma * np.repeat([1.0, self.sigma], 3)
        return replace(given, **{self.array: values, "sigma": sigma})


def as_given(campaign: Campaign) -> SetUp:
    """Return the uncorrected set-up of a campaign of R rows."""
    T = campaign.transforms[:, campaign.robot.index(campaign.robot.platform)]
    axes = T[:, :3, :3]
    points = T[:, :3, 3] + np.einsum("rij,rj->ri", axes, campaign.targets)
    return SetUp(
        coordinates=np.array(campaign.coordinates),
        places=T[:, :3, 3],
        axes=axes,
        loads=np.array(campaign.loads),
        points=points + campaign.measured[:, 3:],
        turns=rotation_matrix(campaign.measured[:, :3]) @ axes,
        nominal={"points": points, "turns": axes},
        sigma=np.array(campaign.sigma),
    )


def corrections(campaign: Campaign) -> list[Correction]:
    """Return all corrections that are possible for the columns of a campaign."""
    read = np.isfinite(campaign.measured)
    there = {
        "pose.t": campaign.commanded == "pose",
        "pose.r": campaign.commanded == "pose",
        "meas.t": read[:, 3:].all(axis=1).any(),
        "meas.r": read[:, :3].all(axis=1).any(),
    }
    tried = [*_of_joints(campaign)] if campaign.commanded == "joints" else []
    tried += _of_loads(campaign)
    for stem, array, how, deviation in _LENGTHS:
        for factor, what in _factors("length") if there[stem] else ():
            # Sigma is not increased, because any large factor would then improve the
            # fit.

            sigma = min(factor, 1.0) if array == "points" else 1.0
            tried.append(Correction(
                "unit", _xyz(stem), what + how, array, partial(np.multiply, factor),
                deviation, sigma,
            ))  # fmt: skip
    for stem, array, how, deviation in _ROTATIONS:
        for kind, what, change in _MISREAD if there[stem] else ():
            tried.append(Correction(
                kind, _xyz(stem), what + how, array, partial(_turned, change=change),
                deviation,
            ))  # fmt: skip
    return tried


def _of_joints(campaign: Campaign) -> Iterator[Correction]:
    """Yield corrections of commanded joint coordinates."""
    frames, kinds = campaign.robot.frames, dict[str, list[int]]()
    count = np.arange(len(frames))
    of = partial(Correction, array="coordinates")
    for i, frame in enumerate(frames):
        if not frame.actuated:
            continue
        own, name = count == i, (f"q.{frame.name}",)
        kinds.setdefault(frame.joint, []).append(i)
        change = partial(np.multiply, np.where(own, -1.0, 1.0))
        yield of("sign", name, "with its sign reversed", change=change)
        for degrees in (90, 180, -90) if frame.turns else ():
            change = partial(np.add, np.where(own, np.deg2rad(degrees), 0.0))
            yield of(
                "quarter_turn", name, f"with {degrees} degrees added", change=change
            )
    for joint, columns in kinds.items():
        names = tuple(f"q.{frames[i].name}" for i in columns)
        for (i, a), (j, b) in combinations(zip(columns, names, strict=True), 2):
            order = np.where(count == i, j, np.where(count == j, i, count))
            change = partial(np.take, indices=order, axis=1)
            yield of("exchanged", (a, b), "exchanged", change=change)
        unit = "length" if joint == "prismatic" else "angle"
        for factor, what in _factors(unit):
            by = np.where(np.isin(count, columns), factor, 1.0)
            yield of("unit", names, what, change=partial(np.multiply, by))


def _of_loads(campaign: Campaign) -> Iterator[Correction]:
    """Yield corrections of the signs and units of loads."""
    names = tuple(f"load.{name}" for name in loaded_components(campaign))
    factors = [(-1.0, "with their signs reversed"), *_factors("load")]
    for factor, what in factors if names else ():
        kind = "sign" if factor < 0 else "unit"
        yield Correction(kind, names, what, "loads", partial(np.multiply, factor))


def _xyz(stem: str) -> tuple[str, ...]:
    """Return the column names of the x, y and z components."""
    return tuple(f"{stem}{axis}" for axis in "xyz")


def _factors(quantity: str) -> list[tuple[float, str]]:
    """Return the conversion factors between units in both directions."""
    both = (f for one in _UNITS[quantity] for f in (one, 1 / one))
    return [(factor, f"times {factor:.4g}") for factor in both]


def _turned(turns: NDArray, change: Callable[[Rotation], Rotation]) -> NDArray:
    """Apply a change to rotations (R, 3, 3), some of which may be NaN."""
    read = np.isfinite(turns).all(axis=(1, 2))
    changed = turns.copy()
    changed[read] = change(Rotation.from_matrix(turns[read])).as_matrix()
    return changed
