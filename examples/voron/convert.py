"""Write campaign folders of the homing heights of a printer at varying temperatures."""

import csv
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from examples.campaign_folder import data_folder, from_command_line, write_campaign
from forcefit.assembly.files.robot_file import read_robot

NAME = "voron_frame_expansion"
RUNS = {
    "run_a": "run_a_2021-06-13_05-41-53.csv",
    "run_b": "run_b_2021-06-13_20-04-43.csv",
}
# [m] step of the motor; the value in the header of run b, 0.0125 mm, is wrong
STEP = 0.0025e-3
SIGMA = 2.0e-6  # [m] standard deviation, from the motor step and repeated homings
OTHERS = ("bed", "chamber", "he")


def convert(out: Path, data: Path | None = None) -> dict[str, Path]:
    """Write a campaign folder for each run.

    A nozzle that is too high by d touches the homing pin at a coordinate that is lower
    by d. The deviation is therefore minus the change of the homing position.

    Args:
        out: folder of the campaigns.
        data: folder of all data sets.

    Returns:
        The folder of each run.
    """
    source = data_folder(NAME, data)
    robot = read_robot(Path(__file__).parent / "robot.toml")
    folders = {}
    for run, file in RUNS.items():
        table = read_run(source / file)
        height = table["mcu_pos_z"] * STEP
        columns = {
            "q.z": np.zeros(len(height)),
            "meas.tz": height[0] - height,
            "cov.temperature": table["frame_t"] - table["frame_t"][0],
            "cov.time": table["time"],
            "cov.sample": table["sample"],
        }
        for name in OTHERS:
            warm = table[f"{name}_t"]
            columns[f"cov.{name}_temperature"] = warm - warm[0]
        folders[run] = write_campaign(
            out / run, robot, columns, (1.0, SIGMA), registration="known"
        )
    return folders


def read_run(path: Path) -> dict[str, NDArray]:
    """Return the columns of a run, with ``time`` in seconds since its first row."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    clock = [datetime.strptime(row.pop("time"), "%Y/%m/%d-%H:%M:%S") for row in rows]
    table = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    return table | {"time": np.array([(t - clock[0]).total_seconds() for t in clock])}


if __name__ == "__main__":
    from_command_line(convert, __doc__)
