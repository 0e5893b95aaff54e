"""Test the reading of valid and invalid campaign folders."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.robots import load_robot
from forcefit.inputs.table import BadInput
from forcefit.validation.campaign.campaign_file import read_campaign
from tests.campaigns_for_tests import ARM, HEAD, NOISE, ROWS, write_campaign


def test_campaign_contains_the_values_of_its_files(tmp_path):
    """The tool position of the planar arm is calculated by hand."""
    campaign = read_campaign(write_campaign(tmp_path / "first"))
    assert campaign.name == "first"
    assert campaign.ids == ("m1", "m2", "m3", "m4")
    assert campaign.commanded == "joints"
    assert campaign.registration == "known"
    q1, q2 = np.array([0.1, 0.3, 0.1, 0.1]), np.array([0.2, 0.4, 0.2, 0.2])
    tool = campaign.transforms[:, campaign.robot.index("tool"), :2, 3]
    expected = [np.cos(q1) + 0.8 * np.cos(q1 + q2), np.sin(q1) + 0.8 * np.sin(q1 + q2)]
    np.testing.assert_allclose(tool, np.transpose(expected), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(campaign.loads[:, 3], [0, 10, 0, 10])
    assert not campaign.loads[:, [0, 1, 2, 4, 5]].any()
    np.testing.assert_array_equal(campaign.measured[1, 3:], [2e-5, math.nan, 0])
    assert np.isnan(campaign.measured[:, :3]).all()
    np.testing.assert_array_equal(campaign.sigma[0], [1e-5] * 3 + [5e-6] * 3)
    np.testing.assert_array_equal(campaign.covariates["approach"], [1, -1, 1, 1])
    np.testing.assert_array_equal(campaign.configuration, [0, 1, 0, 0])
    np.testing.assert_array_equal(campaign.repeat, [0, 1, 0, 2])
    assert not campaign.measured.flags.writeable


def test_campaign_table_has_the_columns_of_the_file(tmp_path):
    pytest.importorskip("xarray")
    table = read_campaign(write_campaign(tmp_path)).to_pandas()
    assert list(table.index) == ["m1", "m2", "m3", "m4"]
    np.testing.assert_array_equal(table["load", "FX"], [0, 10, 0, 10])
    np.testing.assert_array_equal(
        table["joint_coordinate", "two"], [0.2, 0.4, 0.2, 0.2]
    )
    np.testing.assert_array_equal(
        table["reading", "TY"], [2e-5, math.nan, 2.1e-5, 2e-5]
    )
    np.testing.assert_array_equal(table["cov.time", ""], [0, 60, 120, 180])
    units = table.attrs["units"]
    assert (units["cov.time"], units["reading"]) == ("s", "rad, m")


def test_selected_rows_have_the_requested_order(
    tmp_path,
):
    campaign = read_campaign(write_campaign(tmp_path))
    some = campaign.take([3, 1])
    assert some.ids == ("m4", "m2")
    np.testing.assert_array_equal(some.configuration, [0, 1])
    np.testing.assert_array_equal(some.covariates["time"], [180, 60])
    assert campaign.take(campaign.configuration == 0).ids == ("m1", "m3", "m4")
    assert campaign.take(slice(0, 2)).ids == ("m1", "m2")
    assert len(campaign.take([])) == 0


def test_commanded_poses_are_converted_to_joint_coordinates(tmp_path):
    """The poses are computed from known joint coordinates."""
    joints = read_campaign(write_campaign(tmp_path / "joints"))
    tool = joints.transforms[:, joints.robot.index("tool")]
    rows = [
        f"p{i},{float(T[0, 3])!r},{float(T[1, 3])!r},1e-5" for i, T in enumerate(tool)
    ]
    folder = write_campaign(tmp_path / "pose", head="id,pose.tx,pose.ty,meas.tx",
                            rows=rows)  # fmt: skip
    poses = read_campaign(folder)
    assert poses.commanded == "pose"
    np.testing.assert_allclose(poses.coordinates, joints.coordinates, rtol=0, atol=1e-8)
    np.testing.assert_array_equal(poses.configuration, joints.configuration)


def test_machine_without_drives_has_one_configuration(tmp_path):
    robot = 'name = "post"\nplatform = "top"\n[[frame]]\nname = "top"\n'
    robot += 'parent = "base"\ntranslation = [0, 0, 2]\n'
    folder = write_campaign(tmp_path, robot=robot, head="id,meas.tz,cov.temperature",
                            rows=["a,1e-5,0", "b,3e-5,2"])  # fmt: skip
    campaign = read_campaign(folder)
    np.testing.assert_array_equal(campaign.configuration, [0, 0])
    np.testing.assert_array_equal(campaign.repeat, [0, 0])


def test_labels_may_contain_spaces_and_non_latin_letters(tmp_path):
    """Only control characters are rejected."""
    rows = [r.replace(f"m{k}", f"Übung\u00a0{k} é٣") for k, r in enumerate(ROWS, 1)]
    assert read_campaign(write_campaign(tmp_path, rows=rows)).ids[0].startswith("Ü")


def test_declared_table_format_and_units_are_read(tmp_path):
    """The same campaign is written with semicolons, decimal commas and other units."""
    plain = read_campaign(write_campaign(tmp_path / "plain"))
    in_mm = [
        "m1;5,729577951308232;11,459155902616464;0;0;0,01;0,02;0,03;1,5;0;1",
        "m2;17,188733853924695;22,918311805232928;0,01;0;0,02;;0;2;1;-1",
        "m3;5,729577951308232;11,459155902616464;-0;0;0,011;0,021;0,031;1;2;1",
        "m4;5,729577951308232;11,459155902616464;,01;0;1e-2;+0,02;3,0E-2;1;3;1",
    ]
    extra = '[table]\ndelimiter = ";"\ndecimal = ","\n[units]\nposition = "mm"\n'
    extra += 'command_rotation = "deg"\nforce = "kN"\ntime = "min"\n'
    folder = write_campaign(
        tmp_path / "other", head=HEAD.replace(",", ";"), rows=in_mm, extra=extra
    )
    other = read_campaign(folder)
    np.testing.assert_allclose(other.measured[:3], plain.measured[:3], rtol=1e-12)
    np.testing.assert_allclose(other.loads, plain.loads, rtol=1e-12)
    np.testing.assert_allclose(other.coordinates, plain.coordinates, rtol=1e-12)
    np.testing.assert_allclose(
        other.covariates["time"], plain.covariates["time"], rtol=1e-12
    )
    np.testing.assert_array_equal(other.repeat, plain.repeat)
    np.testing.assert_array_equal(other.sigma, plain.sigma)  # [noise] has SI units


def test_measured_motion_is_converted_to_si_units(tmp_path):
    """The motions are in urad and mm.  Other covariates are not converted."""
    head, extra = f"{HEAD},cov.tilt,cov.gap,cov.bed", "[units]\ncov.tilt = 'urad'\n"
    rows = [f"{row},3,{k},5" for k, row in enumerate(ROWS)]
    folder = write_campaign(tmp_path, head, rows, extra=f"{extra}cov.gap = 'mm'\n")
    campaign = read_campaign(folder)
    assert campaign.motion_units == {"tilt": "rad", "gap": "m"}
    assert campaign.covariates["tilt"] == pytest.approx([3e-6] * 4)
    assert campaign.covariates["gap"] == pytest.approx([0, 1e-3, 2e-3, 3e-3])
    assert campaign.covariates["bed"] == pytest.approx([5.0] * 4)
    assert campaign.take([0]).motion_units == campaign.motion_units


def test_table_may_have_byte_order_mark_and_carriage_returns(tmp_path):
    folder = write_campaign(tmp_path)
    table = folder / "measurements.csv"
    text = table.read_text().replace("\n", "\r\n") + "\r\n\r\n"
    table.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert len(read_campaign(folder)) == 4
    assert len(read_campaign(folder / "campaign.toml")) == 4


def test_sigma_column_replaces_sigma_of_the_device(tmp_path):
    rows = ["a,0,0,1e-5,2e-5,3e-6,", "b,0,0,1e-5,,,"]
    head = "id,q.one,q.two,meas.tx,meas.ty,sigma.tx,sigma.ty"
    sigma = read_campaign(write_campaign(tmp_path, head=head, rows=rows)).sigma
    np.testing.assert_array_equal(sigma[:, 3:5], [[3e-6, 5e-6], [5e-6, 5e-6]])


def test_unknown_device_pose_permits_large_positions(tmp_path):
    rows = ["a,0,0,1,2,3,-5.5,10,2,0,0,1"]
    head = "id,q.one,q.two,meas.rx,meas.ry,meas.rz,meas.tx,meas.ty,meas.tz,"
    head += "cov.temperature,cov.time,cov.approach"
    with pytest.raises(BadInput, match="meas.rz.* at most half a turn"):
        read_campaign(write_campaign(tmp_path, head=head,
                                     rows=[rows[0].replace("3,-5.5", "3.2,-5.5")],
                                     toml={"registration": '"unknown"'}))  # fmt: skip
    rows = [rows[0].replace("1,2,3,-5.5", "1,2,2,-5.5")]
    folder = write_campaign(tmp_path, head=head, rows=rows,
                            toml={"registration": '"unknown"'})  # fmt: skip
    assert read_campaign(folder).measured[0, 4] == 10


BAD_TABLES = {
    "unknown column": (HEAD.replace("meas.tx", "mess.tx"), ROWS,
        r'line 1: unknown column "mess.tx"; did you mean "meas.tx"\?'),
    "unknown joint": (HEAD.replace("q.two", "q.tow"), ROWS,
        r'line 1: unknown column "q.tow"; did you mean "q.two"\?'),
    "a joint that is not driven": (HEAD.replace("q.two", "q.tool"), ROWS,
        r'unknown column "q.tool": that joint is fixed'),
    "a drive without a command": (HEAD.replace("q.two", "cov.two"), ROWS,
        r'line 1: missing column "q.two"; expected a column for every actuated joint'),
    "no command at all": ("id,meas.tx", ["a,1e-5"],
        r'no commanded configuration; expected columns "q.one", "q.two" or pose.tx'),
    "joints and poses": ("id,q.one,q.two,pose.tx,meas.tx", ["a,0,0,0,0"],
        r'line 1: found both "q.one" and "pose.tx"; expected joint'),
    "no id": (HEAD.replace("id,", "cov.id,"), ["1" + r[2:] for r in ROWS],
        r'line 1: missing column "id"'),
    "a column twice": (HEAD.replace("load.mx", "load.fx"), ROWS,
        r'line 1: found column "load.fx" twice'),
    "a column without a name": (HEAD.replace("load.mx", " "), ROWS,
        r"line 1: column 5 has no name"),
    "no header": (None, ROWS, r"line 1: found no column name of a measurement table"),
    "semicolons": (HEAD.replace(",", ";"), [r.replace(",", ";") for r in ROWS],
        r'it contains ;: if this separates the cells, set delimiter = ";"'),
    "tabs": (HEAD.replace(",", "\t"), [r.replace(",", "\t") for r in ROWS],
        r'it contains tab: if this separates the cells, set delimiter = "tab"'),
    "a reading of 1e300": (HEAD, [ROWS[0].replace("1e-05", "1e300"), *ROWS[1:]],
        r'line 2 \(id "m1"\), meas.tx: found "1e300", expected a finite number \[m\]$'),
    "decimal commas": (HEAD, [ROWS[0].replace("1.5", "1,5")],
        r"line 2: found 12 cells, expected 11 as in the header; if the decimal mark"),
    "quoted decimal commas": (HEAD, [ROWS[0].replace("1e-05", '"0,00001"'), *ROWS[1:]],
        r'line 2 \(id "m1"\), meas.tx: found "0,00001", expected a finite number \[m\]'
        r'; "," is not the declared decimal mark: write "0.00001", or set in \[table\] '
        r'delimiter = ";", decimal = "," in campaign.toml and separate cells by ";"'),
    "a NUL in a label": (HEAD, [ROWS[0].replace("m1", "m\0"), *ROWS[1:]],
        r"line 2 contains NUL; expected a text file"),
    "a line break in a label": (HEAD, [ROWS[0].replace("m1", '"m\n1"')],
        r"line 3, \"id\": found 'm\\n1', expected text without line breaks"),
    "ragged": (HEAD, [*ROWS[:2], "m9,0.1"], r"line 4: found 2 cells, expected 11 as"),
    "empty": (None, [], r"measurements.csv: found an empty file; expected a header"),
    "no rows": (HEAD, [], r"measurements.csv: found no rows; expected one row"),
    "a word": (HEAD, [ROWS[0].replace("1e-05", "small")],
        r'line 2 \(id "m1"\), meas.tx: found "small", expected a finite number \[m\]'),
    "nan": (HEAD, [ROWS[0].replace("1e-05", "nan")],
        r'meas.tx: found "nan".*; leave the cell empty if it was not measured'),
    "an empty command": (HEAD, [ROWS[0].replace(",0.1,", ",,")],
        r"q.one: found an empty cell, expected a value; only cells of meas. and sigma"),
    "nothing measured": (HEAD, [ROWS[0].replace("1e-05,2e-05,3e-05", ",,")],
        r'line 2 \(id "m1"\): found no reading in this row; expected'),
    "an id twice": (HEAD, [*ROWS, ROWS[1]],
        r'line 6, id: found "m2", already the label of line 3; expected a '),
    "no label": (HEAD, [ROWS[0].replace("m1", " ")], "line 2, id: found an empty cell"),
    "approach": (HEAD, [ROWS[0][:-1] + "0"],
        r"cov.approach: found 0, expected -1 or 1"),
    "before the first": (HEAD, [ROWS[0].replace("1.5,0,1", "1.5,-60,1")],
        r"cov.time: found -60 s, expected seconds since the first measurement, >= 0"),
    "a date": (HEAD, [ROWS[0].replace("1.5,0,1", "1.5,1.7e9,1")],
        r"cov.time: found 1.7e\+09, expected seconds since the first measurement"),
    "absolute temperature": (HEAD, [ROWS[0].replace("1.5,0,1", "293.15,0,1")],
        r"cov.temperature: found 293.15, expected the deviation from the temperature"),
    "metres for micrometres": (HEAD, [ROWS[0].replace("1e-05", "153")],
        r"meas.tx: found 153, expected a length in m, at most the robot's size of "
        r"1\.\d+; "
        r"declare other units in \[units\]"),
    "degrees": (HEAD, [ROWS[0].replace(",0.1,", ",90,")],
        r"q.one: found 90, expected an angle in rad; declare other units"),
    "a load of 1e9 N": (HEAD, [ROWS[0].replace(",0,0,1e", ",1e9,0,1e")],
        r"load.fx: found 1e\+09, expected a load in N"),
    "a pose in mm": ("id,pose.tx,pose.ty,meas.tx", ["a,500,1000,0"],
        r"pose.tx: found 500, expected a position in m; declare other units"),
    "out of reach": ("id,pose.tx,pose.ty,meas.tx", ["a,0.5,1,0", "b,5,1,0"],
        r'line 3 \(id "b"\): pose tx=5, ty=1 cannot be reached'),
    "sigma of zero": ("id,q.one,q.two,meas.tx,sigma.tx", ["a,0,0,0,0"],
        r"sigma.tx: found 0 m, expected a standard deviation > 0"),
    "an open quote": (HEAD, ['"m1,0.1'], r"line \d: not CSV: unexpected end of data"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_TABLES)
def test_invalid_table_is_rejected_with_a_one_line_message(case, tmp_path):
    head, rows, message = BAD_TABLES[case]
    folder = write_campaign(tmp_path, head=head, rows=rows)
    with pytest.raises(BadInput, match=message) as caught:
        read_campaign(folder)
    assert str(caught.value).startswith(str(folder / "measurements.csv"))
    assert "\n" not in str(caught.value)


BAD_TOML = {
    "unknown key": ({"note": '"x"'}, NOISE, r'unknown key "note"; did you mean "noi'),
    "robot missing": ({"robot": None}, NOISE, r"robot: missing; expected a built-in"),
    "no such robot": ({"robot": '"irsbot3"'}, NOISE,
        r'robot: found "irsbot3", which is neither a built-in robot nor a file in '
        r'this folder; '
        r'did you mean "irsbot2"\?'),
    "no table": ({"measurements": '"m.csv"'}, NOISE, r"m.csv: cannot be read: No such"),
    "a point in mm": ({"reference_point": "[20, 0, 50]"}, NOISE,
        r"reference_point: found a point 53.85.* m from the platform, but the robot"),
    "two numbers": ({"reference_point": "[0, 1]"}, NOISE, r"expected 3 finite numbers"),
    "registration": ({"registration": '"unknwon"'}, NOISE, r'did you mean "unknown"'),
    "noise": ({}, "[noise]\nrotatoin = 1\n", r'noise: unknown key "rotatoin"; did you'),
    "no noise": ({}, "", r"sigma.tx: found no standard deviation; expected one in"),
    "noise of 0": ({}, "[noise]\nposition = 0\n", r"noise.position: found 0, expected"),
    "unit": ({}, '[units]\nposition = "miles"\n', "found 'miles', expected .m. . .mm"),
    "unit of a covariate": ({}, "[units]\ncov.time = 'rad'\n",
        r"units.cov.time: found .time., expected a covariate column of the table"),
    "unknown unit": ({}, '[units]\npostion = "m"\n', r'did you mean "position"\?'),
    "comma twice": ({}, '[table]\ndecimal = ","\n', r"as decimal mark and as deli"),
    "delimiter": ({}, '[table]\ndelimiter = "/"\n', r"delimiter: found '/', expected"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_TOML)
def test_invalid_campaign_file_is_rejected_in_one_line(case, tmp_path):
    toml, rest, message = BAD_TOML[case]
    folder = write_campaign(tmp_path, toml=toml, noise=rest)
    with pytest.raises(BadInput, match=message) as caught:
        read_campaign(folder)
    assert str(caught.value).startswith(str(folder))
    assert "\n" not in str(caught.value)


def test_message_about_another_kind_of_file_omits_its_content(tmp_path):
    folder = write_campaign(tmp_path)
    (folder / "measurements.csv").write_text("root:secret:0:0\nother:words\n")
    with pytest.raises(BadInput, match="found no column") as caught:
        read_campaign(folder)
    assert "secret" not in str(caught.value)


def test_missing_folder_is_rejected(tmp_path):
    with pytest.raises(BadInput, match=r"gone/campaign.toml: cannot be read: No such"):
        read_campaign(tmp_path / "gone")


def test_invalid_robot_file_of_a_campaign_is_rejected(tmp_path):
    folder = write_campaign(tmp_path, robot=ARM.replace("one", "base", 1))
    with pytest.raises(BadInput, match=r"robot.toml: frame"):
        read_campaign(folder)


def test_examples_in_the_documentation_are_read(tmp_path):
    """All examples on the page are combined to one file."""
    docs = Path(__file__).parents[3] / "docs" / "campaigns.md"
    blocks = re.findall(r"```toml\n(.*?)```", docs.read_text("utf-8"), flags=re.S)
    assert len(blocks) == 3
    (tmp_path / "campaign.toml").write_text("".join(blocks), encoding="utf-8")
    (tmp_path / "measurements.csv").write_text(
        "id;pose.tx;pose.tz;load.fx;meas.tx;meas.ry;cov.time\n"
        "a;100;-500;0,01;0,25;0,1;2\n"
    )
    campaign = read_campaign(tmp_path)
    assert campaign.robot.name == load_robot("irsbot2").name
    platform = campaign.transforms[0, campaign.robot.index(campaign.robot.platform)]
    np.testing.assert_allclose(platform[[0, 2], 3], [0.1, -0.5], atol=1e-9)
    assert campaign.loads[0, 3] == pytest.approx(10.0)
    assert campaign.measured[0, 3] == pytest.approx(2.5e-4)
    assert campaign.measured[0, 1] == pytest.approx(math.radians(0.1))
    assert campaign.covariates["time"][0] == 120
    np.testing.assert_array_equal(campaign.sigma[0], [1e-5] * 3 + [5e-6] * 3)


POINTS = "[points]\nA = [0.1, 0, 0]\nB = [0, 0.2, 0]\n"


def test_campaign_has_a_row_for_each_measured_point(tmp_path):
    """The nominal positions of the points are calculated by hand."""
    head = "id,q.one,q.two,session,meas.A.tx,meas.A.ty,meas.B.tx,meas.tz"
    rows = ["m1,0.1,0.2,a,1e-5,2e-5,3e-5,4e-5", "m2,0.1,0.2,b,,,5e-5,"]
    campaign = read_campaign(write_campaign(tmp_path, head, rows, extra=POINTS))
    assert campaign.ids == ("m1", "m1:A", "m1:B", "m2:B")
    assert campaign.sessions == ("a", "b")
    assert campaign.session.tolist() == ["a", "a", "a", "b"]
    expected = [[4e-5], [1e-5, 2e-5], [3e-5], [5e-5]]
    for found, values in zip(campaign.measured, expected, strict=True):
        assert found[np.isfinite(found)].tolist() == values
    assert campaign.targets.tolist() == [
        [0, 0, 0],
        [0.1, 0, 0],
        [0, 0.2, 0],
        [0, 0.2, 0],
    ]
    # Rows with different points or sessions are not repeats.
    assert campaign.repeat.tolist() == [0, 1, 2, 3]
    assert campaign.configuration.tolist() == [0, 0, 0, 0]
    assert campaign.take([3]).targets.tolist() == [[0, 0.2, 0]]


def test_each_of_several_tables_is_a_session(tmp_path):
    folder = write_campaign(tmp_path, toml={"measurements": '["a.csv", "b.csv"]'})
    (folder / "a.csv").write_text(f"{HEAD}\n{ROWS[0]}\n")
    (folder / "b.csv").write_text(f"{HEAD}\n{ROWS[1]}\n{ROWS[2]}\n")
    campaign = read_campaign(folder)
    assert campaign.session.tolist() == ["a", "b", "b"]
    assert campaign.ids == ("a/m1", "b/m2", "b/m3")
    (folder / "b.csv").write_text("id,q.one,q.two,meas.tx\nm1,0,0,x\n")
    with pytest.raises(BadInput, match="b.csv: line 2"):
        read_campaign(folder)


@pytest.mark.parametrize(("head", "cells", "extra", "message"), [
    ("id,q.one,q.two,meas.C.tx", "m1,0,0,1e-5", POINTS, 'unknown column "meas.C.tx"'),
    ("id,q.one,q.two,meas.A.rx", "m1,0,0,1e-5", POINTS, 'unknown column "meas.A.rx"'),
    ("id,q.one,q.two,session,meas.tx", "m1,0,0,,1e-5", "", "session: found an empty"),
    ("id,q.one,q.two,meas.A.tx", "m1,0,0,", POINTS, "found no reading in this row"),
    ("id,q.one,q.two,meas.A.tx", "m1,0,0,1e-5", "[points]\nA = [900, 0, 0]\n",
     "points.A: found a point 900 m from the platform"),
    ("id,q.one,q.two,meas.tx", "m1,0,0,1e-5", "[points]\ntx = [0, 0, 0]\n",
     'points: found "tx"'),
])  # fmt: skip
def test_invalid_sessions_and_points_are_rejected(
    head, cells, extra, message, tmp_path
):
    with pytest.raises(BadInput) as error:
        read_campaign(write_campaign(tmp_path, head, [cells], extra=extra))
    assert message in str(error.value)
