"""Figures of quantities that are selected by name."""

import numpy as np
import pytest
import xarray

import forcefit as ff
from forcefit.assembly.statistics.plot import figure_of_draws
from forcefit.assembly.sweeps.dataset import save_dataset


@pytest.fixture(scope="module")
def data():
    return ff.sweep(
        "five_bar", grid="tx=-0.02:0.02:0.02,ty=0.13:0.14:0.01", state="nominal",
        assumption="none", wrench_of=("left.elbow",), load=(0, 0, 0, 10, 0, 0),
    )  # fmt: skip


def shown(panel):
    """Return the values of a map, (y, x)."""
    return np.asarray(panel.collections[0].get_array()).reshape(2, 3)


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
def test_map_shows_the_named_component(data, name, at, scale, title):
    (panel, *_) = ff.show(data, quantities=[name]).axes
    expected = data[name.partition(".")[0]].sel(at).transpose("ty", "tx").values
    np.testing.assert_allclose(shown(panel), scale * expected, rtol=1e-12)
    assert panel.get_title().startswith(title)


def test_name_of_a_variable_selects_all_components(data):
    figure = ff.show(data.isel(ty=[0]), quantities=["stiffness", "energy"])
    lines = [panel for panel in figure.axes if panel.lines]
    titles = [panel.get_title() for panel in lines]
    assert [t.partition(" ")[0] for t in titles] == [
        *(f"stiffness.{one}" for one in ("MX", "MY", "MZ", "FX", "FY", "FZ")), "energy"
    ]  # fmt: skip
    expected = data["stiffness"].isel(ty=0).sel(wrench_component="FY") * 1e-6
    np.testing.assert_allclose(lines[4].lines[0].get_ydata(), expected, rtol=1e-12)


def test_single_natural_frequency_is_plotted(data):
    """The axis of the modes has a single value."""
    one = data.assign(
        frequency=(("tx", "ty", "mode"), np.ones((3, 2, 1)))
    ).assign_coords(mode=["1"])
    for quantities in ([], ["frequency.1"], ["frequency"]):
        titles = [p.get_title() for p in ff.show(one, quantities=quantities).axes]
        assert any("frequency" in title for title in titles)


def test_unknown_or_too_many_quantities_are_rejected_in_one_line(run, data, tmp_path):
    save_dataset(data, tmp_path / "s.nc")
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


def test_histogram_shows_the_negative_mode_of_a_component(arm_draws):
    figure = figure_of_draws(arm_draws, None, ["platform_screw.TX"])
    panel = figure.axes[0]
    assert panel.get_xlabel() == "platform_screw.TX [mm]"
    (mode,) = [line for line in panel.lines if "most probable" in line.get_label()]
    assert mode.get_xdata()[0] == pytest.approx(-1.0, abs=0.05)
    with pytest.raises(ff.BadInput, match="expected a histogram"):
        figure_of_draws(arm_draws, "tornado", ["energy"])


@pytest.fixture
def arm_draws(rng):
    """Return random draws with a mean platform error of -1 mm along x."""
    screw = np.zeros((4000, 6))
    screw[:, 3] = rng.normal(-1e-3, 5e-5, 4000)
    return xarray.Dataset(
        {
            "status": ("draw", np.zeros(4000)), "energy": ("draw", np.ones(4000)),
            "platform_screw": (("draw", "screw"), screw, {"units": "rad, m"}),
        },
        {"screw": ["RX", "RY", "RZ", "TX", "TY", "TZ"]},
        {"clearance": "least", "sources_and_posture_sha256": "0"},
    )  # fmt: skip
