"""``[[effect]]`` named function: as the public format has it, and what is refused."""

import json
from math import cos, sin

import pytest

from assembly.files.robot_file import read_robot, write_robot
from assembly.model.function import Function
from forcefit.inputs.table import BadInput
from tests.assembly.files.test_effect_file import L, arm_with

PUBLIC = """name = "function"
label = "gear of the drive"
where = "drive"
components = ["rz"]
variables = ["q.drive"]
form = "waves"
parameters = { "1.sine" = 1.2e-4, "1.cosine" = -3e-5 }
session = "day2"
"""
FORMULA = """name = "function"
where = "drive"
components = ["rz"]
variables = ["q.drive"]
form = "formula"
formula = "a*sin(3*q) + b"
parameters = { a = 1e-4, b = 2e-5 }
"""


def test_the_public_example_reads_and_comes_back(tmp_path):
    robot = read_robot(arm_with(tmp_path, PUBLIC, FORMULA))
    assert robot.functions[0] == Function(
        "drive", ("rz",), ("q.drive",), "waves", {"1.sine": 1.2e-4, "1.cosine": -3e-5},
        label="gear of the drive", session="day2",
    )  # fmt: skip
    write_robot(robot, tmp_path / "again.toml")
    assert read_robot(tmp_path / "again.toml").functions == robot.functions


def test_effects_of_sessions_come_back(tmp_path):
    zero = 'name = "encoder_offset"\nparameters = { drive = 1e-4 }\n'
    path = arm_with(tmp_path, zero, zero + 'session = "a"', zero + 'session = "b"')
    robot = read_robot(path)
    assert robot.effects == {"encoder_offset": {"drive": 1e-4}}
    assert set(robot.session_effects) == {"a", "b"}
    write_robot(robot, tmp_path / "again.toml")
    assert read_robot(tmp_path / "again.toml").session_effects == robot.session_effects


REFUSED = {
    "an unknown place": (('where = "drive"', 'where = "driv"'),
        'where: found "driv", expected a frame or a place; did you mean "drive"?'),
    "an unknown variable": (('"q.drive"', '"q.drivee"'),
        'variables: found "q.drivee", expected q.<frame>, wrench.<frame>.<mx..fz>'),
    "a fixed joint's coordinate": (('"q.drive"', '"q.tool"'), 'found "q.tool"'),
    "a word": (('"q.drive"', '"speed"'),
        'variables: found "speed", expected q.<frame>'),
    "an unknown form": (('"waves"', '"wave"'), "form: found 'wave', expected"),
    "an unknown component": (('"rz"', '"mz"'), 'components: found "mz" there'),
    "a number of another form": (('"1.sine"', '"sine"'),
        'parameters: found "sine", which is no parameter of waves'),
    "a shape that is missing": (('"waves"', '"lag"'), "no parameter of lag"),
    "a compliance of a reading": (('where = "drive"', 'where = "reading"\n'
        'kind = "compliance"'), 'kind: found "compliance" in the reading'),
    "an unknown key": (('session =', 'sesion ='), 'unknown key "sesion"'),
    "a knee at no load": (('"waves"\nparameters = { "1.sine" = 1.2e-4, "1.cosine" = '
        '-3e-5 }', '"knee"\nparameters = { size = 1e-4, at = 0.0 }'),
        'parameters: "at": found 0, expected > 0'),
    "waves of a load": (('["q.drive"]\nform = "waves"',
        '["approach", "load.fz"]\nform = "reversal_waves"'), '"period" is missing'),
    "a spread of no number": (('session =', 'std = { "2.sine" = 1.0 }\nsession ='),
        'std: found "2.sine", which is no parameter'),
}  # fmt: skip
FORMULAS = {
    "no formula": ("a*sin(3*q) + b", "a*sin(3*q", "expected a formula such as"),
    "a call": ("a*sin(3*q) + b", "__import__('os')", "which is no function"),
    "an unknown name": ("a*sin(3*q) + b", "a*sin(3*p) + b",
        'found "p", which is neither'),
    "a number unused": ("a*sin(3*q) + b", "a*sin(3*q)", 'parameter "b" is not in it'),
    "units": ('variables = ["q.drive"]\nform = "formula"\nformula = "a*sin(3*q) + b"',
        'variables = ["time"]\nform = "formula"\nformula = "a*sin(3*time) + b"',
        'formula: units clash in "3 * time": found s, expected 1'),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_function_that_makes_no_sense_is_refused(case, tmp_path):
    (old, new), message = REFUSED[case]
    assert old in PUBLIC
    path = arm_with(tmp_path, PUBLIC.replace(old, new))
    with pytest.raises(BadInput) as error:
        read_robot(path)
    assert message in str(error.value)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("case", FORMULAS)
def test_a_formula_that_makes_no_sense_is_refused(case, tmp_path):
    old, new, message = FORMULAS[case]
    assert old in FORMULA
    with pytest.raises(BadInput) as error:
        read_robot(arm_with(tmp_path, FORMULA.replace(old, new)))
    assert message in str(error.value)


def answer(run, tmp_path, *words):
    file = tmp_path / "answer.json"
    code, _, error = run("assembly", *words, "--json", str(file))
    assert (code, error) == (0, "")
    return json.loads(file.read_text())


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_functions_act_in_every_state(state, tmp_path, run):
    path = str(arm_with(tmp_path, FORMULA))
    turn = 1e-4 * sin(0.9) + 2e-5
    screw = answer(
        run, tmp_path, "solve", path, "--state", state, "--joint", "drive=0.3"
    )
    expected = [0, 0, turn, -turn * L * sin(0.3), turn * L * cos(0.3), 0]
    assert screw["platform_screw"] == pytest.approx(expected, rel=1e-3, abs=1e-8)


def test_a_formula_without_a_value_is_refused_where_it_is_used(tmp_path, run):
    path = str(arm_with(tmp_path, FORMULA.replace("sin(3*q)", "log(q)")))
    code, _, error = run("assembly", "solve", path, "--joint", "drive=-0.3")
    assert code == 2
    assert "found nan at q.drive = -0.3, expected a finite number" in error


def test_a_session_is_asked_for_by_its_name(tmp_path, run):
    path = str(arm_with(tmp_path, PUBLIC))
    words = ["solve", path, "--joint", "drive=0.5"]
    there = answer(run, tmp_path, *words, "--under", "session=day2")
    turn = 1.2e-4 * sin(0.5) - 3e-5 * cos(0.5)
    assert there["platform_screw"][2] == pytest.approx(turn, rel=1e-9)
    assert answer(run, tmp_path, *words)["platform_screw"][2] == 0.0
    code, _, error = run("assembly", *words, "--under", "session=day3")
    assert code == 2
    assert '--under session: found "day3"; did you mean "day2"' in error


def test_a_variable_is_asked_for_by_the_option_that_gives_it(tmp_path, run):
    humid = PUBLIC.replace('"q.drive"', '"cov.humidity"').replace('"waves"', '"powers"')
    humid = humid.replace('"1.sine" = 1.2e-4, "1.cosine" = -3e-5', '"1" = 1e-6')
    path = str(arm_with(tmp_path, humid.replace('session = "day2"', "")))
    words = ["solve", path, "--joint", "drive=0.5"]
    code, _, error = run("assembly", *words)
    assert code == 2
    assert "expected --under humidity=NUMBER" in error
    there = answer(run, tmp_path, *words, "--under", "humidity=40")
    assert there["platform_screw"][2] == pytest.approx(4e-5)
