"""Compute the static equilibrium of an Exudyn model in several stages.

First, the loops are closed while the loads increase.  Then contacts are stiffened and
free motions are released.  Finally, the target position of each connector that closes a
loop is corrected by the closure error, until all closure errors vanish.

Exudyn stops between two steps when the time limit is reached. The user functions also
check the time.  Exceptions in user functions are raised again.
"""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.multibody.contact import WIDE
from forcefit.validation.multibody.exudyn_model import HOLDING_STIFFNESS, Model
from forcefit.validation.multibody.exudyn_parts import (
    Closure,
    Elastic,
    OutOfTime,
    SimulationFailed,
)
from forcefit.validation.multibody.exudyn_reading import (
    closure_error,
    idle_motions,
    pose,
)
from forcefit.validation.multibody.motion import exponential, inverse, logarithm

_CLOSED = 1e-12  # [rad, m] largest accepted closure error
_LOAD_STEPS = 4
# Number of steps in which the springs on free motions are weakened.
_RELEASING_STEPS = 4
# Number of steps in which the smoothing width of contacts is reduced.
_NARROWING_STEPS = 30
_CLOSING_STEPS = 30
# Largest number of iterations in which the weak springs are made stress-free.
_RELAXING_STEPS = 4
_RESTS = 1e-10  # [rad, m] change of free motions at which the iteration ends
# The status of a failed solution begins with this text.
NO_EQUILIBRIUM = "no equilibrium"
_STAGES = (
    "closures are closed and loads increase",
    "contacts stiffen and free motions are released",
    "the remaining closure errors are removed",
)


def solve(
    model: Model, closures: list[Closure], narrow: bool = False, steps: int = 0
) -> NDArray:
    """Close the loops in steps, then eliminate the remaining closure errors.

    Args:
        model: complete model.  After the call, it is in equilibrium.
        closures: closures to be closed.
        narrow: whether to reduce the smoothing of contacts after the first stage.
        steps: smallest number of steps for closing the loops.

    Returns:
        Shifts of the target positions of the closures, an argument of :func:`close`.

    Raises:
        SimulationFailed: no equilibrium was found.
        OutOfTime: the deadline of the model has passed.
    """
    shift = np.zeros((2, len(closures), 6))  # at the start and end of a stage
    model.mbs.SetPreStepUserFunction(_before_step(model, closures, shift))
    model.mbs.Assemble()
    equilibrate(model, 0.0, max(_LOAD_STEPS, steps))
    if narrow or model.idle:
        equilibrate(model, 1.0, _NARROWING_STEPS if narrow else _RELEASING_STEPS)
    close(model, closures, shift)
    return shift


def close(model: Model, closures: list[Closure], shift: NDArray) -> None:
    """Correct the target positions of the closures until the closure errors vanish.

    Args:
        model: model in equilibrium, with remaining closure errors.
        closures: closures to be closed.
        shift: (2, closures, 6) [rad, m] shifts of the targets, changed in place.

    Raises:
        SimulationFailed: no equilibrium was found.
    """
    for _ in range(_CLOSING_STEPS):
        if largest_gap(model, closures) <= _CLOSED:
            _record(model)
            return
        shift[0] = shift[1]
        shift[1] -= [closure_error(model, closure) for closure in closures]
        equilibrate(model, 2.0, 1)
    raise SimulationFailed(
        model.robot,
        f"a closure error of {largest_gap(model, closures):.2g} rad or m remains: "
        "the rigid parts do not fit together",
    )


def relax(
    model: Model, closures: list[Closure], idle: Mapping[str, Elastic], shift: NDArray
) -> None:
    """Make the weak springs on free motions stress-free in the current state.

    Otherwise, the forces of these springs would displace the equilibrium.

    Args:
        model: model in equilibrium.
        closures: closures of the model.
        idle: springs on free motions.
        shift: (2, closures, 6) [rad, m] shifts of the targets, changed in place.

    Raises:
        SimulationFailed: no equilibrium was found.
    """
    for _ in range(_RELAXING_STEPS):
        motions = idle_motions(model, idle)
        model.rest_idle(motions)
        equilibrate(model, 2.0, 1)
        close(model, closures, shift)
        if np.abs(idle_motions(model, idle) - motions).max(initial=0.0) <= _RESTS:
            return


def _before_step(
    model: Model, closures: list[Closure], shift: NDArray
) -> Callable[[Any, float], bool]:
    """Return a function that is called before each step of the solver."""
    opened = [
        logarithm(inverse(c.first.built @ c.closed) @ c.second.built) for c in closures
    ]

    def before_step(mbs: Any, t: float) -> bool:
        try:
            model.check_time()
            _record(model)
            narrow = model.regularisation.narrow / WIDE
            model.width = WIDE * narrow ** min(max(t - 1.0, 0.0), 1.0)
            idle = model.regularisation.idle / HOLDING_STIFFNESS
            model.hold_idle(HOLDING_STIFFNESS * idle ** min(max(t - 1.0, 0.0), 1.0))
            share = min(max(t - 2.0, 0.0), 1.0)
            shifts = (1.0 - share) * shift[0] + share * shift[1]
            for closure, screw, more in zip(closures, opened, shifts, strict=True):
                target = exponential(max(0.0, 1.0 - t) * screw) @ exponential(more)
                local = model.transform(closure.first.local @ closure.closed @ target)
                mbs.SetMarkerParameter(closure.marker, "localHT", local)
        except BaseException as error:
            model.callback_error = error
            raise
        return True

    return before_step


def equilibrate(model: Model, start: float, steps: int) -> None:
    """Run one stage of Exudyn's static solver, starting from the current state.

    Args:
        model: the assembled model.
        start: number of the stage, which is the start time in Exudyn. In stage 0, loops
            are closed and loads increase. In stage 1, contacts are stiffened. In stage
            2, the target positions of closures are corrected.
        steps: initial number of steps.  A step that fails is divided.

    Raises:
        SimulationFailed: the shortest step fails, or the deadline has passed.
    """
    stage = _STAGES[int(start)]
    timer = model.exu.special.solver
    timer.timeout = max(model.deadline - time.monotonic(), 0.0)
    try:
        model.mbs.SolveStatic(
            static_settings(model, start, steps), updateInitialValues=True
        )
    except model.exu.ExudynError as error:
        raise_callback_error(model, stage)
        reason = str(error).splitlines()[0]
        status = f"{NO_EQUILIBRIUM} while {stage} (Exudyn: {reason})"
        raise SimulationFailed(model.robot, status) from None
    finally:
        timer.timeout = -1.0  # all models share one timer
    if model.mbs.sys["staticSolver"].output.simulationTimeout:
        model.callback_error = TimeoutError()
    raise_callback_error(model, stage)


def raise_callback_error(model: Model, stage: str) -> None:
    """Raise the exception that a user function of a model has stored.

    Args:
        model: model to which the function belongs.
        stage: number of the current stage, for the message.

    Raises:
        OutOfTime: the deadline of the model has passed.
    """
    error, model.callback_error = model.callback_error, None
    if isinstance(error, TimeoutError):
        raise OutOfTime(
            model.robot, f"the time limit was reached while {stage}"
        ) from None
    if error is not None:
        raise error


def static_settings(model: Model, start: float, steps: int) -> Any:
    """Return the Exudyn settings of :func:`equilibrate`."""
    settings = model.exu.SimulationSettings()
    settings.linearSolver.solverType = model.exu.LinearSolverType.EigenSparse
    settings.solution.file.write = False
    static = settings.staticSolver
    static.verboseMode = 0
    static.numberOfLoadSteps = steps
    static.loadStepStart = start
    static.useLoadFactor = start == 0.0
    static.minimumStepSize = 1e-3
    newton = static.newton
    # Convergence is determined from the increments, because weak springs cause only
    # small residuals.
    newton.residualMode = 1
    newton.absoluteTolerance = newton.relativeTolerance = model.regularisation.tolerance
    newton.maxIterations = 25
    newton.numericalDifferentiation.relativeEpsilon = (
        1e-8  # step size for the derivatives of user functions
    )
    return settings


def _record(model: Model) -> None:
    """Record the current poses of the recorded body frames."""
    if model.recorded:
        model.history.append(np.array([pose(model, place) for place in model.recorded]))


def largest_gap(model: Model, closures: list[Closure]) -> float:
    """Return the largest component [rad, m] of the closure errors."""
    gaps = [np.abs(closure_error(model, closure)).max() for closure in closures]
    return float(max(gaps, default=0.0))
