"""From the open robot to its equilibrium: Exudyn's static solver, stage by stage.

Closures are pulled shut while loads grow; contacts harden, if there are any, and
motions that nothing resists are released; what is left open is then taken off the
closures' targets until nothing is.

A solution ends in time: Exudyn counts seconds of the processor and stops between two
steps, and the functions it calls watch the clock.  What they raise, Ctrl-C among it,
comes out again.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validation.multibody.contact import WIDE
from validation.multibody.exudyn_model import HELD, Model
from validation.multibody.exudyn_parts import Closure, OutOfTime, SimulationFailed
from validation.multibody.exudyn_reading import left_open, pose
from validation.multibody.motion import exponential, inverse, logarithm

_SHUT = 1e-12  # [rad, m] largest component a closure may keep open
_LOAD_STEPS = 4
_RELEASING_STEPS = 4  # of motions that nothing resists
_NARROWING_STEPS = 30  # of the smoothing of contacts, geometrically
_CLOSING_STEPS = 30
_STAGES = (
    "closures are pulled shut and loads grow",
    "contacts harden and free motions are released",
    "the last gaps are closed",
)


def solve(
    model: Model, closures: list[Closure], narrow: bool = False, steps: int = 0
) -> None:
    """Pull the closures shut in steps, then shift their targets until they are.

    Args:
        model: built; it is left in its equilibrium.
        closures: to be shut.
        narrow: whether there are contacts, whose smoothing is to shrink in between.
        steps: in which closures are pulled shut, if more than needed.

    Raises:
        SimulationFailed: no equilibrium was found; :class:`OutOfTime` if because the
            model's deadline has passed.
    """
    shift = np.zeros((2, len(closures), 6))  # of the targets, at 2 times
    model.mbs.SetPreStepUserFunction(_pull(model, closures, shift))
    model.mbs.Assemble()
    equilibrate(model, 0.0, max(_LOAD_STEPS, steps))
    if narrow or model.idle:
        equilibrate(model, 1.0, _NARROWING_STEPS if narrow else _RELEASING_STEPS)
    for _ in range(_CLOSING_STEPS):
        if largest_gap(model, closures) <= _SHUT:
            _look(model)
            return
        shift[0] = shift[1]
        shift[1] -= [left_open(model, closure) for closure in closures]
        equilibrate(model, 2.0, 1)
    raise SimulationFailed(
        model.robot,
        f"a closure stays open by {largest_gap(model, closures):.2g} rad or m: rigid "
        "parts do not fit",
    )


def _pull(
    model: Model, closures: list[Closure], shift: NDArray
) -> Callable[[Any, float], bool]:
    """What happens before each step: targets move, contacts narrow."""
    opened = [
        logarithm(inverse(c.first.built @ c.shut) @ c.second.built) for c in closures
    ]

    def pull(mbs: Any, t: float) -> bool:
        try:
            model.check_time()
            _look(model)
            narrow = model.stiffness.narrow / WIDE
            model.width = WIDE * narrow ** min(max(t - 1.0, 0.0), 1.0)
            left = model.stiffness.idle / HELD
            model.hold_idle(HELD * left ** min(max(t - 1.0, 0.0), 1.0))
            way = min(max(t - 2.0, 0.0), 1.0)
            shifts = (1.0 - way) * shift[0] + way * shift[1]
            for closure, screw, more in zip(closures, opened, shifts, strict=True):
                target = exponential(max(0.0, 1.0 - t) * screw) @ exponential(more)
                local = model.transform(closure.first.local @ closure.shut @ target)
                mbs.SetMarkerParameter(closure.marker, "localHT", local)
        except BaseException as error:
            model.broken = error
            raise
        return True

    return pull


def equilibrate(model: Model, start: float, steps: int) -> None:
    """Exudyn's static solver, from the last state, over one unit of its time.

    Args:
        model: assembled.
        start: 0: closures are pulled shut and loads grow; 1: contacts harden; 2:
            the closures' targets are shifted.
        steps: to begin with; a step that fails is cut.

    Raises:
        SimulationFailed: the shortest step fails, or the deadline has passed.
    """
    doing = _STAGES[int(start)]
    timer = model.exu.special.solver
    timer.timeout = max(model.deadline - time.monotonic(), 0.0)
    try:
        model.mbs.SolveStatic(_settings(model, start, steps), updateInitialValues=True)
    except model.exu.ExudynError as error:
        _raise_broken(model, doing)
        said = str(error).splitlines()[0]
        status = f"no equilibrium while {doing} (Exudyn: {said})"
        raise SimulationFailed(model.robot, status) from None
    finally:
        timer.timeout = -1.0  # the timer is everybody's
    if model.mbs.sys["staticSolver"].output.simulationTimeout:
        model.broken = TimeoutError()
    _raise_broken(model, doing)


def _raise_broken(model: Model, doing: str) -> None:
    """Raise what Exudyn has swallowed, if anything."""
    error, model.broken = model.broken, None
    if isinstance(error, TimeoutError):
        raise OutOfTime(
            model.robot, f"the time limit was reached while {doing}"
        ) from None
    if error is not None:
        raise error


def _settings(model: Model, start: float, steps: int) -> Any:
    """Exudyn's settings of :func:`equilibrate`."""
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
    newton.residualMode = 1  # of increments: residuals hide behind weak springs
    newton.absoluteTolerance = newton.relativeTolerance = model.stiffness.tolerance
    newton.maxIterations = 25
    newton.numericalDifferentiation.relativeEpsilon = 1e-8  # of user functions
    return settings


def _look(model: Model) -> None:
    """Keep where the watched places are now."""
    if model.watched:
        model.seen.append(np.array([pose(model, place) for place in model.watched]))


def largest_gap(model: Model, closures: list[Closure]) -> float:
    """[rad, m] largest component left open."""
    gaps = [np.abs(left_open(model, closure)).max() for closure in closures]
    return float(max(gaps, default=0.0))
