"""Compute the platform compliance from small load steps, with its uncertainty.

At the equilibrium, small loads of decreasing size are applied to the platform along
each axis in both directions.  The compliance is half the difference between the two
motions of the platform, divided by the load.  Its error is proportional to the square
of the load, so the differences are extrapolated to zero load.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.screws import rotation_vector
from forcefit.validation.multibody.extrapolation import steadiest, without_squares
from forcefit.validation.multibody.exudyn_model import Model
from forcefit.validation.multibody.exudyn_parts import OutOfTime, SimulationFailed
from forcefit.validation.multibody.exudyn_reading import idle_motions, pose
from forcefit.validation.multibody.exudyn_solver import close, equilibrate
from forcefit.validation.multibody.open_robot import OpenTree

# Largest motion of the platform [rad, m], ratio of consecutive loads, and number of
# loads.
_LARGEST, _RATIO, _SIZES = 4e-3, 5.0, 4


def add_step_loads(model: Model, tree: OpenTree, platform: str) -> tuple[int, int]:
    """Add a moment and a force on the platform, initially zero."""
    marker = model.add_marker(tree.before[platform])
    item = model.item
    moment = item.LoadTorqueVector(markerNumber=marker, loadVector=[0.0] * 3)
    force = item.LoadForceVector(markerNumber=marker, loadVector=[0.0] * 3)
    return int(model.mbs.AddLoad(moment)), int(model.mbs.AddLoad(force))


def stepped_compliance(
    model: Model, tree: OpenTree, platform: str, loads: tuple[int, int], shift: NDArray,
    sizes: NDArray,
) -> tuple[NDArray, float]:  # fmt: skip
    """Return the compliance of a model at its current equilibrium by load steps.

    Args:
        model: model in equilibrium.
        tree: parts of the model.
        platform: name of the platform's frame.
        loads: loads from :func:`add_step_loads`.
        shift: shifts of the targets from
            :func:`forcefit.validation.multibody.exudyn_solver.solve`.
        sizes: (6,) approximate largest motion [rad or m] under each unit load.

    Returns:
        Compliance for small motions at the platform's current origin, base axes, (6, 6)
        [rad/(N m) .. m/N]; and the largest uncertainty of its entries divided by
        sqrt(C_ii C_jj).

    Raises:
        SimulationFailed: no equilibrium was found under the smallest loads.
        OutOfTime: the deadline of the model has passed.
    """
    system, initial = model.mbs.systemData, model.exu.ConfigurationType.Initial
    start, first = system.GetSystemState(), shift.copy()

    def moved(step: float, unit: NDArray, drift: NDArray) -> tuple[NDArray, ...]:
        for number, part in zip(loads, np.split(step * unit, 2), strict=True):
            model.mbs.SetLoadParameter(number, "loadVector", part.tolist())
        # The target positions change approximately in proportion to the load.
        shift[:] = first[1] + step * drift
        system.SetSystemState(start, configuration=initial)
        equilibrate(model, 2.0, 1)
        close(model, tree.closures, shift)
        return (
            pose(model, tree.before[platform]),
            idle_motions(model, tree.idle),
            shift[1],
        )

    columns, changes, turns = [], [], []
    for unit, size in zip(np.eye(6), sizes, strict=True):
        slopes: list[NDArray] = []
        steps: list[float] = []
        drift = np.zeros_like(first[1])
        for step in _LARGEST / size / _RATIO ** np.arange(_SIZES):
            try:
                ahead, idle, target = moved(step, unit, drift)
                drift = (target - first[1]) / step
                back, still, target = moved(-step, unit, drift)
            except OutOfTime:
                raise
            except SimulationFailed:
                # There may be no equilibrium under a large load.
                if step <= _LARGEST / size / _RATIO ** (_SIZES - 3):
                    raise
                slopes.clear()
                steps.clear()
                continue
            turn = rotation_vector(ahead[:3, :3] @ back[:3, :3].T)
            motion = [*turn, *(ahead - back)[:3, 3], *(idle - still)]
            slopes.append(np.array(motion) / (2 * step))
            steps.append(step)
        better = without_squares(steps, slopes)
        largest = np.abs(better)[:, :6].max(axis=0) + 1e-300
        column, change = steadiest(better, partial(_relative, largest))
        columns.append(column[:6])
        changes.append(change[:6])
        turns.append(column[6:])
    theta = np.array(turns)
    C = np.column_stack(columns) + model.regularisation.idle * theta @ theta.T
    size = np.sqrt(np.abs(np.diag(C)))
    return C, float((np.column_stack(changes) / np.outer(size, size)).max())


def _relative(sizes: NDArray, change: NDArray) -> float:
    """Return the largest relative change of the platform's motion."""
    return float((change[:6] / sizes).max())
