"""Test diagnoses of robots whose files contain effects with wrong parameters."""

import json
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.files.robot_file import read_robot
from forcefit.inputs.writing import plain
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.fit import fit_machine
from forcefit.validation.diagnosis.hypotheses import hypotheses, with_declared
from forcefit.validation.diagnosis.prediction import predicted
from forcefit.validation.diagnosis.results import table
from forcefit.validation.diagnosis.saving import save
from forcefit.validation.diagnosis.signatures import conditions_of
from forcefit.validation.diagnosis.unknowns import Acting, Unknowns
from tests.elastic_arm_for_tests import arm, commanded
from tests.planar_arm_for_tests import SIGMA, measured

LOADS = ("mx", "my", "mz", "fx", "fy", "fz")
ROWS = 12
# Parameters in the robot file, and true parameters.
WRONG = {
    "self_weight": ({"g.z": -5.0}, {"g.x": 1.0, "g.y": 0.5, "g.z": -9.81}),
    "thermal_expansion": ({"j2": 2.34e-5}, {"j2": 1.2e-5}),
    "delayed_expansion": (
        {"j2": 2e-5, "j2.time_constant": 300.0},
        {"j2": 2e-5, "j2.time_constant": 300.0, "tool": 3e-5,
         "tool.time_constant": 200.0},
    ),
    "drive_compliance": ({"j1": 9e4, "j2": 2e4}, {"j1": 3e4, "j2": 8e4, "j3": 5e4}),
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
    "device_scale": ({"factor": 1.002}, {"factor": 0.999}),
    "body_mass": (
        {"tool.mass": 0.4},
        {"tool.mass": 0.1, "tool.moment.x": 0.03, "tool.moment.y": -0.02,
         "tool.moment.z": 0.01},
    ),
    "modulus_scale": ({"j2": 0.8}, {"j2": 0.64}),
    # The true machine has an additional joint with clearance.
    "joint_clearance": (
        {"j1.radial": 1e-5},
        {"j1.radial": 1e-5, "j2.radial": 3e-5, "j2.axial": 2e-5, "j2.tilt": 1e-4},
    ),
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
        {f"stiffness.{a}{b}": k for a, k in (("r", 1e6), ("t", 2e5)) for b in "xyz"},
        {f"stiffness.{a}{b}": 4e5 for a in "rt" for b in "xyz"},
    ),
}  # fmt: skip


def widest(campaign, name, true):
    """Return the hypothesis with the most unknowns among those with the true frames."""
    listed = with_declared(hypotheses(conditions_of(campaign), LOADS), campaign.robot)
    bare = campaign.robot.without_effects()
    here = [
        h for h in listed
        if h.effect == name and h.public(bare, h.start + 1e-3).keys() <= true.keys()
    ]  # fmt: skip
    return max(here, key=lambda h: len(h.slots))


@pytest.mark.parametrize("name", WRONG)
def test_fit_corrects_wrong_parameters_of_a_declared_effect(name):
    """From readings without noise, the fit identifies the true parameters."""
    declared, true = WRONG[name]
    campaign = commanded(arm(**{name: declared}))
    weight = {"gravity.z": np.full(ROWS, -9.81)} if name == "body_mass" else {}
    campaign = replace(campaign, covariates={**campaign.covariates, **weight})
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


def test_cases_cover_every_effect_with_parameters():
    assert WRONG.keys() | {"geometric_stiffening"} == LIBRARY.keys()


PLANAR_CASES = {
    "encoder_offset": ({"two": 3e-4}, {"two": -1e-4}, {"offset": (0, -1e-4)}),
    "drive_compliance": (
        {"two": 5e4}, {"two": 2e5}, {"stiffness": (np.inf, 2e5), "force": 40.0},
    ),
    "thermal_expansion": (
        {"two": 23.4e-6, "tool": 23.4e-6}, {"two": 12e-6, "tool": 12e-6},
        {"expansion": (12e-6, 12e-6)},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PLANAR_CASES)
def test_diagnosis_corrects_and_saves_a_declared_effect(name, tmp_path):
    """The saved parameters are the true parameters of a planar arm."""
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
