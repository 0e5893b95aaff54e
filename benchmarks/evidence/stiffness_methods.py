"""Compare K_C of three robots by several methods.

``python -m benchmarks.evidence.stiffness_methods`` prints 1 / C_ii along each axis at
the platform's origin, and the difference of each method from the first, relative to
sqrt(C_ii C_jj).  The methods are

- the virtual-joint model, by the reference method and by the compiled method;
- the displacement method with the displacements of all bodies as unknowns;
- the tangent stiffness of the exact equilibrium;
- finite differences of problem (22);
- load steps and the linearised system of Exudyn, with links as springs and as beams.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture, home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.platform_stiffness.linear_tangent import without_clearance
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import load_robot
from forcefit.validation.assumptions.platform_cost import solid_compliance
from forcefit.validation.crosscheck.link_models import link_models
from forcefit.validation.multibody.tangent import simulated_tangent

POSES = {"irsbot2": {"tx": 0.1, "tz": -0.5}, "hexapod": None, "orthoglide": None}


def methods(posture: Posture) -> dict[str, NDArray]:
    """Return the compliance by each method, (6, 6) [rad/(N m) .. m/N]."""
    robot = posture.robot
    frames = tuple(replace(f, clearance=None) for f in robot.frames)
    tight = replace(robot, frames=frames).with_errors(0 * robot.errors)
    tight_posture = replace(posture, robot=tight)
    many = platform_stiffness([posture])
    moved = [solve_assembly(tight_posture, w).platform_screw for w in np.eye(6)]
    return {
        "virtual joints": without_clearance(posture).compliance,
        "compiled": many.compliance[0],
        "displacement method": solid_compliance(posture, {}),
        "exact tangent": platform_stiffness(tight_posture, "exact").compliance,
        "(22), unit loads": np.array(moved).T,
    } | dict(by_simulation(tight_posture))


def by_simulation(posture: Posture) -> Iterator[tuple[str, NDArray]]:
    """Yield the results of both methods of simulation for both models of the links."""
    for links in ("spring", "beam"):
        answer = simulated_tangent(posture, link_models(posture.robot, links))
        yield f"load steps, {links}s", answer.stepped
        yield f"linearised, {links}s", answer.linearised


def main() -> None:
    """Print a table for each robot."""
    for name, pose in POSES.items():
        robot = load_robot(name)
        posture = place_robot(robot, pose) if pose else home_posture(robot)
        print(f"{name}: mx my mz [N m/rad], fx fy fz [N/m], difference")
        first = None
        for method, C in methods(posture).items():
            first = C if first is None else first
            size = np.sqrt(np.diag(first))
            off = np.abs((C - first) / np.outer(size, size)).max()
            values = "".join(f"{1 / c:13.6g}" for c in np.diag(C))
            print(f"  {method:20s}{values}{off:10.1e}", flush=True)


if __name__ == "__main__":
    main()
