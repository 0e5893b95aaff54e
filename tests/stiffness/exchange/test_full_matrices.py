"""Tests of the condensation of imported matrices."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags

from forcefit.inputs.errors import BadInput
from forcefit.stiffness.exchange.condensing import read_nodes
from forcefit.stiffness.exchange.import_link import import_link
from forcefit.stiffness.exchange.matrix_file import read_matrix
from forcefit.stiffness.fem.elements import assemble, isoparametric, lame
from tests.solids_for_tests import box_solid
from tests.stiffness.exchange.test_links_of_others import assert_same, three_columns


def full_matrix(counts=(2, 2, 5)):
    """Return the nodes and the stiffness matrix of a bar, 0.02 by 0.03 by 0.2 m."""
    solid = box_solid(counts, np.array([0.02, 0.03, 0.2]))
    mesh = isoparametric(solid, 3)
    lam, mu = (np.full(len(mesh.cells), c) for c in lame(7e10, 0.33))
    upper = assemble(mesh, lam, mu)
    return mesh.nodes, csr_matrix(upper + upper.T - diags(upper.diagonal()))


def write_solid(folder, nodes, K):
    """Write two files: the nodes, and the matrix in five columns."""
    lines = [f"{i},{x!r},{y!r},{z!r}" for i, (x, y, z) in enumerate(nodes.tolist(), 1)]
    (folder / "nodes.csv").write_text("\n".join(lines))
    upper = csr_matrix(np.triu(K.toarray())).tocoo()
    rows = zip(upper.row.tolist(), upper.col.tolist(), upper.data.tolist(), strict=True)
    (folder / "k.mtx").write_text("\n".join(
        f"{i // 3 + 1} {i % 3 + 1} {j // 3 + 1} {j % 3 + 1} {v!r}" for i, j, v in rows
    ))  # fmt: skip


ENDS = {"base": "z=0", "tip": "z=0.2"}


def solid_in(folder):
    """Write a small solid, and return its nodes, its matrix and its imported link."""
    nodes, K = full_matrix((1, 1, 2))
    write_solid(folder, nodes, K)
    link = import_link(folder / "k.mtx", nodes=folder / "nodes.csv", **ENDS)
    return nodes, K, link


def deck(nodes, order):
    """Return an input file of Abaqus or CalculiX."""
    lines = [f"{i + 1:7}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in order(nodes)]
    return "\n".join([
        "*Heading", "** made for a test", "*Part, name=bar", "*Node, nset=all", *lines,
        "*Element, type=C3D8", "1, 1, 2, 3, 4, 5, 6, 7, 8", "*Material, name=steel",
        " 2e+11, 0.3", "*NODE FILE", "U",
    ])  # fmt: skip


def in_order(nodes):
    return list(enumerate(nodes.tolist()))


def backwards(nodes):
    return in_order(nodes)[::-1]


@pytest.mark.parametrize("order", [in_order, backwards])
def test_three_column_matrix_has_the_nodes_of_the_input_file(order, tmp_path):
    """The file does not name its rows. There are three rows for each node."""
    nodes, K, named = solid_in(tmp_path)
    rows = [3 * i + d for i, _ in order(nodes) for d in range(3)]
    (tmp_path / "k.mtx").write_text(three_columns(K.toarray()[np.ix_(rows, rows)]))
    (tmp_path / "bar.inp").write_text(deck(nodes, order))
    link = import_link(tmp_path / "k.mtx", nodes=tmp_path / "bar.inp", **ENDS)
    assert_same(link.stiffness, named.stiffness)


@pytest.mark.slow
def test_calculix_stiffness_mass_and_dof_files_are_read(tmp_path):
    """The ``.sti`` and ``.mas`` files contain upper triangles, and the ``.dof`` file
    names their rows.
    """
    nodes, K, named = solid_in(tmp_path)
    rows = np.random.default_rng(3).permutation(3 * len(nodes))
    K = K.toarray()[np.ix_(rows, rows)]
    kilograms = np.full(len(rows), 0.324 / len(nodes))
    for name, matrix in (("bar.sti", K), ("bar.mas", np.diag(kilograms))):
        (tmp_path / name).write_text("".join(
            f"{i + 1} {j + 1} {matrix[i, j]:20.13e}\n"
            for j in range(len(rows)) for i in range(j + 1)
        ))  # fmt: skip
    names = [f"{k // 3 + 1}.{k % 3 + 1}" for k in rows]
    (tmp_path / "bar.dof").write_text("\n".join(names))
    link = import_link(
        tmp_path / "bar.sti", mass=tmp_path / "bar.mas", nodes=tmp_path / "nodes.csv",
        **ENDS,
    )  # fmt: skip
    assert_same(link.stiffness, named.stiffness)
    assert link.mass == pytest.approx(0.324)
    (tmp_path / "bar.dof").write_text("\n".join(names[:-1]))
    with pytest.raises(
        BadInput, match=r"bar\.dof: found \d+ degrees of freedom, expected"
    ):
        import_link(tmp_path / "bar.sti", nodes=tmp_path / "nodes.csv", **ENDS)


@pytest.mark.slow
@pytest.mark.exudyn
def test_condensed_solid_agrees_with_exudyn(tmp_path):
    """The reference is the stiffness of the static modes with rigid faces (RBE2)."""
    fem = pytest.importorskip("exudyn.FEM")
    nodes, K = full_matrix()
    write_solid(tmp_path, nodes, K)
    link = import_link(tmp_path / "k.mtx", nodes=tmp_path / "nodes.csv", **ENDS)
    ends = [np.flatnonzero(np.abs(nodes[:, 2] - z) < 1e-9) for z in (0, 0.2)]
    other = fem.FEMinterface()
    other.nodes = {"Position": nodes}
    other.surface = [{"Name": "none", "Trigs": []}]
    other.stiffnessMatrix = K
    other.massMatrix = csr_matrix(np.eye(3 * len(nodes)))
    other.ComputeHurtyCraigBamptonModes(
        [end.tolist() for end in ends], 0,
        computationMode=fem.HCBstaticModeSelection.RBE2,
    )  # fmt: skip
    reduced = fem.ObjectFFRFreducedOrderInterface(other)
    basis = np.asarray(reduced.modeBasis)
    rigid = np.zeros((len(ends[1]), 3, 6))
    for k in range(3):
        rigid[:, :, k] = np.cross(np.eye(3)[k], nodes[ends[1]] - link.tip)
        rigid[:, k, 3 + k] = 1.0
    moved = basis.reshape(-1, 3, basis.shape[1])[ends[1]]
    screws = np.linalg.lstsq(rigid.reshape(-1, 6), moved.reshape(-1, 6))[0]
    back = np.linalg.inv(screws)
    theirs = back.T @ np.asarray(reduced.stiffnessMatrixReduced) @ back
    assert_same(link.stiffness, theirs, 1e-8)


def test_nastran_grids_in_narrow_wide_and_free_fields_are_read(tmp_path):
    """An entry with wide fields occupies two lines. Exponents have no letter."""
    path = tmp_path / "bar.bdf"
    path.write_text(
        "$ a comment\nCEND\nBEGIN BULK\n"
        "GRID           7       0     1.5    -2.0   2.5-1\n"
        "GRID*                  8               0 0.9999999849815              0.\n"
        "*       -3.0\n"
        "GRID,9,,1.,2.,3.\n"
        "CQUAD4         1       1       7       8       9      10\n"
    )
    nodes = read_nodes(path, 1e-3)
    assert list(nodes) == [7, 8, 9]
    expected = [
        [1.5e-3, -2e-3, 2.5e-4],
        [9.999999849815e-4, 0, -3e-3],
        [1e-3, 2e-3, 3e-3],
    ]
    assert np.array(list(nodes.values())) == pytest.approx(np.array(expected))


def test_nastran_grid_in_another_coordinate_system_is_rejected(tmp_path):
    path = tmp_path / "bar.bdf"
    path.write_text("GRID,9,4,1.,2.,3.\n")
    with pytest.raises(BadInput, match="line 1: found 'GRID,9,4"):
        read_nodes(path, 1.0)


def test_stiffness_and_mass_are_found_in_a_punch_file(tmp_path):
    """The file also contains a rectangular matrix whose name begins with M."""
    path = tmp_path / "part.pch"
    path.write_text(
        "DMIG    KAAX           0       6       2       0\n"
        "DMIG*   KAAX                           1               1\n"
        "*                      1               1 1.556000000D+02\n"
        "DMIG    MAAX           0       6       2       0\n"
        "DMIG*   MAAX                           1               1\n"
        "*                      1               1 2.500000000D+00\n"
        "DMIG    MUG1           0       9       2       0                       1\n"
        "DMIG*   MUG1                           1               0\n"
        "*                      1               1 1.000000000D+00\n"
    )
    assert read_matrix(path).matrix.toarray() == pytest.approx(155.6)
    assert read_matrix(path, "mass").matrix.toarray() == pytest.approx(2.5)
