"""Model physical effects in a simulated machine.

The machine is a tree of frames, and most effects insert frames into it.  For example,
an elastic drive is a spring after the joint, an encoder error is a finite rotation
after the joint, and an elastic foundation is a spring below all frames.  Other effects
change a body, the load, the measuring frame or the reading.

The effect models of the diagnosis are not used here, so that an error in them cannot
affect the test data.  Springs, rotations and translations of joints act about or along
the z axis of the joint.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import BASE, BeamLink, Clearance, Frame, Robot
from forcefit.validation.multibody.beams import beam_span
from forcefit.validation.multibody.motion import placement, turned
from forcefit.validation.synthetic.laws import PowerLawSpring, TwoStepSpring

SCREW = ("rx", "ry", "rz", "tx", "ty", "tz")
WRENCH = ("mx", "my", "mz", "fx", "fy", "fz")
SENSOR = (1e9, 1e10)  # [N m/rad], [N/m] stiffness of an almost rigid force sensor
Parameters = Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Row:
    """One row of a design, which is a commanded measurement.

    Attributes:
        coordinates: mapping from frame to the nominal coordinate of its joint [rad or
            m].
        load: (6,) [N m, N] recorded load at the reference point, base axes.
        covariates: mapping from covariate to value, for example ``temperature`` [K],
            ``time`` [s], ``approach``, and the components ``gravity.x`` to
            ``gravity.z`` [m/s^2] of gravity.
    """

    coordinates: Mapping[str, float]
    load: NDArray
    covariates: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Machine:
    """Simulated machine in one row of a design.

    Attributes:
        robot: robot with the frames that effects inserted.  The load acts on its
            platform, and the pose of the platform is measured.
        coordinates: mapping from frame to joint coordinate [rad or m]; 0 for missing
            joints.
        load: (6,) [N m, N] applied load.
        gravity: (3,) [m/s^2] gravity in base axes.
        laws: mapping from frame to a nonlinear spring of its joint, or to the clearance
            of its joint if the frame is on an open chain; see
            :mod:`forcefit.validation.synthetic.rest`.
    """

    robot: Robot
    coordinates: Mapping[str, float]
    load: NDArray
    gravity: NDArray = field(default_factory=lambda: np.zeros(3))
    laws: Mapping[str, PowerLawSpring | TwoStepSpring | Clearance] = field(
        default_factory=dict
    )


@dataclass(frozen=True, eq=False)
class Rest:
    """Equilibrium of a machine with n frames.

    Attributes:
        transforms: (n, 4, 4) poses of the frames in the base frame, before the motion
            of their joints.
        joint_wrenches: (n, 6) [N m, N] wrenches of the joint springs, in frame axes.
        joint_screws: (n, 6) [rad, m] deformations of the joint springs.
    """

    transforms: NDArray
    joint_wrenches: NDArray
    joint_screws: NDArray


Change = Callable[[Machine, Row, Parameters], Machine]
Moved = Callable[[NDArray, Row, Parameters], NDArray]


def insert_after(robot: Robot, name: str, suffix: str, **given: Any) -> Robot:
    """Insert a fixed frame between a joint and its children."""
    new = f"{name}~{suffix}"
    frames = [replace(f, parent=new) if f.parent == name else f for f in robot.frames]
    return replace(robot, frames=(*frames, Frame(new, name, **given)))


def along_own_axis(frame: Frame, value: float, others: float = 0.0) -> NDArray:
    """Return a screw (6,) of given magnitude along the free motion of a joint."""
    screw = np.full(6, others)
    screw[frame.own_axis] = value
    return screw


def sprung(frame: Frame, stiffness: float) -> NDArray:
    """Return a joint stiffness (6, 6) that is finite only along the free motion."""
    return np.diag(along_own_axis(frame, stiffness, math.inf))


def beam_length(robot: Robot, name: str) -> float:
    """Return the declared length [m] of a frame's beam or body."""
    frame = robot.frame(name)
    if not isinstance(frame.link, BeamLink):
        return float(np.linalg.norm(frame.translation))
    return beam_span(frame, frame.link)[0]


def lengthened(robot: Robot, name: str, change: float) -> Robot:
    """Return the robot with a body that is longer by ``change`` [m]."""
    frame = robot.frame(name)
    # The length of the body is the distance between its joints.
    if not isinstance(frame.link, BeamLink):
        longer = 1.0 + change / float(np.linalg.norm(frame.translation))
        return with_frame(robot, replace(frame, translation=longer * frame.translation))
    length, x = beam_span(frame, frame.link)
    axis = x / np.linalg.norm(x)
    error = frame.geometric_error.copy()
    error[3:] += turned(error[:3]) @ axis * change
    link = replace(frame.link, length=length + change, axis=tuple(axis.tolist()))
    return with_frame(robot, replace(frame, link=link, geometric_error=error))


def with_frame(robot: Robot, frame: Frame) -> Robot:
    """Return the robot with a frame that replaces the frame of the same name."""
    frames = (frame if f.name == frame.name else f for f in robot.frames)
    return replace(robot, frames=tuple(frames))


def misread(machine: Machine, name: str, suffix: str, change: float) -> Machine:
    """Displace a joint by ``change`` [rad or m] from its reported coordinate."""
    screw = along_own_axis(machine.robot.frame(name), change)
    robot = insert_after(machine.robot, name, suffix, geometric_error=screw)
    return replace(machine, robot=robot)


def displacing(
    suffix: str, component: str, amount: Callable[[Row, Parameters, str], float]
) -> Change:
    """Return a function that displaces the drives named in an effect's parameters.

    Parameters are named ``<frame>.<component>`` or ``<frame>``.
    """

    def change(machine: Machine, row: Row, given: Parameters) -> Machine:
        for name in named(given, component) if component else given:
            machine = misread(machine, name, suffix, amount(row, given, name))
        return machine

    return change


def on_ground(robot: Robot, ground: Frame) -> Robot:
    """Insert a frame between the base and its children."""
    frames = [
        replace(f, parent=ground.name) if f.parent == BASE else f for f in robot.frames
    ]
    return replace(robot, frames=(ground, *frames))


def own_compliance(frame: Frame) -> float:
    """Return the declared compliance along a joint's free motion; 0 if rigid."""
    K = frame.springs
    if K is None or not np.isfinite(K[frame.own_axis, frame.own_axis]):
        return 0.0
    soft = np.flatnonzero(np.isfinite(np.diag(K)))
    k = int(np.searchsorted(soft, frame.own_axis))
    return float(np.linalg.inv(K[np.ix_(soft, soft)])[k, k])


def _self_weight(machine: Machine, row: Row, given: Parameters) -> Machine:
    g = np.array([given.get(f"g.{k}", 0.0) for k in "xyz"])
    return replace(machine, gravity=machine.gravity + g)


def _thermal_expansion(machine: Machine, row: Row, given: Parameters) -> Machine:
    kelvin, robot = row.covariates["temperature"], machine.robot
    for name, strain in given.items():
        robot = lengthened(robot, name, strain * kelvin * beam_length(robot, name))
    return replace(machine, robot=robot)


def _delayed_expansion(machine: Machine, row: Row, given: Parameters) -> Machine:
    robot = machine.robot
    for name in named(given, "time_constant"):
        kelvin = row.covariates[f"behind {given[f'{name}.time_constant']!r}"]
        change = given[name] * kelvin * beam_length(robot, name)
        robot = lengthened(robot, name, change)
    return replace(machine, robot=robot)


def _link_length(machine: Machine, row: Row, given: Parameters) -> Machine:
    robot = machine.robot
    for name, change in given.items():
        robot = lengthened(robot, name, change)
    return replace(machine, robot=robot)


def _drive_compliance(machine: Machine, row: Row, given: Parameters) -> Machine:
    robot = machine.robot
    for name, stiffness in given.items():
        K = sprung(robot.frame(name), stiffness)
        robot = insert_after(robot, name, "drive", joint_stiffness=K)
    return replace(machine, robot=robot)


def _base_compliance(machine: Machine, row: Row, given: Parameters) -> Machine:
    K = np.diag([given.get(f"stiffness.{k}", math.inf) for k in SCREW])
    foundation = Frame("base~foundation", BASE, joint_stiffness=K)
    return replace(machine, robot=on_ground(machine.robot, foundation))


def wave(given: Parameters, name: str, angle: float) -> float:
    """Return a drive displacement [rad or m] that is a harmonic of an angle [rad]."""
    return given[f"{name}.amplitude"] * math.sin(angle + given[f"{name}.phase"])


def _modulus_scale(machine: Machine, row: Row, given: Parameters) -> Machine:
    robot = machine.robot
    for name, factor in given.items():
        frame = robot.frame(name)
        assert isinstance(frame.link, BeamLink)
        link = replace(frame.link, young=factor * frame.link.young)
        robot = with_frame(robot, replace(frame, link=link))
    return replace(machine, robot=robot)


def _joint_clearance(machine: Machine, row: Row, given: Parameters) -> Machine:
    robot, laws = machine.robot, dict(machine.laws)
    for name in dict.fromkeys(key.rpartition(".")[0] for key in given):
        kinds = ("radial", "axial", "tilt")
        clearance = Clearance(**{k: given.get(f"{name}.{k}") for k in kinds})
        # The simulation computes the positions of the joints in their clearances.
        if robot.closures:
            robot = with_frame(robot, replace(robot.frame(name), clearance=clearance))
            continue
        K = np.repeat(SENSOR, 3)
        K[robot.frame(name).own_axis] = math.inf
        robot = insert_after(robot, name, "clearance", joint_stiffness=np.diag(K))
        laws[f"{name}~clearance"] = clearance
    return replace(machine, robot=robot, laws=laws)


def _friction_hysteresis(machine: Machine, row: Row, given: Parameters) -> Machine:
    # A constant torque shifts the equilibrium of a linear spring.
    for name, torque in given.items():
        compliance = own_compliance(machine.robot.frame(name))
        change = -torque * row.covariates["approach"] * compliance
        machine = misread(machine, name, "friction", change)
    return machine


def _contact_stiffening(machine: Machine, row: Row, given: Parameters) -> Machine:
    robot, laws = machine.robot, dict(machine.laws)
    for name in named(given, "coefficient"):
        law = PowerLawSpring(given[f"{name}.coefficient"], given[f"{name}.exponent"])
        K = sprung(robot.frame(name), law.secant(1e-5))
        robot = insert_after(robot, name, "contact", joint_stiffness=K)
        laws[f"{name}~contact"] = law
    return replace(machine, robot=robot, laws=laws)


def _load_gain(machine: Machine, row: Row, given: Parameters) -> Machine:
    offset = np.array([given.get(f"offset.{k}", 0.0) for k in WRENCH])
    return replace(machine, load=given.get("factor", 1.0) * machine.load + offset)


def _body_mass(machine: Machine, row: Row, given: Parameters) -> Machine:
    """Add a mass [kg] with a first moment [kg m] to a body."""
    robot = machine.robot
    keys = ("mass", "moment.x", "moment.y", "moment.z")
    for name in dict.fromkeys(n for key in keys for n in named(given, key)):
        frame = robot.frame(name)
        more = given.get(f"{name}.mass", 0.0)
        moment = np.array([given.get(f"{name}.moment.{k}", 0.0) for k in "xyz"])
        mass = frame.mass + more
        centre = frame.centre_of_mass + moment / mass
        robot = with_frame(robot, replace(frame, mass=mass, centre_of_mass=centre))
    return replace(machine, robot=robot)


def _geometric_stiffening(machine: Machine, row: Row, given: Parameters) -> Machine:
    # The simulation always includes this effect, because motions are finite.
    return machine


def _registration(pose: NDArray, row: Row, given: Parameters) -> NDArray:
    """Return the pose of a displaced target in a displaced measuring frame."""
    screw = np.array([given.get(f"base.{k}", 0.0) for k in SCREW])
    tool = [given.get(f"tool.{k}", 0.0) for k in SCREW[3:]]
    measured = pose.copy()
    measured[:3, 3] += pose[:3, :3] @ tool
    return placement(screw[:3], screw[3:]) @ measured


def _device_scale(pose: NDArray, row: Row, given: Parameters) -> NDArray:
    """Scale all lengths from the origin of the device."""
    measured = pose.copy()
    measured[:3, 3] *= given["factor"]
    return measured


def _drift(reading: NDArray, row: Row, given: Parameters) -> NDArray:
    amplitude = np.array([given.get(f"amplitude.{k}", 0.0) for k in SCREW])
    return reading + amplitude * -math.expm1(
        -row.covariates["time"] / given["time_constant"]
    )


def named(given: Parameters, component: str) -> list[str]:
    """Return the frames with a parameter ``<frame>.<component>`` for a component."""
    end = f".{component}"
    return [key.removesuffix(end) for key in given if key.endswith(end)]


CHANGES: dict[str, Change] = {
    "self_weight": _self_weight,
    "thermal_expansion": _thermal_expansion,
    "drive_compliance": _drive_compliance,
    "base_compliance": _base_compliance,
    "encoder_offset": displacing("offset", "", lambda row, given, name: given[name]),
    "encoder_eccentricity": displacing(
        "eccentric",
        "amplitude",
        lambda row, given, name: wave(given, name, row.coordinates[name]),
    ),
    "delayed_expansion": _delayed_expansion,
    "link_length": _link_length,
    "modulus_scale": _modulus_scale,
    "joint_clearance": _joint_clearance,
    "friction_hysteresis": _friction_hysteresis,
    "contact_stiffening": _contact_stiffening,
    "load_gain": _load_gain,
    "body_mass": _body_mass,
    "geometric_stiffening": _geometric_stiffening,
}
# Functions that change the measured pose (4, 4), by effect name.
POSES: dict[str, Moved] = {
    "registration": _registration,
    "device_scale": _device_scale,
}
# Functions that change the reading (6,), by effect name.
READINGS: dict[str, Moved] = {"drift": _drift}
# Covariates that change the machine, by effect name.
COVARIATES: dict[str, tuple[str, ...]] = {
    "thermal_expansion": ("temperature",),
    "friction_hysteresis": ("approach",),
}
LIBRARY = (*CHANGES, *POSES, *READINGS)
