r"""Compute the prior of machine parameters in a new session.

The file of a saved robot contains its geometric errors, compliances, effects and
functions, and the covariance C of their fit.  Before the new session, the machine may
have changed by more than this uncertainty.  The prior therefore has the mean of the
saved values and the covariance k C, where k is chosen by cross-validation on the set-up
rows (:mod:`.session_fit`).

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

# Fraction of the largest eigenvalue of the correlations below which an eigenvalue is
# regarded as round-off.
_RANK = 1e-10


@dataclass(frozen=True, eq=False)
class MachineNumbers:
    """Parameters of a saved robot that are common to all sessions.

    Attributes:
        robot: the saved robot.
        numbers: the m parameters.
        root: (m, r) factor L of their covariance L L'.
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
        """Return the robot with its parameters changed by L u, within bounds.

        Args:
            u: (r,) independent variables.

        Returns:
            The robot.  A parameter that cannot be negative is multiplied by a positive
            factor instead of adding the change.
        """
        robot = self.robot
        if not np.any(u):
            return robot
        change = (self.root @ u).tolist()
        for number, by in zip(self.numbers, change, strict=True):
            robot = number.moved(robot, _possible(number, self.robot, by))
        return robot


def machine_numbers(robot: Robot) -> MachineNumbers:
    """Return the parameters of a saved robot that all sessions share.

    Args:
        robot: robot with a covariance, or with ``tolerance`` and ``std``, in its file.

    Returns:
        Parameters with a known uncertainty, except those of a single session and of a
        measuring device's pose.

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
    """Return an empty set of parameters, for a robot that is known exactly."""
    return MachineNumbers(robot, (), np.zeros((0, 0)))


def renumbered(machine: MachineNumbers) -> list[Number]:
    """Return the parameters with new function numbers, without functions of time.

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
