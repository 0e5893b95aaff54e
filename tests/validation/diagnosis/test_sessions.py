"""Test diagnoses of campaigns with several sessions."""

import re

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.inputs.errors import BadInput
from forcefit.validation.campaign.campaign_file import read_campaign, read_commands
from forcefit.validation.correction.prediction import predict
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.results import table
from forcefit.validation.diagnosis.saving import save
from forcefit.validation.synthetic.design import CampaignDesign, plan_campaign
from forcefit.validation.synthetic.effects import SCREW
from forcefit.validation.synthetic.machine import Hidden, simulate_readings
from tests.campaigns_for_tests import fitted_numbers, table_rows, write_campaign
from tests.elastic_arm_for_tests import arm, with_errors

SIGMA = np.repeat([1e-5, 5e-6], 3)
DESIGN = CampaignDesign(configurations=32, rows=56, load=40.0, reach=0.8)
SPRING = 5e4  # [N m/rad] stiffness in series with the declared drive
ZEROS = {"monday": {"j2": 3e-4, "j3": -2e-4}, "tuesday": {"j2": -2e-4, "j3": 2.5e-4}}
TOOLS = {"monday": [2e-4, 0.0, -1e-4], "tuesday": [-1e-4, 2e-4, 0.0]}
FRAMES = {"monday": [0.3, -0.2, 0.5, 1.2, -0.4, 0.7], "tuesday": [0, 0, 1, 2, 0, 0]}


def registration(session, *, placed):
    """Return the tool error of a session and, if ``placed``, the pose of the device."""
    numbers = {f"tool.{k}": v for k, v in zip(SCREW[3:], TOOLS[session], strict=True)}
    if placed:
        base = zip(SCREW, FRAMES[session], strict=True)
        numbers |= {f"base.{k}": float(v) for k, v in base}
    return Hidden("registration", numbers)


def measured(folder, hidden, common=(), known=True):
    """Write a campaign of an arm with effects of each session and common effects."""
    folder.mkdir(exist_ok=True)
    robot, body, head = with_errors(arm()), [], None
    for number, (session, own) in enumerate(hidden.items()):
        rng = np.random.default_rng(70 + number)
        plan = plan_campaign(robot, DESIGN, rng)
        read = simulate_readings(
            robot, np.zeros(3), plan.rows, [*common, *own], "springs"
        )
        read = read + SIGMA * rng.normal(size=read.shape)
        head = ["id", *plan.columns, "session", "load.fx", "load.fy", "load.fz"]
        head += [f"meas.{k}" for k in SCREW] + ["cov.time", "cov.temperature"]
        for i, row in enumerate(plan.rows):
            cells = [f"{session}{i}", *plan.commands[i].tolist(), session]
            cells += [*row.load[3:].tolist(), *read[i].tolist()]
            cells += [row.covariates["time"], row.covariates["temperature"]]
            body.append(",".join(map(str, cells)))
    write_robot(robot, folder / "declared.toml")
    noise = f"[noise]\nrotation = {SIGMA[0]}\nposition = {SIGMA[5]}\n"
    return write_campaign(
        folder / "days", ",".join(head), body,
        robot=(folder / "declared.toml").read_text(), noise=noise,
        toml={"registration": '"known"' if known else '"unknown"'},
    )  # fmt: skip


def assert_near(found, name, truth, session=None, most=np.inf):
    """Check that parameters are within four standard deviations of the truth."""
    told = fitted_numbers(found["effects"], name, session)
    for key, true in truth.items():
        value, std = told[key]
        assert abs(value - true) < 4 * std
        assert std < most
    return told


@pytest.mark.slow
@pytest.mark.parametrize("known", [True, False])
def test_encoder_offsets_and_tool_errors_are_identified_per_session(known, tmp_path):
    """A spring that is common to all sessions is also identified."""
    spring = Hidden("drive_compliance", {"j2": SPRING})
    hidden = {
        s: [Hidden("encoder_offset", ZEROS[s]), registration(s, placed=not known)]
        for s in ZEROS
    }
    folder = measured(tmp_path, hidden, [spring], known)
    diagnosis = diagnose(read_campaign(folder))
    found = table(diagnosis)
    assert found["verdict"] == "explained"
    assert set(diagnosis.claimed) == {
        "drive_compliance", "encoder_offset", "registration",
    }  # fmt: skip
    assert_near(found, "drive_compliance", {"j2": SPRING})
    for session, zeros in ZEROS.items():
        assert_near(found, "encoder_offset", zeros, session, 2e-5)
        true = dict(zip(("tool.tx", "tool.ty", "tool.tz"), TOOLS[session], strict=True))
        tool = assert_near(found, "registration", true, session, 2e-5)
        assert all(name.startswith("tool.") for name in tool)
    assert found["error"]["after"]["normalised"] < 1.1
    save(diagnosis, tmp_path / "found.toml")
    robot = read_robot(tmp_path / "found.toml")
    assert set(robot.session_effects) == set(ZEROS)
    again = predict(read_commands(folder, robot))
    assert again.error.normalised == pytest.approx(
        found["error"]["saved"]["normalised"]
    )


@pytest.mark.slow
def test_common_effect_is_reported_without_a_session(tmp_path):
    """The encoder offsets are equal in both sessions."""
    zeros = Hidden("encoder_offset", ZEROS["monday"])
    folder = measured(tmp_path, {"monday": [], "tuesday": []}, [zeros])
    diagnosis = diagnose(read_campaign(folder))
    assert diagnosis.claimed == ("encoder_offset",)
    assert diagnosis.robot.session_effects == {}
    assert_near(table(diagnosis), "encoder_offset", ZEROS["monday"])


@pytest.mark.slow
def test_different_drifts_are_identified_per_session(tmp_path):
    """The time constants are 900 s and 2000 s."""
    drifts = {
        "monday": {"amplitude.tx": 8e-5, "amplitude.ry": 1e-4, "time_constant": 900.0},
        "tuesday": {
            "amplitude.tz": -6e-5, "amplitude.ry": -1.5e-4, "time_constant": 2000.0,
        },
    }  # fmt: skip
    hidden = {s: [Hidden("drift", own)] for s, own in drifts.items()}
    folder = measured(tmp_path, hidden)
    diagnosis = diagnose(read_campaign(folder))
    assert diagnosis.claimed == ("drift",)
    for session, own in drifts.items():
        told = assert_near(table(diagnosis), "drift", own, session)
        assert all(told[name][1] < 0.3 * abs(true) for name, true in own.items())
    assert diagnosis.after.normalised < 1.1


@pytest.mark.slow
def test_per_session_key_allows_a_different_load_gain_per_session(tmp_path):
    """The load gains are 1.1 and 0.92."""
    gains = {"monday": 1.1, "tuesday": 0.92}
    hidden = {s: [Hidden("load_gain", {"factor": g})] for s, g in gains.items()}
    folder = measured(tmp_path, hidden)
    file = folder / "campaign.toml"
    file.write_text('per_session = ["load_gain"]\n' + file.read_text())
    diagnosis = diagnose(read_campaign(folder))
    assert diagnosis.claimed == ("load_gain",)
    for session, gain in gains.items():
        assert_near(table(diagnosis), "load_gain", {"factor": gain}, session, 0.01)


@pytest.mark.parametrize(("given", "message"), [
    ('["load_gian"]', 'can differ between sessions; did you mean "load_gain"'),
    ('["modulus_scale"]', "found 'modulus_scale', expected an effect that can differ"),
    ('"load_gain"', "per_session: found"),
    ("[3]", "found 3, expected an effect"),
])  # fmt: skip
def test_invalid_per_session_effect_is_rejected(given, message, tmp_path):
    folder = write_campaign(tmp_path / "days", toml={"per_session": given})
    with pytest.raises(BadInput, match=re.escape(message)):
        read_campaign(folder)


def in_two_tables(folder, shift):
    """Write a campaign of two tables, each with a different covariate."""
    rng = np.random.default_rng(3)
    days = {"dry": "temperature", "wet": "humidity"}
    tables = '["dry.csv", "wet.csv"]'
    folder = write_campaign(folder, toml={"measurements": tables}, noise=(
        f"[noise]\nrotation = {SIGMA[0]}\nposition = {SIGMA[5]}\n"))  # fmt: skip
    for day, name in days.items():
        q, x = rng.uniform(-1, 1, (60, 2)), rng.uniform(0, 10, 60)
        read = SIGMA[5] * rng.normal(size=(60, 3))
        read[:, 2] += shift * x if name == "humidity" else 0.0
        lines = [f"id,q.one,q.two,meas.tx,meas.ty,meas.tz,cov.{name}"]
        lines += table_rows(np.column_stack([q, read, x]))
        (folder / f"{day}.csv").write_text("\n".join(lines) + "\n")
    return folder


def test_learned_function_acts_only_in_sessions_with_its_covariate(tmp_path):
    """The reading changes by 20 um per unit of humidity."""
    folder = in_two_tables(tmp_path / "days", 2e-5)
    diagnosis = diagnose(read_campaign(folder))
    assert diagnosis.verdict == "learned"
    (one,) = table(diagnosis)["learned"]
    assert one["variables"] == ["cov.humidity"]
    save(diagnosis, tmp_path / "found.toml")
    robot = read_robot(tmp_path / "found.toml")
    assert [f.session for f in robot.functions] == ["wet"]
    assert diagnosis.after.normalised < 1.2
    again = predict(read_commands(folder, robot))
    assert again.error.normalised == pytest.approx(diagnosis.saved.normalised)


def test_irrelevant_covariate_of_one_table_is_ignored(tmp_path):
    campaign = read_campaign(in_two_tables(tmp_path / "days", 0.0))
    assert set(campaign.partial) == {"temperature", "humidity"}
    assert campaign.covariates == {}
    assert np.isnan(campaign.partial["humidity"]).sum() == 60
    assert diagnose(campaign).verdict == "none_needed"
