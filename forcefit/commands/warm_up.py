"""Everything that is compiled, compiled beforehand: what ``forcefit warm-up`` does."""

from collections.abc import Callable

import numpy as np

from assembly.batch.many_draws import prepare_energies
from assembly.batch.many_margins import prepare_margins
from assembly.batch.many_pose_errors import bound_pose_errors
from assembly.batch.many_postures import minimise_energies, zone_margins
from assembly.kinematics.posture import place_robot
from assembly.linear.energy import solve_assembly
from assembly.linear.pose_error import bound_pose_error
from assembly.linear.zone import zone_margin
from assembly.platform_stiffness.many_stiffnesses import platform_stiffnesses
from assembly.robots import load_robot
from assembly.statistics.play import settle_play
from assembly.statistics.worst_play import play_pulls


def warm_up(progress: Callable[[int, int], None] = lambda done, total: None) -> None:
    """Ask a small robot every question that compiled functions answer.

    Args:
        progress: told of the questions answered and of how many there are.
    """
    robot = load_robot("five_bar")
    # more than its play takes up
    errors = np.zeros((len(robot.frames), 6))
    errors[:, 3:] = 1e-3
    posture = place_robot(robot.with_errors(errors))
    robot, T = posture.robot, posture.transforms[None]
    draws = prepare_energies(posture)
    resting = draws.solve(np.zeros((1, *errors.shape)))  # with all of its play
    rngs = [np.random.default_rng(1)]
    questions: tuple[Callable[[], object], ...] = (
        lambda: zone_margin(posture),
        lambda: bound_pose_error(solve_assembly(posture)),
        lambda: minimise_energies(robot, T),
        lambda: zone_margins(robot, T),
        lambda: platform_stiffnesses(robot, T),
        lambda: bound_pose_errors(robot, T),
        lambda: prepare_margins(posture).solve(errors[None]),
        lambda: settle_play(draws, resting, "uniform", rngs),
        lambda: settle_play(draws, resting, "contact", rngs),
        _finish_with_newton,
        lambda: play_pulls(draws, resting, "translation", resting.platform_screw),
    )
    progress(0, len(questions))
    for done, ask in enumerate(questions, start=1):
        ask()
        progress(done, len(questions))


def _finish_with_newton() -> None:
    """Newton's method by itself, as it finishes what an interior point left."""
    from assembly.solvers.cone_solvers import cone_solvers, newton

    one, none = np.ones((1, 1)), np.zeros(1)
    starts, u, y = np.array([0, 1]), np.zeros(1), np.ones(1)
    newton(cone_solvers(), one, none, none, 1, starts, 1e-9, 1e-9, 1, 0.0, u, y)
