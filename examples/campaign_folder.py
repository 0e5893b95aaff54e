"""Find or download published measurements and write them as campaign folders."""

import argparse
import os
import sys
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput
from forcefit.stiffness.screws import rotation_vector
from forcefit.validation.campaign.campaign import READING

DATA = Path(__file__).parents[2] / "shared" / "data"
SOURCES = Path(__file__).parent / "data.toml"


def data_folder(name: str, data: Path | None = None) -> Path:
    """Return the folder of a data set, which is downloaded if it is absent.

    Args:
        name: name of the data set.
        data: folder of all data sets. The default is the variable
            ``FORCEFIT_DATA``, then ``../shared/data`` next to the repository, then
            the cache of ``pooch``.

    Returns:
        The folder.

    Raises:
        BadInput: the folder does not exist, and the data cannot be downloaded.
    """
    given = data or os.environ.get("FORCEFIT_DATA")
    folder = Path(given or DATA) / name
    if folder.is_dir():
        return folder
    wanted = f"{folder}: no such folder; expected the measured data in it"
    sources = tomllib.loads(SOURCES.read_text())
    if given or name not in sources:
        raise BadInput(wanted)
    try:
        return _fetched(name, sources[name])
    except ImportError as error:
        raise BadInput(
            f"{wanted}, or in the folder given by FORCEFIT_DATA; to download the data, "
            "run pip install 'forcefit[examples]' (docs/measured_data.md)"
        ) from error
    except (OSError, ValueError) as error:
        raise BadInput(f"{wanted}; the download failed: {error}") from error


def _fetched(name: str, source: dict[str, Any]) -> Path:
    """Download a data set, verify its checksums and return its folder."""
    import pooch

    folder = Path(pooch.os_cache("forcefit")) / name
    for local, (path, checksum) in source["files"].items():
        pooch.retrieve(
            f"{source['source']}/{path}", f"sha256:{checksum}",
            fname=Path(local).name, path=(folder / local).parent,
        )  # fmt: skip
    return folder


def from_command_line(
    convert: Callable[[Path, Path | None], object], about: str | None
) -> None:
    """Run a converter as a program, which prints the written folders or an error."""
    parser = argparse.ArgumentParser(description=(about or "").split("\n")[0])
    parser.add_argument("-o", "--out", type=Path, required=True)
    parser.add_argument("--data", type=Path, help="folder that contains the data sets")
    given = parser.parse_args()
    try:
        written = convert(given.out, given.data)
    except BadInput as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    folders = written.values() if isinstance(written, dict) else [written]
    print(*folders, sep="\n")


def write_campaign(
    folder: Path,
    robot: Robot,
    columns: Mapping[str, NDArray],
    sigma: tuple[float, float],
    registration: str = "unknown",
) -> Path:
    """Write a campaign folder in the public format, with the robot file in it.

    Args:
        folder: folder, created if it is absent.
        robot: robot whose platform is the point that was measured.
        columns: (k,) values of each column of ``measurements.csv``; ``id`` is added
            if it is absent.
        sigma: [rad], [m] standard deviations of a reading.
        registration: ``"known"`` or ``"unknown"``.

    Returns:
        The folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_robot(robot, folder / "robot.toml")
    (folder / "campaign.toml").write_text(
        'robot = "robot.toml"\n'
        'measurements = "measurements.csv"\n'
        f'registration = "{registration}"\n'
        f"\n[noise]\nrotation = {sigma[0]!r}\nposition = {sigma[1]!r}\n"
    )
    count = len(next(iter(columns.values())))
    table = {"id": np.array([f"m{i + 1:05d}" for i in range(count)]), **columns}
    text = [",".join(table)]
    cells = [[_cell(x) for x in column.tolist()] for column in table.values()]
    text += [",".join(row) for row in zip(*cells, strict=True)]
    (folder / "measurements.csv").write_text("\n".join(text) + "\n")
    return folder


def _cell(value: float | str) -> str:
    """Return the text of a table cell, which is empty for NaN."""
    if isinstance(value, str):
        return value
    return "" if np.isnan(value) else f"{value:.12g}"


def deviation_columns(nominal: NDArray, measured: NDArray, turn: bool) -> dict:
    """Return columns ``meas.*`` of poses measured in the frame of the device.

    The pose of the device is estimated by least squares over the positions (Kabsch,
    1976), so that the deviations are small.

    Args:
        nominal: (k, 4, 4) platform poses in base axes.
        measured: (k, 4, 4) poses in the axes of the device.
        turn: whether rotations were also measured.

    Returns:
        (k,) values of each column.
    """
    base = base_pose(nominal, measured)
    R = base[:3, :3].T
    shift = (measured[:, :3, 3] - base[:3, 3]) @ R.T - nominal[:, :3, 3]
    turned = R @ measured[:, :3, :3] @ np.swapaxes(nominal[:, :3, :3], 1, 2)
    screw = np.concatenate([rotation_vector(turned), shift], axis=1)
    kept = READING if turn else READING[3:]
    return {f"meas.{name}": screw[:, READING.index(name)] for name in kept}


def base_pose(nominal: NDArray, measured: NDArray) -> NDArray:
    """Return the (4, 4) pose of the base in the device frame, by Kabsch (1976)."""
    a, b = nominal[:, :3, 3], measured[:, :3, 3]
    U, _, Vt = np.linalg.svd((b - b.mean(0)).T @ (a - a.mean(0)))
    T = np.eye(4)
    T[:3, :3] = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    T[:3, 3] = b.mean(0) - T[:3, :3] @ a.mean(0)
    return T
