"""Test diagnoses with noise that is common to the points of one measurement."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.robots import three_rrr
from forcefit.validation.campaign.campaign import number_rows
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.lack_of_fit import lack_of_fit
from forcefit.validation.diagnosis.results import table
from forcefit.validation.diagnosis.select import select
from forcefit.validation.diagnosis.whitening import independent
from forcefit.validation.multibody.simulation import without_clearance
from forcefit.validation.synthetic.design import CampaignDesign
from forcefit.validation.synthetic.machine import Hidden
from tests.bar_for_tests import BEAM, LONGER, along, bar, columns_of, machine
from tests.elastic_arm_for_tests import arm, with_errors
from tests.points_for_tests import DEVICE, MACHINE, TARGETS, simulated, write_points

VISITS = 60
DESIGN = CampaignDesign(
    configurations=64, rows=128, load=40.0, reach=0.6, reference_point=(0.02, 0, 0.03)
)


def three_points(visits=VISITS, **covariates):
    """Return a campaign in which three points of a bar are measured together."""
    rows = 3 * visits
    single = bar(link=BEAM, rows=visits, spread=6.0)
    measured = np.zeros((rows, 6))
    measured[:, :3] = np.nan
    names = np.tile(list(TARGETS), visits)
    labels = zip(np.repeat(np.arange(visits), 3), names, strict=True)
    return replace(
        single.take(np.repeat(np.arange(visits), 3)), point=names, points=TARGETS,
        ids=tuple(f"m{i}:{name}" for i, name in labels), measured=measured,
        sigma=np.full((rows, 6), DEVICE),
        covariates={name: np.repeat(x, 3) for name, x in covariates.items()},
    )  # fmt: skip


CAMPAIGN = three_points(time=60.0 * np.random.default_rng(0).permutation(VISITS))


@pytest.fixture(scope="module")
def columns():
    return columns_of(CAMPAIGN)


def moved(campaign, sizes, rng):
    """Return readings (R, 6) [m] of a random platform motion in each measurement."""
    turn, shift = (
        size * rng.normal(size=(len(campaign), 3))[campaign.measured_at_once]
        for size in sizes
    )
    centre = np.mean(list(TARGETS.values()), axis=0)
    place = campaign.transforms[:, 1, :3, :3]
    arm = np.einsum("rij,rj->ri", place, campaign.targets - centre)
    return np.hstack([np.zeros(arm.shape), shift + np.cross(turn, arm)])


def found(columns, readings, seed, device=DEVICE):
    rng = np.random.default_rng([seed, 1])
    noise = device * rng.normal(size=readings.shape)
    z = ((readings + noise) / CAMPAIGN.sigma)[CAMPAIGN.cells]
    return select(columns, z, np.ones(len(z), dtype=bool))


# Small device noise means that nearly all noise is common to the points.
@pytest.mark.parametrize(("device", "sizes"), [
    (DEVICE, (2e-4, 2e-5)), (DEVICE, (0.0, 0.0)),
    pytest.param(0.1 * DEVICE, (5e-5, 5e-6), marks=pytest.mark.slow),
    pytest.param(DEVICE, (0.0, 2e-5), marks=pytest.mark.slow),
    pytest.param(DEVICE, (3e-4, 0.0), marks=pytest.mark.slow),
    pytest.param(0.1 * DEVICE, (0.0, 5e-6), marks=pytest.mark.slow),
])  # fmt: skip
def test_common_noise_is_identified_with_its_standard_deviations(
    columns, device, sizes
):
    """The standard error from 60 measurements is about 5 %."""
    rng = np.random.default_rng([7, 1])
    selected = found(columns, moved(CAMPAIGN, sizes, rng), 7, device)
    assert selected.hypotheses == selected.functions == ()
    for seen, true in zip(selected.noise.common, sizes, strict=True):
        assert seen == pytest.approx(true, rel=0.25)
    # The prior of tau has the weight of 20 of the 540 cells.
    assert device / DEVICE - 0.2 < selected.noise.tau < device / DEVICE + 0.25
    told = [s for s in selected.noise.findings if "common to the points" in s]
    assert len(told) == any(sizes)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_length_error_is_identified_despite_common_noise(columns, seed):
    """Its uncertainty follows from the mean of 60 measurements."""
    true = 2e-5
    rng = np.random.default_rng([seed, 2])
    readings = moved(CAMPAIGN, (0.0, 2e-5), rng)
    readings[:, 3:] += true * np.repeat(along(bar(rows=VISITS, spread=6.0)), 3, axis=0)
    selected = found(columns, readings, seed)
    assert [h.effect for h in selected.hypotheses] == ["link_length"]
    std = np.sqrt((2e-5**2 + DEVICE**2 / 3) / VISITS)
    assert selected.values[0] == pytest.approx(true, abs=3.5 * std)


def test_variance_of_a_length_includes_common_noise():
    """For common noise c of three points, it is (c^2 + sigma^2 / 3) / measurements."""
    c = 3 * DEVICE
    common = np.zeros((len(CAMPAIGN), 6, 3))
    common[:, 3:] = c * np.eye(3)
    fit = machine(replace(CAMPAIGN, common=common), LONGER)
    expected = (c**2 + DEVICE**2 / 3) / VISITS
    assert fit.covariance[0, 0] == pytest.approx(expected, rel=1e-3)
    alone = machine(CAMPAIGN, LONGER)
    assert alone.covariance[0, 0] == pytest.approx(DEVICE**2 / 3 / VISITS, rel=1e-3)


@pytest.mark.parametrize("repeats", [True, False])
def test_motion_that_repeats_with_the_command_is_lack_of_fit(repeats):
    """A platform motion that differs between repeats is noise."""
    rng = np.random.default_rng(3)
    campaign = three_points(80)
    visit = campaign.measured_at_once
    point = np.unique(campaign.point, return_inverse=True)[1]
    campaign = replace(campaign, repeat=number_rows(visit // 2, point))
    drawn = rng.normal(size=(80, 3))
    motion = 4 * DEVICE * drawn[visit // 2 * 2 if repeats else visit]
    residual = DEVICE * rng.normal(size=(240, 6))
    residual[:, 3:] += motion
    common = np.zeros((240, 6, 3))
    common[:, 3:] = 4 * DEVICE * np.eye(3)
    campaign = replace(campaign, common=common)
    lack = lack_of_fit(campaign, independent(campaign, residual), 0)
    assert lack.significant == repeats


# The following tests diagnose machines that were simulated with another program.


def diagnosed(robot, wanted, seed, folder):
    made = simulated(robot, wanted, DESIGN, seed, MACHINE[3])
    return made, diagnose(write_points(made, folder / "campaign", seed))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_poor_repeatability_is_not_reported_as_an_effect(seed, tmp_path):
    robot = with_errors(arm()) if seed % 2 else without_clearance(three_rrr())
    _, diagnosis = diagnosed(robot, {}, seed, tmp_path)
    assert diagnosis.verdict == "none_needed"
    assert diagnosis.claimed == ()
    assert not diagnosis.fit.unknowns.functions
    sizes = table(diagnosis)["noise_scale"]["common"]
    # The standard errors are about 4 %.
    assert sizes["rotation"] == pytest.approx(MACHINE[0], rel=0.2)
    assert sizes["translation"] == pytest.approx(MACHINE[3], rel=0.2)
    assert "noise common to the points of a row" in diagnosis.summary()
    assert diagnosis.after.position == pytest.approx(diagnosis.noise.position, rel=0.2)


@pytest.mark.slow
def test_confidence_intervals_include_the_true_value_despite_common_noise(tmp_path):
    """At least 8 of 12 intervals with a confidence of 90 % include the true value."""
    covers, hidden = 0, [(Hidden("encoder_offset", {"j2": 1e-4}), 5.0)]
    for seed in range(12):
        made, diagnosis = diagnosed(
            with_errors(arm()), hidden, 50 + seed, tmp_path / str(seed)
        )
        (true,) = made.effects
        assert diagnosis.claimed == ("encoder_offset",)
        assert not diagnosis.fit.unknowns.functions
        (one,) = table(diagnosis)["effects"][0]["parameters"]
        assert one["name"] == "j2"
        low, high = one["interval_90"]
        covers += low < true.parameters["j2"] < high
    assert covers >= 8
