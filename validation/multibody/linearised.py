"""The platform's compliance by Exudyn's own linearised system.

Exudyn differentiates its equations at the equilibrium, in the motions that its joints
leave.  Closures are connectors there: their open gaps are projected out besides, so
that how stiff the connectors are does not enter, and they may be soft.  That they must,
since the derivatives are differences: of connectors a million times as stiff as what is
looked for the noise alone is seen.
"""

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from stiffness.screws import rotation_vector
from validation.multibody.exudyn_model import Model, Regularisation
from validation.multibody.exudyn_parts import Closure, Place
from validation.multibody.exudyn_reading import pose
from validation.multibody.exudyn_solver import closure_error, solve
from validation.multibody.open_robot import Case, PostureLike, build, link_springs
from validation.multibody.simulation import (
    TIME_LIMIT,
    SimulationModel,
    import_exudyn,
    without_clearance,
)

_SOFT = Regularisation(1e6, 1e-8)
_STEP = 1e-6  # of Exudyn's coordinates, whose rotations are numbers of size 1
_RANK = 1e-7  # relative size of a gap's derivative that counts as none


def linearised_compliance(posture: PostureLike, model: SimulationModel) -> NDArray:
    """Compliance of the nominal robot, drives held, no load.

    Args:
        posture: where it stands; its errors and clearances do not count.
        model: of its links.

    Returns:
        (6, 6) [rad/(N m) .. m/N] at the platform's origin, base axes.

    Raises:
        BadInput: a spring's stiffness is missing.
        SimulationFailed: no equilibrium was found.
    """
    robot = without_clearance(posture.robot)
    robot = robot.with_errors(np.zeros_like(robot.errors))
    posture = replace(posture, robot=robot)  # type: ignore[type-var]
    given = {name: np.asarray(K, dtype=float) for name, K in model.stiffness.items()}
    solids = dict(model.meshes)
    case = Case(
        posture=posture, scale=0.0, meshes=solids, elements=model.elements,
        springs=link_springs(robot, model.links, given, solids), clearances=False,
        bushes=False, load=np.zeros(6), gravity=np.zeros(3), couple=np.zeros(3),
    )  # fmt: skip
    program = Model(*import_exudyn(), robot.name, _SOFT)
    program.deadline = time.monotonic() + TIME_LIMIT
    try:
        tree = build(program, case)
        solve(program, tree.closures)
        return _compliance(program, tree.before[robot.platform], tree.closures)
    finally:
        program.discard()


def _compliance(model: Model, platform: Place, closures: list[Closure]) -> NDArray:
    """V Z (Z'KZ)^-1 Z'V' over the motions Z that keep joints and closures."""
    _, K, *_, N = model.mbs.ComputeLinearizedSystem(
        projectIntoConstraintNullspace=True, returnConstraintNullspace=True
    )
    K, N = (K + K.T) / 2, np.asarray(N)
    N = N if N.shape[1] == len(K) else N.T
    q = np.array(model.mbs.systemData.GetODE2Coordinates())
    V, G = np.zeros((6, len(K))), np.zeros((6 * len(closures), len(K)))
    for k, way in enumerate(N.T):
        places, gaps = [], []
        for moved in (q + _STEP * way, q - _STEP * way):
            model.mbs.systemData.SetODE2Coordinates(moved)
            places.append(pose(model, platform))
            gaps.append([closure_error(model, closure) for closure in closures])
        ahead, back = places
        V[:3, k] = rotation_vector(ahead[:3, :3] @ back[:3, :3].T)
        V[3:, k] = (ahead - back)[:3, 3]
        G[:, k] = np.ravel(np.array(gaps[0]) - np.array(gaps[1]))
    model.mbs.systemData.SetODE2Coordinates(q)
    Z = null_space(G, rcond=_RANK) if len(G) else np.eye(len(K))
    V, K = V @ Z / (2 * _STEP), Z.T @ K @ Z
    size = 1.0 / np.sqrt(np.abs(np.diag(K)))
    return V @ (size[:, None] * np.linalg.solve(K * np.outer(size, size), (V * size).T))
