"""The virtual-joint model against the multibody simulation of the same robot.

The virtual-joint model is linear in the errors, the simulation is not.  If the linear
model is right, what separates them is of second order: as the errors and the load are
scaled by s, the pose difference falls as s^2, a slope of 2 in a log-log plot, and every
quantity of the simulation, divided by its power of s and extrapolated to s = 0, is the
linear model's.  A wrong term of first order, even of a thousandth, bends the slope and
moves the limit.

Joint clearances are left out on both sides: passive joints move freely along their z.

======  ===============  =============================================================
symbol  code             meaning
======  ===============  =============================================================
s       ``scale``        factor on geometric errors and load
slope   ``slopes``       of log difference over log scale, as s goes to 0
limit   ``limits``       quantity / s^p extrapolated to s = 0, relative difference
======  ===============  =============================================================
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.conic import SolverFailed
from assembly.energy import Assembly, CannotAssemble, solve_assembly
from assembly.links import link_compliance
from assembly.posture import Posture
from assembly.reduction import FreeMotion
from assembly.robot import BeamLink, Clearance, Frame, Robot
from stiffness.reading import BadInput
from validation.multibody import (
    MultibodyAssembly,
    SimulationFailed,
    simulate_assembly,
    without_clearance,
)

SCALES = (1.0, 0.5, 0.25, 0.125)
SLOPE_TOLERANCE = 0.1  # of the pose difference, around 2
LIMIT_TOLERANCE = 1e-3  # relative, of every quantity extrapolated to no error
FLOOR = {"rotation": 1e-10, "translation": 1e-11}  # [rad], [m] what simulations resolve
_HALVES = {"rotation": slice(0, 3), "translation": slice(3, 6)}


@dataclass(frozen=True, eq=False)
class Pair:
    """Both answers at one scale.

    Attributes:
        scale: factor on errors and load.
        linear: the virtual-joint model's answer.
        simulated: the simulation's.
    """

    scale: float
    linear: Assembly
    simulated: MultibodyAssembly

    @property
    def screw_difference(self) -> NDArray:
        """(6,) [rad, m] platform screw, simulated minus linear."""
        return self.simulated.platform_screw - self.linear.platform_screw

    def table(self, robot: Robot) -> dict[str, Any]:
        """Both answers and their differences, by name; see the public format."""
        linear, simulated = self.linear, self.simulated
        vjm = {
            "platform_screw": linear.platform_screw,
            "energy": linear.energy,
            "links": _named(robot, "link", linear.wrenches),
            "joints": _named(robot, "joint_stiffness", linear.wrenches),
        }
        multibody = {
            "platform_screw": simulated.platform_screw,
            "energy": simulated.energy,
            "links": _named(robot, "link", simulated.link_wrenches),
            "joints": _named(robot, "joint_stiffness", simulated.joint_wrenches),
        }
        difference = {
            "platform_screw": self.screw_difference,
            "energy": simulated.energy - linear.energy,
            "links": _named(robot, "link", simulated.link_wrenches - linear.wrenches),
            "joints": _named(
                robot, "joint_stiffness", simulated.joint_wrenches - linear.wrenches
            ),
        }
        check = {"closure_gap": simulated.gap, "seconds": simulated.seconds}
        return {
            "scale": self.scale,
            "vjm": vjm,
            "multibody": multibody | check,
            "difference": difference,
        }


def _named(robot: Robot, part: str, rows: NDArray) -> dict[str, NDArray]:
    """Rows of the frames that have a part, by name."""
    return {
        frame.name: row
        for frame, row in zip(robot.frames, rows, strict=True)
        if getattr(frame, part) is not None
    }


@dataclass(frozen=True, eq=False)
class Crosscheck:
    """A robot at one posture, solved twice at several scales of its errors.

    Attributes:
        posture: nominal, of the robot without clearances.
        load: (6,) [N m, N] on the platform at scale 1, base axes.
        links: how the simulation modelled links, ``"beam"`` or ``"spring"``.
        pairs: one for each scale, largest first.
    """

    posture: Posture
    load: NDArray
    links: str
    pairs: tuple[Pair, ...]

    @property
    def scales(self) -> NDArray:
        """(k,) factors, largest first."""
        return np.array([pair.scale for pair in self.pairs])

    @cached_property
    def differences(self) -> dict[str, NDArray]:
        """(k,) norm of the pose difference, ``rotation`` [rad], ``translation`` [m]."""
        screws = np.array([pair.screw_difference for pair in self.pairs])
        return {
            name: np.linalg.norm(screws[:, half], axis=1)
            for name, half in _HALVES.items()
        }

    @cached_property
    def slopes(self) -> dict[str, float]:
        """Slope of each difference; NaN where only the solver's noise is left."""
        return {
            name: fit_slope(self.scales, values, FLOOR[name])
            for name, values in self.differences.items()
        }

    @property
    def slope(self) -> float:
        """The slope farther from 2; NaN where nothing separates the two."""
        known = [s for s in self.slopes.values() if not math.isnan(s)]
        return max(known, key=lambda s: abs(s - 2.0)) if known else math.nan

    @cached_property
    def limits(self) -> dict[str, float]:
        """Difference of each quantity, extrapolated to no error, relative to its size.

        Screws and wrenches are compared by halves, each relative to the largest among
        all frames that have such a spring; nothing is asked below :data:`FLOOR` and
        what it does to the stiffest spring.
        """
        ours = np.array([p.linear.platform_screw for p in self.pairs])
        theirs = np.array([p.simulated.platform_screw for p in self.pairs])
        limits = {}
        for name, half in _HALVES.items():
            value = limit_difference(
                self.scales, ours[:, half], theirs[:, half], 1, FLOOR[name]
            )
            limits[f"platform {name}"] = value
        return limits | spring_limits(self.posture.robot, self.pairs)

    @cached_property
    def checks(self) -> dict[str, tuple[float, float]]:
        """What must hold: by name a value and its bound."""
        slopes = {
            f"slope of {name} from 2": (abs(slope - 2.0), SLOPE_TOLERANCE)
            for name, slope in self.slopes.items()
            if not math.isnan(slope)
        }
        limits = {
            f"limit of {name}": (value, LIMIT_TOLERANCE)
            for name, value in self.limits.items()
        }
        return slopes | limits

    @property
    def passed(self) -> bool:
        """Whether every check holds."""
        return all(value <= bound for value, bound in self.checks.values())

    def table(self) -> dict[str, Any]:
        """Everything ``validation crosscheck`` reports, keys of the public format."""
        return {
            "robot": self.posture.robot.name,
            "status": "ok",
            "pose": self.posture.pose(),
            "load": self.load,
            "links": self.links,
            "clearances": "left out on both sides",
            "scales": [pair.table(self.posture.robot) for pair in self.pairs],
            "slope": self.slope,
            "slopes": self.slopes,
            "limits": self.limits,
            "checks": {
                name: {"value": value, "tolerance": bound, "passed": value <= bound}
                for name, (value, bound) in self.checks.items()
            },
            "passed": self.passed,
        }

    def header(self) -> list[str]:
        """Names of the columns of :meth:`rows`."""
        return [
            "scale of the errors",
            "rotation difference [rad]",
            "translation difference [m]",
            "energy, simulated [J]",
            "energy, linear [J]",
        ]

    def rows(self) -> list[list[str]]:
        """One row for each scale, as text."""
        differences = zip(*self.differences.values(), strict=True)
        return [
            [
                f"{pair.scale:.4g}",
                f"{turn:.3e}",
                f"{shift:.3e}",
                f"{pair.simulated.energy:.6g}",
                f"{pair.linear.energy:.6g}",
            ]
            for pair, (turn, shift) in zip(self.pairs, differences, strict=True)
        ]


def crosscheck(
    posture: Posture,
    scales: Sequence[float] = SCALES,
    load: ArrayLike | None = None,
    links: str = "beam",
) -> Crosscheck:
    """Solve a robot with both models at several scales of its errors.

    Args:
        posture: where the robot stands; its clearances are left out.
        scales: at least two different factors on errors and load, > 0.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        links: ``"beam"``: beams bend geometrically exactly; ``"spring"``: every link
            is its K_E in the simulation too, which checks everything but the beams.

    Returns:
        Both answers at every scale, and the verdict.

    Raises:
        BadInput: too few scales, or one that is not positive.
        SimulationFailed: the simulation found no equilibrium.
        CannotAssemble: the virtual-joint model has none.
        FreeMotion: the load drives a motion that nothing resists.
    """
    factors = check_scales(scales)
    tight = replace(posture, robot=without_clearance(posture.robot))
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    stiffness = link_stiffnesses(tight.robot, links)
    pairs = []
    for s in factors:
        linear = solve_assembly(scaled(tight, s), s * wrench)
        simulated = simulate_assembly(tight, s, links, stiffness, s * wrench)
        pairs.append(Pair(s, linear, simulated))
    return Crosscheck(tight, wrench, links, tuple(pairs))


def scaled(posture: Posture, scale: float) -> Posture:
    """The same posture with all imperfections times a factor.

    Args:
        posture: nominal.
        scale: on geometric errors and clearances.

    Returns:
        A posture of another robot.
    """

    def smaller(frame: Frame) -> Frame:
        given = frame.clearance
        if given is not None:
            bounds = {k: v if v is None else scale * v for k, v in vars(given).items()}
            given = Clearance(**bounds)
        error = scale * frame.geometric_error
        return replace(frame, geometric_error=error, clearance=given)

    frames = tuple(smaller(frame) for frame in posture.robot.frames)
    return replace(posture, robot=replace(posture.robot, frames=frames))


def spring_limits(robot: Robot, pairs: Sequence[Pair]) -> dict[str, float]:
    """Differences of springs and energy, extrapolated to no error.

    Args:
        robot: whose links and joint springs are looked at.
        pairs: both answers at several scales.

    Returns:
        By name, relative to the largest among all links or all joints; see
        :func:`limit_difference`.
    """
    scales = np.array([pair.scale for pair in pairs])
    stiff = _stiffest(robot)
    screw = np.array(list(FLOOR.values()))
    limits = {}
    for kind, part in (("link", "link"), ("joint", "joint_stiffness")):
        rows = [getattr(frame, part) is not None for frame in robot.frames]
        if not any(rows):
            continue
        for what, linear, floor, labels in (
            ("screws", f"{kind}_screws", screw, ("rotation", "translation")),
            ("wrenches", "wrenches", stiff * screw, ("moment", "force")),
        ):
            ours = np.array([getattr(p.linear, linear)[rows] for p in pairs])
            name = f"{kind}_{what}"
            theirs = np.array([getattr(p.simulated, name)[rows] for p in pairs])
            for label, half, least in zip(labels, _HALVES.values(), floor, strict=True):
                limits[f"{kind} {label}"] = limit_difference(
                    scales, ours[..., half], theirs[..., half], 1, least
                )
    ours = np.array([pair.linear.energy for pair in pairs])
    theirs = np.array([pair.simulated.rigid_energy for pair in pairs])
    least = float((stiff * screw**2).max())
    return limits | {"energy": limit_difference(scales, ours, theirs, 2, least)}


def limit_difference(
    scales: NDArray, ours: NDArray, theirs: NDArray, power: int, floor: float
) -> float:
    """Largest difference as the scale goes to 0, relative to the largest value.

    Args:
        scales: (k,) all different.
        ours: (k, ...) values that fall as a power of the scale.
        theirs: (k, ...) values to compare.
        power: of the scale.
        floor: differences below it, in the values' unit, are noise.

    Returns:
        [-] at most :data:`LIMIT_TOLERANCE` if only noise is left.
    """
    weight = scales.reshape(-1, *[1] * (ours.ndim - 1)) ** -float(power)
    gap = np.abs(extrapolate(scales, (theirs - ours) * weight)).max()
    size = max(np.abs(ours * weight).max(), floor / LIMIT_TOLERANCE)
    return float(gap / size) if size > 0 else float(gap)


def check_scales(scales: Sequence[float]) -> list[float]:
    """Scales from which a slope can be read, largest first.

    Args:
        scales: factors on errors, clearances and load.

    Returns:
        Those that differ, sorted.

    Raises:
        BadInput: fewer than two, or one that is not finite and > 0.
    """
    factors = sorted({float(s) for s in scales}, reverse=True)
    if len(factors) < 2 or not all(0 < s < np.inf for s in factors):
        raise BadInput(
            f"scale: found {list(scales)}, expected at least two different factors > 0"
        )
    return factors


def link_stiffnesses(robot: Robot, links: str) -> Mapping[str, NDArray]:
    """K_E of the links that a simulation will model as springs.

    Args:
        robot: any.
        links: ``"beam"``, where beams need none, or ``"spring"``.

    Returns:
        By frame, (6, 6) [N m/rad .. N/m] in its axes.
    """
    return {
        frame.name: _stiffness(frame)
        for frame in robot.frames
        if frame.link is not None
        and (links == "spring" or not isinstance(frame.link, BeamLink))
    }


def _stiffest(robot: Robot) -> NDArray:
    """(2,) [N m/rad, N/m] the largest stiffness of any spring to turns and shifts."""
    diagonals = [np.zeros(6)]
    diagonals += [np.diag(_stiffness(f)) for f in robot.frames if f.link is not None]
    joints = [f.joint_stiffness for f in robot.frames if f.joint_stiffness is not None]
    diagonals += [np.diag(np.where(np.isfinite(K), K, 0.0)) for K in joints]
    return np.max(diagonals, axis=0).reshape(2, 3).max(axis=1)


def _stiffness(frame: Frame) -> NDArray:
    """(6, 6) [N m/rad .. N/m] K_E of a frame's link."""
    return np.linalg.inv(link_compliance(frame))


def fit_slope(scales: ArrayLike, values: ArrayLike, floor: float) -> float:
    """Slope of a log-log line as the scale goes to 0.

    Of three values and more, a power of the scale times ``exp(k scale)`` is fitted:
    where a second-order term happens to be small, the third-order one bends the line
    at large scales, and the power alone would be off by 0.1 and more.

    Args:
        scales: (k,) > 0.
        values: (k,) >= 0.
        floor: values below it are noise and are left out.

    Returns:
        d log value / d log scale, NaN if fewer than two values are left.
    """
    scales, values = np.asarray(scales), np.asarray(values)
    clear = values > floor
    scales, values = scales[clear], values[clear]
    if len(values) < 2:
        return math.nan
    columns = [np.log(scales), np.ones(len(scales)), scales][: len(scales)]
    fit = np.linalg.lstsq(np.transpose(columns), np.log(values))
    return float(fit[0][0])


def extrapolate(scales: NDArray, values: NDArray) -> NDArray:
    """Value at scale 0 of the polynomial through all points, by Neville's scheme.

    Args:
        scales: (k,) all different.
        values: (k, ...) at these scales.

    Returns:
        (...) the limit; its error is of the order of the product of the scales.
    """
    table = [np.asarray(v, dtype=float) for v in values]
    for step in range(1, len(table)):
        for i in range(len(table) - step):
            near, far = scales[i + step], scales[i]
            table[i] = (far * table[i + 1] - near * table[i]) / (far - near)
    return table[0]


def try_crosscheck(
    posture: Posture,
    scales: Sequence[float] = SCALES,
    load: ArrayLike | None = None,
    links: str = "beam",
) -> tuple[Crosscheck | None, dict[str, Any]]:
    """A cross-check, or why there is none, for sweeps and the command line.

    Args:
        posture: as in :func:`crosscheck`, like the other arguments.
        scales: factors on errors and load.
        load: (6,) [N m, N] on the platform.
        links: how the simulation models links.

    Returns:
        The cross-check and nothing, or None and ``status``, ``reason``, ``passed`` and
        a null ``slope``.
    """
    try:
        return crosscheck(posture, scales, load, links), {}
    except SimulationFailed as error:
        status, reason = "simulation failed", str(error)
    except CannotAssemble as error:
        status, reason = "cannot assemble", str(error)
    except FreeMotion as error:
        status, reason = "no equilibrium", str(error)
    except SolverFailed as error:
        status, reason = "solver failed", str(error)
    robot = posture.robot.name
    failure = {"robot": robot, "status": status, "reason": reason}
    return None, failure | {"scales": [], "slope": None, "passed": False}


def crosscheck_text(answer: Crosscheck) -> str:
    """A cross-check for people: a table and the verdict.

    Args:
        answer: of :func:`crosscheck`.

    Returns:
        Text without colours.
    """
    name = answer.posture.robot.name
    lines = [f"{name}, without clearances: simulation minus virtual-joint model"]
    lines += ["  ".join(f"{cell:>26}" for cell in row)
              for row in (answer.header(), *answer.rows())]  # fmt: skip
    for check, (value, bound) in answer.checks.items():
        word = "ok" if value <= bound else "FAILS"
        lines.append(f"{check}: {value:.1e} (bound {bound:g}) {word}")
    return "\n".join([*lines, "passed" if answer.passed else "FAILED"])
