"""Draw plausible parameters of hidden effects and scale effects."""

import math
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.inputs.table import BadInput
from forcefit.validation.synthetic.effects import (
    LIBRARY,
    SCREW,
    WRENCH,
    Parameters,
    own_compliance,
)
from forcefit.validation.synthetic.machine import Hidden
from forcefit.validation.synthetic.outside import OUTSIDE

_SHAPES = (
    "phase", "exponent", "time_constant", "order", "at", "period", "knee",
)  # fmt: skip
SLIDING = ("_lead", "_lead_backlash")  # effects that apply only to prismatic joints


class NotApplicable(ValueError):
    """Exception raised if an effect does not apply to a robot."""


def draw_effect(
    name: str, robot: Robot, duration: float, rng: np.random.Generator
) -> Hidden:
    """Return an effect with plausible random parameters.

    The effect acts on one frame or on all frames.

    Args:
        name: name of the effect.
        robot: the robot.
        duration: [s] duration of the session.
        rng: random number generator.

    Raises:
        BadInput: the name of the effect is unknown.
        NotApplicable: the effect does not apply to the robot.
    """
    # The message does not list effects outside the library, which are only for tests.
    if name not in (*LIBRARY, *OUTSIDE):
        raise BadInput(
            f'effect: found "{name[:60]}", expected one of {", ".join(LIBRARY)}'
        )
    return Hidden(name, _DRAWS[name](robot, rng, duration))


def strengthened(effect: Hidden, factor: float) -> Hidden:
    """Return the effect with a larger or smaller contribution to the readings.

    Args:
        effect: effect with its parameters.
        factor: [-] positive factor by which the contribution is multiplied.
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
        # The factor applies to the compliance, which is inversely proportional to the
        # modulus.
        elif name == "modulus_scale":
            given[key] = 1.0 / max(1.0 + factor * (1.0 / value - 1.0), 0.05)
        elif key == "factor":
            given[key] = 1.0 + factor * (value - 1.0)
        else:
            given[key] = value * factor
    return Hidden(name, given)


def _one(frames: list[Frame], rng: np.random.Generator) -> str:
    """Return the name of a random frame."""
    return frames[rng.integers(len(frames))].name


def _some(frames: list[Frame], rng: np.random.Generator) -> list[str]:
    """Return the name of a random frame, or the names of all frames."""
    if not frames:
        raise NotApplicable("the robot has no frame on which the effect acts")
    return [_one(frames, rng)] if rng.random() < 0.5 else [f.name for f in frames]


def _beams(robot: Robot) -> list[Frame]:
    return [f for f in robot.frames if isinstance(f.link, BeamLink)]


def _bodies(robot: Robot) -> list[Frame]:
    """Return the beams, or all bodies with a length if there are no beams."""
    return _beams(robot) or [f for f in robot.frames if f.translation.any()]


def _drives(robot: Robot) -> list[Frame]:
    return [f for f in robot.frames if f.actuated]


def _turning(robot: Robot) -> list[Frame]:
    return [f for f in _drives(robot) if f.joint == "revolute"]


def _vector(name: str, components: Iterable[str], values: NDArray) -> Parameters:
    """Return parameters ``<name>.<component>`` for the components of a vector."""
    keys = (f"{name}.{component}" for component in components)
    return dict(zip(keys, values.tolist(), strict=True))


def _wave(name: str, size: float, rng: np.random.Generator) -> Parameters:
    """Return a random amplitude and phase of a harmonic error of a frame."""
    amplitude = size * rng.uniform(0.5, 1.0)
    phase = rng.uniform(-math.pi, math.pi)
    return {f"{name}.amplitude": amplitude, f"{name}.phase": phase}


def _errors(frames: list[Frame], rng: np.random.Generator) -> Parameters:
    """Draw errors of about 1e-4 rad or m with random signs."""
    names = _some(frames, rng)
    signs = rng.choice([-1.0, 1.0], len(names)) * rng.uniform(0.4, 1.0, len(names))
    return dict(zip(names, (1e-4 * signs).tolist(), strict=True))


def _weight(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    heavy = any(f.mass for f in robot.frames) or any(
        isinstance(f.link, BeamLink) and f.link.density for f in robot.frames
    )
    if not heavy:
        raise NotApplicable("no part of the robot has a declared mass")
    tilt = rng.uniform(-0.2, 0.2, 2) if rng.random() < 0.5 else np.zeros(2)
    down = np.array([*np.sin(tilt), -1.0])
    return _vector("g", "xyz", 9.81 * down / np.linalg.norm(down))


def _delayed(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    names = _some(_bodies(robot), rng)
    late = [f"{name}.time_constant" for name in names]
    return dict.fromkeys(names, 2e-5) | dict.fromkeys(late, rng.uniform(500, 2000))


def _foundation(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    size = np.where(np.arange(6) < 3, 1e5, 1e6) * rng.uniform(0.5, 2.0, 6)
    return _vector("stiffness", SCREW, size)


def _eccentric(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    given: dict[str, float] = {}
    for name in _some(_turning(robot), rng):
        given |= _wave(name, 1e-4, rng)
    return given


def _registered(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    given = dict(_vector("base", SCREW, 1e-4 * rng.uniform(-1, 1, 6)))
    if rng.random() < 0.5:
        given |= _vector("tool", SCREW[3:], 1e-4 * rng.uniform(-1, 1, 3))
    return given


def _clearances(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    joints = [f for f in robot.frames if f.actuated and f.clearance is None]
    given: dict[str, float] = {}
    for name in _some(joints, rng):
        given |= {f"{name}.radial": 2e-5, f"{name}.axial": 2e-5, f"{name}.tilt": 2e-4}
    return given


def _friction(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    elastic = [f for f in _drives(robot) if own_compliance(f) > 0.0]
    names = _some(elastic, rng)
    compliance = {n: own_compliance(robot.frame(n)) for n in names}
    return {n: 1e-5 / c * rng.uniform(0.6, 1.4) for n, c in compliance.items()}


def _contacts(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    given = {}
    for name in _some(_drives(robot), rng):
        given[f"{name}.coefficient"] = 1e7 * rng.uniform(0.6, 1.6)
        given[f"{name}.exponent"] = 1.5
    return given


def _gain(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    factor = 1.0 + rng.choice([-0.08, 0.08])
    if rng.random() < 0.5:
        return {"factor": factor}
    offset = rng.uniform(-2, 2, 3).round(3)
    return {"factor": factor, **_vector("offset", WRENCH[3:], offset)}


def _heavier(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    heavy = [f for f in robot.frames if f.mass]
    if not heavy:
        raise NotApplicable("no body has a declared mass")
    name = _one(heavy, rng)
    given = {f"{name}.mass": rng.uniform(0.2, 0.6)}
    if rng.random() < 0.5:
        given |= _vector(f"{name}.moment", "xyz", rng.uniform(-0.03, 0.03, 3))
    return given


def _drifting(robot: Robot, rng: np.random.Generator, duration: float) -> Parameters:
    size = rng.choice([-1.0, 1.0], 6) * rng.uniform(0.3, 1.0, 6) * 1e-5
    late = duration * rng.uniform(0.15, 0.6)
    return {**_vector("amplitude", SCREW, size), "time_constant": late}


def _mesh(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    if not _turning(robot):
        raise NotApplicable("the robot has no revolute drive")
    return {f.name: 1e5 for f in _turning(robot)}


def _geared(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    given: dict[str, float] = {}
    for name in _some(_turning(robot), rng):
        given[f"{name}.order"] = float(rng.integers(3, 10))
        given |= _wave(name, 1e-4, rng)
    return given


def _slipping(robot: Robot, rng: np.random.Generator, duration: float) -> Parameters:
    name = _one(_drives(robot), rng)
    return {f"{name}.jump": 1e-4, f"{name}.at": duration * rng.uniform(0.3, 0.7)}


def _screws(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    given: dict[str, float] = {}
    for name in _some([f for f in _drives(robot) if f.joint == "prismatic"], rng):
        given |= _wave(name, 1e-5, rng)
        given[f"{name}.period"] = rng.choice([0.004, 0.005, 0.01, 0.016, 0.02])
    return given


def _stepped(robot: Robot, rng: np.random.Generator, _: float) -> Parameters:
    name = _one(_drives(robot), rng)
    soft, hard = rng.permutation([1e-5, 3e-6]).tolist()
    return {f"{name}.below": soft, f"{name}.above": hard, f"{name}.knee": 4.0}


# Functions that draw parameters from robot, random number generator and duration [s].
_DRAWS: dict[str, Callable[[Robot, np.random.Generator, float], Parameters]] = {
    "self_weight": _weight,
    "thermal_expansion": lambda r, rng, _: dict.fromkeys(_some(_bodies(r), rng), 2e-5),
    "delayed_expansion": _delayed,
    "drive_compliance": lambda robot, rng, _: {
        name: 1e5 * rng.uniform(0.6, 1.6) for name in _some(_drives(robot), rng)
    },
    "base_compliance": _foundation,
    "encoder_offset": lambda robot, rng, _: _errors(_drives(robot), rng),
    "encoder_eccentricity": _eccentric,
    "link_length": lambda robot, rng, _: _errors(_bodies(robot), rng),
    "registration": _registered,
    "modulus_scale": lambda r, rng, _: dict.fromkeys(_some(_beams(r), rng), 0.8),
    "joint_clearance": _clearances,
    "friction_hysteresis": _friction,
    "contact_stiffening": _contacts,
    "load_gain": _gain,
    "body_mass": _heavier,
    "device_scale": lambda _, rng, __: {"factor": 1.0 + rng.choice([-1e-4, 1e-4])},
    "geometric_stiffening": lambda *_: {},
    "drift": _drifting,
    "_pose_stiffness": _mesh,
    "_humidity": lambda r, rng, _: dict.fromkeys(_some(_beams(r), rng), 1e-5),
    "_quadratic_temperature": lambda r, rng, _: dict.fromkeys(
        _some(_beams(r), rng), 1e-5
    ),
    "_second_harmonic": _eccentric,
    "_growth": lambda r, rng, duration: dict.fromkeys(
        _some(_beams(r), rng), 1e-4 / duration
    ),
    "_gear": _geared,
    "_uneven_backlash": _eccentric,
    "_load_friction": lambda robot, rng, _: {
        name: 1e-4 * rng.uniform(0.5, 1.0) for name in _some(_drives(robot), rng)
    },
    "_cable": lambda robot, rng, _: {_one(_drives(robot), rng): 5.0},
    "_slipped": _slipping,
    "_lead": _screws,
    "_lead_backlash": _screws,
    "_two_steps": _stepped,
    "_torque_backlash": lambda robot, rng, _: {_one(_drives(robot), rng): 5e-5},
    "_tilting": lambda _, rng, __: {"gain": rng.uniform(0.7, 1.3)},
    "_stand": lambda _, rng, __: _vector("c", SCREW, 1e-5 * rng.uniform(-1, 1, 6)),
    "_sag": lambda *_: {"rate": 1e-6},
}
