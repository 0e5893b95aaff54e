"""The platform's stiffness against load steps of the multibody simulation.

The simulation is loaded a little along each axis, both ways, at the equilibrium with
the robot's errors and its load; half the difference of the platform's motions, per unit
of load, is the compliance.  What is left of finite steps falls with their square, and
the simulation's own noise grows with their inverse: in between 1e-7 is left.  Beside
it the simulation's own linearised system, of the nominal robot without loads.

Clearances are left out on both sides.  A moment of fixed axes has no potential and the
exact equilibrium's has one (``docs/exact.md``): the load that is already there may have
forces alone.  The small steps may be moments: both are then the same to first order.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.exact.exact import solve_exact
from assembly.kinematics.posture import Posture
from assembly.kinematics.se3 import turn_jacobian
from assembly.linear.reduction import FreeMotion
from assembly.platform_stiffness.exact_tangent import exact_tangent
from assembly.platform_stiffness.linear_tangent import without_clearance as classical
from assembly.platform_stiffness.matrices import PlatformStiffness
from forcefit.inputs.display import html_table, numbers, short_repr
from forcefit.inputs.table import BadInput
from stiffness.screws import SCREW
from validation.crosscheck.link_models import link_models
from validation.multibody.linearised import linearised_compliance
from validation.multibody.simulation import (
    TIME_LIMIT,
    SimulationFailed,
    simulate_assembly,
    without_clearance,
)

STEP = 1e-4  # [rad, reference lengths] by which each load step moves the platform
# of entries over sqrt(C_ii C_jj), where no spring is bent; a bent one is applied by the
# simulation half-way between its ends, and differs by the order of its turn squared
TOLERANCE = {"spring": 1e-6, "beam": 1e-3, "fem": 2e-2}


@dataclass(frozen=True, eq=False)
class StiffnessCheck:
    """A compliance found twice.

    Attributes:
        exact: the tangent of the exact equilibrium, clearances left out.
        linear: the classical one, of the nominal robot.
        simulated: (6, 6) [rad/(N m) .. m/N] by load steps, of small motions at the
            platform's origin, base axes.
        load: (6,) [N m, N] already there.
        links: how the simulation modelled links.
        turned: [rad] largest turn of a spring at the exact equilibrium.
        linearised: (6, 6) of the nominal robot by the simulation's linearised system;
            NaN where that found no equilibrium.
    """

    exact: PlatformStiffness
    linear: PlatformStiffness
    simulated: NDArray
    load: NDArray
    links: str
    turned: float
    linearised: NDArray

    __repr__, _repr_html_ = short_repr, html_table

    @cached_property
    def differences(self) -> dict[str, float]:
        """Largest difference of entries over sqrt(C_ii C_jj).

        Of the exact and the classical compliance from the load steps, and of the
        classical one from the linearised system.
        """
        exact, linear = self.exact.compliance, self.linear.compliance
        pairs = {
            "exact": (exact, self.simulated), "linear": (linear, self.simulated),
            "linearised": (linear, self.linearised),
        }  # fmt: skip
        sizes = {k: np.sqrt(np.abs(np.diag(other))) for k, (_, other) in pairs.items()}
        return {
            name: float(np.abs((C - other) / np.outer(sizes[name], sizes[name])).max())
            for name, (C, other) in pairs.items()
        }

    @property
    def tolerance(self) -> float:
        """[-] of the exact tangent's difference; see the head of this module."""
        return TOLERANCE[self.links] + self.turned**2

    @property
    def passed(self) -> bool:
        """Whether the exact tangent is the simulation's, to what the links allow."""
        return self.differences["exact"] <= self.tolerance

    def table(self) -> dict[str, Any]:
        """Everything as plain values."""
        return {
            "robot": self.exact.posture.robot.name,
            "pose": self.exact.posture.pose(),
            "load": self.load,
            "links": self.links,
            "compliance": {
                "exact": self.exact.compliance,
                "linear": self.linear.compliance,
                "multibody": self.simulated,
                "multibody_linearised": self.linearised,
            },
            "difference": self.differences,
            "tolerance": self.tolerance,
            "passed": self.passed,
        }

    def text(self) -> str:
        """For people."""
        posture = self.exact.posture
        lines = [
            f"{posture.robot.name} at {numbers(posture.pose().values())} [m, rad], "
            f"links as {self.links}s",
            f"{'':12s}" + "".join(f"{name:>12s}" for name in SCREW),
        ]
        for name, C in (
            ("exact", self.exact.compliance), ("linear", self.linear.compliance),
            ("simulation", self.simulated), ("linearised", self.linearised),
        ):  # fmt: skip
            cells = "".join(f"{value:12.5g}" for value in np.diag(C))
            lines.append(f"{name:12s}{cells}")
        for name, value in self.differences.items():
            pair = f"{name} minus simulation"
            if name == "linearised":
                pair = "linear minus the simulation's linearised system"
            lines.append(f"{pair}: {value:.2g} of sqrt(C_ii C_jj)")
        outcome = "passed" if self.passed else "FAILED"
        lines.append(f"{outcome}: exact within {self.tolerance:.2g}")
        return "\n".join(lines)


def check_stiffness(
    posture: Posture,
    load: ArrayLike | None = None,
    links: str = "spring",
    gravity: ArrayLike | None = None,
    time_limit: float = TIME_LIMIT,
) -> StiffnessCheck:
    """Compare the tangent of the exact equilibrium with load steps in Exudyn.

    Args:
        posture: where the robot stands; its errors count, its clearances do not.
        load: (6,) [N m, N] forces on the platform at its origin, base axes.
        links: ``"spring"``, ``"beam"`` or ``"fem"``.
        gravity: (3,) [m/s^2] base axes.
        time_limit: [s] of each of twelve simulations.

    Returns:
        Both compliances.

    Raises:
        BadInput: the load has a moment.
        CannotAssemble: the errors cannot be closed.
        FreeMotion: a motion of the platform is resisted by nothing.
        SolverFailed: no equilibrium was found.
        SimulationFailed: neither did the simulation.
    """
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    if wrench[:3].any():
        raise BadInput(
            f"load: found moments {numbers(wrench[:3])}, expected forces alone: a "
            "moment of fixed axes has no potential"
        )
    robot = without_clearance(posture.robot)
    posture = replace(posture, robot=robot)
    assembly = solve_exact(posture, wrench, gravity=gravity)
    exact = exact_tangent(assembly)
    if exact.free.shape[1]:
        raise FreeMotion(exact.free_text)
    model = link_models(robot, links)
    scale = np.repeat([1.0, 1.0 / exact.length], 3)
    columns, turns = [], []
    for row, moved in enumerate(exact.compliance):
        step = STEP / np.abs(moved * scale).max() * np.eye(6)[row]
        ahead, back = (
            simulate_assembly(
                posture, model=model, load=wrench + sign * step, gravity=gravity,
                time_limit=time_limit,
            ).platform_screw
            for sign in (1, -1)
        )  # fmt: skip
        columns.append((ahead - back) / (2 * step[row]))
        turns.append((ahead + back)[:3] / 2)
    to_motion = np.eye(6)
    to_motion[:3, :3] = turn_jacobian(np.mean(turns, axis=0))
    simulated = to_motion @ np.column_stack(columns)
    springs = np.stack([assembly.link_screws, assembly.joint_screws])[..., :3]
    turned = float(np.linalg.norm(springs, axis=-1).max())
    try:
        linearised = linearised_compliance(posture, model)
    except SimulationFailed:
        linearised = np.full((6, 6), np.nan)
    return StiffnessCheck(
        exact, classical(posture), simulated, wrench, links, turned, linearised
    )
