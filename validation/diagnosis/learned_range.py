"""Find rows outside the range of the variables in which a model was identified.

An identified effect is known only in the range of the variables in the campaign.  If a
joint made a full turn, its angle is compared modulo one turn, unless a function in the
robot file is not periodic in this angle.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.places import drives
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.robot import Robot
from forcefit.validation.campaign.campaign import LOAD, Campaign

_MARGIN = 0.05  # accepted distance from the range, relative to its width
_SAME = 1e-3  # accepted distance from the range, relative to the largest value
# Functional forms that are periodic in the first variable. The first two forms are also
# periodic in the second variable.
_PERIODIC = ("waves", "reversal_waves", "scaled_waves", "reversal", "slip")


@dataclass(frozen=True)
class Beyond:
    """A variable outside the range in which a robot was identified.

    Attributes:
        variable: public name of the variable.
        learned: smallest and largest value in the campaign used for identification.
        now: smallest and largest value in the campaign to be predicted.
        rows: number of rows outside the range in the campaign to be predicted.
        count: number of all rows in the campaign to be predicted.
    """

    variable: str
    learned: tuple[float, float]
    now: tuple[float, float]
    rows: int
    count: int

    def table(self) -> dict[str, Any]:
        """Convert to plain values."""
        return {
            "variable": self.variable, "learned": list(self.learned),
            "now": list(self.now), "rows": self.rows,
        }  # fmt: skip

    def __str__(self) -> str:
        (low, high), (least, most) = self.learned, self.now
        return (
            f"{self.variable} is {least:g} to {most:g}, outside the identified range "
            f"{low:g} to {high:g}, in {self.rows} of {self.count} rows"
        )


def learned_range(campaign: Campaign, rows: NDArray) -> dict[str, tuple[float, float]]:
    """Return the range of every variable in selected rows.

    Variables are drive coordinates, load components and all covariates except time.
    The result maps the name of each variable to its smallest and largest value.
    """
    ranges = {}
    for name, values in _variables(campaign).items():
        some = values[rows]
        if len(some) and np.isfinite(some).all():
            ranges[name] = (float(some.min()), float(some.max()))
    return ranges


def beyond(robot: Robot, campaign: Campaign) -> tuple[Beyond, ...]:
    """Return the variables outside the range in which a robot was identified.

    Values are accepted up to a distance of 5 % of the width of the range.  The result
    is empty if the robot file contains no range.
    """
    left = []
    for name, values, outside in _outside(robot, campaign):
        known = values[np.isfinite(values)]
        now, ends = (float(known.min()), float(known.max())), robot.learned_range[name]
        left.append(Beyond(name, ends, now, int(outside.sum()), len(known)))
    return tuple(left)


def beyond_by_row(robot: Robot, campaign: Campaign) -> NDArray:
    """Return the names of the variables outside their range in each row."""
    names = np.full(len(campaign), "", dtype=object)
    for name, _, outside in _outside(robot, campaign):
        names[outside] = [f"{before} {name}".strip() for before in names[outside]]
    return names


def _outside(
    robot: Robot, campaign: Campaign
) -> Iterator[tuple[str, NDArray, NDArray]]:
    """Yield the name, values and mask of outside rows of each variable, (R,) each."""
    variables = _variables(campaign)
    for name, (low, high) in robot.learned_range.items():
        values = variables.get(name, np.zeros(0))
        margin = _MARGIN * (high - low) + _SAME * max(abs(low), abs(high))
        above = values - (low - margin)
        if _repeats(robot, name):
            above = above % (2 * np.pi)
        outside = (above < 0.0) | (above > high - low + 2 * margin)
        if outside.any():
            yield name, values, outside


def _repeats(robot: Robot, name: str) -> bool:
    """Return whether all functions of a joint coordinate are periodic in it."""
    turning = [f"q.{f.name}" for f in robot.frames if f.joint == "revolute"]
    return name in turning and all(
        _turns_over(function, name)
        for function in robot.functions
        if name in function.variables
    )


def _turns_over(function: Function, name: str) -> bool:
    """Return whether a function is periodic in an angle with a period of one turn."""
    forms = _PERIODIC if name == function.variables[0] else _PERIODIC[:2]
    return function.form in forms and "period" not in function.parameters


def _variables(campaign: Campaign) -> dict[str, NDArray]:
    """Return the values (R,) of all variables by public name."""
    robot = campaign.robot
    variables = {
        f"q.{name}": campaign.coordinates[:, robot.index(name)]
        for name in drives(robot)
    }
    variables |= {f"load.{a}": w for a, w in zip(LOAD, campaign.loads.T, strict=True)}
    for name, values in campaign.covariates.items():
        if name != "time":  # time starts at zero in each session
            variables["approach" if name == "approach" else f"cov.{name}"] = values
    return variables
