"""The notebooks of the examples: without outputs, and their cells run in order."""

import json

import pytest

from tests.test_tutorials import ROOT

NOTEBOOKS = {path.stem: path for path in (ROOT / "examples/notebooks").glob("*.ipynb")}


def cells(name):
    """Cells of code of a notebook."""
    book = json.loads(NOTEBOOKS[name].read_text(encoding="utf-8"))
    assert (book["nbformat"], book["nbformat_minor"]) == (4, 5)
    return [cell for cell in book["cells"] if cell["cell_type"] == "code"]


def variables(name, folder, monkeypatch):
    """The variables after all cells, which are one session."""
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    monkeypatch.chdir(folder)
    session = {}
    for cell in cells(name):
        exec(compile("".join(cell["source"]), name, "exec"), session)
    return session


@pytest.mark.parametrize("name", sorted(NOTEBOOKS))
def test_notebook_has_no_stored_outputs(name):
    for cell in cells(name):
        assert cell["outputs"] == []
        assert cell["execution_count"] is None


@pytest.mark.slow
@pytest.mark.exudyn
def test_notebook_of_ones_own_robot_ends_with_a_report(tmp_path, monkeypatch):
    """A planar loop of five bars: 2 freedoms, 3 constraints out of the plane."""
    found = variables("own_robot", tmp_path, monkeypatch)
    assert (found["mobility"].freedoms, found["mobility"].overconstraint) == (2, 3)
    assert not found["zone"].assemblable
    assert found["results"].passed  # checked by a multibody simulation
    assert (tmp_path / "study_study" / "report.html").is_file()


@pytest.mark.slow
def test_notebook_of_seoul_has_the_rotations_of_the_closed_form(tmp_path, monkeypatch):
    """The corners of three slabs: 48.033 mrad at 20 mm; as 1/distance near home."""
    pytest.importorskip("xarray")
    found = variables("seoul", tmp_path, monkeypatch)
    assert found["mobility"].freedoms == 5
    assert found["distances"][1] == pytest.approx(0.02)
    assert found["rotations"][1] == pytest.approx(48.033e-3, rel=1e-4)
    assert found["slope"] == pytest.approx(-1, abs=0.01)
