"""Examples with published measurements; tests are skipped if the data are missing.

The expected numbers are taken from the README of each data set or computed here.
"""

import csv
import os
import sys
import types
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from examples import campaign_folder, ipa_ur10
from examples.campaign_folder import DATA, base_pose, data_folder
from examples.hangprinter.convert import ANCHORS, LINES, cable_robot
from examples.hangprinter.convert import convert as convert_hangprinter
from examples.hilti.convert import convert as convert_hilti
from examples.ipa_ur10.convert import JOINTS, last_direction
from examples.ipa_ur10.convert import convert as convert_ipa
from examples.serial_robots.convert import convert as convert_serial
from examples.serial_robots.convert import find as find_serial
from examples.voron.convert import convert as convert_voron
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import place_many, place_robot
from forcefit.inputs.table import BadInput
from forcefit.stiffness.screws import rotation_vector, transform
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.correction.compensation import compensate


def needs(name):
    """Skip a test if a data set is missing; nothing is downloaded."""
    folder = Path(os.environ.get("FORCEFIT_DATA", DATA)) / name
    return pytest.mark.skipif(not folder.is_dir(), reason=f"{folder}: no such folder")


def test_missing_data_are_downloaded_with_their_checksums(tmp_path, monkeypatch):
    asked = {}

    def retrieve(url, known_hash, fname, path):
        asked[str(path / fname)] = url, known_hash
        path.mkdir(parents=True, exist_ok=True)

    pooch = types.SimpleNamespace(os_cache=lambda name: tmp_path, retrieve=retrieve)
    monkeypatch.setitem(sys.modules, "pooch", pooch)
    monkeypatch.delenv("FORCEFIT_DATA", raising=False)
    monkeypatch.setattr(campaign_folder, "DATA", tmp_path / "absent")
    folder = data_folder("ipa_ur10")
    assert folder == tmp_path / "ipa_ur10"
    url, checksum = asked[str(folder / "Series_A" / "measurements_grid.csv")]
    assert url.endswith("/Series_A/measurements_grid.csv")
    assert len(checksum.removeprefix("sha256:")) == 64
    assert len(asked) == 3


def test_missing_data_without_pooch_raise_an_error(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)  # makes ``import pooch`` fail
    monkeypatch.delenv("FORCEFIT_DATA", raising=False)
    monkeypatch.setattr(campaign_folder, "DATA", tmp_path)
    with pytest.raises(BadInput, match=r"expected the measured data .*pip install"):
        data_folder("ipa_ur10")


def test_base_pose_is_recovered_from_exact_positions(rng):
    """Kabsch's algorithm is exact for exact data."""
    turn = Rotation.random(9, rng=rng).as_matrix()
    T = transform(rng.normal(size=(9, 3)), turn)
    base = transform([1.0, 2.0, 3.0], Rotation.random(rng=rng).as_matrix())
    np.testing.assert_allclose(base_pose(T, base @ T), base, atol=1e-13)


def test_direction_of_motion_is_kept_during_rest():
    q = np.array([0.0, 0.0, 0.2, 0.2, 0.2001, -0.5, -0.5])
    assert last_direction(q).tolist() == [0, 0, 1, 1, 1, -1, -1]


def test_cable_lengths_equal_distances_to_the_anchors(rng):
    """The distances to the anchors equal the coordinates from the closure solver."""
    robot = cable_robot()
    points = rng.uniform([-0.7, -0.7, 0.0], [0.6, 0.7, 1.4], (8, 3))
    postures, reasons = place_many(robot, np.hstack([points, np.zeros((8, 3))]))
    assert not any(reasons)
    rows = [robot.index(f"{line}.line") for line in LINES]
    found = np.array([p.coordinates[rows] for p in postures])
    lengths = np.linalg.norm(points[:, None] - ANCHORS, axis=2)
    np.testing.assert_allclose(found, lengths, atol=1e-9)


# -- measured data --------------------------------------------------------------------


def spread(height):
    """Return the root mean square deviation from the mean."""
    return float(np.std(height))


@needs("voron_frame_expansion")
def test_voron_example_reproduces_the_published_spreads(tmp_path):
    """The README of the data gives 80 and 43 um for run a."""
    a = read_campaign(convert_voron(tmp_path)["run_a"])
    height, warm = a.measured[:, 5], a.covariates["temperature"]
    declared = -0.530 * 23.4e-6 * warm
    found = np.array([spread(height), spread(height + declared)])
    np.testing.assert_allclose(found * 1e6, [80, 43], rtol=0.01)


def test_hangprinter_data_have_41_samples(tmp_path):
    """The data are stored in the repository."""
    assert len(read_campaign(convert_hangprinter(tmp_path))) == 41


@needs("hilti_trailblazer")
def test_hilti_robot_has_the_known_mass_and_points(tmp_path):
    """The README gives 444 points; the mass is the sum of the masses in the URDF."""
    flat = read_campaign(convert_hilti(tmp_path)["flat"])
    assert len(flat) == 444
    total = sum(frame.mass for frame in flat.robot.frames)
    assert total == pytest.approx(530.73, abs=1e-3)
    assert np.abs(flat.covariates["column_ry"]).max() < 0.02  # [rad]


@pytest.mark.slow
@needs("ipa_ur10")
def test_ur10_series_have_the_known_numbers_of_poses(tmp_path):
    """The expected numbers of poses are given in the README of the data."""
    folders = convert_ipa(tmp_path)
    counts = {name: len(read_campaign(folder)) for name, folder in folders.items()}
    assert counts == {"A": 11911, "B": 1495}


def test_ur10_flange_equals_the_denavit_hartenberg_product():
    """The flange pose is compared with the product of the DH matrices."""
    folder = Path(ipa_ur10.__path__[0])
    robot = read_robot(folder / "ur10.toml")
    dh = (
        (0.1273, 0, np.pi / 2), (0, -0.612, 0), (0, -0.5723, 0),
        (0.163941, 0, np.pi / 2), (0.1157, 0, -np.pi / 2), (0.0922, 0, 0),
    )  # fmt: skip
    q = [0.3, -1.2, 0.8, -0.5, 1.1, 0.4]
    T = np.eye(4)
    for angle, (d, a, alpha) in zip(q, dh, strict=True):
        c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(alpha), np.sin(alpha)
        T = T @ [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s],
                 [0, sa, ca, d], [0, 0, 0, 1]]  # fmt: skip
    found = place_robot(robot, joints=dict(zip(JOINTS, q, strict=True))).platform
    np.testing.assert_allclose(found, T, atol=1e-12)


# -- two serial robots ----------------------------------------------------------------


def serial_table(path, q, length=0.031):
    """Write a table with one UR5 row, in which only the first joint angle q varies.

    Args:
        path: file to write.
        q: first joint angle [deg].
        length: distance of the reflector from the flange [m].
    """
    # at zero angles, the arm is straight along -x (drawing of the manufacturer)
    reach, height = 0.425 + 0.39225, 0.089159 - 0.09465
    aside = 0.10915 + 0.0823 + length
    x, y = -reach * np.cos(np.radians(q)), -reach * np.sin(np.radians(q))
    x, y = x + aside * np.sin(np.radians(q)), y - aside * np.cos(np.radians(q))
    names = [f"joint_{k}" for k in range(1, 7)]
    head = ["step_order", "x_t", "y_t", "z_t", "x_dif", "y_dif", "z_dif", *names]
    cells = [0, 1e3 * x, 1e3 * y, 1e3 * height, 2.0, -1.0, 0.5, q, 0, 0, 0, 0, 0]
    path.write_text(",".join(head) + "\n" + ",".join(map(str, cells)) + "\n")
    return path


@pytest.mark.parametrize("q", [0.0, 35.0])
def test_ur5_table_is_converted_to_a_campaign(q, tmp_path):
    folder = convert_serial(serial_table(tmp_path / "a.csv", q), tmp_path / "out")
    campaign = read_campaign(folder)
    assert campaign.ids == ("m0",)
    assert campaign.measured[0, 3:] == pytest.approx([2e-3, -1e-3, 5e-4])
    with pytest.raises(BadInput, match=r"targets differ by 0\.01 m"):
        convert_serial(serial_table(tmp_path / "b.csv", 0.0, 0.041), tmp_path / "b")


def test_serial_robot_table_is_found_by_path_or_by_name(tmp_path):
    (tmp_path / "serial_robots").mkdir()
    named = serial_table(tmp_path / "serial_robots" / "a.csv", 0.0)
    assert find_serial(named) == find_serial(Path("a.csv"), tmp_path) == named
    with pytest.raises(BadInput, match=r"b\.csv: no such file, nor .*expected a table"):
        find_serial(Path("b.csv"), tmp_path)


@needs("serial_robots")
def test_serial_robot_targets_equal_forward_kinematics(tmp_path):
    """The converter rejects targets with a deviation of more than 0.1 mm."""
    for path in data_folder("serial_robots").glob("*.csv"):
        campaign = read_campaign(convert_serial(path, tmp_path / path.stem))
        assert len(campaign) in {1000, 216}


def reached_by_the_file(path):
    """Return the targets and the measured positions in a file, each (R, 3) [m].

    The sign of the differences in the file is not documented.  The tracker writes six
    decimals [mm], which only target + difference or target - difference has.
    """
    with path.open(newline="", encoding="utf-8-sig") as lines:
        rows = list(csv.DictReader(lines))
    target, gap = (
        np.array([[Decimal(row[f"{k}_{kind}"]) for k in "xyz"] for row in rows])
        for kind in ("t", "dif")
    )

    def has_six_decimals(cells):
        return all(abs(x - round(x, 6)) < Decimal("1e-11") for x in cells.ravel())

    whole = [z for z in (target + gap, target - gap) if has_six_decimals(z)]
    assert len(whole) == 1
    return target.astype(float) / 1e3, whole[0].astype(float) / 1e3


@needs("serial_robots")
def test_target_plus_deviation_equals_measured_position(tmp_path):
    for path in data_folder("serial_robots").glob("*.csv"):
        campaign = read_campaign(convert_serial(path, tmp_path / path.stem))
        target, reached = reached_by_the_file(path)
        found = target + campaign.measured[:, 3:]
        np.testing.assert_allclose(found, reached, rtol=0, atol=1e-12)


@needs("serial_robots")
def test_compensation_halves_the_position_error(tmp_path):
    """Only the rigid displacement of the tracker frame is compensated.

    The deviation changes little over a few mm.  An arm commanded to c instead of the
    target therefore reaches c + deviation.  With a wrong sign, the error would double.
    """
    (path,) = data_folder("serial_robots").glob("*UR5*.csv")
    campaign = read_campaign(convert_serial(path, tmp_path / "ur5")).take(range(100))
    target, reached = (x[:100] for x in reached_by_the_file(path))
    nominal = campaign.transforms[:, campaign.robot.index("reflector")]
    read = transform(nominal[:, :3, 3] + campaign.measured[:, 3:], nominal[:, :3, :3])
    base = base_pose(nominal, read)
    screw = [*rotation_vector(base[:3, :3]), *base[:3, 3]]
    named = [f"base.{axis}" for axis in ("rx", "ry", "rz", "tx", "ty", "tz")]
    placed = {"registration": dict(zip(named, screw, strict=True))}
    robot = replace(campaign.robot, effects={**campaign.robot.effects, **placed})
    found = compensate(replace(campaign, robot=robot), as_read=True)
    commanded = found.transforms[:, robot.index("reflector"), :3, 3]
    before = np.linalg.norm(reached - target, axis=1)
    after = np.linalg.norm(commanded - target + reached - target, axis=1)
    assert after.mean() < before.mean() / 2
