"""Example notebooks are stored without outputs and run without errors."""

import json
import re
from math import pi

import numpy as np
import pytest

from forcefit.assembly.statistics.joint_fits import fits_of
from tests.test_tutorials import ROOT

NOTEBOOKS = {path.stem: path for path in (ROOT / "examples/notebooks").glob("*.ipynb")}


def cells(name):
    """Return the code cells of a notebook."""
    book = json.loads(NOTEBOOKS[name].read_text(encoding="utf-8"))
    assert (book["nbformat"], book["nbformat_minor"]) == (4, 5)
    return [cell for cell in book["cells"] if cell["cell_type"] == "code"]


def variables(name, folder, monkeypatch):
    """Run all cells of a notebook, and return the variables."""
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


@pytest.mark.parametrize("name", sorted(NOTEBOOKS))
def test_notebook_uses_only_public_names(name):
    """Names in the modules of the packages may change."""
    source = "\n".join("".join(cell["source"]) for cell in cells(name))
    modules = re.findall(r"^(?:from|import) ([\w.]+)", source, re.MULTILINE)
    assert "forcefit" in modules
    assert not {"assembly", "stiffness", "validation"} & {
        m.split(".")[0] for m in modules
    }


def test_notebooks_page_lists_every_notebook():
    page = (ROOT / "docs/notebooks.md").read_text(encoding="utf-8")
    listed = re.findall(r"\[(\w+)\.ipynb\]\(notebooks/\1\.ipynb\)", page)
    assert sorted(listed) == sorted(NOTEBOOKS)


@pytest.mark.slow
@pytest.mark.exudyn
def test_custom_robot_notebook_writes_a_report(tmp_path, monkeypatch):
    """A planar five-bar has 2 degrees of freedom and 3 redundant constraints."""
    found = variables("own_robot", tmp_path, monkeypatch)
    assert (found["mobility"].freedoms, found["mobility"].overconstraint) == (2, 3)
    assert not found["zone"].assemblable
    assert found["results"].passed  # includes a multibody simulation
    assert (tmp_path / "study" / "report.html").is_file()


@pytest.mark.slow
def test_seoul_robot_notebook_agrees_with_closed_form(tmp_path, monkeypatch):
    """The rotation is 48.033 mrad at 20 mm, and proportional to 1/distance."""
    pytest.importorskip("xarray")
    found = variables("seoul", tmp_path, monkeypatch)
    assert found["mobility"].freedoms == 5
    assert found["distances"][1] == pytest.approx(0.02)
    assert found["rotations"][1] == pytest.approx(48.033e-3, rel=1e-4)
    assert found["slope"] == pytest.approx(-1, abs=0.01)


@pytest.mark.slow
def test_cad_link_notebook_agrees_with_cone_deflection(tmp_path, monkeypatch):
    """Deflection of a cone: F L^3 / (3 E I) R / r + F L / (k G pi R r).

    A rigid end increases the stiffness by 1 to 2 %.
    """
    found = variables("link_from_cad", tmp_path, monkeypatch)
    F, L, R, r, E, nu = 100.0, 0.35, 0.045, 0.025, 7e10, 0.33
    k, G = 6 * (1 + nu) / (7 + 6 * nu), E / (2 * (1 + nu))
    cone = F * L**3 / (3 * E * pi * R**4 / 4) * R / r + F * L / (k * G * pi * R * r)
    assert 0.98 * cone < found["by_elements"] < 0.99 * cone
    sag = -found["loaded"].platform_screw[5]
    assert sag == pytest.approx(found["by_elements"], rel=1e-9)
    volume = pi * L / 3 * (R**2 + R * r + r**2)
    assert found["arm"].mass == pytest.approx(2700 * volume, rel=1e-4)
    # Saint-Venant's torsion is exact for a round bar with rigid faces
    assert found["twist"] == pytest.approx(1, abs=2e-4)
    # a rigid end stiffens a bar by less than a reduction of its length by its radius
    assert 1 < found["stretch"] < 0.452 / (0.452 - 0.04)
    assert sum(frame.link is not None for frame in found["solids"].frames) == 4
    assert (found["ratio"] > 1).all()
    assert (found["ratio"] < 0.452 / (0.452 - 0.04)).all()


@pytest.mark.slow
def test_campaign_notebook_agrees_with_the_command(tmp_path, monkeypatch, run):
    """The errors on held-out rows are equal; compensation removes the deviation."""
    pytest.importorskip("xarray")
    found = variables("campaign_to_machine", tmp_path, monkeypatch)
    code, text, _ = run(
        "validation", "diagnose", "examples/campaign", "--json", "o.json"
    )
    assert code == 0
    assert found["diagnosis"].summary() in text
    printed = json.loads((tmp_path / "o.json").read_text())["error"]
    for when in ("before", "after"):
        assert vars(getattr(found["diagnosis"], when)) == pytest.approx(printed[when])
    assert found["diagnosis"].verdict == "explained"
    # only the measurement noise of 5 um remains after the identification
    assert printed["after"]["position"] == pytest.approx(5e-6, rel=0.1)
    assert found["after"] < 1e-3 < 100 < found["before"]  # [um]


@pytest.mark.slow
def test_tolerance_notebook_bounds_exceed_all_draws(tmp_path, monkeypatch):
    """The sum of the shares lies between the attained value and the bound."""
    pytest.importorskip("xarray")
    found = variables("drawing_tolerances", tmp_path, monkeypatch)
    worst = found["worst"]
    assert found["translation"].max() < 1e6 * worst.attained <= 1e6 * worst.bound
    share = float(np.mean(found["translation"] <= 150))
    assert found["share"]["probability"] == pytest.approx(share)
    assert found["share"]["lower"] < share < found["share"]["upper"]
    fits = [fit.fit for fit in fits_of(found["robot"])]
    assert [fit.text for fit in fits] == ["12 H7/g6", "12 H7/g6"]
    assert len(found["robot"].callouts) == 4
    assert worst.attained <= sum(x for _, x in worst.shares) <= worst.bound


@pytest.mark.slow
def test_map_notebook_agrees_with_the_sum_over_struts(tmp_path, monkeypatch):
    """K is the sum of k w w^T over the struts, and symmetric about the plane x = 0."""
    pytest.importorskip("xarray")
    found = variables("stiffness_maps", tmp_path, monkeypatch)
    assert found["error"].max() < 1e-9
    stiffness = found["data"]["stiffness"]
    np.testing.assert_allclose(stiffness, stiffness[::-1], rtol=1e-6)
    along = 1 / np.linalg.inv(found["by_hand"])[5, 5]
    home = stiffness.sel(tx=0, ty=0, wrench_component="FZ", method=None)
    assert float(home) == pytest.approx(along, rel=1e-6)
    np.testing.assert_allclose(found["data"]["share"].sum("part"), 1.0)


@pytest.mark.slow
def test_paper_notebook_agrees_with_reference_values(tmp_path, monkeypatch):
    """The reference values, computed by a different program, have 2 or 3 digits."""
    pytest.importorskip("xarray")
    found = variables("paper_figures", tmp_path, monkeypatch)
    assert (len(found["frames"]), found["mobility"].freedoms) == (21, 2)
    assert int(found["reached"].sum()) == 1113
    assert found["share"] == pytest.approx(15.9, abs=0.1)
    for name, row in found["reference"].items():
        # the reference is rounded to two digits
        assert found["found"][name] == pytest.approx(row[2:], rel=0.05), name
    alone = found["alone"]
    # bounds are computed to 1 um, as in the paper
    assert np.nanmax(np.abs(alone - alone[::-1])) <= 1e-6
