"""Tests of random positions of bolted joints."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.model.error_distributions import read_sources, tolerance_sources
from forcefit.assembly.model.robot import Clearance, Frame, LockedAt, Robot
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.steps.bolted import bolt_generators, bolt_joints, bolted_errors
from forcefit.assembly.sweeps.robot_sweep import sweep
from forcefit.inputs.table import BadInput
from tests.assembly.steps.robots_for_steps import spring
from tests.assembly.steps.test_bolted import four_bar

COUNT = 2000
UNIFORM = {"left": "uniform"}


def pin(name, radius, error, **more):
    """Return the frames of a rigid leg on a bolted pin with clearance."""
    bolt = LockedAt(Clearance(**radius), **more)
    return (
        Frame(name, "base", geometric_error=error, locked_at=bolt),
        Frame(f"{name}.end", name),
    )


def bolted(robot, count=COUNT, seed=3):
    """Return the motions within clearances at which random machines are bolted."""
    errors = np.repeat(robot.errors[None], count, axis=0)
    rngs = bolt_generators(robot, seed, range(count))
    return bolted_errors(robot, errors, rngs) - errors


def platform_of_two_pins(radius, distance):
    """Return a platform on two pins, with an error of their distance along x."""
    frames = [
        Frame("y", "base", rotation=[-np.pi / 2, 0, 0], joint="prismatic"),
        Frame("back", "y", rotation=[np.pi / 2, 0, 0]),
        Frame("x", "back", rotation=[0, np.pi / 2, 0], joint="prismatic"),
        Frame("platform", "x", rotation=[0, -np.pi / 2, 0]),
    ]
    frames += pin("left", radius, [0, 0, 0, 0, 0, 0], **UNIFORM)
    frames += pin("right", radius, [0, 0, 0, distance, 0, 0], **UNIFORM)
    closures = (("platform", "left.end"), ("platform", "right.end"))
    return Robot("two pins", "platform", tuple(frames), closures)


def test_random_positions_in_slot_are_uniform():
    """The squared radius and the axial position have uniform distributions."""
    frames = pin("slot", {"radial": 1e-3, "axial": 2e-4}, np.zeros(6), **UNIFORM)
    screws = bolted(Robot("slot", "slot.end", frames, ()))[:, 0]
    squares = (screws[:, 3] ** 2 + screws[:, 4] ** 2) / 1e-6
    assert stats.kstest(squares, "uniform").pvalue > 1e-3
    assert stats.kstest(screws[:, 5] / 4e-4 + 0.5, "uniform").pvalue > 1e-3
    assert not screws[:, :3].any()


def test_random_positions_on_two_pins_are_uniform(rng):
    """Rejection sampling of the intersection of two discs is the reference."""
    robot = platform_of_two_pins({"radial": 1e-4}, 1e-4)
    left = bolted(robot)[:, 4, 3:5] / 1e-4
    points = rng.uniform(-1, 1, (40_000, 2))
    shifted = points - [1, 0]
    inside = (points**2).sum(axis=1) <= 1
    inside &= (shifted**2).sum(axis=1) <= 1
    for axis in (0, 1):
        found = stats.ks_2samp(left[:, axis], points[inside, axis])
        assert found.pvalue > 1e-3


def test_single_possible_position_is_found():
    """The error is twice the clearance, so only one position closes the loop."""
    robot = platform_of_two_pins({"radial": 1e-4}, 2e-4)
    screws = bolted(robot, 20)
    assert screws[:, 4, 3] == pytest.approx(np.full(20, 1e-4), rel=1e-5)
    assert screws[:, 4, 4] == pytest.approx(np.zeros(20), abs=1e-6)


def test_pins_with_contact_force_do_not_move_randomly():
    """An error of 50 um exceeds the clearances of +- 20 um of two pins.

    A third clearance has no contact force.
    """
    frames = [Frame("guide", "base", joint="prismatic"), Frame("platform", "guide")]
    frames += pin("left", {"axial": 20e-6}, np.zeros(6), **UNIFORM)
    frames += pin("right", {"axial": 20e-6}, [0, 0, 0, 0, 0, 50e-6], **UNIFORM)
    frames[4] = replace(frames[4], link=spring(1e6, 5))
    slot, end = pin("slot", {"radial": 1e-3}, np.zeros(6), **UNIFORM)
    closures = (("platform", "left.end"), ("platform", "right.end"))
    robot = Robot("pressed", "platform", (*frames, slot, end), closures)
    screws = bolted(robot, 400)
    assert screws[:, 2, 5] == pytest.approx(np.full(400, 20e-6), rel=1e-5)
    assert screws[:, 4, 5] == pytest.approx(np.full(400, -20e-6), rel=1e-5)
    squares = (screws[:, 6, 3:5] ** 2).sum(axis=1) / 1e-6
    assert stats.kstest(squares, "uniform").pvalue > 1e-3


def experiment_of(robot):
    sources = tolerance_sources(robot, np.array([1e-3] * 3 + [1e-4] * 3), ("pin2",))
    posture = place_robot(robot, joints={"crank": 2.0})
    return Experiment(posture, sources, 7, "least", margins=False, stress=False)


def test_random_position_does_not_depend_on_other_draws(tmp_path):
    key = '{ joints = { crank = 0.4 }, left = "uniform" }'
    robot = load_robot(four_bar(tmp_path, key))
    experiment = experiment_of(robot)
    rows, alone = experiment.solve(0, 6), experiment.solve(4, 1)
    assert rows["energy"][4] == pytest.approx(alone["energy"][0], rel=1e-6)
    least = experiment_of(
        load_robot(four_bar(tmp_path, "{ joints = { crank = 0.4 } }"))
    )
    assert not np.allclose(rows["energy"], least.solve(0, 6)["energy"], rtol=1e-3)


def test_random_positions_have_minimum_energy(tmp_path):
    """All random positions have minimum energy at the pose of bolting."""
    key = '{ joints = { crank = 0.4 }, left = "uniform" }'
    robot = load_robot(four_bar(tmp_path, key))
    experiment = experiment_of(robot)
    there = replace(
        experiment, posture=place_robot(robot, joints={"crank": 0.4})
    ).solve(0, 8)
    loose = load_robot(four_bar(tmp_path))
    least = replace(
        experiment_of(loose), posture=place_robot(loose, joints={"crank": 0.4})
    ).solve(0, 8)
    assert there["energy"] == pytest.approx(least["energy"], rel=1e-5, abs=1e-9)


def test_sweep_and_statistics_use_same_random_positions(tmp_path):
    key = '{ joints = { crank = 0.4 }, left = "uniform" }'
    path = four_bar(tmp_path, key)
    errors = tmp_path / "errors.toml"
    errors.write_text('[[errors]]\nframes = ["pin2"]\nmost = [5e-3, 0, 0, 0, 0, 0]\n')
    data = sweep(
        path, grid="q.crank=2.0", errors=errors, draws=3, seed=7, assumption="none"
    )
    robot = load_robot(path)
    own = replace(experiment_of(robot), sources=read_sources(errors, robot))
    energies = np.asarray(data["energy"]).ravel()
    assert energies == pytest.approx(own.solve(0, 3)["energy"], rel=1e-6, abs=1e-12)


def test_bolting_rule_is_unchanged_after_writing_and_reading(tmp_path):
    robot = load_robot(four_bar(tmp_path, '{ left = "uniform" }'))
    write_robot(robot, tmp_path / "again.toml")
    bolt = load_robot(tmp_path / "again.toml").frame("stand").locked_at
    assert bolt.left == "uniform"
    assert not bolt.pose
    assert not bolt.joints


@pytest.mark.parametrize("key", ['{ left = "normal" }', "{ left = 3 }"])
def test_unknown_bolting_rule_is_rejected(tmp_path, key):
    with pytest.raises(BadInput) as caught:
        load_robot(four_bar(tmp_path, key))
    assert "locked_at.left: found" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_nominal_robot_is_bolted_at_smallest_sum_of_squares():
    frames = pin("slot", {"radial": 1e-3}, np.zeros(6), **UNIFORM)
    robot = bolt_joints(Robot("slot", "slot.end", frames, ()))
    assert not robot.frame("slot").locked_at.screw.any()
    assert robot.remarks[-1].endswith("at random positions of minimum energy")
