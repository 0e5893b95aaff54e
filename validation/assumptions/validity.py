"""The error of each assumption of the virtual-joint model at a posture.

Five assumptions, each against a model without it, all else being equal:

==================  ==================================================================
assumption          instead of
==================  ==================================================================
linear closures     closures that hold with finite motions, :mod:`assembly.exact.exact`
beams               solids with held ends, by finite elements
loads at the ends   a weight spread over its link
disc and cone       a pin in two bushes, :mod:`validation.assumptions.bushes`
one spring a beam   the same beam in ever more pieces, finite motions
==================  ==================================================================

A cost is a difference of the platform's pose and a relative difference of the energy.
It counts where it exceeds one per cent or 20 um, the paper's robot's own target.
Where neither model stores energy or moves the platform there is nothing to compare.

Poses are compared at the solution of least energy.  Where no load acts on a clearance
the minimum is not unique in the pose; ``docs/validity.md`` says where.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.exact.exact import ExactAssembly, solve_exact
from assembly.kinematics.posture import Posture
from assembly.linear.energy import Assembly, solve_assembly
from assembly.model.robot import BeamLink, MatrixLink
from validation.assumptions.bushes import solve_bushes
from validation.crosscheck.limits import FLOOR, HALVES, energy_floor
from validation.crosscheck.spread_weight import energy_between_ends

POSITION_LIMIT = 20e-6  # [m]
ENERGY_LIMIT = 0.01  # [-]


@dataclass(frozen=True)
class Cost:
    """The error of an assumption; NaN where both models give nothing but rounding.

    Attributes:
        rotation: [rad] by which the platform's orientation is off.
        position: [m] by which its origin is off.
        energy: [-] by which the elastic energy is off, relative to the better model's.
        pieces: of every beam with which less than the limits is left, where pieces are
            what is compared.
    """

    rotation: float
    position: float
    energy: float
    pieces: int | None = None

    @property
    def matters(self) -> bool:
        """Whether it costs more than one per cent or 20 um."""
        return self.position > POSITION_LIMIT or self.energy > ENERGY_LIMIT

    @property
    def known(self) -> bool:
        """Whether there was anything to compare."""
        return not (math.isnan(self.position) and math.isnan(self.energy))


def cost_between(
    model: Assembly, better: Assembly | ExactAssembly, missing: float = 0.0
) -> Cost:
    """Return the difference of a solution from a better one.

    Args:
        model: the solution with the assumption.
        better: the one without.
        missing: [J] energy that neither counts but the better one has.

    Returns:
        The cost.  Without loads, energies below 1e-6 of that of closing without
        clearances count as that: inside an assembly zone both are rounding.
    """
    energy = better.energy + missing
    least = 0.0 if model.frame_loads else 1e-6 * model.energy_without_clearance
    stored = max(energy, model.energy, 1e6 * least) > energy_floor(model.posture.robot)
    moved = np.abs([model.platform_screw, better.platform_screw]).max(axis=0)
    turn, shift = (
        float(np.linalg.norm((model.platform_screw - better.platform_screw)[half]))
        for half in HALVES.values()
    )
    nothing = not stored and all(
        (moved[half] < FLOOR[name]).all() for name, half in HALVES.items()
    )
    return Cost(
        math.nan if nothing else turn,
        math.nan if nothing else shift,
        abs(model.energy - energy) / max(energy, least) if stored else math.nan,
    )


def closure_cost(posture: Posture, load: ArrayLike | None = None) -> Cost:
    """What closures linear in the screws cost, against finite motions.

    Args:
        posture: the robot's configuration.
        load: (6,) [N m, N] on the platform at its origin, base axes.

    Returns:
        The cost.

    Raises:
        CannotAssemble: it cannot be assembled.
        SolverFailed: no solution was found.
    """
    exact = solve_exact(posture, load)
    return cost_between(exact.linear, exact)


def link_cost(
    posture: Posture,
    stiffness: Mapping[str, NDArray],
    load: ArrayLike | None = None,
) -> Cost:
    """What it costs that links are beams.

    Args:
        posture: the robot's configuration.
        stiffness: by frame, the K_E (6, 6) [N m/rad .. N/m] they should have.
        load: (6,) [N m, N] on the platform at its origin, base axes.

    Returns:
        The cost.

    Raises:
        CannotAssemble: it cannot be assembled.
        SolverFailed: no solution was found.
    """
    links = {name: MatrixLink(K) for name, K in stiffness.items()}
    other = replace(posture, robot=posture.robot.with_links({**links}))
    return cost_between(solve_assembly(posture, load), solve_assembly(other, load))


def spread_cost(
    posture: Posture, gravity: ArrayLike, load: ArrayLike | None = None
) -> Cost:
    """What it costs that weights act at the links' ends.

    The ends' equivalents of :mod:`assembly.linear.load` leave the pose as it is, and
    miss what the beams store between their ends.

    Args:
        posture: the robot's configuration.
        gravity: (3,) [m/s^2] base axes.
        load: (6,) [N m, N] on the platform at its origin, base axes.

    Returns:
        The cost; no pose difference to first order.

    Raises:
        CannotAssemble: it cannot be assembled.
        SolverFailed: no solution was found.
    """
    ends = solve_assembly(posture, load, gravity=gravity)
    return cost_between(ends, ends, missing=energy_between_ends(posture, gravity))


def bush_cost(posture: Posture, load: ArrayLike | None = None) -> Cost:
    """What disc and cone cost, against pins in two bushes.

    Args:
        posture: the robot's configuration.
        load: (6,) [N m, N] on the platform at its origin, base axes.

    Returns:
        The cost.

    Raises:
        CannotAssemble: it cannot be assembled.
        SolverFailed: no solution was found.
    """
    return cost_between(solve_assembly(posture, load), solve_bushes(posture, load))


def pieces_cost(
    posture: Posture, load: ArrayLike | None = None, gravity: ArrayLike | None = None
) -> Cost:
    """What it costs that a beam is one spring at any deformation.

    The error of n pieces falls as 1 / n^2 (``docs/proofs.md``): one and two pieces tell
    what none would leave, and how many leave less than the limits.

    Args:
        posture: the robot's configuration.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.

    Returns:
        The cost, with the pieces that every beam needs.

    Raises:
        CannotAssemble: it cannot be assembled.
        SolverFailed: no solution was found.
    """
    one, two = (
        solve_exact(_in_pieces(posture, count), load, gravity=gravity)
        for count in (1, 2)
    )
    off = 4 / 3 * (one.platform_screw - two.platform_screw)
    energy = one.energy + 4 / 3 * (two.energy - one.energy)
    stored = max(one.energy, energy) > energy_floor(posture.robot)
    relative = abs(one.energy - energy) / energy if stored else math.nan
    turn, shift = (float(np.linalg.norm(off[half])) for half in HALVES.values())
    worst = max(shift / POSITION_LIMIT, relative / ENERGY_LIMIT if stored else 0.0)
    return Cost(turn, shift, relative, max(1, math.ceil(math.sqrt(worst))))


def _in_pieces(posture: Posture, count: int) -> Posture:
    """Return the same with every beam cut."""
    links = {
        frame.name: replace(frame.link, pieces=count)
        for frame in posture.robot.frames
        if isinstance(frame.link, BeamLink)
    }
    return replace(posture, robot=posture.robot.with_links({**links}))
