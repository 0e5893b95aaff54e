"""A small TOML file that adds elasticity, clearances, tolerances to a robot.

It is separate from the robot's own file, which may then be written again, for example
by a CAD program, without loss of measured data.
"""

from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from forcefit.inputs.errors import nearest, quoted
from forcefit.inputs.table import Table, read_toml

# keys that are valid only in the robot's own file
_PLACED = ("parent", "translation", "rotation", "dh", "joint")
_WHOLE = ("name", "description", "platform", "effect", "frame")


def lay_over(robot: Mapping[str, Any], overlay: Path | str) -> Table:
    """Return a robot's table with an overlay's keys added or replaced.

    Args:
        robot: table of :func:`forcefit.assembly.files.robot_file.robot_table`; its
            paths start in the overlay's folder.
        overlay: the file: ``[[frame]]`` with a ``name`` (``*`` matches any letters) and
            any keys of a frame except those of its placement; ``platform``,
            ``description``, ``[[effect]]`` of the whole robot.

    Returns:
        The root table, ready to be read; error messages name the overlay.

    Raises:
        BadInput: the overlay is not TOML, names an unknown frame, or changes a
            placement.
    """
    given = read_toml(overlay)
    content = dict(robot)
    for key in _WHOLE[:-1]:
        if given.has(key):
            content[key] = given.content[key]
    frames = {frame["name"]: dict(frame) for frame in robot["frame"]}
    for table in given.tables("frame"):
        pattern = table.text("name", expected="the name of a frame")
        names = [
            name for name in frames if name == pattern or fnmatchcase(name, pattern)
        ]
        if not names:
            hint = nearest(pattern, frames)
            raise table.bad(
                "name",
                f"found {quoted(pattern)}, expected the name of a frame of the "
                f"robot{hint}",
            )
        for key, value in table.content.items():
            if key in _PLACED:
                raise table.bad(
                    key,
                    f"found {key} in an overlay, which cannot place frames; "
                    "remove it, or edit the robot file",
                )
            if key != "name":
                for name in names:
                    frames[name][key] = value
    given.finish()
    content["frame"] = list(frames.values())
    return Table(content, str(overlay), "")
