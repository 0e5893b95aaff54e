"""Additional robots for the evaluation of the cross-check.

``hexapod`` is a Gough-Stewart platform with six legs of steel tubes.  ``three_rrr`` is
a planar 3-RRR robot, which has an overconstraint of six in space.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.assembly.robots import load_robot

PLAY = Clearance(radial=2e-5, axial=2e-5, tilt=5e-4)


def _vector(R: np.ndarray) -> np.ndarray:
    """Return the rotation vector of a rotation matrix."""
    return Rotation.from_matrix(R).as_rotvec()


def _axes_along(x: np.ndarray) -> np.ndarray:
    """Return axes with the x axis along a direction."""
    x = x / np.linalg.norm(x)
    y = np.cross([0.3, 1.0, 0.2], x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def hexapod(play: bool = False) -> Robot:
    """Return a hexapod whose legs have a universal joint, a locked slide and pins.

    Args:
        play: whether the last pin has clearances.

    Returns:
        The robot with its platform 0.6 m above the base.
    """
    tube = BeamLink({"radius": 0.012, "inner_radius": 0.008}, 200e9, 0.3)
    bush = np.diag([2e5, 2e5, 50.0, 2e8, 2e8, 2e8])
    frames, closures = [], []
    for k in range(6):
        foot = np.deg2rad(120 * (k // 2) + (20 if k % 2 else -20))
        head = np.deg2rad(120 * (k // 2) + (45 if k % 2 else -45))
        a = 0.5 * np.array([np.cos(foot), np.sin(foot), 0.0])
        b = np.array([0.3 * np.cos(head), 0.3 * np.sin(head), 0.6])
        R = _axes_along(b - a)
        length = float(np.linalg.norm(b - a))
        turn = np.array([0.0, np.pi / 2, 0.0])  # rotates z to the axis of the leg
        back = np.array([0.0, -np.pi / 2, 0.0])
        name = f"leg{k}"
        frames += [
            Frame(f"{name}.first", translation=a, rotation=_vector(R),
                  joint="revolute"),
            Frame(f"{name}.second", f"{name}.first", rotation=[np.pi / 2, 0, 0],
                  joint="revolute"),
            Frame(f"{name}.slide", f"{name}.second", rotation=turn, joint="prismatic",
                  actuated=True, position=length / 2),
            Frame(f"{name}.rod", f"{name}.slide", rotation=back,
                  translation=[0, 0, length / 2], joint="revolute",
                  link=BeamLink(tube.section, tube.young, tube.poisson,
                                length=length, axis=(1.0, 0.0, 0.0))),
            Frame(f"{name}.ball2", f"{name}.rod", rotation=[np.pi / 2, 0, 0],
                  joint="revolute"),
            Frame(f"{name}.ball3", f"{name}.ball2", rotation=[0, np.pi / 2, 0],
                  joint="revolute", joint_stiffness=bush,
                  clearance=PLAY if play else None),
        ]  # fmt: skip
        rotation = R @ Rotation.from_euler("X", np.pi).as_matrix()
        rotation = rotation @ Rotation.from_euler("Y", np.pi / 2).as_matrix()
        frames.append(
            Frame(
                f"{name}.tip",
                f"{name}.ball3",
                rotation=_vector(rotation.T),
                translation=rotation.T @ (np.array([0, 0, 0.6]) - b),
            )
        )
        if k:
            closures.append(("leg0.tip", f"{name}.tip"))
    return Robot("hexapod", "leg0.tip", tuple(frames), tuple(closures))


def three_rrr(play: bool = False) -> Robot:
    """Return a 3-RRR robot with aluminium bars and stiff pins.

    Args:
        play: whether the last pins have clearances.

    Returns:
        The robot with its platform in the middle.
    """
    bar = BeamLink({"width": 0.03, "height": 0.02}, 70e9, 0.33, up=(0.0, 0.0, 1.0))
    frames, closures = [], []
    for k in range(3):
        angle = 2 * np.pi * k / 3
        base = 0.5 * np.array([np.cos(angle), np.sin(angle), 0])
        name = f"leg{k}"
        frames += [
            Frame(f"{name}.drive", translation=base, rotation=[0, 0, angle + 2.4],
                  joint="revolute", actuated=True),
            Frame(f"{name}.elbow", f"{name}.drive", translation=[0.3, 0, 0], link=bar,
                  joint="revolute"),
            Frame(f"{name}.wrist", f"{name}.elbow",
                  translation=[0.25 * np.cos(1.2), 0.25 * np.sin(1.2), 0], link=bar,
                  joint="revolute", clearance=PLAY if play else None),
        ]  # fmt: skip
        elbow = base + 0.3 * np.array([np.cos(angle + 2.4), np.sin(angle + 2.4), 0])
        wrist = elbow + 0.25 * np.array([np.cos(angle + 3.6), np.sin(angle + 3.6), 0])
        R = Rotation.from_rotvec([0, 0, angle + 2.4]).as_matrix()
        frames.append(
            Frame(
                f"{name}.tip",
                f"{name}.wrist",
                rotation=[0, 0, -(angle + 2.4)],
                translation=-R.T @ wrist,
            )
        )
        if k:
            closures.append(("leg0.tip", f"{name}.tip"))
    return Robot("three_rrr", "leg0.tip", tuple(frames), tuple(closures))


def papers_robot(seed: int, signed: bool) -> Robot:
    """Return IRSBot-2 with random errors at the frames of the paper.

    Args:
        seed: seed of the random numbers.
        signed: whether errors have random signs.  Otherwise, all are positive.

    Returns:
        The robot with errors of up to 2e-2 rad and 2e-4 m.
    """
    robot = load_robot("irsbot2")
    rng = np.random.default_rng(seed)
    erring = ("elbow_a", "link_a", "elbow_b", "link_b", "loop2_platform", "tip")
    errors = np.zeros((len(robot.frames), 6))
    for i, frame in enumerate(robot.frames):
        if frame.name.split(".")[-1] in erring:
            draw = rng.uniform(-1 if signed else 0, 1, 6)
            errors[i] = draw * ([2e-2] * 3 + [2e-4] * 3)
    return robot.with_errors(errors)


def drawn(robot: Robot, seed: int, turn: float, shift: float) -> Robot:
    """Return a robot with random errors of all elastic links and frames of closures.

    Args:
        robot: nominal robot.
        seed: seed of the random numbers.
        turn: [rad] largest rotation about an axis.
        shift: [m] largest translation along an axis.

    Returns:
        The robot with errors.
    """
    rng = np.random.default_rng(seed)
    errors = np.zeros((len(robot.frames), 6))
    ends = {name for pair in robot.closures for name in pair}
    for i, frame in enumerate(robot.frames):
        if frame.link is not None or frame.name in ends:
            errors[i] = rng.uniform(-1, 1, 6) * ([turn] * 3 + [shift] * 3)
    return robot.with_errors(errors)
