"""Test the diagnosis of readings in one configuration with varying temperatures."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.prediction import predicted
from forcefit.validation.diagnosis.results import table
from forcefit.validation.diagnosis.saving import corrected
from tests.campaigns_for_tests import table_rows

ROWS, STEP, SIGMA = 240, 60.0, 2e-6
BED, FRAME = 0.9e-6, -16e-6  # [m/K]
SLOW = 1.5e-6  # [m] standard deviation of noise with a correlation time of 10 min


def lagged(x, time_constant):
    """Return x with a first-order delay."""
    y = np.empty_like(x)
    y[0] = x[0]
    for i in range(1, len(x)):
        y[i] = y[i - 1] + (x[i] - y[i - 1]) * (1 - np.exp(-STEP / time_constant))
    return y


def diagnosed(tmp_path, read, covariates, sigma=SIGMA):
    """Diagnose the readings of a z axis at rest."""
    frames = Frame("z", joint="prismatic", actuated=True), Frame("nozzle", "z")
    write_robot(Robot("axis", "nozzle", frames), tmp_path / "robot.toml")
    (tmp_path / "campaign.toml").write_text(
        'robot = "robot.toml"\nmeasurements = "rows.csv"\nregistration = "known"\n'
        f"[noise]\nrotation = 1.0\nposition = {sigma}\n"
    )
    head = ",".join(["id", "q.z", "meas.tz", *(f"cov.{name}" for name in covariates)])
    lines = table_rows(np.column_stack([0 * read, read, *covariates.values()]))
    (tmp_path / "rows.csv").write_text("\n".join([head, *lines]) + "\n")
    return diagnose(read_campaign(tmp_path))


@pytest.fixture(scope="module")
def heated(tmp_path_factory):
    """Diagnosis of readings that depend on two temperatures, and the noise."""
    rng = np.random.default_rng(3)
    time = STEP * np.arange(ROWS)
    asked = np.select([time < 600, time < 5400, time < 9000], [0.0, 60.0, 20.0], 80.0)
    bed = lagged(asked, 300.0) + 0.05 * rng.normal(size=ROWS)
    chamber = lagged(0.3 * bed, 2500.0) + 0.05 * rng.normal(size=ROWS)
    frame = lagged(0.5 * chamber, 1500.0) + 0.03 * rng.normal(size=ROWS)
    slow = lagged(rng.normal(size=ROWS), 600.0)
    noise = SLOW * slow / slow.std() + SIGMA * rng.normal(size=ROWS)
    covariates = {"time": time, "bed": bed, "chamber": chamber, "frame": frame}
    folder = tmp_path_factory.mktemp("heated")
    read = BED * bed + FRAME * frame + noise
    return diagnosed(folder, read, covariates), noise


def test_dependence_on_temperatures_is_learned_as_polynomials(heated):
    """Correlated noise could be mistaken for splines or functions of time.

    The tolerance is five standard errors of the gain.  The noise is 2.5 um, and its
    correlation reduces 180 fitted rows to about 40 independent ones.
    """
    diagnosis, _ = heated
    functions = corrected(diagnosis).functions
    assert {v for one in functions for v in one.variables} == {"cov.bed", "cov.frame"}
    assert all(one.form == "powers" for one in functions)
    campaign = diagnosis.campaign
    warmer = campaign.covariates | {"bed": campaign.covariates["bed"] + 1.0}
    here, there = (
        predicted(replace(campaign, covariates=given), diagnosis.robot).deviation[:, 5]
        for given in (campaign.covariates, warmer)
    )
    value = np.mean(there - here)
    spread = 15.0  # [K] rms of the bed temperature that other variables do not explain
    assert value == pytest.approx(BED, abs=5 * 2.5e-6 / spread / np.sqrt(40))


def test_error_in_held_out_time_spans_is_near_the_noise(heated):
    """There are about 60 independent rows, so the tolerance is a factor of 1.5."""
    diagnosis, noise = heated
    kept = diagnosis.held.rows
    left = np.sqrt(np.mean(noise[kept] ** 2))
    assert diagnosis.before.position > 7 * left
    assert diagnosis.after.position < 1.5 * left


def test_function_is_learned_despite_many_outliers(tmp_path):
    """There are eleven outliers of decreasing size."""
    rng = np.random.default_rng(9)
    warm = np.sin(np.linspace(0, 20, 320))
    read = 80e-6 * warm**2 + 1e-6 * rng.normal(size=320)
    where = rng.choice(320, 11, replace=False)
    read[where] += 2e-2 * 0.62 ** np.arange(11)
    diagnosis = diagnosed(tmp_path, read, {"bed": warm}, sigma=1e-6)
    assert set(where.tolist()) <= set(np.flatnonzero(diagnosis.outliers).tolist())
    (learned,) = table(diagnosis)["learned"]
    assert learned["variables"] == ["cov.bed"]
    # Components that were not measured remain as declared.
    assert learned["components"] == ["tz"]
    assert diagnosis.after.normalised < 1 + 4 / np.sqrt(2 * 309)
