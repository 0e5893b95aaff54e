"""Tests of exports of device programs, all with the same exact readings.

The readings are computed in closed form for a planar arm, so all deviations of the
imported campaigns are round-off.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.inputs.errors import BadInput
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.exchange.cells import read_sheet
from tests.validation.exchange.test_tracker import (
    ANGLES,
    SHIFT,
    SPATIAL_ANALYZER,
    TARGETS,
    TURN,
    Lab,
    imported,
    points,
    refused,
    seen,
)


@pytest.fixture
def lab(tmp_path):
    return Lab(tmp_path)


def assert_exact(lab, readings=None):
    """Check the number of readings, and that all deviations are round-off."""
    campaign = read_campaign(lab.folder / "campaign")
    assert np.nanmax(np.abs(campaign.measured[:, 3:])) < 1e-9
    if readings is not None:
        assert len(campaign) == readings


def rows(names="ABC", mark=",", line=None):
    """Yield lines with x, y, z [mm] of all targets, one for each command."""
    for k, angles in enumerate(ANGLES):
        cells = [repr(float(x)) for n in names for x in 1e3 * seen(angles, n)]
        yield mark.join(([line.format(k=k)] if line else []) + cells)


LEICA = (
    "X  [mm],Y  [mm],Z  [mm],U(95)  [mm],U(95) X  [mm],U(95) Y  [mm],U(95) Z  [mm],"
    "Tilt  [deg],Target,Temperature  [°C],Time Stamp,OTG Applied"
)
LEICA_ROW = (
    "{x!r},{y!r},{z!r},0.01,0.008,0.002,0.006,29.9,TMC 30-B #5320,22.8,"
    "'11.10.2022 15:{k:02d}:48.043,FALSE"
)


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8-sig", "utf-16"])
def test_leica_export_with_zero_uncertainty_uses_the_noise(lab, run, encoding):
    """U(95) is two standard deviations.  An U(95) of 0 is replaced by the noise."""
    lab.targets("A", unit=None)
    body = list(points("A", LEICA_ROW))
    body[3] = body[3].replace(",0.002,", ",0,")
    table = imported(lab, run, "\r\n".join([LEICA, *body]) + "\r\n", encoding)
    assert (table["readings"], table["joined_by"]) == (13, "order")
    assert_exact(lab, 13)
    campaign = read_campaign(lab.folder / "campaign")
    variance = TURN.as_matrix() ** 2 @ (np.array([4e-6, 1e-6, 3e-6]) ** 2)
    expected = np.tile(np.sqrt(variance), (13, 1))
    expected[3] = 1e-5
    assert campaign.sigma[:, 3:] == pytest.approx(expected, rel=1e-9)
    assert campaign.covariates["time"] == pytest.approx(60.0 * np.arange(13))


def with_commas(lines):
    """Return lines with decimal commas, as in German exports, except in dates."""
    return [line.replace(".", ",").replace("02,03,", "02.03.") for line in lines]


def hidden(lines):
    """Return lines without the coordinates of target A in the fifth line."""
    cells = lines[4].split(",")
    cells[2:5] = "", "", ""
    return [*lines[:4], ",".join(cells), *lines[5:]]


AXES = ",".join("XYZ" * 3)
MOTIVE = [
    "Format Version,1.23,Capture Frame Rate,120.0,Length Units,Millimeters", "",
    ",Type," + ",".join(["Marker"] * 9),
    ",Name," + ",".join(f"arm:{n}" for n in "ABC" for _ in "xyz"),
    ",ID," + ",".join(["7"] * 9), ",," + ",".join(["Position"] * 9),
    "Frame,Time (Seconds)," + AXES,
]  # fmt: skip
VICON = ["Trajectories", "100", ",,arm:A,,,arm:B,,,arm:C,,", "Frame,Sub Frame," + AXES,
         ",,mm" + 8 * ",mm"]  # fmt: skip
GERMAN = with_commas(
    points(line="p{k}::{name};{x!r};{y!r};{z!r};02.03.2026;10:{k:02d}:00")
)
FARO = "FARO CAM2 2023\nReport: robot 7\n{}\nCoordinate System: World\n\n"
FARO += "Name\tX\tY\tZ\tDeviation"
FARO_ROWS = list(points(line="p{k}::{name}\t{x!r}\t{y!r}\t{z!r}\t0.0021"))
BLANKS = list(points(line="p{k}::{name}   {x!r}  {y!r}  {z!r}"))
STATED, COMMA = {"unit": None}, {"unit": None, "decimal": '","'}
# header, rows, and keys of the targets file
EXPORTS = {
    "prefix": (",".join(f"{n} {a} [mm]" for n in "ABC" for a in "XYZ"), rows(), {}),
    "dots": (",".join(f"arm.{n}.{a}" for n in "ABC" for a in "xyz"), rows(), {}),
    "suffix": (",".join(f"{a}_{n}" for n in "ABC" for a in "xyz"), rows(), {}),
    "joined": (",".join(f"{n}{a}" for n in "ABC" for a in "xyz"), rows(), {}),
    "numbered": (",".join(f"{a}{k}" for k in (1, 2, 3) for a in "xyz"), rows(), {}),
    "axes alone": (AXES, rows(), {}),
    "commands in rows": (
        "Point," + ",".join(f"{n} {a} [mm]" for n in "ABC" for a in "XYZ"),
        reversed(list(rows(line="p{k}"))), {},
    ),
    # the coordinates of one hidden target are missing
    "Vicon": ("\n".join(VICON), hidden(list(rows(line="{k}00,0"))), STATED),
    "Motive": ("\n".join(MOTIVE), rows(line="{k},0.{k}"), STATED),
    "German": ("Punkt;X [mm];Y [mm];Z [mm];Datum;Uhrzeit", GERMAN, COMMA),
    "slash": ("Punktname;X / mm;Y / mm;Z / mm;Datum;Zeit", GERMAN, COMMA),
    "underline": ("Point Name;X_mm;Y_mm;Z_mm;Date;Time", GERMAN, COMMA),
    "FARO": (FARO.format("Units: Millimeters"), FARO_ROWS, STATED),
    "FARO in": (FARO.format("Units in mm"), FARO_ROWS, STATED),
    "FARO unit": (FARO.format("unit\tmm"), FARO_ROWS, STATED),
    "blanks": ("Point Name    X          Y          Z", BLANKS, {}),
    "blanks, units": ("Point  X [mm]  Y [mm]  Z [mm]", BLANKS, {}),
    "blank, units": ("Point X [mm] Y [mm] Z [mm]", BLANKS, {}),
    # the table of commands has commas as separators and decimal points
    "commas": ("Point;X [mm];Y [mm];Z [mm]",
               with_commas(points(line="p{k}::{name};{x!r};{y!r};{z!r}")), COMMA),
}  # fmt: skip
EXPORTS = {
    name: (head, list(body), keys) for name, (head, body, keys) in EXPORTS.items()
}


@pytest.mark.parametrize("name", EXPORTS)
def test_imported_export_of_a_device_program_has_no_deviations(lab, run, name):
    head, body, keys = EXPORTS[name]
    lab.targets(**keys)
    encoding = "utf-8-sig" if name == "commas" else "utf-8"
    text = "\n".join([head, *body])
    if name == "Vicon":
        text = text.replace("\n", "\r\n")
    table = imported(lab, run, text, encoding)
    readings = 38 if name == "Vicon" else 39
    assert (table["readings"], table["rows"]) == (readings, 13)
    assert_exact(lab, readings)
    named = any("p3" in line for line in body)
    assert table["joined_by"] == ("name" if named else "order")
    if name == "Vicon":
        assert "1 readings without coordinates" in table["left_out"][0]
    if "Dat" in head:  # Datum, Date
        times = read_campaign(lab.folder / "campaign").covariates["time"]
        assert times == pytest.approx(60.0 * np.repeat(np.arange(13), 3))


@pytest.mark.parametrize("before", [None, "{k}", "{k}.5"])
def test_rows_without_names_are_assigned_to_targets_in_order(lab, run, before):
    """Distances between targets show whether a counter or a time comes first."""
    body = [row + ",35.1,-2.5,0.4" for row in rows(line=before)]
    assert imported(lab, run, "\n".join(body))["readings"] == 39
    assert_exact(lab, 39)


def test_motive_rigid_body_is_imported_without_its_markers(lab, run):
    """The rotation is a quaternion x, y, z, w.  The markers also have the name A."""
    lab.targets("A", unit=None, noise_rotation=1e-4)
    kinds = ["Rotation"] * 4 + ["Position"] * 6
    head = [
        "Format Version,1.23,Length Units,Millimeters",
        ",Type," + ",".join(["Rigid Body"] * 7 + ["Rigid Body Marker"] * 3),
        ",Name," + ",".join(["A"] * 7 + ["A:1"] * 3),
        ",," + ",".join(kinds),
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,X,Y,Z",
    ]
    body = []
    for k, angles in enumerate(ANGLES):
        place = 1e3 * seen(angles, "A")
        cells = [k, 0.1 * k, *oriented(k).as_quat(), *place, *place]
        body.append(",".join(repr(float(x)) for x in cells))
    table = imported(lab, run, "\n".join([*head, *body]))
    assert table["mounts"]["A"] == pytest.approx(MOUNT.as_rotvec(), abs=1e-9)
    assert_exact(lab, 13)


def test_quoted_numbers_with_decimal_comma_are_read(lab, run):
    lab.targets(decimal='{ export = ",", commands = "." }')
    line = 'p{k}::{name},"{x!r}","{y!r}","{z!r}"'
    body = [row.replace(".", ",") for row in points(line=line)]
    imported(lab, run, "\n".join(["name,x,y,z", *body]))
    assert_exact(lab, 39)


def test_decimal_mark_is_declared_for_each_table(lab, run):
    text = (lab.folder / "commands.csv").read_text().replace(",", ";")
    (lab.folder / "commands.csv").write_text(text)
    line = "p{k}::{name};{x!r};{y!r};{z!r}"
    body = [row.replace(".", ",") for row in points(line=line)]
    lab.targets(decimal='","')
    assert 'decimal = { commands = "." }' in refused(lab, run, "\n".join(body))
    lab.targets(decimal='{ export = ",", commands = "." }')
    imported(lab, run, "\n".join(body))
    assert_exact(lab, 39)


def test_campaign_contains_the_times_of_the_commands(lab, run):
    """Only the table of commands contains times, in minutes."""
    lab.commands([str(0.5 * k) for k in range(13)], head="id,q.one,q.two")
    text = (lab.folder / "commands.csv").read_text().replace("time", "time [min]")
    (lab.folder / "commands.csv").write_text(text)
    imported(lab, run, "\n".join(points(line=SPATIAL_ANALYZER)))
    campaign = read_campaign(lab.folder / "campaign")
    times = 30.0 * np.repeat(np.arange(13), 3)
    assert campaign.covariates["time"] == pytest.approx(times)


@pytest.mark.parametrize(("column", "message"), [
    ("cov.temperature [K]", None),
    ("cov.temperature [°C]", None),
    ("cov.humidity [%]", None),
    ("cov.temperature [kg]", 'found the unit "kg"'),
    ("load.fx [mm]", 'found the unit "mm"'),
])  # fmt: skip
def test_unit_of_another_quantity_in_commands_is_rejected(lab, run, column, message):
    lab.commands(range(13))
    path = lab.folder / "commands.csv"
    path.write_text(path.read_text().replace("time", column), encoding="utf-8")
    text = "\n".join(points(line=SPATIAL_ANALYZER))
    if message:
        assert message in refused(lab, run, text)
        return
    imported(lab, run, text)
    (name,) = (c for c in lab.table() if c.startswith("cov."))
    assert name == column.split(" ")[0]
    assert [float(x) for x in lab.table()[name]] == list(range(13))


@pytest.mark.parametrize("nothing", ["NaN", "", "-", "#N/A"])
def test_reading_without_coordinates_is_omitted_from_the_campaign(lab, run, nothing):
    """Readings are joined by order, so a missing reading must not shift the others."""
    lab.targets("A")
    body = list(points("A", "A;{x!r};{y!r};{z!r}"))
    body[6] = f"A;{nothing};{nothing};{nothing}"
    table = imported(lab, run, "\n".join(["name;x;y;z", *body]))
    assert (table["joined_by"], table["readings"]) == ("order", 12)
    assert "1 readings without coordinates" in table["left_out"][0]
    assert_exact(lab, 12)
    assert "p6" not in lab.table()["id"]


def test_repeated_reading_is_omitted_and_reported(lab, run):
    body = list(points(line=SPATIAL_ANALYZER))
    table = imported(lab, run, "\n".join([*body, body[4]]))
    assert table["readings"] == 39
    (line,) = table["left_out"]
    assert 'line 40 ("Main::p1::B"): this reading occurs twice' in line


def test_surplus_reading_is_reported_with_its_line(lab, run):
    """Readings are joined by order, so a repeated line would shift the others."""
    body = list(points("A", "{name} {x!r} {y!r} {z!r}"))
    lab.targets("A")
    line = refused(lab, run, "\n".join([*body[:6], body[5], *body[6:]]))
    assert 'found 14 readings of "A" for 13 commands' in line
    assert line.endswith("; line 7 repeats line 6")


def test_duplicate_commands_are_reported(lab, run):
    path = lab.folder / "commands.csv"
    text = path.read_text()
    path.write_text(text.replace("p5", "p3"))
    body = "\n".join(points(line=SPATIAL_ANALYZER))
    expected = 'line 7, id: found "p3", which is already the label of line 5'
    assert expected in refused(lab, run, body)
    path.write_text(text.replace("q.two", "q.one"))
    assert 'found column "q.one" twice' in refused(lab, run, body)


# -- wrong units and wrong axes -------------------------------------------------------


def changed(change):
    """Return an export with a change of every point, device axes."""
    return "\n".join(points(line=SPATIAL_ANALYZER, change=lambda k, n, p: change(p)))


@pytest.mark.parametrize(("factor", "words"), [
    (1 / 25.4, 'if multiplied by 25.4, probably because "in" was read as "mm"'),
    (25.4, 'if multiplied by 0.03937, probably because "mm" was read as "in"'),
    (1e-3, 'if multiplied by 1000, probably because "m" was read as "mm"'),
    (1 / 304.8, 'if multiplied by 304.8, probably because "ft" was read as "mm"'),
])  # fmt: skip
def test_wrong_unit_of_lengths_is_rejected_with_the_factor(lab, run, factor, words):
    line = refused(lab, run, changed(lambda p: factor * p))
    assert f"unit: the readings fit much better {words}" in line


@pytest.mark.parametrize("axis", range(3))
def test_left_handed_axes_are_rejected(lab, run, axis):
    mirror = np.ones(3)
    mirror[axis] = -1
    line = refused(lab, run, changed(lambda p: mirror * p))
    assert "the readings fit much better with one axis reversed" in line


@pytest.mark.parametrize(("change", "words"), [
    (lambda p: p * [1, -1, 1], "if y is the device's -y"),
    (lambda p: p[[1, 0, 2]], "if x is the device's y, y is the device's x"),
])  # fmt: skip
def test_wrong_axes_of_a_known_registration_are_reported(lab, run, change, words):
    """The registration of the device is known."""
    lab.targets(registration='"known"')

    def base(k, name, p):
        return change(TURN.apply(p) + SHIFT)

    line = refused(lab, run, "\n".join(points(line=SPATIAL_ANALYZER, change=base)))
    assert words in line


def test_targets_in_millimetres_are_rejected_with_the_factor(lab, run):
    text = (lab.folder / "smr.toml").read_text()
    head = text.split("[targets]")[0]
    places = [f"{n} = {[1e3 * x for x in at]}" for n, at in TARGETS.items()]
    (lab.folder / "smr.toml").write_text("\n".join([head, "[targets]", *places]))
    line = refused(lab, run, "\n".join(points(line=SPATIAL_ANALYZER)))
    assert 'as large as declared, probably because "mm" was read as "m"' in line


def moved_mount(k, name, p):
    """Return the position of a target, with target B moved by 60 mm."""
    turn = Rotation.from_euler("z", sum(ANGLES[k]))
    return p + (name == "B") * TURN.inv().apply(turn.apply([0, 0.06, 0]))


def no_target(k, name, p):
    return np.random.default_rng([k, ord(name)]).normal(0, 0.8, 3)


SHUFFLED = list(points("A", "{x!r} {y!r} {z!r}"))
REMARKS = {
    "other distances": ("ABC", points(line=SPATIAL_ANALYZER, change=moved_mount),
        "remark: the measured distance of A and B is 0.162 .. 0.162 m"),
    "other order": ("A", SHUFFLED[::2] + SHUFFLED[1::2],
        "check whether the readings are joined"),
    "no targets": ("ABC", points(line=SPATIAL_ANALYZER, change=no_target),
        "the distances between targets differ from row to row"),
}  # fmt: skip


@pytest.mark.parametrize("case", REMARKS)
def test_readings_that_do_not_match_targets_or_commands_are_reported(lab, run, case):
    names, lines, remark = REMARKS[case]
    lab.targets(names)
    lab.export("\n".join(lines))
    status, out, _ = run(*lab.words())
    assert status == 0
    assert remark in out


@pytest.mark.parametrize("piece", ["[", "(", " [", "0", "<body>"])
def test_very_long_cell_is_reported_with_its_line(lab, run, piece):
    lines = list(points(line=SPATIAL_ANALYZER))
    lines[1] += piece * 200_000 + "x"
    line = refused(lab, run, "\n".join(lines))
    assert "line 2: found a cell of" in line


# -- orientations ---------------------------------------------------------------------

MOUNT = Rotation.from_rotvec([0.3, 0.2, -0.5])  # rotation of the target on the platform


def oriented(k, error=(0, 0, 0)):
    """Return the rotation of the target in device axes, in closed form."""
    turned = Rotation.from_rotvec(error) * Rotation.from_euler("z", sum(ANGLES[k]))
    return TURN.inv() * turned * MOUNT


def oriented_rows(values, errors=((0, 0, 0),) * 13):
    """Yield rows with the position and orientation of target A."""
    for k, angles in enumerate(ANGLES):
        cells = [*(1e3 * seen(angles, "A")), *values(oriented(k, errors[k]))]
        yield ",".join(repr(float(x)) for x in cells)


ORIENTATIONS = {
    "quaternion": ("qw,qx,qy,qz", lambda R: np.roll(R.as_quat(), 1), {}),
    "ros": ("orientation.x,orientation.y,orientation.z,orientation.w",
            lambda R: R.as_quat(), {}),
    "motive": ("Rotation X,Rotation Y,Rotation Z,Rotation W",
               lambda R: R.as_quat(), {}),
    "numbered": ("q0,q1,q2,q3", lambda R: -np.roll(R.as_quat(), 1), {}),
    "moving": ("rx [deg],ry [deg],rz [deg]",
               lambda R: R.as_euler("ZYX", degrees=True)[::-1],
               {"orientation": '"ZYX"'}),
    "fixed": ("roll [deg],pitch [deg],yaw [deg]",
              lambda R: R.as_euler("xyz", degrees=True), {"orientation": '"xyz"'}),
    "kuka": ("A [deg],B [deg],C [deg]", lambda R: R.as_euler("ZYX", degrees=True),
             {"orientation": '"ZYX"'}),
    "vector": ("rx,ry,rz", lambda R: R.as_rotvec(),
               {"orientation": '"rotation_vector"', "angle_unit": '"rad"'}),
    "proper": ("rx [rad],ry [rad],rz [rad]", lambda R: R.as_euler("ZXZ"),
               {"orientation": '"ZXZ"'}),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:Gimbal")
@pytest.mark.parametrize("kind", ORIENTATIONS)
def test_target_orientations_are_converted_to_platform_rotations(lab, run, kind):
    """The rotation of the target on the platform is fitted."""
    head, values, keys = ORIENTATIONS[kind]
    lab.targets("A", noise_rotation=1e-4, **keys)
    text = "\n".join(["X,Y,Z," + head, *oriented_rows(values)])
    table = imported(lab, run, text)
    assert table["mounts"]["A"] == pytest.approx(MOUNT.as_rotvec(), abs=1e-9)
    campaign = read_campaign(lab.folder / "campaign")
    assert np.abs(campaign.measured[:, :3]).max() < 1e-9
    assert (campaign.sigma[:, :3] == 1e-4).all()


def test_rotation_errors_are_recovered_with_a_declared_mount(lab, run, rng):
    head, values, _ = ORIENTATIONS["quaternion"]
    lab.targets("A", noise_rotation=1e-4)
    with (lab.folder / "smr.toml").open("a") as file:
        file.write(f"[rotations]\nA = {MOUNT.as_rotvec().tolist()}\n")
    errors = 1e-4 * rng.normal(size=(13, 3))
    imported(lab, run, "\n".join(["X,Y,Z," + head, *oriented_rows(values, errors)]))
    rotations = read_campaign(lab.folder / "campaign").measured[:, :3]
    assert rotations == pytest.approx(errors, abs=1e-9)


@pytest.mark.parametrize(("head", "values", "keys", "message"), [
    ("rx [deg],ry [deg],rz [deg]", lambda R: [1, 2, 3], {},
     "found three angles, expected their order in the targets file"),
    ("rx,ry,rz", lambda R: [1, 2, 3], {"orientation": '"ZYX"'},
     "found no unit of angles"),
    ("qw,qx,qy,qz", lambda R: [1, 2, 3, 4], {}, "found a quaternion of norm 5.477"),
    ("qw,qx,qy,qz", lambda R: np.roll(R.inv().as_quat(), 1), {},
     "found inverted orientations"),
    ("qw,qx,qy,qz", lambda R: R.as_quat(), {},
     "found orientations that do not follow the commands"),
    ("rx [deg],ry [deg],rz [deg]", lambda R: R.as_euler("ZYX", degrees=True),
     {"orientation": '"XYZ"'}, "found orientations that do not follow the commands"),
    ("rx,ry,rz", lambda R: [1, 2, 3], {"orientation": '"zzx"'},
     "orientation: found"),
])  # fmt: skip
def test_ambiguous_orientations_are_rejected(lab, run, head, values, keys, message):
    lab.targets("A", noise_rotation=1e-4, **keys)
    text = "\n".join(["X,Y,Z," + head, *oriented_rows(values)])
    assert message in refused(lab, run, text)


def test_orientations_without_declared_noise_are_ignored(lab, run):
    head, values, _ = ORIENTATIONS["quaternion"]
    lab.targets("A")
    imported(lab, run, "\n".join(["X,Y,Z," + head, *oriented_rows(values)]))
    assert not [name for name in lab.table() if name.startswith("meas.r")]


def test_platform_rotation_equals_orientation_of_one_target(lab, run):
    """Each row contains a quaternion of A and points of B and C."""
    head = "A x,A y,A z,A qw,A qx,A qy,A qz,B x,B y,B z,C x,C y,C z"
    lab.targets(noise_rotation=1e-4)
    body = []
    for k, angles in enumerate(ANGLES):
        a, b, c = (1e3 * seen(angles, name) for name in "ABC")
        turn = np.roll(oriented(k).as_quat(), 1)
        body.append(",".join(repr(float(x)) for x in [*a, *turn, *b, *c]))
    imported(lab, run, "\n".join([head, *body]))
    campaign = read_campaign(lab.folder / "campaign")
    turned = np.isfinite(campaign.measured[:, :3]).all(axis=1)
    assert (turned.sum(), len(campaign)) == (13, 52)
    assert np.abs(campaign.measured[turned, :3]).max() < 1e-9


# -- cells and clocks ---------------------------------------------------------------


def test_binary_file_is_rejected(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(40) + b"name,x,y,z")
    with pytest.raises(BadInput, match="found the character NUL"):
        read_sheet(path)
