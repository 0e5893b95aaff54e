"""Points of a sweep under load, weight and the effects of the robot's file.

Effects that only change errors, springs or play leave the compiled roads open.  Under
load every point is solved by itself, some milliseconds each.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.batch.many_postures import Energies
from assembly.effects import apply_known
from assembly.effects.acting import by_argument
from assembly.kinematics.posture import Posture
from assembly.linear.closure import virtual_joints
from assembly.linear.energy import Assembly, CannotAssemble
from assembly.linear.reduction import FreeMotion
from assembly.measurement.conditions import Conditions, as_declared
from assembly.measurement.predict import assemble_row
from assembly.model.robot import Robot
from assembly.report.results import failure_status
from assembly.solvers.conic import SolverFailed
from assembly.sweeps.quantities import Question


def situations(
    question: Question, robot: Robot, postures: list[Posture], errors: NDArray | None
) -> Conditions:
    """Points of one design as situations, effects at work.

    Args:
        question: says what acts everywhere.
        robot: of the design.
        postures: k of them.
        errors: (k, n, 6) [rad, m] drawn; None for the robot's own.

    Returns:
        The situations, k rows.
    """
    many = Posture(
        robot.without_effects(),
        np.array([posture.coordinates for posture in postures]),
        np.array([posture.transforms for posture in postures]),
        max(posture.mismatch for posture in postures),
    )
    off = [posture.mismatch for posture in postures]
    here = as_declared(
        many, question.load, mismatch=off, gravity=question.gravity,
        **by_argument(question.under),
    )  # fmt: skip
    if errors is not None:
        here = replace(here, errors=errors)
    return apply_known(here, robot)


def is_loaded(here: Conditions) -> bool:
    """Whether anything pushes, or yields otherwise than in proportion."""
    return bool(here.load.any() or here.gravity.any() or here.laws or here.yields)


def assemble_situations(here: Conditions) -> tuple[Energies, NDArray]:
    """Least energies of situations one by one, in full.

    Args:
        here: k situations of a robot of n frames.

    Returns:
        Energies, screws and certificates in the order given; and the (k, n, 6)
        [N m, N] wrenches through the bodies.
    """
    k, n = len(here), len(here.robot.frames)
    joints = virtual_joints(here.robot)

    def unknown(*shape: int) -> NDArray:
        return np.full((k, *shape), np.nan)

    found = Energies(
        unknown(), unknown(), unknown(), unknown(6), unknown(), unknown(),
        unknown(joints.cones.shape[1]), unknown(joints.free.shape[1]),
        unknown(6 * len(here.robot.closures)),
        np.zeros(k, dtype=int), np.full(k, "ok", dtype=object),
        np.full(k, "", dtype=object), joints,
    )  # fmt: skip
    wrenches = unknown(n, 6)
    for i in range(k):
        try:
            one = assemble_row(here, i)
        except (CannotAssemble, FreeMotion, SolverFailed) as error:
            found.status[i], found.reason[i] = failure_status(error), str(error)
            continue
        assert isinstance(one, Assembly)
        found.energy[i] = one.energy
        found.bound[i] = one.energy - one.duality_gap()
        found.energy_without_play[i] = one.energy_without_play
        found.platform_screw[i] = one.platform_screw
        found.closure_residual[i] = one.closure_residual()
        found.clearance_excess[i] = one.clearance_excess()
        found.multipliers[i] = one.multipliers
        wrenches[i] = one.wrenches
    return found, wrenches
