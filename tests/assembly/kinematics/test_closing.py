"""Open loops due to rounded files, errors and preloaded drives."""

import math
from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput, Frame, Robot, solve_assembly
from forcefit.assembly.kinematics.closing import preloaded, rest_in
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.robots import load_robot

OFF = 1e-4  # [m] out-of-plane error of a four-bar, which no joint motion can compensate


def bent_four_bar():
    """Return a four-bar in which the end of one link is out of plane."""
    robot = load_robot("four_bar")
    frames = tuple(
        replace(f, translation=f.translation + [0, 0, OFF]) if f.name == "rocker" else f
        for f in robot.frames
    )
    return replace(robot, frames=frames)


def test_message_about_an_open_loop_contains_the_rest_option():
    with pytest.raises(BadInput, match=r"a gap of 0.0001 m with .*with --rest NAME, "):
        home_posture(bent_four_bar())


def test_closure_gap_becomes_the_error_of_the_given_frame():
    """The error and the energy are the same for both frames."""
    energies = []
    for name in ("end_coupler", "rocker"):
        robot = rest_in(bent_four_bar(), name)
        error = robot.errors[robot.index(name)]
        assert np.abs(error[5]) == pytest.approx(OFF, rel=1e-6)
        assert np.abs(np.delete(error, 5)).max() < 1e-9
        assert home_posture(robot).mismatch < 1e-12
        energies.append(solve_assembly(home_posture(robot)).energy)
    assert energies[0] == pytest.approx(energies[1], rel=1e-6)


@pytest.mark.parametrize(
    ("name", "message"),
    [("ankle", 'no frame "ankle"'), ("crank", "found no open loop through it")],
)
def test_closure_gap_at_an_unsuitable_frame_is_rejected(name, message):
    robot = bent_four_bar() if name == "ankle" else load_robot("four_bar")
    with pytest.raises(BadInput, match=message):
        rest_in(robot, name)


def two_slides(first=2e6, second=3e6):
    """Return a platform on two driven collinear slides along x."""
    turn = [0, np.pi / 2, 0]

    def drive(name, stiffness):
        K = np.diag([np.inf] * 5 + [stiffness])
        return Frame(name, rotation=turn, joint="prismatic", actuated=True,
                     position=0.3, joint_stiffness=K)  # fmt: skip

    back = [0, -np.pi / 2, 0]
    frames = (
        drive("one", first), Frame("tip", "one", rotation=back),
        drive("two", second), Frame("end", "two", rotation=back),
    )  # fmt: skip
    return Robot("slides", "tip", frames, (("tip", "end"),))


@pytest.mark.parametrize("apart", [1e-5, -3e-3])
def test_energy_of_preloaded_drives_equals_that_of_springs_in_series(apart):
    """The energy of springs in series is k1 k2 / (k1 + k2) d^2 / 2."""
    k = 2e6, 3e6
    robot = preloaded(two_slides(*k), {"one": 0.35, "two": 0.35 + apart})
    assembly = solve_assembly(home_posture(robot))
    assert assembly.energy == pytest.approx(apart**2 / 2 * 1.2e6, rel=1e-9)
    at = home_posture(robot).pose()["tx"] + assembly.platform_screw[3]
    assert at == pytest.approx(0.35 + apart * k[1] / sum(k), abs=1e-12)
    assert robot.remarks[-1].startswith("1 of 2 drives redundant")


def test_message_about_redundant_drives_contains_the_option():
    with pytest.raises(BadInput, match="1 of 2 drives are redundant: with --mismatch"):
        place_robot(two_slides(), joints={"one": 0.3, "two": 0.32})


def test_rigid_redundant_drive_is_rejected():
    robot = two_slides()
    frames = tuple(
        replace(f, joint_stiffness=None) if f.name == "two" else f for f in robot.frames
    )
    with pytest.raises(BadInput, match="drive two: found a rigid drive"):
        preloaded(replace(robot, frames=frames), {"one": 0.3, "two": 0.3001})


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 0.05, 1.0])
def test_closure_tolerance_is_proportional_to_robot_size(scale):
    """A gap of 1e-4 times the robot's size exceeds the tolerance."""
    frames = (
        Frame("tip", translation=[scale, 0, 0]),
        Frame("post", translation=[scale, 1e-4 * scale, 0]),
    )
    with pytest.raises(BadInput, match="is open in the home pose"):
        home_posture(Robot("gap", "tip", frames, (("tip", "post"),)))
    frames = (frames[0], replace(frames[1], translation=[scale, 1e-7 * scale, 0]))
    assert home_posture(Robot("gap", "tip", frames, (("tip", "post"),))).mismatch > 0


def frame(name, parent="base", at=(0, 0, 0), **more):
    return Frame(name, parent, np.array(at, float), np.zeros(3), **more)


def parallelograms(digits, error=0.0):
    """Return an overconstrained linkage of three equal cranks with rounded numbers."""
    q = 0.7
    height = round(math.sqrt(0.05), digits) + error
    shifts = [(0.0, 0.0), (0.5, 0.0), (round(1 / 3, digits), height)]
    frames, closures = [], []
    for i, (x, y) in enumerate(shifts):
        frames += [
            frame(f"crank{i}", at=(x, y, 0), joint="revolute", position=q,
                  actuated=i == 0),
            frame(f"pin{i}", f"crank{i}", (0.3, 0, 0), joint="revolute", position=-q),
            frame(f"tip{i}", f"pin{i}", (-(1 / 3 if i == 2 else x),
                  -(math.sqrt(0.05) if i == 2 else y), 0)),
        ]  # fmt: skip
        if i:
            closures.append((f"tip{i}", "tip0"))
    return Robot("cranks", "tip0", tuple(frames), tuple(closures))


def test_closure_gap_due_to_rounding_is_accepted():
    """Rounding errors are at most 5e-7 m, and gaps below 1e-6 m are accepted."""
    posture = home_posture(parallelograms(digits=6))
    assert 1e-9 < posture.mismatch < 1e-6
    assert home_posture(parallelograms(digits=15)).mismatch < 1e-12
    moved = place_robot(parallelograms(digits=6), joints={"crank0": 0.9})
    assert moved.mismatch < 1e-6


def test_closure_gap_above_one_micrometre_is_rejected():
    with pytest.raises(BadInput, match=r'closure\[2\] \("tip2", "tip0"\)') as caught:
        home_posture(parallelograms(digits=15, error=1e-4))
    assert "expected < 1e-06" in str(caught.value)
