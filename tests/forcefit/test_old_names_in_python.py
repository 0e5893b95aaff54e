"""Deprecated public names, arguments and values work with a warning."""

from pathlib import Path

import numpy as np
import pytest
import xarray

import forcefit as ff
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.path.path_file import PathTable
from forcefit.assembly.path.request import PathTimes
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.sweeps.selection import BY_CLEARANCE, FINITE
from forcefit.stiffness.fem.fea import FemOptions
from forcefit.stiffness.fem.material import Material

ROOT = Path(__file__).parents[2]
ERRORS = """
[[errors]]
frames = ["leg1.link_a"]
most = [1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5]
"""
LOAD = [0, 0, 0, 0, 0, -100.0]


@pytest.fixture(scope="module")
def posture():
    return ff.place_robot(ff.load_robot("irsbot2"))


@pytest.mark.parametrize("old", sorted(ff._RENAMED))
def test_old_public_name_warns_with_the_new_name(old):
    new, *elsewhere = ff._RENAMED[old]
    with pytest.warns(FutureWarning, match=rf"forcefit\.{old} is now forcefit\.{new}"):
        found = getattr(ff, old)
    assert callable(found)
    assert elsewhere or found is getattr(ff, new)
    assert old not in ff.__all__
    assert new in ff.__all__


@pytest.mark.parametrize("name", sorted(ff._MOVED_TO))
def test_moved_name_warns_with_its_module(name):
    with pytest.warns(FutureWarning, match=rf"forcefit\.{name} is now [\w.]+\.{name}$"):
        found = getattr(ff, name)
    assert callable(found)
    assert found.__name__ == name
    assert name not in ff.__all__


@pytest.mark.parametrize(
    ("old", "new"), [("without clearance", "nominal"), ("in contact", "contact")]
)
def test_old_state_has_same_results_as_new_state(posture, old, new):
    with pytest.warns(FutureWarning, match=f"state='{old}' is now state='{new}'"):
        found = ff.platform_stiffness(posture, old, LOAD)
    expected = ff.platform_stiffness(posture, new, LOAD)
    assert found.state == new
    np.testing.assert_array_equal(found.compliance, expected.compliance)


def test_natural_modes_accepts_old_exact_flag():
    posture = ff.place_robot(ff.load_robot("delta"))
    with pytest.warns(FutureWarning, match="state='exact'") as caught:
        found = ff.natural_modes(posture, 2, LOAD, exact=True)
    assert caught[0].filename == __file__
    expected = ff.natural_modes(posture, 2, LOAD, state="exact")
    np.testing.assert_array_equal(found.frequencies, expected.frequencies)


def test_deflection_curve_accepts_old_exact_flag():
    posture = ff.place_robot(ff.load_robot("four_bar"))
    with pytest.warns(FutureWarning, match="state='exact'"):
        found = ff.deflection_curve(posture, 3, [0.0, 10.0], exact=True)
    expected = ff.deflection_curve(posture, 3, [0.0, 10.0], state="exact")
    np.testing.assert_array_equal(found.screws, expected.screws)
    with pytest.raises(ValueError, match="found state 'nominal'"):
        ff.deflection_curve(posture, 3, [0.0, 10.0], state="nominal")


def test_old_data_set_is_read_with_new_names(tmp_path):
    variables = {"translation_error_play": ("x", [1.0, 2.0]), "energy": ("x", [3.0, 4])}
    old = xarray.Dataset(variables, attrs={"play": "worst", "reading": "free"})
    old.to_netcdf(tmp_path / "old.nc", engine="h5netcdf")
    data = ff.open_dataset(tmp_path / "old.nc")
    assert sorted(data) == ["energy", "translation_error_clearance"]
    assert data.translation_error_clearance.values.tolist() == [1.0, 2.0]
    assert data.attrs == {"clearance": "worst", "assumption": "free"}


def test_bound_pose_error_accepts_old_argument_reading(posture):
    forced = ff.solve_assembly(posture)
    with pytest.warns(FutureWarning, match="bound_pose_error.assumption='free'"):
        found = ff.bound_pose_error(forced, reading="free")
    expected = ff.bound_pose_error(forced, assumption="free")
    assert found.assumption == "free"
    with pytest.warns(FutureWarning, match=r"is now PoseError\.assumption"):
        assert found.reading == "free"
    np.testing.assert_array_equal(found.rotation_error, expected.rotation_error)


def test_old_sweep_functions_have_equal_results(tmp_path):
    """The last release had separate functions for options, request and results."""
    new = ff.sweep(
        "five_bar", grid="tx=0:0.02:0.02,ty=0.13", assumption="free",
        wrench_of=["left.elbow"], state="contact",
        quantities=["default", *BY_CLEARANCE],
    )  # fmt: skip
    with pytest.warns(FutureWarning):
        SweepOptions, ask_sweep, run_sweep, sweep_in_memory = (
            getattr(ff, name)
            for name in ("SweepOptions", "ask_sweep", "run_sweep", "sweep_in_memory")
        )
    options = SweepOptions(
        grid="tx=0:0.02:0.02,ty=0.13", reading="free", play_alone=True,
        wrench=["left.elbow"], tangent="contact",
    )  # fmt: skip
    xarray.testing.assert_identical(
        sweep_in_memory(ask_sweep("five_bar", options)), new
    )
    run_sweep(ask_sweep("five_bar", options), tmp_path / "old.nc")
    xarray.testing.assert_identical(ff.open_dataset(tmp_path / "old.nc"), new)
    assert SweepOptions(linearisation=True).quantities == ("default", *FINITE)
    assert SweepOptions(stiffness=True).state == "nominal"
    assert SweepOptions(stiffness=False).state is None


def test_experiment_accepts_old_argument_clearance_model(posture, tmp_path):
    file = tmp_path / "errors.toml"
    file.write_text(ERRORS)
    sources = sources_of(posture.robot, file)
    with pytest.warns(FutureWarning, match=r"is now Experiment.clearance='least'") as c:
        found = Experiment(posture, sources, clearance_model="least")
    assert c[0].filename == __file__
    assert found.clearance == "least"
    with pytest.warns(FutureWarning, match=r"is now Experiment\.clearance"):
        assert found.clearance_model == "least"


def test_errors_along_path_accepts_old_argument_times():
    """The largest acceleration of a quintic is 10 d / (sqrt(3) T^2)."""
    robot = Robot("cart", "tool", (
        Frame("rail", joint="prismatic", actuated=True),
        Frame("tool", "rail", mass=2.0),
    ))  # fmt: skip
    table = PathTable(("tz",), np.array([[0.0], [0.1]]))
    with pytest.warns(FutureWarning, match="errors_along_path.times. is now") as caught:
        old = ff.errors_along_path(robot, table, times=PathTimes("quintic", 0.2))
    assert caught[0].filename == __file__
    new = ff.errors_along_path(robot, table, profile="quintic", duration=0.2)
    for name, values in new.arrays.items():
        np.testing.assert_array_equal(old.arrays[name], values)
    peak = np.abs(new.arrays["platform_acceleration"][:, 5]).max()
    assert peak == pytest.approx(10 * 0.1 / (np.sqrt(3) * 0.2**2), rel=1e-3)


def test_mesh_link_accepts_old_argument_material(tmp_path):
    surface = ROOT / "meshes" / "distal_plain.stl"
    quick = FemOptions(accuracy=0.05)
    with pytest.warns(FutureWarning, match="mesh_link.material. is now") as caught:
        old = ff.mesh_link(
            surface, "z=0", "z=0.452", Material(6e10, 0.3), options=quick
        )
    assert caught[0].filename == __file__
    new = ff.mesh_link(surface, "z=0", "z=0.452", E=6e10, nu=0.3, options=quick)
    np.testing.assert_array_equal(old.stiffness, new.stiffness)
    # E A / L of a solid round bar
    stretch = 6e10 * np.pi * 0.04**2 / 0.452
    assert new.stiffness[5, 5] == pytest.approx(stretch, rel=0.06)


def test_worst_pose_accepts_old_argument_prepared(posture, tmp_path):
    file = tmp_path / "errors.toml"
    file.write_text(ERRORS)
    sources = sources_of(posture.robot, file)
    with pytest.warns(FutureWarning, match="worst_pose"):
        old = ff.worst_pose(
            prepared=linear_response(posture), sources=sources, quantity="translation"
        )
    assert ff.worst_pose(posture, file).bound == old.bound


@pytest.mark.parametrize(
    ("old", "new"), [("holding", "loading"), ("letting go", "unloading")]
)
def test_old_side_has_same_results_as_new_side(posture, old, new):
    with pytest.warns(FutureWarning, match=f"side='{old}' is now side='{new}'") as c:
        found = ff.platform_stiffness(posture, "contact", LOAD, side=old)
    assert c[0].filename == __file__
    expected = ff.platform_stiffness(posture, "contact", LOAD, side=new)
    np.testing.assert_array_equal(found.compliance, expected.compliance)
