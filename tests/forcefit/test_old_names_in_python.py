"""Public names, arguments and values of the last release: they work, with a warning."""

import numpy as np
import pytest
import xarray

import forcefit as ff
from forcefit.assembly.sweeps.selection import BY_CLEARANCE, FINITE

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
def test_old_public_name_works_and_warns_with_the_new_name(old):
    new, *elsewhere = ff._RENAMED[old]
    with pytest.warns(FutureWarning, match=rf"forcefit\.{old} is now forcefit\.{new}"):
        found = getattr(ff, old)
    assert callable(found)
    assert elsewhere or found is getattr(ff, new)
    assert old not in ff.__all__
    assert new in ff.__all__


@pytest.mark.parametrize("name", sorted(ff._MOVED_TO))
def test_name_that_is_no_longer_public_works_and_warns_with_its_module(name):
    with pytest.warns(FutureWarning, match=rf"forcefit\.{name} is now [\w.]+\.{name}$"):
        found = getattr(ff, name)
    assert callable(found)
    assert found.__name__ == name
    assert name not in ff.__all__


@pytest.mark.parametrize(
    ("old", "new"), [("without clearance", "nominal"), ("in contact", "contact")]
)
def test_old_state_has_the_results_of_the_new_one(posture, old, new):
    with pytest.warns(FutureWarning, match=f"state='{old}' is now state='{new}'"):
        found = ff.platform_stiffness(posture, old, LOAD)
    expected = ff.platform_stiffness(posture, new, LOAD)
    assert found.state == new
    np.testing.assert_array_equal(found.compliance, expected.compliance)


def test_old_exact_flag_of_modes_has_the_results_of_the_exact_state():
    posture = ff.place_robot(ff.load_robot("delta"))
    with pytest.warns(FutureWarning, match="state='exact'") as caught:
        found = ff.natural_modes(posture, 2, LOAD, exact=True)
    assert caught[0].filename == __file__
    expected = ff.natural_modes(posture, 2, LOAD, state="exact")
    np.testing.assert_array_equal(found.frequencies, expected.frequencies)


def test_old_exact_flag_of_a_deflection_curve_has_the_results_of_the_exact_state():
    posture = ff.place_robot(ff.load_robot("four_bar"))
    with pytest.warns(FutureWarning, match="state='exact'"):
        found = ff.deflection_curve(posture, 3, [0.0, 10.0], exact=True)
    expected = ff.deflection_curve(posture, 3, [0.0, 10.0], state="exact")
    np.testing.assert_array_equal(found.screws, expected.screws)
    with pytest.raises(ValueError, match="no state 'nominal'"):
        ff.deflection_curve(posture, 3, [0.0, 10.0], state="nominal")


def test_data_set_of_an_older_release_is_read_with_the_present_names(tmp_path):
    variables = {"translation_error_play": ("x", [1.0, 2.0]), "energy": ("x", [3.0, 4])}
    old = xarray.Dataset(variables, attrs={"play": "worst", "reading": "free"})
    old.to_netcdf(tmp_path / "old.nc", engine="h5netcdf")
    data = ff.open_dataset(tmp_path / "old.nc")
    assert sorted(data) == ["energy", "translation_error_clearance"]
    assert data.translation_error_clearance.values.tolist() == [1.0, 2.0]
    assert data.attrs == {"clearance": "worst", "assumption": "free"}


def test_old_argument_reading_of_a_pose_error_works_as_assumption(posture):
    forced = ff.solve_assembly(posture)
    with pytest.warns(FutureWarning, match="bound_pose_error.assumption='free'"):
        found = ff.bound_pose_error(forced, reading="free")
    expected = ff.bound_pose_error(forced, assumption="free")
    assert found.assumption == "free"
    with pytest.warns(FutureWarning, match=r"is now PoseError\.assumption"):
        assert found.reading == "free"
    np.testing.assert_array_equal(found.rotation_error, expected.rotation_error)


def test_sweep_by_the_names_of_the_last_release_has_equal_results(tmp_path):
    """By separate functions for options, request and result;
    file and memory are equal."""
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


def test_old_argument_clearance_model_of_an_experiment_works_as_clearance(
    posture, tmp_path
):
    file = tmp_path / "errors.toml"
    file.write_text(ERRORS)
    sources = ff.read_sources(file, posture.robot)
    with pytest.warns(FutureWarning, match=r"is now Experiment.clearance='least'") as c:
        found = ff.Experiment(posture, sources, clearance_model="least")
    assert c[0].filename == __file__
    assert found.clearance == "least"
    with pytest.warns(FutureWarning, match=r"is now Experiment\.clearance"):
        assert found.clearance_model == "least"
