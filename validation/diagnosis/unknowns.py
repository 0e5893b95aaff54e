"""Define the unknown machine parameters and the robot with given parameters.

A diagnosis determines parameters that a robot file lacks: library effects, geometric
errors, joint compliances and functions.  Together they form a vector x, and each x
defines a robot that can be saved.
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

# Ratio of prior standard deviation to plausible size of an effect's unknown.
_WIDE = 1e3
# Largest change of a function's shape parameter, and its prior standard deviation,
# relative to its value.
_BEND = 0.5
# Standard deviation of an unknown fixed at its declared value, in plausible sizes.
_HELD = 1e-12
STEP = 1e-4  # step of numerical derivatives relative to the size of a parameter


@dataclass(frozen=True, eq=False)
class Small:
    """Geometric errors or joint compliances of many frames, with Gaussian priors.

    Attributes:
        name: ``"geometry"`` or ``"springs"``.
        frame: (k,) index of the frame in the robot.
        axis: (k,) component of the screw at the frame, 0 to 5.
        std: (k,) [rad, m] or [rad/(N m), m/N] prior standard deviations about the
            declared values.
    """

    name: str
    frame: NDArray
    axis: NDArray
    std: NDArray

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def bounds(self) -> tuple[NDArray, NDArray]:
        """(k,) lower and upper bounds; a joint can only become more compliant."""
        least = -np.inf if self.name == GEOMETRY else 0.0
        return np.full(len(self), least), np.full(len(self), np.inf)


@dataclass(frozen=True, eq=False)
class Acting:
    """A library effect that acts in all rows or in one session.

    Attributes:
        hypothesis: effect with its frames and unknowns.
        mean: (k,) prior means, which are also the start values of a fit.
        session: session in which the effect acts, None for all sessions.
        device: whether the effect is the pose of a measuring frame, which is always
            fitted.
    """

    hypothesis: Hypothesis
    mean: NDArray
    session: str | None = None
    device: bool = False

    def __len__(self) -> int:
        return len(self.hypothesis.slots)

    @property
    def std(self) -> NDArray:
        """(k,) prior standard deviations, so large that the prior is nearly flat."""
        unknowns = [slot.unknown for slot in self.hypothesis.slots]
        wide = [(_HELD if u.upper == u.lower else _WIDE) * u.scale for u in unknowns]
        return np.array(wide)

    @property
    def bounds(self) -> tuple[NDArray, NDArray]:
        """(k,) lower and upper bounds, from the library."""
        return self.hypothesis.bounds


@dataclass(frozen=True, eq=False)
class LearnedFunction:
    """A learned function with unknown coefficients.

    Attributes:
        candidate: places, variables and form of the function.
        coefficients: (m,) prior standard deviations of the coefficients.
    """

    candidate: Candidate
    coefficients: NDArray

    def __len__(self) -> int:
        return len(self.std)

    @property
    def std(self) -> NDArray:
        """(m,) or (m + 1,) prior standard deviations; the last belongs to the shape."""
        return np.concatenate([self.coefficients, _BEND * self.candidate.shape.bends])

    @property
    def bounds(self) -> tuple[NDArray, NDArray]:
        """(m,) or (m + 1,) lower and upper bounds; the last belong to the shape."""
        upper = np.full(len(self), np.inf)
        upper[len(self.coefficients) :] = self.std[len(self.coefficients) :]
        return -upper, upper


Part = Acting | Small | LearnedFunction


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The unknown parameters x of a robot, with their prior.

    Attributes:
        robot: declared robot with the effects of its file.
        effects: library effects, including the registration.
        small: geometric errors and joint compliances.
        functions: learned functions.
        sensitivities: derivatives by which functions are normalised; None without
            functions.
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
        """Parts of the parameter vector x and their slices, in the order of x."""
        parts: list[Part] = [*self.effects, *self.small, *self.functions]
        ends = np.cumsum([len(part) for part in parts]).tolist()
        return [
            (p, slice(end - len(p), end)) for p, end in zip(parts, ends, strict=True)
        ]

    def place(self, part: Part) -> slice:
        """Return the slice of a part in the parameter vector x."""
        return next(own for one, own in self.places if one is part)

    @property
    def mean(self) -> NDArray:
        """(k,) prior means, which are also the start values of a fit."""
        zeros = np.zeros(len(self) - sum(len(one) for one in self.effects))
        return np.concatenate([*(one.mean for one in self.effects), zeros])

    @property
    def std(self) -> NDArray:
        """(k,) prior standard deviations."""
        return np.concatenate([np.zeros(0), *(part.std for part, _ in self.places)])

    @property
    def bounds(self) -> tuple[NDArray, NDArray]:
        """(k,) lower and upper bounds."""
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
        """Return the effects to add to the file, for all rows or a session."""
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
        """Return the derivatives of the readings by x (k,) in the linear model.

        Returns:
            (R, 6, k) [rad, m] per unit of x; zero in rows without a solution.
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
        """Remove the unknowns of one effect."""
        kept = tuple(one for one in self.effects if one is not effect)
        return replace(self, effects=kept)


def effects_in(robot: Robot, session: str | None) -> Mapping[str, Values]:
    """Return a robot's effects for all rows, or for one session only."""
    if session is None:
        return robot.effects
    return robot.session_effects.get(session, {})


def with_effects_in(
    robot: Robot, session: str | None, effects: Mapping[str, Values]
) -> Robot:
    """Replace a robot's effects for all rows, or for one session only."""
    if session is None:
        return replace(robot, effects=effects)
    sessions = {**robot.session_effects, session: effects}
    return replace(robot, session_effects=sessions)


def _linear(conditions: Conditions) -> Conditions:
    """Return the linear model, in which clearances of closed chains are fixed."""
    conditions = replace(conditions, exact=False)
    loose = virtual_joints(conditions.robot).cones.shape[1]
    if loose and conditions.robot.closures and conditions.rest is None:
        return with_rest_positions(conditions)
    return conditions


def _resting_as(conditions: Conditions, held: Conditions) -> Conditions:
    """Give conditions the rest positions of ``held``; new frames are at 0."""
    assert held.rest is not None
    rest = np.zeros_like(conditions.errors)
    for row, frame in enumerate(conditions.robot.frames):
        if any(frame.name == other.name for other in held.robot.frames):
            rest[:, row] = held.rest[:, held.robot.index(frame.name)]
    return replace(conditions, rest=rest)
