r"""Refine a minimum of :func:`.conic.minimise_energy` in numpy.

A cone solver stops at a small duality gap.  If the active cones are known (clearances
with a contact force), the minimum satisfies equations that Newton's method solves to
machine precision.  With the springs y, the multipliers n of H and the contact forces f,
these are

    G u + h - y = 0,  G' y - d - H' n + f_c u_c = 0,  H u = k,  (|u_c|^2 - 1) / 2 = 0.

Sources:
    Nocedal, Wright (2006), Numerical Optimization, section 18.1.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.solvers.cones import cone_sizes

_STEPS = 4  # largest number of Newton steps
_SETTLED = 1e-12  # [-] size of the last step at convergence
_GUESSES = 6  # largest number of corrections of the active cones
# [-] distances from the bound below which a cone with a force may be active
_NEAR = 1e-2, 0.0
_BEYOND = 1e-9  # [-] tolerance for the bound of a cone that is not active

_Problem = tuple[NDArray, NDArray, NDArray, NDArray, NDArray, NDArray]
_Point = tuple[NDArray, NDArray, NDArray]


def refine(problem: _Problem, u: NDArray, n: NDArray) -> Iterator[_Point]:
    """Yield refined minima.

    Args:
        problem: G (r, nu), h (r,), d (nu,), H (p, nu), k (p,), and the cone of each
            column (nu,).
        u: (nu,) solution to refine.
        n: (p,) multipliers of H at this solution.

    Yields:
        u (nu,), y (r,) and n (p,) for each guess of the active cones.
    """
    G, h, d, H, _, group = problem
    y = G @ u + h
    force, slack = cone_sizes(G.T @ y - d - H.T @ n, group), 1.0 - cone_sizes(u, group)
    # Either the contact force or the distance from the bound is nearly zero.
    scale = max(float(y @ y) / 2, float(force.max()), 1e-300)
    for near in _NEAR:
        pressed = (slack < near) | (force > scale * slack)
        yield _settled(problem, (u, y, n), pressed, force)


def _settled(
    problem: _Problem, start: _Point, pressed: NDArray, force: NDArray
) -> _Point:
    """Return the minimum, after correcting the set of active cones if necessary."""
    for _ in range(_GUESSES):
        settled, forces = _with_pressed(problem, start, pressed, force)
        beyond = ~pressed & (cone_sizes(settled[0], problem[-1]) > 1.0 + _BEYOND)
        pulled = pressed & (forces < 0.0)
        if not (beyond | pulled).any():
            break
        pressed = (pressed | beyond) & ~pulled
    return settled


def _with_pressed(
    problem: _Problem, start: _Point, pressed: NDArray, force: NDArray
) -> tuple[_Point, NDArray]:
    """Return the Newton solution and the contact forces for given active cones."""
    G, h, d, H, k, group = problem
    u, y, n = start
    held = np.flatnonzero(pressed)
    member, f = group[:, None] == held, force[held]
    counts = np.cumsum([len(u), len(y), len(n)])
    for _ in range(_STEPS):
        N = member * u[:, None]
        left = np.concatenate([
            G @ u + h - y,
            G.T @ y - d - H.T @ n + N @ f,
            H @ u - k,
            (cone_sizes(u, group)[held] ** 2 - 1.0) / 2,
        ])  # fmt: skip
        A = _derivatives(G, H, N, member @ f)
        step = -np.linalg.lstsq(A, left, rcond=None)[0]
        du, dy, dn, df = np.split(step, counts)
        u, y, n, f = u + du, y + dy, n + dn, f + df
        if np.abs(du).max() <= _SETTLED:
            break
    forces = np.zeros(len(force))
    forces[held] = f
    return (u, y, n), forces


def _derivatives(G: NDArray, H: NDArray, N: NDArray, curvature: NDArray) -> NDArray:
    """Return the Jacobian of the equations with respect to u, y, n and f."""
    r, p, m = len(G), len(H), N.shape[1]
    return np.block([
        [G, -np.eye(r), np.zeros((r, p + m))],
        [np.diag(curvature), G.T, -H.T, N],
        [np.vstack([H, N.T]), np.zeros((p + m, r + p + m))],
    ])  # fmt: skip
