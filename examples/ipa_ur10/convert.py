"""Write campaign folders of a UR10 that was measured by a laser tracker."""

import csv
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from examples.campaign_folder import (
    base_pose,
    data_folder,
    deviation_columns,
    from_command_line,
    write_campaign,
)
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.nominal import Target, follow
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.stiffness.screws import rotation_vector, transform

NAME = "ipa_ur10"
SERIES = {
    "A": "Series_A/measurements_grid.csv",
    "B": "Series_B/measurements_joint_configurations.csv",
}
JOINTS = (
    "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
    "wrist_1_joint", "wrist_2_joint", "wrist_3_joint",
)  # fmt: skip
SIGMA = (4e-5, 1.2e-5)  # [rad], [m] medians of the values in series B
TMAC = 1.0  # [kg] assumed mass of the target of the laser tracker
MOVED = 1e-3  # [rad] smallest change of a joint angle that is regarded as a motion


def convert(out: Path, data: Path | None = None) -> dict[str, Path]:
    """Write a campaign folder for each series.

    Args:
        out: folder of the campaigns.
        data: folder of all data sets.

    Returns:
        The folder of each series.
    """
    source = data_folder(NAME, data)
    arm = read_robot(Path(__file__).parent / "ur10.toml")
    folders = {}
    tool = np.linalg.inv(_tool(source / "Series_A" / "Trafo_TM_F_init.txt"))
    for series, file in SERIES.items():
        table = read_series(source / file)
        measured = measured_poses(table)
        if series == "A":  # the orientation of the target was not published
            T = _platform(with_target(arm, tool), table)
            turn = base_pose(T, measured)[:3, :3] @ T[:, :3, :3]
            relative = np.swapaxes(turn, 1, 2) @ measured[:, :3, :3]
            tool[:3, :3] @= Rotation.from_matrix(relative).mean().as_matrix()
        robot = with_target(arm, tool)
        columns = {f"q.{name}": table[name] for name in JOINTS}
        nominal = _platform(robot, table)
        columns |= deviation_columns(nominal, measured, turn=True)
        columns |= _covariates(table)
        folders[series] = write_campaign(out / series, robot, columns, SIGMA)
    return folders


def read_series(path: Path) -> dict[str, NDArray]:
    """Return the columns of a series in chronological order, in the units of the file.

    ``Timestamp`` is converted to seconds since the first row.  The times of series B
    are rounded in the file, so its rows are numbered instead.
    """
    with path.open(newline="") as file:
        header, *rows = csv.reader(file, delimiter=";")
    columns = dict(zip(header, zip(*rows, strict=True), strict=True))
    stamps = columns.pop("Timestamp")
    table = {
        name: np.array([float(x.replace(",", ".")) for x in texts])
        for name, texts in columns.items()
    }
    table["time"] = np.full(len(stamps), np.nan)
    if stamps[0].isdigit():
        times = [datetime.strptime(s, "%Y%m%d%H%M%S").timestamp() for s in stamps]
        table["time"] = np.array(times) - min(times)
        order = np.argsort(times, kind="stable")
        table = {name: column[order] for name, column in table.items()}
    return table


def measured_poses(table: dict[str, NDArray]) -> NDArray:
    """Return poses of the target, (k, 4, 4), in tracker axes, with R = Rx Ry Rz."""
    where = np.column_stack([table[f"measurement_{a}"] for a in "xyz"]) / 1e3
    angles = np.column_stack([table[f"measurement_r{a}"] for a in "xyz"])
    turn = Rotation.from_euler("XYZ", angles, degrees=True).as_matrix()
    return transform(where, turn)


def with_target(arm: Robot, tool: NDArray) -> Robot:
    """Return the arm with the target of the tracker on its flange."""
    turn = rotation_vector(tool[:3, :3])
    target = Frame("tmac", "flange", tool[:3, 3], turn, mass=TMAC)
    return Robot("ur10", "tmac", (*arm.frames, target), (), arm.description)


def _tool(path: Path) -> NDArray:
    """Return the orthogonalised transform, (4, 4), of a file of 3 x 4 numbers in mm."""
    T = np.loadtxt(path)
    U, _, Vt = np.linalg.svd(T[:3, :3])
    return transform(T[:3, 3] / 1e3, U @ Vt)


def _platform(robot: Robot, table: dict[str, NDArray]) -> NDArray:
    """Return nominal poses of the platform, (k, 4, 4)."""
    q = np.zeros((len(table["time"]), len(robot.frames)))
    for name in JOINTS:
        q[:, robot.index(name)] = table[name]
    home = home_posture(robot).coordinates
    return follow(robot, home, Target(coordinates=q), guess=True).transforms[:, -1]


def _covariates(table: dict[str, NDArray]) -> dict[str, NDArray]:
    """Return time, temperature, and the last direction of motion of each joint."""
    warm = table["measurement_temperature"]
    columns = {"cov.temperature": warm - np.median(warm)}
    columns["cov.gravity.z"] = np.full(len(warm), -9.81)  # the arm is upright
    if np.isfinite(table["time"]).all():
        columns["cov.time"] = table["time"]
    else:
        columns["cov.row"] = np.arange(len(warm), dtype=float)
    for name in JOINTS:
        columns[f"cov.approach_{name}"] = last_direction(table[name])
    return columns


def last_direction(q: NDArray) -> NDArray:
    """Return the sign of the last motion of a joint, (k,), or 0 before any motion."""
    side = np.sign(np.where(np.abs(np.diff(q)) > MOVED, np.diff(q), 0.0))
    moved = np.flatnonzero(side)
    latest = np.searchsorted(moved, np.arange(len(side)), side="right") - 1
    known = np.where(latest >= 0, side[moved[np.maximum(latest, 0)]], 0.0)
    return np.concatenate([[0.0], known])


if __name__ == "__main__":
    from_command_line(convert, __doc__)
