"""Tables with one row per point of a sweep."""

import csv
import itertools

import numpy as np
import pytest

import forcefit as ff
from forcefit.assembly.sweeps.dataset import save_dataset
from forcefit.assembly.sweeps.point_table import write_point_table
from forcefit.stiffness.screws import WRENCH


@pytest.fixture(scope="module")
def data():
    return ff.sweep(
        "five_bar", grid="tx=-0.02:0.02:0.02,ty=0.13:0.14:0.01", state="nominal",
        vary=["elbow.link.young=7e10,2.1e11"], wrench_of=("left.elbow", "right.elbow"),
    )  # fmt: skip


def read(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_point_table_has_the_cells_of_the_data_set(data):
    table = ff.point_table(data)
    assert table.shape == (12, sum(v.size // 12 for v in data.data_vars.values()))
    for place in itertools.product(*(data[d].values for d in data["status"].dims)):
        at = dict(zip(data["status"].dims, place, strict=True))
        point, row = data.sel(at), table.loc[place]
        assert row["energy", ""] == point["energy"]
        assert row["status", ""] == point["status"]
        for frame in ("left.elbow", "right.elbow"):
            expected = point["wrench"].sel(frame=frame)
            found = [row["wrench", f"{frame}.{one}"] for one in WRENCH]
            np.testing.assert_array_equal(found, expected)


def test_pose_components_of_listed_postures_are_columns(tmp_path):
    poses = tmp_path / "poses.csv"
    poses.write_text("id,pose.tx,pose.ty\na,0,0.13\nb,0.01,0.14\nc,0.02,0.13\n")
    data = ff.sweep("five_bar", poses=poses, draws=None)
    table = ff.point_table(data)
    assert list(table.index) == ["a", "b", "c"]
    assert list(table["ty", ""]) == [0.13, 0.14, 0.13]


def test_point_table_of_a_robot_without_joints_has_all_rows():
    """There are no columns of joint coordinates."""
    bar = ff.Robot("bar", "tip", (ff.Frame("tip", translation=[1.0, 0, 0]),))
    data = ff.sweep(bar, grid="tx=1", assumption="none")
    assert list(ff.point_table(data)["energy", ""]) == [0.0]


def test_csv_has_units_in_its_header_and_all_digits(data, tmp_path):
    write_point_table(data, tmp_path / "t.csv")
    rows = read(tmp_path / "t.csv")
    assert [row["id"] for row in rows] == [str(k) for k in range(12)]
    energies = [float(row["energy [J]"]) for row in rows]
    np.testing.assert_array_equal(energies, data["energy"].values.ravel())
    forces = [float(row["wrench.right.elbow.FX [N]"]) for row in rows]
    expected = data["wrench"].sel(frame="right.elbow", wrench_component="FX")
    np.testing.assert_array_equal(forces, expected.values.ravel())
    heads = rows[0].keys()
    assert {"tx [m]", "ty [m]", "platform_screw.RX [rad]", "platform_screw.TZ [m]",
            "wrench.left.elbow.MX [N m]", "compliance.RX.MX [rad/(N m)]",
            "compliance.TX.FX [m/N]", "stiffness.FX [N/m]"} <= heads  # fmt: skip


def test_missing_number_is_an_empty_csv_cell(data, tmp_path):
    some = data.assign(energy=data["energy"].where(data["tx"] < 0.01))
    write_point_table(some, tmp_path / "t.csv")
    for row in read(tmp_path / "t.csv"):
        assert (row["energy [J]"] == "") == (float(row["tx [m]"]) > 0.01)


def test_table_rows_are_selected_by_axis_names(data):
    table = ff.point_table(data, ["wrench_component"])
    assert list(table.index) == list(WRENCH)
    with pytest.raises(ff.BadInput, match='table: no axis "txx"; did you mean "tx"'):
        ff.point_table(data, ["txx"])
    with pytest.raises(ff.BadInput, match="expected a data set of a sweep"):
        ff.point_table(data[["energy"]])


def test_plot_command_writes_a_csv_table(run, data, tmp_path):
    save_dataset(data, tmp_path / "s.nc")
    file, out = tmp_path / "s.nc", tmp_path / "t.csv"
    assert run("assembly", "plot", file, "--csv", out) == (0, "", "")
    assert len(read(out)) == 12
    status, _, err = run("assembly", "plot", file, "--csv", out, "--rows", "txx")
    assert (status, err.count("\n")) == (2, 1)
    assert f'{file}: no axis "txx"' in err
    out.write_text("mine,1\n")
    assert run("assembly", "plot", file, "--csv", out)[0] == 2
    assert out.read_text() == "mine,1\n"


def test_draws_and_importance_have_separate_tables(run, tmp_path, monkeypatch):
    """One data set contains both."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "errors.toml").write_text(
        '[[errors]]\nframes = ["elbow"]\nmost = [0, 0, 0, 1e-5, 1e-5, 0]\n'
    )
    status, *_ = run(
        "assembly", "statistics", "five_bar", "--errors", "errors.toml", "--pose",
        "tx=0,ty=0.13", "--draws", 20, "--importance", 16, "--clearance", "least",
        "-o", "d.nc", "--csv", "d.csv",
    )  # fmt: skip
    assert status == 0
    drawn = ff.open_dataset("d.nc")
    rows = read(tmp_path / "d.csv")
    assert [float(row["rotation [rad]"]) for row in rows] == list(drawn["rotation"])
    shares = ff.point_table("d.nc", ["quantity", "group"])
    assert len(shares) == drawn.sizes["quantity"] * drawn.sizes["group"]
    one = drawn["total_index"].sel(quantity="rotation", group="elbow.TX")
    value = shares.loc[("rotation", "elbow.TX")]["total_index", "value"]
    assert value == one.sel(estimate="value")
