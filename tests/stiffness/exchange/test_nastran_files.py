"""Tests of the import of DMIG matrices from Nastran."""

import numpy as np
import pytest

from forcefit.inputs.errors import BadInput
from forcefit.stiffness.exchange.import_link import import_link
from forcefit.stiffness.exchange.matrix_file import read_matrix
from tests.stiffness.exchange.test_links_of_others import (
    LENGTH,
    RADIUS,
    RHO,
    assert_same,
    beam_mass,
    expected_stiffness,
    textbook_beam,
    user_element,
)


def columns(K, first=1):
    """Return node and direction of each column, with the rows of the lower triangle."""
    for j in range(len(K)):
        rows = [i for i in range(j, len(K)) if K[i, j]]
        terms = [(i // 6 + first, i % 6 + 1, K[i, j]) for i in rows]
        if terms:
            yield j // 6 + first, j % 6 + 1, terms


def between_commas(K, name):
    """Return fields separated by commas, with a column in each line."""
    text = f"DMIG,{name},0,6,2,0\n"
    for node, direction, terms in columns(K):
        text += f"DMIG,{name},{node},{direction}," + "".join(
            f",{n},{d},{v:.12E}," for n, d, v in terms
        )
        text += "\n"
    return text


def cards_between_commas(K, name):
    """Return fields separated by commas, with eight fields in each line."""
    text = f"DMIG,{name},0,6,2,0\n"
    for node, direction, terms in columns(K):
        words = [f"{n},{d},{v:.12E}," for n, d, v in terms]
        text += f"DMIG,{name},{node},{direction},,{words[0]},+\n"
        for k in range(1, len(words), 2):
            text += "+," + ",".join(words[k : k + 2]) + "\n"
    return text


def between_blanks(K, name, first=1):
    """Return fields separated by blanks."""
    text = f"DMIG {name} 0 6 2 0\n"
    for node, direction, terms in columns(K, first):
        text += f"DMIG {name} {node} {direction}"
        text += "".join(f" {n} {d} {v:.12E}" for n, d, v in terms) + "\n"
    return text


def large_fields(K, name):
    """Return fields of sixteen characters."""
    text = f"DMIG    {name:8}       0       6       2       0\n"
    for node, direction, terms in columns(K):
        text += f"DMIG*   {name:16}{node:16}{direction:16}\n"
        for n, d, v in terms:
            text += f"*       {n:16}{d:16}{v:16.9E}\n".replace("E", "D")
    return text


LAYOUTS = [between_commas, cards_between_commas, between_blanks, large_fields]


@pytest.mark.parametrize("write", LAYOUTS)
def test_dmig_in_every_layout_has_textbook_stiffness_and_mass(write, tmp_path):
    """The units are mm and tonnes. The mass is rho A L."""
    path = tmp_path / "beam.dmig"
    path.write_text(
        write(textbook_beam(), "KAAX")
        + write(0.02 * textbook_beam(), "K4AAX")
        + write(beam_mass(), "MAAX")
    )
    link = import_link(path, mass=path, unit="mm")
    assert_same(link.stiffness, expected_stiffness(), 1e-8)
    mass = RHO * 1e3 * np.pi * RADIUS**2 * LENGTH
    assert link.mass == pytest.approx(mass, rel=1e-9)


@pytest.mark.parametrize(("name", "write"), [
    ("one.mtx", lambda K: user_element(K, head="** 12\n1, 2, 3, 4, 5, 6\n")),
    ("one.dmig", lambda K: between_blanks(K, "KAAX", first=12)),
    ("five.mtx", lambda K: "".join(
        f"7,{i + 1},7,{j + 1},{K[i, j]:.15e}\n"
        for i in range(6) for j in range(6) if K[i, j]
    )),
])  # fmt: skip
def test_dmig_of_a_single_node_is_the_stiffness_at_the_tip(name, write, tmp_path):
    path = tmp_path / name
    path.write_text(write(textbook_beam()[6:, 6:]))
    assert_same(import_link(path, unit="mm").stiffness, expected_stiffness(), 1e-9)


DIAGONAL = "DMIG,KAAX,0,6,2,0\n" + "".join(
    f"DMIG,KAAX,7,{k},,7,{k},1.0E+06\n" for k in range(1, 7)
)


@pytest.mark.parametrize(("text", "message"), [
    ("DMIG,KAAX,0,6,2,0\nDMIG,KAAX,1,1,,1,1,2.0,,1,2\n",
     "'1 2' at the end of a line, expected"),
    (DIAGONAL + DIAGONAL.replace("7,2,,7,2,1.0", "7,2,,7,2,9.0"),
     r"KAAX: row 7 2, .* found 1e\+06 and 9e\+06"),
    (DIAGONAL.replace("7,3,1.0E+06", "7,3,1.0E+06,5.0E+04"),
     r"row 7 3: .* imaginary part '5.0E\+04'"),
    (large_fields(textbook_beam(), "K4AAX"),
     r"K4AAX \(structural damping\), expected one"),
])  # fmt: skip
def test_wrong_dmig_is_rejected(text, message, tmp_path):
    path = tmp_path / "k.dmig"
    path.write_text(text)
    with pytest.raises(BadInput, match=message):
        read_matrix(path)


def test_mass_matrix_with_an_unknown_name_is_read(tmp_path):
    path = tmp_path / "k.pch"
    path.write_text(large_fields(textbook_beam(), "KAAX"))
    with pytest.raises(BadInput, match=r"KAAX \(stiffness\), expected one mass"):
        read_matrix(path, "mass")
    path.write_text(large_fields(textbook_beam(), "MINE"))
    assert read_matrix(path, "mass").matrix.shape == (12, 12)


@pytest.mark.parametrize(
    "text", [DIAGONAL + DIAGONAL, DIAGONAL.replace("7,3,1.0E+06", "7,3,1.0E+06,0.0")]
)
def test_dmig_with_repeated_entries_or_of_real_type_is_read(text, tmp_path):
    path = tmp_path / "k.dmig"
    path.write_text(text)
    assert read_matrix(path).matrix.shape == (6, 6)
