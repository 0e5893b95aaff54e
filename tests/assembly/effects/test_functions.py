"""Functions of robot files, compared with closed forms and equivalent springs."""

from dataclasses import replace
from math import cos, exp, sin

import numpy as np
import pytest

from forcefit.assembly.effects import apply_effects, apply_known
from forcefit.assembly.effects.functions import apply_functions, basis
from forcefit.assembly.kinematics.posture import (
    place_many_joints,
    place_robot,
    together,
)
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import assemble_row, predict
from forcefit.assembly.measurement.variables import with_history
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.links import in_series
from forcefit.assembly.robots import load_robot
from tests.assembly.effects.test_effects import L, arm, here

RIGID = arm(rigid=True)


def seen(conditions, *functions):
    """Return the change of the reading due to functions."""
    both = predict(apply_functions(conditions, functions))
    assert list(both.reason) == [""] * len(conditions)
    return both.deviation - predict(conditions).deviation


def at_drive(parameters, form="powers", variables=("q.drive",), **more):
    return Function("drive", ("rz",), variables, form, parameters, **more)


def turned(angle, q):
    """Return the reading of an arm with a small angular error of its drive."""
    return [0, 0, angle, -angle * L * sin(q), angle * L * cos(q), 0]


@pytest.mark.parametrize("q", [-0.8, 0.0, 0.7])
def test_arm_rotation_equals_the_sum_of_joint_harmonics(q):
    waves = at_drive({"1.sine": 2e-5, "3.cosine": -1e-5}, "waves")
    angle = 2e-5 * sin(q) - 1e-5 * cos(3 * q)
    found = seen(here(RIGID, q=q), waves)[0]
    assert found == pytest.approx(turned(angle, q), rel=1e-4, abs=1e-9)


def test_drive_rotation_equals_the_formula_value():
    formula = at_drive(
        {"a": 1e-5, "b": 2e-6, "n": 2.0}, "formula", formula="a*sin(3*q)**n - b/2"
    )
    angle = 1e-5 * sin(3 * 0.3) ** 2 - 1e-6
    assert seen(here(RIGID, q=0.3), formula)[0][2] == pytest.approx(angle, rel=1e-9)


def test_base_functions_rotate_and_translate_the_whole_robot():
    """The tip moves with the base."""
    turn = Function("base", ("ry",), ("cov.tilt",), "powers", {"1": 1.0})
    shift = Function("base", ("tx",), ("temperature",), "powers", {"1": 1e-6})
    shift = replace(shift, variables=("cov.temperature",))
    there = here(arm(), q=0.0, temperature=5.0, tilt=1e-5)
    expected = [0, 1e-5, 0, 5e-6, 0, -1e-5 * L]
    assert seen(there, turn, shift)[0] == pytest.approx(expected, rel=1e-4, abs=1e-9)


def test_functions_change_the_load_and_the_reading():
    load = Function("load", ("fy",), ("load.fy",), "powers", {"1": 0.1})
    read = Function("reading", ("tz",), ("position.x",), "powers", {"2": 1e-5})
    there = here(arm(), (0, 0, 0, 0, 20, 0), q=0.4)
    gain = {"load_gain": {"factor": 1.1}}
    expected = (
        predict(apply_effects(there, gain)).deviation - predict(there).deviation
    )[0]
    expected[5] += 1e-5 * (L * cos(0.4)) ** 2
    assert seen(there, load, read)[0] == pytest.approx(expected, rel=1e-9, abs=1e-18)


def test_compliance_function_equals_an_elastic_drive():
    """The deflection is M / k, where 1 / k increases with the angle."""
    soft = at_drive({"0": 1e-5, "2": 3e-5}, kind="compliance")
    F, q = 30.0, 0.7
    there = here(RIGID, (0, 0, 0, 0, F, 0), q=q)
    turn = (1e-5 + 3e-5 * q**2) * F * L * cos(q)
    assert seen(there, soft)[0] == pytest.approx(turned(turn, q), rel=1e-3, abs=1e-8)
    K = in_series(None, 2, 1e-5 + 3e-5 * q**2)
    frames = (replace(RIGID.frames[0], joint_stiffness=K), RIGID.frames[1])
    sprung = here(replace(RIGID, frames=frames), (0, 0, 0, 0, F, 0), q=q)
    found = predict(apply_functions(there, [soft])).deviation
    assert found == pytest.approx(predict(sprung).deviation, rel=1e-12, abs=1e-18)
    one = assemble_row(apply_functions(there, [soft]), 0)
    assert one.energy == pytest.approx(assemble_row(sprung, 0).energy, rel=1e-9)


def test_rotation_by_a_wrench_function_is_quadratic_in_the_moment():
    square = at_drive({"2": 1e-7}, variables=("wrench.drive.mz",))
    F, q = 30.0, 0.5
    there = here(RIGID, (0, 0, 0, 0, F, 0), q=q)
    turn = 1e-7 * (F * L * cos(q)) ** 2
    assert seen(there, square)[0] == pytest.approx(turned(turn, q), rel=1e-4, abs=1e-9)


def three_rrr(load):
    robot = load_robot("3rrr")
    return as_declared(place_robot(robot), np.array(load, dtype=float))


@pytest.mark.parametrize("exact", [False, True])
def test_compliance_in_a_closed_chain_equals_a_joint_spring(exact):
    """The function is solved by Newton's method, the spring by the linear model."""
    there = replace(three_rrr([0, 0, 5, 40, -30, 0]), exact=exact)
    robot = there.robot
    names = [f.name for f in robot.frames if f.actuated]
    soft = [
        Function(n, ("rz",), ("time",), "powers", {"0": c}, kind="compliance")
        for n, c in zip(names, (2e-5, 5e-5, 1e-5), strict=True)
    ]
    there = replace(there, time=np.zeros(1))
    found = predict(apply_functions(there, soft)).deviation
    stiff = {n: 1 / c for n, c in zip(names, (2e-5, 5e-5, 1e-5), strict=True)}
    spring = predict(apply_effects(there, {"drive_compliance": stiff})).deviation
    assert found == pytest.approx(spring, rel=1e-8, abs=1e-12)
    assert np.abs(spring - predict(there).deviation).max() > 1e-5


def test_nonlinear_law_in_a_closed_chain_is_satisfied():
    """The deflection is e = g(w), where w is the joint wrench of the solution."""
    there = three_rrr([0, 0, 5, 40, -30, 0])
    name = next(f.name for f in there.robot.frames if f.actuated)
    law = Function(
        name, ("rz",), (f"wrench.{name}.mz",), "powers", {"1": 2e-5, "3": 4e-7}
    )
    one = assemble_row(apply_functions(there, [law]), 0)
    row = one.posture.robot.index(name)
    w = one.joint_wrenches[row][2]
    bent = one.posture.robot.errors[row][2] - there.robot.errors[row][2]
    assert bent == pytest.approx(2e-5 * w + 4e-7 * w**3, rel=1e-8)
    assert 4e-7 * abs(w) ** 3 > 1e-7
    many = predict(apply_functions(there, [law])).deviation[0]
    assert one.platform_screw == pytest.approx(many, rel=1e-6, abs=1e-12)


def campaign_of(times, **columns):
    """Return conditions of an arm that is measured in sequence."""
    q = np.array(columns.pop("q", np.zeros(len(times))), dtype=float)
    coordinates = np.column_stack([q, np.zeros(len(q))])
    postures, _ = place_many_joints(RIGID, coordinates)
    rows = together(postures)
    session = columns.pop("session", None)
    known = {"time": times, **columns}
    return with_history(as_declared(rows, covariates=known | {"session": session}))


def test_lag_function_approaches_its_gain_exponentially():
    """The result of a step of 10 K is gain 10 (1 - exp(-t / tau))."""
    t = np.array([0.0, 50.0, 200.0, 700.0])
    rows = campaign_of(t, temperature=10.0)
    lag = at_drive({"gain": 1e-6, "time_constant": 300.0}, "lag", ("cov.temperature",))
    assert seen(rows, lag)[:, 2] == pytest.approx(
        1e-5 * (1 - np.exp(-t / 300)), rel=1e-9
    )


def test_selected_readings_have_the_complete_history():
    t = np.linspace(0, 900, 10)
    rows = campaign_of(t, temperature=5 * np.sin(t / 200), q=np.sin(t / 100))
    lag = at_drive({"time_constant": 100.0}, "lag", ("cov.temperature",))
    back = at_drive({}, "reversal", ("q.drive",))
    for function, name in ((lag, "gain"), (back, "0")):
        whole = basis(rows, function, [name])
        some = basis(rows.take([7, 2, 4]), function, [name])
        assert some == pytest.approx(whole[[7, 2, 4]], rel=1e-12)


def test_reversal_sign_equals_the_direction_of_motion():
    q = [0.0, 0.5, 0.5, 0.2, 0.9]
    rows = campaign_of(np.arange(5.0), q=q, approach=-1.0)
    back = at_drive({"0": 1e-5, "1": 1e-5}, "reversal", ("q.drive", "q.drive"))
    side = np.array([-1, 1, 1, -1, 1])  # the first sign is from the column ``approach``
    expected = side * (1e-5 + 1e-5 * np.array(q))
    assert seen(rows, back)[:, 2] == pytest.approx(expected, rel=1e-9)


def test_slip_function_moves_with_the_drive_within_its_depth():
    q = [0.0, 0.5, 0.5, 0.2, 0.9]
    rows = campaign_of(np.arange(5.0), q=q, approach=-1.0)
    slack = at_drive({"size": 1e-5, "depth": 0.5}, "slip", ("q.drive",))
    expected = 1e-5 * np.array([-1.0, 0.0, 0.0, -0.6, 0.8])  # by hand
    assert seen(rows, slack)[:, 2] == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_backlash_by_reversal_waves_varies_over_one_turn():
    q = [0.0, 0.5, 0.5, 0.2, 0.9]
    rows = campaign_of(np.arange(5.0), q=q, approach=-1.0)
    side = np.array([-1, 1, 1, -1, 1])
    uneven = at_drive({"1.sine": 1e-5}, "reversal_waves", ("q.drive",))
    expected = 1e-5 * side * np.sin(q)
    assert seen(rows, uneven)[:, 2] == pytest.approx(expected, rel=1e-9, abs=1e-15)
    scaled = at_drive({"1.cosine": 1e-5}, "scaled_waves", ("q.drive", "approach"))
    expected = -1e-5 * np.cos(q)
    assert seen(rows, scaled)[:, 2] == pytest.approx(expected, rel=1e-9)


def test_session_effects_do_not_act_on_other_sessions():
    rows = campaign_of(np.zeros(3), session=np.array(["a", "b", "a"]))
    own = at_drive({"0": 1e-5}, session="a")
    assert seen(rows, own)[:, 2] == pytest.approx([1e-5, 0, 1e-5], abs=1e-15)
    zeros = {"encoder_offset": {"drive": 2e-5}, "registration": {"base.tz": 1e-4}}
    robot = replace(RIGID, session_effects={"b": zeros})
    found = predict(apply_known(rows, robot)).deviation - predict(rows).deviation
    assert found[:, 2] == pytest.approx([0, 2e-5, 0], abs=1e-15)
    assert found[:, 5] == pytest.approx([0, 1e-4, 0], abs=1e-15)


def test_creep_step_and_slow_wave_equal_their_formulas():
    t = np.array([0.0, 100.0, 300.0])
    rows = campaign_of(t)
    creep = at_drive({"gain": 1e-5, "time_constant": 150.0}, "creep", ("time",))
    jump = at_drive({"size": 2e-5, "at": 100.0}, "step", ("time",))
    slow = at_drive({"sine": 3e-5, "period": 400.0}, "slow_wave", ("time",))
    assert seen(rows, creep)[:, 2] == pytest.approx(
        [0, 1e-5 * (1 - exp(-100 / 150)), 1e-5 * (1 - exp(-2))], rel=1e-9
    )
    assert seen(rows, jump)[:, 2] == pytest.approx([0, 2e-5, 2e-5], abs=1e-15)
    assert seen(rows, slow)[:, 2] == pytest.approx([0, 3e-5, -3e-5], abs=1e-15)
