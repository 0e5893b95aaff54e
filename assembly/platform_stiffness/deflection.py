"""Platform deflection as a function of a load, with contact changes and buckling.

One component of the load varies, and the other components are constant.  For each load,
the equilibrium is computed by problem (22) or with finite motions.  With finite
motions, each equilibrium is the initial guess for the next.

The curve has a kink where a contact in a clearance opens or closes.  The load is
critical where the smallest curvature of the potential changes sign.  There, the path of
equilibria branches, or the platform jumps to a distant equilibrium.  Both events are
located by bisection.

Unstable equilibria are not found; see :mod:`.arc_length`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.equilibrium import active_clearances
from forcefit.assembly.exact.exact import ExactAssembly, solve_exact
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.closure import VirtualJoints
from forcefit.assembly.linear.energy import Assembly, solve_assembly
from forcefit.assembly.linear.load import driven
from forcefit.assembly.linear.nearest_pose import nearest_pose
from forcefit.assembly.model.clearance import bound_name
from forcefit.assembly.model.given_load import Load, one_load
from forcefit.assembly.model.joint_names import shown_name
from forcefit.assembly.platform_stiffness.active_set import contacts
from forcefit.assembly.platform_stiffness.exact_tangent import exact_tangent
from forcefit.assembly.platform_stiffness.linear_tangent import in_contact
from forcefit.assembly.platform_stiffness.matrices import (
    Part,
    PlatformStiffness,
    numbers_of,
)
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.solvers.method import Method, check_method
from forcefit.inputs.errors import BadInput
from forcefit.inputs.renamed import renamed_keywords
from forcefit.results.display import html_table, largest_row, numbers, short_repr

if TYPE_CHECKING:
    import pandas
    import xarray

_HALVINGS = 14  # number of bisections, for an accuracy of 6e-5 of a load step
# [-] tolerance for zero contact forces, relative to the largest contact force
_CARRIES = 1e-6
_CHANGES = 8  # maximum number of changes of contact within a load step
# [-] tolerance for zero platform motions, relative to the largest of all modes
_STAYS = 1e-6
_STILL = 1e-12  # [characteristic lengths] round-off of platform motions
_JUMP = 5.0  # [-] smallest ratio of a jump to the motion predicted by the tangents
_NO_LOAD = 1e-9  # [-] tolerance for zero loads, relative to the largest load


@dataclass(frozen=True)
class Event:
    """An event on a load-deflection curve, such as a change of contact.

    Attributes:
        load: [N or N m] load at the event, or directly after it.
        kind: ``"contact"``, ``"release"``, ``"critical"`` or ``"jump"``.
        what: description of the clearances, of the mode or of the distance.
        deflection: [rad or m] component of the platform's deflection along the load.
    """

    load: float
    kind: str
    what: str
    deflection: float


@dataclass(frozen=True, eq=False)
class DeflectionCurve:
    """Motion of the platform while one component of the load varies.

    Attributes:
        posture: the robot's nominal configuration.
        component: component of the wrench and of the screw, 0 to 5.
        loads: (k,) [N m or N] values of this component, in the order of application.
        screws: (k, 6) [rad, m] screws of the platform at its origin, base axes.
        energies: (k,) [J] elastic energies.
        stiffness: (k,) [N m/rad or N/m] tangent stiffness along this component, with
            the other components of the motion free.
        pressed: (k,) names of the clearances with a contact force.
        open_: (k,) bool, True if the pose is undetermined because of clearances.
        events: events in the order of the curve.
        method: requested method of all equilibria: ``"compiled"`` or ``"reference"``.
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

    def to_xarray(self) -> "xarray.Dataset":
        """Return a data set with the dimension ``point``; see :mod:`.tables`."""
        from forcefit.assembly.platform_stiffness.tables import curve_dataset

        return curve_dataset(self)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a pandas table with a row for each load."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "point")

    @property
    def deflection(self) -> NDArray:
        """Deflections along the component of the load, (k,) [rad or m]."""
        return self.screws[:, self.component]


@dataclass(frozen=True, eq=False)
class _Point:
    """An equilibrium on the load-deflection curve."""

    load: float
    equilibrium: Assembly | ExactAssembly
    tangent: PlatformStiffness
    pressed: frozenset[str]


Progress = Callable[[str, int, int], None]
_Solver = Callable[[float, _Point | None], _Point]


@renamed_keywords(exact=("state", {True: "exact", False: "contact"}))
def deflection_curve(
    posture: Posture,
    component: int,
    loads: Sequence[float],
    load: Load | None = None,
    gravity: ArrayLike | None = None,
    state: Literal["contact", "exact"] = "contact",
    progress: Progress = lambda what, done, most: None,
    method: Method = "compiled",
) -> DeflectionCurve:
    """Compute the motion of the platform while one component of the load varies.

    Args:
        posture: the robot's configuration, with its errors and clearances.
        component: index in ``[mx my mz fx fy fz]``, 0 to 5.
        loads: [N m or N] values of the component, in the order of application.
        load: (6,) [N m, N] constant components, at the platform's origin, base axes; or
            a mapping of components such as ``{"fz": -50}``.
        gravity: (3,) [m/s^2] gravity vector in base axes.
        state: ``"contact"`` for problem (22), or ``"exact"`` for finite motions.
        progress: function called at each load with the current and the maximum number
            of steps.
        method: method of :func:`forcefit.assembly.linear.energy.solve_assembly` or
            :func:`forcefit.assembly.exact.exact.solve_exact`.

    Returns:
        The curve with its kinks and critical loads.

    Raises:
        CannotAssemble: the loops cannot be closed with these errors.
        FreeMotion: the load acts on a motion without stiffness.
        SolverFailed: no equilibrium was found.
        BadInput: the component is unknown, or the loads are missing or not numbers.
        ValueError: ``state`` or ``method`` is unknown.
    """
    check_method(method)
    if state not in {"contact", "exact"}:
        raise ValueError(
            f"deflection_curve: found state {state!r}, expected 'contact' or 'exact'"
        )
    if component not in range(6) or not len(loads):
        raise BadInput(
            f"deflection_curve: found component {component} and {len(loads)} loads, "
            "expected a component from 0 to 5 and at least one load"
        )
    rest = np.zeros(6) if load is None else one_load(load)
    loads = numbers_of("loads", loads, len(loads), "N m or N").tolist()
    largest = float(np.abs(loads).max(initial=0.0))

    def at(value: float, near: _Point | None) -> _Point:
        wrench = rest.copy()
        wrench[component] = value
        what = f"steps at load {value:.6g}"
        return _solve(
            posture, value, wrench, gravity, state == "exact", near,
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
        return _Point(value, linear, in_contact(linear, "unloading"), names)
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
    # omit contacts whose forces are round-off
    active &= force > _CARRIES * force.max(initial=0.0)
    names = clearance_names(equilibrium.expansion.placement.model.joints, active)
    return _Point(value, equilibrium, exact_tangent(equilibrium, "unloading"), names)


def _settled(
    point: _Point, largest: float, rest: NDArray, gravity: ArrayLike | None,
    method: Method,
) -> tuple[NDArray, bool]:  # fmt: skip
    """Return the platform screw, and whether the pose is undetermined.

    Of all possible poses, the pose nearest to nominal is returned.
    """
    equilibrium = point.equilibrium
    others = rest.any() or gravity is not None or driven(equilibrium.posture.robot)
    idle = not others and abs(point.load) <= _NO_LOAD * largest
    if idle and isinstance(equilibrium, Assembly):
        nearest, open_ = nearest_pose(equilibrium, np.zeros(3), method)
        return nearest.platform_screw, open_
    return equilibrium.platform_screw, bool(point.tangent.free.shape[1])


def clearance_names(joints: VirtualJoints, marked: NDArray) -> frozenset[str]:
    """Return the names of selected clearances, such as ``"leg1.elbow radial"``.

    Args:
        joints: virtual joints with clearances.
        marked: (cones,) bool, True for the selected clearances.

    Returns:
        The names.
    """
    names = set()
    for k in np.flatnonzero(marked):
        columns = joints.cones[:, joints.group == k]
        row = int(columns.any(axis=1).argmax()) // 6
        names.add(f"{shown_name(joints.robot, row)} {bound_name(columns)}")
    return frozenset(names)


def _events(
    before: _Point, after: _Point, at: _Solver, component: int, most: int = _CHANGES
) -> list[Event]:
    """Find the events between two successive loads."""
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
        if _jumps(low, high, component):  # otherwise the motion is large but continuous
            way = numbers(
                high.equilibrium.platform_screw - low.equilibrium.platform_screw
            )
            events.append(_event(high, "jump", f"by {way} rad, m", component))
    return events


def _event(point: _Point, kind: str, what: str, component: int) -> Event:
    """Return an event at a point of the curve."""
    moved = float(point.equilibrium.platform_screw[component])
    return Event(point.load, kind, what, moved)


def _bracket(
    low: _Point, high: _Point, at: _Solver, same: Callable[[_Point], bool]
) -> tuple[_Point, _Point]:
    """Return equilibria at two close loads between which a property changes."""
    for _ in range(_HALVINGS):
        try:
            middle = at((low.load + high.load) / 2, low)
        except SolverFailed:
            break  # The change of contact is too small to locate.
        low, high = (middle, high) if same(middle) else (low, middle)
    return low, high


def _apart(one: _Point, other: _Point) -> float:
    """Return the distance [m] between platform poses.

    Rotations are multiplied by the characteristic length.
    """
    change = other.equilibrium.platform_screw - one.equilibrium.platform_screw
    return float(np.linalg.norm(change * np.repeat([one.tangent.length, 1.0], 3)))


def _jumps(before: _Point, after: _Point, component: int) -> bool:
    """Return whether the platform moves much farther than tangents predict."""
    scale = np.repeat([before.tangent.length, 1.0], 3)
    farthest = max(
        float(np.linalg.norm(scale * p.tangent.compliance[component]))
        for p in (before, after)
    )
    step = abs(after.load - before.load)
    apart = _apart(before, after)
    moved = apart > _STILL * before.tangent.length
    return moved and apart > _JUMP * step * farthest  # a free platform does not jump


def _mode(point: _Point) -> str:
    """Return a description of the mode with negative stiffness."""
    tangent = point.tangent
    soft = int(np.flatnonzero(tangent.signs < 0)[0])
    return "buckles: " + mode_text(
        tangent.root, soft, tangent.springs[:, soft], tangent.parts, tangent.length
    )


def mode_text(
    screws: NDArray, mode: int, springs: NDArray, parts: Sequence[Part], length: float
) -> str:
    """Return a description of a mode.

    Args:
        screws: (6, k) [rad, m] screws of the platform in all modes, with a common
            factor.
        mode: index of the mode.
        springs: (m,) [sqrt(2 J)] deformations of the springs in this mode.
        parts: (m,) link or joint to which each spring belongs.
        length: [m] characteristic length, by which rotations are multiplied.

    Returns:
        Text with the unit screw of the platform and the link or joint that deforms
        most.
    """
    part = parts[largest_row(np.square(springs))]
    scale, screw = np.repeat([length, 1.0], 3), screws[:, mode]
    sizes = np.linalg.norm(screws * scale[:, None], axis=0)
    size = sizes[mode]
    if size <= _STAYS * sizes.max():
        return (
            "no motion of the platform, largest deformation in "
            f"{part.frame} {part.kind}"
        )
    way = np.where(np.abs(screw) * scale > 1e-6 * size, screw / (size or 1.0), 0.0)
    return (
        f"platform motion {numbers(way)} rad, m, largest deformation in "
        f"{part.frame} {part.kind}"
    )
