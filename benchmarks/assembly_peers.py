"""Problems (22) and (21) solved by cvxpy, Clarabel and moreau, for comparison."""

import time
import warnings

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, coo_array, csc_matrix, diags_array, hstack, vstack

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.assembled import all_loads
from forcefit.assembly.linear.closure import linearise, virtual_joints
from forcefit.assembly.linear.reference import as_printed
from forcefit.assembly.linear.reference.reduction import reduce_problem
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.solvers import conic

LOAD = np.array([1.0, 2.0, 3.0, 30.0, 10.0, -100.0])  # [N m, N] load on the platform
GRAVITY = np.array([0.0, 0.0, -9.81])  # [m/s^2]


def closure_matrices(
    posture: Posture, springs: bool = True, own_axes_free: bool = False
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Return the scaled coefficients and constants of the loop-closure equations.

    The coefficients belong to free motions, clearances and springs.
    """
    lin, joints = (
        linearise(posture),
        virtual_joints(posture.robot, springs, own_axes_free),
    )
    small = np.abs(lin.rows @ joints.cones).max()
    elastic = lin.rows @ joints.elastic
    soft = np.abs(elastic).max(initial=0.0) or 1.0
    return (
        lin.rows @ joints.free, lin.rows @ joints.cones / small, elastic / soft,
        lin.misfit / small,
    )  # fmt: skip


def loaded_matrices(posture: Posture) -> tuple[NDArray, ...]:
    """Return the closure matrices and the loads, with the same scaling."""
    lin, joints = linearise(posture), virtual_joints(posture.robot)
    loads = all_loads(posture, LOAD, None, GRAVITY)
    small = np.abs(lin.rows @ joints.cones).max()
    # scaling factor of the springs
    soft = np.abs(lin.rows @ joints.elastic).max() / small
    on_springs = np.where(
        joints.links, loads.body @ joints.elastic, loads.joint @ joints.elastic
    )
    return (
        *closure_matrices(posture), soft**2 * small * (loads.joint @ joints.free),
        soft**2 * (loads.joint @ joints.cones), soft * on_springs,
    )  # fmt: skip


class Dpp:
    """Problem (22) or (21) with cvxpy parameters, which is canonicalised only once.

    Entries that are zero at every posture are constants.  As parameters, they would
    double the time, because cvxpy passes them to the solver as explicit zeros.
    """

    def __init__(
        self, robot: Robot, own_axes_free: bool, margin: bool, data: list[tuple]
    ) -> None:
        joints = virtual_joints(robot, not margin, own_axes_free)
        self.entries = [
            np.nonzero(sum(map(np.abs, parts))) for parts in zip(*data, strict=True)
        ]
        self.parameters = [
            cp.Parameter(part.shape, sparsity=at) if part.size and part.ndim > 1
            else cp.Parameter(part.shape)
            for part, at in zip(data[0], self.entries, strict=True)
        ]  # fmt: skip
        q, u, y = (cp.Variable(part.shape[1]) for part in data[0][:3])
        t = cp.Variable(nonneg=True)
        A_q, A_u, A_y, misfit, *loads = self.parameters
        total = A_q @ q + A_u @ u + misfit
        if len(joints.links):
            total = total + A_y @ y
        limits = [total == 0]
        for cone in range(int(joints.group.max()) + 1):
            part = np.flatnonzero(joints.group == cone)
            limits.append(cp.norm(u[part]) <= (t if margin else 1.0))
        goal = t if margin else cp.sum_squares(y) / 2
        goal -= sum(own @ x for own, x in zip(loads, (q, u, y), strict=False))
        self.problem = cp.Problem(cp.Minimize(goal), limits)
        self(data[0])

    def __call__(self, data: tuple) -> float:
        """Return the minimum for the closure matrices of a new posture."""
        for parameter, value, at in zip(
            self.parameters, data, self.entries, strict=True
        ):
            if parameter.attributes["sparsity"]:
                parameter.value_sparse = coo_array((value[at], at), shape=value.shape)
            else:
                parameter.value = value
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.problem.solve(solver=cp.CLARABEL)
        return float(self.problem.value)


def clarabel_full(posture: Posture) -> object:
    """Solve the full, scaled problem by Clarabel without a modelling layer."""
    A_q, A_u, A_y, misfit = closure_matrices(posture)
    group = virtual_joints(posture.robot).group
    limits, radii = conic._unit_cones(group, np.ones(len(group)))
    others = csc_matrix((limits.shape[0], A_y.shape[1] + A_q.shape[1]))
    A = vstack([csc_matrix(np.hstack([A_u, A_y, A_q])), hstack([limits, others])])
    P = block_diag([
        csc_matrix((len(group),) * 2), diags_array(np.ones(A_y.shape[1])),
        csc_matrix((A_q.shape[1],) * 2),
    ])  # fmt: skip
    b = np.concatenate([-misfit, radii])
    q = np.zeros(A.shape[1])
    return conic._clarabel(
        P.tocsc(), q, A.tocsc(), b, conic._Cones(equal=len(misfit), group=group), 1e-8
    )


def clarabel_reduced(posture: Posture) -> object:
    """Reduce the problem and solve it by Clarabel."""
    joints = virtual_joints(posture.robot)
    small = reduce_problem(linearise(posture), joints)
    size = max(np.linalg.norm(small.h), np.linalg.norm(small.G, axis=0).max())
    return conic._by_clarabel(
        1e-8, small.G / size, small.h / size, small.d, small.H, small.k, joints.group
    )


def moreau_batched(postures: list[Posture]) -> float:
    """Return the processor time [us] of moreau per problem in a batch.

    The time includes passing the matrices, but not their computation.  It is NaN if
    moreau is not installed.
    """
    try:
        import moreau
    except ImportError:
        return np.nan
    data = [closure_matrices(posture) for posture in postures]
    group = virtual_joints(postures[0].robot).group
    limits, radii = conic._unit_cones(group, np.ones(len(group)))
    springs, free = data[0][2].shape[1], data[0][0].shape[1]
    limits = np.pad(limits.toarray(), ((0, 0), (0, springs + free)))
    A = np.array([np.vstack([np.hstack([u, y, q]), limits]) for q, u, y, _ in data])
    at = np.nonzero(np.any(A, axis=0))
    offsets = np.cumsum([0, *np.bincount(at[0], minlength=A.shape[1])])
    stored = len(group) + np.arange(springs)  # spring unknowns
    P_offsets = np.searchsorted(stored, np.arange(A.shape[2] + 1))
    solver = moreau.CompiledSolver(
        A.shape[2], A.shape[1], P_offsets, stored, offsets, at[1],
        moreau.Cones(
            num_zero_cones=len(data[0][3]), so_cone_dims=list(np.bincount(group) + 1)
        ),
        moreau.Settings(batch_size=len(A), device="cpu", solver="ipm"),
    )  # fmt: skip
    q = np.zeros((len(A), A.shape[2]))
    b = np.array([np.concatenate([-one[3], radii]) for one in data])
    values, ones = A[:, *at], np.ones((len(A), springs))
    start = time.process_time()
    solver.setup(ones, values)
    solver.solve(q, b)
    taken = (time.process_time() - start) / len(A) * 1e6
    solved = {status.name for status in solver.info.status}
    return taken if solved == {"Solved"} else np.nan


def cvxpy_rebuilt(posture: Posture) -> object:
    """Solve the problem in SI units, with a new cvxpy model for each posture."""
    as_printed._UNIT = 1.0
    return as_printed.energy_as_printed(posture)
