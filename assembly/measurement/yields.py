"""Solve for deflections that depend on wrenches by deflection laws.

The deflections e are stress-free screws that depend on the wrenches w by a law e =
g(w).  In a closed chain, the wrenches depend on the deflections, w = w0 + A e, with the
self-stress A.  Newton's method solves e - g(w) = 0 for all measurements together.  In
an open chain, A is zero and the first iterate is exact.

======  ===========  ===========  ====================================================
symbol  code         shape        meaning
======  ===========  ===========  ====================================================
e       ``give``     (R, m)       deflections of the m laws
w       ``through``  (R, t)       wrenches on which the laws depend
G       ``slope``    (R, m, t)    derivative of the laws
======  ===========  ===========  ====================================================
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.links import in_series, own_screw
from forcefit.assembly.solvers.conic import SolverFailed

T = TypeVar("T")
_STEP = 1e-6  # finite-difference step, relative to the wrench
_SETTLED = 1e-10  # largest residual at convergence, relative to the deflection
_STEPS = 40


@dataclass(frozen=True, eq=False)
class Yields:
    """Deflection laws of a robot.

    Attributes:
        conditions: conditions of R measurements of a robot of n frames.
    """

    conditions: Conditions

    @cached_property
    def places(self) -> NDArray:
        """Unit screws of the deflections, (6n, m)."""
        return self._units([(y.frame, y.component) for y in self.conditions.yields])

    @cached_property
    def read(self) -> NDArray:
        """Unit screws of the wrenches on which the laws depend, (6n, t)."""
        return self._units(self._pairs)

    @cached_property
    def _pairs(self) -> list[tuple[str, int]]:
        pairs = (pair for y in self.conditions.yields for pair in y.through)
        return list(dict.fromkeys(pairs))

    def _units(self, pairs: list[tuple[str, int]]) -> NDArray:
        columns = np.zeros((6 * len(self.conditions.robot.frames), len(pairs)))
        for k, (frame, row) in enumerate(pairs):
            i = self.conditions.robot.index(frame)
            thread = own_screw(self.conditions.robot.frames[i])
            columns[6 * i : 6 * i + 6, k] = np.eye(6)[row] if row < 6 else thread
        return columns

    def deflections(self, through: NDArray) -> NDArray:
        """Return the deflections (R, m) under wrenches (R, t)."""
        columns = []
        for one in self.conditions.yields:
            chosen = [self._pairs.index(pair) for pair in one.through]
            columns.append(one.law(one.inputs, through[:, chosen]))
        return np.column_stack(columns)

    def slope(self, through: NDArray) -> NDArray:
        """Return derivatives (R, m, t) of the deflections by central differences."""
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
        """Compute the Newton correction of the deflections.

        Args:
            give: (R, m) current deflections.
            through: (R, t) wrenches at these deflections.
            A: (R, t, m) derivative of the wrenches with respect to the deflections.

        Returns:
            (R, m) correction to be added; zero where converged.

        Raises:
            SolverFailed: the deflections are unbounded.
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
            raise SolverFailed(
                "yields", "the compliance of the effects has no finite equilibrium"
            ) from None


def with_deflections(
    conditions: Conditions, places: NDArray, give: NDArray
) -> Conditions:
    """Replace deflection laws by given deflections.

    Args:
        conditions: conditions of R measurements.
        places: (6n, m) unit screws of the deflections.
        give: (R, m) [rad or m] deflections.

    Returns:
        The conditions without deflection laws.
    """
    screws = (give @ places.T).reshape(conditions.errors.shape)
    return replace(conditions, errors=conditions.errors + screws, yields=())


def settle_yields(
    conditions: Conditions,
    solve: Callable[[Conditions], tuple[T, NDArray]],
    A: Callable[[Yields], NDArray],
) -> T:
    """Solve for the equilibrium of a robot with deflection laws.

    Args:
        conditions: conditions of R measurements.
        solve: function that returns solutions and joint wrenches (R, 6n) for conditions
            with fixed deflections.
        A: (R, t, m) derivative of the wrenches with respect to the deflections.

    Returns:
        The solutions.

    Raises:
        SolverFailed: the deflections do not converge.
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
    raise SolverFailed("yields", f"the deflections do not converge in {_STEPS} steps")


def with_springs(conditions: Conditions, row: int) -> Conditions:
    """Replace linear deflection laws by springs in series with the joints.

    Args:
        conditions: conditions of all measurements.
        row: index of the measurement.

    Returns:
        Conditions of one measurement.  Nonlinear laws, and laws without a positive
        compliance, are not replaced.
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
        component = each.component if each.component < 6 else frames[i].own_axis
        K = in_series(frames[i].resistance, component, compliance)
        frames[i] = replace(frames[i], joint_stiffness=K)
    robot = replace(conditions.robot, frames=tuple(frames))
    return replace(one, robot=robot, yields=tuple(left))
