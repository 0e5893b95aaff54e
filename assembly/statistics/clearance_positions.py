"""Clearance models: positions within the clearances of an assembled robot.

In the minimum-energy solution, clearances that carry load are at their bounds. The
other clearances can move without deforming any spring, and their possible positions
form a convex set. The available models are

======== =====================================================================
worst    any position; the largest pose errors are computed, see
         :mod:`forcefit.assembly.statistics.worst_clearance`
uniform  uniformly distributed over the set (billiard walk)
contact  displaced by a wrench of random direction on the platform until in contact
least    the position in the minimum-energy solution, one of many possible ones
======== =====================================================================

The contact model requires a length that relates moments to forces: random moments
divided by this length are as large as random forces.  The positions depend on the
length, so every result reports it.  If the service loads are known, they determine how
the clearances close, so no contact length is needed.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.solvers.conic import minimise_energy
from forcefit.assembly.statistics.bounded_motion import (
    bounded_position,
    draws_at_bounds,
)
from forcefit.assembly.statistics.linear_response import LinearResponse

# values of the option --clearance and their meaning
CLEARANCE_MODELS = {
    "worst": "largest pose errors over all positions in the clearances, eq. (27)",
    "uniform": "positions uniform over all possible ones in the clearances",
    "contact": "clearances displaced to contact by a wrench of random direction",
    "least": "positions of the least-energy solution, one of many possible ones",
}
CLEARANCE_STREAM = 1  # random number stream for clearances; stream 0 is for errors


def position_clearances(
    prepared: LinearResponse,
    draws: Assembly,
    clearance: str,
    generators: Sequence[np.random.Generator],
    contact_length: float | None = None,
) -> tuple[NDArray, NDArray]:
    """Place the clearances according to a clearance model; return the platform screws.

    Args:
        prepared: the prepared posture.
        draws: solutions for k draws, from the posture's ``solve``.
        clearance: one of :data:`CLEARANCE_MODELS` except the worst model.
        generators: random number generator for each draw; not used for "least".
        contact_length: [m] length of the contact model, see :func:`contact_length_of`.

    Returns:
        (k, 6) [rad, m] screws, NaN where a draw has no solution; and (k,) bool, False
        where the random walk of the uniform model did not mix even at its maximum
        length, see
        :func:`forcefit.assembly.solvers.uniform_clearance.sample_uniform_position`.

    Raises:
        ValueError: ``clearance`` is not a valid model.
    """
    if clearance not in CLEARANCE_MODELS or clearance == "worst":
        valid = tuple(name for name in CLEARANCE_MODELS if name != "worst")
        raise ValueError(f"clearance is {clearance!r}, expected one of {valid}")
    mixed = np.ones(len(draws.energy), dtype=bool)
    if clearance == "least":
        return draws.platform_screw, mixed
    wrenches = None
    if clearance == "contact":
        length = contact_length or contact_length_of(prepared.posture.robot)
        wrenches = _random_wrenches(generators, length)
    screws = draws.platform_screw.copy()
    at_bounds = draws_at_bounds(prepared, draws)
    for i in np.flatnonzero(at_bounds).tolist():
        wrench = None if wrenches is None else wrenches[i]
        screws[i], mixed[i] = bounded_position(draws, i, wrench, generators[i])
    left = np.isfinite(draws.energy) & ~at_bounds
    if prepared.starts[-1] and left.any():
        moved, mixed[left] = _moved_clearances(
            prepared, draws, left, wrenches, generators
        )
        screws[left] += moved @ prepared.screws[:, : prepared.starts[-1]].T
    return screws, mixed


def _moved_clearances(
    prepared: LinearResponse, draws: Assembly, left: NDArray, wrenches: NDArray | None,
    generators: Sequence[np.random.Generator],
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Move clearances of the draws ``left``; return also whether random walks mixed."""
    clearances, mixed = draws.clearances.copy(), np.ones(len(left), dtype=bool)
    loaded = loaded_clearances(prepared, draws)
    patterns, pattern_of_draw = np.unique(loaded, axis=0, return_inverse=True)
    for i, pattern in enumerate(patterns):
        rows = np.flatnonzero((pattern_of_draw.ravel() == i) & left)
        if wrenches is None:
            rngs = [generators[k] for k in rows.tolist()]
            clearances[rows], mixed[rows] = _at_random(
                prepared, pattern, clearances[rows], rngs
            )
        else:
            clearances[rows] = _at_contact(
                prepared, pattern, clearances[rows], wrenches[rows]
            )
    return (clearances - draws.clearances)[left], mixed[left]


def contact_length_of(robot: Robot) -> float:
    """Return the default contact length [m]: the length of the robot's longest body."""
    return size_of(robot)


def clearance_means(clearance: str, contact_length: float | None = None) -> str:
    """Describe a clearance model; for "contact", include the contact length."""
    words = CLEARANCE_MODELS[clearance]
    if clearance != "contact" or contact_length is None:
        return words
    return f"{words} (moments / {contact_length:.4g} m, contact length, as forces)"


def _random_wrenches(
    generators: Sequence[np.random.Generator], length: float
) -> NDArray:
    """Draw platform wrenches (k, 6) with moments scaled by the contact length."""
    scale = np.repeat([1.0, 1.0 / length], 3)
    wrenches = np.array([rng.normal(size=6) for rng in generators])
    return wrenches.reshape(-1, 6) * scale


def _at_random(
    prepared: LinearResponse, loaded: NDArray, clearances: NDArray,
    generators: Sequence[np.random.Generator],
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Sample clearances uniformly; return them and whether each random walk mixed."""
    from forcefit.assembly.solvers.uniform_clearance import sample_uniform_position

    free = ~loaded
    rows = clearance_constraints(prepared, loaded)[:, free]
    # null space of the closure equations, whose rows are orthonormal
    Z = np.ascontiguousarray(np.linalg.svd(rows)[2][len(rows) :].T)
    to_screw = np.ascontiguousarray(prepared.screws[:, : len(free)][:, free])
    starts, mixed = free_starts(prepared, free), np.ones(len(clearances), dtype=bool)
    clearances = clearances.copy()
    for i, rng in enumerate(generators):
        v = clearances[i, free].copy()
        mixed[i] = sample_uniform_position(Z, starts, to_screw, v, rng)
        clearances[i, free] = v
    return clearances, mixed


def _at_contact(
    prepared: LinearResponse, loaded: NDArray, clearances: NDArray, wrenches: NDArray
) -> NDArray:
    """Move clearances along platform wrenches (k, 6) until they are in contact."""
    from forcefit.assembly.statistics.contact_positions import move_to_contact

    rows, free = clearance_constraints(prepared, loaded), ~loaded
    directions = wrenches @ prepared.screws[:, : clearances.shape[1]]
    ends = move_to_contact(rows, prepared.starts, free, clearances, directions)
    for k in np.flatnonzero(np.isnan(ends).any(axis=1)).tolist():
        ends[k] = _at_contact_alone(prepared, rows, free, clearances[k], directions[k])
    return ends


def free_starts(prepared: LinearResponse, free: NDArray) -> NDArray:
    """Return the first column of each free cone among the free columns (cones + 1,)."""
    sizes = np.diff(prepared.starts)[free[prepared.starts[:-1]]]
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


def _at_contact_alone(
    prepared: LinearResponse,
    rows: NDArray,
    free: NDArray,
    clearances: NDArray,
    direction: NDArray,
) -> NDArray:
    """Compute the farthest clearance position (nu,) with the Clarabel solver."""
    group = np.unique(prepared.joints.group[free], return_inverse=True)[1]
    none, size = np.zeros((0, int(free.sum()))), np.linalg.norm(direction[free])
    solution = minimise_energy(
        none,
        np.zeros(0),
        direction[free] / size,
        rows[:, free],
        rows[:, free] @ clearances[free],
        group,
    )
    end = clearances.copy()
    end[free] = solution.clearances
    return end


def loaded_clearances(prepared: LinearResponse, draws: Assembly) -> NDArray:
    """Return (k, nu) bool: whether a clearance transmits force at its bound."""
    forces = draws.multipliers @ (_cone_columns(prepared))
    if prepared.loads is not None:
        forces += prepared.loads.joint @ prepared.joints.cones
    force_sizes = _sizes(forces, prepared.starts)
    slack = np.maximum(0.0, 1.0 - _sizes(draws.clearances, prepared.starts))
    # the product of contact force and slack is about the duality gap, so one of the two
    # is nearly zero
    scale = np.maximum(draws.energy, 1e-18)[:, None]
    loaded = (force_sizes > scale * slack) & (force_sizes > 1e-9 * scale)
    return np.repeat(loaded, np.diff(prepared.starts), axis=1)


def clearance_constraints(prepared: LinearResponse, loaded: NDArray) -> NDArray:
    """Return orthonormal rows (p, nu) of the equations that free clearances satisfy."""
    rows = np.vstack([prepared.G, prepared.H]) * ~loaded
    _, S, Vt = np.linalg.svd(rows, full_matrices=False)
    return np.ascontiguousarray(Vt[S > 1e-10 * S.max(initial=0.0)])


def _cone_columns(prepared: LinearResponse) -> NDArray:
    """Return the columns (m, nu) of the clearances in the closure equations."""
    return prepared.closures @ prepared.joints.cones


def _sizes(values: NDArray, starts: NDArray) -> NDArray:
    """Return the norm (k, cones) of each cone's clearance components."""
    return np.sqrt(np.add.reduceat(values**2, starts[:-1], axis=1))
