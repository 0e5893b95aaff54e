"""Tests of random and worst positions of bolted joints."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from forcefit import (
    BadInput,
    bound_pose_error,
    load_robot,
    place_robot,
    solve_assembly,
    sweep,
    write_robot,
)
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.error_distributions import read_sources, tolerance_sources
from forcefit.assembly.model.robot import Clearance, Frame, LockedAt, Robot
from forcefit.assembly.report.pose_errors import pose_error_of
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.steps.bolted import bolt_generators, bolt_joints, bolted_errors
from forcefit.assembly.steps.worst_left import BRACKET, CONVEX, worst_left
from tests.assembly.steps.robots_for_steps import spring
from tests.assembly.steps.test_bolted import at_angle, four_bar

COUNT = 2000
UNIFORM = {"left": "uniform"}
ANYWHERE = '{ joints = { crank = 0.4 }, left = "uniform" }'


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


def experiment_of(robot, crank=2.0):
    sources = tolerance_sources(robot, np.array([1e-3] * 3 + [1e-4] * 3), ("pin2",))
    posture = place_robot(robot, joints={"crank": crank})
    return Experiment(posture, sources, 7, "least", margins=False, stress=False)


def test_random_position_does_not_depend_on_other_draws(tmp_path):
    robot = load_robot(four_bar(tmp_path, ANYWHERE))
    experiment = experiment_of(robot)
    rows, alone = experiment.solve(0, 6), experiment.solve(4, 1)
    assert rows["energy"][4] == pytest.approx(alone["energy"][0], rel=1e-6)
    least = experiment_of(load_robot(four_bar(tmp_path, at_angle(0.4))))
    assert not np.allclose(rows["energy"], least.solve(0, 6)["energy"], rtol=1e-3)


def test_random_positions_have_minimum_energy(tmp_path):
    """All random positions have minimum energy at the pose of bolting."""
    robot = load_robot(four_bar(tmp_path, ANYWHERE))
    there, least = (
        experiment_of(one, crank=0.4).solve(0, 8)
        for one in (robot, load_robot(four_bar(tmp_path)))
    )
    assert there["energy"] == pytest.approx(least["energy"], rel=1e-5, abs=1e-9)


def test_sweep_and_statistics_use_same_random_positions(tmp_path):
    path = four_bar(tmp_path, ANYWHERE)
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


WORST = {"left": "worst"}
AT_WORST = '{ joints = { crank = 1.2 }, left = "worst" }'


def assert_bracket(found, expected):
    """Assert that both bounds agree with the exact value within 1e-3."""
    low, high = found
    assert expected * (1 - 1e-3) <= low <= expected * (1 + 1e-9)
    assert expected * (1 - 1e-9) <= high <= expected * (1 + 1e-3)


def left(robot, rule):
    """Return a robot whose bolted joints have another rule ``left``."""
    bolts = [f.locked_at and replace(f.locked_at, left=rule) for f in robot.frames]
    frames = zip(robot.frames, bolts, strict=True)
    return replace(robot, frames=tuple(replace(f, locked_at=b) for f, b in frames))


def test_largest_error_of_slot_with_arm_equals_closed_form():
    """A tilt of 2 mrad at an arm of 0.3 m is added to a radial clearance of 1 mm."""
    gaps = Clearance(radial=1e-3, axial=2e-4, tilt=2e-3)
    slot = Frame("slot", "base", locked_at=LockedAt(gaps, **WORST))
    arm = Frame("arm", "slot", translation=[0, 0, 0.3])
    robot = bolt_joints(Robot("slot", "arm", (slot, arm), ()))
    worst = worst_left(home_posture(robot))
    assert worst.assumption == CONVEX
    assert_bracket(worst.rotation, 2e-3)
    assert_bracket(worst.translation, np.hypot(1e-3 + 0.3 * 2e-3, 2e-4))


def test_largest_error_on_two_axial_pins_equals_closed_form():
    """Pins at 0 +- 20 um and 30 +- 20 um allow positions between 10 and 20 um."""
    frames = [Frame("guide", "base", joint="prismatic"), Frame("platform", "guide")]
    for name, error in (("left", 0.0), ("right", 30e-6)):
        axial = {"axial": 20e-6}
        frames += pin(name, axial, [0, 0, 0, 0, 0, error], **WORST)
    closures = (("platform", "left.end"), ("platform", "right.end"))
    robot = bolt_joints(Robot("pins", "platform", tuple(frames), closures))
    worst = worst_left(home_posture(robot))
    assert worst.assumption == CONVEX
    assert_bracket(worst.translation, 20e-6)
    assert worst.rotation == pytest.approx([0, 0], abs=1e-12)


@pytest.mark.parametrize("distance", [1e-4, 1.6e-4])
def test_largest_error_on_two_round_pins_equals_closed_form(distance):
    """The positions are in the intersection of two discs with a radius of 0.1 mm."""
    robot = left(platform_of_two_pins({"radial": 1e-4}, distance), "worst")
    worst = worst_left(home_posture(bolt_joints(robot)))
    assert worst.assumption == CONVEX
    assert_bracket(worst.translation, 1e-4)


@pytest.mark.parametrize("angle", [0.4, 1.6])
def test_upper_bound_exceeds_errors_of_random_positions(tmp_path, angle):
    """The errors of random positions do not exceed the upper bound."""
    robot = load_robot(str(four_bar(tmp_path, AT_WORST)))
    posture = place_robot(bolt_joints(robot), joints={"crank": angle})
    worst = worst_left(posture)
    assert worst.assumption == BRACKET
    count = 200
    anywhere = left(robot, "uniform")
    errors = np.repeat(robot.declared_errors[None], count, axis=0)
    errors = bolted_errors(anywhere, errors, bolt_generators(anywhere, 1, range(count)))
    found = bound_pose_error(solve_assembly(posture, errors=errors))
    for name in ("rotation", "translation"):
        low, high = getattr(worst, name)
        largest = np.nanmax(getattr(found, f"{name}_error")[:, 0])
        assert largest <= high
        assert 0.98 * largest <= low <= high


def test_command_error_reports_bounds_of_largest_error(tmp_path, run):
    """The command and the function return the same values."""
    path = four_bar(tmp_path, AT_WORST)
    words = ("assembly", "error", path, "--joint", "crank=0.4")
    status, text, _ = run(*words)
    assert status == 0
    assert "bolted at worst, rotation" in text
    status, text, _ = run(*words, "--json", "-")
    found = json.loads(text)["bolted_worst"]
    robot = bolt_joints(load_robot(path))
    worst = worst_left(place_robot(robot, joints={"crank": 0.4}))
    bounds = [found["translation"][key] for key in ("lower", "upper")]
    assert bounds == pytest.approx(worst.translation)
    assert found["assumption"] == BRACKET


def test_worst_position_under_load_is_rejected(tmp_path):
    """The worst position is defined only without a load."""
    robot = bolt_joints(load_robot(str(four_bar(tmp_path, AT_WORST))))
    posture = place_robot(robot, joints={"crank": 0.4})
    with pytest.raises(BadInput, match='left = "worst", expected no load'):
        pose_error_of(posture, load=[0, 0, 0, 0, 0, -1.0])
