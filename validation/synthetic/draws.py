"""Draw plausible parameters of hidden effects, and scale effects by a factor."""

import math
from collections.abc import Callable

import numpy as np

from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.inputs.table import BadInput
from forcefit.validation.synthetic.effects import (
    LIBRARY,
    SCREW,
    Parameters,
    own_compliance,
)
from forcefit.validation.synthetic.machine import Hidden
from forcefit.validation.synthetic.outside import OUTSIDE

_SHAPES = (
    "phase", "exponent", "time_constant", "order", "at", "period", "knee",
)  # fmt: skip
SLIDING = ("_lead", "_lead_backlash")  # effects of prismatic joints only


class NotApplicable(ValueError):
    """Error: an effect cannot act at any place of the robot."""


def draw_effect(
    name: str, robot: Robot, duration: float, rng: np.random.Generator
) -> Hidden:
    """Return an effect with plausible parameters, at one place or at all places.

    Args:
        name: name of the effect.
        robot: the robot with the effect.
        duration: [s] duration of the session.
        rng: random number generator of the draws.

    Returns:
        The effect, whose strength can be changed by :func:`strengthened`.

    Raises:
        BadInput: the name of the effect is unknown.
        NotApplicable: the effect cannot act at any place of the robot.
    """
    # Effects outside the library are only for tests, so the message does not list them.
    if name not in (*LIBRARY, *OUTSIDE):
        raise BadInput(
            f'effect: found "{name[:60]}", expected one of {", ".join(LIBRARY)}'
        )
    return Hidden(name, _DRAWS[name](robot, duration, rng))


def strengthened(effect: Hidden, factor: float) -> Hidden:
    """Return the effect with its contribution to the readings scaled by a factor.

    Args:
        effect: effect with its parameters.
        factor: [-] positive factor.

    Returns:
        The effect with more compliant springs or larger errors.
    """
    name, given = effect.name, dict(effect.parameters)
    for key, value in given.items():
        last = key.rpartition(".")[2]
        if last in _SHAPES:
            continue
        if name in ("drive_compliance", "base_compliance", "_pose_stiffness"):
            given[key] = value / factor
        elif name == "contact_stiffening":
            exponent = given[key.removesuffix("coefficient") + "exponent"]
            given[key] = value / factor**exponent
        # The compliance is inversely proportional to the modulus.
        elif name == "modulus_scale":
            given[key] = 1.0 / max(1.0 + factor * (1.0 / value - 1.0), 0.05)
        elif key == "factor":
            given[key] = 1.0 + factor * (value - 1.0)
        else:
            given[key] = value * factor
    return Hidden(name, given)


def _some(frames: list[Frame], rng: np.random.Generator) -> list[str]:
    """Return one of the frames, or all of them, at random."""
    if not frames:
        raise NotApplicable("the robot has no frame on which the effect acts")
    if rng.random() < 0.5:
        return [frames[rng.integers(len(frames))].name]
    return [frame.name for frame in frames]


def _beams(robot: Robot) -> list[Frame]:
    return [f for f in robot.frames if isinstance(f.link, BeamLink)]


def _bodies(robot: Robot) -> list[Frame]:
    """Return the beams or, if there are none, all bodies with a length."""
    return _beams(robot) or [f for f in robot.frames if f.translation.any()]


def _drives(robot: Robot) -> list[Frame]:
    return [f for f in robot.frames if f.actuated]


def _turning(robot: Robot) -> list[Frame]:
    return [f for f in _drives(robot) if f.joint == "revolute"]


def _weight(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    heavy = any(f.mass for f in robot.frames) or any(
        isinstance(f.link, BeamLink) and f.link.density for f in robot.frames
    )
    if not heavy:
        raise NotApplicable("no part of the robot has a declared mass")
    tilt = rng.uniform(-0.2, 0.2, 2) if rng.random() < 0.5 else np.zeros(2)
    down = np.array([*np.sin(tilt), -1.0])
    g = 9.81 * down / np.linalg.norm(down)
    return dict(zip(("g.x", "g.y", "g.z"), g.tolist(), strict=True))


def _expansion(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    return dict.fromkeys(_some(_bodies(robot), rng), 2e-5)


def _delayed(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    names = _some(_bodies(robot), rng)
    late = [f"{name}.time_constant" for name in names]
    return dict.fromkeys(names, 2e-5) | dict.fromkeys(late, rng.uniform(500, 2000))


def _drive_springs(
    robot: Robot, duration: float, rng: np.random.Generator
) -> Parameters:
    return {n: 1e5 * rng.uniform(0.6, 1.6) for n in _some(_drives(robot), rng)}


def _foundation(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    size = np.where(np.arange(6) < 3, 1e5, 1e6) * rng.uniform(0.5, 2.0, 6)
    return {f"stiffness.{k}": v for k, v in zip(SCREW, size.tolist(), strict=True)}


def _offsets(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    return _errors(_some(_drives(robot), rng), rng)


def _lengths(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    return _errors(_some(_bodies(robot), rng), rng)


def _errors(names: list[str], rng: np.random.Generator) -> Parameters:
    """Return errors of about 1e-4 rad or m with random signs."""
    signs = rng.choice([-1.0, 1.0], len(names)) * rng.uniform(0.4, 1.0, len(names))
    return dict(zip(names, (1e-4 * signs).tolist(), strict=True))


def _eccentric(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    given = {}
    for name in _some(_turning(robot), rng):
        given[f"{name}.amplitude"] = 1e-4 * rng.uniform(0.5, 1.0)
        given[f"{name}.phase"] = rng.uniform(-math.pi, math.pi)
    return given


def _registered(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    base = 1e-4 * rng.uniform(-1, 1, 6)
    given = {f"base.{k}": v for k, v in zip(SCREW, base.tolist(), strict=True)}
    if rng.random() < 0.5:
        tool = 1e-4 * rng.uniform(-1, 1, 3)
        names = (f"tool.{k}" for k in SCREW[3:])
        given |= dict(zip(names, tool.tolist(), strict=True))
    return given


def _softer(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    return dict.fromkeys(_some(_beams(robot), rng), 0.8)


def _clearances(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    joints = [f for f in robot.frames if f.actuated and f.clearance is None]
    given: dict[str, float] = {}
    for name in _some(joints, rng):
        given |= {f"{name}.radial": 2e-5, f"{name}.axial": 2e-5, f"{name}.tilt": 2e-4}
    return given


def _friction(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    elastic = [f for f in _drives(robot) if own_compliance(f) > 0.0]
    names = _some(elastic, rng)
    compliance = {n: own_compliance(robot.frame(n)) for n in names}
    return {n: 1e-5 / c * rng.uniform(0.6, 1.4) for n, c in compliance.items()}


def _contacts(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    given = {}
    for name in _some(_drives(robot), rng):
        given[f"{name}.coefficient"] = 1e7 * rng.uniform(0.6, 1.6)
        given[f"{name}.exponent"] = 1.5
    return given


def _gain(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    factor = 1.0 + rng.choice([-0.08, 0.08])
    if rng.random() < 0.5:
        return {"factor": factor}
    offset = rng.uniform(-2, 2, 3).round(3)
    names = ("offset.fx", "offset.fy", "offset.fz")
    return {"factor": factor, **dict(zip(names, offset.tolist(), strict=True))}


def _heavier(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    heavy = [f for f in robot.frames if f.mass]
    if not heavy:
        raise NotApplicable("no body has a declared mass")
    name = heavy[rng.integers(len(heavy))].name
    given = {f"{name}.mass": rng.uniform(0.2, 0.6)}
    if rng.random() < 0.5:
        moment = rng.uniform(-0.03, 0.03, 3).tolist()
        given |= {f"{name}.moment.{k}": v for k, v in zip("xyz", moment, strict=True)}
    return given


def _measuring(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    return {"factor": 1.0 + rng.choice([-1e-4, 1e-4])}


def _stiffening(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    return {}


def _drifting(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    size = rng.choice([-1.0, 1.0], 6) * rng.uniform(0.3, 1.0, 6) * 1e-5
    given = {f"amplitude.{k}": v for k, v in zip(SCREW, size.tolist(), strict=True)}
    return given | {"time_constant": duration * rng.uniform(0.15, 0.6)}


def _swelling(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    return dict.fromkeys(_some(_beams(robot), rng), 1e-5)


def _mesh(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    return {f.name: 1e5 for f in _turning(robot)} or _nothing()


def _geared(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    given = {}
    for name in _some(_turning(robot), rng):
        given[f"{name}.order"] = float(rng.integers(3, 10))
        given[f"{name}.amplitude"] = 1e-4 * rng.uniform(0.5, 1.0)
        given[f"{name}.phase"] = rng.uniform(-math.pi, math.pi)
    return given


def _growing(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    return dict.fromkeys(_some(_beams(robot), rng), 1e-4 / duration)


def _pressed(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    return {n: 1e-4 * rng.uniform(0.5, 1.0) for n in _some(_drives(robot), rng)}


def _pulling(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    drives = _drives(robot)
    return {drives[rng.integers(len(drives))].name: 5.0}


def _slipping(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    drives = _drives(robot)
    name = drives[rng.integers(len(drives))].name
    return {f"{name}.jump": 1e-4, f"{name}.at": duration * rng.uniform(0.3, 0.7)}


def _screws(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    given = {}
    for name in _some([f for f in _drives(robot) if f.joint == "prismatic"], rng):
        given[f"{name}.amplitude"] = 1e-5 * rng.uniform(0.5, 1.0)
        given[f"{name}.phase"] = rng.uniform(-math.pi, math.pi)
        given[f"{name}.period"] = rng.choice([0.004, 0.005, 0.01, 0.016, 0.02])
    return given


def _stepped(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    drives = _drives(robot)
    name = drives[rng.integers(len(drives))].name
    soft, hard = rng.permutation([1e-5, 3e-6]).tolist()
    return {f"{name}.below": soft, f"{name}.above": hard, f"{name}.knee": 4.0}


def _pushed(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    drives = _drives(robot)
    return {drives[rng.integers(len(drives))].name: 5e-5}


def _turned(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    return {"gain": rng.uniform(0.7, 1.3)}


def _nothing() -> Parameters:
    raise NotApplicable("the robot has no revolute drive")


def _stand(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    c = 1e-5 * rng.uniform(-1, 1, 6)
    return {f"c.{k}": v for k, v in zip(SCREW, c.tolist(), strict=True)}


def _sagging(robot: Robot, duration: float, rng: np.random.Generator) -> Parameters:
    return {"rate": 1e-6}


_DRAWS: dict[str, Callable[[Robot, float, np.random.Generator], Parameters]] = {
    "self_weight": _weight,
    "thermal_expansion": _expansion,
    "delayed_expansion": _delayed,
    "drive_compliance": _drive_springs,
    "base_compliance": _foundation,
    "encoder_offset": _offsets,
    "encoder_eccentricity": _eccentric,
    "link_length": _lengths,
    "registration": _registered,
    "modulus_scale": _softer,
    "joint_clearance": _clearances,
    "friction_hysteresis": _friction,
    "contact_stiffening": _contacts,
    "load_gain": _gain,
    "body_mass": _heavier,
    "device_scale": _measuring,
    "geometric_stiffening": _stiffening,
    "drift": _drifting,
    "_pose_stiffness": _mesh,
    "_humidity": _swelling,
    "_quadratic_temperature": _swelling,
    "_second_harmonic": _eccentric,
    "_growth": _growing,
    "_gear": _geared,
    "_uneven_backlash": _eccentric,
    "_load_friction": _pressed,
    "_cable": _pulling,
    "_slipped": _slipping,
    "_lead": _screws,
    "_lead_backlash": _screws,
    "_two_steps": _stepped,
    "_torque_backlash": _pushed,
    "_tilting": _turned,
    "_stand": _stand,
    "_sag": _sagging,
}
