"""The targets file of an import: what was measured on, how exports are written."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from assembly.exchange.robot_files import load_robot
from assembly.model.robot import Robot
from assembly.robots import BUILT_IN
from forcefit.inputs.errors import quoted
from forcefit.inputs.table import read_toml
from validation.exchange.device_table import DATES, LENGTHS, Writing

_REGISTRATIONS = ("unknown", "known")


@dataclass(frozen=True, eq=False)
class TargetsFile:
    """What a targets file says.

    Attributes:
        file: its path.
        robot: as declared.
        robot_name: built-in name, or path from the targets file's folder.
        places: (3,) [m] of each target, platform axes.
        registration: ``"unknown"``: the device stands somewhere, or ``"known"``: its
            axes are the base's.
        window: [s] between a command and its readings.
        noise: [m] one standard deviation of a reading that states none, or None.
        writing: of the exports.
    """

    file: Path
    robot: Robot
    robot_name: str
    places: Mapping[str, NDArray]
    registration: str
    window: float
    noise: float | None
    writing: Writing


def read_targets(path: Path | str) -> TargetsFile:
    """Read a targets file.

    Args:
        path: a TOML file with ``robot``, ``[targets]`` (name = [x, y, z] in m), and
            ``unit``, ``decimal``, ``dates``, ``coverage``, ``registration``,
            ``window``, ``noise`` where the defaults do not hold.

    Returns:
        What it says.

    Raises:
        BadInput: a key is unknown, missing, or holds something else.
    """
    root = read_toml(path)
    name = root.text("robot", expected="a built-in robot or a robot file")
    table = root.table("targets")
    places = {key: table.array(key, (3,), "m", largest=1e4) for key in table.content}
    if not places:
        raise root.bad("targets", "found none, expected at least one name = [x, y, z]")
    for key in places:
        if not key or set(key) & set(".:,"):
            raise table.bad("", f"found {quoted(key)}, expected no . , : in a name")
    writing = Writing(
        unit=root.choice("unit", tuple(LENGTHS)) if root.has("unit") else None,
        decimal=root.choice("decimal", (".", ","), "."),
        dates=root.choice("dates", DATES) if root.has("dates") else None,
        coverage=root.number("coverage", "-", 2.0, above=0.0),
    )
    registration = root.choice("registration", _REGISTRATIONS, "unknown")
    window = root.number("window", "s", 5.0, above=0.0)
    noise = root.number("noise", "m", above=0.0) if root.has("noise") else None
    root.finish()
    robot = load_robot(name if name in BUILT_IN else Path(path).parent / name)
    places = {key: np.array(place) for key, place in places.items()}
    return TargetsFile(
        file=Path(path),
        robot=robot,
        robot_name=name,
        places=places,
        registration=registration,
        window=window,
        noise=noise,
        writing=writing,
    )
