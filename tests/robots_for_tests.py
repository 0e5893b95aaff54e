"""Robots shared by several tests: IRSBot-2, small robots and random robots."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from forcefit.assembly.kinematics.posture import Posture, place_many
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.robots.irsbot2 import NAMES, irsbot2
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, transform

NUMBERS = json.loads((Path(__file__).parent / "irsbot2_numbers.json").read_text())


def paper_frame(key):
    """Return the frame name for a key such as ``leg1_frame8``, counted from 1."""
    leg, index = key.split("_frame")
    return f"{leg}.{NAMES[int(index) - 1]}"


def irsbot2_with(case, scale=1.0):
    """Return IRSBot-2 with the errors of one draw of the reference data."""
    robot = irsbot2()
    errors = np.zeros((len(robot.frames), 6))
    for key, value in case["dl"].items():
        errors[robot.index(paper_frame(key))] = value
    return robot.with_errors(scale * errors)


def irsbot2_over(x, z):
    """Return IRSBot-2 with the first draw, and its postures on a grid (x, z) [m]."""
    robot = irsbot2_with(NUMBERS["cases"][0])
    poses = np.full((len(x) * len(z), 6), np.nan)
    poses[:, 0], poses[:, 2] = (axis.ravel() for axis in np.meshgrid(x, z))
    return robot, place_many(robot, poses)[0]


def with_frames(robot, chosen, **changes):
    """The robot with changes of the chosen frames; a change may depend on the frame."""
    return replace(robot, frames=tuple(
        replace(f, **{k: v(f) if callable(v) else v for k, v in changes.items()})
        if chosen(f) else f for f in robot.frames
    ))  # fmt: skip


def with_bodies(robot, rng, heaviest=5.0, off=0.2):
    """Return the robot with random masses [kg] and centres of mass."""
    return replace(robot, frames=tuple(
        replace(f, mass=rng.uniform(1, heaviest),
                centre_of_mass=rng.normal(size=3) * off)
        for f in robot.frames
    ))  # fmt: skip


def with_bounded_motion(robot, rng):
    """Limit the motion of each passive joint to about 1e-4 rad or m."""

    def bounded(frame):
        if not frame.passive or frame.compliant:
            return frame
        key = "axial" if frame.joint == "prismatic" else "spin"
        clearance = frame.clearance or Clearance()
        bound = {key: float(rng.uniform(0.3, 3) * 1e-4)}
        return replace(frame, clearance=replace(clearance, **bound))

    return replace(robot, frames=tuple(bounded(f) for f in robot.frames))


def coaxial_beams(gap, stiffnesses=(1e6, 1e6), length=0.5, clearance=None):
    """Return two coaxial elastic links with a gap (6,) [rad, m] between their ends.

    The stiffness matrix of each link at its end is a multiple of the unit matrix.
    """
    K = [np.diag([k] * 6) for k in stiffnesses]
    frames = (
        Frame("one", translation=[length, 0, 0], link=MatrixLink(K[0])),
        Frame("mount", translation=[2 * length, 0, 0]),
        Frame("two", "mount", [-length, 0, 0], link=MatrixLink(K[1]),
              geometric_error=gap),
        Frame("joint", "one", clearance=clearance),
        Frame("end_one", "joint"),
        Frame("end_two", "two"),
    )  # fmt: skip
    return Robot("beams", "end_one", frames, (("end_one", "end_two"),))


def planar_four_bar(crank=0.1, coupler=0.3, rocker=0.25, ground=0.3, errors=None):
    """Return a planar four-bar linkage with an elastic coupler."""
    # law of cosines for the end of the coupler
    reach = ground - crank
    x = (coupler**2 - rocker**2 + reach**2) / (2 * reach)
    y = np.sqrt(coupler**2 - x**2)
    angle = np.arctan2(y, x)
    back = np.arctan2(y, crank + x - ground)
    frames = (
        Frame("crank", joint="revolute", actuated=True),
        Frame("pin_a", "crank", [crank, 0, 0], [0, 0, angle], joint="revolute"),
        Frame("pin_b", "pin_a", [coupler, 0, 0], joint="revolute",
              link=BeamLink({"radius": 0.01}, 70e9, 0.33)),
        Frame("end_a", "pin_b"),
        Frame("rocker", translation=[ground, 0, 0], rotation=[0, 0, back],
              joint="revolute"),
        Frame("end_b", "rocker", [rocker, 0, 0], [0, 0, angle - back]),
    )  # fmt: skip
    robot = Robot("four_bar", "end_a", frames, (("end_a", "end_b"),))
    return robot if errors is None else robot.with_errors(errors)


def small_clearance(radial=20e-6, axial=30e-6, tilt=5e-4, spin=None):
    """Return a joint clearance of typical size."""
    return Clearance(radial=radial, axial=axial, tilt=tilt, spin=spin)


def in_millimetres(robot, s=1000.0):
    """Return the same robot with lengths in another unit, of which 1 m contains s."""
    screw = np.array([1, 1, 1, s, s, s])

    def stiffness(K):
        # w = K x, in which moments and translations are s times larger
        wrench = np.array([s, s, s, 1, 1, 1])
        return K * np.outer(wrench, 1 / screw)

    def turned(frame):
        part = {}
        if frame.link is not None:
            part["link"] = MatrixLink(stiffness(frame.link.stiffness))
        if frame.joint_stiffness is not None:
            part["joint_stiffness"] = np.diag(
                np.diag(frame.joint_stiffness) * [s, s, s, 1 / s, 1 / s, 1 / s]
            )
        if frame.clearance is not None:
            c = frame.clearance
            axial = None if c.axial is None else c.axial * s
            part["clearance"] = Clearance(c.radial * s, axial, c.tilt, c.spin)
        return replace(
            frame, translation=frame.translation * s,
            geometric_error=frame.geometric_error * screw, **part,
        )  # fmt: skip

    return replace(robot, frames=tuple(turned(f) for f in robot.frames))


def random_robot(rng, legs=2, joints=3, link_share=0.7, branched=False):
    """Return a robot with random links, joints, clearances and errors.

    The joints are fixed, revolute or prismatic, and passive, driven or compliant.  The
    loops of the nominal robot are closed.
    """
    platform = _random_transform(rng)
    frames, tips = [], []
    for leg in range(legs):
        above, T = "base", np.eye(4)
        for k in range(joints):
            name = f"leg{leg}.f{k}"
            step = _random_transform(rng)
            frames.append(_random_frame(rng, name, above, step, link_share))
            above, T = name, T @ step
        last = np.linalg.inv(T) @ platform
        frames.append(Frame(f"leg{leg}.tip", above, last[:3, 3],
                            rotation_vector(last[:3, :3]),
                            geometric_error=_error(rng)))  # fmt: skip
        tips.append(f"leg{leg}.tip")
    pairs = tuple((tips[0], tip) for tip in tips[1:])
    return Robot("random", tips[0], tuple(frames), pairs)


def _random_transform(rng):
    return transform(rng.uniform(-0.5, 0.5, 3), rotation_matrix(rng.uniform(-2, 2, 3)))


def _error(rng):
    return rng.uniform(-1, 1, 6) * rng.choice([1e-4, 1e-3, 1e-2])


def _random_frame(rng, name, parent, step, link_share):
    part = {}
    if rng.random() < link_share:
        B = rng.normal(size=(6, 6))
        unit = B @ B.T + 0.5 * np.eye(6)
        size = np.array([1e3] * 3 + [3e4] * 3) * 10 ** rng.uniform(-1, 2)
        part["link"] = MatrixLink(unit * np.outer(size, size) / size.mean())
    kind = rng.choice(["fixed", "passive", "driven", "compliant"])
    if kind != "fixed":
        part["joint"] = str(rng.choice(["revolute", "prismatic"]))
        part["actuated"] = kind == "driven"
    if kind == "compliant" or (kind == "driven" and rng.random() < 0.5):
        soft = 10.0 ** rng.uniform(0, 8, 6)
        soft[rng.random(6) < 0.3] = np.inf
        own = 5 if part["joint"] == "prismatic" else 2
        soft[own] = 10 ** rng.uniform(0, 3)
        part["joint_stiffness"] = np.diag(soft)
    if rng.random() < 0.6:
        part["clearance"] = Clearance(*rng.choice([0.0, 1e-5, 1e-4, 1e-3], 3))
    return Frame(name, parent, step[:3, 3], rotation_vector(step[:3, :3]),
                 geometric_error=_error(rng), **part)  # fmt: skip


PAPERS_FRAMES = ("elbow_a", "link_a", "elbow_b", "link_b", "loop2_platform", "tip")


def with_papers_errors(robot, seed, frames=PAPERS_FRAMES, signed=False):
    """Return the robot with random errors as in the paper (up to 2e-2 rad, 2e-4 m)."""
    rng = np.random.default_rng(seed)
    size = np.array([2e-2] * 3 + [2e-4] * 3)
    errors = np.zeros((len(robot.frames), 6))
    for i, frame in enumerate(robot.frames):
        if frame.name.split(".")[-1] in frames:
            errors[i] = rng.uniform(-1.0 if signed else 0.0, 1.0, 6) * size
    return robot.with_errors(errors)


def stack(postures):
    """Return the transforms and closure errors of postures as arrays."""
    return (
        np.array([p.transforms for p in postures]),
        np.array([p.mismatch for p in postures]),
    )


def standing(robot, T, mismatch=0.0):
    """Return postures with given transforms (k, n, 4, 4) and unknown coordinates."""
    T = np.asarray(T)
    return Posture(robot, np.full(T.shape[:2], np.nan), T, mismatch)


def assemble_at(robot, T, errors=None, mismatch=0.0, method="compiled"):
    """Solve the forced assembly at postures with given transforms."""
    postures = standing(robot, T, mismatch)
    return solve_assembly(postures, errors=errors, method=method)


# quantities compared between batch and single solutions
ROWS = (
    "energy", "energy_without_clearance", "work", "platform_screw", "clearances",
    "motions", "multipliers", "elastic", "method", "duality_gap", "closure_residual",
    "clearance_excess",
)  # fmt: skip


def row(many, name):
    """Return the value of an attribute, or the result of a method without arguments."""
    value = getattr(many, name)
    return value() if callable(value) else value


def proved(many):
    """Return the certified lower bounds of the energies [J]."""
    return many.energy - many.duality_gap()
