"""Store the covariance of the parameters of a robot file in a separate file.

Parameters are geometric errors, joint compliances, effect parameters and function
coefficients.  Their posterior covariance C determines the uncertainty of predicted
readings.  The covariance of the readings is J C J', where J contains the derivatives of
the readings with respect to the parameters.
"""

import io
import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from forcefit.assembly.model.function import Function
from forcefit.assembly.model.links import in_series
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import write_bytes
from forcefit.validation.campaign.campaign import READING
from forcefit.validation.diagnosis.fit import MachineFit
from forcefit.validation.diagnosis.nuisance import GEOMETRY, with_error
from forcefit.validation.diagnosis.unknowns import (
    STEP,
    Small,
    effects_in,
    with_effects_in,
)

ERROR, COMPLIANCE, EFFECT, FUNCTION = (
    "geometric_error", "joint_compliance", "effect", "function",
)  # fmt: skip
# Lower bound on the compliance of a joint, relative to the declared compliance.
_STAYS = 1e-3


@dataclass(frozen=True)
class Number:
    """Identifier of a parameter in a robot file.

    Attributes:
        kind: ``"geometric_error"``, ``"joint_compliance"``, ``"effect"`` or
            ``"function"``.
        owner: name of the frame or effect, or index of the function.
        name: name of the screw component or of the parameter.
        session: session in which the effect acts, ``""`` for all sessions.
    """

    kind: str
    owner: str
    name: str
    session: str = ""

    def of(self, robot: Robot) -> float:
        """Return the value of the parameter in a robot.

        For a joint compliance, the value is 0, because compliances are differences from
        this robot.
        """
        if self.kind == ERROR:
            return float(
                robot.errors[robot.index(self.owner), READING.index(self.name)]
            )
        if self.kind == EFFECT:
            effects = effects_in(robot, self.session or None)
            return float(effects.get(self.owner, {}).get(self.name, 0.0))
        if self.kind == FUNCTION:
            return float(robot.functions[int(self.owner)].parameters[self.name])
        return 0.0

    def moved(self, robot: Robot, by: float) -> Robot:
        """Return the robot after increasing the parameter."""
        if self.kind == ERROR:
            row, axis = robot.index(self.owner), READING.index(self.name)
            return with_error(robot, *map(np.atleast_1d, (row, axis, by)))
        if self.kind == COMPLIANCE:
            return self._softened(robot, by)
        if self.kind == FUNCTION:
            functions = list(robot.functions)
            one = functions[int(self.owner)]
            more = {**one.parameters, self.name: one.parameters[self.name] + by}
            functions[int(self.owner)] = replace(one, parameters=more)
            return replace(robot, functions=tuple(functions))
        effects = effects_in(robot, self.session or None)
        own = {**effects.get(self.owner, {}), self.name: self.of(robot) + by}
        return with_effects_in(
            robot, self.session or None, {**effects, self.owner: own}
        )

    def _softened(self, robot: Robot, by: float) -> Robot:
        """Return the robot with an increased joint compliance."""
        row, axis = robot.index(self.owner), READING.index(self.name)
        K = robot.frames[row].resistance
        stiffness = np.inf if K is None else float(K[axis, axis])
        soft = 1 / stiffness if 0.0 < stiffness < np.inf else 0.0
        by = max(by, -(1 - _STAYS) * soft)
        if not by:
            return robot
        frames = list(robot.frames)
        frames[row] = replace(frames[row], joint_stiffness=in_series(K, axis, by))
        return replace(robot, frames=tuple(frames))


@dataclass(frozen=True, eq=False)
class SavedCovariance:
    """Parameters of a robot file and their covariance.

    Attributes:
        numbers: the k parameters.
        covariance: (k, k) covariance in SI units.
    """

    numbers: tuple[Number, ...]
    covariance: NDArray

    @property
    def std(self) -> NDArray:
        """Standard deviations (k,) of the parameters."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def covariance_of(fit: MachineFit, robot: Robot) -> SavedCovariance:
    """Return the first-order covariance of the parameters of a fitted robot."""
    numbers = _numbers(fit, robot)
    J = np.zeros((len(numbers), len(fit.x)))
    middle = np.array([n.of(robot) for n in numbers])
    for part, own in fit.unknowns.places:
        if isinstance(part, Small) and part.name != GEOMETRY:
            springs = [numbers.index(n) for n in _of_frames(part, robot)]
            J[springs, np.arange(own.start, own.stop)] = 1.0
            continue
        for k in range(own.start, own.stop):
            step = STEP * fit.std[k]
            if step > 0.0:
                moved = fit.x.copy()
                moved[k] += step
                other = fit.unknowns.robot_at(moved)
                there = np.array([_value(n, other, robot) for n in numbers])
                J[:, k] = (there - middle) / step
    return SavedCovariance(tuple(numbers), J @ fit.covariance @ J.T)


def _value(number: Number, robot: Robot, saved: Robot) -> float:
    """Return the value of a parameter in a modified robot, or 0 if it is absent."""
    if number.kind != FUNCTION:
        return number.of(robot)
    # A function may be absent from the modified robot, or may have a different index.
    own = saved.functions[int(number.owner)]
    alike = [f for f in saved.functions if _names(f) == _names(own)]
    there = [f for f in robot.functions if _names(f) == _names(own)]
    place = next(k for k, f in enumerate(alike) if f is own)
    if place >= len(there):
        return 0.0
    return float(there[place].parameters.get(number.name, 0.0))


def _names(function: Function) -> tuple[object, ...]:
    """Return the properties that identify a function in a robot file."""
    return function.where, function.variables, function.form, function.kind


def _numbers(fit: MachineFit, robot: Robot) -> list[Number]:
    """Return the identifiers of the parameters that depend on the fitted unknowns."""
    numbers = [n for part in fit.unknowns.small for n in _of_frames(part, robot)]
    for one in fit.unknowns.effects:
        effect = one.hypothesis.effect
        for name in effects_in(robot, one.session).get(effect, {}):
            number = Number(EFFECT, effect, name, one.session or "")
            if number not in numbers:
                numbers.append(number)
    first = len(fit.unknowns.robot.functions)
    for k, function in enumerate(robot.functions[first:], first):
        numbers += [Number(FUNCTION, str(k), name) for name in function.std]
    return numbers


def _of_frames(part: Small, robot: Robot) -> list[Number]:
    """Return the identifiers of geometric errors or joint compliances."""
    kind = ERROR if part.name == GEOMETRY else COMPLIANCE
    return [
        Number(kind, robot.frames[row].name, READING[axis])
        for row, axis in zip(part.frame, part.axis, strict=True)
    ]


def write_covariance(saved: SavedCovariance, path: Path | str) -> None:
    """Write a covariance as an array file with the suffix ``.npz``.

    Raises:
        BadInput: the file cannot be written.
    """
    labels = [json.dumps([n.kind, n.owner, n.name, n.session]) for n in saved.numbers]
    content = io.BytesIO()
    np.savez_compressed(
        content, numbers=np.array(labels, dtype=str), covariance=saved.covariance
    )
    write_bytes(content.getvalue(), path)


def read_covariance(robot: Robot) -> SavedCovariance | None:
    """Read the covariance file of a robot.

    Returns:
        The covariance, or None if the robot has no covariance file.

    Raises:
        BadInput: the file does not exist, or belongs to a different robot.
    """
    path = robot.diagnosis.get("covariance")
    if not path:
        return None
    expected = "expected the covariance that was written with the robot file"
    try:
        archive = io.BytesIO(Path(path).read_bytes())
        with np.load(archive, allow_pickle=False) as content:
            labels = content["numbers"].tolist()
            C = np.array(content["covariance"], dtype=float)
        numbers = tuple(Number(*json.loads(label)) for label in labels)
        values = [number.of(robot) for number in numbers]
    except FileNotFoundError:
        raise BadInput(f"{path}: no such file; {expected}") from None
    except Exception:  # a damaged archive may raise any exception
        raise BadInput(f"{path}: found damaged content, {expected}") from None
    if C.shape != (len(values), len(values)) or not np.isfinite(C).all():
        raise BadInput(
            f"{path}: found a matrix of shape {C.shape} or invalid values, expected "
            f"{len(values)} rows and columns of finite numbers"
        )
    return SavedCovariance(numbers, C)


def known_covariance(robot: Robot) -> SavedCovariance:
    """Return the covariance of all parameters in a robot file.

    Returns:
        The covariance from the covariance file of the robot.  Further parameters are
        treated as independent, with the standard deviations ``tolerance`` of frames and
        ``std`` of functions.

    Raises:
        BadInput: as for :func:`read_covariance`.
    """
    saved = read_covariance(robot) or SavedCovariance((), np.zeros((0, 0)))
    further = {
        Number(ERROR, frame.name, axis): sigma
        for frame in robot.frames if frame.tolerance is not None
        for axis, sigma in zip(READING, frame.tolerance.tolist(), strict=True)
    }  # fmt: skip
    for k, function in enumerate(robot.functions):
        further |= {Number(FUNCTION, str(k), n): s for n, s in function.std.items()}
    alone = {n: s for n, s in further.items() if s > 0.0 and n not in saved.numbers}
    variance = np.diag(np.square([*alone.values()]))
    C = block_diag(saved.covariance, variance) if alone else saved.covariance
    return SavedCovariance((*saved.numbers, *alone), C)
