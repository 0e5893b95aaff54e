"""Overlays: TOML files that add elasticity, clearances and tolerances to a robot.

An overlay is separate from the robot file.  A CAD program can therefore replace the
robot file without loss of measured data.
"""

from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from forcefit.inputs.errors import nearest, quoted
from forcefit.inputs.table import Table, read_toml

# keys of a frame that an overlay cannot change
_PLACED = ("parent", "translation", "rotation", "dh", "joint")
_WHOLE = ("name", "description", "platform", "effect", "frame")


def lay_over(robot: Mapping[str, Any], overlay: Path | str) -> Table:
    """Add the keys of an overlay to a robot, and replace existing keys.

    Args:
        robot: table from :func:`forcefit.assembly.files.robot_file.robot_table`, with
            paths relative to the overlay's folder.
        overlay: path of the file. It may contain ``[[frame]]`` with a ``name`` (``*``
            matches any letters) and any keys of a frame except the keys of its
            placement. It may also contain ``platform``, ``description`` and
            ``[[effect]]``.

    Returns:
        Root table of the robot.  Error messages name the overlay as the file.

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
