"""Define the unknown machine parameters and compute the robot for given values.

The unknown parameters describe library effects, geometric errors, joint compliances and
functions.  Together they form a vector x.  Each value of x defines a robot.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.combine import combined
from forcefit.assembly.effects.effect import Values
from forcefit.assembly.linear.closure import virtual_joints
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import predict, with_rest_positions
from forcefit.assembly.model.robot import Robot
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.candidates import Candidate
from forcefit.validation.diagnosis.hypotheses import Hypothesis
from forcefit.validation.diagnosis.nuisance import GEOMETRY, with_compliance, with_error
from forcefit.validation.diagnosis.responses import responses
from forcefit.validation.diagnosis.sensitivities import Sensitivities
from forcefit.validation.diagnosis.signatures import conditions_of

# Prior standard deviation of an effect parameter, relative to a plausible value.
_WIDE = 1e3
# Largest change of a nonlinear parameter of a function, and prior standard deviation of
# this change, relative to the value of the parameter.
_BEND = 0.5
# Prior standard deviation of an unknown that is held fixed, relative to a plausible
# value.
_HELD = 1e-12
STEP = 1e-4  # step of numerical derivatives, relative to the parameter


@dataclass(frozen=True, eq=False)
class Small:
    """Geometric errors or joint compliances of many frames, with Gaussian priors.

    Attributes:
        name: ``"geometry"`` or ``"springs"``.
        frame: (k,) index of the frame in the robot.
        axis: (k,) screw component at the frame, 0 to 5.
        std: (k,) prior standard deviations about the declared values, [rad, m] for
            geometric errors or [rad/(N m), m/N] for compliances.
    """

    name: str
    frame: NDArray
    axis: NDArray
    std: NDArray

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def bounds(self) -> tuple[NDArray, NDArray]:
        """Lower bounds (k,) and upper bounds (k,).

        The additional compliance of a joint cannot be negative.
        """
        least = -np.inf if self.name == GEOMETRY else 0.0
        return np.full(len(self), least), np.full(len(self), np.inf)


@dataclass(frozen=True, eq=False)
class Acting:
    """A library effect that acts in all sessions or in one session.

    Attributes:
        hypothesis: effect with its frames and unknowns.
        mean: (k,) prior means, which are also the start values of a fit.
        session: session in which the effect acts, None for all sessions.
        device: whether the effect is the pose of a measuring frame.
    """

    hypothesis: Hypothesis
    mean: NDArray
    session: str | None = None
    device: bool = False

    def __len__(self) -> int:
        return len(self.hypothesis.slots)

    @property
    def std(self) -> NDArray:
        """Prior standard deviations (k,), much larger than plausible values."""
        unknowns = [slot.unknown for slot in self.hypothesis.slots]
        wide = [(_HELD if u.upper == u.lower else _WIDE) * u.scale for u in unknowns]
        return np.array(wide)

    @property
    def bounds(self) -> tuple[NDArray, NDArray]:
        """Lower bounds (k,) and upper bounds (k,)."""
        return self.hypothesis.bounds


@dataclass(frozen=True, eq=False)
class LearnedFunction:
    """A learned function with unknown coefficients.

    Attributes:
        candidate: locations, variables and form of the function.
        coefficients: (m,) prior standard deviations of the coefficients.
    """

    candidate: Candidate
    coefficients: NDArray

    def __len__(self) -> int:
        return len(self.std)

    @property
    def std(self) -> NDArray:
        """Prior standard deviations (m,), or (m + 1,) with a shape parameter."""
        return np.concatenate([self.coefficients, _BEND * self.candidate.shape.bends])

    @property
    def bounds(self) -> tuple[NDArray, NDArray]:
        """Lower and upper bounds, each (m,), or (m + 1,) with a shape parameter."""
        upper = np.full(len(self), np.inf)
        upper[len(self.coefficients) :] = self.std[len(self.coefficients) :]
        return -upper, upper


Part = Acting | Small | LearnedFunction


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The unknown parameters x of a robot, with their prior.

    Attributes:
        robot: robot as described in its file.
        effects: library effects, including the pose of the measuring device.
        small: geometric errors and joint compliances.
        functions: learned functions.
        sensitivities: derivatives of the readings with respect to the functions.  None
            if there are no functions.
    """

    robot: Robot
    effects: tuple[Acting, ...] = ()
    small: tuple[Small, ...] = ()
    functions: tuple[LearnedFunction, ...] = ()
    sensitivities: Sensitivities | None = None

    def __len__(self) -> int:
        return sum(len(part) for part, _ in self.places)

    @cached_property
    def places(self) -> list[tuple[Part, slice]]:
        """Effects, nuisance parameters and functions, with their slices of x."""
        parts: list[Part] = [*self.effects, *self.small, *self.functions]
        ends = np.cumsum([len(part) for part in parts]).tolist()
        return [
            (p, slice(end - len(p), end)) for p, end in zip(parts, ends, strict=True)
        ]

    def place(self, part: Part) -> slice:
        """Return the slice of x that contains a group of parameters."""
        return next(own for one, own in self.places if one is part)

    @property
    def mean(self) -> NDArray:
        """Prior means (k,), which are also the start values of a fit."""
        zeros = np.zeros(len(self) - sum(len(one) for one in self.effects))
        return np.concatenate([*(one.mean for one in self.effects), zeros])

    @property
    def std(self) -> NDArray:
        """Prior standard deviations (k,)."""
        return np.concatenate([np.zeros(0), *(part.std for part, _ in self.places)])

    @property
    def bounds(self) -> tuple[NDArray, NDArray]:
        """Lower bounds (k,) and upper bounds (k,)."""
        both = [np.zeros((2, 0)), *(np.array(part.bounds) for part, _ in self.places)]
        lower, upper = np.hstack(both)
        return lower, upper

    def robot_at(self, x: NDArray) -> Robot:
        """Return the robot with parameters x (k,)."""
        robot, functions = self.robot, list(self.robot.functions)
        for part, own in self.places:
            if isinstance(part, Small):
                change = with_error if part.name == GEOMETRY else with_compliance
                robot = change(robot, part.frame, part.axis, x[own])
            elif isinstance(part, LearnedFunction):
                assert self.sensitivities is not None
                functions += self.sensitivities.fitted(
                    part.candidate, x[own], np.zeros(len(part))
                )
        robot = replace(robot, functions=tuple(functions))
        for session, found in self._effects_at(x).items():
            both = combined(effects_in(robot, session), found)
            robot = with_effects_in(robot, session, both)
        return robot

    def _effects_at(self, x: NDArray) -> dict[str | None, dict[str, dict[str, float]]]:
        """Return the effects to add to the robot file, for each session."""
        found: dict[str | None, dict[str, dict[str, float]]] = {}
        for one in self.effects:
            values = one.hypothesis.public(
                self.robot.without_effects(), x[self.place(one)]
            )
            effects = found.setdefault(one.session, {})
            if values or not one.hypothesis.slots:
                effects.setdefault(one.hypothesis.effect, {}).update(values)
        return found

    def slopes(self, campaign: Campaign, x: NDArray) -> NDArray:
        """Return the derivatives of the readings with respect to x (k,).

        Returns:
            (R, 6, k) [rad, m] derivatives of the linear model, zero in rows without a
            solution.
        """
        robot = self.robot_at(x)
        conditions = _linear(conditions_of(replace(campaign, robot=robot)))
        response = responses(conditions)
        J = np.zeros((len(campaign), 6, len(x)))
        own_rows = np.array([conditions.robot.index(f.name) for f in robot.frames])
        middle = predict(conditions).deviation if self.effects else np.zeros(0)
        for part, own in self.places:
            if isinstance(part, Small):
                rows = own_rows[part.frame]
                J[:, :, own] = response.screws[:, :, rows, part.axis]
                if part.name != GEOMETRY:
                    J[:, :, own] *= response.wrenches[:, None, rows, part.axis]
            elif isinstance(part, LearnedFunction):
                assert self.sensitivities is not None
                there = self.sensitivities.about(conditions, response)
                J[:, :, own] = there.changes(part.candidate, x[own])
            else:
                for k, slot in enumerate(part.hypothesis.slots, own.start):
                    if slot.unknown.lower == slot.unknown.upper:
                        continue
                    step = STEP * max(slot.unknown.scale, abs(x[k]))
                    if x[k] + step > slot.unknown.upper:
                        step = -step
                    moved = x.copy()
                    moved[k] += step
                    there_robot = replace(campaign, robot=self.robot_at(moved))
                    other = replace(conditions_of(there_robot), exact=False)
                    if conditions.rest is not None:
                        other = _resting_as(other, conditions)
                    J[:, :, k] = (predict(other).deviation - middle) / step
        return np.nan_to_num(J, nan=0.0, posinf=0.0, neginf=0.0)

    def without(self, effect: Acting) -> "Unknowns":
        """Return a copy without the unknown parameters of one effect."""
        kept = tuple(one for one in self.effects if one is not effect)
        return replace(self, effects=kept)


def effects_in(robot: Robot, session: str | None) -> Mapping[str, Values]:
    """Return the effects of a robot for one session.

    If the session is None, return the effects that act in all sessions.
    """
    if session is None:
        return robot.effects
    return robot.session_effects.get(session, {})


def with_effects_in(
    robot: Robot, session: str | None, effects: Mapping[str, Values]
) -> Robot:
    """Return a robot with replaced effects in one session.

    If the session is None, the effects act in all sessions.
    """
    if session is None:
        return replace(robot, effects=effects)
    sessions = {**robot.session_effects, session: effects}
    return replace(robot, session_effects=sessions)


def _linear(conditions: Conditions) -> Conditions:
    """Return conditions for the linear model, with joints fixed at rest positions."""
    conditions = replace(conditions, exact=False)
    loose = virtual_joints(conditions.robot).cones.shape[1]
    if loose and conditions.robot.closures and conditions.rest is None:
        return with_rest_positions(conditions)
    return conditions


def _resting_as(conditions: Conditions, held: Conditions) -> Conditions:
    """Return conditions with the rest positions of joints of other conditions."""
    assert held.rest is not None
    rest = np.zeros_like(conditions.errors)
    for row, frame in enumerate(conditions.robot.frames):
        if any(frame.name == other.name for other in held.robot.frames):
            rest[:, row] = held.rest[:, held.robot.index(frame.name)]
    return replace(conditions, rest=rest)
