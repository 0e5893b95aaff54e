"""Loads on a robot along a path, and the effects in its robot file.

At each instant, the effects change errors, springs, masses, loads and gravity as in the
command ``forcefit assembly solve``.  Effects that depend on the direction of approach
or on earlier measurements are not supported.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.effects import LIBRARY, apply_known
from forcefit.assembly.effects.forms import FORMS
from forcefit.assembly.effects.functions import covariates_of
from forcefit.assembly.effects.robot_effects import check_covariates
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import (
    Assembly,
    CannotAssemble,
    solve_assembly,
    together_at,
)
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.measurement.conditions import Conditions, as_declared
from forcefit.assembly.measurement.predict import assemble_row
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.path.inertial_loads import InertialLoads
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.inputs.table import BadInput

Covariates = Mapping[str, float | str]


@dataclass(frozen=True, eq=False)
class Equilibria:
    """Minimum-energy solutions of a robot with n frames at k instants of a path.

    Attributes:
        assembly: solutions at all instants.
        wrenches: (k, n, 6) [N m, N] wrenches in the links; NaN without a solution.
        joint_wrenches: (k, n, 6) [N m, N] wrenches in the joints.
    """

    assembly: Assembly
    wrenches: NDArray
    joint_wrenches: NDArray


def check_effects(robot: Robot, under: Covariates) -> None:
    """Raise BadInput for effects that are not supported along a path.

    Args:
        robot: robot with the effects in its file.
        under: values of covariates by name.

    Raises:
        BadInput: an effect depends on the direction of approach, on earlier
            measurements or on finite motions, or a covariate is unknown or missing.
    """
    session = str(under.get("session"))
    for name in (*robot.effects, *robot.session_effects.get(session, ())):
        if "approach" in LIBRARY[name].needs:
            raise BadInput(
                f'{robot.name}: effect "{name}" depends on the direction of approach, '
                "which a path does not define; expected a robot without this effect"
            )
    for function in robot.functions:
        if function.session not in (None, session):
            continue
        form = FORMS.get(function.form)
        if form is not None and form.remembers:
            raise BadInput(
                f'{robot.name}: the function "{function.title}" has the form '
                f'"{function.form}", which depends on earlier rows of a campaign and '
                "is not supported along a path; expected a robot without this function"
            )
    approached = covariates_of(robot, [session]).get("approach")
    if approached is not None:
        raise BadInput(
            f'{robot.name}: the function "{approached}" depends on the direction of '
            "approach, which a path does not define; expected a robot without this "
            "function"
        )
    check_covariates(robot, under)


def path_conditions(
    robot: Robot, postures: Posture, times: NDArray, load: ArrayLike | None,
    gravity: ArrayLike | None, under: Covariates,
) -> Conditions:  # fmt: skip
    """Return the conditions at k instants, with the effects in the robot file.

    Args:
        robot: robot with the effects in its file.
        postures: k postures of this robot.
        times: (k,) [s] instants.  The covariate ``time`` is the sum of the instant and
            the value in ``under``.
        load: (6,) [N m, N] constant load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes; None for no gravity.
        under: values of covariates by name.

    Returns:
        Conditions with k rows.  Effects that change springs, clearances or masses are
        applied to their robot.  An elastic foundation is an additional frame of this
        robot.
    """
    covariates: dict[str, ArrayLike] = dict(under)
    if "time" in covariates:
        covariates["time"] = np.asarray(covariates["time"], dtype=float) + times
    declared = as_declared(
        replace(postures, robot=robot.without_effects()), load,
        mismatch=postures.mismatch,
        gravity=np.zeros(3) if gravity is None else gravity, covariates=covariates,
    )  # fmt: skip
    return apply_known(declared, robot)


def equilibria(conditions: Conditions, loads: InertialLoads) -> Equilibria:
    """Solve problem (22) at k instants under loads on the bodies.

    Args:
        conditions: conditions at k instants.
        loads: d'Alembert loads and weight at each instant.

    Returns:
        The solutions.
    """
    if not (conditions.laws or conditions.yields):
        found = solve_assembly(
            conditions.postures, conditions.load_at_origin(), loads.bodies,
            errors=conditions.errors, carried=loads.carried,
        )  # fmt: skip
        return Equilibria(found, found.wrenches, found.joint_wrenches)
    points = [_equilibrium(conditions, loads, i) for i in range(len(conditions))]
    wrenches, through = np.full((2, *loads.bodies.shape), np.nan)
    for i, point in enumerate(points):
        if isinstance(point, Assembly):
            wrenches[i], through[i] = point.wrenches, point.joint_wrenches
    found = together_at(conditions.postures, points)
    return Equilibria(found, wrenches, through)


def _equilibrium(
    conditions: Conditions, loads: InertialLoads, i: int
) -> Assembly | Exception:
    """Return the solution at one instant, or the exception raised by the solver."""
    try:
        found = equilibrium_of_row(conditions, loads, i)
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        return error
    return found


def equilibrium_of_row(
    conditions: Conditions, loads: InertialLoads, i: int
) -> Assembly:
    """Solve problem (22) at one instant under loads on the bodies.

    Args:
        conditions: conditions at k instants.
        loads: d'Alembert loads and weight at each instant.
        i: index of the instant.

    Returns:
        The solution.

    Raises:
        CannotAssemble: a loop cannot be closed.
        FreeMotion: a load acts on a motion without stiffness.
        SolverFailed: the solver failed, or contacts did not converge.
    """
    # the loads on the bodies include the weight
    weightless = replace(conditions, gravity=np.zeros_like(conditions.gravity))
    found = assemble_row(weightless, i, loads.bodies[i], loads.carried[i])
    assert isinstance(found, Assembly)
    return found
