"""Reading and writing of effects in robot files, and their results in ``solve``."""

import json
from dataclasses import replace

import pytest

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.files.effect_file import parameter_names
from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.inputs.table import BadInput

L = 0.8
ARM = f"""
name = "arm"
platform = "tool"
[[frame]]
name = "drive"
parent = "base"
joint = "revolute"
actuated = true
joint_stiffness = [inf, inf, 4e4, inf, inf, inf]
[[frame]]
name = "tool"
parent = "drive"
translation = [{L}, 0, 0]
link = {{ beam = {{ radius = 0.015 }}, young = 7e10, poisson = 0.3, density = 2700.0 }}
"""


def arm_with(tmp_path, *effects):
    """Write a robot file of an arm with ``[[effect]]`` tables."""
    path = tmp_path / "arm.toml"
    path.write_text(ARM + "".join(f"[[effect]]\n{e}\n" for e in effects))
    return path


def test_effects_are_equal_after_writing_and_reading(tmp_path):
    plain = read_robot(arm_with(tmp_path))
    effects = {
        name: {
            key: 1.25 + 1e-17 * k + k
            for k, key in enumerate(parameter_names(plain, name))
        }
        for name in LIBRARY
    }
    without_numbers = {"geometric_stiffening"}
    assert {n for n, values in effects.items() if not values} == without_numbers
    robot = replace(plain, effects=effects)
    write_robot(robot, tmp_path / "again.toml")
    assert read_robot(tmp_path / "again.toml").effects == effects


SHIFT = 'parameters = { "amplitude.tx" = 1e-5'
REFUSED = {
    f'name = "drift"\n{SHIFT}, time_constant = 0.0 }}':
        '"drift".parameters.time_constant: found 0.0, expected a finite number > 0 '
        "[SI]",
    f'name = "drift"\n{SHIFT} }}':
        '"drift".parameters: "time_constant" is missing; expected a time in s',
    'name = "delayed_expansion"\nparameters = { tool = 1e-5 }':
        '"delayed_expansion".parameters: "tool.time_constant" is missing; expected a '
        "time in s",
    'name = "self_weight"\nparameters = { "g.w" = 1 }':
        '"self_weight".parameters: found "g.w", which is not a parameter of '
        'self_weight; did you mean "g.z"?',
    'name = "self_weight"\n[[effect]]\nname = "self_weight"':
        '"self_weight".name: found this name twice; expected one [[effect]] per name',
    'name = "encoder_offset"\nparameters = { tool = 1e-4 }':
        '"encoder_offset".parameters: found "tool", which is not a parameter of '
        "encoder_offset; valid: drive",
    'name = "encoder_offset"\nparameters = { drive = "0" }':
        "\"encoder_offset\".parameters.drive: found '0', expected a finite number [SI]",
    'name = "encoder_offset"\nsize = 1':
        '"encoder_offset": unknown key "size"; valid: name, parameters, session',
}  # fmt: skip


@pytest.mark.parametrize(("lines", "message"), REFUSED.items())
def test_invalid_effect_is_rejected(lines, message, tmp_path):
    path = arm_with(tmp_path, lines)
    with pytest.raises(BadInput) as refused:
        read_robot(path)
    assert str(refused.value) == f"{path}: effect {message}"


def test_unknown_effect_is_rejected_with_suggestion(tmp_path):
    path = arm_with(tmp_path, 'name = "self_wait"')
    with pytest.raises(BadInput) as refused:
        read_robot(path)
    told = str(refused.value)
    assert told.startswith(f"{path}: effect[1].name: found 'self_wait', expected ")
    assert told.endswith('; did you mean "self_weight"?')


def solved(run, *words):
    status, out, err = run("assembly", "solve", *words, "--json", "-")
    assert status == 0, err
    return json.loads(out)


def test_solve_includes_effects_in_robot_file(tmp_path, run):
    """The changes are F L / k for a spring in series and alpha T L for a warm beam."""
    plain = arm_with(tmp_path)
    words = ("--load", "fy=10")
    before = solved(run, plain, *words)["platform_screw"]
    soft = 'name = "drive_compliance"\nparameters = { drive = 5e4 }'
    warm = 'name = "thermal_expansion"\nparameters = { tool = 2e-5 }'
    path = arm_with(tmp_path, soft, warm)
    after = solved(run, path, *words, "--under", "temperature=6")["platform_screw"]
    assert after[2] - before[2] == pytest.approx(10 * L / 5e4, rel=1e-9)
    assert after[3] - before[3] == pytest.approx(2e-5 * 6 * L, rel=1e-9)


def test_device_drift_changes_reading_but_not_pose(tmp_path, run):
    drift = 'name = "drift"\nparameters = { "amplitude.tz" = 1e-5, time_constant = 10 }'
    path = arm_with(tmp_path, drift)
    found = solved(run, path, "--under", "time=10")
    assert found["platform_screw"][5] == pytest.approx(0.0, abs=1e-15)
    assert found["reading"][5] == pytest.approx(1e-5 * (1 - 1 / 2.718281828459045))


def test_solve_requires_covariate_of_an_effect(tmp_path, run):
    warm = 'name = "thermal_expansion"\nparameters = { tool = 2e-5 }'
    path = arm_with(tmp_path, warm)
    status, out, err = run("assembly", "solve", path)
    assert (status, out) == (2, "")
    assert '"thermal_expansion" depends on temperature' in err
    assert "--under temperature=NUMBER" in err
    status, _, err = run("validation", "validity", path)
    assert status == 2
    assert 'found effect "thermal_expansion", which depends on temperature' in err
    status, _, err = run("assembly", "solve", path, "--under", "temprature=6")
    assert status == 2
    assert "temprature" in err
    assert "temperature" in err
