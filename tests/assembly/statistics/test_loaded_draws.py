"""Random errors of robots under loads and weight."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from forcefit import BadInput, BeamLink, Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import (
    draw_generator,
    tolerance_sources,
)
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.clearance_positions import position_clearances
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.commands.assembly import app
from tests.tolerances_for_tests import drawn_errors

LOAD = [1.0, 2.0, 3.0, 30.0, 10.0, -100.0]


def cantilever():
    """Return a steel bar of 1 m length and 20 mm diameter, clamped at one end."""
    bar = BeamLink({"radius": 0.01}, 200e9, 0.3, theory="euler")
    frames = (Frame("tip", translation=[1.0, 0, 0], link=bar),)
    return home_posture(Robot("bar", "tip", frames))


def test_energy_and_stress_of_a_cantilever_equal_textbook_values():
    """The energy is F^2 L^3 / 6 E I, the moment is F L, and the stress is F L / W."""
    posture, F = cantilever(), 100.0
    sources = tolerance_sources(posture.robot, [1e-3] * 3 + [1e-4] * 3)
    load = (0.0, 0.0, 0.0, 0.0, 0.0, -F)
    data = run_draws(Experiment(posture, sources, margins=False, load=load), 20)
    second = np.pi * 0.01**4 / 4
    np.testing.assert_allclose(data["energy"], F**2 / (6 * 200e9 * second), rtol=1e-9)
    np.testing.assert_allclose(data["force"], F, rtol=1e-9)
    np.testing.assert_allclose(data["stress"], F * 0.01 / second, rtol=1e-2)
    sag = data["platform_screw"].values[:, 5] - sources.draw(0, 20, 1)[:, 5]
    np.testing.assert_allclose(sag, -F / (3 * 200e9 * second), rtol=1e-9)


@pytest.mark.parametrize("play", ["uniform", "contact"])
@pytest.mark.parametrize("load", [[0, 0, 0, 0, 0, -1], [0, 0, 0, 1, 0, 0]])
def test_load_does_no_work_for_motions_within_clearances(play, load):
    """Otherwise, a lower value of energy minus work would exist."""
    robot = load_robot("3rrr")
    one = linear_response(home_posture(robot), load)
    found = one.solve(drawn_errors(robot, 4.0) / 50)
    generators = [draw_generator(1, d, 1) for d in range(8)]
    settled, mixed = position_clearances(one, found, play, generators)
    assert mixed.all()
    moved = settled - found.platform_screw
    assert np.abs(moved).max() > 3e-5
    assert np.abs(moved @ load).max() < 1e-9 * np.abs(moved).max()


def test_random_errors_with_a_load_on_a_free_motion_are_rejected():
    frames = (
        Frame("pin", joint="revolute"),
        Frame("tip", "pin", translation=[0.3, 0, 0]),
    )
    robot = Robot("swing", "tip", frames)
    sources = tolerance_sources(robot, [1e-3] * 3 + [1e-4] * 3)
    swing = Experiment(home_posture(robot), sources, load=(0, 0, 0, 0, 1.0, 0))
    with pytest.raises(BadInput, match=r"^swing: .*motion"):
        run_draws(swing, 4)


def test_statistics_command_applies_load_and_gravity(tmp_path):
    """A force limit is satisfied for a small load and exceeded for a large load."""
    robot = cantilever().robot
    write_robot(robot, tmp_path / "bar.toml")
    (tmp_path / "errors.toml").write_text(
        '[[errors]]\nframes = ["tip"]\nmost = [0, 0, 0, 1e-4, 1e-4, 1e-4]\n'
    )
    said = []
    for load in ("fz=-1", "fz=-100"):
        done = CliRunner().invoke(app, [
            "statistics", str(tmp_path / "bar.toml"), "--errors",
            str(tmp_path / "errors.toml"), "--draws", "50", "--load", load, "--limit",
            "force=50", "--gravity", "z=-9.81", "--json", "-",
        ])  # fmt: skip
        assert done.exit_code == 0, done.output
        said.append(json.loads(done.stdout))
    assert [one["exceeds"]["force"]["probability"] for one in said] == [0.0, 1.0]
    assert said[1]["load"] == [0, 0, 0, 0, 0, -100]
    assert said[1]["gravity"] == [0, 0, -9.81]


@pytest.mark.parametrize("load", [None, LOAD])
def test_random_errors_replace_errors_in_the_robot_file(load):
    """The results do not depend on the errors in the robot file."""
    robot = load_robot("irsbot2")
    posture, errors = place_robot(robot), drawn_errors(robot, 4.0, 2)
    own = replace(posture, robot=robot.with_errors(0.5 * errors[::-1][0]))
    plain, other = (linear_response(p, load).solve(errors) for p in (posture, own))
    np.testing.assert_allclose(other.energy, plain.energy, rtol=1e-6)
    np.testing.assert_allclose(
        other.platform_screw, plain.platform_screw, rtol=1e-4, atol=1e-8
    )


def test_load_and_error_together_move_a_joint_to_its_limit():
    """Under the moment M, a pin with motion limit L and spring K rotates by M / K minus
    the error. For M = K L and errors of -L / 2 or L / 2, it is at its limit or within
    it.
    """
    L, K = 1e-3, 2e4
    robot = Robot("pin", "end", (
        Frame("pin", joint="revolute", clearance=Clearance(spin=L)),
        Frame("end", "pin", [1.0, 0, 0]),
        Frame("stop", link=MatrixLink(K * np.eye(6))),
        Frame("at_end", "stop", [1.0, 0, 0]),
    ), (("end", "at_end"),))  # fmt: skip
    load = np.array([0, 0, K * L, 0, 0, 0])
    errors = np.zeros((2, 4, 6))
    errors[:, 0, 2] = 0.5 * L, -0.5 * L
    found = linear_response(home_posture(robot), load).solve(errors)
    assert found.method.tolist() == ["compiled", "compiled"]
    # The spring rotates by L or, with the pin at its limit, by L / 2.
    expected = K * np.array([L, 0.5 * L]) ** 2 / 2
    assert found.energy == pytest.approx(expected, rel=1e-6)
    assert found.platform_screw[:, 2] == pytest.approx([L, 0.5 * L], rel=1e-6)
    # The certificate refers to the energy without the work of the load.
    assert (found.duality_gap() < 1e-8 * found.energy).all()


def test_load_moves_a_free_joint_to_its_motion_limit():
    """A link of stiffness K on a pin with motion limit L rotates by L + M / K."""
    L, K, M = 1e-3, 2e4, 20.0
    robot = Robot("pin", "end", (
        Frame("pin", joint="revolute", clearance=Clearance(spin=L)),
        Frame("end", "pin", [1.0, 0, 0], link=MatrixLink(K * np.eye(6))),
    ))  # fmt: skip
    errors = np.zeros((3, 2, 6))
    errors[:, 1, 2] = 0.0, 1e-4, -2e-4
    one = linear_response(home_posture(robot), [0, 0, M, 0, 0, 0])
    found = one.solve(errors)
    assert found.clearances == pytest.approx(1.0)
    assert found.energy == pytest.approx(M**2 / (2 * K), rel=1e-6)
    turned = L + M / K + errors[:, 1, 2]
    assert found.platform_screw[:, 2] == pytest.approx(turned, rel=1e-6)
