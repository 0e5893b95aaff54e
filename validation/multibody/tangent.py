"""Compute the platform compliance in the simulation by two methods.

Errors, loads and weight act as in :func:`.simulation.simulate_assembly`.  The wrench of
a spring is the gradient of its energy, so the tangent stiffness is symmetric.
"""

import time
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.results.display import html_table, short_repr
from forcefit.validation.multibody.exudyn_model import Model, Regularisation
from forcefit.validation.multibody.exudyn_parts import OutOfTime, SimulationFailed
from forcefit.validation.multibody.exudyn_reading import pose
from forcefit.validation.multibody.exudyn_solver import relax, solve
from forcefit.validation.multibody.linearised import linearised_compliance
from forcefit.validation.multibody.load_steps import add_step_loads, stepped_compliance
from forcefit.validation.multibody.open_robot import (
    Case,
    PostureLike,
    build,
    link_springs,
)
from forcefit.validation.multibody.simulation import (
    TIME_LIMIT,
    WITH_CLEARANCES,
    SimulationModel,
    import_exudyn,
)

# Regularisations in the order in which they are tried.  Soft closures reduce the
# round-off of closure forces.
_REGULARISATIONS = (
    Regularisation(1e8, 1e-8), Regularisation(1e8, 1e-6), Regularisation(1e10, 1e-6)
)  # fmt: skip

# Numbers of load steps that are tried if the equilibrium is unstable. A large load step
# may lead to an unstable branch.
_SMALLER_STEPS = (16, 64)


@dataclass(frozen=True, eq=False)
class SimulatedTangent:
    """Platform compliance from two methods in the same simulation.

    Attributes:
        linearised: (6, 6) [rad/(N m) .. m/N] compliance from the linearised system, for
            small motions at the platform's current origin, base axes.
        stepped: (6, 6) compliance from small loads; NaN if it was not requested.
        linearised_error: [-] largest uncertainty of the entries of ``linearised``,
            divided by sqrt(C_ii C_jj).
        stepped_error: [-] largest uncertainty of the entries of ``stepped``, divided by
            sqrt(C_ii C_jj).
        platform: (4, 4) current pose of the platform in the base frame.
        stable: whether the equilibrium is stable.
        seconds: [s] computing time.
    """

    linearised: NDArray
    stepped: NDArray
    linearised_error: float
    stepped_error: float
    platform: NDArray
    stable: bool
    seconds: float

    __repr__, _repr_html_ = short_repr, html_table


def simulated_tangent(
    posture: PostureLike,
    model: SimulationModel,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    steps: bool = True,
    time_limit: float = TIME_LIMIT,
) -> SimulatedTangent:
    """Return the platform compliance at the equilibrium under errors, load and weight.

    Args:
        posture: the robot's configuration, with its geometric errors.
        model: model of links and joints.  Clearances are modelled as smoothed contacts
            of 1e12 N/m. With clearances, no load steps are computed.
        load: (6,) [N m, N] load on the platform at its origin, base axes.  The force
            has a constant direction, and the moment is a couple of such forces.
        gravity: (3,) [m/s^2] gravity in base axes.
        steps: whether to compute the compliance also by load steps.
        time_limit: [s] largest time of the computation.

    Returns:
        The compliances.  If the equilibrium is unstable, the solution is repeated with
        smaller load steps.

    Raises:
        BadInput: the stiffness of a spring is missing.
        SimulationFailed: no equilibrium was found.
        OutOfTime: the time limit was reached.
    """
    started = time.monotonic()
    case = _case(posture, model, load, gravity)
    # The springs of Exudyn are faster than user functions, and exact if no spring
    # deforms.
    bent = is_bent(posture.robot.errors, load, gravity)
    hard = tuple(r for r in WITH_CLEARANCES if r.contact == 1.0)
    tried = hard[:2] if model.clearances else _REGULARISATIONS
    ways = [replace(one, conservative=bent) for one in tried]
    answer = _first(case, ways, 0, steps, started, time_limit)
    for load_steps in _SMALLER_STEPS:
        if answer.stable:
            break
        with suppress(SimulationFailed):
            answer = _first(case, ways, load_steps, steps, started, time_limit)
    return answer


def _first(
    case: Case, ways: list[Regularisation], load_steps: int, steps: bool,
    started: float, limit: float,
) -> SimulatedTangent:  # fmt: skip
    """Return the result of the first regularisation that succeeds in time."""
    *first, last = ways
    for way in first:
        try:
            return _tangent(case, way, load_steps, steps, started, limit)
        except OutOfTime:
            raise
        except SimulationFailed:
            continue
    return _tangent(case, last, load_steps, steps, started, limit)


def is_bent(*causes: ArrayLike | None) -> bool:
    """Return whether errors, load or weight deform the springs."""
    return any(np.any(cause) for cause in causes if cause is not None)


def _case(
    posture: PostureLike, model: SimulationModel,
    load: ArrayLike | None, gravity: ArrayLike | None,
) -> Case:  # fmt: skip
    """Return the description of the model to build."""
    given = {name: np.asarray(K, dtype=float) for name, K in model.stiffness.items()}
    solids = dict(model.meshes)
    wrench = np.zeros(6) if load is None else np.asarray(load, dtype=float)
    return Case(
        posture=posture, scale=1.0, meshes=solids, elements=model.elements,
        springs=link_springs(posture.robot, model.links, given, solids),
        clearances=model.clearances, bushes=model.bushes,
        load=wrench * [0, 0, 0, 1, 1, 1],
        gravity=np.zeros(3) if gravity is None else np.asarray(gravity, dtype=float),
        couple=wrench[:3],
    )  # fmt: skip


def _tangent(
    case: Case, regularisation: Regularisation, load_steps: int, steps: bool,
    started: float, limit: float,
) -> SimulatedTangent:  # fmt: skip
    """Build and solve a model, compute its compliance, and release its memory."""
    robot = case.posture.robot
    program = Model(*import_exudyn(), robot.name, regularisation)
    program.deadline = started + limit
    try:
        tree = build(program, case)
        loads = add_step_loads(program, tree, robot.platform)
        shift = solve(program, tree.closures, bool(tree.contacts), load_steps)
        if regularisation.conservative and tree.idle:
            relax(program, tree.closures, tree.idle, shift)
        C, error, stable = linearised_compliance(program, tree, robot.platform)
        stands = pose(program, tree.before[robot.platform])
        stepped, own = np.full((6, 6), np.nan), np.nan
        if steps and not tree.contacts:
            sizes = np.abs(C).max(axis=0)
            stepped, own = stepped_compliance(
                program, tree, robot.platform, loads, shift, sizes
            )
        seconds = time.monotonic() - started
        return SimulatedTangent(C, stepped, error, own, stands, stable, seconds)
    finally:
        program.discard()
