"""Tests of studies of a loaded robot."""

import json

import numpy as np
import pytest
import xarray

import forcefit as ff
from forcefit.assembly.files.robot_file import write_robot
from forcefit.validation.multibody.simulation import without_clearance
from forcefit.validation.study.report import report_page, results_table, write_study
from forcefit.validation.study.study import run_study
from forcefit.validation.study.study_file import read_study
from tests.pages_for_tests import parse
from tests.robots_for_tests import coaxial_beams, with_frames

QUIET = "[checks]\npicture = false\ncrosscheck = false\nreference = false\n"
LOAD = np.array([0.0, 0.0, 0.0, 40.0, -30.0, 0.0])


def study_of(folder, text):
    path = folder / "study.toml"
    path.write_text(text + QUIET, encoding="utf-8")
    results = run_study(read_study(path, folder / "out"))
    write_study(results)
    return results, parse((folder / "out" / "report.html").read_text())


def test_deflection_of_parallel_springs_equals_closed_form(tmp_path):
    """The deflection by 400 N is 0.1 mm, and does not include that by errors."""
    write_robot(coaxial_beams(np.zeros(6), (1e6, 3e6)), tmp_path / "beams.toml")
    text = (
        'robot = "beams.toml"\n[errors.explicit]\ntwo = [0, 0, 0, 2e-4, 0, 0]\n'
        "[service]\nload = [0, 0, 0, 400, 0, 0]\n"
    )
    results, page = study_of(tmp_path, text)
    assert results.service["deflection"] == pytest.approx(
        [0, 0, 0, 1e-4, 0, 0], abs=1e-12
    )
    assert results.passed
    rows = {
        row[0].text: row
        for row in page.table("component", "platform error with load and weight")[1:]
    }
    assert rows["TX"][2].value == pytest.approx(1e-4)
    assert rows["TX"][1].value == pytest.approx(1e-4 + 2e-4 * 3 / 4)
    table = json.loads((tmp_path / "out" / "results.json").read_text())
    assert table["service"]["load"] == [0, 0, 0, 400, 0, 0]


def test_study_with_an_unresisted_load_does_not_pass(tmp_path):
    """The platform on a single free pin rotates under a moment about its axis."""
    (tmp_path / "pin.toml").write_text(
        'platform = "tip"\n[[frame]]\nname = "pin"\nparent = "base"\n'
        'joint = "revolute"\n[[frame]]\nname = "tip"\nparent = "pin"\n'
        "translation = [0.1, 0, 0]\ngeometric_error = [0, 0, 0, 1e-4, 0, 0]\n"
    )
    text = 'robot = "pin.toml"\n[service]\nload = [0, 0, 1, 0, 0, 0]\n'
    results, _ = study_of(tmp_path, text)
    assert results.service["status"] != "ok"
    assert "service" in results.unchecked
    assert not results.passed


@pytest.fixture(scope="module")
def five_bar(tmp_path_factory):
    """Return a study of the five-bar without clearances, linear in the load."""
    folder = tmp_path_factory.mktemp("service")
    rigid = without_clearance(ff.load_robot("five_bar"))
    write_robot(rigid, folder / "five_bar.toml")
    load = ", ".join(map(str, LOAD))
    text = (
        'robot = "five_bar.toml"\ngrid = "tx=-0.02:0.02:0.02,ty=0.13:0.14:0.01"\n'
        f"[service]\nload = [{load}]\nstiffness = true\n"
    )
    return (rigid, folder, *study_of(folder, text))


def test_deflection_over_the_grid_is_compliance_times_load(five_bar):
    """The compliance is computed independently of the equilibrium under load."""
    robot, _, results, _ = five_bar
    for tx, ty in ((-0.02, 0.13), (0.02, 0.14)):
        posture = ff.place_robot(robot, {"tx": tx, "ty": ty})
        expected = ff.platform_stiffness(posture).compliance @ LOAD
        found = results.maps["deflection"].sel(tx=tx, ty=ty, method="nearest")
        assert found.values == pytest.approx(
            expected, abs=1e-5 * np.abs(expected).max()
        )


def test_service_maps_on_the_page_equal_those_in_the_file(five_bar):
    _, folder, results, page = five_bar
    (drawn,) = (one for one in page.figures if "layers" in one)
    layers = {one["key"]: np.array(one["values"], float) for one in drawn["layers"]}
    with xarray.open_dataset(folder / "out" / "results.nc") as data:
        along = data["stiffness"].sel(wrench_component="FX").values
        np.testing.assert_array_equal(layers["stiffness.FX"], along)
        shift = np.linalg.norm(data["deflection"].values[..., 3:], axis=-1)
        np.testing.assert_allclose(layers["deflection_shift"], shift, rtol=1e-12)
    rows = {row[0].text: row for row in page.table("quantity", "least")[1:]}
    row = rows["stiffness along FX, the other axes free"]
    assert [row[1].value, row[3].value] == [along.min(), along.max()]
    assert results_table(results)["maps"]["stiffness.FX"][2] == along.max()


def test_frequencies_at_the_pose_equal_closed_form(tmp_path):
    """A mass of 4 kg is on springs of 1e6 and 3e6 N/m along each axis."""
    beams = coaxial_beams(np.zeros(6), (1e6, 3e6))
    robot = with_frames(beams, lambda f: f.name == "end_one", mass=4.0)
    write_robot(robot, tmp_path / "beams.toml")
    results, page = study_of(
        tmp_path, 'robot = "beams.toml"\n[service]\nfrequencies = 3\n'
    )
    expected = np.sqrt(4e6 / 4.0) / (2 * np.pi)
    assert results.service["frequencies"]["frequencies"] == pytest.approx(
        [expected] * 3, rel=1e-6
    )
    assert page.table("mode")[1][1].value == pytest.approx(expected, rel=1e-6)


def test_map_of_three_axes_is_drawn_at_the_largest_error(tmp_path):
    text = (
        'robot = "orthoglide"\n'
        'grid = "tx=-0.05:0.05:0.05,ty=-0.05:0.05:0.05,tz=-0.05:0.05:0.1"\n'
    )
    results, page = study_of(tmp_path, text)
    error = results.maps["translation_error"].sel(bound="upper")
    at = np.unravel_index(int(np.nanargmax(error.values)), error.shape)
    place = {d: float(error[d][i]) for d, i in zip(error.dims, at, strict=True)}
    (row, *_) = page.table("quantity", "least")[1:]
    assert row[4].text == ", ".join(f"{d} = {v:.6g} m" for d, v in place.items())
    (drawn,) = (one for one in page.figures if "layers" in one)
    values = np.array(drawn["layers"][0]["values"], float)
    np.testing.assert_array_equal(
        values, error.sel(tz=place["tz"]).transpose("tx", "ty").values
    )
    assert np.nanmax(values) == row[3].value
    assert "The grid has 3 axes: the map is drawn over tx and ty, with tz = " in (
        report_page(results)
    )


def test_contributions_of_all_parts_add_up_to_100_per_cent(tmp_path):
    """The table contains all twelve parts of the hexapod."""
    _, page = study_of(tmp_path, 'robot = "hexapod"\n')
    rows = page.table("part", "rx")[1:]
    for column in range(1, 7):
        total = sum(float(row[column].text) for row in rows)
        # the contributions are rounded to 0.1 %
        assert total == pytest.approx(100.0, abs=0.05 * len(rows))
