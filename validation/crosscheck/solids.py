"""Prepare meshed links as solids for a simulation."""

import numpy as np
from scipy.sparse import csr_matrix, diags

from forcefit.assembly.model.mesh_link import mesh_solution, mesh_turn, modulus_factor
from forcefit.assembly.model.robot import MeshLink, Robot
from forcefit.inputs.table import BadInput
from forcefit.stiffness.fem.fea import MeshedLink
from forcefit.validation.multibody.exudyn_parts import MeshBody, MeshedSolid


def mesh_bodies(robot: Robot) -> dict[str, MeshBody]:
    """Return the solids of a robot's meshed links.

    Args:
        robot: robot of the virtual-joint model.

    Returns:
        Mapping from frame to the solid of the finest mesh. The K_E of the linear model
        is computed from the same mesh.  Links of the same shape and material share a
        solid.

    Raises:
        BadInput: K_E of a mesh was not computed when the robot was loaded, or an
            interface is not rigid.
    """
    known: dict[tuple[MeshedLink, float], MeshedSolid] = {}
    bodies = {}
    for frame in robot.frames:
        link = frame.link
        if not isinstance(link, MeshLink):
            continue
        if link.interface != "rigid":
            raise BadInput(
                f'frame "{frame.name}".link.mesh.interface: found "{link.interface}", '
                'expected "rigid" for a simulation with solids'
            )
        key = mesh_solution(frame).solved, modulus_factor(frame)
        if key not in known:
            known[key] = _solid(*key)
        solid = known[key]
        span = solid.centers[1] - solid.centers[0]
        bodies[frame.name] = MeshBody(solid, mesh_turn(frame, span))
    return bodies


def _solid(solved: MeshedLink, factor: float) -> MeshedSolid:
    """Return the solid of a link's finest mesh with the link's stiffness factor."""
    from forcefit.stiffness.fem.elements import assemble

    mesh, constants = solved.level.mesh, solved.level.material
    upper = assemble(mesh, constants[:, 0], constants[:, 1])
    return MeshedSolid(
        nodes=mesh.nodes,
        stiffness=factor * csr_matrix(upper + upper.T - diags(upper.diagonal())),
        base=np.unique(mesh.faces[mesh.patch == 0]),
        tip=np.unique(mesh.faces[mesh.patch == 1]),
        centers=solved.centers,
    )
