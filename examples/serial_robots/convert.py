"""Write the campaign folder of a UR5 or a Barrett WAM measured by a laser tracker.

    python -m examples.serial_robots.convert FILE.csv -o FOLDER
    forcefit validation diagnose FOLDER --save corrected.toml

Data: P. Jacobi, A Hybrid Error Compensation Method for Enhancing the Pose Accuracy of
Serial Industrial Robots, Master's thesis, Tsinghua University, 2025 (MIT licence).
"""

import argparse
import csv
import sys
from pathlib import Path

import numpy as np

from examples.campaign_folder import data_folder, write_campaign
from forcefit.assembly.kinematics.posture import place_many_joints
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.robots import load_robot
from forcefit.inputs.table import BadInput

HERE = Path(__file__).parent
NAME = "serial_robots"
# [m] standard deviation, from repeatabilities of 0.1 mm and 2 mm
SIGMA = {"ur5": 3e-5, "wam": 1e-3}
_AGREES = 1e-4  # [m] largest difference between targets and the poses of the angles
_AXES = "xyz"


def convert(file: Path, out: Path) -> Path:
    """Write the campaign folder of one table of the data set.

    Args:
        file: table with the columns ``x_t`` .., ``x_dif`` .. [mm] and ``joint_1`` ..
            [degrees].
        out: folder of the campaign.

    Returns:
        The folder.

    Raises:
        BadInput: the table has other columns, or the nominal poses at these angles
            differ from the targets.
    """
    with file.open(newline="", encoding="utf-8-sig") as lines:
        rows = list(csv.DictReader(lines))
    joints = [name for name in (rows[0] if rows else ()) if name.startswith("joint_")]
    if len(joints) not in {6, 7}:
        expected = "expected joint_1 .. joint_6 (UR5) or .. joint_7 (WAM)"
        raise BadInput(f"{file}: found {len(joints)} columns of joints, {expected}")
    name = "ur5" if len(joints) == 6 else "wam"
    robot = load_robot(HERE / f"{name}.toml")
    q = np.radians([[float(row[joint]) for joint in joints] for row in rows])
    target = np.array([[float(row[f"{k}_t"]) for k in _AXES] for row in rows]) / 1e3
    deviation = (
        np.array([[float(row[f"{k}_dif"]) for k in _AXES] for row in rows]) / 1e3
    )
    _check_targets(file, robot, q, target)
    columns = {"id": np.array([f"m{row['step_order']}" for row in rows])}
    columns |= {f"q.joint{k + 1}": angle for k, angle in enumerate(q.T)}
    # The reached position is the target plus the difference, because these sums have
    # six decimals, like the output of the tracker.
    columns |= {f"meas.t{k}": deviation[:, i] for i, k in enumerate(_AXES)}
    return write_campaign(out, robot, columns, (1e-4, SIGMA[name]))


def _check_targets(
    file: Path, robot: Robot, q: np.ndarray, target: np.ndarray
) -> None:  # fmt: skip
    """Raise an error if the nominal positions differ from the targets."""
    coordinates = np.zeros((len(q), len(robot.frames)))
    coordinates[:, : q.shape[1]] = q
    postures, _ = place_many_joints(robot, coordinates)
    nominal = np.array([p.platform[:3, 3] for p in postures if p is not None])
    off = float(np.abs(nominal - target).max())
    if off > _AGREES:
        raise BadInput(f"{file}: targets differ by {off:.3g} m from the nominal poses")


def find(file: Path, data: Path | None = None) -> Path:
    """Return the path of a table that is given by its path or its name.

    Args:
        file: path, or name in the data set.
        data: folder of all data sets, see :func:`.campaign_folder.data_folder`.

    Returns:
        The path of the table.

    Raises:
        BadInput: the table does not exist.
    """
    if file.is_file():
        return file
    named = data_folder(NAME, data) / file
    if not named.is_file():
        raise BadInput(f"{file}: no such file, nor {named}; expected a table of poses")
    return named


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("file", type=Path, help="a table, or its name in the data set")
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--data", type=Path, help="folder that contains the data sets")
    given = parser.parse_args()
    try:
        print(convert(find(given.file, given.data), given.out))
    except BadInput as error:
        print(error, file=sys.stderr)
        sys.exit(2)
