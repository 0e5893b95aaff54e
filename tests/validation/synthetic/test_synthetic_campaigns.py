"""Tests of plans, strengths, files and equivalent effects of synthetic campaigns."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import Posture, place_many_joints
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.robots import load_robot
from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import plain
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.multibody.simulation import without_clearance
from forcefit.validation.synthetic.design import (
    CampaignDesign,
    plan_campaign,
    varied_for,
)
from forcefit.validation.synthetic.draws import SLIDING, NotApplicable, draw_effect
from forcefit.validation.synthetic.effects import LIBRARY, Row
from forcefit.validation.synthetic.equivalents import alternatives
from forcefit.validation.synthetic.generator import (
    Noise,
    generate_campaign,
    write_campaign,
)
from forcefit.validation.synthetic.machine import Hidden, simulate_readings
from forcefit.validation.synthetic.outside import OUTSIDE
from forcefit.validation.synthetic.truth import truth_of
from tests.campaigns_for_tests import read_table
from tests.elastic_arm_for_tests import SPRING, TUBE

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
TRUTH = json.loads((CAMPAIGNS / "truth.json").read_text(encoding="utf-8"))
SMALL = CampaignDesign(configurations=8, rows=40, load=20.0)


def two_axes(spring=SPRING):
    """Return an arm with two perpendicular joints."""
    rng = np.random.default_rng(1)
    frames = (
        Frame("j1", joint="revolute", actuated=True, joint_stiffness=spring),
        Frame("j2", "j1", [0.3, 0, 0.1], [np.pi / 2, 0, 0], joint="revolute",
              actuated=True, joint_stiffness=spring, link=TUBE),
        Frame("tool", "j2", [0.25, 0.1, 0], link=TUBE, mass=0.5),
    )  # fmt: skip
    errors = rng.uniform(-1, 1, (3, 6)) * np.repeat([1e-4, 5e-5], 3)
    return Robot("two_axes", "tool", frames).with_errors(errors)


def sliding():
    """Return a rotating arm on a slide."""
    slide = Frame("slide", joint="prismatic", actuated=True)
    first, *others = two_axes().frames
    on_it = replace(first, parent="slide", rotation=np.array([0, 1.0, 0]))
    return Robot("sliding", "tool", (slide, on_it, *others))


def quick(wanted, robot=None, **given):
    design = given.pop("design", SMALL)
    robot = robot or two_axes()
    return generate_campaign(robot, wanted, design, program="springs", **given)


def test_plan_contains_repeated_loads_and_zero_loads():
    """Each pass visits every configuration once."""
    plan = plan_campaign(two_axes(), SMALL, np.random.default_rng(0))
    passes = plan.configuration.reshape(5, 8)
    assert all(sorted(p) == list(range(8)) for p in passes.tolist())
    loads = np.array([row.load for row in plan.rows])
    conditions = np.column_stack([plan.configuration, loads])
    assert len(np.unique(conditions, axis=0)) < len(loads)
    assert (np.abs(loads).max(axis=1) == 0).any()
    assert np.linalg.norm(loads[:, 3:], axis=1).max() <= 20.0 + 1e-3
    assert all(np.diff([row.covariates["time"] for row in plan.rows]) > 0)
    assert {row.covariates["approach"] for row in plan.rows} == {-1.0, 1.0}


@pytest.mark.parametrize("name", [*LIBRARY, *OUTSIDE])
def test_every_simulated_effect_has_the_requested_strength(name):
    design = varied_for(SMALL, [name])
    robot = sliding() if name in SLIDING else two_axes()
    campaign = quick({name: 5.0}, robot, design=design, seed=4)
    assert campaign.strength[name] == pytest.approx(5.0, rel=0.05)


@pytest.mark.parametrize("seed", range(3))
def test_effect_that_is_invisible_in_the_readings_is_drawn_again(seed):
    """Forces at a point on the wrist axis do not load the wrist spring."""
    arm = two_axes()
    wrist = Frame("j3", "tool", joint="revolute", actuated=True, joint_stiffness=SPRING)
    robot = Robot("wristed", "j3", (*arm.frames, wrist))
    alone = [(Hidden("drive_compliance", {"j3": 5e4}), 5.0)]
    with pytest.raises(NotApplicable, match="drive_compliance"):
        quick(alone, robot, seed=seed)
    campaign = quick({"drive_compliance": 5.0}, robot, seed=seed)
    assert campaign.strength["drive_compliance"] == pytest.approx(5.0, rel=0.05)
    assert set(campaign.effects[0].parameters) & {"j1", "j2"}


def test_simulated_noise_has_the_requested_standard_deviation():
    """The tolerance is three standard deviations of the rms of 1440 readings."""
    design = replace(SMALL, rows=240)
    campaign = quick({}, design=design, noise=Noise(3e-5, 2e-6), seed=2)
    noise = (campaign.readings - campaign.exact) / np.repeat([3e-5, 2e-6], 3)
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(1.0, abs=0.06)
    assert np.abs(campaign.added).max() == 0.0


def test_contributions_of_two_effects_add_up_to_first_order():
    both = quick({"encoder_offset": 5.0, "thermal_expansion": 5.0}, seed=3)
    alone = sum(
        quick([(effect, both.strength[effect.name])], seed=3).added
        for effect in both.effects
    )
    np.testing.assert_allclose(both.added, alone, rtol=0, atol=5e-8)


@pytest.mark.exudyn
@pytest.mark.parametrize("name", ["3rrr", "hexapod", "arm6"])
def test_multibody_and_spring_programs_agree(name):
    """Bending between the ends of beams changes the readings to second order."""
    rng = np.random.default_rng(5)
    robot = without_clearance(load_robot(name))
    robot = robot.with_errors(5e-5 * rng.uniform(-1, 1, (len(robot.frames), 6)))
    design = CampaignDesign(configurations=2, rows=2, reach=0.1, load=20.0)
    rows = plan_campaign(robot, design, rng).rows
    drives = {f.name: 2e-5 for f in robot.frames if f.actuated}
    effects = [Hidden("encoder_offset", drives), Hidden("self_weight", {"g.z": -9.81})]
    point = np.array([0.0, 0.02, 0.01])
    beams = simulate_readings(robot, point, rows, effects)
    springs = simulate_readings(robot, point, rows, effects, "springs")
    assert np.abs(beams).max() > 5e-5
    np.testing.assert_allclose(springs, beams, rtol=0, atol=5e-8)


@pytest.mark.parametrize("name", ["3rrr", "hexapod", "arm6"])
def test_spring_program_agrees_with_the_exact_equilibrium(name):
    """Both programs use finite motions and a load that moves with the platform."""
    rng = np.random.default_rng(6)
    robot = without_clearance(load_robot(name))
    robot = robot.with_errors(2e-3 * rng.uniform(-1, 1, (len(robot.frames), 6)))
    design = CampaignDesign(configurations=3, rows=3, reach=0.1, load=80.0)
    rows = plan_campaign(robot, design, rng).rows
    point = np.array([0.03, 0.05, 0.02])
    springs = simulate_readings(robot, point, rows, (), "springs")
    commands = [
        [row.coordinates[f.name] if f.actuated else np.nan for f in robot.frames]
        for row in rows
    ]
    placed, _ = place_many_joints(robot, commands)
    postures = Posture(
        robot, np.array([p.coordinates for p in placed]),
        np.array([p.transforms for p in placed]), 0.0,
    )  # fmt: skip
    linear = as_declared(postures, np.array([row.load for row in rows]), point=point)
    exact = predict(replace(linear, exact=True)).deviation
    assert np.abs(exact - predict(linear).deviation).max() > 1e-5
    np.testing.assert_allclose(springs, exact, rtol=0, atol=2e-9)


def test_written_campaign_does_not_contain_the_hidden_effects(tmp_path):
    noise = Noise(missing=0.05, outliers=2, hidden_frame=1e-3)
    design = replace(SMALL, reference_point=(0, 0, 0.1))
    campaign = quick({"drift": 5.0}, design=design, seed=7, noise=noise)
    write_campaign(campaign, tmp_path / "c")
    texts = [p.read_text() for p in (tmp_path / "c").iterdir()]
    assert len(texts) == 3
    assert not any("drift" in text or "amplitude" in text for text in texts)
    table = tomllib.loads((tmp_path / "c" / "campaign.toml").read_text())
    assert table["registration"] == "unknown"
    assert table["noise"] == {"rotation": 1e-5, "position": 5e-6}
    rows = read_table(tmp_path / "c" / "measurements.csv")
    assert len(rows) == 40
    missing = sum(row["meas.tx"] == "" for row in rows)
    assert missing == np.isnan(campaign.readings[:, 3]).sum()
    robot = read_robot(tmp_path / "c" / "robot.toml")
    np.testing.assert_array_equal(robot.errors, campaign.robot.errors)
    read = read_campaign(tmp_path / "c")
    np.testing.assert_allclose(read.measured, campaign.readings, rtol=1e-8, atol=0)
    expected = [list(row.coordinates.values()) for row in campaign.plan.rows]
    np.testing.assert_allclose(read.coordinates, expected, rtol=0, atol=1e-9)
    with pytest.raises(BadInput, match="expected a new folder"):
        write_campaign(campaign, tmp_path / "c")


def test_campaign_of_commanded_poses_is_read_unchanged(tmp_path):
    robot = without_clearance(load_robot("hexapod"))
    design = CampaignDesign(configurations=3, rows=3, reach=0.1, command="pose")
    campaign = quick({}, robot, design=design)
    write_campaign(campaign, tmp_path / "c")
    read = read_campaign(tmp_path / "c")
    names = [frame.name for frame in robot.frames]
    own = [names.index(f"leg{k}.strut") for k in range(1, 7)]
    expected = [list(row.coordinates.values()) for row in campaign.plan.rows]
    readings = read.coordinates[:, own]
    np.testing.assert_allclose(readings, np.array(expected)[:, own], rtol=0, atol=1e-9)


def test_truth_of_a_campaign_contains_effects_and_verdict():
    campaign = quick({"drive_compliance": 5.0, "link_length": 3.0}, seed=1)
    truth = json.loads(json.dumps(plain(truth_of(campaign))))
    assert truth["verdict"] == "explained"
    assert truth["accept_effects"] == [["drive_compliance", "link_length"]]
    drive = truth["effects"][0]
    assert drive["where"] == [p["frame"] for p in drive["parameters"]]
    assert {p["unit"] for p in drive["parameters"]} == {"N·m/rad"}
    total = np.hypot(*truth["contribution_rms"].values())
    assert truth["normalised_before"] == pytest.approx(np.hypot(total, 1), rel=0.2)
    assert truth["normalised_perfect"] == pytest.approx(1.0, abs=0.2)
    assert truth_of(quick({}))["verdict"] == "none_needed"
    outside = truth_of(quick({"_sag": 5.0}))
    assert outside["verdict"] == "outside_library"
    assert outside["accept_effects"] == [[]]


@pytest.mark.parametrize("name", sorted(TRUTH))
def test_residuals_of_stored_campaigns_equal_their_truth_files(name):
    """The stored campaigns were simulated in Exudyn.

    The rms residuals with and without the hidden effects equal those in the truth file.
    """
    truth, campaign = TRUTH[name], read_campaign(CAMPAIGNS / name)
    names = [frame.name for frame in campaign.robot.frames]
    rows = [
        Row(
            dict(zip(names, campaign.coordinates[i].tolist(), strict=True)),
            campaign.loads[i],
            {k: float(v[i]) for k, v in campaign.covariates.items()},
        )
        for i in range(len(campaign))
    ]
    hidden = [
        Hidden(e["name"], {p["name"]: p["value"] for p in e["parameters"]})
        for e in truth["effects"]
    ]
    for effects, key in ((hidden, "normalised_perfect"), ((), "normalised_before")):
        readings = simulate_readings(
            campaign.robot, campaign.reference_point, rows, effects, "springs"
        )
        rms = np.sqrt(np.mean(((campaign.measured - readings) / campaign.sigma) ** 2))
        assert rms == pytest.approx(truth[key], rel=1e-3)


def left(campaign):
    """Return the residual chi-square of each effect.

    The hidden effects contribute about 6000.  Second-order effects are below 0.1.
    """
    return {one.names[0]: one.residual for one in alternatives(campaign)}


def test_expansion_equals_length_error_only_at_constant_temperature():
    hidden = [(Hidden("thermal_expansion", {"tool": 2e-5}), 5.0)]
    steady = left(quick(hidden, design=replace(SMALL, temperature="constant")))
    assert steady["thermal_expansion"] < 0.1
    assert steady["link_length"] < 0.1
    swinging = left(quick(hidden))
    assert swinging["thermal_expansion"] < 0.1
    assert swinging["link_length"] > 100


def test_softer_links_equal_a_larger_load_only_with_rigid_joints():
    rigid = left(quick({"load_gain": 5.0}, two_axes(spring=None), seed=2))
    assert rigid["modulus_scale"] < 0.1
    elastic = left(quick({"load_gain": 5.0}, seed=2))
    assert elastic["modulus_scale"] > 100


# one effect of each kind: weight, spring, geometry, reading and nonlinear joint
QUICK = ("self_weight", "drive_compliance", "encoder_offset", "registration",
         "friction_hysteresis", "contact_stiffening", "thermal_expansion")  # fmt: skip


@pytest.mark.parametrize(
    "name",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow)
     for name in LIBRARY if name not in ("joint_clearance", "geometric_stiffening")],
)  # fmt: skip
def test_simulated_effect_has_the_smallest_residual(name):
    design = varied_for(SMALL, [name])
    readings = alternatives(quick({name: 5.0}, design=design, seed=6))
    own = min(one.residual for one in readings if one.names[0].startswith(name))
    curved = "drift", "contact_stiffening", "delayed_expansion"
    bound = 60.0 if name in curved else 1.0
    assert own < bound  # the readings are nonlinear in these parameters
    assert own <= min(one.residual for one in readings) + 1.0


def test_effect_that_does_not_apply_to_the_robot_is_rejected():
    rng = np.random.default_rng(0)
    with pytest.raises(NotApplicable):
        draw_effect("friction_hysteresis", two_axes(spring=None), 1.0, rng)
    # the loads are too small for a visible deflection
    away = CampaignDesign(configurations=8, rows=40, load=1e-3)
    with pytest.raises(NotApplicable, match="hardly changes the readings"):
        quick({"drive_compliance": 5.0}, design=away)
    with pytest.raises(BadInput, match='found "gravity"') as caught:
        draw_effect("gravity", two_axes(), 1.0, rng)
    assert "self_weight" in str(caught.value)
    # names of effects outside the library are not listed
    assert " _" not in str(caught.value)
    with pytest.raises(BadInput, match="configurations"):
        CampaignDesign(configurations=5, rows=4)
    with pytest.raises(BadInput, match="temperature"):
        CampaignDesign(temperature="warm")


def test_generate_writes_a_campaign_and_its_truth_to_a_new_folder(
    run, rejected, tmp_path
):
    words = ["validation", "generate", "arm6", tmp_path / "c", "--truth",
             tmp_path / "t.json", "--effect", "drift=2", "--rows", 6,
             "--configurations", 3, "--program", "springs"]  # fmt: skip
    assert run(*words)[0] == 0
    truth = json.loads((tmp_path / "t.json").read_text())["c"]
    assert truth["contribution_rms"]["drift"] == pytest.approx(2.0, rel=0.05)
    assert "expected a new folder" in rejected(*words)
