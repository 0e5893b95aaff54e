"""Readers of robots that other distributions install, by entry points.

A distribution names a function for the ending of its files::

    [project.entry-points."forcefit.readers"]
    cad = "their_package.robots:read"   # of files that end in .cad

``read(path)`` returns a :class:`forcefit.assembly.model.robot.Robot`; its ``BadInput``
is the message for the user.
"""

from pathlib import Path

from forcefit.assembly.model.robot import Robot
from forcefit.inputs.entry_points import installed_names, load_installed, naming_owner
from forcefit.inputs.errors import BadInput

GROUP = "forcefit.readers"


def has_reader(path: Path) -> bool:
    """Return whether a distribution installed a reader of this ending."""
    return _ending(path) in installed_names(GROUP)


def read_by_other(path: Path) -> Robot:
    """Return the robot of a file that an installed distribution reads.

    Args:
        path: file whose ending has a reader, see :func:`has_reader`.

    Returns:
        The robot.

    Raises:
        BadInput: several distributions read this ending; the reader cannot be imported,
            fails, or returns something else.
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
    """Return the ending of a file, without its dot."""
    return path.suffix[1:].lower()
