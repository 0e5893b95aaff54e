"""Model effects that occur in real machines but not in the library.

A diagnosis should report that no effect of the library explains such data.  The names
of these effects begin with an underscore.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import BASE, Clearance, Frame
from forcefit.validation.synthetic.effects import (
    SCREW,
    SENSOR,
    Change,
    Machine,
    Moved,
    Parameters,
    Row,
    beam_length,
    displacing,
    insert_after,
    lengthened,
    named,
    on_ground,
    sprung,
    wave,
)
from forcefit.validation.synthetic.laws import TwoStepSpring


def _pose_stiffness(machine: Machine, row: Row, given: Parameters) -> Machine:
    """Add a drive compliance proportional to 1 + cos 3q, as in a gear mesh."""
    robot = machine.robot
    for name, softest in given.items():
        share = 1.0 + math.cos(3 * row.coordinates[name])
        K = sprung(robot.frame(name), softest / max(share / 2, 1e-6))
        robot = insert_after(robot, name, "mesh", joint_stiffness=K)
    return replace(machine, robot=robot)


def _humidity(machine: Machine, row: Row, given: Parameters) -> Machine:
    """Add a beam strain that is proportional to the humidity."""
    return _swollen(machine, given, row.covariates["humidity"] - 40.0)


def _quadratic_temperature(machine: Machine, row: Row, given: Parameters) -> Machine:
    """Add a beam strain that is proportional to the square of the temperature."""
    return _swollen(machine, given, row.covariates["temperature"] ** 2)


def _swollen(machine: Machine, given: Parameters, cause: float) -> Machine:
    robot = machine.robot
    for name, rate in given.items():
        robot = lengthened(robot, name, rate * beam_length(robot, name) * cause)
    return replace(machine, robot=robot)


def _growth(machine: Machine, row: Row, given: Parameters) -> Machine:
    """Add a beam strain that is proportional to time, as in creep."""
    return _swollen(machine, given, row.covariates["time"])


def _backlash(row: Row, given: Parameters, name: str, angle: float) -> float:
    """Return the displacement [rad or m] due to a backlash that depends on an angle."""
    share = 1.0 + 0.8 * math.sin(angle + given[f"{name}.phase"])
    return given[f"{name}.amplitude"] * row.covariates["approach"] * share


def _thread(row: Row, given: Parameters, name: str) -> float:
    """Return the rotation angle [rad] of the lead screw of a slide."""
    return 2 * math.pi * (row.coordinates[name] / given[f"{name}.period"])


def _friction(row: Row, given: Parameters, name: str) -> float:
    """Return the displacement due to friction that is proportional to the load."""
    pressed = float(np.linalg.norm(row.load[3:])) / 100 * row.covariates["approach"]
    return -given[name] * pressed


def _cable(machine: Machine, row: Row, given: Parameters) -> Machine:
    """Add the weight of a cable, proportional to the coordinate of a drive."""
    load = machine.load.copy()
    load[5] -= sum(rate * row.coordinates[name] for name, rate in given.items())
    return replace(machine, load=load)


def _two_steps(machine: Machine, row: Row, given: Parameters) -> Machine:
    """Add a joint compliance that changes at a certain load."""
    robot, laws = machine.robot, dict(machine.laws)
    for name in named(given, "knee"):
        keys = ("below", "above", "knee")
        law = TwoStepSpring(*(given[f"{name}.{key}"] for key in keys))
        K = sprung(robot.frame(name), law.secant(0.0))
        robot = insert_after(robot, name, "steps", joint_stiffness=K)
        laws[f"{name}~steps"] = law
    return replace(machine, robot=robot, laws=laws)


def _torque_backlash(machine: Machine, row: Row, given: Parameters) -> Machine:
    """Add the backlash of a gear, in the direction of the drive's load."""
    robot, laws = machine.robot, dict(machine.laws)
    for name, clearance in given.items():
        frame = robot.frame(name)
        turns = frame.joint == "revolute"
        K = sprung(frame, SENSOR[0 if turns else 1])
        robot = insert_after(robot, name, "teeth", joint_stiffness=K)
        laws[f"{name}~teeth"] = Clearance(**{"spin" if turns else "axial": clearance})
    return replace(machine, robot=robot, laws=laws)


def _tilting(machine: Machine, row: Row, given: Parameters) -> Machine:
    """Add a tilt of the ground that is proportional to the tilt covariate."""
    screw = np.zeros(6)
    screw[0] = given["gain"] * row.covariates["tilt"]
    ground = Frame("base~tilt", BASE, geometric_error=screw)
    return replace(machine, robot=on_ground(machine.robot, ground))


def _stand(reading: NDArray, row: Row, given: Parameters) -> NDArray:
    """Add a deflection c (f/100 N)^2 of the device's stand under the load f."""
    squared = float(row.load[3:] @ row.load[3:]) / 1e4
    return reading + squared * np.array([given.get(f"c.{k}", 0.0) for k in SCREW])


def _sag(reading: NDArray, row: Row, given: Parameters) -> NDArray:
    """Add a deflection of the measured target that is proportional to the load."""
    sag = np.zeros(6)
    sag[5] = -given["rate"] * np.linalg.norm(row.load[3:])
    return reading + sag


OUTSIDE_CHANGES: dict[str, Change] = {
    "_pose_stiffness": _pose_stiffness,
    "_humidity": _humidity,
    "_quadratic_temperature": _quadratic_temperature,
    "_second_harmonic": displacing(
        "wobble",
        "amplitude",
        lambda row, given, name: wave(given, name, 2 * row.coordinates[name]),
    ),
    "_growth": _growth,
    "_gear": displacing(
        "gear",
        "order",
        lambda row, given, name: wave(
            given, name, given[f"{name}.order"] * row.coordinates[name]
        ),
    ),
    "_uneven_backlash": displacing(
        "backlash",
        "phase",
        lambda row, given, name: _backlash(row, given, name, row.coordinates[name]),
    ),
    "_load_friction": displacing("friction", "", _friction),
    "_cable": _cable,
    "_slipped": displacing(
        "slip",
        "at",
        lambda row, given, name: (
            given[f"{name}.jump"] * (row.covariates["time"] >= given[f"{name}.at"])
        ),
    ),
    "_lead": displacing(
        "lead",
        "period",
        lambda row, given, name: wave(given, name, _thread(row, given, name)),
    ),
    "_lead_backlash": displacing(
        "backlash",
        "period",
        lambda row, given, name: _backlash(row, given, name, _thread(row, given, name)),
    ),
    "_two_steps": _two_steps,
    "_torque_backlash": _torque_backlash,
    "_tilting": _tilting,
}
OUTSIDE_READINGS: dict[str, Moved] = {"_stand": _stand, "_sag": _sag}
OUTSIDE_COVARIATES: dict[str, tuple[str, ...]] = {
    "_humidity": ("humidity",),
    "_quadratic_temperature": ("temperature",),
    "_growth": ("time",),
    "_uneven_backlash": ("approach",),
    "_load_friction": ("approach",),
    "_slipped": ("time",),
    "_lead_backlash": ("approach",),
    "_tilting": ("tilt",),
}
OUTSIDE = {
    "_pose_stiffness": "a drive is softer in some poses than in others",
    "_humidity": "links swell with the humidity",
    "_quadratic_temperature": "links grow with the square of the temperature",
    "_second_harmonic": "an encoder's error repeats twice a turn",
    "_growth": "links grow with time",
    "_gear": "a drive's angle has waves of its gear",
    "_uneven_backlash": "backlash that varies around a turn of a gear",
    "_load_friction": "friction that grows with the size of the load",
    "_cable": "a cable's force increases with a coordinate",
    "_slipped": "a drive's zero jumps at a time",
    "_lead": "a slide's position has waves of its screw",
    "_lead_backlash": "backlash that varies over a turn of a screw",
    "_two_steps": "a joint's compliance changes above some load",
    "_torque_backlash": "backlash on the side to which a drive's load pushes",
    "_tilting": "the ground rotates in proportion to a sensor's reading",
    "_stand": "the device's stand deflects with the square of the load",
    "_sag": "the measured target sags with the size of the load",
}
