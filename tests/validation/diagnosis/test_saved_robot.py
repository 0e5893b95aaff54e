"""Test the robots that a diagnosis saves."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.inputs.writing import plain
from forcefit.validation.correction.prediction import predict
from forcefit.validation.diagnosis import diagnose as module
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.fit import fit_machine
from forcefit.validation.diagnosis.prediction import predicted, residual_of
from forcefit.validation.diagnosis.results import table
from forcefit.validation.diagnosis.saving import save
from forcefit.validation.diagnosis.sequence import errors_of
from tests.elastic_arm_for_tests import arm, commanded
from tests.planar_arm_for_tests import SIGMA

ERRORS = np.random.default_rng(3).normal(size=(4, 6)) * np.repeat([4e-4, 2e-4], 3)
ROWS = 72  # number of configurations, sufficient for a single split


def machine():
    """Return the true machine, with errors of all frames and an encoder offset."""
    return arm(encoder_offset={"j3": 2e-3}).with_errors(ERRORS)


def read(campaign, seed=5):
    """Return the campaign with noisy readings of the true machine."""
    noise = SIGMA * np.random.default_rng(seed).normal(size=(len(campaign), 6))
    seen = predicted(replace(campaign, robot=machine())).deviation + noise
    return replace(campaign, measured=seen)


@pytest.fixture(scope="module")
def found():
    return diagnose(read(commanded(arm(), ROWS)))


@pytest.fixture(scope="module")
def saved(found, tmp_path_factory):
    path = tmp_path_factory.mktemp("saved") / "robot.toml"
    found.save(path)
    return read_robot(path)


def test_saved_robot_predicts_with_the_reported_error(found, saved):
    """The robot file has ten digits, and outliers are omitted."""
    again = predict(replace(found.campaign, robot=saved).take(~found.outliers))
    printed = asdict(found.saved)
    assert asdict(again.error) == pytest.approx(printed, rel=1e-6)
    written = json.loads(json.dumps(plain(table(found))))
    assert written["error"]["saved"] == pytest.approx(printed)


def test_residuals_in_the_table_have_the_reported_rms(found):
    """Outliers are omitted."""
    pytest.importorskip("xarray")
    table = found.to_pandas()
    kept = table[~table["outlier", ""].astype(bool)]
    shift = kept["residual_after"][["TX", "TY", "TZ"]].to_numpy()
    rms = np.sqrt(np.nanmean(shift**2))
    assert rms == pytest.approx(found.saved.position, rel=1e-9)
    assert table["held_out", ""].sum() == found.held.rows.sum()


def test_held_out_error_is_that_of_a_fit_to_other_rows(found):
    """The same unknowns are fitted again without the held-out rows."""
    assert found.held.how == "split"
    used = ~found.held.rows & ~found.outliers
    blind = np.where(found.held.rows[:, None], np.nan, found.campaign.measured)
    believed = replace(found.traced.campaign, measured=blind)
    fit = fit_machine(believed, found.fit.unknowns, used)
    left = residual_of(found.campaign, fit.robot)
    error = errors_of(found.campaign, left, found.held.rows & ~found.outliers)
    assert error.normalised == pytest.approx(found.after.normalised, rel=2e-3)
    assert found.before.normalised > 20
    # The tolerance is due to the noise of 18 rows and the uncertainty of the fit.
    assert 0.75 < found.after.normalised < 1.35


def test_saved_robot_is_fitted_to_all_rows(found, saved):
    rows = ~found.outliers
    assert saved.diagnosis["rows_fitted"] == rows.sum() == found.fitted.sum()
    assert len(found.fit.residual) == 6 * rows.sum()
    best = fit_machine(found.campaign, found.fit.unknowns, rows, found.fit.x)
    squares = np.sum(found.fit.residual**2) * found.traced.selected.noise.tau**2
    assert squares == pytest.approx(best.residual @ best.residual, rel=1e-3)


@pytest.mark.parametrize("change", ["noise", "anything"])
def test_held_out_readings_affect_only_errors_and_verdict(found, change):
    """They are not used to select effects, functions or unknowns."""
    rng = np.random.default_rng(8)
    held, readings = found.held.rows, found.campaign.measured.copy()
    size = SIGMA if change == "noise" else 1e-2
    readings[held] += size * rng.normal(size=(held.sum(), 6))
    again = diagnose(replace(found.campaign, measured=readings))
    assert np.array_equal(again.held.rows, held)
    assert again.probability == found.probability
    assert again.alternatives == found.alternatives
    assert again.effects == found.effects
    acting = [[e.hypothesis for e in one.fit.effects] for one in (again, found)]
    assert acting[0] == acting[1]
    assert np.array_equal(again.fit.unknowns.std, found.fit.unknowns.std)
    assert again.noise_scale == found.noise_scale
    assert again.after.normalised > 1.2 * found.after.normalised
    if change == "anything":
        assert again.verdict == "outside_library"
        assert not again.claimed


def test_saved_robot_contains_the_measured_point(found, saved):
    """A prediction for another point reports the measured point."""
    point = tuple(found.campaign.reference_point.tolist())
    assert saved.reference_point == pytest.approx(point)
    same = predict(replace(found.campaign, robot=saved)).table()
    assert same["identified_at"] is None
    other = replace(found.campaign, robot=saved, reference_point=np.zeros(3))
    told = predict(other).table()
    assert told["identified_at"] == pytest.approx(list(point))
    assert told["reference_point"] == [0.0, 0.0, 0.0]


def test_prediction_uses_the_reference_point_of_the_robot(found, tmp_path, run):
    """The table contains two rows, and the readings are predicted by the command."""
    save(found, tmp_path / "robot.toml")
    campaign = found.campaign.take(np.arange(2))
    names = ("mx", "my", "mz", "fx", "fy", "fz")
    head = ["id", "q.j1", "q.j2", "q.j3", *(f"load.{n}" for n in names)]
    head += ["cov.temperature", "cov.time", "cov.approach"]
    lines = [",".join(head)]
    for k in range(2):
        cells = [*campaign.coordinates[k, :3], *campaign.loads[k]]
        cells += [v[k] for v in campaign.covariates.values()]
        lines.append(",".join([f"a{k}", *(repr(float(c)) for c in cells)]))
    (tmp_path / "new.csv").write_text("\n".join(lines) + "\n")
    out, answer = tmp_path / "out.csv", tmp_path / "out.json"
    code, _, error = run("validation", "predict", tmp_path / "robot.toml",
                         tmp_path / "new.csv", "-o", out, "--json", answer)  # fmt: skip
    assert (code, error) == (0, "")
    told = json.loads(answer.read_text())
    point = found.campaign.reference_point.tolist()
    assert told["reference_point"] == pytest.approx(point)
    head, *rows = [line.split(",") for line in out.read_text().splitlines()]
    at = [head.index(f"meas.{c}") for c in ("rx", "ry", "rz", "tx", "ty", "tz")]
    expected = predicted(campaign, found.robot).deviation
    for row, values in zip(rows, expected, strict=True):
        read = [float(row[k]) for k in at]
        assert read == pytest.approx(values, rel=1e-6, abs=1e-10)
    assert {f"std.{c}" for c in ("rx", "tz")} <= set(head)


def test_90_per_cent_of_new_readings_are_in_predicted_intervals(found, saved):
    """The intervals include the uncertainty of the parameters and the noise.

    The tolerance is five standard errors of 0.011 for 720 readings.
    """
    fresh = read(commanded(saved, 120, seed=11, reach=1.4), seed=12)
    told = predict(fresh)
    left = fresh.measured - told.prediction.deviation
    total = np.hypot(told.spread, told.noise)
    inside = np.mean(np.abs(left) < 1.645 * total)
    assert 0.845 < inside < 0.955
    assert told.spread.max() > 0.1 * SIGMA.min()


def test_predictions_of_unmeasured_components_are_uncertain(tmp_path):
    """Only tz is measured."""
    seen = read(commanded(arm(), 24))
    blind = seen.measured.copy()
    blind[:, :5] = np.nan
    found = diagnose(replace(seen, measured=blind))
    save(found, tmp_path / "robot.toml")
    robot = read_robot(tmp_path / "robot.toml")
    assert robot.diagnosis["not_measured"] == ["rx", "ry", "rz", "tx", "ty"]
    assert table(found)["not_measured"] == ["rx", "ry", "rz", "tx", "ty"]
    fresh = read(commanded(robot, 30, seed=11, reach=1.4), seed=12)
    told = predict(fresh)
    left = fresh.measured - told.prediction.deviation
    # The predictions of tx and ty are uncertain.
    assert np.median(told.spread[:, 3:5]) > 3 * SIGMA[3]
    inside = np.abs(left) < 2.6 * np.hypot(told.spread, told.noise)
    assert np.mean(inside[:, 3:]) > 0.9
    # Summaries over all rows include only the measured component.
    std = told.table()["std"]
    assert std["position"] == pytest.approx(np.sqrt(np.mean(told.spread[:, 5] ** 2)))
    assert np.isnan(std["rotation"])


def test_robot_with_larger_held_out_error_is_not_saved(
    found, tmp_path, run, monkeypatch
):
    """The exit status is 1 for any verdict."""
    folder = tmp_path / "campaign"
    folder.mkdir()
    worse = replace(found, after=found.before, before=found.after, verdict="learned")
    monkeypatch.setattr(
        "forcefit.validation.campaign.campaign_file.read_campaign",
        lambda path: found.campaign,
    )
    for one, code, verdict in ((worse, 1, "learned"), (found, 0, "outside_library")):
        one = replace(one, verdict=verdict)
        monkeypatch.setattr(module, "diagnose", lambda *given, _one=one, **more: _one)
        status, _, err = run("validation", "diagnose", folder, "--save",
                             tmp_path / "robot.toml")  # fmt: skip
        assert status == code, err
        assert (tmp_path / "robot.toml").exists() == (code == 0)
        if code:
            assert "predicts the held-out rows no better than the declared" in err
