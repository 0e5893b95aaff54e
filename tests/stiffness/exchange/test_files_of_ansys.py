"""Tests of the import of matrices from Ansys."""

import numpy as np
import pytest
from scipy.sparse import csc_array, tril

from forcefit.inputs.errors import BadInput
from forcefit.stiffness.exchange.import_link import import_link
from forcefit.stiffness.exchange.matrix_file import read_matrix
from tests.stiffness.exchange.test_full_matrices import ENDS, solid_in
from tests.stiffness.exchange.test_links_of_others import assert_same

HEAD = "%%MatrixMarket matrix coordinate real {}\n%===\n% Creator: ANSYS Inc\n%===\n"


def matrix_market(K, symmetry="symmetric"):
    """Return a Matrix Market file as written by ``*EXPORT,K,MMF``."""
    half = tril(K).tocoo()
    entries = zip(half.row + 1, half.col + 1, half.data.tolist(), strict=True)
    lines = [f"{i} {j} {v:.16e}" for i, j, v in entries]
    n = K.shape[0]
    return HEAD.format(symmetry) + "\n".join([f"{n} {n} {len(lines)}", *lines, ""])


def harwell_boeing(K, kind="RSA", right_side=True):
    """Return a Harwell-Boeing file as written by ``HBMAT``."""
    half = csc_array(tril(K)) if kind == "RSA" else csc_array(K)
    half.sort_indices()
    n, entries = half.shape[0], half.nnz
    counts = [n + 1, entries, entries, n if right_side else 0]
    rhs = [f"{0.0:25.15E}".replace("E", "D")] * counts[3]
    head = [
        f"{'STIFFNESS MATRIX FROM ANSYS FULL FILE':72s}file",
        "".join(f"{count:14d}" for count in [sum(counts), *counts]),
        f"{kind:14s}" + "".join(f"{count:14d}" for count in (n, n, entries, 0)),
        "(1I14)          (1I14)          (1D25.15)           (1D25.15)",
        *(["F                          1             0"] if right_side else []),
    ]
    body = [f"{k + 1:14d}" for k in (*half.indptr.tolist(), *half.indices.tolist())]
    values = [f"{v:25.15E}".replace("E", "D") for v in half.data.tolist()]
    return "\n".join([*head, *body, *values, *rhs, ""])


def node_vector(numbers):
    """Return the nodes in the order of the rows as written by ``*EXPORT``."""
    head = "%%MatrixMarket matrix array integer general\n% Creator: ANSYS Inc\n"
    return head + "\n".join(map(str, [f"{len(numbers)} 1", *numbers, ""]))


def mapping(freedoms):
    """Return a mapping file as written by ``HBMAT,..,YES``."""
    labels = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
    lines = [
        f"{row:12d}{node:12d}   {labels[direction - 1]}"
        for row, (node, direction) in enumerate(freedoms, 1)
    ]
    return "\n".join(["  Matrix Eqn       Node   DOF", *lines, ""])


@pytest.fixture
def solid(tmp_path):
    """Return a folder with the files of a solid, its matrix in random row order, this
    order and the expected stiffness."""
    nodes, K, expected = solid_in(tmp_path)
    order = np.random.default_rng(2).permutation(len(nodes))
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    return tmp_path, K.tocsr()[rows][:, rows], order, expected.stiffness


@pytest.mark.parametrize("symmetry", ["symmetric", "general"])
def test_matrix_market_rows_have_the_order_of_the_node_vector(solid, symmetry):
    """The file contains only one triangle of the matrix, although its header declares a
    general matrix.
    """
    folder, K, order, expected = solid
    (folder / "full.mmf").write_text(matrix_market(K, symmetry))
    (folder / "full.mapping").write_text(node_vector((order + 1).tolist()))
    link = import_link(folder / "full.mmf", nodes=folder / "nodes.csv", **ENDS)
    assert_same(link.stiffness, expected)


@pytest.mark.parametrize("kind", ["RSA", "RUA"])
def test_harwell_boeing_rows_have_the_order_of_the_mapping_file(solid, kind):
    folder, K, order, expected = solid
    freedoms = [(node + 1, d) for node in order.tolist() for d in (1, 2, 3)]
    shuffled = np.random.default_rng(4).permutation(len(freedoms))
    K = K[shuffled][:, shuffled]
    (folder / "stiff.matrix").write_text(harwell_boeing(K, kind))
    (folder / "stiff.mapping").write_text(mapping([freedoms[k] for k in shuffled]))
    M = csc_array((np.full(K.shape[0], 0.324 / len(order)), (range(K.shape[0]),) * 2))
    (folder / "mass.matrix").write_text(harwell_boeing(M, right_side=False))
    link = import_link(
        folder / "stiff.matrix", mass=folder / "mass.matrix",
        nodes=folder / "nodes.csv", **ENDS,
    )  # fmt: skip
    assert_same(link.stiffness, expected)
    assert link.mass == pytest.approx(0.324)


def test_node_file_with_decimal_commas_is_read(solid):
    folder, K, order, expected = solid
    places = [line.split(",") for line in (folder / "nodes.csv").read_text().split()]
    lines = ["\t".join(words).replace(".", ",") + "\t" for words in places]
    head = "Node Number\tX Location (m)\tY Location (m)\tZ Location (m)\t"
    (folder / "nodes.txt").write_text("\n".join([head, *lines, ""]))
    (folder / "full.mtx").write_text(matrix_market(K))
    (folder / "full.mapping").write_text(node_vector((order + 1).tolist()))
    link = import_link(folder / "full.mtx", nodes=folder / "nodes.txt", **ENDS)
    assert_same(link.stiffness, expected)
    with pytest.raises(
        BadInput, match="lengths in the file are in m, but --unit is different"
    ):
        import_link(folder / "full.mtx", nodes=folder / "nodes.txt", unit="mm", **ENDS)


def test_mapping_of_six_degrees_of_freedom_per_node_is_read(tmp_path):
    """The matrix has two nodes, and the rows of the second node come first."""
    B = np.random.default_rng(0).normal(size=(12, 12))
    K = B @ B.T
    rows = np.r_[6:12, 0:6]
    (tmp_path / "k.mtx").write_text(matrix_market(csc_array(K[np.ix_(rows, rows)])))
    (tmp_path / "k.mapping").write_text(node_vector([2, 1]))
    read = read_matrix(tmp_path / "k.mtx")
    assert read.named
    assert read.freedoms[:3] == ((2, 1), (2, 2), (2, 3))
    back = np.argsort([6 * node + d for node, d in read.freedoms])
    np.testing.assert_allclose(read.matrix.toarray()[np.ix_(back, back)], K)


@pytest.mark.parametrize(("text", "message"), [
    (node_vector([1, 1, 2]), "found 2 different nodes, expected one column with 3"),
    (node_vector([1, 2, 3, 4, 5]), "but the matrix has 12 rows"),
    ("1 1 UX\n2 1 UQ\n", "found the label 'UQ'"),
    ("1 1 UX\n3 1 UY\n", "expected rows numbered from 1"),
    ("1 1\n", "expected a row number, a node number and a label"),
    ("Matrix Eqn\n", "expected rows numbered from 1"),
])  # fmt: skip
def test_wrong_mapping_is_rejected(text, message, tmp_path):
    (tmp_path / "k.mtx").write_text(matrix_market(csc_array(np.eye(12))))
    (tmp_path / "k.mapping").write_text(text)
    with pytest.raises(BadInput) as caught:
        read_matrix(tmp_path / "k.mtx")
    assert message in str(caught.value).replace('"', "'")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("change", "message"), [
    (lambda t: t.replace("RSA", "CSA"), "expected RSA or RUA"),
    (lambda t: "\n".join(t.split("\n")[:3]), "found an incomplete header"),
    (lambda t: "\n".join(t.split("\n")[:20]), "expected 12"),
    (lambda t: t.replace("1.000000000000000D+00", "1.0000x0000000000D+00", 1),
     "expected a number"),
])  # fmt: skip
def test_wrong_harwell_boeing_file_is_rejected(change, message, tmp_path):
    text = harwell_boeing(csc_array(np.eye(12)), right_side=False)
    (tmp_path / "k.matrix").write_text(change(text))
    with pytest.raises(BadInput, match=message):
        read_matrix(tmp_path / "k.matrix")


@pytest.mark.parametrize(("head", "numbers"), [
    ("coordinate real general", "3 3 5\n1 1 2\n2 2 3\n3 3 0.04D2\n1 2 1\n2 1 1\n"),
    ("coordinate integer symmetric", "3 3 4\n1 1 2\n2 2 3\n3 3 4\n2 1 1\n"),
    ("array real general", "3 3\n2\n1\n0\n1\n3\n0\n0\n0\n4\n"),
    ("array real symmetric", "3 3\n2\n1\n0\n3\n0\n4\n"),
])  # fmt: skip
def test_matrix_market_file_of_every_kind_is_read(head, numbers, tmp_path):
    """Arrays are stored by columns. The lower triangle of a symmetric matrix is
    stored."""
    matrix = np.array([[2.0, 1, 0], [1, 3, 0], [0, 0, 4]])
    path = tmp_path / "k.mtx"
    path.write_text(f"%%MatrixMarket matrix {head}\n% a comment\n{numbers}")
    assert np.array_equal(read_matrix(path, nodes=[1]).matrix.toarray(), matrix)


@pytest.mark.parametrize(("text", "message"), [
    ("coordinate pattern general\n2 2 1\n1 1\n", "expected a header with matrix"),
    ("coordinate real general\n2 2 3\n1 1 1\n2 2 1\n",
     "expected row, column and value for each entry"),
    ("coordinate real general\n2 2 2\n1 1 1\n3 2 1\n", "row or column number"),
    ("coordinate real general\n2 2 2\n1 1 1\n2 1.5 1\n", "an invalid row or column"),
    ("coordinate real general\n", "expected a square"),
    ("coordinate real general\n2 2\n", "expected row, column and value for each entry"),
    ("coordinate real general\n1e9 1e9 0\n", "expected a square"),
    ("array real general\n1000000 1000000\n1\n", "expected 1000000000000"),
    ("array real general\n2 3\n1 1 1 1 1 1\n", "found 2 by 3 numbers"),
    ("array real general\n2 2\n1 1 x 1\n", "expected a number"),
])  # fmt: skip
def test_damaged_matrix_market_file_is_rejected(text, message, tmp_path):
    """SciPy's reader accepts some of these files."""
    (tmp_path / "k.mtx").write_text(f"%%MatrixMarket matrix {text}")
    with pytest.raises(BadInput, match=message):
        read_matrix(tmp_path / "k.mtx")
