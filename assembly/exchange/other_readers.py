"""Readers for robot files from other Python packages.

A package declares a function for the suffix of its files as an entry point::

    [project.entry-points."forcefit.readers"]
    cad = "their_package.robots:read"   # for files with the suffix .cad

``read(path)`` returns a :class:`forcefit.assembly.model.robot.Robot`. The message of a
``BadInput`` error that it raises is shown to the user.
"""

from pathlib import Path

from forcefit.assembly.model.robot import Robot
from forcefit.inputs.entry_points import installed_names, load_installed, naming_owner
from forcefit.inputs.errors import BadInput

GROUP = "forcefit.readers"


def has_reader(path: Path) -> bool:
    """Return whether an installed package provides a reader for a file suffix."""
    return _ending(path) in installed_names(GROUP)


def read_by_other(path: Path) -> Robot:
    """Read a robot with the reader of an installed package.

    Args:
        path: file with a suffix for which a reader exists; see :func:`has_reader`.

    Returns:
        Robot.

    Raises:
        BadInput: several packages read this suffix, or the reader cannot be imported,
            fails, or does not return a robot.
    """
    try:
        read, words = load_installed(GROUP, _ending(path), "reader")
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None
    robot = naming_owner(read, f"{path}: {words}")(path)
    if not isinstance(robot, Robot):
        kind = type(robot).__name__
        raise BadInput(f"{path}: {words} returned {kind}, expected a Robot")
    return robot


def _ending(path: Path) -> str:
    """Return the suffix of a file without the dot."""
    return path.suffix[1:].lower()
