r"""The unknown numbers of a machine, and the robot that has them.

A diagnosis finds which numbers a robot file lacks: effects of the library, geometric
errors, compliances of joints, functions.  Side by side they are a vector x, and every
x is a robot, the one that can be saved.

======  ==============  =========  ===================================================
symbol  code            shape      meaning
======  ==============  =========  ===================================================
x       ``x``           (k,)       effects, geometric errors, compliances, functions
m       ``mean``        (k,)       mean of the prior
s       ``std``         (k,)       standard deviation of the prior, in the unit of x
J       ``slopes``      (R, 6, k)  change of the readings per unit of x
======  ==============  =========  ===================================================
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly.effects.combine import combined
from assembly.effects.effect import Values
from assembly.linear.closure import virtual_joints
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict, with_rest_positions
from assembly.model.robot import Robot
from validation.campaign.campaign import Campaign
from validation.diagnosis.candidates import Candidate, Sensitivities
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.responses import responses
from validation.diagnosis.signatures import conditions_of
from validation.diagnosis.small_terms import GEOMETRY, with_compliance, with_error

_WIDE = 1e3  # plausible sizes of an effect's unknown: standard deviation of its prior
_BEND = 0.5  # of a number in which a function is not linear, likewise; and its bound
_HELD = 1e-12  # plausible sizes, of an unknown whose value the file declares
_STEP = 1e-4  # of an unknown's size, for its derivative


@dataclass(frozen=True, eq=False)
class Small:
    """Geometric errors or joint compliances of many frames, with Gaussian priors.

    Attributes:
        name: ``"geometry"`` or ``"springs"``.
        frame: (k,) row of the frame in the robot.
        axis: (k,) component of the screw there, 0 to 5.
        std: (k,) [rad, m] or [rad/(N m), m/N] of the prior about what is declared.
    """

    name: str
    frame: NDArray
    axis: NDArray
    std: NDArray

    def __len__(self) -> int:
        return len(self.frame)


@dataclass(frozen=True, eq=False)
class Acting:
    """An effect of the library, in all rows or in those of one session.

    Attributes:
        hypothesis: where it acts and what is unknown.
        start: (k,) where a fit begins, and the mean of its prior.
        session: the only one in which it acts, None in all.
        device: whether it is the place of a measuring frame, which is always unknown.
    """

    hypothesis: Hypothesis
    start: NDArray
    session: str | None = None
    device: bool = False

    def __len__(self) -> int:
        return len(self.hypothesis.slots)


@dataclass(frozen=True, eq=False)
class LearnedFunction:
    """A function of the machine whose coefficients are unknown.

    Attributes:
        candidate: where it acts, of what, in which form.
        coefficients: (m,) standard deviations of their prior.
    """

    candidate: Candidate
    coefficients: NDArray

    def __len__(self) -> int:
        return len(self.std)

    @property
    def std(self) -> NDArray:
        """(m,) or (m + 1,): last that of the number in which it is not linear."""
        bends = _BEND * self.candidate.shape.bends
        return np.concatenate([self.coefficients, bends])


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The unknown numbers x of a robot, with their prior.

    Attributes:
        robot: as declared, with the effects of its file.
        effects: of the library, the registration among them.
        small: geometric errors and joint compliances.
        functions: learned ones.
        sensitivities: by which functions are normalised; None without functions.
    """

    robot: Robot
    effects: tuple[Acting, ...] = ()
    small: tuple[Small, ...] = ()
    functions: tuple[LearnedFunction, ...] = ()
    sensitivities: Sensitivities | None = None

    def __len__(self) -> int:
        return sum(len(part) for part in self.parts)

    @property
    def parts(self) -> tuple[Acting | Small | LearnedFunction, ...]:
        """What x consists of, in its order."""
        return (*self.effects, *self.small, *self.functions)

    @cached_property
    def slices(self) -> list[slice]:
        """Where each of :attr:`parts` is in x."""
        ends = np.cumsum([0, *(len(part) for part in self.parts)]).tolist()
        return [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]

    @property
    def mean(self) -> NDArray:
        """(k,) mean of the prior, where a fit begins."""
        zeros = np.zeros(len(self) - sum(len(one) for one in self.effects))
        return np.concatenate([*(one.start for one in self.effects), zeros])

    @property
    def std(self) -> NDArray:
        """(k,) standard deviation of the prior; of effects so wide that it is flat."""
        wide = [
            (_HELD if slot.unknown.upper == slot.unknown.lower else _WIDE)
            * slot.unknown.scale
            for e in self.effects
            for slot in e.hypothesis.slots
        ]
        priors = [*(p.std for p in self.small), *(f.std for f in self.functions)]
        return np.concatenate([np.array(wide), *priors])

    @property
    def bounds(self) -> tuple[NDArray, NDArray]:
        """(k,) lower and upper: of effects as the library says, compliances above 0."""
        lower, upper = np.full(len(self), -np.inf), np.full(len(self), np.inf)
        for part, own in zip(self.parts, self.slices, strict=True):
            if isinstance(part, Acting):
                lower[own], upper[own] = part.hypothesis.bounds
            elif isinstance(part, Small) and part.name != GEOMETRY:
                lower[own] = 0.0
            elif isinstance(part, LearnedFunction):
                bends = part.candidate.shape.bends
                upper[own.stop - len(bends) : own.stop] = _BEND * bends
                lower[own.stop - len(bends) : own.stop] = -_BEND * bends
        return lower, upper

    def robot_at(self, x: NDArray) -> Robot:
        """The robot that has these numbers.

        Args:
            x: (k,).

        Returns:
            The declared robot with them built in: what is saved, and what is judged.
        """
        robot, functions = self.robot, list(self.robot.functions)
        for part, own in zip(self.parts, self.slices, strict=True):
            if isinstance(part, Small):
                change = with_error if part.name == GEOMETRY else with_compliance
                robot = change(robot, part.frame, part.axis, x[own])
            elif isinstance(part, LearnedFunction):
                assert self.sensitivities is not None
                functions += self.sensitivities.fitted(
                    part.candidate, x[own], np.zeros(len(part))
                )
        effects, sessions = self._effects_at(x)
        return replace(
            robot, effects=effects, session_effects=sessions, functions=tuple(functions)
        )

    def _effects_at(
        self, x: NDArray
    ) -> tuple[dict[str, Values], dict[str, dict[str, Values]]]:
        """Effects of all rows, and of each session, those of the file included."""
        found: dict[str | None, dict[str, dict[str, float]]] = {None: {}}
        for one, own in zip(self.effects, self.slices, strict=False):
            values = one.hypothesis.public(self.robot.without_effects(), x[own])
            effects = found.setdefault(one.session, {})
            if values or not one.hypothesis.slots:
                effects.setdefault(one.hypothesis.effect, {}).update(values)
        sessions: dict[str, dict[str, Values]] = {
            s: dict(e) for s, e in self.robot.session_effects.items()
        }
        for session, effects in found.items():
            if session is not None:
                sessions[session] = dict(combined(sessions.get(session, {}), effects))
        return dict(combined(self.robot.effects, found[None])), sessions

    def slopes(self, campaign: Campaign, x: NDArray) -> NDArray:
        """Change of the readings per unknown, by the linear model at a robot.

        Args:
            campaign: of R rows.
            x: (k,) where it is taken.

        Returns:
            (R, 6, k) [rad, m] per unit of x; zero where the model has no answer.
        """
        robot = self.robot_at(x)
        conditions = _linear(conditions_of(replace(campaign, robot=robot)))
        response = responses(conditions)
        J = np.zeros((len(campaign), 6, len(x)))
        lower, upper = self.bounds
        own_rows = np.array([conditions.robot.index(f.name) for f in robot.frames])
        middle = predict(conditions).deviation if self.effects else np.zeros(0)
        for part, own in zip(self.parts, self.slices, strict=True):
            if isinstance(part, Small):
                rows = own_rows[part.frame]
                columns = response.screws[:, :, rows, part.axis]
                if part.name != GEOMETRY:
                    columns = columns * response.wrenches[:, None, rows, part.axis]
                J[:, :, own] = columns
            elif isinstance(part, LearnedFunction):
                assert self.sensitivities is not None
                there = self.sensitivities.about(conditions, response)
                J[:, :, own] = there.changes(part.candidate, x[own])
            else:
                for k in range(own.start, own.stop):
                    if lower[k] == upper[k]:
                        continue
                    moved, step = self._moved(x, k, part)
                    there_robot = replace(campaign, robot=self.robot_at(moved))
                    other = replace(conditions_of(there_robot), exact=False)
                    if conditions.rest is not None:
                        other = _resting_as(other, conditions)
                    J[:, :, k] = (predict(other).deviation - middle) / step
        return np.nan_to_num(J, nan=0.0, posinf=0.0, neginf=0.0)

    def _moved(self, x: NDArray, k: int, part: Acting) -> tuple[NDArray, float]:
        """X with one unknown changed by a small step, within its bounds."""
        slot = part.hypothesis.slots[k - self.slices[self.parts.index(part)].start]
        step = _STEP * max(slot.unknown.scale, abs(x[k]))
        if x[k] + step > slot.unknown.upper:
            step = -step
        moved = x.copy()
        moved[k] += step
        return moved, step

    def without(self, effects: Sequence[Acting]) -> "Unknowns":
        """The same without some of its effects."""
        kept = tuple(one for one in self.effects if not any(one is e for e in effects))
        return replace(self, effects=kept)

    def names(self) -> list[str]:
        """(k,) public names: effect, frame and component of each unknown."""
        names: list[str] = []
        frames = self.robot.frames
        for part in self.parts:
            if isinstance(part, Acting):
                h = part.hypothesis
                names += [f"{h.effect} {' '.join(s.names)}" for s in h.slots]
            elif isinstance(part, Small):
                names += [
                    f"{part.name} {frames[i].name} {a}"
                    for i, a in zip(part.frame, part.axis, strict=True)
                ]
            else:
                names += [f"function {k + 1}" for k in range(len(part))]
        return names


def _linear(conditions: Conditions) -> Conditions:
    """The linear model, clearances of closed chains held where they rest."""
    conditions = replace(conditions, exact=False)
    loose = virtual_joints(conditions.robot).cones.shape[1]
    if loose and conditions.robot.closures and conditions.rest is None:
        return with_rest_positions(conditions)
    return conditions


def _resting_as(conditions: Conditions, held: Conditions) -> Conditions:
    """Conditions with clearances where they rest in others; a foundation has none."""
    assert held.rest is not None
    rest = np.zeros_like(conditions.errors)
    for row, frame in enumerate(conditions.robot.frames):
        if any(frame.name == other.name for other in held.robot.frames):
            rest[:, row] = held.rest[:, held.robot.index(frame.name)]
    return replace(conditions, rest=rest)
