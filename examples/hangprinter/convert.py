"""Write the robot file and the campaign folder of a Hangprinter with four anchors."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from examples.campaign_folder import from_command_line, write_campaign
from forcefit.assembly.model.placed_frames import PlacedFrame, place_frames
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.robots.placing import (
    at,
    ball_joint,
    cardan_joint,
    drive_stiffness,
)

NAME = "hangprinter"
FILE = "hp4_force_series2.csv"
LINES = ("A", "B", "C", "D")
ANCHORS = np.array([
    [0.0, -1.600, -0.110], [1.290, 1.240, -0.155],
    [-1.410, 0.740, -0.150], [0.0, 0.0, 2.350],
])  # fmt: skip
ADVANTAGE = np.array([2.0, 2.0, 2.0, 4.0])  # mechanical advantage of the blocks
GEAR = 255 / 20  # turns of the motor for one turn of the spool
RADIUS = 0.075  # [m] radius of the spools
STIFFNESS = 1e4  # [N/m] stiffness of every line; only the ratios of stiffnesses matter
CAMERA = 2e-3  # [m] standard deviation of a measured position


@dataclass(frozen=True, eq=False)
class Samples:
    """Recorded samples, with one row per sample and one column per line.

    Attributes:
        position: (k, 3) [m] position of the effector measured by a camera.
        spool: (k, 4) [rad] rotation of each spool since the first sample.
        force: (k, 4) [N] force of each line.
    """

    position: NDArray
    spool: NDArray
    force: NDArray


def read_samples(data: Path | None = None) -> Samples:
    """Return the 41 samples in SI units, by default from the folder of this file."""
    path = (data / NAME if data else Path(__file__).parent) / FILE
    table = np.genfromtxt(path, delimiter=",", names=True)
    where = np.column_stack([table[f"{axis}_mm"] for axis in "xyz"]) / 1e3
    motor = np.column_stack([table[f"motor{line}_deg"] for line in LINES])
    force = np.column_stack([table[f"force{line}_N"] for line in LINES])
    return Samples(where, np.deg2rad(motor) / GEAR, force)


def cable_robot(anchors: NDArray = ANCHORS) -> Robot:
    """Return a robot in which driven struts represent the lines of a Hangprinter.

    Args:
        anchors: (4, 3) [m] positions of the anchors.

    Returns:
        The robot with its platform at the origin.  The coordinate of ``A.line`` is
        the length of this line. The platform can rotate freely, so a pose must
        include its rotation.
    """
    placed: list[PlacedFrame] = []
    for line, anchor in zip(LINES, anchors, strict=True):
        placed += _line(line, anchor)
    closures = tuple((f"{LINES[0]}.tip", f"{line}.tip") for line in LINES[1:])
    text = "four lines to one point"
    return Robot("hangprinter", "A.tip", place_frames(placed), closures, text)


def _line(name: str, anchor: NDArray) -> Sequence[PlacedFrame]:
    """Return a strut between a cardan joint at the anchor and a ball at the origin."""
    length = float(np.linalg.norm(anchor))
    along = -anchor / length
    first = np.cross([1.0, 0.0, 0.0], along)
    first = first / np.linalg.norm(first)
    second = np.cross(along, first)
    end, origin = f"{name}.cardan", np.zeros(3)
    driven = Frame(
        f"{name}.line", f"{end}_2", joint="prismatic", actuated=True, position=length,
        joint_stiffness=drive_stiffness(STIFFNESS, "prismatic"),
    )  # fmt: skip
    return [
        *cardan_joint(end, "base", anchor, first, second),
        (driven, at(anchor, along, first)),
        *ball_joint(f"{name}.ball", driven.name, origin, first, second),
        (Frame(f"{name}.tip", f"{name}.ball_3"), at(origin)),
    ]


def commanded(samples: Samples) -> NDArray:
    """Return effector positions, (k, 3) [m], fitted to the motor angles."""
    paid = RADIUS * samples.spool / ADVANTAGE
    lengths = np.linalg.norm(ANCHORS, axis=1) + paid

    def misfit(p: NDArray, row: NDArray) -> NDArray:
        return np.linalg.norm(p - ANCHORS, axis=1) - row

    fits = [
        least_squares(misfit, p, args=(row,))
        for p, row in zip(samples.position, lengths, strict=True)
    ]
    return np.array([fit.x for fit in fits])


def convert(out: Path, data: Path | None = None) -> Path:
    """Write the campaign folder with commanded poses and measured deviations.

    Args:
        out: folder of the campaign.
        data: folder of all data sets.

    Returns:
        The folder.
    """
    samples = read_samples(data)
    pose = commanded(samples)
    columns = {f"pose.t{a}": pose[:, k] for k, a in enumerate("xyz")}
    columns |= {f"pose.r{a}": np.zeros(len(pose)) for a in "xyz"}
    deviation = samples.position - pose
    columns |= {f"meas.t{a}": deviation[:, k] for k, a in enumerate("xyz")}
    for k, line in enumerate(LINES):
        columns[f"cov.force_{line}"] = samples.force[:, k]
        columns[f"cov.spool_{line}"] = samples.spool[:, k]
    return write_campaign(out, cable_robot(), columns, (1.0, CAMERA))


if __name__ == "__main__":
    from_command_line(convert, __doc__)
