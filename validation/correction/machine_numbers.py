r"""Compute the prior distribution of machine parameters in a new session.

The file of a saved robot contains its geometric errors, compliances, effects and
functions, and the covariance C of their fit.  The machine may have changed since this
fit by more than its uncertainty.  The prior therefore has the mean of the saved values
and the covariance k C, where k is chosen by cross-validation on the set-up rows
(:mod:`.session_fit`).

======  =============  =========  ====================================================
symbol  code           shape      meaning
======  =============  =========  ====================================================
u       ``u``          (r,)       independent variables of variance k
L       ``root``       (m, r)     C = L L'; the m parameters are saved value + L u
======  =============  =========  ====================================================
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.model.robot import Robot
from forcefit.validation.correction.session_unknowns import DRIFT, of_one_session
from forcefit.validation.diagnosis.saved_covariance import (
    EFFECT,
    FUNCTION,
    Number,
    known_covariance,
)

# Eigenvalue of the correlation matrix that is treated as zero, relative to the largest
# eigenvalue.
_RANK = 1e-10


@dataclass(frozen=True, eq=False)
class MachineNumbers:
    """Parameters of a saved robot that are common to all sessions.

    Attributes:
        robot: the saved robot.
        numbers: the m parameters.
        root: (m, r) factor L of the parameter covariance L L'.
    """

    robot: Robot
    numbers: tuple[Number, ...]
    root: NDArray

    def __len__(self) -> int:
        return int(self.root.shape[1])

    @property
    def std(self) -> NDArray:
        """Standard deviations of the parameters, (m,)."""
        return np.sqrt(np.einsum("mr,mr->m", self.root, self.root))

    def robot_at(self, u: NDArray) -> Robot:
        """Return the robot with its parameters changed by L u, limited to their bounds.

        Args:
            u: (r,) independent variables.

        Returns:
            The robot. A parameter that cannot be negative is multiplied by a positive
            factor instead.
        """
        robot = self.robot
        if not np.any(u):
            return robot
        change = (self.root @ u).tolist()
        for number, by in zip(self.numbers, change, strict=True):
            robot = number.moved(robot, _possible(number, self.robot, by))
        return robot


def machine_numbers(robot: Robot) -> MachineNumbers:
    """Return the parameters of a saved robot that are common to all sessions.

    Args:
        robot: robot with a covariance, or with ``tolerance`` and ``std``, in its file.

    Returns:
        Parameters with a known uncertainty. Parameters of a single session and of the
        pose of a measuring device are excluded.

    Raises:
        BadInput: the file of the covariance cannot be read.
    """
    known = known_covariance(robot)
    own = np.array([_is_shared(n, robot) for n in known.numbers], dtype=bool)
    C = known.covariance[np.ix_(own, own)]
    unit = np.where(known.std > 0.0, known.std, 1.0)[own]
    values, vectors = np.linalg.eigh(C / np.outer(unit, unit))
    shown = values > _RANK * values.max(initial=0.0)
    root = unit[:, None] * vectors[:, shown] * np.sqrt(values[shown])
    numbers = [n for n, is_own in zip(known.numbers, own, strict=True) if is_own]
    return MachineNumbers(robot, tuple(numbers), root)


def _is_shared(number: Number, robot: Robot) -> bool:
    """Return whether a parameter is common to all sessions."""
    if number.kind == EFFECT:
        return not number.session and number.owner not in {"registration", DRIFT}
    if number.kind == FUNCTION:
        function = robot.functions[int(number.owner)]
        return function.session is None and function not in of_one_session(robot)[1]
    return True


def _possible(number: Number, robot: Robot, by: float) -> float:
    """Return the change of a parameter, limited to its admissible range."""
    value = number.of(robot)
    if number.kind == EFFECT and value > 0.0:
        unknowns = LIBRARY[number.owner].unknowns(robot)
        if all(unknown.lower >= 0.0 for unknown in unknowns):
            return value * float(np.expm1(by / value))
    return by


def unchanging(robot: Robot) -> MachineNumbers:
    """Return an empty set of parameters, for a robot without uncertainty."""
    return MachineNumbers(robot, (), np.zeros((0, 0)))


def renumbered(machine: MachineNumbers) -> list[Number]:
    """Return the parameters after functions of time are removed from the robot.

    Args:
        machine: parameters of a saved robot.

    Returns:
        The parameters for a robot without functions of time.
    """
    own, places = of_one_session(machine.robot)[1], dict[str, str]()
    for place, function in enumerate(machine.robot.functions):
        if function not in own:
            places[str(place)] = str(len(places))
    return [
        replace(n, owner=places[n.owner]) if n.kind == FUNCTION else n
        for n in machine.numbers
    ]
