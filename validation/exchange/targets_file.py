"""The targets file of an import: targets, and format of the exports."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from assembly.exchange.robot_files import load_robot
from assembly.model.robot import Robot
from assembly.robots import BUILT_IN
from forcefit.inputs.errors import nearest, quoted
from forcefit.inputs.table import Table, read_toml
from validation.exchange.clock import DATES
from validation.exchange.orientation import ANGLES, orders
from validation.exchange.reading import LENGTHS, Writing

_REGISTRATIONS = ("unknown", "known")
_MARKS = (".", ",")


@dataclass(frozen=True, eq=False)
class TargetsFile:
    """The content of a targets file.

    Attributes:
        file: its path.
        robot: robot as declared.
        robot_name: built-in name, or path from the targets file's folder.
        places: (3,) [m] of each target, platform axes.
        registration: ``"unknown"``: the device's pose is unknown, or ``"known"``: its
            axes are the base's.
        window: [s] between a command and its readings.
        noise: [m] one standard deviation of a reading that states none, or None.
        noise_rotation: [rad] the same for an orientation; None if none is read.
        rotations: (3,) [rad] rotation vector from the platform's axes to a target's, if
            declared; others are fitted.
        writing: notation of the exports.
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
        path: a TOML file with ``robot``, ``[targets]`` (name = [x, y, z] in m), and, to
            change defaults, ``unit``, ``decimal``, ``dates``, ``coverage``,
            ``registration``, ``window``, ``noise``, ``noise_rotation``,
            ``orientation``, ``angle_unit``, ``[rotations]``.

    Returns:
        The content.

    Raises:
        BadInput: a key is unknown, missing, or has an invalid value.
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
    """Return one of several words, None if not given."""
    return root.choice(key, valid) if root.has(key) else None


def _decimals(root: Table) -> tuple[str, str]:
    """Return the decimal marks of the exports and of the commands."""
    if not isinstance(root.get("decimal"), dict):
        mark = root.choice("decimal", _MARKS, ".")
        return mark, mark
    table = root.table("decimal")
    marks = table.choice("export", _MARKS, "."), table.choice("commands", _MARKS, ".")
    table.finish()
    return marks


def _rotations(root: Table, places: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """Return the (3,) [rad] rotation vectors of targets, platform axes."""
    if not root.has("rotations"):
        return {}
    table = root.table("rotations")
    for key in table.content:
        if key not in places:
            raise table.bad("", f"found {quoted(key)}{nearest(key, places)}")
    return {key: table.array(key, (3,), "rad", largest=10.0) for key in table.content}
