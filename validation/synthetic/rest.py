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

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.model.robot import Robot
from validation.multibody.simulation import (
    SimulationFailed,
    simulate_assembly,
)
from validation.synthetic.effects import (
    Contact,
    Machine,
    Rattle,
    Rest,
    sprung,
    with_frame,
)
from validation.synthetic.springs import rest_on_springs

_ELEMENTS = 2  # of a beam; corrected ones need no more at deflections this small
_STEPS = 60
_SETTLED = 1e-11  # [rad, m] of contacts
_SETTLED_PLAY = 5e-9  # [rad, m] of play: what a sensor's rounding makes of a weak push
_CENTRING = {"radial": 3e3, "axial": 3e3, "tilt": 3e2, "spin": 3e2}  # [N/m, N m/rad]
Progress = Callable[[int, int], None]
_ROWS = {"tilt": [0, 1], "spin": [2], "radial": [3, 4], "axial": [5]}


def rest_poses(
    machines: Sequence[Machine], program: str, update: Progress | None = None
) -> NDArray:
    """Equilibria of machines of one structure under their loads.

    Args:
        machines: with all their effects.
        program: one of :data:`PROGRAMS`.
        update: called with the number of machines at rest and their total.

    Returns:
        (k, 4, 4) of their platforms, seen from the base.

    Raises:
        SimulationFailed: one has none, or the joints' laws do not settle.
    """
    poses = np.zeros((len(machines), 4, 4))
    waiting = dict(enumerate(machines))
    for _ in range(_STEPS):
        found = PROGRAMS[program](list(waiting.values()))
        for (i, machine), rest in zip(list(waiting.items()), found, strict=True):
            waiting[i], left = _revised(machine, rest)
            if left <= 1.0:
                poses[i] = rest.transforms[machine.robot.index(machine.robot.platform)]
                del waiting[i]
                if update is not None:
                    update(len(machines) - len(waiting), len(machines))
        if not waiting:
            return poses
    raise SimulationFailed(machines[0].robot.name, "its joints' laws do not settle")


def _revised(machine: Machine, answer: Rest) -> tuple[Machine, float]:
    """The machine as its laws want it under these loads; the change, in tolerances."""
    left, robot = 0.0, machine.robot
    for name, law in machine.laws.items():
        i, frame = robot.index(name), robot.frame(name)
        axis = robot.frame(frame.parent).own_axis
        wrench, screw = answer.joint_wrenches[i], answer.joint_screws[i]
        if isinstance(law, Contact):
            bent = (abs(wrench[axis]) / law.coefficient) ** (1.0 / law.exponent)
            left = max(left, abs(bent - abs(screw[axis])) / _SETTLED)
            K = sprung(robot.frame(frame.parent), law.secant(bent))
            new = replace(frame, joint_stiffness=K)
        else:
            rest = _against_bounds(law, wrench)
            change = float(np.abs(rest - frame.geometric_error).max())
            left = max(left, change / _SETTLED_PLAY)
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


def _simulated(machines: Sequence[Machine]) -> Iterator[Rest]:
    """Equilibria by the multibody simulation, one by one."""
    for machine in machines:
        robot = machine.robot
        q = np.array([machine.coordinates.get(f.name, 0.0) for f in robot.frames])
        found = simulate_assembly(
            _Placed(robot, q),
            load=machine.load,
            gravity=machine.gravity if machine.gravity.any() else None,
            elements=_ELEMENTS,
            clearances=any(f.clearance is not None for f in robot.frames),
        )
        yield Rest(found.transforms, found.joint_wrenches, found.joint_screws)


PROGRAMS: dict[str, Callable[[Sequence[Machine]], Iterable[Rest]]] = {
    "multibody": _simulated,
    "springs": rest_on_springs,
}
