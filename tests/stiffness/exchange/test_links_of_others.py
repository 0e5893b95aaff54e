"""Tests of the import and export of links."""

import json

import numpy as np
import pytest
from scipy.io import mmread, mmwrite
from scipy.sparse import csr_matrix, save_npz

from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.sections import round_section
from forcefit.stiffness.exchange.export_link import link_file, read_link_results
from forcefit.stiffness.exchange.import_link import import_link
from forcefit.stiffness.exchange.two_interfaces import both_ends
from forcefit.stiffness.link import scaled

# steel bar along x in mm, N and tonnes
E, NU, RADIUS, LENGTH, RHO = 2.1e5, 0.3, 10.0, 500.0, 7.85e-9


def textbook_beam(length=LENGTH):
    """Return the stiffness matrix of an Euler-Bernoulli beam along x, (12, 12). The
    order is X Y Z RX RY RZ of node 1, then of node 2. Source: Przemieniecki (1968),
    Theory of Matrix Structural Analysis, eq. (5.116)."""
    A, I = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4
    J, G, L = 2 * I, E / (2 + 2 * NU), length
    K = np.zeros((12, 12))

    def spring(k, i, j):
        K[np.ix_([i, j], [i, j])] += k * np.array([[1, -1], [-1, 1]])

    spring(E * A / L, 0, 6)
    spring(G * J / L, 3, 9)
    bend = E * I / L**3 * np.array([
        [12, 6 * L, -12, 6 * L], [6 * L, 4 * L**2, -6 * L, 2 * L**2],
        [-12, -6 * L, 12, -6 * L], [6 * L, 2 * L**2, -6 * L, 4 * L**2],
    ])  # fmt: skip
    for rows, sign in (([1, 5, 7, 11], 1), ([2, 4, 8, 10], -1)):
        # a positive rotation about y moves points on the x axis along -z
        turn = np.diag([1, sign, 1, sign])
        K[np.ix_(rows, rows)] += turn @ bend @ turn
    return K


def beam_mass():
    """Return the lumped mass matrix of the beam, (12, 12)."""
    half = RHO * np.pi * RADIUS**2 * LENGTH / 2
    M = np.zeros((12, 12))
    for k in (0, 1, 2, 6, 7, 8):
        M[k, k] = half
    return M


def expected_stiffness():
    """Return the stiffness of the beam in SI units, (6, 6)."""
    section = round_section(RADIUS * 1e-3, NU)
    C = beam_compliance(LENGTH * 1e-3, section, E * 1e6, NU, theory="euler")
    return np.linalg.inv(C)


def assert_same(K, expected, tolerance=1e-9):
    assert np.abs(scaled(K - expected, expected)).max() < tolerance


def user_element(K, M=None, head="** 1, 2\n1, 2, 3, 4, 5, 6\n"):
    """Return a symmetric matrix as a user element of Abaqus."""
    text = f"**\n*USER ELEMENT, NODES= 2, LINEAR\n** ELEMENT NODES\n{head}"
    for kind, matrix in (("STIFFNESS", K), ("MASS", M)):
        if matrix is not None:
            text += f"*MATRIX,TYPE={kind}\n"
            for i in range(len(matrix)):
                row = [repr(v) for v in matrix[i, : i + 1].tolist()]
                for k in range(0, i + 1, 4):
                    text += " " + " , ".join(row[k : k + 4]) + ",\n"
    return text


def calculix_element(K):
    """Return a symmetric matrix as a user element of CalculiX."""
    order = [(1, d) for d in range(1, 7)] + [(2, d) for d in range(1, 7)]
    head = "**" + ",".join(f"{n:10}" for n, _ in order[:10]) + ",\n"
    head += "**" + ",".join(f"{n:10}" for n, _ in order[10:]) + ",\n"
    head += f"{order[0][1]:10}\n"
    head += "".join(f"{k:10},{d:10}\n" for k, (_, d) in enumerate(order[1:], 2))
    return user_element(K, head=head)


def five_columns(K):
    """Return the upper triangle as lines of node, direction, node, direction and
    value."""
    return "".join(
        f"{i // 6 + 1},{i % 6 + 1}, {j // 6 + 1},{j % 6 + 1}, {K[i, j].item()!r}\n"
        for i in range(12) for j in range(i, 12) if K[i, j]
    )  # fmt: skip


def three_columns(K):
    """Return a matrix as lines of row, column and value."""
    entries = [(i, j) for i in range(len(K)) for j in range(i, len(K)) if K[i, j]]
    both = [pair for i, j in entries for pair in dict.fromkeys([(i, j), (j, i)])]
    return "".join(f"{i + 1} {j + 1}  {K[i, j]:.15e}\n" for i, j in both)


@pytest.mark.parametrize(("name", "write"), [
    ("k.mtx", lambda p, K: p.write_text(user_element(K))),
    ("ccx.mtx", lambda p, K: p.write_text(calculix_element(K))),
    ("five.mtx", lambda p, K: p.write_text(five_columns(K))),
    ("three.mtx", lambda p, K: p.write_text(three_columns(K))),
    ("mm.mtx", lambda p, K: mmwrite(p, csr_matrix(K), symmetry="symmetric")),
    ("full.mtx", lambda p, K: mmwrite(p, K, symmetry="general")),
    ("k.npy", lambda p, K: np.save(p, K)),
    ("k.npz", lambda p, K: save_npz(p, csr_matrix(K))),
    ("six.npy", lambda p, K: np.save(p, K[6:, 6:])),
])  # fmt: skip
def test_imported_beam_has_its_textbook_stiffness(name, write, tmp_path):
    """The unit of length in the files is 1 mm."""
    path = tmp_path / name
    write(path, textbook_beam())
    link = import_link(path, unit="mm")
    assert_same(link.stiffness, expected_stiffness())
    if name != "six.npy":  # a matrix with six rows does not contain the base
        assert link.base - link.tip == pytest.approx([-0.5, 0, 0], abs=1e-9)


@pytest.mark.parametrize(
    "to", ["matrix-market", "abaqus", "calculix", "nastran", "numpy"]
)
@pytest.mark.parametrize("unit", ["m", "mm"])
def test_exported_link_is_imported_with_the_same_stiffness(to, unit, tmp_path, rng):
    """Values have ten digits in Nastran files. Other formats are exact."""
    L = rng.normal(size=(6, 6))
    size = np.array([3, 2, 1, 1e4, 2e4, 3e4])
    K = (L @ L.T + np.eye(6)) * np.outer(size, size)
    offset = np.array([-0.3, 0.1, 0.05])
    ending = {"nastran": "pch", "numpy": "npy"}.get(to, "mtx")
    path = tmp_path / f"k.{ending}"
    path.write_bytes(link_file(K, offset, to, unit))
    link = import_link(path, unit=unit)
    assert_same(link.stiffness, K, 1e-8 if to == "nastran" else 1e-12)
    assert link.base - link.tip == pytest.approx(offset, abs=1e-8)


def test_exported_matrix_market_file_is_read_by_scipy(tmp_path):
    path = tmp_path / "k.mtx"
    K = expected_stiffness()
    path.write_bytes(link_file(K, np.array([-0.5, 0, 0]), "matrix-market"))
    order = [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]
    expected = both_ends(K, [-0.5, 0, 0])[np.ix_(order, order)]
    assert mmread(path, spmatrix=False).toarray() == pytest.approx(expected, rel=1e-15)


def test_mass_properties_are_computed_from_a_mass_matrix(tmp_path):
    """Half of the mass is at each end, so the centre is in the middle, and the inertia
    is m L^2 / 4.
    """
    path = tmp_path / "k.mtx"
    path.write_text(user_element(textbook_beam(), beam_mass()))
    link = import_link(path, mass=path, unit="mm")
    mass = RHO * 1e3 * np.pi * RADIUS**2 * LENGTH  # [kg]
    assert link.mass == pytest.approx(mass, rel=1e-12)
    middle = (link.base + link.tip) / 2
    assert link.center_of_mass == pytest.approx(middle, abs=1e-12)
    expected = np.diag([0, 1, 1]) * mass * 0.5**2 / 4
    assert link.inertia == pytest.approx(expected, abs=1e-12 * mass)


def test_two_half_beams_are_condensed_to_one_beam(tmp_path):
    """The middle node is eliminated."""
    K, part = np.zeros((18, 18)), textbook_beam(LENGTH / 2)
    K[:12, :12] += part
    K[6:, 6:] += part
    np.save(tmp_path / "k.npy", K)
    link = import_link(tmp_path / "k.npy", unit="mm", base="1", tip="3")
    assert_same(link.stiffness, expected_stiffness())


@pytest.mark.parametrize(("matrix", "options", "message"), [
    (lambda K: K[:, :11], [], "expected a square"),
    (lambda K: K[:11, :11], [], "found 11 rows without names"),
    (lambda K: K + np.eye(12, k=1) * 1e4, [], "not symmetric: [1, 2]"),
    (lambda K: K + np.diag([1e3] * 12), [], "the two interfaces do not balance"),
    (lambda K: -K, [], "is not positive definite"),
    (lambda K: K * np.nan, [], "not finite"),
    (lambda K: 1e200 * np.eye(12), [], "not finite, or above 1e100"),
    (lambda K: K, ["--tip", "3"], "node 3 of"),
    (lambda K: K, ["--tip", "1"], "have common degrees of freedom"),
    (lambda K: K, ["--tip", "z=1"], "but no node positions; add --nodes"),
    (lambda K: K, ["--tip", "q"], "--tip: found 'q', expected"),
    (lambda K: K, ["--unit", "ft"], '--unit: found "ft"'),
    (lambda K: K, ["--order", "x"], '--order: found "x"'),
    (lambda K: np.array(["a"]), [], "expected a square matrix of numbers"),
])  # fmt: skip
def test_invalid_stiffness_matrix_is_rejected(
    rejected, matrix, options, message, tmp_path
):
    path = tmp_path / "k.npy"
    np.save(path, matrix(textbook_beam()))
    err = rejected("stiffness", "convert", path, *options)
    assert message in err.splitlines()[-1]


@pytest.mark.parametrize(("name", "text", "message"), [
    ("k.mtx", "%%MatrixMarket matrix nonsense\n", "expected a header with matrix"),
    ("k.mtx", "%%matrixmarket MATRIX coordinate Real general\n2 2 2\n1 1 1\n2 2\n",
     "found 5 numbers, expected row, column"),
    ("k.dmig", "DMIG,K,0,6,2,0\nDMIG,K,101,4,,101,4,1.0\nDMIG,K,202,4,,202,4,1.0\n",
     "node 1 of {}/k.dmig has the degrees of freedom none, expected a node with the "
     "degrees of freedom 1 to 6 (nodes with rotations: 101, 202)"),
    ("k.mtx", "1 1 1 1\n", "line 1: found 4 words"),
    ("k.mtx", "1 1 1 1 x\n", "expected a number"),
    ("k.mtx", "1 1 1 1 1\n1 1 1\n", "line 2: found 3 words, expected node,"),
    ("k.mtx", "1 1 1\n1 1 1 1 1\n", "line 2: found 5 words, expected row,"),
    ("k.mtx", "1 0 1\n", "line 1: found row 1, column 0, expected 1 to"),
    ("k.mtx", "1 1 1\n", "found 1 rows without names, expected six for each"),
    ("k.mtx", "", "found no matrix entries"),
    ("k.mtx", "*USER ELEMENT,NODES=2\n", "expected ** ELEMENT NODES"),
    ("k.mtx", user_element(np.eye(11)), "found 66 numbers, expected 78"),
    ("k.pch", "DMIG    A              0       9       1       0\n", "form '9'"),
    ("k.pch", "DMIG,A,1,1,,1,1,1.0\nDMIG,B,1,1,,1,1,1.0\n", "the matrices A, B"),
    ("k.pch", "DMIG,A,1,x,,1,1,1.0\n", "expected a whole number"),
    ("k.npy", "not numpy", "not a NumPy or SciPy matrix"),
    ("k.npz", "not numpy", "not a NumPy or SciPy matrix"),
    ("k.odb", "", "found the ending .odb, expected one of"),
])  # fmt: skip
def test_wrong_matrix_file_is_rejected(rejected, name, text, message, tmp_path):
    (tmp_path / name).write_text(text)
    err = rejected("stiffness", "convert", tmp_path / name)
    assert message.replace("{}", str(tmp_path)) in err.splitlines()[-1]


@pytest.fixture
def rod(run, tmp_path):
    """Write the results of a round rod to a file."""
    path = tmp_path / "rod.json"
    assert run("stiffness", "beam", "--length", 0.5, "--radius", 0.01, "--young", 2e11,
               "--poisson", 0.3, "--json", path)[0] == 0  # fmt: skip
    return path


def test_stiffness_is_preserved_by_export_to_nastran_and_import(run, rod):
    """The files are written by ``beam --json`` and ``convert``."""
    punch = rod.with_name("rod.pch")
    assert run("stiffness", "convert", rod, "--to", "nastran", "-o", punch)[0] == 0
    status, out, _ = run("stiffness", "convert", punch, "--json", "-")
    assert status == 0
    K, _ = read_link_results(rod)
    assert_same(np.array(json.loads(out)["stiffness"]), K, 1e-8)


def test_matrix_is_converted_between_two_programs(run, tmp_path):
    """The stiffness does not change."""
    first, second = tmp_path / "k.pch", tmp_path / "k.mtx"
    K, offset = expected_stiffness(), np.array([-0.5, 0, 0])
    first.write_bytes(link_file(K, offset, "nastran", "mm"))
    status, out, _ = run(
        "stiffness", "convert", first, "--unit", "mm", "--to", "abaqus", "-o", second,
        "--json", "-",
    )  # fmt: skip
    assert status == 0
    assert_same(np.array(json.loads(out)["stiffness"]), K, 1e-8)
    link = import_link(second, unit="mm")
    assert_same(link.stiffness, K, 1e-8)
    assert link.base - link.tip == pytest.approx(offset, abs=1e-8)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["k.pch", "--to", "abaqus"], "found only one of --to and --output"),
        (["k.json"], "--to: missing; expected the format of the output file"),
        (["k.json", "--tip", "2", "--to", "numpy", "-o", "k.npy"],
         "--tip: found together with the results k.json"),
    ],
)  # fmt: skip
def test_options_not_applicable_to_a_conversion_are_rejected(rejected, words, message):
    assert message in rejected("stiffness", "convert", *words)


@pytest.mark.parametrize(("to", "name", "message"), [
    ("numpy", "rod.npz", '--output: found "rod.npz", expected a file extension'),
    ("nastran", "rod.npy", '--output: found "rod.npy", expected a file extension'),
    ("nastra", "rod.pch", 'did you mean "nastran"?'),
    ("nastran", "rod.mtx", "found a file that is not a matrix for nastran"),
])  # fmt: skip
def test_export_overwrites_only_a_file_of_the_same_format(
    run, rejected, rod, to, name, message
):
    matrix, words = rod.with_name("rod.mtx"), ["stiffness", "convert", rod, "--to"]
    for more in ([], ["--unit", "mm"]):
        assert run(*words, "matrix-market", *more, "-o", matrix)[0] == 0
    before = matrix.read_bytes()
    assert message in rejected(*words, to, "-o", rod.with_name(name))
    assert matrix.read_bytes() == before
    assert {path.name for path in rod.parent.iterdir()} == {"rod.json", "rod.mtx"}


@pytest.mark.parametrize(("given", "message"), [
    ({}, "found no stiffness, base and tip"),
    ({"stiffness": np.diag([1e300, 1, 1, 1, 1, 1]).tolist()}, "numbers above 1e100"),
])  # fmt: skip
def test_link_without_a_finite_stiffness_is_not_exported(
    rejected, tmp_path, given, message
):
    link = tmp_path / "rod.json"
    link.write_text(json.dumps({"base": [0] * 3, "tip": [0, 0, 1]} | given))
    out = tmp_path / "rod.mtx"
    words = "stiffness", "convert", link, "--to", "abaqus", "-o", out
    assert message in rejected(*words)
    assert not out.exists()
