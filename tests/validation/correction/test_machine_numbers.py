"""Tests of the robot parameters that are fitted to a new session."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.measurement.predict import predict as predict_rows
from forcefit.assembly.model.function import Function
from forcefit.validation.campaign.campaign_file import read_campaign, read_commands
from forcefit.validation.correction.carried_file import save
from forcefit.validation.correction.carrying import carry
from forcefit.validation.correction.machine_numbers import machine_numbers
from forcefit.validation.correction.spread import number_slopes
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.saved_covariance import (
    COMPLIANCE,
    EFFECT,
    FUNCTION,
    Number,
    SavedCovariance,
    read_covariance,
    write_covariance,
)
from forcefit.validation.diagnosis.saving import save as save_found
from forcefit.validation.diagnosis.signatures import conditions_of
from forcefit.validation.synthetic.machine import Hidden
from tests.campaigns_for_tests import campaign_of, table_rows
from tests.elastic_arm_for_tests import arm, with_errors
from tests.validation.diagnosis.test_sessions import FRAMES, measured

SIGMA = 1e-5


def wet_post(readings, wet, covariance, folder, numbers=("0", "1")):
    """Return campaigns of a post that moves along x with the covariate ``wet``."""
    measured = np.full((len(readings), 6), np.nan)
    measured[:, 3] = readings
    campaign = campaign_of(measured, SIGMA, wet=np.array(wet, dtype=float))
    nothing = dict.fromkeys(numbers, 0.0)
    function = Function("reading", ("tx",), ("cov.wet",), "powers", nothing)
    path = folder / "saved.npz"
    own = tuple(Number(FUNCTION, "0", name) for name in numbers)
    write_covariance(SavedCovariance(own, np.array(covariance)), path)
    saved = replace(
        campaign.robot, functions=(function,), diagnosis={"covariance": str(path)}
    )
    return replace(campaign, robot=saved), campaign


def test_fitted_parameter_is_the_mean_of_prior_and_readings(tmp_path):
    """The prior is normal with mean 0, and all n readings are y."""
    y, s, n = 4e-5, 3e-5, 8
    saved, declared = wet_post([y] * 12, [1] * 12, [[s**2]], tmp_path, ("1",))
    carried = carry(saved, declared, np.arange(12) < n, ())
    prior = 1 / (carried.fit.widened * s**2)
    told = n / SIGMA**2
    (number,) = carried.fit.robot.functions[0].parameters.values()
    assert number == pytest.approx(y * told / (told + prior), rel=1e-6)
    save(carried, tmp_path / "carried.toml")
    known = read_covariance(read_robot(tmp_path / "carried.toml"))
    assert known.numbers == (Number(FUNCTION, "0", "1"),)
    assert known.covariance[0, 0] == pytest.approx(1 / (told + prior), rel=1e-6)


def test_known_sum_of_two_parameters_is_unchanged(tmp_path):
    """Only a + b was known, and the new rows determine a."""
    s, little, a = 1e-4, 1e-9, 5e-5
    C = s**2 * np.array([[1, -1], [-1, 1]]) + little**2 * np.eye(2)
    wet = [0] * 8 + [1] * 8
    saved, declared = wet_post([a] * 8 + [0.0] * 8, wet, C, tmp_path)
    carried = carry(saved, declared, np.arange(16) < 8, ())
    (day,) = carried.sessions
    assert day.error.position < 0.01 * a
    assert day.declared.position == 0.0
    numbers = carried.fit.robot.functions[0].parameters
    assert numbers["0"] == pytest.approx(a, rel=0.01)
    assert numbers["0"] + numbers["1"] == pytest.approx(0.0, abs=0.01 * a)


def test_prior_covariance_increases_for_a_large_parameter_change(tmp_path):
    """The fitted parameter then agrees with the readings."""
    s, y = 2e-6, 4e-5
    saved, declared = wet_post([y] * 40, [1] * 40, [[s**2]], tmp_path, ("1",))
    carried = carry(saved, declared, np.arange(40) < 20, ())
    assert carried.fit.widened > 16
    (day,) = carried.sessions
    assert day.error.position < 0.05 * y
    assert day.held == pytest.approx(y)
    assert day.suffices


def test_machine_parameters_exclude_session_parameters(tmp_path):
    saved, _ = wet_post([0.0] * 12, [1] * 12, np.eye(2) * 1e-12, tmp_path)
    clock = Function("reading", ("tx",), ("time",), "powers", {"1": 1e-9})
    robot = replace(
        saved.robot,
        functions=(*saved.robot.functions, clock),
        effects={"registration": {"base.tx": 0.1}, "self_weight": {"g.z": -9.0}},
    )
    numbers = (
        Number(FUNCTION, "0", "0"),
        Number(FUNCTION, "1", "1"),
        Number(EFFECT, "registration", "base.tx"),
        Number(EFFECT, "self_weight", "g.z"),
        Number(EFFECT, "self_weight", "g.z", "monday"),
    )
    path = tmp_path / "saved.npz"
    write_covariance(SavedCovariance(numbers, 1e-12 * np.eye(5)), path)
    own = machine_numbers(robot)
    assert own.numbers == (numbers[0], numbers[3])
    assert len(own) == 2


def test_fitted_compliance_is_positive():
    """At least one thousandth of a compliance remains."""
    robot = campaign_of(np.zeros((1, 6))).robot
    K = np.diag([np.inf, np.inf, np.inf, 1e6, np.inf, np.inf])
    soft = replace(robot, frames=(replace(robot.frames[0], joint_stiffness=K),))
    one = Number(COMPLIANCE, "top", "tx")
    less = one.moved(soft, -5e-7).frames[0].joint_stiffness
    assert less[3, 3] == pytest.approx(2e6)
    least = one.moved(soft, -1.0).frames[0].joint_stiffness
    assert least[3, 3] == pytest.approx(1e9)
    assert one.moved(robot, -1e-6).frames[0].joint_stiffness is None


@pytest.mark.parametrize(("where", "component", "kind"), [
    ("base", "ry", "screw"), ("reading", "ry", "screw"), ("reading", "tz", "screw"),
    ("j2", "rz", "screw"), ("j2", "rz", "compliance"),
])  # fmt: skip
def test_derivatives_of_functions_equal_finite_differences(
    where, component, kind, tmp_path
):
    """The predictions include a load and the pose of the device."""
    robot, rng = with_errors(arm()), np.random.default_rng(2)
    numbers = rng.uniform(-1, 1, (5, 6)) * np.repeat([1, 40], 3)
    lines = ["id,q.j1,q.j2,q.j3,load.fx,load.fz,load.mz", *table_rows(numbers)]
    (tmp_path / "plain.csv").write_text("\n".join(lines) + "\n")
    one = Function(where, (component,), ("q.j2",), "powers", {"1": 1e-7}, kind)
    place = {"base.rz": 0.4, "base.rx": -0.2, "base.tx": 0.3}
    robot = replace(robot, functions=(one,), effects={"registration": place})
    rows = read_commands(tmp_path / "plain.csv", robot)
    number = Number(FUNCTION, "0", "1")

    def conditions_for(other):
        return conditions_of(replace(rows, robot=other))

    J = number_slopes(
        robot, conditions_for(robot), (number,), np.array([1e-7]), conditions_for
    )
    step = 1e-6
    ends = [
        predict_rows(conditions_for(number.moved(robot, by))).deviation
        for by in (step, -step)
    ]
    expected = (ends[0] - ends[1]) / (2 * step)
    # The rotation of the device changes rotation vectors only to second order.
    assert J[:, :, 0] == pytest.approx(expected, abs=1e-3 * np.abs(expected).max())


@pytest.mark.slow
def test_softer_drive_is_identified_in_a_new_session(tmp_path):
    """After the diagnosis, the stiffness of a drive decreases by a fifth."""
    springs = {"monday": 5e4, "tuesday": 4e4}
    days = {}
    for day, stiffness in springs.items():
        base = {f"base.t{k}": v for k, v in zip("xyz", FRAMES[day][3:], strict=True)}
        hidden = {day: [Hidden("registration", base)]}
        spring = Hidden("drive_compliance", {"j2": stiffness})
        days[day] = measured(tmp_path / day, hidden, [spring], known=False)
    found = diagnose(read_campaign(days["monday"]))
    assert found.claimed == ("drive_compliance",)
    save_found(found, tmp_path / "found.toml")
    rows = read_commands(days["tuesday"], read_robot(tmp_path / "found.toml"))
    carried = carry(rows, read_campaign(days["tuesday"]), np.arange(len(rows)) < 20)
    (day,) = carried.sessions
    assert day.suffices
    assert day.error.normalised < 1.2
    save(carried, tmp_path / "carried.toml")
    robot = read_robot(tmp_path / "carried.toml")
    known = read_covariance(robot)
    place = known.numbers.index(Number(EFFECT, "drive_compliance", "j2"))
    value = robot.effects["drive_compliance"]["j2"]
    std = known.covariance[place, place] ** 0.5
    assert abs(value - springs["tuesday"]) < 4 * std
    assert std < 0.02 * value
