"""Random positions of clearances that are not determined by any force.

At minimum energy, clearances that transmit force are at their bounds.  The others can
move without deforming springs. Their possible positions form a convex set, over which
they are distributed uniformly (:mod:`forcefit.assembly.solvers.uniform_clearance`).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from forcefit.assembly.solvers.uniform_clearance import sample_uniform_position
from forcefit.assembly.steps.machine import Machine
from forcefit.assembly.steps.state import State

_SAME = 1e-10  # relative size below which a singular value counts as zero
_LOADED = 1e-9  # a clearance is loaded if its force exceeds this fraction of the energy


def positions_left_anywhere(
    machine: Machine, state: State, rngs: Sequence[np.random.Generator]
) -> NDArray:
    """Sample clearances uniformly from all minimum-energy positions.

    Args:
        machine: columns and rows of the robot.
        state: state of k machines at minimum energy, without loads.
        rngs: k random number generators.

    Returns:
        (k, nu) clearances in units of their bounds.
    """
    u = state.found.clearances.copy()
    # random combinations of the clearances reveal whether the random walk mixed
    judged = np.random.default_rng(0).normal(size=(6, u.shape[1]))
    of_cones, of_motions = _of_rows(machine, state)
    loaded = _loaded(machine, state, of_cones[1:])
    for i, rng in enumerate(rngs):
        # forces at the level of solver error do not reveal which clearances are loaded;
        # if the set of all clearances has an interior, none is loaded
        for free in (np.ones_like(loaded[i]), ~loaded[i]):
            Z = _directions(of_cones[:, free], of_motions)
            own, starts = u[i, free].copy(), _starts(machine.joints.group[free])
            sample_uniform_position(
                Z, starts, np.ascontiguousarray(judged[:, free]), own, rng
            )
            moved = bool((own != u[i, free]).any())
            u[i, free] = own
            if moved or free.all() and not loaded[i].any():
                break
    return u


def free_positions(
    machine: Machine, state: State, row: int
) -> tuple[NDArray, NDArray, NDArray]:
    """Find the possible motion of one machine's clearances at minimum energy.

    Args:
        machine: columns and rows of the robot.
        state: state of k machines at minimum energy, without loads.
        row: index of the machine.

    Returns:
        (nu,) clearances in units of their bounds; (nu,) bool, True for clearances that
        transmit no force; and orthonormal columns, the directions in which these
        clearances move without deforming springs.
    """
    of_cones, of_motions = _of_rows(machine, state)
    free = ~_loaded(machine, state, of_cones[1:])[row]
    Z = _directions(of_cones[:, free], of_motions)
    return state.found.clearances[row], free, Z


def _of_rows(machine: Machine, state: State) -> tuple[NDArray, NDArray]:
    """Return the constraint rows on clearances and free motions; row 0 is zero."""
    rows = np.vstack([
        np.zeros((1, len(machine.cones))),
        *(h.rows for h in state.holds.values()),
    ])
    return rows @ machine.cones, rows @ machine.free


def _directions(of_cones: NDArray, of_motions: NDArray) -> NDArray:
    """Return orthonormal directions of the clearances that deform no spring."""
    together = null_space(np.hstack([of_cones, of_motions]), rcond=_SAME)
    U, S, _ = np.linalg.svd(together[: of_cones.shape[1]], full_matrices=False)
    return np.ascontiguousarray(U[:, S > _SAME])


def _loaded(machine: Machine, state: State, of_cones: NDArray) -> NDArray:
    """Return (k, nu) bool, True if a clearance is at its bound and transmits force."""
    group, energy = machine.joints.group, state.found.energy
    cones = (group[:, None] == np.unique(group)).astype(float)
    forces = np.sqrt((state.found.multipliers @ of_cones) ** 2 @ cones)
    slack = np.maximum(0.0, 1.0 - np.sqrt(state.found.clearances**2 @ cones))
    # force times slack is about the duality gap, so one of the two is nearly zero
    scale = np.maximum(energy, 1e-18)[:, None]
    loaded = (forces > scale * slack) & (forces > _LOADED * scale)
    return loaded @ cones.T > 0


def _starts(group: NDArray) -> NDArray:
    """Return the first column of each cone, and finally the number of columns."""
    first = np.unique(group, return_index=True)[1]
    return np.append(first, len(group)).astype(np.int64)
