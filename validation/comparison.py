"""Two answers side by side, at several scales of a robot's imperfections.

======  ===============  =============================================================
symbol  code             meaning
======  ===============  =============================================================
s       ``scale``        factor on geometric errors, clearances and load
slope   ``fit_slope``    of log difference over log scale, as s goes to 0
limit   ``limit_*``      difference / s^p extrapolated to s = 0, relative
======  ===============  =============================================================
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.conic import SolverFailed
from assembly.energy import Assembly
from assembly.exact import ExactAssembly, solve_exact
from assembly.links import link_compliance
from assembly.posture import Posture
from assembly.reduction import FreeMotion
from assembly.robot import BeamLink, Clearance, Frame, Robot
from stiffness.reading import BadInput
from validation.exudyn_parts import MeshBody
from validation.multibody import MultibodyAssembly
from validation.solids import mesh_bodies

SCALES = (1.0, 0.5, 0.25, 0.125)
LIMIT_TOLERANCE = 1e-3  # relative, of every quantity extrapolated to no error
FLOOR = {"rotation": 1e-10, "translation": 1e-11}  # [rad], [m] what simulations resolve
KINDS = ("beam", "spring", "fem")
HALVES = {"rotation": slice(0, 3), "translation": slice(3, 6)}


@dataclass(frozen=True, eq=False)
class Pair:
    """Both answers at one scale.

    Attributes:
        scale: factor on errors and load.
        linear: the virtual-joint model's answer.
        simulated: the simulation's.
        exact: the virtual-joint model with finite rotations, None if it gave up.
    """

    scale: float
    linear: Assembly
    simulated: MultibodyAssembly
    exact: ExactAssembly | None

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
            "joints": _named(robot, "joint_stiffness", linear.joint_wrenches),
        }
        multibody = {
            "platform_screw": simulated.platform_screw,
            "energy": simulated.energy,
            "links": _named(robot, "link", simulated.link_wrenches),
            "joints": _named(robot, "joint_stiffness", simulated.joint_wrenches),
        }
        joints = simulated.joint_wrenches - linear.joint_wrenches
        difference = {
            "platform_screw": self.screw_difference,
            "energy": simulated.energy - linear.energy,
            "links": _named(robot, "link", simulated.link_wrenches - linear.wrenches),
            "joints": _named(robot, "joint_stiffness", joints * sprung(robot)),
        }
        check = {"closure_gap": simulated.gap, "seconds": simulated.seconds}
        exact = self.exact and {
            "platform_screw": self.exact.platform_screw,
            "energy": self.exact.energy,
            "links": _named(robot, "link", self.exact.wrenches),
            "joints": _named(robot, "joint_stiffness", self.exact.wrenches),
        }
        return {
            "scale": self.scale,
            "vjm": vjm,
            "exact_vjm": exact,
            "multibody": multibody | check,
            "difference": difference,
        }


def sprung(robot: Robot) -> NDArray:
    """Where joints have springs: in rigid directions the simulation has no wrench.

    Args:
        robot: of n frames.

    Returns:
        (n, 6) 1 where K_B is finite, else 0.
    """
    rows = np.zeros((len(robot.frames), 6))
    for row, frame in zip(rows, robot.frames, strict=True):
        if frame.joint_stiffness is not None:
            row[:] = np.isfinite(np.diag(frame.joint_stiffness))
    return rows


def _named(robot: Robot, part: str, rows: NDArray) -> dict[str, NDArray]:
    """Rows of the frames that have a part, by name."""
    return {
        frame.name: row
        for frame, row in zip(robot.frames, rows, strict=True)
        if getattr(frame, part) is not None
    }


def exact_answer(linear: Assembly) -> ExactAssembly | None:
    """The answer with finite rotations near a linear one; None if none was found."""
    joints = linear.joints
    if not any(A.shape[1] for A in (joints.elastic, joints.cones, joints.free)):
        return None  # nothing can move
    try:
        return solve_exact(linear.posture, linear.load, linear)
    except (SolverFailed, FreeMotion):
        return None


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


def spring_limits(
    robot: Robot, pairs: Sequence[Pair], spread: bool = False
) -> dict[str, float]:
    """Differences of springs and energy, extrapolated to no error.

    Args:
        robot: whose links and joint springs are looked at.
        pairs: both answers at several scales.
        spread: loads act between the links' ends: what they store and carry there
            is not in the linear model, and links' wrenches and energy are left out.

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
        wrench = "wrenches" if kind == "link" else "joint_wrenches"
        compared = [("screws", f"{kind}_screws", screw, ("rotation", "translation"))]
        if kind == "joint" or not spread:
            compared.append(("wrenches", wrench, stiff * screw, ("moment", "force")))
        for what, linear, floor, labels in compared:
            name = f"{kind}_{what}"
            known = sprung(robot)[rows] if name == "joint_wrenches" else 1.0
            ours = np.array([getattr(p.linear, linear)[rows] for p in pairs]) * known
            theirs = np.array([getattr(p.simulated, name)[rows] for p in pairs])
            theirs = theirs * known
            for label, half, least in zip(labels, HALVES.values(), floor, strict=True):
                limits[f"{kind} {label}"] = limit_difference(
                    scales, ours[..., half], theirs[..., half], 1, least
                )
    if spread:
        return limits
    ours = np.array([pair.linear.energy for pair in pairs])
    theirs = np.array([pair.simulated.rigid_energy for pair in pairs])
    least = float((stiff * screw**2).max())
    return limits | {"energy": limit_difference(scales, ours, theirs, 2, least)}


def limit_difference(
    scales: NDArray, ours: NDArray, theirs: NDArray, power: int, floor: float
) -> float:
    """Largest difference as the scale goes to 0, relative to the largest value.

    Less what the extrapolation itself leaves open: with few scales and large errors
    the limit is not known to a thousandth.

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
    differences = (theirs - ours) * weight
    limit = extrapolate(scales, differences)
    # what leaving out the largest scale changes, the limit does not know to better
    # than a factor of its own order
    unsure = 2 * np.abs(limit - extrapolate(scales[1:], differences[1:]))
    gap = np.maximum(0.0, np.abs(limit) - unsure).max()
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


@dataclass(frozen=True, eq=False)
class LinkModels:
    """How a simulation models links, ready for ``simulate_assembly``.

    Attributes:
        links: ``"beam"`` or ``"spring"``.
        stiffness: K_E of springs by frame.
        meshes: solids by frame.
    """

    links: str
    stiffness: Mapping[str, NDArray]
    meshes: Mapping[str, MeshBody]


def link_models(robot: Robot, kind: str) -> LinkModels:
    """What a simulation needs to model a robot's links in one of three ways.

    Args:
        robot: any.
        kind: ``"beam"``: beams as beams, all others as springs; ``"spring"``: all as
            springs; ``"fem"``: meshed links as solids, the others as with ``"beam"``.

    Returns:
        Stiffnesses and solids.

    Raises:
        BadInput: an unknown kind, or a mesh is not usable.
    """
    if kind not in KINDS:
        raise BadInput(f"links: found {kind!r}, expected one of {', '.join(KINDS)}")
    meshes = mesh_bodies(robot) if kind == "fem" else {}
    stiffness = {
        name: K
        for name, K in link_stiffnesses(robot, kind).items()
        if name not in meshes
    }
    return LinkModels("spring" if kind == "spring" else "beam", stiffness, meshes)


def link_stiffnesses(robot: Robot, links: str) -> Mapping[str, NDArray]:
    """K_E of the links that a simulation will model as springs.

    Args:
        robot: any.
        links: ``"spring"``, or anything else, where beams need none.

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


class Judged(Protocol):
    """A comparison that reached a verdict."""

    @property
    def checks(self) -> dict[str, tuple[float, float]]:
        """By name a value and its bound."""

    @property
    def passed(self) -> bool:
        """Whether every value is within its bound."""

    def header(self) -> list[str]:
        """Names of columns."""

    def rows(self) -> list[list[str]]:
        """Cells."""


def check_table(checks: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
    """Checks as plain values: each with ``value``, ``tolerance`` and ``passed``."""
    return {
        name: {"value": value, "tolerance": bound, "passed": value <= bound}
        for name, (value, bound) in checks.items()
    }


def check_text(lines: list[str], answer: Judged) -> str:
    """A comparison for people.

    Args:
        lines: to begin with.
        answer: what was found.

    Returns:
        These lines, the table, every check and the verdict, without colours.
    """
    table = [answer.header(), *answer.rows()]
    lines = lines + ["  ".join(f"{cell:>26}" for cell in row) for row in table]
    for name, (value, bound) in answer.checks.items():
        word = "ok" if value <= bound else "FAILS"
        lines.append(f"{name}: {value:.1e} (bound {bound:g}) {word}")
    return "\n".join([*lines, "passed" if answer.passed else "FAILED"])
