"""Compute the errors caused by the assumptions of the virtual-joint model.

Each of five assumptions is tested against a model without this assumption:

==================  ==================================================================
assumption          compared with
==================  ==================================================================
linear closures     loop closure with finite motions, :func:`.solve_exact`
beams               solids with rigid ends, computed by finite elements
loads at the ends   a weight that is distributed over its link
disc and cone       a pin in two bushes, :mod:`forcefit.validation.assumptions.bushes`
one spring a beam   a beam divided into many elements, with finite motions
==================  ==================================================================

The error of an assumption consists of the difference of the platform pose and the
relative difference of the elastic energy.  It is significant if the energy differs by
more than 1 % or the position by more than 20 um, the required accuracy of the IRSBot-2.
The error is unknown if neither model has deformations or platform motions.

The poses of the minimum-energy solutions are compared.  These poses are not unique if a
joint with clearance is not loaded; see ``docs/validity.md``.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.exact import ExactAssembly, solve_exact
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import Assembly, solve_assembly
from forcefit.assembly.model.robot import BeamLink, MatrixLink
from forcefit.validation.assumptions.bushes import solve_bushes
from forcefit.validation.crosscheck.limits import FLOOR, HALVES, energy_floor
from forcefit.validation.crosscheck.spread_weight import energy_between_ends

POSITION_LIMIT = 20e-6  # [m] required accuracy of the IRSBot-2
ENERGY_LIMIT = 0.01  # [-] smallest significant relative error of the energy


@dataclass(frozen=True)
class Cost:
    """Error caused by an assumption. A difference due to round-off is NaN.

    Attributes:
        rotation: [rad] error of the platform's orientation.
        position: [m] error of the position of the platform's origin.
        energy: [-] error of the elastic energy, relative to the energy of the more
            accurate model.
        pieces: number of elements per beam with which the errors are not significant.
            None if the assumption does not concern the division of beams.
    """

    rotation: float
    position: float
    energy: float
    pieces: int | None = None

    @property
    def matters(self) -> bool:
        """Whether the energy error exceeds 1 % or the position error exceeds 20 um."""
        return self.position > POSITION_LIMIT or self.energy > ENERGY_LIMIT

    @property
    def known(self) -> bool:
        """Whether the error is known."""
        return not (math.isnan(self.position) and math.isnan(self.energy))


def cost_between(
    model: Assembly, better: Assembly | ExactAssembly, missing: float = 0.0
) -> Cost:
    """Return the difference between a solution and a more accurate solution.

    Args:
        model: solution with the assumption.
        better: solution without the assumption.
        missing: [J] energy of the more accurate model that is not included in its
            solution.

    Returns:
        The error. Without loads, an energy of less than 1e-6 times the energy without
        clearances is round-off, and is replaced by this limit.
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
    """Return the error of linearised loop closures, compared with finite motions.

    Args:
        posture: the robot's configuration.
        load: (6,) [N m, N] load on the platform at its origin, base axes.

    Returns:
        The error.

    Raises:
        CannotAssemble: the robot cannot be assembled.
        SolverFailed: no solution was found.
    """
    exact = solve_exact(posture, load)
    return cost_between(exact.linear, exact)


def link_cost(
    posture: Posture,
    stiffness: Mapping[str, NDArray],
    load: ArrayLike | None = None,
) -> Cost:
    """Return the error of beam theory, compared with given link stiffnesses.

    Args:
        posture: the robot's configuration.
        stiffness: mapping from frame to the reference K_E, (6, 6) [N m/rad .. N/m].
        load: (6,) [N m, N] load on the platform at its origin, base axes.

    Returns:
        The error.

    Raises:
        CannotAssemble: the robot cannot be assembled.
        SolverFailed: no solution was found.
    """
    links = {name: MatrixLink(K) for name, K in stiffness.items()}
    other = replace(posture, robot=posture.robot.with_links({**links}))
    return cost_between(solve_assembly(posture, load), solve_assembly(other, load))


def spread_cost(
    posture: Posture, gravity: ArrayLike, load: ArrayLike | None = None
) -> Cost:
    """Return the error of replacing the weights of links by loads at their ends.

    With these loads (:mod:`forcefit.assembly.linear.load`), the platform pose is
    correct, but the energy between the ends of a beam is missing.

    Args:
        posture: the robot's configuration.
        gravity: (3,) [m/s^2] gravity in base axes.
        load: (6,) [N m, N] load on the platform at its origin, base axes.

    Returns:
        The error.  The poses of both models are equal to first order.

    Raises:
        CannotAssemble: the robot cannot be assembled.
        SolverFailed: no solution was found.
    """
    ends = solve_assembly(posture, load, gravity=gravity)
    return cost_between(ends, ends, missing=energy_between_ends(posture, gravity))


def bush_cost(posture: Posture, load: ArrayLike | None = None) -> Cost:
    """Return the error of the paper's clearance bounds for pins in two bushes.

    Args:
        posture: the robot's configuration.
        load: (6,) [N m, N] load on the platform at its origin, base axes.

    Returns:
        The error.

    Raises:
        CannotAssemble: the robot cannot be assembled.
        SolverFailed: no solution was found.
    """
    return cost_between(solve_assembly(posture, load), solve_bushes(posture, load))


def pieces_cost(
    posture: Posture, load: ArrayLike | None = None, gravity: ArrayLike | None = None
) -> Cost:
    """Return the error of modelling a beam as a single spring.

    The error of a beam divided into n elements is proportional to 1 / n^2
    (``docs/proofs.md``).  The solution for infinitely many elements is therefore
    extrapolated from the solutions with one and two elements.

    Args:
        posture: the robot's configuration.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.

    Returns:
        The error, with the number of elements for which it is not significant.

    Raises:
        CannotAssemble: the robot cannot be assembled.
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
    """Return the configuration with every beam divided into ``count`` elements."""
    links = {
        frame.name: replace(frame.link, pieces=count)
        for frame in posture.robot.frames
        if isinstance(frame.link, BeamLink)
    }
    return replace(posture, robot=posture.robot.with_links({**links}))
