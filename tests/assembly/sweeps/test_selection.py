"""Selection of the quantities of a sweep, and figures of selected quantities."""

import numpy as np
import pytest
import xarray

import forcefit as ff
from forcefit.assembly.statistics.plot import figure_of_draws
from forcefit.assembly.sweeps.dataset import save_dataset
from forcefit.assembly.sweeps.selection import BY_CLEARANCE, FINITE
from forcefit.stiffness.screws import SCREW, WRENCH

GRID = "tx=-0.02:0.02:0.02,ty=0.13:0.14:0.01"
TEXTS = {"status", "reason", "near_singularity"}


@pytest.fixture(scope="module")
def whole():
    return ff.sweep(
        "five_bar", grid=GRID, state="nominal", wrench_of=["left.elbow"],
        quantities=["default", *BY_CLEARANCE, *FINITE],
    )  # fmt: skip


@pytest.mark.parametrize(
    "names",
    ["energy", "margin,rotation_error", "rotation_error_clearance", "wrench",
     "linearisation_energy", "stiffness,share", "condition,joint_coordinate"],
)  # fmt: skip
def test_sweep_stores_only_the_named_variables(whole, names):
    more = {"wrench_of": ["left.elbow"]} if names == "wrench" else {}
    data = ff.sweep("five_bar", grid=GRID, quantities=[names], **more)
    assert set(data.data_vars) == {*names.split(","), *TEXTS}
    for name in names.split(","):
        xarray.testing.assert_identical(data[name].drop_vars(()), whole[name])


def test_default_selects_the_quantities_stored_without_names(whole):
    plain = ff.sweep("five_bar", grid=GRID)
    added = ff.sweep("five_bar", grid=GRID, quantities=["default", "stiffness"])
    assert set(added.data_vars) == {*plain.data_vars, "stiffness"}
    named = ff.sweep("five_bar", grid=GRID, quantities=["default"])
    assert set(named.data_vars) == set(plain.data_vars)
    xarray.testing.assert_identical(added["stiffness"], whole["stiffness"])


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ("enrgy", '--quantities: no "enrgy"; did you mean "energy"?'),
        ("wrench", "--quantities: wrench needs --wrench-of"),
        ("safety", "--quantities: safety needs --yield-strength"),
        ("reading", "--quantities: reading needs effects that change what a device"),
    ],
)
def test_invalid_quantities_are_rejected_with_one_message(names, message):
    with pytest.raises(ff.BadInput) as error:
        ff.sweep("five_bar", grid=GRID, quantities=[names])
    assert str(error.value).startswith(message)


def test_loaded_sweep_without_pose_error_bounds_is_accepted():
    load = [0, 0, 0, 10.0, 0, 0]
    data = ff.sweep("five_bar", grid=GRID, load=load, quantities=["energy"])
    assert set(data.data_vars) == {"energy", *TEXTS}
    with pytest.raises(ff.BadInput, match="--assumption: found a loaded robot"):
        ff.sweep("five_bar", grid=GRID, load=load)


def test_sweep_command_lists_and_selects_quantities(run, tmp_path):
    status, out, _ = run("assembly", "sweep", "five_bar", "--quantities", "list")
    assert status == 0
    names = [line.split()[0] for line in out.splitlines()]
    assert {"energy", "margin_free", "share", "frequency", *BY_CLEARANCE} <= set(names)
    file, picture = tmp_path / "x.nc", tmp_path / "x.svg"
    words = ["--quantities", "energy,margin", "-o", file, "--figure", picture]
    assert run("assembly", "sweep", "five_bar", "--grid", GRID, *words)[0] == 0
    assert set(ff.open_dataset(file).data_vars) == {"energy", "margin", *TEXTS}
    text = picture.read_text()
    assert "assembly energy" in text
    assert "orientation" not in text
    status, _, err = run("assembly", "plot", file, "--quantities", "energy", "--figure",
                         picture)  # fmt: skip
    assert (status, err) == (0, "")


def test_figure_without_default_quantities_is_rejected():
    data = ff.sweep("five_bar", grid=GRID, quantities=["condition"])
    with pytest.raises(ff.BadInput, match="found none of the default quantities"):
        ff.show(data)


@pytest.fixture(scope="module")
def loaded():
    return ff.sweep("five_bar", grid=GRID, state="nominal", assumption="none",
                    wrench_of=("left.elbow",), load=(0, 0, 0, 10, 0, 0))  # fmt: skip


@pytest.mark.parametrize(
    ("name", "at", "scale", "title"),
    [
        ("stiffness.FX", {"wrench_component": "FX"}, 1e-6, "stiffness.FX [N/um]"),
        ("compliance.TY.MZ", {"screw": "TY", "wrench_component": "MZ"}, 1.0,
         "compliance.TY.MZ [m/(N m)]"),
        ("platform_screw.TX", {"screw": "TX"}, 1e3, "platform_screw.TX [mm]"),
        ("wrench.left.elbow.FX", {"frame": "left.elbow", "wrench_component": "FX"},
         1.0, "wrench.left.elbow.FX [N]"),
        ("singular_distance.parallel", {"kind": "parallel"}, 1.0,
         "singular_distance.parallel [-]"),
    ],
)  # fmt: skip
def test_map_shows_the_named_component(loaded, name, at, scale, title):
    (panel, *_) = ff.show(loaded, quantities=[name]).axes
    expected = loaded[name.partition(".")[0]].sel(at).transpose("ty", "tx").values
    shown = np.asarray(panel.collections[0].get_array()).reshape(2, 3)
    np.testing.assert_allclose(shown, scale * expected, rtol=1e-12)
    assert panel.get_title().startswith(title)


def test_name_of_a_variable_selects_all_components(loaded):
    figure = ff.show(loaded.isel(ty=[0]), quantities=["stiffness", "energy"])
    lines = [panel for panel in figure.axes if panel.lines]
    titles = [panel.get_title().partition(" ")[0] for panel in lines]
    assert titles == [*(f"stiffness.{one}" for one in WRENCH), "energy"]
    expected = loaded["stiffness"].isel(ty=0).sel(wrench_component="FY") * 1e-6
    np.testing.assert_allclose(lines[4].lines[0].get_ydata(), expected, rtol=1e-12)


def test_single_natural_frequency_is_plotted(loaded):
    """The axis of the modes has a single value."""
    frequency = (("tx", "ty", "mode"), np.ones((3, 2, 1)))
    one = loaded.assign(frequency=frequency).assign_coords(mode=["1"])
    for quantities in ([], ["frequency.1"], ["frequency"]):
        titles = [p.get_title() for p in ff.show(one, quantities=quantities).axes]
        assert any("frequency" in title for title in titles)


def test_unknown_or_too_many_quantities_are_rejected_in_one_line(run, loaded, tmp_path):
    save_dataset(loaded, tmp_path / "s.nc")
    for name, said in (
        ("stifness", 'no "stifness"; did you mean "stiffness"?'),
        ("stiffness.FQ", 'no "stiffness.FQ"; did you mean "stiffness.F'),
        ("compliance", "found 36 components, expected at most 12"),
    ):
        status, _, err = run(
            "assembly", "plot", tmp_path / "s.nc", "--quantities", name,
            "--figure", tmp_path / "p.png",
        )  # fmt: skip
        assert (status, err.count("\n")) == (2, 1)
        assert said in err
    assert not (tmp_path / "p.png").exists()


def test_histogram_shows_the_negative_mode_of_a_component(rng):
    """The mean platform error is -1 mm along x."""
    screw = np.zeros((4000, 6))
    screw[:, 3] = rng.normal(-1e-3, 5e-5, 4000)
    drawn = xarray.Dataset(
        {
            "status": ("draw", np.zeros(4000)), "energy": ("draw", np.ones(4000)),
            "platform_screw": (("draw", "screw"), screw, {"units": "rad, m"}),
        },
        {"screw": list(SCREW)},
        {"clearance": "least", "sources_and_posture_sha256": "0"},
    )  # fmt: skip
    panel = figure_of_draws(drawn, None, ["platform_screw.TX"]).axes[0]
    assert panel.get_xlabel() == "platform_screw.TX [mm]"
    (mode,) = [line for line in panel.lines if "most probable" in line.get_label()]
    assert mode.get_xdata()[0] == pytest.approx(-1.0, abs=0.05)
    with pytest.raises(ff.BadInput, match="expected a histogram"):
        figure_of_draws(drawn, "tornado", ["energy"])
