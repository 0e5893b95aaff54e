"""Places that give under what goes through them, by laws of their own.

Their deflections e are stress-free screws that depend on the wrenches w, which depend
on them: e = g(w), w = w0 + A e with A the self-stress.  Newton's method on e - g(w),
all rows at once; in a robot without closures A is zero and the first answer is right.

======  ===========  ===========  ====================================================
symbol  code         shape        meaning
======  ===========  ===========  ====================================================
e       ``give``     (R, m)       deflections of the m yields
w       ``through``  (R, t)       the wrenches that laws read
G       ``slope``    (R, m, t)    derivative of the laws
======  ===========  ===========  ====================================================
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.conditions import Conditions
from assembly.model.links import in_series
from assembly.solvers.conic import SolverFailed

T = TypeVar("T")
_STEP = 1e-6  # of a wrench's size, for the slope of a law
_SETTLED = 1e-10  # of the largest deflection: what may be left
_STEPS = 40


@dataclass(frozen=True, eq=False)
class Yields:
    """The yields of conditions, as columns of small screws.

    Attributes:
        conditions: R rows of a robot of n frames.
    """

    conditions: Conditions

    @cached_property
    def places(self) -> NDArray:
        """(6n, m) unit screws that the yields change."""
        return self._units([(y.frame, y.component) for y in self.conditions.yields])

    @cached_property
    def read(self) -> NDArray:
        """(6n, t) unit screws whose wrenches the laws read."""
        return self._units(self._pairs)

    @cached_property
    def _pairs(self) -> list[tuple[str, int]]:
        pairs = (pair for y in self.conditions.yields for pair in y.through)
        return list(dict.fromkeys(pairs))

    def _units(self, pairs: list[tuple[str, int]]) -> NDArray:
        columns = np.zeros((6 * len(self.conditions.robot.frames), len(pairs)))
        for k, (frame, row) in enumerate(pairs):
            columns[6 * self.conditions.robot.index(frame) + row, k] = 1.0
        return columns

    def deflections(self, through: NDArray) -> NDArray:
        """(R, m) of the yields under wrenches (R, t)."""
        columns = []
        for one in self.conditions.yields:
            chosen = [self._pairs.index(pair) for pair in one.through]
            columns.append(one.law(one.inputs, through[:, chosen]))
        return np.column_stack(columns)

    def slope(self, through: NDArray) -> NDArray:
        """Return (R, m, t) derivative of the deflections, by central differences."""
        slopes = np.zeros((len(through), len(self.conditions.yields), through.shape[1]))
        for k in range(through.shape[1]):
            step = _STEP * max(float(np.abs(through[:, k]).max(initial=0.0)), 1e-9)
            more, less = through.copy(), through.copy()
            more[:, k] += step
            less[:, k] -= step
            change = self.deflections(more) - self.deflections(less)
            slopes[:, :, k] = change / (2 * step)
        return slopes

    def correction(self, give: NDArray, through: NDArray, A: NDArray) -> NDArray:
        """What deflections lack, carried over to what their own stress makes of it.

        Args:
            give: (R, m) that are there.
            through: (R, t) wrenches that they meet.
            A: (R, t, m) wrenches per unit of them.

        Returns:
            (R, m) to be added; zero where they are settled.

        Raises:
            SolverFailed: nothing holds them back.
        """
        lack = self.deflections(through) - give
        size = np.abs(give).max(axis=1, initial=0.0) + np.abs(lack).max(axis=1)
        lack[np.abs(lack).max(axis=1) <= _SETTLED * size] = 0.0
        if not lack.any():
            return lack
        J = np.eye(give.shape[1]) - self.slope(through) @ A
        try:
            return np.linalg.solve(J, lack[..., None])[..., 0]
        except np.linalg.LinAlgError:
            raise SolverFailed("yields", "springs that give without end") from None


def with_deflections(
    conditions: Conditions, places: NDArray, give: NDArray
) -> Conditions:
    """Conditions whose yields are held where they are: stress-free screws, no laws.

    Args:
        conditions: R rows.
        places: (6n, m) unit screws of the yields.
        give: (R, m) [rad or m].

    Returns:
        The same, without yields.
    """
    screws = (give @ places.T).reshape(conditions.errors.shape)
    return replace(conditions, errors=conditions.errors + screws, yields=())


def settle_yields(
    conditions: Conditions,
    solve: Callable[[Conditions], tuple[T, NDArray]],
    A: Callable[[Yields], NDArray],
) -> T:
    """Return answers in which every yield gives by its law under what goes through it.

    Args:
        conditions: R rows.
        solve: answers and (R, 6n) joint wrenches of rows without yields.
        A: (R, t, m) wrenches that the laws read per unit of the yields, to first order.

    Returns:
        The answers.

    Raises:
        SolverFailed: the deflections do not settle.
    """
    yields = Yields(conditions)
    give = np.zeros((len(conditions), len(conditions.yields)))
    stress = A(yields)
    for _ in range(_STEPS):
        solution, wrenches = solve(with_deflections(conditions, yields.places, give))
        step = yields.correction(give, wrenches @ yields.read, stress)
        if not step.any():
            return solution
        give += step
    raise SolverFailed("yields", f"deflections that do not settle in {_STEPS} steps")


def with_springs(conditions: Conditions, row: int) -> Conditions:
    """One row, its yields that are springs put in series with their joints.

    Args:
        conditions: of all rows.
        row: which.

    Returns:
        That one; yields that are no springs, or whose compliance is not positive, stay.
    """
    one, left = conditions.take([row]), []
    frames = list(conditions.robot.frames)
    for each in one.yields:
        unit = np.ones((1, len(each.through)))
        compliance = float(each.law(each.inputs, unit)[0]) if each.linear else 0.0
        if compliance <= 0.0:
            left.append(each)
            continue
        i = conditions.robot.index(each.frame)
        K = in_series(frames[i].resistance, each.component, compliance)
        frames[i] = replace(frames[i], joint_stiffness=K)
    robot = replace(conditions.robot, frames=tuple(frames))
    return replace(one, robot=robot, yields=tuple(left))
