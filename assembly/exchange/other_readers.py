"""Readers of robots that other distributions install, by entry points.

A distribution names a function for the ending of its files::

    [project.entry-points."forcefit.readers"]
    cad = "their_package.robots:read"   # of files that end in .cad

``read(path)`` returns a :class:`forcefit.assembly.model.robot.Robot`; its ``BadInput``
is the message for the user.
"""

from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from forcefit.assembly.model.robot import Robot
from forcefit.inputs.errors import BadInput

GROUP = "forcefit.readers"


def has_reader(path: Path) -> bool:
    """Return whether a distribution installed a reader of this ending."""
    return bool(path.suffix) and bool(_readers(path))


def read_by_other(path: Path) -> Robot:
    """Return the robot of a file that an installed distribution reads.

    Args:
        path: file whose ending has a reader, see :func:`has_reader`.

    Returns:
        The robot.

    Raises:
        BadInput: several distributions read this ending; the reader cannot be imported,
            returns something else, or raises it.
    """
    found = _readers(path)
    if len(found) > 1:
        owners = " and ".join(sorted(map(_owner, found)))
        raise BadInput(
            f"{path}: found readers of {path.suffix} in {owners}, expected one; "
            "uninstall the others"
        )
    (point,) = found
    try:
        read = point.load()
    except (ImportError, AttributeError) as error:
        whose = f"the reader {point.value} of {_owner(point)}"
        raise BadInput(f"{path}: {whose} cannot be imported: {error}") from None
    robot = read(path)
    if not isinstance(robot, Robot):
        kind = type(robot).__name__
        raise BadInput(
            f"{path}: the reader {point.value} of {_owner(point)} returned {kind}, "
            "expected a Robot"
        )
    return robot


def _readers(path: Path) -> list[EntryPoint]:
    """Return the entry points of the ending of a file, without its dot."""
    return list(entry_points(group=GROUP, name=path.suffix[1:].lower()))


def _owner(point: EntryPoint) -> str:
    """Return the name of the distribution of an entry point."""
    return "an unknown distribution" if point.dist is None else point.dist.name
