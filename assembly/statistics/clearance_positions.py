"""Clearance models: the positions that clearances take in an assembled robot.

At least energy the clearances that carry load are at their bound.  The positions that
the others may take without changing any spring form a convex set.  The models are

======== =====================================================================
worst    any position: the largest pose errors count, see
         :mod:`assembly.statistics.worst_clearance`
uniform  uniformly distributed over the set (billiard walk)
contact  displaced by a wrench of random direction on the platform until in contact
least    that of the solution of (22): one possible position of many
======== =====================================================================
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.batch.draws import Draws
from assembly.batch.many_draws import OnePosture
from assembly.kinematics.nominal import size_of
from assembly.solvers.conic import minimise_energy

# the option --play and its explanation
CLEARANCE_MODELS = {
    "worst": "clearances anywhere they may be, the largest pose errors count, eq. (27)",
    "uniform": "clearances uniform over all places they may be",
    "contact": "clearances taken up in a random direction",
    "least": "clearances where the solution leaves them, one possible place of many",
}
CLEARANCE_STREAM = 1  # of random numbers; 0 is the errors'


def position_clearances(
    prepared: OnePosture,
    draws: Draws,
    clearance_model: str,
    generators: Sequence[np.random.Generator],
) -> tuple[NDArray, NDArray]:
    """Platform screws with the clearances at positions of a clearance model.

    Args:
        prepared: the posture.
        draws: of :meth:`~assembly.batch.many_draws.OnePosture.solve`, k draws.
        clearance_model: one of :data:`CLEARANCE_MODELS` but the worst.
        generators: of random numbers, one for each draw; none for "least".

    Returns:
        (k, 6) [rad, m]; NaN where a draw has no solution in unit cones (the bound of a
        passive joint's own motion is active).  (k,) bool: False where the walks of the
        uniform model had not mixed at their greatest length, see
        :func:`assembly.statistics.uniform_clearance.sample_uniform_position`.

    Raises:
        ValueError: ``clearance_model`` is something else.
    """
    if clearance_model not in CLEARANCE_MODELS or clearance_model == "worst":
        valid = tuple(name for name in CLEARANCE_MODELS if name != "worst")
        raise ValueError(f"play is {clearance_model!r}, expected one of {valid}")
    mixed = np.ones(len(draws.energy), dtype=bool)
    if clearance_model == "least" or not len(prepared.G.T):
        return draws.platform_screw, mixed
    clearances = draws.clearances.copy()
    loaded = loaded_clearances(prepared, draws)
    nu = clearances.shape[1]
    solved = ~np.isnan(clearances).any(axis=1)
    patterns, pattern_of_draw = np.unique(loaded, axis=0, return_inverse=True)
    position = _at_random if clearance_model == "uniform" else _at_contact
    for i, pattern in enumerate(patterns):
        some = np.flatnonzero((pattern_of_draw.ravel() == i) & solved)
        clearances[some], mixed[some] = position(
            prepared, pattern, clearances[some], [generators[k] for k in some.tolist()]
        )
    moved = (clearances - draws.clearances) @ prepared.screws[:, :nu].T
    return draws.platform_screw + moved, mixed


def _at_random(
    prepared: OnePosture, loaded: NDArray, clearances: NDArray,
    generators: Sequence[np.random.Generator],
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Clearances uniform over their set, and whether the walks mixed."""
    from assembly.statistics.uniform_clearance import sample_uniform_position

    free = ~loaded
    rows = clearance_constraints(prepared, loaded)[:, free]
    # null space of the rows, which are orthonormal
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
    prepared: OnePosture, loaded: NDArray, clearances: NDArray,
    generators: Sequence[np.random.Generator],
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Clearances displaced along a random wrench until in contact."""
    from assembly.statistics.contact_positions import move_to_contact

    rows, free = clearance_constraints(prepared, loaded), ~loaded
    length = size_of(prepared.posture.robot)
    scale = np.array([1, 1, 1, 1 / length, 1 / length, 1 / length])
    wrenches = np.array([rng.normal(size=6) * scale for rng in generators])
    directions = wrenches.reshape(-1, 6) @ prepared.screws[:, : clearances.shape[1]]
    positions, ends = np.ascontiguousarray(clearances), np.empty_like(clearances)
    move_to_contact(rows, prepared.starts, free, positions, directions, ends)
    for k in np.flatnonzero(np.isnan(ends).any(axis=1)).tolist():
        ends[k] = _contact_fallback(prepared, rows, free, positions[k], directions[k])
    return ends, np.ones(len(clearances), dtype=bool)


def free_starts(prepared: OnePosture, free: NDArray) -> NDArray:
    """(cones + 1,) first column of each cone that is free among those that are."""
    sizes = np.diff(prepared.starts)[free[prepared.starts[:-1]]]
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


def _contact_fallback(
    prepared: OnePosture,
    rows: NDArray,
    free: NDArray,
    clearances: NDArray,
    direction: NDArray,
) -> NDArray:
    """(nu,) the farthest position, by Clarabel."""
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


def loaded_clearances(prepared: OnePosture, draws: Draws) -> NDArray:
    """(k, nu) bool: clearances loaded at their bound, by strict complementarity."""
    forces = draws.multipliers @ (_cone_columns(prepared))
    if prepared.loads is not None:
        forces += prepared.loads.frame_loads.joint @ prepared.joints.cones
    force_sizes = _sizes(forces, prepared.starts)
    slack = np.maximum(0.0, 1.0 - _sizes(draws.clearances, prepared.starts))
    # force times slack is about the solver's gap: one of the two is nearly zero
    scale = np.maximum(draws.energy, 1e-18)[:, None]
    loaded = (force_sizes > scale * slack) & (force_sizes > 1e-9 * scale)
    return np.repeat(loaded, np.diff(prepared.starts), axis=1)


def clearance_constraints(prepared: OnePosture, loaded: NDArray) -> NDArray:
    """(p, nu) orthonormal rows of the equations that the free clearances keep."""
    rows = np.vstack([prepared.G, prepared.H]) * ~loaded
    _, S, Vt = np.linalg.svd(rows, full_matrices=False)
    return np.ascontiguousarray(Vt[S > 1e-10 * S.max(initial=0.0)])


def _cone_columns(prepared: OnePosture) -> NDArray:
    """(m, nu) closure columns of the clearances."""
    return prepared.closures @ prepared.joints.cones


def _sizes(values: NDArray, starts: NDArray) -> NDArray:
    """(k, cones) size of each cone's part."""
    return np.sqrt(np.add.reduceat(values**2, starts[:-1], axis=1))
