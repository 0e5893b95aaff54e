"""Where a simulated machine comes to rest, laws of its joints included.

A law is settled from outside: the machine is simulated with a spring or a misfit in the
joint's place, the joint's load is read, the law says what spring or misfit belongs to
that load, and so on until nothing changes.

- A contact that stiffens takes its secant stiffness.  It moves less than its last
  stiffness predicts, so each step leaves at most 1 - 1/n of the mistake.
- A joint that rattles rests against its bounds where its load pushes it.  On an open
  chain the load is known whatever the play.  Against less than a weak spring's push
  (grease, seals) it stays near the middle: otherwise rounding would decide.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.robot import Robot
from validation.generator_effects import (
    Contact,
    Machine,
    Rattle,
    sprung,
    with_frame,
)
from validation.multibody import (
    MultibodyAssembly,
    SimulationFailed,
    simulate_assembly,
)

_ELEMENTS = 2  # of a beam; corrected ones need no more at deflections this small
_STEPS = 60
_SETTLED = 1e-11  # [rad, m]
_CENTRING = {"radial": 3e3, "axial": 3e3, "tilt": 3e2, "spin": 3e2}  # [N/m, N m/rad]
_ROWS = {"tilt": [0, 1], "spin": [2], "radial": [3, 4], "axial": [5]}


def rest_pose(machine: Machine) -> NDArray:
    """Equilibrium of a machine under its load.

    Args:
        machine: with all its effects.

    Returns:
        (4, 4) of its platform, seen from the base.

    Raises:
        SimulationFailed: there is none, or the joints' laws do not settle.
    """
    for _ in range(_STEPS):
        answer = _simulate(machine)
        machine, left = _revised(machine, answer)
        if left <= _SETTLED:
            return answer.transforms[machine.robot.index(machine.robot.platform)]
    raise SimulationFailed(machine.robot.name, "its joints' laws do not settle")


def _revised(machine: Machine, answer: MultibodyAssembly) -> tuple[Machine, float]:
    """The machine as its laws want it under the loads found, and the change."""
    left, robot = 0.0, machine.robot
    for name, law in machine.laws.items():
        i, frame = robot.index(name), robot.frame(name)
        axis = robot.frame(frame.parent).own_axis
        wrench, screw = answer.joint_wrenches[i], answer.joint_screws[i]
        if isinstance(law, Contact):
            bent = (abs(wrench[axis]) / law.coefficient) ** (1.0 / law.exponent)
            left = max(left, abs(bent - abs(screw[axis])))
            K = sprung(robot.frame(frame.parent), law.secant(bent))
            new = replace(frame, joint_stiffness=K)
        else:
            rest = _against_bounds(law, wrench)
            left = max(left, float(np.abs(rest - frame.geometric_error).max()))
            new = replace(frame, geometric_error=rest)
        robot = with_frame(robot, new)
    return replace(machine, robot=robot), left


def _against_bounds(law: Rattle, wrench: NDArray) -> NDArray:
    """(6,) [rad, m] where a load pushes a joint that plays."""
    rest = np.zeros(6)
    for name, rows in _ROWS.items():
        bound = getattr(law.clearance, name) or 0.0
        push = float(np.linalg.norm(wrench[rows]))
        if push > 0.0:
            rest[rows] = min(push / _CENTRING[name], bound) * wrench[rows] / push
    return rest


@dataclass(frozen=True, eq=False)
class _Placed:
    """Joint coordinates of a robot, as the simulation asks for them."""

    robot: Robot
    coordinates: NDArray


def _simulate(machine: Machine) -> MultibodyAssembly:
    """One equilibrium, with springs and misfits as they are."""
    robot = machine.robot
    q = np.array([machine.coordinates.get(f.name, 0.0) for f in robot.frames])
    return simulate_assembly(
        _Placed(robot, q),
        load=machine.load,
        gravity=machine.gravity if machine.gravity.any() else None,
        elements=_ELEMENTS,
        clearances=any(f.clearance is not None for f in robot.frames),
    )
