"""Random positions of joints within their clearances.

At minimum energy, joints with a contact force are at the bounds of their clearances.
The other joints can move without deforming springs.  Their possible positions form a
convex set, in which random positions have a uniform distribution
(:mod:`forcefit.assembly.solvers.uniform_clearance`).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from forcefit.assembly.solvers.uniform_clearance import sample_uniform_position
from forcefit.assembly.steps.machine import Machine
from forcefit.assembly.steps.state import State

_SAME = 1e-10  # [-] tolerance for zero singular values, relative to the largest
_LOADED = 1e-9  # [-] tolerance for zero contact forces, relative to the energy


def positions_left_anywhere(
    machine: Machine, state: State, rngs: Sequence[np.random.Generator]
) -> NDArray:
    """Return uniformly distributed random positions with minimum energy.

    Args:
        machine: the robot in array form.
        state: state of k machines at minimum energy, without loads.
        rngs: k random number generators.

    Returns:
        (k, nu) motions within the clearances, divided by the clearance.
    """
    u = state.found.clearances.copy()
    # convergence of the random walk is tested for random linear combinations of u
    judged = np.random.default_rng(0).normal(size=(6, u.shape[1]))
    of_cones, of_motions = _of_rows(machine, state)
    loaded = _loaded(machine, state, of_cones[1:])
    for i, rng in enumerate(rngs):
        # first assume that there are no contact forces, because small forces are
        # uncertain; the assumption is correct if the random walk can move
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
    """Return the possible motions of a machine within its clearances at minimum energy.

    Args:
        machine: the robot in array form.
        state: state of k machines at minimum energy, without loads.
        row: index of the machine.

    Returns:
        Motions within the clearances (nu,), divided by the clearance; (nu,) bool, True
        for clearances without a contact force; and orthonormal directions in which
        these clearances can move without deforming springs.
    """
    of_cones, of_motions = _of_rows(machine, state)
    free = ~_loaded(machine, state, of_cones[1:])[row]
    Z = _directions(of_cones[:, free], of_motions)
    return state.found.clearances[row], free, Z


def _of_rows(machine: Machine, state: State) -> tuple[NDArray, NDArray]:
    """Return the constraint equations in clearance motions and free motions."""
    rows = np.vstack([
        np.zeros((1, len(machine.cones))),
        *(h.rows for h in state.holds.values()),
    ])
    return rows @ machine.cones, rows @ machine.free


def _directions(of_cones: NDArray, of_motions: NDArray) -> NDArray:
    """Return orthonormal directions of motions that do not deform springs."""
    together = null_space(np.hstack([of_cones, of_motions]), rcond=_SAME)
    U, S, _ = np.linalg.svd(together[: of_cones.shape[1]], full_matrices=False)
    return np.ascontiguousarray(U[:, S > _SAME])


def _loaded(machine: Machine, state: State, of_cones: NDArray) -> NDArray:
    """Return whether each clearance has a contact force, (k, nu) bool."""
    group, energy = machine.joints.group, state.found.energy
    cones = (group[:, None] == np.unique(group)).astype(float)
    forces = np.sqrt((state.found.multipliers @ of_cones) ** 2 @ cones)
    slack = np.maximum(0.0, 1.0 - np.sqrt(state.found.clearances**2 @ cones))
    # either the contact force or the distance from the bound is nearly zero
    scale = np.maximum(energy, 1e-18)[:, None]
    loaded = (forces > scale * slack) & (forces > _LOADED * scale)
    return loaded @ cones.T > 0


def _starts(group: NDArray) -> NDArray:
    """Return the index of the first motion of each cone, followed by their number."""
    first = np.unique(group, return_index=True)[1]
    return np.append(first, len(group)).astype(np.int64)
