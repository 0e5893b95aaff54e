"""Models of the joint positions within the clearances of an assembled robot.

In the minimum-energy solution, joints that transmit a force through their clearance are
in contact. The other joints can move within their clearances without deforming a
spring. Their possible positions form a convex set. The models are

======== =====================================================================
worst    all positions; the largest pose errors are computed, see
         :mod:`forcefit.assembly.statistics.worst_clearance`
uniform  uniformly distributed over the set (billiard walk)
contact  in contact under a platform wrench of random direction
least    the position in the computed minimum-energy solution, which is not unique
======== =====================================================================

The contact model uses random moments and random forces, whose ratio is the contact
length. The positions depend on this length, so every result contains it.
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

# valid values of the option --clearance, with descriptions for reports
CLEARANCE_MODELS = {
    "worst": "largest pose errors over all positions within the clearances, eq. (27)",
    "uniform": "uniformly distributed positions within the clearances",
    "contact": "positions in contact under a wrench of random direction",
    "least": "positions in the minimum-energy solution, which is not unique",
}
CLEARANCE_STREAM = 1  # random number stream for clearances; stream 0 is for errors


def position_clearances(
    prepared: LinearResponse,
    draws: Assembly,
    clearance: str,
    generators: Sequence[np.random.Generator],
    contact_length: float | None = None,
) -> tuple[NDArray, NDArray]:
    """Return platform screws for joint positions from a clearance model.

    Args:
        prepared: linear response of the posture.
        draws: minimum-energy solutions for k draws.
        clearance: one of :data:`CLEARANCE_MODELS` except the worst model.
        generators: random number generator for each draw; not used for "least".
        contact_length: [m] length of the contact model, see :func:`contact_length_of`.

    Returns:
        Platform screws, (k, 6) [rad, m], NaN for a draw without a solution; and (k,)
        bool, False if the random walk of the uniform model did not mix, see
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
    """Return new platform screws of some draws, and whether random walks mixed."""
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
    """Return the default contact length [m], the length of the longest body."""
    return size_of(robot)


def clearance_means(clearance: str, contact_length: float | None = None) -> str:
    """Return a description of a clearance model, including the contact length."""
    words = CLEARANCE_MODELS[clearance]
    if clearance != "contact" or contact_length is None:
        return words
    return f"{words} (contact length {contact_length:.4g} m)"


def _random_wrenches(
    generators: Sequence[np.random.Generator], length: float
) -> NDArray:
    """Return random platform wrenches, (k, 6); the contact length scales moments."""
    scale = np.repeat([1.0, 1.0 / length], 3)
    wrenches = np.array([rng.normal(size=6) for rng in generators])
    return wrenches.reshape(-1, 6) * scale


def _at_random(
    prepared: LinearResponse, loaded: NDArray, clearances: NDArray,
    generators: Sequence[np.random.Generator],
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Return uniformly distributed positions, and whether each random walk mixed."""
    from forcefit.assembly.solvers.uniform_clearance import sample_uniform_position

    free = ~loaded
    rows = clearance_constraints(prepared, loaded)[:, free]
    # basis of the null space of the closure equations
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
    """Return the joint positions in contact under platform wrenches (k, 6)."""
    from forcefit.assembly.statistics.contact_positions import move_to_contact

    rows, free = clearance_constraints(prepared, loaded), ~loaded
    directions = wrenches @ prepared.screws[:, : clearances.shape[1]]
    ends = move_to_contact(rows, prepared.starts, free, clearances, directions)
    for k in np.flatnonzero(np.isnan(ends).any(axis=1)).tolist():
        ends[k] = _at_contact_alone(prepared, rows, free, clearances[k], directions[k])
    return ends


def free_starts(prepared: LinearResponse, free: NDArray) -> NDArray:
    """Return the index of each cone's first free clearance, (cones + 1,)."""
    sizes = np.diff(prepared.starts)[free[prepared.starts[:-1]]]
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


def _at_contact_alone(
    prepared: LinearResponse,
    rows: NDArray,
    free: NDArray,
    clearances: NDArray,
    direction: NDArray,
) -> NDArray:
    """Return the positions, (nu,), farthest along a direction by a cone program."""
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
    """Return a mask (k, nu) of clearances that transmit a contact force."""
    forces = draws.multipliers @ (_cone_columns(prepared))
    if prepared.loads is not None:
        forces += prepared.loads.joint @ prepared.joints.cones
    force_sizes = _sizes(forces, prepared.starts)
    slack = np.maximum(0.0, 1.0 - _sizes(draws.clearances, prepared.starts))
    # Either the contact force or the distance from the bound is nearly zero.
    scale = np.maximum(draws.energy, 1e-18)[:, None]
    loaded = (force_sizes > scale * slack) & (force_sizes > 1e-9 * scale)
    return np.repeat(loaded, np.diff(prepared.starts), axis=1)


def clearance_constraints(prepared: LinearResponse, loaded: NDArray) -> NDArray:
    """Return orthonormal closure equations of the free clearances, (p, nu)."""
    rows = np.vstack([prepared.G, prepared.H]) * ~loaded
    _, S, Vt = np.linalg.svd(rows, full_matrices=False)
    return np.ascontiguousarray(Vt[S > 1e-10 * S.max(initial=0.0)])


def _cone_columns(prepared: LinearResponse) -> NDArray:
    """Return the coefficients of the clearances in the closure equations, (m, nu)."""
    return prepared.closures @ prepared.joints.cones


def _sizes(values: NDArray, starts: NDArray) -> NDArray:
    """Return the norm of each cone's components, (k, cones)."""
    return np.sqrt(np.add.reduceat(values**2, starts[:-1], axis=1))
