"""Reading and writing of the effect ``function``, and error messages."""

import json
from math import cos, sin

import pytest

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.model.function import Function
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


def test_functions_are_equal_after_writing_and_reading(tmp_path):
    robot = read_robot(arm_with(tmp_path, PUBLIC, FORMULA))
    assert robot.functions[0] == Function(
        "drive", ("rz",), ("q.drive",), "waves", {"1.sine": 1.2e-4, "1.cosine": -3e-5},
        label="gear of the drive", session="day2",
    )  # fmt: skip
    write_robot(robot, tmp_path / "again.toml")
    assert read_robot(tmp_path / "again.toml").functions == robot.functions


def test_session_effects_are_equal_after_writing_and_reading(tmp_path):
    zero = 'name = "encoder_offset"\nparameters = { drive = 1e-4 }\n'
    path = arm_with(tmp_path, zero, zero + 'session = "a"', zero + 'session = "b"')
    robot = read_robot(path)
    assert robot.effects == {"encoder_offset": {"drive": 1e-4}}
    assert set(robot.session_effects) == {"a", "b"}
    write_robot(robot, tmp_path / "again.toml")
    assert read_robot(tmp_path / "again.toml").session_effects == robot.session_effects


WAVES = '"waves"\nparameters = { "1.sine" = 1.2e-4, "1.cosine" = -3e-5 }'
ANGLE = 'variables = ["q.drive"]\nform = "formula"\nformula = "a*sin(3*q) + b"'
VARIABLES = (
    "expected q.<frame>, wrench.<frame>.<mx..fz>, load.<mx..fz>, load.force, "
    "position.<x..z>, time, approach, cov.<name>"
)
REFUSED = {
    "an unknown place": (PUBLIC, 'where = "drive"', 'where = "driv"',
        '.where: found "driv", expected a frame, "base", "reading" or "load"; did you '
        'mean "drive"?'),
    "an unknown variable": (PUBLIC, '"q.drive"', '"q.drivee"',
        f'.variables: found "q.drivee", {VARIABLES}; did you mean "q.drive"?'),
    "a fixed joint's coordinate": (PUBLIC, '"q.drive"', '"q.tool"',
        f'.variables: found "q.tool", {VARIABLES}'),
    "a word": (PUBLIC, '"q.drive"', '"speed"',
        f'.variables: found "speed", {VARIABLES}'),
    "an unknown form": (PUBLIC, '"waves"', '"wave"',
        ".form: found 'wave', expected \"powers\" | \"waves\" | "),
    "an unknown component": (PUBLIC, '"rz"', '"mz"',
        '.components: found "mz"; valid: rx, ry, rz, tx, ty, tz'),
    "a number of another form": (PUBLIC, '"1.sine"', '"sine"',
        '.parameters: found "sine", which is not a parameter of waves; expected names '
        'such as "1.sine" or "period"'),
    "a shape that is missing": (PUBLIC, '"waves"', '"lag"',
        '.parameters: found "1.sine", which is not a parameter of lag; expected names '
        'such as "gain" or "time_constant"'),
    "a compliance of a reading": (PUBLIC, 'where = "drive"',
        'where = "reading"\nkind = "compliance"',
        '.kind: found "compliance" for reading, expected "screw"'),
    "an unknown key": (PUBLIC, "session =", "sesion =",
        ': unknown key "sesion"; did you mean "session"?'),
    "a knee at no load": (PUBLIC, WAVES,
        '"knee"\nparameters = { size = 1e-4, at = 0.0 }',
        '.parameters: "at": found 0, expected > 0'),
    "waves of a load": (PUBLIC, '["q.drive"]\nform = "waves"',
        '["approach", "load.fz"]\nform = "reversal_waves"',
        '.parameters: "period" is missing; expected because the variable is not '
        "an angle in rad"),
    "a spread of no number": (PUBLIC, "session =",
        'std = { "2.sine" = 1.0 }\nsession =',
        '.std: found "2.sine", which is not a parameter; did you mean "1.sine"?'),
    "no formula": (FORMULA, "a*sin(3*q) + b", "a*sin(3*q",
        ".formula: found 'a*sin(3*q', expected a formula such as \"a*sin(q)\""),
    "a call": (FORMULA, "a*sin(3*q) + b", "__import__('os')",
        '.formula: found "__import__", expected the name of a function; valid: abs, '
        "atan, cos, exp, log, sign, sin, sqrt, tan, tanh"),
    "an unknown name": (FORMULA, "a*sin(3*q) + b", "a*sin(3*p) + b",
        '.formula: found "p", which is neither a variable nor a parameter; valid: a, '
        "b, drive, q, q_drive"),
    "a number unused": (FORMULA, "a*sin(3*q) + b", "a*sin(3*q)",
        '.formula: parameter "b" is not in the formula'),
    "units": (FORMULA, ANGLE,
        'variables = ["time"]\nform = "formula"\nformula = "a*sin(3*time) + b"',
        '.formula: units clash in "3 * time": found s, expected 1'),
}  # fmt: skip


@pytest.mark.parametrize(("text", "old", "new", "message"), REFUSED.values(),
                         ids=REFUSED)  # fmt: skip
def test_invalid_function_is_rejected(text, old, new, message, tmp_path):
    assert old in text
    path = arm_with(tmp_path, text.replace(old, new))
    with pytest.raises(BadInput) as error:
        read_robot(path)
    label = "gear of the drive" if text == PUBLIC else "function"
    assert str(error.value).startswith(f'{path}: effect "{label}"{message}')
    assert "\n" not in str(error.value)


def answer(run, tmp_path, *words):
    file = tmp_path / "answer.json"
    code, _, error = run("assembly", *words, "--json", str(file))
    assert (code, error) == (0, "")
    return json.loads(file.read_text())


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_linear_and_exact_solutions_include_functions(state, tmp_path, run):
    path = str(arm_with(tmp_path, FORMULA))
    turn = 1e-4 * sin(0.9) + 2e-5
    screw = answer(
        run, tmp_path, "solve", path, "--state", state, "--joint", "drive=0.3"
    )
    expected = [0, 0, turn, -turn * L * sin(0.3), turn * L * cos(0.3), 0]
    assert screw["platform_screw"] == pytest.approx(expected, rel=1e-3, abs=1e-8)


def test_formula_with_infinite_value_is_rejected(tmp_path, run):
    path = str(arm_with(tmp_path, FORMULA.replace("sin(3*q)", "log(q)")))
    code, _, error = run("assembly", "solve", path, "--joint", "drive=-0.3")
    assert code == 2
    assert "found nan at q.drive = -0.3, expected a finite number" in error


def test_unknown_session_is_rejected_with_suggestion(tmp_path, run):
    path = str(arm_with(tmp_path, PUBLIC))
    words = ["solve", path, "--joint", "drive=0.5"]
    there = answer(run, tmp_path, *words, "--under", "session=day2")
    turn = 1.2e-4 * sin(0.5) - 3e-5 * cos(0.5)
    assert there["platform_screw"][2] == pytest.approx(turn, rel=1e-9)
    assert answer(run, tmp_path, *words)["platform_screw"][2] == 0.0
    code, _, error = run("assembly", *words, "--under", "session=day3")
    assert code == 2
    assert '--under session: found "day3"; did you mean "day2"' in error


def test_solve_requires_covariate_of_a_function(tmp_path, run):
    humid = PUBLIC.replace('"q.drive"', '"cov.humidity"').replace('"waves"', '"powers"')
    humid = humid.replace('"1.sine" = 1.2e-4, "1.cosine" = -3e-5', '"1" = 1e-6')
    path = str(arm_with(tmp_path, humid.replace('session = "day2"', "")))
    words = ["solve", path, "--joint", "drive=0.5"]
    code, _, error = run("assembly", *words)
    assert code == 2
    assert "expected --under humidity=NUMBER" in error
    there = answer(run, tmp_path, *words, "--under", "humidity=40")
    assert there["platform_screw"][2] == pytest.approx(4e-5)
