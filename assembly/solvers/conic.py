"""Second-order cone programs in the clearances, with certified solutions.

The module solves a reduced problem (22) for the minimum energy, and problem (21) for
the smallest factor on the clearances.  Clarabel solves problem (21).

Problem (22) is solved by Clarabel (``"reference"``), or by a compiled interior-point
method (``"compiled"``) with Clarabel as fallback.  The solution is refined by
:mod:`forcefit.assembly.solvers.pressed_cones` or by Newton's method on the dual
(:mod:`forcefit.assembly.solvers.one_problem`).  The solution with the smallest
certified duality gap is returned.  The gap is evaluated independently of the solvers.

Sources:
    Goulart, Chen (2024), Clarabel: an interior-point solver for conic programs with
    quadratic objectives.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, hstack, vstack

from forcefit.assembly.solvers import one_problem
from forcefit.assembly.solvers.cones import cone_sizes, cone_starts, into_cones
from forcefit.assembly.solvers.method import Method
from forcefit.assembly.solvers.pressed_cones import refine

_TOLERANCE = 1e-13
# Static regularisations of Clarabel, tried in this order. Its default, 1e-8, is less
# accurate.
_REGULARISATIONS = (0.0, 1e-10, 1e-8)
# largest duality gap of a certified solution, relative to its energy and to the
# energy without clearance
GAP, GAP_WITHOUT_CLEARANCE = 1e-8, 1e-12
_GAP_WITHIN = 1e-12  # required relative duality gap of the interior-point method
# fraction of GAP that is required here, because the duality gap of the problem before
# elimination of the springs is larger
_SHARE = 0.1
_STOP = 1e-2  # fraction of GAP at which Newton's method stops
# largest number of Newton steps, and initial sigma of Newton's method
_STEPS, _FIRST_SIGMA = 150, 1e6
_RESIDUAL = 1e-11  # largest residual of H u = k
# largest factor on the clearances for which infeasibility is proved
_LARGEST_FACTOR = 1e8
_UNPROVED = "PrimalInfeasible, but its multipliers do not prove it"


class SolverFailed(RuntimeError):
    """Raised if a solver finds no solution of a problem.

    Attributes:
        problem: name of the problem.
        status: status reported by the solver.
    """

    def __init__(self, problem: str, status: str) -> None:
        super().__init__(f"{problem}: Clarabel stopped with {status}")
        self.problem, self.status = problem, status


@dataclass(frozen=True, eq=False)
class ConicSolution:
    """Solution of :func:`minimise_energy`.

    Attributes:
        clearances: (nu,) clearances relative to their bounds.
        springs: (r,) [sqrt(2 J)] multipliers of the springs, equal to G u + h up to the
            duality gap.
        rigid_multipliers: (p,) [J] multipliers of the equations H u = k.
        value: [J] value of the objective.
        bound: [J] certified lower bound on the objective.
        feasible: whether H u = k has a solution with |u_k| <= 1 for each cone.
    """

    clearances: NDArray
    springs: NDArray
    rigid_multipliers: NDArray
    value: float
    bound: float
    feasible: bool = True

    @property
    def gap(self) -> float:
        """Duality gap: objective minus its lower bound [J]."""
        return self.value - self.bound


class ConeProgramme(NamedTuple):
    """Scaled arguments of :func:`minimise_energy`."""

    G: NDArray
    h: NDArray
    d: NDArray
    H: NDArray
    k: NDArray
    group: NDArray


def minimise_energy(
    G: NDArray, h: NDArray, d: NDArray, H: NDArray, k: NDArray, group: NDArray,
    method: Method = "compiled",
) -> ConicSolution:  # fmt: skip
    """Minimise |G u + h|^2 / 2 - d.u subject to H u = k and |u_k| <= 1 for each cone.

    Args:
        G: (r, nu) [sqrt(2 J)] matrix.
        h: (r,) [sqrt(2 J)] vector.
        d: (nu,) [J] vector.
        H: (p, nu) matrix of full row rank.
        k: (p,) vector.
        group: (nu,) cone of each column, counted from 0.
        method: ``"compiled"``, which falls back on Clarabel if the solution cannot be
            certified; or ``"reference"``, which uses only Clarabel.

    Returns:
        The minimiser with a certified lower bound.

    Raises:
        SolverFailed: Clarabel returned no usable solution.
    """
    if not (h.any() or d.any() or k.any()):  # The solution is zero.
        zeros = np.zeros(len(h)), np.zeros(len(k))
        return ConicSolution(np.zeros(len(d)), *zeros, 0.0, 0.0)
    if G.shape[1] == 0:
        energy = float(h @ h) / 2
        return ConicSolution(np.zeros(0), h, np.zeros(len(k)), energy, energy)
    size = max(np.linalg.norm(h), np.linalg.norm(G, axis=0).max(), 1e-150)
    size = max(size, float(np.sqrt(np.abs(d).max())))
    rows = np.linalg.norm(H, axis=1)
    scaled = ConeProgramme(
        G / size, h / size, d / size**2, H / rows[:, None], k / rows, group
    )
    best, status = None, ""
    for solve in _SOLVERS[method]:
        u, rigid, status = solve(*scaled)
        if status == "PrimalInfeasible":
            return ConicSolution(
                clearances=np.zeros_like(d),
                springs=np.zeros_like(h),
                rigid_multipliers=np.zeros_like(k),
                value=np.inf,
                bound=np.inf,
                feasible=False,
            )
        if u is None:
            continue
        for candidate in _certified(scaled, into_cones(u, group), rigid, method):
            if best is None or candidate.gap < best.gap:
                best = candidate
            if _proved(best, scaled.h):
                break
        if best is not None and _proved(best, scaled.h):
            break
    if best is None:
        raise SolverFailed("minimum energy", status)
    joule = size**2
    return ConicSolution(
        clearances=best.clearances,
        springs=best.springs * size,
        rigid_multipliers=best.rigid_multipliers / rows * joule,
        value=best.value * joule,
        bound=best.bound * joule,
    )


def _proved(least: ConicSolution, h: NDArray) -> bool:
    """Return whether the duality gap of a solution is within the tolerance."""
    allowed = GAP * abs(least.value) + GAP_WITHOUT_CLEARANCE * float(h @ h) / 2
    return least.gap <= _SHARE * allowed


def _compiled(
    G: NDArray, h: NDArray, d: NDArray, H: NDArray, k: NDArray, group: NDArray
) -> tuple[NDArray | None, NDArray, str]:
    """Solve a problem by the compiled interior-point method."""
    u, n = one_problem.interior_point((G, h, d, H, k), cone_starts(group), _GAP_WITHIN)
    finite = np.isfinite(u).all() and np.isfinite(n).all()
    if not finite or np.abs(H @ u - k).max(initial=0.0) > _RESIDUAL:
        return None, -n, "no feasible point found"
    return u, -n, "Solved"


def _by_clarabel(
    regularisation: float, G: NDArray, h: NDArray, d: NDArray, H: NDArray, k: NDArray,
    group: NDArray,
) -> tuple[NDArray | None, NDArray, str]:  # fmt: skip
    """Solve a problem by Clarabel, with v = -G u - h as additional variables."""
    r, nu = G.shape
    cones, radii = _unit_cones(group, np.ones(nu))
    rows = np.vstack([G, H, cones.toarray()])
    # A dense matrix is faster for small problems.
    A = csc_matrix(np.hstack([rows, np.eye(len(rows), r)]))
    b = np.concatenate([-h, k, radii])
    P = csc_matrix(np.diag(np.repeat([0.0, 1.0], [nu, r])))
    q = np.concatenate([-d, np.zeros(r)])
    x, z, status = _clarabel(
        P, q, A, b, _Cones(equal=r + len(k), group=group), regularisation
    )
    rigid = -z[r : r + len(k)]
    if status == "PrimalInfeasible":
        if not _proves_no_point(rigid, H, k, group, np.ones(group[-1] + 1)):
            status = _UNPROVED
        return None, rigid, status
    return (None if x is None else x[:nu]), rigid, status


_BY_CLARABEL = tuple(partial(_by_clarabel, value) for value in _REGULARISATIONS)
_Solver = Callable[..., tuple[NDArray | None, NDArray, str]]
_SOLVERS: dict[Method, tuple[_Solver, ...]] = {
    "compiled": (_compiled, *_BY_CLARABEL), "reference": _BY_CLARABEL,
}  # fmt: skip


def _certified(
    problem: ConeProgramme, u: NDArray, rigid: NDArray, method: Method
) -> Iterator[ConicSolution]:
    """Yield solutions with bounds, before and after refinement by Newton's method."""
    own = _certify(problem, u, problem.G @ u + problem.h, rigid)
    if method == "reference":  # The compiled method omits this step.
        for refined in refine(problem, u, rigid):
            yield from _checked(problem, *refined)
    yield own
    if method == "reference" or np.bincount(problem.group).max() > 2:
        return  # The compiled Newton's method supports cones of at most two columns.
    G, h, d, H, k, group = problem
    u, y, starts = u.copy(), np.concatenate([h, -rigid]), cone_starts(group)
    relative = _STOP * GAP
    absolute = _STOP * GAP_WITHOUT_CLEARANCE * float(h @ h) / 2
    limits = one_problem.SolverLimits(relative, absolute, _FIRST_SIGMA, _STEPS)
    one_problem.newton((G, h, d, H, k), starts, limits, u, y)
    yield from _checked(problem, u, y[: len(h)], -y[len(h) :])


def _checked(
    problem: ConeProgramme, u: NDArray, springs: NDArray, rigid: NDArray
) -> Iterator[ConicSolution]:
    """Yield a solution with its lower bound if it satisfies all constraints."""
    u = into_cones(u, problem.group)
    if all(np.isfinite(part).all() for part in (u, springs, rigid)):
        if np.abs(problem.H @ u - problem.k).max(initial=0.0) <= _RESIDUAL:
            yield _certify(problem, u, springs, rigid)


def _certify(
    problem: ConeProgramme, u: NDArray, springs: NDArray, rigid: NDArray
) -> ConicSolution:
    """Return a solution with its objective and a certified lower bound."""
    strain = problem.G @ u + problem.h
    value = float(strain @ strain) / 2 - float(problem.d @ u)
    bound = _energy_bound(problem, springs, rigid)
    if not problem.d.any():
        # The multipliers times any factor f prove the bound f gain - f^2 cost / 2.
        cost = float(springs @ springs)
        factor = max(0.0, bound + cost / 2) / cost if cost > 0.0 else 0.0
        better = _energy_bound(problem, factor * springs, factor * rigid)
        if better > bound:
            bound, springs, rigid = better, factor * springs, factor * rigid
    return ConicSolution(u, springs, rigid, value, bound)


def _energy_bound(problem: ConeProgramme, spring: NDArray, rigid: NDArray) -> float:
    """Compute a certified lower bound on problem (22) from estimated multipliers.

    For every y and n, and for every u that satisfies H u = k, |Gu + h|^2/2 - d.u >=
    y.(Gu + h) - y.y/2 - d.u + n.(k - Hu).  The bound is the minimum of the right-hand
    side over the unit cones, which has a closed form.

    Args:
        problem: scaled problem.
        spring: (r,) estimate of y; the best value is G u + h at the minimum.
        rigid: (p,) estimate of n.

    Returns:
        The certified lower bound.
    """
    G, h, d, H, k, group = problem
    gradient = G.T @ spring - d - H.T @ rigid
    gain = float(cone_sizes(gradient, group).sum())
    return float(spring @ h - spring @ spring / 2 + rigid @ k) - gain


def least_factor(
    B: NDArray, right: NDArray, group: NDArray, scaled: NDArray
) -> tuple[float | None, NDArray, NDArray]:
    """Return the smallest t with B u = right, |u_k| <= t or |u_k| <= 1 for each cone.

    Args:
        B: (m, nu) matrix of full row rank, m >= 1.
        right: (m,) right-hand side.
        group: (nu,) cone of each column.
        scaled: (nu,) bool, True if the cone of the column has the radius t, False if it
            has the radius 1.

    Returns:
        The factor t, or None if there is no solution; the clearances u (nu,); and the
        multipliers (m,) that prove t.

    Raises:
        SolverFailed: Clarabel returned no usable solution.
    """
    m, nu = B.shape
    rows = np.linalg.norm(B, axis=1)
    # If t scales all cones, t is proportional to ``right``, which is then normalised.
    size = np.linalg.norm(right / rows) if scaled.all() else 1.0
    unit_cones, radii = _unit_cones(group, np.where(scaled, 0.0, 1.0))
    _, factors = _unit_cones(group, np.where(scaled, -1.0, 0.0))
    equal = hstack([csc_matrix(B / rows[:, None]), csc_matrix((m, 1))])
    cones = hstack([unit_cones, csc_matrix(factors[:, None])])
    positive = csc_matrix(([-1.0], ([0], [nu])), shape=(1, nu + 1))  # t >= 0
    A = vstack([equal, positive, cones], format="csc")
    b = np.concatenate([right / rows / size, [0.0], radii])
    q = np.zeros(nu + 1)
    q[-1] = 1.0
    P = csc_matrix((nu + 1, nu + 1))
    for regularisation in _REGULARISATIONS:
        x, z, status = _clarabel(
            P, q, A, b, _Cones(equal=m, group=group, positive=1), regularisation
        )
        if status == "PrimalInfeasible":
            radius = np.where(scaled, _LARGEST_FACTOR, 1.0)[cone_starts(group)[:-1]]
            n = -z[:m] / rows
            if _proves_no_point(n, B, right / size, group, radius):
                return None, np.zeros(nu), np.zeros(m)
            status = _UNPROVED
        if status == "Solved":
            break
    if x is None:
        raise SolverFailed("zone margin", status)
    return max(0.0, float(x[-1] * size)), x[:nu] * size, -z[:m] / rows


def _unit_cones(group: NDArray, radius: NDArray) -> tuple[csc_matrix, NDArray]:
    """Return A and b of the conic constraints |u_k| <= radius, in Clarabel's form."""
    nu, cones = len(group), int(group.max()) + 1
    # Each cone has one row for its radius, followed by a row for each component.
    at = np.arange(nu) + group + 1
    A = csc_matrix((np.ones(nu), (at, np.arange(nu))), shape=(nu + cones, nu))
    b = np.zeros(nu + cones)
    first = cone_starts(group)[:-1]
    b[first + np.arange(cones)] = radius[first]
    return A, b


class _Cones(NamedTuple):
    """Constraints of a program: equations, then inequalities, then cones."""

    equal: int
    group: NDArray
    positive: int = 0


def _clarabel(
    P: csc_matrix, q: NDArray, A: csc_matrix, b: NDArray, cones: _Cones,
    regularisation: float,
) -> tuple[NDArray | None, NDArray, str]:  # fmt: skip
    """Minimise x.P.x/2 + q.x subject to A x + s = b by Clarabel."""
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_iter = 200
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TOLERANCE
    settings.static_regularization_enable = bool(regularisation)
    settings.static_regularization_constant = regularisation
    sets = [clarabel.ZeroConeT(cones.equal)] if cones.equal else []
    sets += [clarabel.NonnegativeConeT(cones.positive)] if cones.positive else []
    sets += [clarabel.SecondOrderConeT(int(n) + 1) for n in np.bincount(cones.group)]
    solution = clarabel.DefaultSolver(P, q, A, b, sets, settings).solve()
    status = str(solution.status)
    x, z = np.array(solution.x), np.array(solution.z)
    # An inaccurate solution is accepted, because its certificate is checked later.
    usable = {"Solved", "AlmostSolved", "InsufficientProgress", "MaxIterations"}
    if status not in usable or not (np.isfinite(x).all() and np.isfinite(z).all()):
        return None, z, status
    return x, z, status


def _proves_no_point(
    n: NDArray, H: NDArray, k: NDArray, group: NDArray, radius: NDArray
) -> bool:
    """Return whether n proves that H u = k has no solution with |u_k| <= radius."""
    # Since n.H u is at most the sum of radius_k |(H^T n)_k|, the equation H u = k is
    # infeasible if n.k exceeds this sum by more than round-off.
    most = float(cone_sizes(H.T @ n, group) @ radius)
    rounding = 1e-13 * float(np.abs(n) @ (np.abs(k) + np.abs(H).sum(axis=1)))
    return bool(float(n @ k) > most + rounding)
