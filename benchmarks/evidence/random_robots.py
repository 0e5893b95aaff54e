"""Robots with random dimensions and geometric errors, for simulated campaigns.

They are serial arms with 3 to 6 joints, planar 3-RRR and five-bar robots, hexapods and
Delta robots.  Joints have no clearance, some drives are elastic, and bodies have
masses.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.assembly.robots import delta, five_bar, hexapod, three_rrr
from forcefit.assembly.robots.delta import DeltaParameters
from forcefit.assembly.robots.five_bar import FiveBarParameters
from forcefit.assembly.robots.hexapod import HexapodParameters
from forcefit.assembly.robots.placing import drive_stiffness
from forcefit.assembly.robots.three_rrr import ThreeRRRParameters
from forcefit.validation.multibody.motion import turn_of
from forcefit.validation.multibody.simulation import SimulationFailed, without_clearance
from forcefit.validation.synthetic.design import CampaignDesign, plan_campaign
from forcefit.validation.synthetic.effects import Machine
from forcefit.validation.synthetic.machine import simulate_readings
from forcefit.validation.synthetic.springs import rest_on_springs

KINDS = ("arm",) * 5 + ("3rrr",) * 2 + ("five_bar",) * 2 + ("hexapod", "delta")
_MOST = 1.5e-3  # [rad, m] largest deviation at all poses
_ALLOWED = np.array([6e-4, 3e-4])  # [rad, m] largest deviations due to errors and loads


@dataclass(frozen=True, eq=False)
class Drawn:
    """A robot, and the limits of its motions and loads.

    Attributes:
        kind: kind of the robot.
        robot: robot with its declared errors.
        reach: [rad] largest change of a revolute drive from the home pose.  For a
            prismatic drive, it is 0.1 m per rad.
        load: [N] largest force.
        point: (3,) [m] measured point, platform axes.
    """

    kind: str
    robot: Robot
    reach: float
    load: float
    point: NDArray


def draw_robot(rng: np.random.Generator, kind: str | None = None) -> Drawn:
    """Return a random robot.

    Args:
        rng: random number generator.
        kind: a member of :data:`KINDS`, or ``"gantry"``; random by default.

    Returns:
        The robot.
    """
    kind = kind or KINDS[rng.integers(len(KINDS))]
    robot, reach = _BUILDERS[kind](rng)
    robot = _with_masses(without_clearance(robot), rng)
    errors = rng.uniform(-1, 1, (len(robot.frames), 6))
    tight = robot.with_errors(0 * errors)
    robot = robot.with_errors(errors * np.repeat([1e-4, 5e-5], 3))
    excess = float((_moved(robot, [np.zeros(6)], tight) / _ALLOWED).max())
    robot = robot.with_errors(robot.errors / max(excess, 1.0))
    robot = replace(robot, name=kind, description="drawn at random")
    point = rng.uniform(-0.05, 0.05, 3).round(3)
    reach, load = _of_first_order(robot, point, reach, _largest_load(tight))
    return Drawn(kind, robot, reach, load, point)


def _of_first_order(
    robot: Robot, point: NDArray, reach: float, load: float
) -> tuple[float, float]:
    """Return the reach [rad] and load [N] for which deviations are small."""
    for _ in range(8):
        design = CampaignDesign(configurations=30, rows=60, reach=reach, load=load)
        rows = plan_campaign(robot, design, np.random.default_rng(0)).rows
        try:
            readings = simulate_readings(robot, point, rows, program="springs")
        except SimulationFailed:
            readings = np.full((1, 6), np.inf)
        if np.abs(readings).max() < _MOST:
            break
        reach, load = 0.75 * reach, 0.75 * load
    return round(reach, 3), float(f"{load:.2g}")


def _arm(rng: np.random.Generator) -> tuple[Robot, float]:
    """Return an arm whose axes are parallel or perpendicular to their neighbours."""
    count = int(rng.integers(3, 7))
    elastic = rng.random() < 0.6
    frames: list[Frame] = []
    parent, radius = "base", rng.uniform(0.035, 0.055)
    for k in range(count):
        name, link, place, turn = f"j{k + 1}", None, np.zeros(3), np.zeros(3)
        if k:
            link = _tube(radius)
            place = rng.uniform(0.15, 0.4) * _direction(rng)
            turn = rng.choice([-1, 0, 1]) * np.pi / 2 * np.eye(3)[rng.integers(2)]
            if k == 1:  # otherwise all axes could be parallel
                turn = np.array([np.pi / 2, 0, 0])
        K = drive_stiffness(2e5 * 0.65**k) if elastic else None
        frames.append(
            Frame(
                name, parent, place.round(4), turn, joint="revolute", actuated=True,
                joint_stiffness=K, link=link,
            )
        )  # fmt: skip
        parent, radius = name, 0.87 * radius
    end = rng.uniform(0.08, 0.2) * _direction(rng)
    frames.append(Frame("tool", parent, end.round(4), link=_tube(radius)))
    return Robot("arm", "tool", tuple(frames)), 0.8


def _gantry(rng: np.random.Generator) -> tuple[Robot, float]:
    """Return a gantry with three perpendicular slides and a rotating head."""
    elastic = rng.random() < 0.6
    frames: list[Frame] = []
    parent, radius = "base", rng.uniform(0.035, 0.055)
    for k, joint in enumerate(("prismatic",) * 3 + ("revolute",)):
        place = rng.uniform(0.15, 0.4) * _direction(rng)
        turn = np.array([np.pi / 2, 0, 0]) if k % 2 else np.array([0, np.pi / 2, 0])
        K = (
            drive_stiffness(2e5)
            if joint == "revolute"
            else np.diag([np.inf] * 5 + [3e6])
        )
        # length and axis of a slide's body
        along = {"length": 0.3, "axis": (1.0, 0.0, 0.0)}
        frames.append(
            Frame(
                f"{'wxyz'[(k + 1) % 4]}", parent, place.round(4), turn, joint=joint,
                actuated=True, joint_stiffness=K if elastic else None,
                link=replace(_tube(radius), **along) if k else None,
            )
        )  # fmt: skip
        parent, radius = frames[-1].name, 0.87 * radius
    end = rng.uniform(0.08, 0.2) * _direction(rng)
    frames.append(Frame("tool", parent, end.round(4), link=_tube(radius)))
    return Robot("gantry", "tool", tuple(frames)), 0.8


def _direction(rng: np.random.Generator) -> NDArray:
    """Return a random unit vector, which is more probable normal to the joint axis."""
    vector = rng.normal(size=3) * [1, 1, 0.5]
    return vector / np.linalg.norm(vector)


def _tube(radius: float) -> BeamLink:
    section = {"radius": round(radius, 4), "inner_radius": round(radius - 0.005, 4)}
    return BeamLink(section, 70e9, 0.33, density=2700.0)


def _about(rng: np.random.Generator, value: float) -> float:
    """Return a random number that differs from a value by up to 20 %."""
    return float(value * rng.uniform(0.8, 1.2))


def _three_rrr(rng: np.random.Generator) -> tuple[Robot, float]:
    P = ThreeRRRParameters()
    leg = replace(P.leg, near=_about(rng, P.leg.near), far=_about(rng, P.leg.far))
    robot = three_rrr(replace(P, leg=_driven(leg, rng)))
    return robot, 0.15


def _five_bar(rng: np.random.Generator) -> tuple[Robot, float]:
    P = FiveBarParameters()
    arm = _about(rng, P.leg.near)
    leg = replace(P.leg, near=arm, far=_about(rng, arm))
    robot = five_bar(replace(P, leg=_driven(leg, rng), base=_about(rng, P.base)))
    return robot, 0.15


def _driven(leg, rng: np.random.Generator):
    """Return a planar leg whose drive has a random stiffness."""
    return replace(leg, drive=_about(rng, 3 * leg.drive))


def _hexapod(rng: np.random.Generator) -> tuple[Robot, float]:
    P = HexapodParameters()
    P = replace(P, height=_about(rng, P.height), radius=_about(rng, 0.011))
    return hexapod(P), 0.15


def _delta(rng: np.random.Generator) -> tuple[Robot, float]:
    P = DeltaParameters()
    size = _about(rng, 1.0)
    P = replace(P, arm=size * P.arm, rod=size * P.rod, home=size * P.home)
    return delta(P), 0.25


_BUILDERS = {
    "arm": _arm,
    "gantry": _gantry,
    "3rrr": _three_rrr,
    "five_bar": _five_bar,
    "hexapod": _hexapod,
    "delta": _delta,
}


def _with_masses(robot: Robot, rng: np.random.Generator) -> Robot:
    """Return a robot with random masses at the ends of beams and at the platform."""
    heavy = []
    for frame in robot.frames:
        if frame.name == robot.platform or isinstance(frame.link, BeamLink):
            frame = replace(frame, mass=round(rng.uniform(0.1, 1.0), 2))
        heavy.append(frame)
    return replace(robot, frames=tuple(heavy))


def _largest_load(tight: Robot) -> float:
    """Return the load [N] that causes the allowed deflection of the platform."""
    forces = [np.eye(6)[k] for k in (3, 4, 5)]
    softest = (_moved(tight, forces, tight) / _ALLOWED).max()
    return float(f"{np.clip(1 / softest, 0.5, 400):.2g}")


def _moved(robot: Robot, forces: list[NDArray], tight: Robot) -> NDArray:
    """Return the platform displacements under forces in the home pose, (k, 2)."""
    home = home_posture(tight)
    names = [frame.name for frame in robot.frames]
    q = dict(zip(names, home.coordinates.tolist(), strict=True))
    rests = rest_on_springs([Machine(robot, q, force) for force in forces])
    T = np.array([r.transforms[robot.index(robot.platform)] for r in rests])
    turns = [np.linalg.norm(turn_of(R @ home.platform[:3, :3].T)) for R in T[:, :3, :3]]
    shifts = np.linalg.norm(T[:, :3, 3] - home.platform[:3, 3], axis=1)
    return np.column_stack([turns, shifts])
