"""Sweeps over grids of postures."""

import numpy as np
import pytest
import xarray

import forcefit as ff
from forcefit import BadInput, place_robot, solve_assembly
from forcefit.assembly.sweeps import points
from forcefit.assembly.sweeps.dataset import save_dataset
from forcefit.assembly.sweeps.maps import map_figure
from forcefit.assembly.sweeps.sweep import sweep_poses
from forcefit.assembly.sweeps.targets import parse_grid
from tests.robots_for_tests import NUMBERS, coaxial_beams, irsbot2_with

GRID = "tx=-0.4:0.4:0.2,tz=-0.65:-0.45:0.1"


@pytest.fixture(scope="module")
def robot():
    return irsbot2_with(NUMBERS["cases"][0])


@pytest.fixture(scope="module")
def data(robot):
    return sweep_poses(robot, parse_grid(GRID))


def test_swept_points_equal_single_solutions(robot, data):
    for x in (-0.2, 0.2):
        one = solve_assembly(place_robot(robot, pose={"tx": x, "tz": -0.45}))
        point = data.sel(tx=x, tz=-0.45, method="nearest")
        assert float(point.energy) == pytest.approx(one.energy, rel=1e-7)
        assert np.allclose(point.platform_screw, one.platform_screw, atol=1e-8)
        assert float(point.duality_gap) < 1e-8 * one.energy
    reference = NUMBERS["cases"][0]["points"][1]
    point = data.sel(tx=0.2, tz=-0.45, method="nearest")
    assert float(point.margin) == pytest.approx(reference["t_compliant_rigid"])
    assert float(point.margin_free) == pytest.approx(reference["t_compliant_free"])


def test_unreachable_points_have_status_out_of_reach(data):
    """The point (-0.4, -0.65) is 0.83 m from the centre of leg 1, whose links reach
    0.758 m.
    """
    point = data.sel(tx=-0.4, tz=-0.65, method="nearest")
    assert point.status.item() == "out of reach"
    assert "cannot be reached" in point.reason.item()
    assert np.isnan(point.energy)
    assert (data.status == "ok").sum() == 13


def test_points_without_clearance_have_an_infinite_margin():
    robot = coaxial_beams(np.array([0, 0, 0, 1e-4, 0, 0]))
    data = sweep_poses(robot, {"tx": np.array([0.5])})
    assert data.status.item() == "ok"
    assert np.isinf(data.margin.item())
    assert data.energy.item() == pytest.approx(0.5e6 * 1e-8 / 2)


def test_saved_sweep_is_read_with_units_and_provenance(data, tmp_path):
    save_dataset(data, tmp_path / "map.nc")
    assert [p.name for p in tmp_path.iterdir()] == ["map.nc"]
    with xarray.open_dataset(tmp_path / "map.nc") as back:
        assert back.energy.attrs["units"] == "J"
        assert back.tx.attrs["units"] == "m"
        assert back.platform_screw.dims == ("tx", "tz", "screw")
        assert list(back.screw.values) == ["RX", "RY", "RZ", "TX", "TY", "TZ"]
        assert len(back.attrs["robot_sha256"]) == 64
        assert back.status.values.tolist() == data.status.values.tolist()
        assert np.array_equal(back.energy, data.energy, equal_nan=True)


def test_saving_to_a_missing_folder_is_rejected(data, tmp_path):
    with pytest.raises(BadInput, match="no folder .*nowhere; expected an existing"):
        save_dataset(data, tmp_path / "nowhere" / "map.nc")


def test_map_of_a_single_axis_is_rejected(data):
    with pytest.raises(ValueError, match="two axes, this sweep has 1"):
        map_figure(data.isel(tx=[0]))


def test_failed_margin_has_status_solver_failed(robot, monkeypatch):
    """The solver fails at one of two points."""
    solve = points.zone_margin

    def spoilt(postures, reading, errors):
        found = solve(postures, reading, errors)
        if reading == "free":
            found.margin[0], found.reason[0] = np.nan, "zone margin: gave up"
        return found

    monkeypatch.setattr(points, "zone_margin", spoilt)
    data = sweep_poses(robot, {"tx": np.array([0.0, 0.1]), "tz": np.array([-0.4])})
    assert data.status.values.ravel().tolist() == ["solver failed", "ok"]
    assert data.reason.values.ravel().tolist() == ["zone margin: gave up", ""]
    assert np.isnan(data.energy.values[0, 0])
    assert np.isfinite(data.energy.values[1, 0])


FIVE_BAR_GRID = "tx=-0.02:0.02:0.02,ty=0.13:0.14:0.01"


def test_sweep_to_a_file_equals_the_sweep_in_memory(tmp_path):
    done = []
    written = ff.sweep(
        "five_bar", grid=FIVE_BAR_GRID, output=tmp_path / "map.nc",
        progress=lambda *numbers: done.append(numbers),
    )  # fmt: skip
    xarray.testing.assert_identical(written, ff.sweep("five_bar", grid=FIVE_BAR_GRID))
    assert done == [(0, 6), (6, 6)]
    assert [path.name for path in tmp_path.iterdir()] == ["map.nc"]


def test_sweep_of_a_robot_object_equals_that_of_its_name():
    named = ff.sweep("five_bar", grid=FIVE_BAR_GRID)
    command = named.attrs.pop("command")
    assert command == f"forcefit assembly sweep five_bar --grid {FIVE_BAR_GRID}"
    robot = ff.load_robot("five_bar")
    xarray.testing.assert_identical(ff.sweep(robot, grid=FIVE_BAR_GRID), named)
    with pytest.raises(ff.BadInput, match="--vary: found a robot made in Python"):
        ff.sweep(robot, grid=FIVE_BAR_GRID, vary=["a.b=1,2"])


def test_sweep_stores_its_command_line():
    data = ff.sweep("five_bar", grid="ty=0.13", wrench_of=["left.elbow"], seed=3)
    expected = "five_bar --grid ty=0.13 --seed 3 --wrench-of left.elbow"
    assert data.attrs["command"] == f"forcefit assembly sweep {expected}"
