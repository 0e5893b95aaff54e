"""Tests of solids in floating frames against their condensed stiffness K_E."""

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags

from forcefit.assembly.files.solved_links import solve_links
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import BeamLink, Frame, MatrixLink, MeshLink, Robot
from forcefit.stiffness.fem.condensation import condense
from forcefit.stiffness.fem.elements import assemble, isoparametric, lame
from forcefit.validation.crosscheck.crosscheck import crosscheck
from forcefit.validation.multibody.exudyn_parts import MeshBody, MeshedSolid
from forcefit.validation.multibody.motion import placement
from forcefit.validation.multibody.simulation import SimulationModel, simulate_assembly
from tests.solids_for_tests import box_solid

pytestmark = pytest.mark.exudyn

SURFACE = Path(__file__).parents[3] / "meshes" / "distal_plain.stl"
SIZE = np.array([0.03, 0.04, 0.2])  # [m] dimensions of a link along z of the mesh
TURN = np.array([0.4, -0.3, 0.8])  # [rad] rotation vector from frame to mesh axes


@pytest.fixture(scope="module")
def block():
    """Return a slender box as a mesh body, and its K_E at the tip in frame axes."""
    solid = box_solid((2, 2, 8), SIZE)
    mesh = isoparametric(solid)
    constants = np.array(lame(70e9, 0.33))[:, None] * np.ones(len(solid.cells))
    centers = np.array([[*SIZE[:2] / 2, 0], [*SIZE[:2] / 2, SIZE[2]]])
    upper = assemble(mesh, *constants)
    turn = placement(TURN, np.zeros(3))[:3, :3]
    meshed = MeshedSolid(
        nodes=mesh.nodes,
        stiffness=csr_matrix(upper + upper.T - diags(upper.diagonal())),
        base=np.unique(mesh.faces[mesh.patch == 0]),
        tip=np.unique(mesh.faces[mesh.patch == 1]),
        centers=centers,
    )
    A = np.kron(np.eye(2), turn)
    return MeshBody(meshed, turn), A @ condense(
        mesh, *constants, centers
    ).stiffness @ A.T


def test_deformation_of_a_loaded_solid_equals_condensed_stiffness(block):
    """The screw is K_E^-1 w, and the energy is w K_E^-1 w / 2."""
    body, K = block
    frame = Frame("tip", translation=[0.1, 0.2, 0.3], link=MatrixLink(K))
    posture = home_posture(Robot("block", "tip", (frame,)))
    wrench = np.array([0.03, -0.02, 0.01, 0.3, 0.2, -0.4])
    assembly = simulate_assembly(
        posture, model=SimulationModel(meshes={"tip": body}), load=wrench
    )
    screw = np.linalg.solve(K, wrench)
    scale = np.abs(screw[:3]).max() * np.array([1, 1, 1, 0.2, 0.2, 0.2])
    assert 1e-7 < scale[0] < 1e-5
    np.testing.assert_allclose(
        assembly.link_screws[0] / scale, screw / scale, atol=1e-5
    )
    assert assembly.energy == pytest.approx(wrench @ screw / 2, rel=1e-5)
    np.testing.assert_allclose(assembly.link_wrenches[0], wrench, atol=1e-5 * 0.4)


def test_solid_between_walls_agrees_with_its_spring_to_first_order(block):
    """A tenth of the misfit causes a hundredth of the difference."""
    body, K = block
    error = np.array([1e-3, -2e-3, 1e-3, 1e-4, 2e-4, -1e-4])
    frames = (
        Frame("a", translation=[0.1, 0, 0], link=MatrixLink(K), geometric_error=error),
        Frame("wall", translation=[0.3, 0, 0]),
        Frame("b", "wall", translation=[-0.2, 0, 0], link=MatrixLink(K / 3)),
    )
    posture = home_posture(Robot("walls", "a", frames, (("a", "b"),)))
    difference = []
    for scale in (1.0, 0.1):
        solid = simulate_assembly(posture, scale, SimulationModel(meshes={"a": body}))
        spring = simulate_assembly(posture, scale)
        gap = np.abs(solid.platform_screw - spring.platform_screw).max()
        assert solid.energy == pytest.approx(spring.energy, rel=1e-2 * scale)
        difference.append(gap)
    assert difference[0] > 1e-9
    assert np.log10(difference[0] / difference[1]) > 1.8


@pytest.mark.slow
def test_crosscheck_of_meshed_links_as_solids_passes():
    """The linear model uses K_E, and the simulation uses the solid of the same mesh."""
    link = MeshLink(SURFACE, "z=0", "z=0.452", 60e9, 0.3)
    error = [1e-3, -2e-3, 1e-3, 1e-4, 2e-4, -1e-4]
    frames = (
        Frame("a", translation=[0.452, 0, 0], link=link, geometric_error=error),
        Frame("wall", translation=[0.5, 0.4, 0.2]),
        Frame("b", "wall", translation=[-0.048, -0.4, -0.2],
              link=BeamLink({"radius": 0.02}, 60e9, 0.3)),
    )  # fmt: skip
    robot = solve_links(Robot("meshed", "a", frames, (("a", "b"),)))
    posture = home_posture(robot)
    assembly = crosscheck(posture, links="fem", load=[1, 2, -1, 30, 20, -50])
    assert assembly.passed, assembly.checks
    assert max(check.value for check in assembly.metric.limits.values()) < 1e-3
