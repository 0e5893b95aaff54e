"""A sweep by one call: in memory or to a file, of a named robot or an object."""

import pytest
import xarray

import forcefit as ff

GRID = "tx=-0.02:0.02:0.02,ty=0.13:0.14:0.01"


def test_sweep_to_a_file_equals_the_sweep_in_memory(tmp_path):
    done = []
    written = ff.sweep(
        "five_bar", grid=GRID, output=tmp_path / "map.nc",
        progress=lambda *numbers: done.append(numbers),
    )  # fmt: skip
    xarray.testing.assert_identical(written, ff.sweep("five_bar", grid=GRID))
    assert done == [(0, 6), (6, 6)]
    assert [path.name for path in tmp_path.iterdir()] == ["map.nc"]


def test_sweep_of_a_robot_object_equals_that_of_its_name():
    named = ff.sweep("five_bar", grid=GRID)
    command = named.attrs.pop("command")
    assert command == f"forcefit assembly sweep five_bar --grid {GRID}"
    xarray.testing.assert_identical(
        ff.sweep(ff.load_robot("five_bar"), grid=GRID), named
    )


def test_varying_a_robot_object_is_refused():
    with pytest.raises(ff.BadInput, match="--vary: found a robot in memory"):
        ff.sweep(ff.load_robot("five_bar"), grid=GRID, vary=["a.b=1,2"])


def test_sweep_records_its_command_with_all_options():
    data = ff.sweep("five_bar", grid="ty=0.13", wrench_of=["left.elbow"], seed=3)
    expected = "five_bar --grid ty=0.13 --seed 3 --wrench-of left.elbow"
    assert data.attrs["command"] == f"forcefit assembly sweep {expected}"
