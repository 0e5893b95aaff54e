"""Effects that a robot's file declares with wrong numbers: the machine's are saved."""

import json
from dataclasses import replace

import numpy as np
import pytest

from assembly.effects import LIBRARY
from assembly.files.robot_file import read_robot
from assembly.kinematics.posture import place_robot
from assembly.model.robot import BeamLink, Frame, Robot
from forcefit.inputs.writing import plain
from tests.planar_arm_for_tests import SIGMA, measured
from validation.campaign.campaign import Campaign
from validation.diagnosis.diagnose import diagnose
from validation.diagnosis.fit import fit_machine
from validation.diagnosis.hypotheses import hypotheses, with_declared
from validation.diagnosis.prediction import predicted
from validation.diagnosis.results import table
from validation.diagnosis.saving import save
from validation.diagnosis.signatures import conditions_of
from validation.diagnosis.unknowns import Acting, Unknowns

SPRING = np.diag([np.inf, np.inf, 5e4, np.inf, np.inf, np.inf])
TUBE = BeamLink({"radius": 0.03, "inner_radius": 0.025}, 70e9, 0.33, density=2700.0)
LOADS = ("mx", "my", "mz", "fx", "fy", "fz")
ROWS = 12
# declared, and what the machine has
WRONG = {
    "self_weight": ({"g.z": -5.0}, {"g.x": 1.0, "g.y": 0.5, "g.z": -9.81}),
    "thermal_expansion": ({"j2": 2.34e-5}, {"j2": 1.2e-5}),
    "drive_compliance": ({"j2": 9e4}, {"j2": 3e4}),
    "encoder_offset": ({"j2": 2e-4}, {"j2": -3e-4}),
    "encoder_eccentricity": (
        {"j2.amplitude": 2e-4, "j2.phase": 0.4},
        {"j2.amplitude": 3e-4, "j2.phase": 2.9},
    ),
    "link_length": ({"tool": 1e-4}, {"tool": -5e-5}),
    "registration": (
        {"base.rx": 0.03, "base.ty": 1e-3, "tool.tx": 1e-4},
        {"base.rx": -0.02, "base.ry": 1e-3, "base.rz": 0.01, "base.tx": 1e-3,
         "base.ty": -1e-3, "base.tz": 2e-3, "tool.tx": -1e-4, "tool.ty": 2e-4,
         "tool.tz": 1e-4},
    ),
    "modulus_scale": ({"j2": 0.8}, {"j2": 0.64}),
    "joint_clearance": ({"j2.radial": 1e-5}, {"j2.radial": 3e-5}),
    "friction_hysteresis": ({"j2": 2.0}, {"j2": 5.0}),
    "contact_stiffening": (
        {"j1.coefficient": 1e8, "j1.exponent": 1.5},
        {"j1.coefficient": 1e8, "j1.exponent": 1.5, "j2.coefficient": 5e7,
         "j2.exponent": 1.5},
    ),
    "load_gain": (
        {"factor": 1.2},
        {"factor": 0.9, **{f"offset.{k}": 0.1 * (i + 1) for i, k in enumerate(LOADS)}},
    ),
    "drift": (
        {"amplitude.tz": 1e-4, "time_constant": 300.0},
        {**{f"amplitude.{a}{b}": 3e-5 for a in "rt" for b in "xyz"},
         "time_constant": 300.0},
    ),
    "base_compliance": (
        {f"stiffness.{a}{b}": 1e6 for a in "rt" for b in "xyz"},
        {f"stiffness.{a}{b}": 4e5 for a in "rt" for b in "xyz"},
    ),
}  # fmt: skip


def arm(**effects):
    """Three elastic drives, none parallel to the next, and two tubes."""
    turning = {"joint": "revolute", "actuated": True, "joint_stiffness": SPRING}
    robot = Robot("arm", "tool", (
        Frame("j1", **turning),
        Frame("j2", "j1", [0.1, 0, 0.3], [np.pi / 2, 0, 0.3], link=TUBE, **turning),
        Frame("j3", "j2", [0.35, 0.1, 0], [0, np.pi / 3, 0], link=TUBE, **turning),
        Frame("tool", "j3", [0.3, 0.05, 0.1], link=TUBE, mass=0.8),
    ))  # fmt: skip
    return replace(robot, effects=effects)


def commanded(robot):
    """Rows of the arm, all around, loaded, while it warms; read without noise."""
    rng = np.random.default_rng(2)
    q = rng.uniform(-1.5, 1.5, (ROWS, 3))
    bare = robot.without_effects()
    placed = [place_robot(bare, joints=dict(zip(("j1", "j2", "j3"), row, strict=True)))
              for row in q]  # fmt: skip
    loads = rng.normal(size=(ROWS, 6)) * np.repeat([2.0, 30.0], 3)
    return Campaign(
        name="arm", robot=robot, ids=tuple(f"m{i}" for i in range(ROWS)),
        coordinates=np.stack([p.coordinates for p in placed]),
        transforms=np.stack([p.transforms for p in placed]), mismatch=np.zeros(ROWS),
        commanded="joints", loads=loads, measured=np.zeros((ROWS, 6)),
        sigma=np.tile(SIGMA, (ROWS, 1)),
        covariates={"temperature": np.linspace(1, 8, ROWS),
                    "time": 60.0 * np.arange(ROWS),
                    "approach": rng.choice([-1.0, 1.0], ROWS)},
        reference_point=np.array([0.02, 0.05, 0.03]), registration="known",
        configuration=np.arange(ROWS), repeat=np.arange(ROWS),
    )  # fmt: skip


def widest(campaign, name, true):
    """The hypothesis of an effect with most unknowns, at the frames of the truth."""
    listed = with_declared(hypotheses(conditions_of(campaign), LOADS), campaign.robot)
    bare = campaign.robot.without_effects()
    here = [
        h for h in listed
        if h.effect == name and h.public(bare, h.start + 1e-3).keys() <= true.keys()
    ]  # fmt: skip
    return max(here, key=lambda h: len(h.slots))


@pytest.mark.parametrize("name", WRONG)
def test_what_is_fitted_beside_a_declared_effect_is_the_machine(name):
    """Readings of the machine without noise: its numbers, and its readings."""
    declared, true = WRONG[name]
    campaign = commanded(arm(**{name: declared}))
    seen = predicted(campaign, arm(**{name: true})).deviation
    campaign = replace(campaign, measured=seen)
    before = predicted(campaign).deviation
    assert np.abs((before - seen) / SIGMA).max() > 3
    one = widest(campaign, name, true)
    unknowns = Unknowns(campaign.robot, (Acting(one, one.start),))
    fit = fit_machine(campaign, unknowns, np.ones(ROWS, bool))
    left = predicted(campaign, fit.robot).deviation - seen
    assert np.abs(left / SIGMA).max() < 0.1
    found, std = fit.robot.effects[name], np.sqrt(np.diag(fit.covariance))
    assert found.keys() == true.keys()
    sizes = np.maximum(std.max(), 1e-9)
    if not name.endswith(("compliance", "eccentricity", "stiffening", "scale")):
        for key, value in true.items():
            assert found[key] == pytest.approx(value, abs=0.1 * sizes)
    else:
        assert found == pytest.approx(true, rel=2e-2)


def test_no_effect_with_numbers_is_left_out():
    assert WRONG.keys() | {"geometric_stiffening"} == LIBRARY.keys()


PLANAR_CASES = {
    "encoder_offset": ({"two": 3e-4}, {"two": -1e-4}, {"offset": (0, -1e-4)}),
    "drive_compliance": (
        {"two": 2e5}, {"two": 5e4}, {"stiffness": (np.inf, 5e4), "force": 40.0},
    ),
    "thermal_expansion": (
        {"two": 23.4e-6, "tool": 23.4e-6}, {"two": 12e-6, "tool": 12e-6},
        {"expansion": (12e-6, 12e-6)},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PLANAR_CASES)
def test_a_declared_effect_that_differs_is_found_and_saved(name, tmp_path):
    """By hand: drives and beams of a plane.  The machine's numbers are saved."""
    declared, true, machine = PLANAR_CASES[name]
    campaign = measured(tmp_path / name, seed=4, configurations=12, passes=3, **machine)
    robot = replace(campaign.robot, effects={name: declared})
    found = diagnose(replace(campaign, robot=robot))
    assert (found.verdict, found.claimed) == ("explained", (name,))
    assert found.before.normalised > 2.5
    assert found.after.normalised < 1.2
    written = json.loads(json.dumps(plain(table(found))))
    (effect,) = written["effects"]
    save(found, tmp_path / "saved.toml")
    saved = read_robot(tmp_path / "saved.toml").effects
    assert saved.keys() == {name}
    for one in effect["parameters"]:
        key = one["name"]
        assert saved[name][key] == pytest.approx(one["value"], rel=1e-6)
        assert abs(one["value"] - true[key]) < 4 * one["std"]
        assert one["std"] < 0.2 * abs(declared[key] - true[key])
        told = one["found"]
        assert told["declared"] == declared[key]
        assert told["corrected"] == one["value"]
