"""The virtual-joint model against the simulation, with clearances.

Play that no load takes up leaves the platform free within a flat valley, so poses are
not compared.  What is unique is: the least energy, and the springs' deformations and
wrenches.  Beside them the simulated play is put into the linear model: the energy it
costs there, beyond the least, is the optimality gap.  With springs as links the energy
must also be that of the exact virtual-joint model, at full size.  Errors, clearances
and load are scaled together by s; the linear energy is proportional to s^2 and the
relative gap falls as s^2 too, down to what the contacts' softness leaves.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.posture import Posture
from assembly.linear.closure import linearise
from assembly.linear.energy import solve_assembly
from assembly.linear.reduction import reduce_problem
from assembly.model.links import link_compliance
from assembly.solvers.conic import into_cones
from forcefit.inputs.display import html_table, short_repr
from validation.crosscheck.crosscheck import ELEMENTS
from validation.crosscheck.limits import extrapolate, limit_difference, limit_of
from validation.crosscheck.link_models import link_models
from validation.crosscheck.pair import Pair, exact_answer, scaled
from validation.crosscheck.spread_weight import energy_between_ends
from validation.crosscheck.verdict import (
    SCALES,
    Check,
    compare_scales,
    comparison_table,
    comparison_text,
    verdict,
)
from validation.multibody.simulation import TIME_LIMIT, simulate_assembly

PLAY_TOLERANCE = 0.02  # relative, of limits: contacts yield and are smoothed
FLOOR_ENERGY = 1e-4  # [J] at scale 1: what the springs that centre the play may store


@dataclass(frozen=True, eq=False)
class PlayCheck:
    """A robot with clearances at one posture, solved twice at several scales.

    Attributes:
        posture: nominal.
        load: (6,) [N m, N] on the platform at scale 1, base axes.
        links: how the simulation modelled links, ``"beam"`` or ``"spring"``.
        gravity: (3,) [m/s^2] at scale 1, base axes.
        pairs: one for each scale, largest first.
        asked: how many of the scales were asked for; smaller ones were added to tell.
    """

    posture: Posture
    load: NDArray
    links: str
    gravity: NDArray
    pairs: tuple[Pair, ...]
    asked: int

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def scales(self) -> NDArray:
        """(k,) factors, largest first."""
        return np.array([pair.scale for pair in self.pairs])

    @cached_property
    def gaps(self) -> NDArray:
        """(k,) optimality gap of the simulated play, relative to the reference energy.

        The reference is the energy that closing would cost without any play, or what
        is stored under the load if that is more.
        """
        return np.array([optimality_gap(pair) for pair in self.pairs])

    @cached_property
    def signal(self) -> bool:
        """Whether play or springs have anything to take up that is above the noise.

        Inside an assembly zone both energies are zero: what makes that a finding is
        the energy that closing would cost without play.
        """
        linear, s = self.pairs[0].linear, self.pairs[0].scale
        return (
            max(linear.energy_without_clearance, linear.energy) >= FLOOR_ENERGY * s**2
        )

    @cached_property
    def limits(self) -> dict[str, Check]:
        """Relative differences extrapolated to no imperfection."""
        ours = np.array([pair.linear_energy for pair in self.pairs])
        theirs = np.array([pair.simulated.rigid_energy for pair in self.pairs])
        gap = limit_of(self.scales**2, self.gaps)
        energy = limit_difference(
            self.scales, ours, theirs, 2, 0.0, PLAY_TOLERANCE, FLOOR_ENERGY
        )
        found = {
            "energy": energy,
            "spring deformation": self._strain_limit(),
            "optimality gap": Check(gap[0], PLAY_TOLERANCE, gap[1]),
        }
        return {k: replace(check, signal=self.signal) for k, check in found.items()}

    def _strain_limit(self) -> Check:
        """All springs' difference in the norm of their energy: what bears load."""
        frames = self.posture.robot.frames
        K = {"link_screws": np.zeros((len(frames), 6, 6))}
        K["joint_screws"] = np.zeros((len(frames), 6, 6))
        for i, frame in enumerate(frames):
            if frame.link is not None:
                K["link_screws"][i] = np.linalg.inv(link_compliance(frame))
            if frame.joint_stiffness is not None:
                given = frame.joint_stiffness
                K["joint_screws"][i] = np.where(np.isfinite(given), given, 0.0)
        first = self.pairs[0]
        energy = max(first.linear.energy / first.scale**2, FLOOR_ENERGY)

        def size(screws: dict[str, NDArray]) -> float:
            cost = sum(
                np.einsum("ni,nij,nj", s, K[kind], s) / 2 for kind, s in screws.items()
            )
            return float(np.sqrt(cost / energy))

        left = {
            kind: np.array([
                (getattr(p.simulated, kind) - getattr(p.linear, kind)) / p.scale
                for p in self.pairs
            ])
            for kind in K
        }
        limit = {kind: extrapolate(self.scales, v) for kind, v in left.items()}
        fewer = {kind: extrapolate(self.scales[1:], v[1:]) for kind, v in left.items()}
        change = {kind: limit[kind] - fewer[kind] for kind in K}
        return Check(size(limit), PLAY_TOLERANCE, 2 * size(change))

    @cached_property
    def energies(self) -> dict[str, NDArray]:
        """(k,) energy, simulated minus linear or exact, relative to the latter.

        NaN where the exact model gave up.
        """
        sides: dict[str, list[float]] = {"linear": [], "exact": []}
        for pair in self.pairs:
            least = FLOOR_ENERGY * pair.scale**2
            for name, answer in (("linear", pair.linear), ("exact", pair.exact)):
                known = math.nan if answer is None else answer.energy + pair.between
                difference = pair.simulated.rigid_energy - known
                sides[name].append(difference / max(known, least))
        return {name: np.array(values) for name, values in sides.items()}

    @cached_property
    def checks(self) -> dict[str, Check]:
        """What must hold, by name."""
        checks = {f"limit of {name}": check for name, check in self.limits.items()}
        exact = abs(float(self.energies["exact"][0]))
        if self.links == "spring":
            compared = self.signal and not math.isnan(exact)
            checks["energy against finite rotations"] = Check(
                exact, PLAY_TOLERANCE, signal=compared
            )
        return checks

    @property
    def passed(self) -> bool:
        """Whether every check holds."""
        return verdict(self) == "passed"

    def table(self) -> dict[str, Any]:
        """Everything the command reports, keys of the public format."""
        own = {
            "clearances": "on both sides; poses are not unique and not judged",
            "slope": None,
            "optimality_gaps": self.gaps,
            "relative_energy_differences": self.energies,
            "limits": {name: check.value for name, check in self.limits.items()},
        }
        return comparison_table(self, own)

    def header(self) -> list[str]:
        """Names of the columns of :meth:`rows`."""
        return [
            "scale of imperfections",
            "energy, simulated [J]",
            "minus linear [%]",
            "minus exact [%]",
            "optimality gap [-]",
        ]

    def rows(self) -> list[list[str]]:
        """One row for each scale, as text."""
        return [
            [
                f"{pair.scale:.4g}",
                f"{pair.simulated.rigid_energy:.6g}",
                f"{100 * linear:.3g}",
                f"{100 * exact:.3g}",
                f"{gap:.2e}",
            ]
            for pair, linear, exact, gap in zip(
                self.pairs, *self.energies.values(), self.gaps, strict=True
            )
        ]

    def text(self) -> str:
        """A table and the verdict for people, without colours."""
        return comparison_text([f"{self.posture.robot.name}, with clearances"], self)


def optimality_gap(pair: Pair) -> float:
    """What the simulated play costs in the linear model, beyond the least.

    Args:
        pair: both answers, of a robot with clearances.

    Returns:
        [-] energy minus the load's work at the simulated play, brought back into its
        cones, minus the least one; relative to the energy stored without any play, or
        with it under the load if that is more, or to :data:`FLOOR_ENERGY`.
    """
    best = pair.linear
    small = reduce_problem(linearise(best.posture), best.joints, best.frame_loads)
    cones = best.joints.cones
    # a column of cones has one entry, its bound
    u = cones.T @ pair.simulated.clearance_screws.ravel() / (cones**2).sum(axis=0)
    u = into_cones(u, best.joints.group)
    strain, least = small.G @ u + small.h, small.G @ best.clearances + small.h
    cost = (strain @ strain - least @ least) / 2 - small.d @ (u - best.clearances)
    least_reference = FLOOR_ENERGY * pair.scale**2
    reference = max(small.energy_without_clearance, best.energy, least_reference)
    return float(cost / reference)


def playcheck(
    posture: Posture,
    scales: Sequence[float] = SCALES,
    load: ArrayLike | None = None,
    links: str = "beam",
    gravity: ArrayLike | None = None,
    time_limit: float = TIME_LIMIT,
) -> PlayCheck:
    """Solve a robot with clearances with both models at several scales.

    Args:
        posture: where the robot stands.
        scales: at least two different factors on errors, clearances and load, > 0;
            smaller ones are added where these leave a check undecided.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        links: ``"beam"``, ``"spring"`` or ``"fem"``, as for a cross-check.
        gravity: (3,) [m/s^2] base axes; weight acts in all three models.
        time_limit: [s] for each simulation.

    Returns:
        Both answers at every scale, and the verdict.

    Raises:
        BadInput: too few scales, or one that is not positive.
        SimulationFailed: the simulation found no equilibrium.
        CannotAssemble: the virtual-joint model has none.
    """
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    force = wrench * [0, 0, 0, 1, 1, 1]  # its moment acts as a couple of dead forces
    models = link_models(posture.robot, links)
    g = np.zeros(3) if gravity is None else np.array(gravity, dtype=float)
    between = 0.0
    if links != "spring":
        between = energy_between_ends(posture, g, ELEMENTS)

    def solve(s: float) -> Pair:
        linear = solve_assembly(scaled(posture, s), s * wrench, gravity=s * g)
        simulated = simulate_assembly(
            posture, s, load=s * force, gravity=s * g, couple=s * wrench[:3],
            elements=ELEMENTS, clearances=True, time_limit=time_limit, **vars(models),
        )  # fmt: skip
        exact = exact_answer(linear, s * g)
        return Pair(s, linear, simulated, exact, s**2 * between)

    def judge(pairs: tuple[Pair, ...], asked: int) -> PlayCheck:
        return PlayCheck(posture, wrench, links, g, pairs, asked)

    return compare_scales(scales, solve, judge)
