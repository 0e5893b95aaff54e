"""Tests of predicted readings and their names."""

from math import cos, sin

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.robots import load_robot
from forcefit.validation.campaign.campaign_file import read_commands
from forcefit.validation.correction.prediction import predict
from tests.campaigns_for_tests import ARM, read_table, table_rows, write_campaign

WAVE = """
[[effect]]
name = "function"
where = "one"
components = ["rz"]
variables = ["q.one"]
form = "waves"
parameters = { "1.sine" = 1e-3 }
"""


def robot_file(tmp_path, text=ARM + WAVE):
    path = tmp_path / "corrected.toml"
    path.write_text(text)
    return str(path)


def test_predict_reads_a_table_of_commands(tmp_path, run):
    """The first joint has an additional rotation a sin q."""
    table = tmp_path / "new.csv"
    table.write_text("id,q.one,q.two\na,0.3,0.0\nb,-0.4,0.5\n")
    out = tmp_path / "readings.csv"
    code, _, error = run("validation", "predict", robot_file(tmp_path), str(table),
                         "-o", str(out))  # fmt: skip
    assert (code, error) == (0, "")
    rows = read_table(out)
    assert [row["id"] for row in rows] == ["a", "b"]
    assert list(rows[0]) == [
        "id",
        *(f"meas.{c}" for c in ("rx", "ry", "rz", "tx", "ty", "tz")),
    ]
    for row, q1, q2 in zip(rows, (0.3, -0.4), (0.0, 0.5), strict=True):
        turn = 1e-3 * sin(q1)
        x, y = cos(q1) + 0.8 * cos(q1 + q2), sin(q1) + 0.8 * sin(q1 + q2)
        found = [float(row[f"meas.{name}"]) for name in ("rz", "tx", "ty")]
        # the translation is exact to first order
        assert found == pytest.approx([turn, -turn * y, turn * x], abs=2e-7)


def test_prediction_table_has_measured_and_predicted_readings(tmp_path):
    """The first joint has an additional rotation a sin q."""
    pytest.importorskip("xarray")
    folder = write_campaign(tmp_path / "campaign")
    commands = read_commands(folder, load_robot(robot_file(tmp_path)))
    table = predict(commands).to_pandas()
    q = table.index.map({"m1": 0.1, "m2": 0.3, "m3": 0.1, "m4": 0.1})
    np.testing.assert_allclose(table["predicted", "RZ"], 1e-3 * np.sin(q), rtol=1e-6)
    np.testing.assert_array_equal(table["reading"], commands.measured)


def test_predicted_readings_have_the_names_of_the_campaign(tmp_path, run):
    head = "id,q.one,q.two,meas.A.tx,meas.B.ty"
    folder = write_campaign(
        tmp_path / "c", head, ["m1,0.1,0.2,1e-4,2e-4", "m2,0.4,0.2,0,"],
        extra="[points]\nA = [0.1, 0, 0]\nB = [0, 0.2, 0]\n",
    )  # fmt: skip
    out = tmp_path / "readings.csv"
    code, text, _ = run("validation", "predict", robot_file(tmp_path), str(folder),
                        "-o", str(out))  # fmt: skip
    assert code == 0
    assert "rms of measured minus predicted" in text
    rows = read_table(out)
    assert list(rows[0]) == ["id", "meas.A.tx", "meas.B.ty"]
    # The distance of point A from the tool frame is 0.1 m along the tool.
    turn, angle = 1e-3 * sin(0.1), 0.3
    y = sin(0.1) + 0.8 * sin(angle) + 0.1 * sin(angle)
    assert float(rows[0]["meas.A.tx"]) == pytest.approx(-turn * y, abs=2e-8)
    x = cos(0.1) + 0.8 * cos(angle) - 0.2 * sin(angle)
    assert float(rows[0]["meas.B.ty"]) == pytest.approx(turn * x, abs=2e-8)
    assert rows[1]["meas.B.ty"] == ""


def test_predict_rejects_a_missing_covariate(tmp_path, rejected):
    humid = ARM + WAVE.replace('"q.one"', '"cov.humidity"').replace(
        "1.sine", "1"
    ).replace("waves", "powers")
    table = tmp_path / "new.csv"
    table.write_text("id,q.one,q.two\na,0.3,0.0\n")
    out = tmp_path / "readings.csv"
    robot = robot_file(tmp_path, humid)
    error = rejected("validation", "predict", robot, table, "-o", out)
    assert "expected a column cov.humidity" in error
    assert not out.exists()


def test_each_session_is_registered_separately(tmp_path):
    """The tracker is relocated in each session."""
    robot = load_robot("arm6")
    write_robot(robot, tmp_path / "robot.toml")
    rng = np.random.default_rng(1)
    q = rng.uniform(-1, 1, (16, 6))
    names = [f.name for f in robot.frames if f.actuated]
    head = ",".join(["id", *(f"q.{n}" for n in names)])
    shift = np.array([[0.3, -0.2, 0.1], [-1.0, 0.5, 0.0]])[np.arange(16) % 2]
    rows = table_rows(np.hstack([q, shift]))
    measured = [f"{row},{'ab'[i % 2]}" for i, row in enumerate(rows)]
    folder = write_campaign(
        tmp_path / "days", f"{head},meas.tx,meas.ty,meas.tz,session", measured,
        robot=(tmp_path / "robot.toml").read_text(),
        toml={"registration": '"unknown"'},
    )  # fmt: skip
    found = predict(read_commands(folder, robot))
    assert found.error.position < 1e-9
