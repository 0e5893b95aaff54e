"""Design parameters: numbers in a robot file, selected by paths.

A path consists of a frame name and keys, such as ``leg1.link_a.link.beam.radius`` or
``leg1.elbow.clearance.radial``. Without the leg name, it selects the frame in every
leg. A path may also begin with the name of a joint that consists of several frames,
such as ``ball.clearance.ball``.

Entries of arrays have the names x, y, z (three numbers), rx .. tz (six numbers) or xx,
yy, zz, xy, xz, yz (moments of inertia). An entry of a 6 x 6 matrix has two names:
``stiffness.rx.ty`` sets this entry and its symmetric counterpart.
"""

import copy
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from forcefit.assembly.files.drawing_file import is_drawing
from forcefit.assembly.files.robot_file import declared_robot, robot_of, robot_table
from forcefit.assembly.files.solved_links import solve_links
from forcefit.assembly.model.joint_names import NamedJoint, joint_paths
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.steps.bolted import bolt_joints
from forcefit.inputs.table import BadInput, Table, nearest, quoted, read_toml

_AXES = {3: ("x", "y", "z"), 6: ("rx", "ry", "rz", "tx", "ty", "tz")}
_MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
_ABSENT: dict[str, Any] = {  # default values of optional keys of a frame
    "geometric_error": [0.0] * 6, "mass": 0.0, "centre_of_mass": [0.0] * 3
}  # fmt: skip
_PLACED: dict[str, Any] = {"translation": [0.0] * 3, "rotation": [0.0] * 3}
_DH_UNITS = {"theta": "rad", "d": "m", "a": "m", "alpha": "rad"}
_UNITS = {
    "translation": "m", "rotation": "rad", "radial": "m", "axial": "m",
    "tilt": "rad", "spin": "rad", "ball": "m",
    "radius": "m", "inner_radius": "m", "width": "m", "height": "m", "length": "m",
    "area": "m^2", "I_y": "m^4", "I_z": "m^4", "J": "m^4", "shear_y": "1",
    "shear_z": "1", "young": "Pa", "poisson": "1", "density": "kg/m^3", "mass": "kg",
    "centre_of_mass": "m", "inertia": "kg m^2", "drive_force": "N m or N",
    "position": "rad or m",
}  # fmt: skip

Setter = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class Design:
    """Content of a robot file, whose numbers can be changed.

    Attributes:
        content: content of the file as a dictionary of plain values.
        file: name of the file. File paths in the content are relative to its folder.
        name: name of the robot if the content contains none.
        joints: joints that consist of several frames, by name.
    """

    content: dict[str, Any]
    file: str
    name: str
    joints: Mapping[str, NamedJoint] = field(default_factory=dict)

    @cached_property
    def paths(self) -> list[str]:
        """Full paths of all numbers."""
        return list(self.values)

    @cached_property
    def values(self) -> dict[str, float]:
        """Values of all numbers by full path."""
        numbers = _numbers(copy.deepcopy(self.content))
        return {path: float(value) for path, value, _ in numbers}

    def find(self, path: str) -> list[str]:
        """Return the full paths of the numbers that a path selects.

        Args:
            path: full path, or a path without the leg name.

        Returns:
            The full paths. There may be one for each leg, or one for each axis of a
            universal joint.

        Raises:
            BadInput: no number has this path.
        """
        known = self.paths
        matches = [p for p in known if p == path] or [
            p for p in known if p.partition(".")[2] == path
        ]
        for joint in () if matches else self.joints.values():
            matches += joint_paths(joint, path)
        matches = [p for p in matches if p in self.values]
        if not matches:
            hint = nearest(path, known) if known else ""
            raise BadInput(f"{self.file}: no number {quoted(path)}{hint}")
        return matches

    def changed(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Return the content of the robot file with some numbers replaced.

        Args:
            values: mapping from path to new value.

        Returns:
            The new content.

        Raises:
            BadInput: no number has a given path.
        """
        content = copy.deepcopy(self.content)
        setters = {path: setter for path, _, setter in _numbers(content)}
        for path, value in values.items():
            for full in self.find(path):
                setters[full](float(value))
        return content

    def robot(self, values: Mapping[str, float]) -> Robot:
        """Build the robot with some numbers replaced.

        Args:
            values: mapping from path to new value.

        Returns:
            The robot, checked in the same way as a robot file.

        Raises:
            BadInput: no number has a given path, a value is invalid, loops do not
                close, or the mesh or the stiffness library of a link is invalid.
        """
        robot = robot_of(Table(self.changed(values), self.file, ""), self.name)
        try:
            return bolt_joints(solve_links(robot))
        except BadInput as error:
            raise BadInput(f"{self.file}: {error}") from None

    def check(self, values: Mapping[str, float]) -> None:
        """Raise an error if numbers are invalid.

        Args:
            values: mapping from path to new value.

        Raises:
            BadInput: a number is invalid. Loop closure is not checked.
        """
        declared_robot(Table(self.changed(values), self.file, ""), self.name)


def design_of(robot: Robot) -> Design:
    """Convert a robot in memory to the content of a robot file."""
    return Design(robot_table(robot), robot.name, robot.name, robot.joints)


def load_design(name: str | Path) -> Design:
    """Load a built-in robot or a robot file as a design.

    Args:
        name: name such as ``"irsbot2"``, or the path of a robot file.

    Returns:
        The design.

    Raises:
        BadInput: the name is neither a built-in name nor a file.
    """
    from forcefit.assembly.exchange.robot_files import is_robot_file, load_robot
    from forcefit.assembly.robots import BUILT_IN

    # This raises an error if the file is invalid.
    robot = load_robot(name, links=False)
    if str(name) in BUILT_IN or not is_robot_file(Path(name)):
        return design_of(robot)
    table = read_toml(Path(name))
    if is_drawing(
        table
    ):  # bodies may be copies of other bodies, so the numbers of the frames are used
        return Design(robot_table(robot), str(name), robot.name, robot.joints)
    return Design(table.content, str(name), robot.name, robot.joints)


def unit_of(path: str) -> str:
    """Return the unit of a number; ``"SI"`` if it depends on other keys."""
    *_, above, key = path.split(".")
    if above == "dh":
        return _DH_UNITS[key]
    if above == "geometric_error":
        return "rad" if key.startswith("r") else "m"
    return _UNITS.get(key, _UNITS.get(above, "SI"))


def _numbers(content: dict[str, Any]) -> Iterator[tuple[str, float, Setter]]:
    """Yield path, value and setter function of all numbers, including omitted zeros."""
    for frame in content.get("frame", ()):
        given = dict(_ABSENT) if "dh" in frame else _ABSENT | _PLACED
        if frame.get("joint", "fixed") != "fixed":
            given["position"] = 0.0
        for key, value in given.items():
            frame.setdefault(key, copy.copy(value))
        yield from _inside(frame["name"], frame)


def _inside(path: str, table: dict[str, Any]) -> Iterator[tuple[str, float, Setter]]:
    """Yield path, value and setter function of all numbers in a TOML table."""
    for key, value in table.items():
        path_of_key = f"{path}.{key}"
        if _is_number(value):
            yield path_of_key, value, _setter(table, key)
        elif isinstance(value, dict):
            yield from _inside(path_of_key, value)
        elif isinstance(value, list) and len(value) in _AXES:
            axes = _MOMENTS if key == "inertia" else _AXES[len(value)]
            for i, name in enumerate(axes):
                if _is_number(value[i]):
                    yield f"{path_of_key}.{name}", value[i], _setter(value, i)
                elif isinstance(value[i], list) and len(value[i]) == len(axes):
                    for j, other in enumerate(axes):
                        whose = f"{path_of_key}.{name}.{other}"
                        yield whose, value[i][j], _setter_of_two(value, i, j)


def _is_number(value: object) -> bool:
    """Return whether a value is a number, but not a boolean."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _setter(place: Any, key: Any) -> Setter:
    """Return a function that assigns a number to an entry of a container."""
    return lambda number: place.__setitem__(key, number)


def _setter_of_two(rows: list[list[float]], i: int, j: int) -> Setter:
    """Return a function that assigns a number to both entries of a symmetric matrix."""

    def write(number: float) -> None:
        rows[i][j] = rows[j][i] = number

    return write
