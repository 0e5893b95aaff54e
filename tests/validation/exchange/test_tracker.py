"""Tests of the import of tracker files as a campaign, with a known device frame."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.exchange.device_table import Writing, parse_time
from tests.campaigns_for_tests import ARM, read_table

TARGETS = {"A": (0.0, 0.0, 0.1), "B": (0.1, 0.02, 0.0), "C": (0.0, 0.07, 0.03)}
ANGLES = [(0.1 * k, 0.3 + 0.17 * k) for k in range(-6, 7)]
TURN = Rotation.from_rotvec([0.4, -1.1, 2.0])  # pose of the device
SHIFT = np.array([2.0, -3.0, 0.7])


def attained(angles, place):
    """Return the position of a target on the planar arm, base axes, (3,) [m]."""
    one, two = angles
    turn = Rotation.from_euler("z", one + two)
    elbow = np.array([np.cos(one), np.sin(one), 0.0])
    return elbow + turn.apply(np.array([0.8, 0, 0]) + place)


def seen(angles, name):
    """Return the position of a target in device axes, (3,) [m]."""
    return TURN.inv().apply(attained(angles, TARGETS[name]) - SHIFT)


class Lab:
    """A folder with files for an import."""

    def __init__(self, folder):
        self.folder = folder
        (folder / "robot.toml").write_text(ARM)
        self.targets()
        self.commands()

    def targets(self, names="ABC", **keys):
        """Write the targets file."""
        keys = {"robot": '"robot.toml"', "noise": 1e-5, "unit": '"mm"'} | keys
        lines = [f"{k} = {v}" for k, v in keys.items() if v is not None]
        lines += ["[targets]", *(f"{n} = {list(TARGETS[n])}" for n in names)]
        (self.folder / "smr.toml").write_text("\n".join(lines) + "\n")

    def commands(self, times=None, head="id,q.one,q.two"):
        """Write the table of commands."""
        rows = [f"p{k},{a!r},{b!r}" for k, (a, b) in enumerate(ANGLES)]
        if times is not None:
            pairs = zip(rows, times, strict=True)
            head, rows = f"{head},time", [f"{row},{time}" for row, time in pairs]
        (self.folder / "commands.csv").write_text("\n".join([head, *rows]) + "\n")

    def export(self, text, name="export.txt"):
        """Write a file of the device."""
        (self.folder / name).write_text(text)

    def words(self, *files):
        """Return the arguments of the import command."""
        f = self.folder
        paths = [f / name for name in files or ("export.txt",)]
        return ["validation", "import", *paths, "--targets", f / "smr.toml",
                "--commands", f / "commands.csv", "-o", f / "campaign"]  # fmt: skip

    def table(self):
        """Return the columns of the imported campaign."""
        rows = read_table(self.folder / "campaign" / "measurements.csv")
        return {k: [row[k] for row in rows] for k in rows[0]}


@pytest.fixture
def lab(tmp_path):
    return Lab(tmp_path)


def points(names="ABC", line="{name}", change=lambda k, name, p: p):
    """Yield the lines of an export, one for each command and target, in mm."""
    for k, angles in enumerate(ANGLES):
        for name in names:
            x, y, z = (1e3 * change(k, name, seen(angles, name))).tolist()
            yield line.format(k=k, name=name, x=x, y=y, z=z)


def imported(lab, run, text, encoding="utf-8"):
    """Import an export and return the JSON output of the command."""
    lab.folder.joinpath("export.txt").write_bytes(text.encode(encoding))
    status, out, err = run(*lab.words(), "--json", "-")
    assert status == 0, err
    return json.loads(out)


def refused(lab, run, text):
    """Return the error message for an export, and check that nothing is written."""
    lab.export(text)
    status, out, err = run(*lab.words())
    assert (status, out) == (2, "")
    assert not (lab.folder / "campaign").exists()
    return err.strip().splitlines()[-1]


SPATIAL_ANALYZER = "Main::p{k}::{name}, {x!r}, {y!r}, {z!r}"


def test_spatial_analyzer_readings_are_assigned_to_commands_by_name(lab, run):
    """For exact readings, deviations are round-off."""
    text = "\n".join(["// a comment", *points(line=SPATIAL_ANALYZER)])
    table = imported(lab, run, text)
    assert table["joined_by"] == "name"
    assert (table["rows"], table["readings"], table["left_out"]) == (13, 39, [])
    assert table["device"]["rotation"] == pytest.approx(TURN.as_matrix(), abs=1e-12)
    assert table["device"]["shift"] == pytest.approx(SHIFT, abs=1e-12)
    columns = lab.table()
    for name in "ABC":
        for axis in "xyz":
            values = np.array(columns[f"meas.{name}.t{axis}"], dtype=float)
            assert np.abs(values).max() < 1e-12
    declared = (lab.folder / "campaign" / "campaign.toml").read_text()
    assert '[points]\n"A" = [0.0, 0.0, 0.1]' in declared
    assert 'registration = "unknown"' in declared
    assert 'robot = "../robot.toml"' in declared


def test_import_with_diagnose_writes_a_report(lab, run, rejected):
    """The readings of the declared arm contain only noise."""
    noise = np.random.default_rng(1).normal(size=(len(ANGLES), 3))
    lab.export("\n".join(points(
        "A", "p{k}, {x!r}, {y!r}, {z!r}", lambda k, name, p: p + 1e-5 * noise[k]
    )))  # fmt: skip
    lab.targets("A")
    report = lab.folder / "diagnosis.html"
    message = rejected(*lab.words(), "--report", report)
    assert "--report: found without --diagnose" in message
    assert not (lab.folder / "campaign").exists()
    status, out, err = run(
        *lab.words(), "--diagnose", "--json", "-", "--report", report
    )
    assert status == 0, err
    assert json.loads(out)["verdict"] == "none_needed"
    assert report.stat().st_size < 5e6


def test_german_export_with_times_and_uncertainty_is_read(lab, run):
    """U95 is two standard deviations."""
    lab.targets("A", unit=None, noise=None, decimal='","')
    lab.commands([f"22.11.2026 10:{k:02d}:00" for k in range(13)])
    text = (lab.folder / "commands.csv").read_text().replace(",", ";")
    (lab.folder / "commands.csv").write_text(text.replace(".", ",").replace(
        "q,", "q.").replace("22,11,2026", "22.11.2026"))  # fmt: skip
    rows = ["Name;X [mm];Y [mm];Z [mm];U95 X [um];U95 Y [um];U95 Z [um];Timestamp"]
    for line in points("A", "{name};{x!r};{y!r};{z!r};30,0;40,0;50,0;{k}"):
        cells, _, k = line.replace(".", ",").rpartition(";")
        rows.append(f"{cells};2026-11-22T10:{int(k):02d}:02")
    assert imported(lab, run, "\n".join(rows))["joined_by"] == "time"
    campaign = read_campaign(lab.folder / "campaign")
    assert campaign.reference_point == pytest.approx(TARGETS["A"])
    assert np.abs(campaign.measured[:, 3:]).max() < 1e-12
    # variances along the base axes, from those along the device axes
    variance = TURN.as_matrix() ** 2 @ (np.array([15e-6, 20e-6, 25e-6]) ** 2)
    assert campaign.sigma[:, 3:] == pytest.approx(
        np.tile(np.sqrt(variance), (13, 1)), rel=1e-9
    )
    assert campaign.covariates["time"] == pytest.approx(60.0 * np.arange(13))


def test_deviations_are_recovered_with_a_known_registration(lab, run):
    lab.targets("B", registration='"known"', unit='"m"')
    lines = [
        "B\t{}\t{}\t{}".format(*(attained(a, TARGETS["B"]) + [1e-4, 2e-4, k * 1e-6]))
        for k, a in enumerate(ANGLES)
    ]
    imported(lab, run, "\n".join(lines))
    campaign = read_campaign(lab.folder / "campaign")
    expected = [[1e-4, 2e-4, k * 1e-6] for k in range(13)]
    assert campaign.measured[:, 3:] == pytest.approx(np.array(expected), abs=1e-14)


def test_exchanged_targets_and_outliers_are_omitted_and_reported(lab, run, rng):
    """Targets A and B are exchanged at p3, and C deviates by 30 mm at p7."""

    def change(k, name, p):
        if k == 3 and name in "AB":
            p = seen(ANGLES[k], "BA"["AB".index(name)])
        return p + (k == 7 and name == "C") * np.array([0, 0.03, 0])

    text = "\n".join(points(line=SPATIAL_ANALYZER, change=change))
    left_out = imported(lab, run, text)["left_out"]
    assert len(left_out) == 3
    assert '"Main::p3::A"): command "p3": this is target "B"' in left_out[0]
    assert 'command "p3": this is target "A"; targets were exch' in left_out[1]
    assert 'command "p7": deviates by 30 mm, other readings by' in left_out[2]
    columns = lab.table()
    row = columns["id"].index("p3")
    assert columns["meas.A.tx"][row] == columns["meas.B.tx"][row] == ""
    assert columns["meas.C.tx"][row] != ""


def test_targets_exchanged_in_every_row_are_rejected(lab, run):
    lines = [line.translate(str.maketrans("AB", "BA"))
             for line in points(line=SPATIAL_ANALYZER)]  # fmt: skip
    message = refused(lab, run, "\n".join(lines))
    assert "exchanged in every row: A is B, B is A" in message


def test_files_with_the_same_points_become_repeated_rows(lab, run):
    """Names without a command are joined by order.  Two files have the same points."""
    imported(lab, run, "\n".join(points(line="{name} {x!r} {y!r} {z!r}")))
    lab.folder.joinpath("campaign/measurements.csv").unlink()
    lab.folder.joinpath("campaign/campaign.toml").unlink()
    named = "\n".join(points(line="p{k}::{name} {x!r} {y!r} {z!r}"))
    lab.export(named)
    lab.export(named, "again.txt")
    assert run(*lab.words("export.txt", "again.txt"))[0] == 0
    assert lab.table()["id"][:4] == ["p0", "p0.2", "p1", "p1.2"]


@pytest.mark.parametrize("line", ["p{k}_{name}", "{name} p{k}", "run-p{k}.{name}"])
def test_names_with_any_separator_identify_target_and_command(line, lab, run):
    """The rows are in reverse order, and p1 must not be found in p10."""
    rows = [
        ";".join([
            line.format(k=k, name=name),
            *(repr(float(1e3 * x)) for x in seen(a, name)),
        ])
        for k, a in enumerate(ANGLES)
        for name in "ABC"
    ]
    imported(lab, run, "\n".join(["name;x;y;z", *rows[::-1]]))
    table = lab.table()
    assert table["id"] == [f"p{k}" for k in range(len(ANGLES))]
    assert [float(x) for x in table["meas.B.tx"]] == pytest.approx(
        [0.0] * len(ANGLES), abs=1e-9
    )


@pytest.mark.parametrize(("text", "targets", "message"), [
    ("name x y\nA 1 2", {}, "found no column z"),
    ("name;x;y;z\nA;1;2;3", {"unit": None}, "found no unit of lengths"),
    ("name;x [furlong];y;z\nA;1;2;3", {}, 'found the unit "furlong"'),
    ("name;Az [deg];El [deg];Range [mm]\nA;1;2;3", {},
     'line 1: found the column "az", expected Cartesian coordinates'),
    ("name;x;y;z\nA;1,5;2;3", {}, "if this is a decimal mark, set decimal"),
    ("name;x;y;z\nA;1;2", {}, "found 3 cells, expected 4"),
    ("name;x;y;z\nD;1;2;3", {}, 'no name of a target, expected one of: "A", "B", "C"'),
    ("A 1 2 3\nA 1 2 4", {}, 'found 2 readings of "A" for 13 commands'),
    ("name;x;y;z;time\nA;1;2;3;noon", {}, "expected a time: seconds"),
    ("name;x;y;z;date\nA;1;2;3;3/4/2026 10:00:00", {}, 'expected dates = "day_fi'),
    ("name;x;y;z;U95 x\nA;1;2;3;-4", {}, "found -0.002 m, expected >= 0"),
    ("Units: Inches\nname;x;y;z\nA;1;2;3", {},
     'line 1: found the unit "in", expected "mm" as declared'),
    (13 * f"{9 * 'NaN '}\n", {}, "found no"),
    ("", {}, "found an empty file, expected a table"),
    ("A 1 2 3", {"unit": '"ft"'}, "unit: found 'ft'"),
    ("A 1 2 3", {"robot": None}, "robot: missing"),
    ("A 1 2 3", {"windw": 3}, 'unknown key "windw"; did you mean "window"?'),
])  # fmt: skip
def test_invalid_device_file_is_rejected(lab, run, text, targets, message):
    lab.targets(**targets)
    assert message in refused(lab, run, text)


@pytest.mark.parametrize(("head", "message"), [
    ("id,q.one,q.to", 'unknown column "q.to"; did you mean "q.two"?'),
    ("id,q.one,cov.a", "expected a column for every drive"),
    ("id,q.one,q.two [grad]", 'found the unit "grad"'),
    ("ids,q.one,q.two", 'unknown column "ids"'),
])  # fmt: skip
def test_invalid_table_of_commands_is_rejected(lab, run, head, message):
    lab.commands(head=head)
    assert message in refused(lab, run, "\n".join(points(line=SPATIAL_ANALYZER)))


def test_import_does_not_overwrite_a_campaign(lab, run, rejected):
    imported(lab, run, "\n".join(points(line=SPATIAL_ANALYZER)))
    assert "expected a new folder" in rejected(*lab.words())


def test_import_reports_ground_points_and_unknown_names(lab, run):
    lines = list(points(line=SPATIAL_ANALYZER))
    lines[5] = lines[5].replace("p1", "pl")
    table = imported(lab, run, "\n".join(["Ground::nest1, 1, 2, 3", *lines]))
    assert table["readings"] == 38
    misnamed, ground = table["left_out"]
    assert misnamed.endswith('("Main::pl::C"): its name contains no id of a command')
    assert "1 readings of no target" in ground
    assert "nest1" in ground


def test_readings_far_from_any_command_are_reported(lab, run):
    lab.targets("A", window=3)
    lab.commands(range(0, 130, 10))
    lines = [f"{line};{10 * k + 1 + 3 * (k == 5)}" for k, line in enumerate(
        points("A", "{name};{x!r};{y!r};{z!r}"))]  # fmt: skip
    table = imported(lab, run, "\n".join(["name;x;y;z;time", *lines]))
    assert table["readings"] == 12
    assert "no command is near it in time" in table["left_out"][0]


@pytest.mark.parametrize(("text", "seconds", "dates"), [
    *((text, 1795343400.0, None) for text in (
        "2026-11-22T10:30:00", "2026-11-22 10:30:00.000", "20261122103000",
        "22.11.2026 10:30:00", "2026-11-22T11:30:00+01:00", "1795343400",
    )),
    ("11/22/2026 10:30:00 AM", 1795343400.0, "month_first"),
    ("22/11/2026 10:30:00", 1795343400.0, "day_first"),
    ("10:30:00", 37800.0, None), ("9:30:00 PM", 77400.0, None),
    ("10:30:00,25", 37800.25, None),
    ("1.1.1970 00:01:00.123456789", 60.123456, None),
])  # fmt: skip
def test_time_in_every_notation_is_converted_to_seconds(text, seconds, dates):
    assert parse_time("", text, Writing(dates=dates)) == seconds
