"""Where the play of an assembled robot may sit, and what its platform then does.

Least energy holds the clearances that carry load at their bound; what the others may
do without changing any spring is a convex set.  Its points are drawn

======== =====================================================================
least    not at all: as the solution of (22) leaves it
uniform  uniformly over the set (hit-and-run): nothing is known of the play
contact  pushed by a wrench of random direction on the platform until it is taken up
======== =====================================================================
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.nominal import size_of
from assembly.solvers.conic import minimise_energy
from assembly.solvers.one_posture import Draws, OnePosture

PLAY = ("least", "uniform", "contact")
STEPS = 400  # of a walk; twice as many change no quantile, see tests/test_play.py


def settle_play(
    one: OnePosture, found: Draws, play: str, generators: Sequence[np.random.Generator],
    steps: int = STEPS,
) -> NDArray:  # fmt: skip
    """Platform screws with the play somewhere in its set.

    Args:
        one: the posture.
        found: of :meth:`~assembly.solvers.one_posture.OnePosture.solve`, k draws.
        play: one of :data:`PLAY`.
        generators: of random numbers, one for each draw.
        steps: of each walk.

    Returns:
        (k, 6) [rad, m]; NaN where a draw has no answer in unit cones (the bound of a
        passive joint's own motion mattered).

    Raises:
        ValueError: ``play`` is something else.
    """
    if play not in PLAY:
        raise ValueError(f"play is {play!r}, expected one of {PLAY}")
    if play == "least" or not len(one.G.T):
        return found.platform_screw
    from assembly.solvers.cone_solvers import cone_solvers
    from assembly.statistics.hit_and_run import hit_and_run, push_all

    u = found.clearances.copy()
    loaded = loaded_clearances(one, found)
    nu = u.shape[1]
    solved = ~np.isnan(u).any(axis=1)
    to_platform = one.screws[:, :nu]
    patterns, which = np.unique(loaded, axis=0, return_inverse=True)
    for i, pattern in enumerate(patterns):
        some = np.flatnonzero((which.ravel() == i) & solved)
        rows, free = play_rows(one, pattern), ~pattern
        here = np.ascontiguousarray(u[some])
        if play == "uniform":
            for v, k in zip(here, some.tolist(), strict=True):
                hit_and_run(rows, one.starts, free, v, steps, generators[k])
        else:
            size = size_of(one.posture.robot)
            scale = np.array([1, 1, 1, 1 / size, 1 / size, 1 / size])
            wrench = [generators[k].normal(size=6) * scale for k in some.tolist()]
            pushes, ends = np.array(wrench) @ to_platform, np.empty_like(here)
            push_all(cone_solvers(), rows, one.starts, free, here, pushes, ends)
            for k in np.flatnonzero(np.isnan(ends).any(axis=1)).tolist():
                ends[k] = _push_slowly(one, rows, free, here[k], pushes[k])
            here = ends
        u[some] = here
    moved = (u - found.clearances) @ to_platform.T
    return found.platform_screw + moved


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
