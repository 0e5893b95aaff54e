"""Load against deflection: clearances, contacts, elasticity, and buckling.

One component of the load goes through a list of values while the rest stays.  At each
the equilibrium is found, of problem (22) or with finite motions, the latter from the
one before, so that a path is followed, forwards or back.  Where the set of pressed
clearances changes, the curve has a kink; where the least second derivative of the
potential passes zero, the equilibrium is lost or branches: a critical load; where it is
lost, the platform jumps to another.  These loads are bracketed by bisection.

The load is what is prescribed: of a path that turns back, only what is stable from one
side is met, and the jump past the rest is named.  :mod:`.arc_length` follows the rest.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.exact.equilibrium import active_clearances
from assembly.exact.exact import ExactAssembly, solve_exact
from assembly.kinematics.posture import Posture
from assembly.linear.closure import VirtualJoints
from assembly.linear.energy import Assembly, solve_assembly
from assembly.linear.nearest_pose import nearest_pose
from assembly.platform_stiffness.active_set import contacts
from assembly.platform_stiffness.exact_tangent import exact_tangent
from assembly.platform_stiffness.linear_tangent import in_contact
from assembly.platform_stiffness.matrices import (
    Part,
    PlatformStiffness,
    numbers_of,
)
from assembly.solvers.conic import SolverFailed
from assembly.solvers.method import Method, check_method
from forcefit.inputs.display import html_table, largest_row, numbers, short_repr
from forcefit.inputs.errors import BadInput

_HALVINGS = 14  # of a step of the load, to bracket what happens in it: 6e-5 of it
_CARRIES = 1e-6  # of the largest force, work along its bound: what is pressed
# contacts followed within a step of the load: symmetric robots have some that carry
# rounding alone, and change with it
_CHANGES = 8
_STAYS = 1e-6  # of the largest motion in a mode: rounding of a platform that stays
_STILL = 1e-12  # [characteristic lengths] motions that are rounding
_JUMP = 5.0  # times what the tangents on both sides explain
_BOUNDS = ("tilt", "tilt", "spin", "radial", "radial", "axial")  # by row of a screw
_NO_LOAD = 1e-9  # of the largest load: where clearances may leave the pose open


@dataclass(frozen=True)
class Event:
    """Something that happens on the way.

    Attributes:
        load: [N or N m] at which, or right after which.
        kind: ``"contact"``, ``"release"``, ``"critical"`` or ``"jump"``.
        what: in words: which clearances, which mode, how far.
        deflection: [rad or m] of the platform there, along the load's component.
    """

    load: float
    kind: str
    what: str
    deflection: float


@dataclass(frozen=True, eq=False)
class DeflectionCurve:
    """How the platform follows one component of the load.

    Attributes:
        posture: the robot's configuration nominally.
        component: of the wrench and of the screw, 0 to 5.
        loads: (k,) [N m or N] that component, in the order in which it was followed.
        screws: (k, 6) [rad, m] of the platform at its origin, base axes.
        energies: (k,) [J] elastic.
        stiffness: (k,) tangent along the component, the others free.
        pressed: (k,) names of the clearances that carry a force.
        open_: (k,) bool, where clearances leave the pose undetermined.
        events: in the order met.
        method: of all equilibria, as asked: ``"compiled"`` or ``"reference"``.
    """

    posture: Posture
    component: int
    loads: NDArray
    screws: NDArray
    energies: NDArray
    stiffness: NDArray
    pressed: tuple[frozenset[str], ...]
    open_: NDArray
    events: tuple[Event, ...]
    method: Method

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def deflection(self) -> NDArray:
        """(k,) [rad or m] along the component."""
        return self.screws[:, self.component]


@dataclass(frozen=True, eq=False)
class _Point:
    """An equilibrium on the curve."""

    load: float
    equilibrium: Assembly | ExactAssembly
    tangent: PlatformStiffness
    pressed: frozenset[str]


Progress = Callable[[str, int, int], None]
_Solver = Callable[[float, _Point | None], _Point]


def deflection_curve(
    posture: Posture,
    component: int,
    loads: Sequence[float],
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    exact: bool = False,
    progress: Progress = lambda what, done, most: None,
    method: Method = "compiled",
) -> DeflectionCurve:
    """Follow the platform while one component of the load changes.

    Args:
        posture: the robot's configuration; its errors and clearances count.
        component: which of ``[mx my mz fx fy fz]``, 0 to 5.
        loads: [N m or N] its values, in the order in which they act.
        load: (6,) [N m, N] the rest of the load, at the platform's origin, base axes.
        gravity: (3,) [m/s^2] base axes.
        exact: whether with finite motions, else by problem (22).
        progress: called at each load with the steps taken there and how many there
            may be.
        method: of :func:`assembly.linear.energy.solve_assembly` or
            :func:`assembly.exact.exact.solve_exact`.

    Returns:
        The curve with its kinks and critical loads.

    Raises:
        CannotAssemble: the errors cannot be closed.
        FreeMotion: the load drives a motion that nothing resists.
        SolverFailed: no equilibrium was found; the load at which is in the message.
        BadInput: no such component, no loads, or not numbers.
        ValueError: no such method.
    """
    check_method(method)
    if component not in range(6) or not len(loads):
        raise BadInput(
            f"deflection_curve: found component {component} and {len(loads)} loads, "
            "expected one of 0 to 5 and at least one load"
        )
    rest = np.zeros(6) if load is None else numbers_of("load", load, 6, "N m, N")
    loads = numbers_of("loads", loads, len(loads), "N m or N").tolist()
    largest = float(np.abs(loads).max(initial=0.0))

    def at(value: float, near: _Point | None) -> _Point:
        wrench = rest.copy()
        wrench[component] = value
        what = f"steps at load {value:.6g}"
        return _solve(
            posture, value, wrench, gravity, exact, near,
            lambda done, most: progress(what, done, most), method,
        )  # fmt: skip

    points: list[_Point] = []
    events: list[Event] = []
    for value in loads:
        before = points[-1] if points else None
        point = at(float(value), before)
        if before is not None:
            events += _events(before, point, at, component)
        points.append(point)
    screws, open_ = zip(
        *(_settled(p, largest, rest, gravity, method) for p in points), strict=True
    )
    axis = np.eye(6)[component]
    return DeflectionCurve(
        posture=posture,
        component=component,
        loads=np.array([p.load for p in points]),
        screws=np.array(screws),
        energies=np.array([p.equilibrium.energy for p in points]),
        stiffness=np.array([p.tangent.along(axis)[0] for p in points]),
        pressed=tuple(p.pressed for p in points),
        open_=np.array(open_),
        events=tuple(events),
        method=method,
    )


def _solve(
    posture: Posture, value: float, wrench: NDArray, gravity: ArrayLike | None,
    exact: bool, near: _Point | None, progress: Callable[[int, int], None],
    method: Method,
) -> _Point:  # fmt: skip
    """Return the equilibrium under one load."""
    progress(0, 1)
    if not exact:
        linear = solve_assembly(posture, wrench, gravity=gravity, method=method)
        names = clearance_names(linear.joints, contacts(linear)[0])
        return _Point(value, linear, in_contact(linear, "letting go"), names)
    start = (
        near.equilibrium
        if near and isinstance(near.equilibrium, ExactAssembly)
        else None
    )
    try:
        equilibrium = solve_exact(
            posture, wrench, gravity=gravity, near=start, progress=progress,
            method=method,
        )  # fmt: skip
    except SolverFailed:
        if start is None:
            raise
        equilibrium = solve_exact(
            posture, wrench, gravity=gravity, progress=progress, method=method
        )
    active, force = active_clearances(equilibrium.expansion)
    # what carries rounding alone changes with it
    active &= force > _CARRIES * force.max(initial=0.0)
    names = clearance_names(equilibrium.expansion.placement.model.joints, active)
    return _Point(value, equilibrium, exact_tangent(equilibrium, "letting go"), names)


def _settled(
    point: _Point, largest: float, rest: NDArray, gravity: ArrayLike | None,
    method: Method,
) -> tuple[NDArray, bool]:  # fmt: skip
    """Platform screw, where clearances leave it open the one nearest to nominal."""
    equilibrium = point.equilibrium
    idle = not rest.any() and gravity is None and abs(point.load) <= _NO_LOAD * largest
    if idle and isinstance(equilibrium, Assembly):
        nearest, open_ = nearest_pose(equilibrium, np.zeros(3), method)
        return nearest.platform_screw, open_
    return equilibrium.platform_screw, bool(point.tangent.free.shape[1])


def clearance_names(joints: VirtualJoints, marked: NDArray) -> frozenset[str]:
    """Return the names such as ``"leg1.elbow radial"`` of the clearances marked.

    Args:
        joints: whose clearances they are.
        marked: (cones,) bool.

    Returns:
        The names.
    """
    names = set()
    for k in np.flatnonzero(marked):
        column = int(np.flatnonzero(joints.group == k)[0])
        row = int(np.abs(joints.cones[:, column]).argmax())
        names.add(f"{joints.robot.frames[row // 6].name} {_BOUNDS[row % 6]}")
    return frozenset(names)


def _events(
    before: _Point, after: _Point, at: _Solver, component: int, most: int = _CHANGES
) -> list[Event]:
    """What changed between two neighbouring loads, and at which load."""
    events = []
    if before.pressed != after.pressed:
        low, high = _bracket(before, after, at, lambda p: p.pressed == before.pressed)
        changes = (
            ("contact", high.pressed - low.pressed),
            ("release", low.pressed - high.pressed),
        )
        events = [
            _event(high, kind, ", ".join(sorted(names)), component)
            for kind, names in changes
            if names
        ]
        if high.load != after.load and high.pressed != after.pressed and most > 1:
            return events + _events(high, after, at, component, most - 1)
    if before.tangent.stable != after.tangent.stable:
        stable = before.tangent.stable
        low, high = _bracket(before, after, at, lambda p: p.tangent.stable == stable)
        mode = _mode(high if stable else low)
        events.append(_event(high, "critical", mode, component))
    elif not events and _jumps(before, after, component):
        low, high = _bracket(
            before, after, at, lambda p: _apart(before, p) < _apart(p, after)
        )
        if _jumps(low, high, component):  # else it was but soft on the way
            way = numbers(
                high.equilibrium.platform_screw - low.equilibrium.platform_screw
            )
            events.append(_event(high, "jump", f"by {way} rad, m", component))
    return events


def _event(point: _Point, kind: str, what: str, component: int) -> Event:
    """What happens at a point."""
    moved = float(point.equilibrium.platform_screw[component])
    return Event(point.load, kind, what, moved)


def _bracket(
    low: _Point, high: _Point, at: _Solver, same: Callable[[_Point], bool]
) -> tuple[_Point, _Point]:
    """Return neighbouring loads between which something changes for the first time."""
    for _ in range(_HALVINGS):
        try:
            middle = at((low.load + high.load) / 2, low)
        except SolverFailed:
            break  # as between free motion and the least load: that near it is known
        low, high = (middle, high) if same(middle) else (low, middle)
    return low, high


def _apart(one: _Point, other: _Point) -> float:
    """[m] between the platforms of two equilibria, rotations times the length."""
    change = other.equilibrium.platform_screw - one.equilibrium.platform_screw
    return float(np.linalg.norm(change * np.repeat([one.tangent.length, 1.0], 3)))


def _jumps(before: _Point, after: _Point, component: int) -> bool:
    """Return whether the platform moves much farther than either tangent says."""
    scale = np.repeat([before.tangent.length, 1.0], 3)
    farthest = max(
        float(np.linalg.norm(scale * p.tangent.compliance[component]))
        for p in (before, after)
    )
    step = abs(after.load - before.load)
    apart = _apart(before, after)
    moved = apart > _STILL * before.tangent.length
    return moved and apart > _JUMP * step * farthest  # never if one is free


def _mode(point: _Point) -> str:
    """Return motion of negative stiffness, by the platform and the part that bends."""
    tangent = point.tangent
    soft = int(np.flatnonzero(tangent.signs < 0)[0])
    return "buckles: " + mode_text(
        tangent.root, soft, tangent.springs[:, soft], tangent.parts, tangent.length
    )


def mode_text(
    screws: NDArray, mode: int, springs: NDArray, parts: Sequence[Part], length: float
) -> str:
    """Return a mode in words: how the platform moves, and what bends most.

    Args:
        screws: (6, k) [rad, m] of the platform in all modes, of any common size.
        mode: which of them it is.
        springs: (m,) [sqrt(2 J)] their deformation in it.
        parts: (m,) whose springs they are.
        length: [m] by which rotations are multiplied to be compared.

    Returns:
        The screw of unit size, or that the platform stays, and the part.
    """
    part = parts[largest_row(np.square(springs))]
    scale, screw = np.repeat([length, 1.0], 3), screws[:, mode]
    sizes = np.linalg.norm(screws * scale[:, None], axis=0)
    size = sizes[mode]
    if size <= _STAYS * sizes.max():
        return f"inside the links, the platform stays; most in {part.frame} {part.kind}"
    way = np.where(np.abs(screw) * scale > 1e-6 * size, screw / (size or 1.0), 0.0)
    return f"platform along {numbers(way)} rad, m; most in {part.frame} {part.kind}"
