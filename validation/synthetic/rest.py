"""Compute equilibria of a simulated machine with nonlinear joints.

The equilibrium is found by fixed-point iteration.  In each step, the machine is
simulated with a linear spring or an offset in the joint.  The resulting load on the
joint determines the next spring or offset.

- A stiffening contact is replaced by a spring of its secant stiffness.  Each step
  multiplies the error by at most 1 - 1/n, where n is the exponent of the contact law.
- The load displaces a joint with clearance up to the bounds of the clearance.  On an
  open chain, the load does not depend on the clearance.  A weak spring, which
  represents grease or seals, centres the joint under small loads.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Clearance, Robot
from forcefit.validation.multibody.simulation import (
    SimulationFailed,
    SimulationModel,
    simulate_assembly,
)
from forcefit.validation.synthetic.effects import Machine, Rest, sprung, with_frame
from forcefit.validation.synthetic.springs import rest_on_springs

# Number of finite elements per beam, sufficient for small deflections.
_ELEMENTS = 2
_STEPS = 60
_SETTLED = 1e-11  # [rad, m] largest change of a spring deflection at convergence
# [rad, m] Largest change of a joint's position within its clearance at convergence.
_SETTLED_CLEARANCE = 5e-9
# [N/m, N m/rad] Stiffness of the springs that centre joints within their clearances.
_CENTRING = {"radial": 3e3, "axial": 3e3, "tilt": 3e2, "spin": 3e2}
Progress = Callable[[int, int], None]
_ROWS = {"tilt": [0, 1], "spin": [2], "radial": [3, 4], "axial": [5]}


def rest_poses(
    machines: Sequence[Machine], program: str, update: Progress | None = None
) -> NDArray:
    """Return the equilibria of machines of equal structure under their loads.

    Args:
        machines: machines with their effects.
        program: one of :data:`PROGRAMS`.
        update: function called with the number of finished machines and the total
            number.

    Returns:
        Poses of the platforms in the base frame, (k, 4, 4).

    Raises:
        SimulationFailed: no equilibrium was found, or the iteration does not converge.
    """
    poses = np.zeros((len(machines), 4, 4))
    waiting = dict(enumerate(machines))
    for _ in range(_STEPS):
        equilibria = PROGRAMS[program](list(waiting.values()))
        for (i, machine), rest in zip(list(waiting.items()), equilibria, strict=True):
            waiting[i], change = _updated(machine, rest)
            if change <= 1.0:
                poses[i] = rest.transforms[machine.robot.index(machine.robot.platform)]
                del waiting[i]
                if update is not None:
                    update(len(machines) - len(waiting), len(machines))
        if not waiting:
            return poses
    raise SimulationFailed(
        machines[0].robot.name,
        "the iteration for the equilibrium with nonlinear joints does not converge",
    )


def _updated(machine: Machine, equilibrium: Rest) -> tuple[Machine, float]:
    """Return updated springs and offsets, and their change divided by the tolerance."""
    largest, robot = 0.0, machine.robot
    for name, law in machine.laws.items():
        i, frame = robot.index(name), robot.frame(name)
        axis = robot.frame(frame.parent).own_axis
        wrench, screw = equilibrium.joint_wrenches[i], equilibrium.joint_screws[i]
        if isinstance(law, Clearance):
            position = _clearance_position(law, wrench)
            change = float(np.abs(position - frame.geometric_error).max())
            largest = max(largest, change / _SETTLED_CLEARANCE)
            new = replace(frame, geometric_error=position)
        else:
            deflection, stiffness = law.under(wrench[axis])
            largest = max(largest, abs(deflection - abs(screw[axis])) / _SETTLED)
            K = sprung(robot.frame(frame.parent), stiffness)
            new = replace(frame, joint_stiffness=K)
        robot = with_frame(robot, new)
    return replace(machine, robot=robot), largest


def _clearance_position(clearance: Clearance, wrench: NDArray) -> NDArray:
    """Return the position (6,) [rad, m] of a loaded joint within its clearance."""
    position = np.zeros(6)
    for name, rows in _ROWS.items():
        bound = getattr(clearance, name) or 0.0
        load = float(np.linalg.norm(wrench[rows]))
        if load > 0.0:
            position[rows] = min(load / _CENTRING[name], bound) * wrench[rows] / load
    return position


@dataclass(frozen=True, eq=False)
class _Placed:
    """Robot with the joint coordinates that are simulated."""

    robot: Robot
    coordinates: NDArray


def _simulated(machines: Sequence[Machine]) -> Iterator[Rest]:
    """Yield the equilibrium of each machine, computed by the multibody simulation."""
    for machine in machines:
        robot = machine.robot
        q = np.array([machine.coordinates.get(f.name, 0.0) for f in robot.frames])
        assembly = simulate_assembly(
            _Placed(robot, q),
            load=machine.load,
            gravity=machine.gravity if machine.gravity.any() else None,
            model=SimulationModel(
                elements=_ELEMENTS,
                clearances=any(f.clearance is not None for f in robot.frames),
            ),
        )
        yield Rest(assembly.transforms, assembly.joint_wrenches, assembly.joint_screws)


PROGRAMS: dict[str, Callable[[Sequence[Machine]], Iterable[Rest]]] = {
    "multibody": _simulated,
    "springs": rest_on_springs,
}
