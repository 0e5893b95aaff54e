"""Trajectories: pose components over time, with first and second derivatives.

Poses with times are interpolated by a quintic spline, which is continuous up to the
fourth derivative.  Poses without times are interpolated by a natural cubic spline over
the chord length.  This curve is traversed with a profile from
:mod:`forcefit.assembly.path.profiles`.  Each component of positions, rotation vectors
or joint coordinates is interpolated separately.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.path.path_file import PathTable
from forcefit.assembly.path.profiles import JUMPING, PROFILES
from forcefit.inputs.table import BadInput, nearest

MOST_POINTS = 20_000  # maximum number of points
_FINE = 4001  # number of instants at which peak speed and acceleration are searched
_ROWS_MOVING = 6  # minimum number of poses for a quintic spline without end conditions


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Pose components at k instants.

    Attributes:
        names: components, ``tx`` .. or ``q.<frame>``.
        times: (k,) [s] instants.
        values: (k, c) [m or rad] values of the components.
        first: (k, c) first derivatives.
        second: (k, c) second derivatives.
        law: ``"times"`` or the name of the profile.
        jumps: whether the acceleration is discontinuous.
    """

    names: tuple[str, ...]
    times: NDArray
    values: NDArray
    first: NDArray
    second: NDArray
    law: str
    jumps: bool = False

    @property
    def duration(self) -> float:
        """Time from the first to the last instant [s]."""
        return float(self.times[-1] - self.times[0])


def timed(table: PathTable, points: int, ends: str = "rest") -> Trajectory:
    """Return the trajectory through poses at given times.

    Args:
        table: path with times.
        points: number of equally spaced instants.
        ends: ``"rest"`` if speed and acceleration are zero at both ends, or
            ``"moving"`` for a spline without end conditions.

    Returns:
        The trajectory.

    Raises:
        BadInput: ``ends`` is ``"moving"`` and the path has fewer than six poses, or the
            number of points is out of range.
    """
    from scipy.interpolate import make_interp_spline

    _check_points(points)
    assert table.times is not None
    rest = ends == "rest"
    if not rest and len(table.values) < _ROWS_MOVING:
        raise BadInput(
            f"--ends moving: found {len(table.values)} rows, expected at least "
            f"{_ROWS_MOVING}, or --ends rest"
        )
    zero = np.zeros(table.values.shape[1])
    still = [(1, zero), (2, zero)]
    spline = make_interp_spline(
        table.times, table.values, k=5, bc_type=(still, still) if rest else None
    )
    t = np.linspace(table.times[0], table.times[-1], points)
    parts = (spline(t), spline(t, 1), spline(t, 2))
    return Trajectory(table.names, t, *parts, "times")


def profiled(
    table: PathTable, points: int, profile: str, size: float,
    duration: float | None = None, speed: float | None = None,
    acceleration: float | None = None,
) -> Trajectory:  # fmt: skip
    """Return the trajectory through poses with a rest-to-rest motion profile.

    Args:
        table: path, whose times are not used.
        points: number of equally spaced instants.
        profile: name in :data:`forcefit.assembly.path.profiles.PROFILES`.
        size: [m] length by which rotations are multiplied in the chord length.
        duration: [s] duration of the motion; None if limits are given.
        speed: [m/s, or rad/s of drives] largest speed of the platform's origin, or of
            any named joint.
        acceleration: [m/s^2, or rad/s^2 of drives] largest acceleration of the
            platform's origin, or of any named joint.

    Returns:
        The trajectory, which has the shortest duration within the limits.

    Raises:
        BadInput: the profile is unknown, duration and limits are both given or both
            missing, two consecutive poses are equal, or limits are given and the
            origin of the platform does not move.
    """
    from scipy.interpolate import CubicSpline

    _check_points(points)
    if profile not in PROFILES:
        raise BadInput(f'--profile: found "{profile[:60]}"{nearest(profile, PROFILES)}')
    if (duration is None) == (speed is None and acceleration is None):
        raise BadInput(
            "--profile: expected --duration, or --speed or --acceleration or both of "
            "the latter"
        )
    curve = CubicSpline(_chords(table, size), table.values, bc_type="natural")

    def at(t: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        s, s1, s2 = (part[:, None] for part in PROFILES[profile](t))
        along = s[:, 0]
        slope = curve(along, 1)
        return curve(along), slope * s1, slope * s2 + curve(along, 2) * s1**2

    if duration is None:
        _, first, second = at(np.linspace(0, 1, _FINE))
        duration = _within(table.names, first, second, speed, acceleration)
    t = np.linspace(0, 1, points)
    values, first, second = at(t)
    return Trajectory(
        table.names, duration * t, values, first / duration, second / duration**2,
        profile, profile in JUMPING,
    )  # fmt: skip


def _check_points(points: int) -> None:
    """Raise BadInput for a number of points that is out of range."""
    if not 2 <= points <= MOST_POINTS:
        raise BadInput(f"--points: found {points}, expected 2 to {MOST_POINTS}")


def _chords(table: PathTable, size: float) -> NDArray:
    """Return the relative chord length from the first pose to each pose, (rows,)."""
    turns = np.array([name[0] == "r" for name in table.names])
    steps = np.diff(table.values, axis=0) * np.where(turns, size, 1.0)
    lengths = np.linalg.norm(steps, axis=1)
    if not lengths.all():
        row = int(np.argmin(lengths))
        raise BadInput(
            f"path: {table.row_name(row + 1)}: found the same pose as "
            f"in {table.row_name(row)}; expected a different pose, or a path with times"
        )
    before = np.concatenate([[0.0], np.cumsum(lengths)])
    return before / before[-1]


def _within(
    names: tuple[str, ...], first: NDArray, second: NDArray, speed: float | None,
    acceleration: float | None,
) -> float:  # fmt: skip
    """Return the shortest duration [s] with speed and acceleration within limits."""
    # speed is inversely proportional to the duration, acceleration to its square
    moved = [k for k, name in enumerate(names) if name[0] == "t"]
    if names[0].startswith("q."):
        fastest = np.abs(first).max(), np.abs(second).max()
    else:
        fastest = tuple(
            np.linalg.norm(part[:, moved], axis=1).max(initial=0.0)
            for part in (first, second)
        )
    if fastest[0] == 0.0:
        raise BadInput(
            "--speed, --acceleration: found a path along which the platform's origin "
            "does not move; expected --duration"
        )
    times = [0.0 if speed is None else fastest[0] / speed]
    times.append(0.0 if acceleration is None else np.sqrt(fastest[1] / acceleration))
    return float(max(times))
