"""Built-in robots; each module defines one robot and its parameters.

Start with ``five_bar.py``.  ``placing.py`` creates frames from their home poses.
"""

import os
from collections.abc import Callable
from pathlib import Path

from forcefit.assembly.files.robot_file import Closing, read_robot
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.robots.arm6 import arm6
from forcefit.assembly.robots.delta import delta
from forcefit.assembly.robots.five_bar import five_bar
from forcefit.assembly.robots.four_bar import four_bar
from forcefit.assembly.robots.hexapod import hexapod
from forcefit.assembly.robots.irsbot2 import irsbot2
from forcefit.assembly.robots.orthoglide import orthoglide
from forcefit.assembly.robots.three_rrr import three_rrr
from forcefit.inputs.table import BadInput, nearest

BUILT_IN: dict[str, Callable[[], Robot]] = {
    "irsbot2": irsbot2,
    "four_bar": four_bar,
    "five_bar": five_bar,
    "3rrr": three_rrr,
    "hexapod": hexapod,
    "delta": delta,
    "orthoglide": orthoglide,
    "arm6": arm6,
}


def load_robot(name: str | Path, close: Closing | None = None) -> Robot:
    """Load a built-in robot by its name, or a robot from a file.

    Args:
        name: name such as ``"irsbot2"``, or the path of a robot file.
        close: function from :mod:`forcefit.assembly.kinematics.closing` that closes
            open loops; None for no change.

    Returns:
        The robot.  For links with meshes or libraries, use
        :func:`forcefit.assembly.exchange.robot_files.load_robot`.

    Raises:
        BadInput: the name is neither a built-in robot nor a file, or the file is
            invalid.
    """
    if str(name) in BUILT_IN:
        robot = BUILT_IN[str(name)]()
        return robot if close is None else close(robot)
    path = Path(name)
    if not path.suffix and not os.path.exists(path):
        hint = nearest(str(name), BUILT_IN)
        raise BadInput(f'"{str(name)[:80]}": neither a built-in robot nor a file{hint}')
    return read_robot(path, close)
