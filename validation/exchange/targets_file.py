"""Read the targets file of an import: target positions and export format."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.robots import BUILT_IN
from forcefit.inputs.errors import nearest, quoted
from forcefit.inputs.table import Table, read_toml
from forcefit.validation.exchange.clock import DATES
from forcefit.validation.exchange.orientation import ANGLES, orders
from forcefit.validation.exchange.reading import LENGTHS, Writing

_REGISTRATIONS = ("unknown", "known")
_MARKS = (".", ",")


@dataclass(frozen=True, eq=False)
class TargetsFile:
    """Content of a targets file.

    Attributes:
        file: path of the file.
        robot: the declared robot.
        robot_name: name of a built-in robot, or path relative to the targets file.
        places: mapping from the name of each target to its position (3,) [m], platform
            axes.
        registration: ``"unknown"`` if the device pose is unknown; ``"known"`` if the
            device axes are the base axes.
        window: [s] largest time between a command and its readings.
        noise: [m] standard deviation of readings for which the export contains none;
            None if undeclared.
        noise_rotation: [rad] standard deviation of an orientation; None if undeclared.
        rotations: mapping from target to the declared rotation vector (3,) [rad] from
            platform axes to target axes.  The rotations of other targets are fitted.
        writing: format of the exports.
    """

    file: Path
    robot: Robot
    robot_name: str
    places: Mapping[str, NDArray]
    registration: str
    window: float
    noise: float | None
    noise_rotation: float | None
    rotations: Mapping[str, NDArray]
    writing: Writing


def read_targets(path: Path | str) -> TargetsFile:
    """Read a targets file.

    Args:
        path: a TOML file with ``robot`` and ``[targets]`` (name = [x, y, z] in m).
            Optional keys are ``unit``, ``decimal``, ``dates``, ``coverage``,
            ``registration``, ``window``, ``noise``, ``noise_rotation``,
            ``orientation``, ``angle_unit``, ``[rotations]``.

    Returns:
        The content of the file.

    Raises:
        BadInput: a key is unknown or missing, or has an invalid value.
    """
    root = read_toml(path)
    name = root.text("robot", expected="a built-in robot or a robot file")
    table = root.table("targets")
    places = {key: table.array(key, (3,), "m", largest=1e4) for key in table.content}
    if not places:
        raise root.bad(
            "targets", "found no target, expected at least one name = [x, y, z]"
        )
    for key in places:
        if not key or set(key) & set(".:,"):
            raise table.bad("", f"found {quoted(key)}, expected a name without . , :")
    decimal, commands_decimal = _decimals(root)
    writing = Writing(
        unit=_choice(root, "unit", LENGTHS),
        decimal=decimal,
        commands_decimal=commands_decimal,
        dates=_choice(root, "dates", DATES),
        coverage=root.number("coverage", "-", 2.0, above=0.0),
        orientation=_choice(root, "orientation", orders()),
        angle_unit=_choice(root, "angle_unit", ANGLES),
        oriented=root.has("noise_rotation"),
    )
    registration = root.choice("registration", _REGISTRATIONS, "unknown")
    window = root.number("window", "s", 5.0, above=0.0)
    noise = root.number("noise", "m", above=0.0) if root.has("noise") else None
    turning = None
    if writing.oriented:
        turning = root.number("noise_rotation", "rad", above=0.0, largest=np.pi)
    rotations = _rotations(root, places)
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
        noise_rotation=turning,
        rotations=rotations,
        writing=writing,
    )


def _choice(root: Table, key: str, valid: Iterable[str]) -> str | None:
    """Read a keyword, or None if the key is absent."""
    return root.choice(key, valid) if root.has(key) else None


def _decimals(root: Table) -> tuple[str, str]:
    """Read the decimal marks of the exports and of the commands."""
    if not isinstance(root.get("decimal"), dict):
        mark = root.choice("decimal", _MARKS, ".")
        return mark, mark
    table = root.table("decimal")
    marks = table.choice("export", _MARKS, "."), table.choice("commands", _MARKS, ".")
    table.finish()
    return marks


def _rotations(root: Table, places: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """Read the declared rotation vectors (3,) [rad] of targets, platform axes."""
    if not root.has("rotations"):
        return {}
    table = root.table("rotations")
    for key in table.content:
        if key not in places:
            raise table.bad("", f"found {quoted(key)}{nearest(key, places)}")
    return {key: table.array(key, (3,), "rad", largest=10.0) for key in table.content}
