"""Selection of the quantities of a sweep."""

import pytest
import xarray

import forcefit as ff
from forcefit.assembly.sweeps.selection import BY_CLEARANCE, FINITE

GRID = "tx=-0.02:0.02:0.02,ty=0.13:0.14:0.01"
TEXTS = {"status", "reason", "near_singularity"}


@pytest.fixture(scope="module")
def whole():
    return ff.sweep(
        "five_bar", grid=GRID, state="nominal", wrench_of=["left.elbow"],
        quantities=["default", *BY_CLEARANCE, *FINITE],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("names", "more"),
    [
        ("energy", {}),
        ("margin,rotation_error", {}),
        ("rotation_error_clearance", {}),
        ("linearisation_energy", {}),
        ("stiffness,share", {}),
        ("wrench", {"wrench_of": ["left.elbow"]}),
        ("condition,joint_coordinate", {}),
    ],
)
def test_sweep_stores_only_the_named_variables(whole, names, more):
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


def test_figure_without_default_quantities_is_rejected(tmp_path):
    data = ff.sweep("five_bar", grid=GRID, quantities=["condition"])
    with pytest.raises(ff.BadInput, match="found none of the default quantities"):
        ff.show(data)
