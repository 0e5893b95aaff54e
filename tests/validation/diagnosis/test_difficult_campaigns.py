"""Test diagnoses of difficult campaigns of machines with known errors."""

from dataclasses import replace
from functools import cache

import pytest

from examples.campaign_folder import DATA
from forcefit.assembly.files.robot_file import read_robot
from forcefit.validation.campaign.campaign_file import read_campaign, read_commands
from forcefit.validation.correction.prediction import predict
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.results import table
from forcefit.validation.diagnosis.saving import save

CASES = DATA.parent / "cases" / "campaigns"
PRACTICE = DATA / "practice"
FOLDERS = [CASES / name for name in (
    "ax_cum", "crash_singular", "crash_sizes", "declared_effect", "fb_gear", "fb_wear",
    "few_8", "hx_play", "hyst", "points_in_one_go", "zonly",
)] + [PRACTICE / name for name in (
    "p02_self_weight", "p04_drive_compliance_encoder_offset", "p05_outside",
)]  # fmt: skip


@pytest.fixture(scope="module")
def diagnosed():
    """Return a function that diagnoses each campaign and caches the result."""

    @cache
    def find(folder):
        if not folder.is_dir():
            pytest.skip(f"{folder} is not there")
        return diagnose(read_campaign(folder))

    return find


def effect(found, name):
    """Return the parameters of an effect by name."""
    (one,) = [e for e in table(found)["effects"] if e["name"] == name]
    return {p["name"]: p for p in one["parameters"]}


@pytest.mark.slow
@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_saved_robot_predicts_with_the_reported_error(folder, diagnosed, tmp_path):
    found = diagnosed(folder)
    if not found.better:
        assert found.verdict != "explained"
        return
    save(found, tmp_path / "robot.toml")
    data = read_commands(folder, read_robot(tmp_path / "robot.toml"))
    told = predict(replace(data, registration="known").take(~found.outliers))
    assert told.error.normalised == pytest.approx(found.saved.normalised, rel=1e-4)
    assert found.after.normalised < found.before.normalised
    assert found.sequence[-1].error.normalised == found.after.normalised


@pytest.mark.slow
def test_wrong_declared_expansion_of_a_printer_is_corrected(diagnosed, tmp_path):
    """The declared coefficient is 23.4e-6 per kelvin, and the true one is 12e-6."""
    found = diagnosed(CASES / "declared_effect")
    assert (found.verdict, found.claimed) == ("explained", ("thermal_expansion",))
    one = effect(found, "thermal_expansion")["frame"]
    assert abs(one["value"] - 12e-6) < 4 * one["std"] < 1e-6
    assert one["found"]["declared"] == 23.4e-6
    save(found, tmp_path / "robot.toml")
    saved = read_robot(tmp_path / "robot.toml").effects["thermal_expansion"]
    assert saved["frame"] == pytest.approx(one["value"])


@pytest.mark.slow
def test_clearance_in_a_leg_is_identified(diagnosed):
    found = diagnosed(CASES / "hx_play")
    assert (found.verdict, found.claimed) == ("explained", ("joint_clearance",))
    springs = table(found)["springs"] or {"parameters": []}
    assert all(p["value"] >= 0.0 for p in springs["parameters"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fb_wear", "fb_gear"])
def test_effects_outside_the_library_are_learned_as_functions(name, diagnosed):
    """The length of a rod increases with time, or a gear has harmonic errors."""
    found = diagnosed(CASES / name)
    assert (found.verdict, found.claimed) == ("learned", ())
    assert found.after.normalised < 1.2


@pytest.mark.slow
def test_scatter_of_repeats_is_not_reported_as_drift(diagnosed):
    """The machine has hysteresis."""
    found = diagnosed(CASES / "hyst")
    assert not set(found.claimed) & {"drift", "encoder_eccentricity"}
