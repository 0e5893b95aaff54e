"""Check the platform stiffness by two methods of the multibody simulation.

Both methods start from the equilibrium with the robot's errors, load and weight.  The
linearised method differentiates the residual of the simulation.  The load-step method
applies small loads to the platform along each axis.  A method is not used for the
verdict if its estimated uncertainty exceeds the tolerance.

Both models are without clearances unless clearances are requested.  With clearances,
only the linearised method is used, with smoothed contacts.  The force of a load has a
constant direction.  Its moment is a couple of such forces, because a moment about fixed
axes has no potential (``docs/exact.md``).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.statuses import FAILED, NOT_DECIDED, PASSED
from forcefit.assembly.platform_stiffness.exact_tangent import exact_tangent
from forcefit.assembly.platform_stiffness.linear_tangent import (
    without_clearance as classical,
)
from forcefit.assembly.platform_stiffness.matrices import PlatformStiffness
from forcefit.results.display import html_table, numbers, pose_text, short_repr
from forcefit.stiffness.screws import SCREW, rotation_vector
from forcefit.validation.crosscheck.link_models import link_models
from forcefit.validation.multibody.simulation import TIME_LIMIT, without_clearance
from forcefit.validation.multibody.tangent import (
    SimulatedTangent,
    is_bent,
    simulated_tangent,
)

# [-] Largest accepted difference between entries of two compliances, divided by
# sqrt(C_ii C_jj), for each model of the links.
TOLERANCE = {"spring": 1e-6, "beam": 1e-3, "fem": 2e-2}
CONTACT_TOLERANCE = 2e-2
# [-] Relative difference of the platform displacements above which the models are at
# different equilibria.
_ELSEWHERE = 0.1


@dataclass(frozen=True, eq=False)
class StiffnessCheck:
    """Platform compliance of the exact model, the linear model and the simulation.

    Attributes:
        exact: tangent stiffness of the exact model at its equilibrium.
        linear: classical stiffness of the nominal robot.
        simulated: compliance of the simulation at the platform's origin.
        load: (6,) [N m, N] load at the equilibrium.
        links: model of the links in the simulation.
        bent: whether errors, a load or weight deform the springs at the equilibrium.
        clearances: whether clearances are modelled.
        moved: (6,) [rad, m] displacement of the platform from its nominal pose at the
            exact equilibrium.
    """

    exact: PlatformStiffness
    linear: PlatformStiffness
    simulated: SimulatedTangent
    load: NDArray
    links: str
    bent: bool
    moved: NDArray
    clearances: bool = False

    __repr__, _repr_html_ = short_repr, html_table

    @cached_property
    def differences(self) -> dict[str, float]:
        """Largest differences between two compliances, for three pairs of methods.

        Differences of entries are divided by sqrt(C_ii C_jj). ``exact`` compares the
        exact model with the load-step method. ``linearised`` compares the exact model
        with the linearised simulation. ``linear`` compares the linear model with the
        linearised simulation.
        """
        exact, linear = self.exact.compliance, self.linear.compliance
        stepped, linearised = self.simulated.stepped, self.simulated.linearised
        size = np.sqrt(np.abs(np.diag(linearised)))
        pairs = {
            "exact": (exact, stepped), "linearised": (exact, linearised),
            "linear": (linear, linearised),
        }  # fmt: skip
        return {
            name: float(np.abs((C - other) / np.outer(size, size)).max())
            for name, (C, other) in pairs.items()
        }

    @property
    def uncertainties(self) -> dict[str, float]:
        """Uncertainties of the two simulation methods, by name."""
        return {
            "exact": self.simulated.stepped_error,
            "linearised": self.simulated.linearised_error,
        }

    @property
    def tolerance(self) -> float:
        """Largest accepted relative difference between entries of two compliances."""
        own = TOLERANCE[self.links]
        return max(own, CONTACT_TOLERANCE) if self.clearances else own

    @cached_property
    def mixed(self) -> tuple[str, ...]:
        """Names of joints whose deformations are defined differently in the two models.

        Such joints are locked in some components and elastic in several others,
        including a rotation.  In the exact model, locked components are components of
        the rotation vector.  In the simulation, they are angles between axes.
        """
        names = []
        for frame in self.exact.posture.robot.frames:
            if frame.springs is not None and self.bent:
                soft = np.isfinite(np.diag(frame.springs))
                several = soft.sum() > 1 and soft[:3].any()
                names += [frame.name] * bool(several and not soft.all())
        return tuple(names)

    @cached_property
    def simulated_moved(self) -> NDArray:
        """Displacement of the platform in the simulation, (6,) [rad, m]."""
        nominal, there = self.exact.posture.platform, self.simulated.platform
        turn = rotation_vector(there[:3, :3] @ nominal[:3, :3].T)
        return np.concatenate([turn, there[:3, 3] - nominal[:3, 3]])

    @property
    def another_equilibrium(self) -> bool:
        """Whether the exact model and the simulation are at different equilibria.

        A robot that is loaded beyond buckling has several equilibria.
        """
        scale = np.repeat([self.exact.length, 1.0], 3)
        ours, theirs = scale * self.moved, scale * self.simulated_moved
        farthest = max(np.linalg.norm(ours), np.linalg.norm(theirs))
        apart = np.linalg.norm(ours - theirs) > _ELSEWHERE * farthest
        return bool(apart and self._decided and not all(self._decided))

    @property
    def passed(self) -> bool:
        """Whether all sufficiently accurate methods agree; False if there is none."""
        return not self.mixed and bool(self._decided) and all(self._decided)

    @property
    def _decided(self) -> list[bool]:
        """Whether the exact tangent agrees with each sufficiently accurate method."""
        return [
            self.differences[name] <= self.tolerance
            for name, own in self.uncertainties.items() if own <= self.tolerance
        ]  # fmt: skip

    @property
    def outcome(self) -> str:
        """``"passed"``, ``"failed"`` or ``"not decided"``."""
        if self.passed:
            return PASSED
        open_questions = self.another_equilibrium or self.mixed or not self._decided
        return NOT_DECIDED if open_questions else FAILED

    @property
    def reason(self) -> str:
        """Reason for the outcome."""
        if self.another_equilibrium:
            ours, theirs = (
                f"{numbers(screw)} rad, m ({'' if stable else 'un'}stable)"
                for screw, stable in (
                    (self.moved, self.exact.stable),
                    (self.simulated_moved, self.simulated.stable),
                )
            )
            return (
                "the two models are at different equilibria: the platform is displaced "
                f"by {ours}, in the simulation by {theirs}"
            )
        if self.mixed:
            return (
                f"{', '.join(self.mixed)} deform and have both locked and elastic "
                "axes, for which the two models define finite motions differently"
            )
        return f"exact within {self.tolerance:.2g}"

    def table(self) -> dict[str, Any]:
        """Return all results as plain values."""
        return {
            "robot": self.exact.posture.robot.name,
            "pose": self.exact.posture.pose(),
            "load": self.load,
            "links": self.links,
            "compliance": {
                "exact": self.exact.compliance,
                "linear": self.linear.compliance,
                "multibody": self.simulated.stepped,
                "multibody_linearised": self.simulated.linearised,
            },
            "difference": self.differences,
            "uncertainty": self.uncertainties,
            "tolerance": self.tolerance,
            "undecided_joints": self.mixed,
            "moved": {"exact": self.moved, "multibody": self.simulated_moved},
            "stable": {"exact": self.exact.stable, "multibody": self.simulated.stable},
            "another_equilibrium": self.another_equilibrium,
            "passed": self.passed,
        }

    def text(self) -> str:
        """Return the results as text."""
        posture = self.exact.posture
        lines = [
            f"{posture.robot.name} at {pose_text(posture.pose())}, "
            f"links as {self.links}s",
            f"{'':12s}" + "".join(f"{name:>12s}" for name in SCREW),
        ]
        rows = {
            "exact": self.exact.compliance, "linear": self.linear.compliance,
            "load steps": self.simulated.stepped,
            "linearised": self.simulated.linearised,
        }  # fmt: skip
        off, own = self.differences, self.uncertainties
        texts = [
            f"exact minus load steps: {off['exact']:.2g} of sqrt(C_ii C_jj), "
            f"uncertainty {own['exact']:.2g}",
            f"exact minus linearised simulation: {off['linearised']:.2g}, uncertainty "
            f"{own['linearised']:.2g}",
            f"linear minus linearised simulation: {off['linear']:.2g}",
        ]
        if self.clearances:  # no load steps
            del rows["load steps"], texts[0]
        for name, C in rows.items():
            cells = "".join(f"{value:12.5g}" for value in np.diag(C))
            lines.append(f"{name:12s}{cells}")
        lines += texts
        words = {PASSED: "passed", FAILED: "FAILED", NOT_DECIDED: "undecided"}
        lines.append(f"{words[self.outcome]}: {self.reason}")
        if self.outcome == FAILED and self.links == "beam" and self.bent:
            lines.append(
                "a single spring per link bends differently from a loaded "
                'beam: declare more "pieces" of the link in the robot file'
            )
        return "\n".join(lines)


def check_stiffness(
    posture: Posture,
    load: ArrayLike | None = None,
    links: str = "spring",
    gravity: ArrayLike | None = None,
    time_limit: float = TIME_LIMIT,
    clearances: bool = False,
) -> StiffnessCheck:
    """Compare the tangent stiffness of the exact model with a simulation in Exudyn.

    Args:
        posture: the robot's configuration, with its errors.
        load: (6,) [N m, N] load on the platform at its origin, in base axes.
        links: ``"spring"``, ``"beam"`` or ``"fem"``.
        gravity: (3,) [m/s^2] gravity in base axes.
        time_limit: [s] time limit of the simulation.
        clearances: whether clearances are modelled.

    Returns:
        The platform compliances by all methods.

    Raises:
        CannotAssemble: the kinematic loops cannot be closed with these errors.
        FreeMotion: the platform has an unresisted motion.
        SolverFailed: no equilibrium was found.
        SimulationFailed: the simulation found no equilibrium.
    """
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    robot = posture.robot if clearances else without_clearance(posture.robot)
    posture = replace(posture, robot=robot)
    couples = np.zeros((len(robot.frames), 6))
    couples[robot.index(robot.platform), :3] = wrench[:3]
    force = wrench * [0, 0, 0, 1, 1, 1]
    equilibrium = solve_exact(posture, force, bodies=couples, gravity=gravity)
    exact = exact_tangent(equilibrium)
    if exact.free.shape[1]:
        raise FreeMotion(exact.free_text)
    model = replace(link_models(robot, links), clearances=clearances)
    simulated = simulated_tangent(
        posture, model, wrench, gravity, time_limit=time_limit
    )
    bent = is_bent(robot.errors, wrench, gravity)
    return StiffnessCheck(
        exact, classical(posture), simulated, wrench, links, bent,
        equilibrium.platform_screw, clearances,
    )  # fmt: skip
