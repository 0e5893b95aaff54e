"""Compilation of all compiled functions in advance: ``forcefit warm-up``."""

from collections.abc import Callable
from functools import partial

import numpy as np

from assembly.batch.many_draws import prepare_energies
from assembly.batch.many_margins import prepare_margins
from assembly.kinematics.posture import place_robot
from assembly.linear.energy import minimise_energies
from assembly.linear.fallback import reference_assembly, reference_margin
from assembly.linear.moving_clearances import Asked
from assembly.linear.pose_error import bound_pose_errors, reference_pose_error
from assembly.linear.reach import reachable_screws
from assembly.linear.zone import zone_margins
from assembly.platform_stiffness.many_stiffnesses import platform_stiffnesses
from assembly.robots import load_robot
from assembly.statistics.clearance_positions import position_clearances
from assembly.statistics.worst_clearance import worst_error_slopes
from forcefit.native.libraries import by_numba


def warm_up(progress: Callable[[int, int], None] = lambda done, total: None) -> None:
    """Call every compiled function for a small robot.

    Args:
        progress: called with the computations done and their number.
    """
    robot = load_robot("five_bar")
    # more than its clearances take up
    errors = np.zeros((len(robot.frames), 6))
    errors[:, 3:] = 1e-3
    posture = place_robot(robot.with_errors(errors))
    robot, T = posture.robot, posture.transforms[None]
    prepared = prepare_energies(posture)
    perfect = prepared.solve(np.zeros((1, *errors.shape)))  # clearances undetermined
    rngs = [np.random.default_rng(1)]
    computations: tuple[Callable[[], object], ...] = (
        lambda: reference_margin(posture, "rigid"),
        *(
            partial(_by_each_method, compute)
            for compute in (
                # what the fallback calls
                lambda: reference_pose_error(reference_assembly(posture), Asked()),
                lambda: reachable_screws(reference_assembly(posture), "frozen").support(
                    np.eye(6)[3]
                ),
                lambda: bound_pose_errors(robot, T),
                lambda: place_robot(robot, {"tx": posture.pose()["tx"]}),
                lambda: minimise_energies(robot, T),
                lambda: zone_margins(robot, T),
                lambda: prepared.solve(errors[None]),
                lambda: platform_stiffnesses(robot, T),
            )
        ),
        lambda: prepare_margins(posture).solve(errors[None]),
        lambda: position_clearances(prepared, perfect, "uniform", rngs),
        lambda: position_clearances(prepared, perfect, "contact", rngs),
        _finish_with_newton,
        lambda: worst_error_slopes(
            prepared, perfect, "translation", perfect.platform_screw
        ),
    )
    progress(0, len(computations))
    for done, compute in enumerate(computations, start=1):
        compute()
        progress(done, len(computations))


def _by_each_method(compute: Callable[[], object]) -> None:
    """In C++, where a compiler stands, and by numba, which is at hand for the rest."""
    compute()
    with by_numba():
        compute()


def _finish_with_newton() -> None:
    """Newton's method by itself, as it refines a solution of the interior point."""
    from assembly.solvers.cone_solvers import newton
    from assembly.solvers.dual_newton import Dual

    none = np.zeros(1)
    dual = Dual(
        Gt=np.ones((1, 1)), h=none, d=none, springs=1, starts=np.array([0, 1]),
        relative=1e-9, absolute=1e-9,
    )  # fmt: skip
    newton(dual, 1, 0.0, np.zeros(1), np.ones(1))
