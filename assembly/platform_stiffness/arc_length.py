r"""Arc-length continuation of the load-deflection path beyond limit points.

At a maximum of the load (a limit point), no nearby equilibrium exists for larger loads.
The load lambda is therefore treated as an unknown, and the path (x, lambda) is computed
in steps of given arc length.  Each step consists of a prediction along the tangent to
the path and of Newton corrections perpendicular to this tangent,

        [ Z'HZ   -Z'q ] [ t       ]     [ unbalanced force       ]
        [ tau_x   tau ] [ dlambda ] = - [ error of the arc length ].

The columns of Z span the motions that satisfy the loop-closure equations, H is the
exact second derivative of the potential, q the work of a unit load, and tau the
direction of the step.  Both stable and unstable equilibria are found.  Clearances are
fixed at zero.

The load is critical if an eigenvalue of Z'HZ changes sign.  Either the load has an
extremum there (limit point), or a second path branches off, as for a buckled column.
The second path is not computed.  Z excludes motions without stiffness and load, such as
the spin of a rod between two ball joints.

Sources:
    Riks (1979), An incremental approach to the solution of snapping and buckling
    problems; Crisfield (1991), Non-linear Finite Element Analysis of Solids and
    Structures, chapter 9.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.dead_load import dead_loads, work_gradient
from forcefit.assembly.exact.descent import Expansion, NotConverged, energy_of, expand
from forcefit.assembly.exact.equilibrium import curvature_modes
from forcefit.assembly.exact.exact import ExactAssembly, solve_exact
from forcefit.assembly.exact.placement import place
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.platform_stiffness.deflection import (
    DeflectionCurve,
    Event,
    Progress,
    mode_text,
)
from forcefit.assembly.platform_stiffness.exact_tangent import (
    FLAT,
    part_owners,
    platform_moves,
)
from forcefit.assembly.platform_stiffness.matrices import Part
from forcefit.assembly.solvers.method import Method, check_method

_STEPS = 400  # maximum number of steps along a path
_CORRECTIONS = 8  # maximum number of Newton corrections in a step
_CLOSED = 1e-10  # [-] convergence tolerance on the arc length of a correction
_SMALLEST = 1e-6  # [-] minimum step length, relative to the first step
_HALVINGS = 20  # number of bisections to locate a critical load within a step


@dataclass(frozen=True, eq=False)
class _Place:
    """An equilibrium on the load-deflection path.

    Attributes:
        load: [N or N m] load at the equilibrium.
        local: expansion of the problem at the equilibrium.
        motion: (N,) derivative of the unknowns with respect to arc length.
        rise: [N or N m] derivative of the load with respect to arc length.
        curvatures: (k,) second derivatives of the potential along the modes, in
            ascending order.  Only their signs are used.
        modes: (N, k) modes of the potential.
    """

    load: float
    local: Expansion
    motion: NDArray
    rise: float
    curvatures: NDArray
    modes: NDArray

    @property
    def unstable(self) -> int:
        """Number of modes with negative curvature."""
        return int((self.curvatures < 0).sum())


@dataclass(frozen=True, eq=False)
class _Path:
    """A load-deflection path, with the definition of its arc length.

    Attributes:
        posture: posture of the robot without clearance, with divided beams.
        component: component of the load that varies.
        rest: (6,) [N m, N] constant components of the load.
        gravity: (3,) [m/s^2] gravity vector, or None.
        weight: factor w of the arc length s, ds^2 = w |dx|^2 + (dload / range)^2.
        range: [N or N m] difference between the first and the last load.
        parts: link or joint to which each spring belongs.
        idle: number of free motions on which no load acts.
    """

    posture: Posture
    component: int
    rest: NDArray
    gravity: ArrayLike | None
    weight: float
    range: float
    parts: tuple[Part, ...]
    idle: int = 0

    def expand(self, x: NDArray, load: float, model: Expansion) -> Expansion:
        """Expand the problem at a placement, under a load."""
        wrench = self.rest.copy()
        wrench[self.component] = load
        placement = place(model.placement.model, x)
        loads = dead_loads(self.posture, wrench, gravity=self.gravity)
        return expand(placement, loads, np.zeros(len(placement.residual)))

    def reference_load(self, local: Expansion) -> NDArray:
        """Return the work of a unit load per unit of each unknown, (N,)."""
        unit = dead_loads(self.posture, np.eye(6)[self.component])
        unit = replace(unit, drives=0 * unit.drives)
        return work_gradient(local.placement, unit)

    def covector(self, local: Expansion, motion: NDArray) -> NDArray:
        """Return the inner product of a motion with each unknown, (N,)."""
        return self.weight * motion / local.placement.model.units**2

    def modes(self, local: Expansion) -> tuple[NDArray, NDArray]:
        """Return the curvatures of the potential in ascending order, and the modes."""
        B, units = local.basis, local.placement.model.units
        values, motions = curvature_modes(B, B.T @ local.hessian @ B, units)
        kept = np.sort(np.argsort(np.abs(values))[self.idle :])
        return values[kept], motions[:, kept]


def follow_load(
    posture: Posture,
    component: int,
    first: float,
    last: float,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    count: int = 20,
    progress: Progress = lambda what, done, most: None,
    method: Method = "compiled",
) -> DeflectionCurve:
    """Compute the path of equilibria until the load reaches a given value.

    Args:
        posture: the robot's configuration with its errors; clearances are fixed at
            zero.
        component: component of the load that varies, 0 to 5.
        first: [N m or N] first load of the path.
        last: [N m or N] last load of the path.
        load: (6,) [N m, N] constant components of the load.
        gravity: (3,) [m/s^2] gravity vector in base axes.
        count: reciprocal of the first step's arc length.  Later steps are at most twice
            as long.
        progress: function called with the current and the maximum number of points.
        method: method for the first equilibrium.  The other equilibria are computed in
            numpy.

    Returns:
        The curve.  Its events are the ``"critical"`` loads with their modes.

    Raises:
        CannotAssemble: the loops cannot be closed with these errors.
        FreeMotion: a load acts on a motion without stiffness.
        NotConverged: no equilibrium was found at the first load or along the path.
            The class is derived from :class:`SolverFailed`.
        ValueError: the method is unknown.
    """
    check_method(method)
    frames = (replace(f, clearance=None) for f in posture.robot.frames)
    tight = replace(posture, robot=replace(posture.robot, frames=tuple(frames)))
    rest = np.zeros(6) if load is None else np.array(load, dtype=float)
    rest[component] = first
    start = solve_exact(tight, rest, gravity=gravity, method=method)
    # this call raises FreeMotion if the load acts on a motion without stiffness
    solve_assembly(tight, np.eye(6)[component], method=method)
    span = abs(last - first)
    cut = start.cut.cut(tight)
    path = _Path(cut, component, rest, gravity, 1.0, span, part_owners(start))
    place, path = _begin(path, start, first, last)
    places, events, step, longest = [place], [], 1.0 / count, 2.0 / count
    while len(places) < _STEPS and abs(places[-1].load - first) <= span:
        progress("points of the path", len(places), _STEPS)
        there, corrections = _advance(path, places[-1], step)
        if there is None:
            step /= 2
            if step < _SMALLEST / count:
                raise NotConverged(
                    f"path of {posture.robot.name}",
                    f"no equilibrium was found after the load {places[-1].load:.6g}",
                )
            continue
        if there.unstable != places[-1].unstable:
            events.append(_critical(path, places[-1], there, step))
        places.append(there)
        grown = 1.5 if corrections <= 3 else 0.7 if corrections > 5 else 1.0
        step = min(longest, step * grown)
    return _curve(path, tight, places, events, method)


def _begin(
    path: _Path, start: ExactAssembly, first: float, last: float
) -> tuple[_Place, _Path]:
    """Return the first equilibrium with its tangent, and the path to be computed."""
    local = start.expansion
    values, _ = path.modes(local)
    flat = np.abs(values) <= FLAT * np.abs(values).max(initial=0.0)
    path = replace(path, idle=int(flat.sum()))
    values, Z = path.modes(local)
    motion = Z @ ((Z.T @ path.reference_load(local)) / values)
    size = np.linalg.norm(motion / local.placement.model.units) * path.range
    weight = 1.0 / (size or 1.0) ** 2  # the size is zero if the robot is rigid
    # the load and the unknowns contribute equally to the squared arc length
    rise = path.range / np.sqrt(2.0) * np.sign(last - first)
    place = _Place(first, local, motion * rise, float(rise), values, Z)
    return place, replace(path, weight=float(weight))


def _advance(path: _Path, place: _Place, step: float) -> tuple[_Place | None, int]:
    """Return the next equilibrium, or None, and the number of Newton corrections."""
    x0, load = place.local.placement.x, place.load
    x = x0 + step * place.motion
    load = load + step * place.rise
    normal_to = path.covector(place.local, place.motion)
    rise = place.rise / path.range**2
    for count in range(1, _CORRECTIONS + 1):
        local = path.expand(x, load, place.local)
        values, Z = path.modes(local)
        closing = np.zeros(len(x))
        closing[local.unbounded] = -local.inverse @ local.placement.residual
        left = Z.T @ (local.gradient + local.hessian @ closing)
        long_of = normal_to @ (x + closing - x0) + rise * (load - place.load) - step
        tangent = np.append(normal_to @ Z, rise)
        change = _solve(path, local, (values, Z), tangent, np.append(left, long_of))
        if change is None:
            return None, count
        moved = closing + Z @ change[:-1]
        x, load = x + moved, load + change[-1]
        size = np.sqrt(
            path.covector(local, moved) @ moved + (change[-1] / path.range) ** 2
        )
        if not size < 1.0:
            return None, count
        if size <= _CLOSED:
            local = path.expand(x, load, place.local)
            return _oriented(path, local, float(load), normal_to, rise), count
    return None, _CORRECTIONS


def _solve(
    path: _Path, local: Expansion, modes: tuple[NDArray, NDArray], tangent: NDArray,
    left: NDArray,
) -> NDArray | None:  # fmt: skip
    """Return the Newton correction of the modes and of the load."""
    values, Z = modes
    M = np.zeros((len(left), len(left)))
    M[:-1, :-1] = np.diag(values)
    M[:-1, -1] = -(Z.T @ path.reference_load(local))
    M[-1] = tangent
    try:
        return np.linalg.solve(M, -left)
    except np.linalg.LinAlgError:
        return None


def _oriented(
    path: _Path, local: Expansion, load: float, normal_to: NDArray, rise: float
) -> _Place | None:
    """Return an equilibrium with the unit tangent to the path."""
    values, Z = path.modes(local)
    left = np.zeros(len(values) + 1)
    left[-1] = -1.0
    way = _solve(path, local, (values, Z), np.append(normal_to @ Z, rise), left)
    if way is None:
        return None
    motion = Z @ way[:-1]
    length = np.sqrt(
        path.covector(local, motion) @ motion + (way[-1] / path.range) ** 2
    )
    rise = float(way[-1] / length)
    return _Place(load, local, motion / length, rise, values, Z)


def _critical(path: _Path, low: _Place, high: _Place, step: float) -> Event:
    """Return the critical load between two points, and its mode."""
    start, short, long_ = low, 0.0, step
    for _ in range(_HALVINGS):
        middle, _ = _advance(path, start, (short + long_) / 2)
        if middle is None:
            break  # the equations are singular, for example at a branch point
        if middle.unstable == start.unstable:
            low, short = middle, (short + long_) / 2
        else:
            high, long_ = middle, (short + long_) / 2
    turns = low.rise * high.rise < 0
    # the curvature of the critical mode is the negative one nearest to zero
    more = high if high.unstable > low.unstable else low
    soft = more.unstable - 1
    bent = more.modes[:, soft]
    what = "limit point, an extremum of the load" if turns else "branch point, buckles"
    model = more.local.placement.model
    words = mode_text(
        platform_moves(more.local) @ more.modes, soft, bent[model.springs],
        path.parts, model.size,
    )  # fmt: skip
    moved = float(high.local.placement.platform_screw[path.component])
    return Event(high.load, "critical", f"{what}: {words}", moved)


def _curve(
    path: _Path, posture: Posture, places: list[_Place], events: list[Event],
    method: Method,
) -> DeflectionCurve:  # fmt: skip
    """Return the load-deflection curve of these points and events."""
    screws = np.array([p.local.placement.platform_screw for p in places])
    moved = [p.local.placement.platform_rows[path.component] @ p.motion for p in places]
    with np.errstate(divide="ignore"):
        slopes = np.array([p.rise for p in places]) / np.array(moved)
    return DeflectionCurve(
        posture=posture,
        component=path.component,
        loads=np.array([p.load for p in places]),
        screws=screws,
        energies=np.array([energy_of(p.local.placement) for p in places]),
        stiffness=slopes,
        pressed=(frozenset(),) * len(places),
        open_=np.zeros(len(places), dtype=bool),
        events=tuple(events),
        method=method,
    )
