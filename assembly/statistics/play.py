"""Where the play of an assembled robot may sit, and what its platform then does.

Least energy holds the clearances that carry load at their bound; what the others may
do without changing any spring is a convex set.  What is assumed of it is one of

======== =====================================================================
worst    anywhere: the largest pose errors count, see
         :mod:`assembly.statistics.worst_play`
uniform  uniformly over the set (billiards): nothing is known of the play
contact  pushed by a wrench of random direction on the platform until it is taken up
least    as the solution of (22) leaves it: one possible place of many
======== =====================================================================
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.batch.draws import Draws
from assembly.batch.many_draws import OnePosture
from assembly.kinematics.nominal import size_of
from assembly.solvers.conic import minimise_energy

PLAY = {
    "worst": "play anywhere it may be, the largest pose errors count, eq. (27)",
    "uniform": "play uniform over all places it may be",
    "contact": "play pushed in a random direction until taken up",
    "least": "play where the solution leaves it, one possible place of many",
}
PLAY_STREAM = 1  # of random numbers; 0 is the errors'


def settle_play(
    one: OnePosture, found: Draws, play: str, generators: Sequence[np.random.Generator]
) -> tuple[NDArray, NDArray]:
    """Platform screws with the play somewhere in its set.

    Args:
        one: the posture.
        found: of :meth:`~assembly.batch.many_draws.OnePosture.solve`, k draws.
        play: one of :data:`PLAY` but the worst.
        generators: of random numbers, one for each draw.

    Returns:
        (k, 6) [rad, m]; NaN where a draw has no answer in unit cones (the bound of a
        passive joint's own motion mattered).  (k,) bool: False where uniform play was
        not mixed when the longest walks ended, see
        :func:`assembly.statistics.uniform_play.settle_uniformly`.

    Raises:
        ValueError: ``play`` is something else.
    """
    if play not in PLAY or play == "worst":
        valid = tuple(name for name in PLAY if name != "worst")
        raise ValueError(f"play is {play!r}, expected one of {valid}")
    mixed = np.ones(len(found.energy), dtype=bool)
    if play == "least" or not len(one.G.T):
        return found.platform_screw, mixed
    u = found.clearances.copy()
    loaded = loaded_clearances(one, found)
    nu = u.shape[1]
    solved = ~np.isnan(u).any(axis=1)
    patterns, which = np.unique(loaded, axis=0, return_inverse=True)
    settle = _uniformly if play == "uniform" else _at_contact
    for i, pattern in enumerate(patterns):
        some = np.flatnonzero((which.ravel() == i) & solved)
        u[some], mixed[some] = settle(
            one, pattern, u[some], [generators[k] for k in some.tolist()]
        )
    moved = (u - found.clearances) @ one.screws[:, :nu].T
    return found.platform_screw + moved, mixed


def _uniformly(
    one: OnePosture, loaded: NDArray, u: NDArray,
    generators: Sequence[np.random.Generator],
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Clearances uniform over their set, and whether they are mixed."""
    from assembly.statistics.uniform_play import settle_uniformly

    free = ~loaded
    rows = play_rows(one, loaded)[:, free]
    # all directions that the rows, which are orthonormal, leave
    Z = np.ascontiguousarray(np.linalg.svd(rows)[2][len(rows) :].T)
    to_screw = np.ascontiguousarray(one.screws[:, : len(free)][:, free])
    starts, mixed = free_starts(one, free), np.ones(len(u), dtype=bool)
    u = u.copy()
    for i, rng in enumerate(generators):
        v = u[i, free].copy()
        mixed[i] = settle_uniformly(Z, starts, to_screw, v, rng)
        u[i, free] = v
    return u, mixed


def _at_contact(
    one: OnePosture, loaded: NDArray, u: NDArray,
    generators: Sequence[np.random.Generator],
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Clearances pushed by a random wrench until they are taken up."""
    from assembly.statistics.push import push_all

    rows, free = play_rows(one, loaded), ~loaded
    size = size_of(one.posture.robot)
    scale = np.array([1, 1, 1, 1 / size, 1 / size, 1 / size])
    wrenches = np.array([rng.normal(size=6) * scale for rng in generators])
    pushes = wrenches.reshape(-1, 6) @ one.screws[:, : u.shape[1]]
    here, ends = np.ascontiguousarray(u), np.empty_like(u)
    push_all(rows, one.starts, free, here, pushes, ends)
    for k in np.flatnonzero(np.isnan(ends).any(axis=1)).tolist():
        ends[k] = _push_slowly(one, rows, free, here[k], pushes[k])
    return ends, np.ones(len(u), dtype=bool)


def free_starts(one: OnePosture, free: NDArray) -> NDArray:
    """(cones + 1,) first column of each cone that is free among those that are."""
    sizes = np.diff(one.starts)[free[one.starts[:-1]]]
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)


def _push_slowly(
    one: OnePosture, rows: NDArray, free: NDArray, u: NDArray, push: NDArray
) -> NDArray:
    """(nu,) where a push leads, by Clarabel where the interior point breaks down."""
    group = np.unique(one.joints.group[free], return_inverse=True)[1]
    none, at = np.zeros((0, int(free.sum()))), np.linalg.norm(push[free])
    least = minimise_energy(
        none,
        np.zeros(0),
        push[free] / at,
        rows[:, free],
        rows[:, free] @ u[free],
        group,
    )
    end = u.copy()
    end[free] = least.clearances
    return end


def loaded_clearances(one: OnePosture, found: Draws) -> NDArray:
    """(k, nu) bool: clearances that press on their bound, by strict complementarity."""
    pull = found.multipliers @ (_cone_columns(one))
    if one.loads is not None:
        pull += one.loads.forces.joint @ one.joints.cones
    push = _sizes(pull, one.starts)
    slack = np.maximum(0.0, 1.0 - _sizes(found.clearances, one.starts))
    # push times slack is about the solver's gap: one of the two is nearly zero
    scale = np.maximum(found.energy, 1e-18)[:, None]
    loaded = (push > scale * slack) & (push > 1e-9 * scale)
    return np.repeat(loaded, np.diff(one.starts), axis=1)


def play_rows(one: OnePosture, loaded: NDArray) -> NDArray:
    """(p, nu) orthonormal rows that the free clearances must not change."""
    rows = np.vstack([one.G, one.H]) * ~loaded
    _, S, Vt = np.linalg.svd(rows, full_matrices=False)
    return np.ascontiguousarray(Vt[S > 1e-10 * S.max(initial=0.0)])


def _cone_columns(one: OnePosture) -> NDArray:
    """(m, nu) closure columns of the clearances."""
    return one.closures @ one.joints.cones


def _sizes(values: NDArray, starts: NDArray) -> NDArray:
    """(k, cones) size of each cone's part."""
    return np.sqrt(np.add.reduceat(values**2, starts[:-1], axis=1))
