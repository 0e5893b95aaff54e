"""Tests of fitting a saved robot to a new session."""

import json
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.function import Function
from forcefit.assembly.robots import load_robot
from forcefit.stiffness.screws import rotation_matrix, rotation_vector
from forcefit.validation.campaign.campaign_file import read_campaign, read_commands
from forcefit.validation.correction.prediction import predict
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.saving import corrected
from forcefit.validation.multibody.simulation import without_clearance
from tests.campaigns_for_tests import table_rows, write_campaign

SIGMA = 2e-5
HOUR = 3600.0
DEVICE = np.array([0.3, -0.2, 0.5, 1.2, -0.4, 0.7])


@pytest.fixture(name="machine")
def a_machine(tmp_path):
    """Write robot files of an arm, declared without and saved with errors."""
    declared = load_robot("arm6")
    rng = np.random.default_rng(5)
    errors = rng.normal(size=(len(declared.frames), 6)) * 3e-4
    write_robot(declared, tmp_path / "declared.toml")
    write_robot(declared.with_errors(errors), tmp_path / "saved.toml")
    return tmp_path


def measured(folder, rows, reach, sessions=None, zero=0.0, wave=None):
    """Write a campaign that is measured by a relocated device with noise.

    A wave (sine, cosine) [m] along x has a period of one hour.
    """
    rng = np.random.default_rng(rows)
    saved = load_robot(folder / "saved.toml")
    names = [f.name for f in saved.frames if f.actuated]
    q = np.array([f.position for f in saved.frames if f.actuated])
    q = q + reach * rng.uniform(-1, 1, (rows, len(q)))
    head = ",".join(["id", *(f"q.{n}" for n in names)])
    lines = table_rows(q, first=1)
    (folder / "plain.csv").write_text("\n".join([head, *lines]) + "\n")
    offset = {"encoder_offset": {names[0]: zero}}
    commands = read_commands(folder / "plain.csv", replace(saved, effects=offset))
    found = predict(commands).prediction.deviation
    nominal = commands.transforms[:, saved.index(saved.platform), :3, 3]
    R = rotation_matrix(DEVICE[:3])
    read = (nominal + found[:, 3:]) @ R.T + DEVICE[3:] - nominal
    read += SIGMA * rng.normal(size=read.shape)
    if wave is not None:
        time = HOUR / rows * np.arange(rows)
        turn = 2 * np.pi * time / HOUR
        read[:, 0] += wave[0] * np.sin(turn) + wave[1] * np.cos(turn)
        head += ",cov.time"
        lines = [f"{line},{t!r}" for line, t in zip(lines, time.tolist(), strict=True)]
    cells = [[*map(repr, r.tolist())] for r in read]
    days = sessions or [""] * rows
    head += (",session" if sessions else "") + ",meas.tx,meas.ty,meas.tz"
    body = [
        ",".join([line, *([day] if sessions else []), *row])
        for line, day, row in zip(lines, days, cells, strict=True)
    ]
    return write_campaign(
        folder / "day", head, body, robot=(folder / "declared.toml").read_text(),
        toml={"registration": '"unknown"'}, noise=f"[noise]\nposition = {SIGMA}\n",
    )  # fmt: skip


def with_a_wave(machine, sine, cosine):
    """Add a slow wave of another day to the saved robot file."""
    numbers = {"sine": sine, "cosine": cosine, "period": HOUR}
    wave = Function("reading", ("tx",), ("time",), "slow_wave", numbers)
    saved = load_robot(machine / "saved.toml")
    write_robot(replace(saved, functions=(wave,)), machine / "saved.toml")


def carried(run, machine, folder, *words):
    saved, out = str(machine / "saved.toml"), machine / "carried.toml"
    file = machine / "answer.json"
    code, text, error = run("validation", "carry", saved, str(folder), "-o", str(out),
                            "--json", str(file), *words)  # fmt: skip
    assert error == ""
    return code, text, json.loads(file.read_text())["sessions"], out


def test_robot_fitted_to_few_rows_predicts_a_new_session(machine, run):
    folder = measured(machine, 60, 0.8)
    code, _, (day,), out = carried(run, machine, folder, "--setup", "12")
    assert code == 0
    assert day["suffices"]
    assert (day["setup_rows"], day["other_rows"]) == (12, 48)
    # noise and uncertainty of the device frame, fitted to 36 readings
    assert 0.9 < day["error"]["normalised"] < 1.3
    assert day["declared"]["normalised"] > 5
    found = {p["name"]: (p["value"], p["std"]) for p in day["parameters"]}
    turn = rotation_vector(rotation_matrix(DEVICE[:3]))
    for k, axis in enumerate("xyz"):
        value, std = found[f"base.r{axis}"]
        assert abs(value - turn[k]) < 5 * std
    # The saved file predicts the session without another fit.
    again = predict(read_commands(folder, load_robot(out)))
    assert again.error.position < 1.3 * SIGMA


def test_set_up_rows_at_a_single_position_are_insufficient(machine, run):
    """Forty rows within a milliradian do not determine the rotation of the device."""
    wide = measured(machine, 60, 0.8)
    text = (wide / "measurements.csv").read_text().splitlines()
    folder = measured(machine, 40, 1e-3)
    near = (folder / "measurements.csv").read_text().splitlines()
    more = [line.replace("m", "w", 1) for line in text[1:]]
    (folder / "measurements.csv").write_text("\n".join([*near, *more]) + "\n")
    code, said, (day,), out = carried(run, machine, folder, "--setup", "40")
    assert code == 1
    assert not out.exists()
    assert not day["suffices"]
    assert "are not sufficient" in said
    assert day["uncertainty"] > 10 * day["left_in_setup"]


def test_saved_robot_predicts_its_own_sessions(machine, run):
    """The device is relocated in each session."""
    tight = without_clearance(load_robot(machine / "declared.toml"))
    zeros = {f.name: 5e-4 for f in tight.frames if f.actuated}
    write_robot(tight, machine / "declared.toml")
    hidden = replace(tight, effects={"encoder_offset": zeros})
    write_robot(hidden, machine / "saved.toml")
    folder = measured(machine, 60, 0.8, ["a", "b"] * 30)
    write_robot(corrected(diagnose(read_campaign(folder))), machine / "found.toml")
    again = read_commands(folder, load_robot(machine / "found.toml"))
    error = predict(replace(again, registration="known")).error
    assert 0.8 < error.normalised < 1.1


def test_robot_is_fitted_to_each_session_separately(machine, run):
    folder = measured(machine, 60, 0.8, ["a", "b"] * 30)
    code, _, days, out = carried(run, machine, folder, "--setup", "10")
    assert code == 0
    assert [(d["session"], d["setup_rows"]) for d in days] == [("a", 10), ("b", 10)]
    assert set(load_robot(out).session_effects) == {"a", "b"}


def test_drift_of_an_earlier_session_is_not_used_without_times(machine, run):
    """The drift of another day is about 15 sigma."""
    folder = measured(machine, 60, 0.8)
    with_a_wave(machine, 3e-4, 1e-4)
    code, said, (day,), out = carried(run, machine, folder, "--setup", "12")
    assert code == 0
    assert day["left_behind"] == ["reading tx of time"]
    assert "effect of an earlier session that is not used: reading tx of tim" in said
    assert 0.9 < day["error"]["normalised"] < 1.3
    assert load_robot(out).functions == ()


def test_drift_is_fitted_to_set_up_rows(machine, run):
    """The set-up rows are every fourth row of the session."""
    folder = measured(machine, 80, 0.8, wave=(-2e-4, 1e-4))
    with_a_wave(machine, 3e-4, 1e-4)
    rows = ",".join(map(str, range(1, 81, 4)))
    code, _, (day,), out = carried(run, machine, folder, "--setup", rows)
    assert code == 0
    assert 0.9 < day["error"]["normalised"] < 1.3
    numbers = {p["name"]: p for p in day["parameters"] if "time" in p["effect"]}
    for name, true in (("sine", -2e-4), ("cosine", 1e-4)):
        value, std = numbers[name]["value"], numbers[name]["std"]
        assert abs(value - true) < 4 * std
        assert 0.2 * SIGMA < std < SIGMA
    (written,) = load_robot(out).functions
    assert written.parameters["sine"] == pytest.approx(numbers["sine"]["value"])


def test_set_up_rows_of_the_first_minutes_are_insufficient_for_drift(machine, run):
    """The prior standard deviation of the drift is 2e-4 m."""
    folder = measured(machine, 60, 0.8, wave=(0.0, 0.0))
    with_a_wave(machine, 2e-4, 2e-4)
    code, said, (day,), _ = carried(run, machine, folder, "--setup", "10")
    assert code == 1
    assert {"sine", "cosine"} & set(day["open"])
    assert 3e-5 < day["uncertainty"] < 3e-4
    assert "are not sufficient" in said


@pytest.mark.parametrize(("words", "message"), [
    (["--setup", "x1"], 'found "x1", expected a row'),
    (["--setup", "1-99"], 'found "1-99", expected rows 1 to 6'),
    (["--setup", "0"], "found no set-up rows"),
    (["--setup", "6"], "found only set-up rows"),
    (["--setup", "3", "--fit", "zero"], '--fit: found "zero"; did you mean "zeros"'),
])  # fmt: skip
def test_invalid_set_up_rows_are_rejected(words, message, machine, rejected):
    folder = measured(machine, 6, 0.8)
    error = rejected("validation", "carry", machine / "saved.toml", folder, *words)
    assert message in error
    assert "\n" not in error


def test_rows_that_do_not_determine_the_registration_are_rejected(machine, rejected):
    """The rows contain one reading each."""
    folder = measured(machine, 6, 0.8)
    file = folder / "campaign.toml"
    file.write_text(file.read_text().replace('"unknown"', '"known"'))
    table = folder / "measurements.csv"
    head, *rows = table.read_text().splitlines()
    lines = [row.rsplit(",", 3)[0] + ",1e-4" for row in rows]
    table.write_text("\n".join([head.rsplit(",", 2)[0], *lines]) + "\n")
    saved = machine / "saved.toml"
    error = rejected("validation", "carry", saved, folder, "--setup", "3")
    assert "found a fit of the registration" in error
    assert error.endswith("or --fit zeros")
