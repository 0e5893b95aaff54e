"""Random geometric errors as in the paper's section IV, reproducible by a seed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.joint_names import error_rows, names_of, row_of
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, nearest, quoted

SIGNS = ("literal", "signed")


@dataclass(frozen=True)
class ErrorDraw:
    """Parameters of a draw of geometric errors delta l.

    Attributes:
        frames: names of the frames and joints with an error, in the order in which
            random numbers are drawn.
        least: (6,) [rad, m] smallest absolute value of each component.
        most: (6,) [rad, m] largest absolute value of each component.
        seed: seed of the random numbers.
        signs: ``"literal"`` for positive errors only, as the paper's interval is
            printed; or ``"signed"`` for the same absolute values with random signs.
            The paper does not state which of them it used.  The median energies of the
            two differ by a factor of five.
    """

    frames: tuple[str, ...]
    least: tuple[float, ...]
    most: tuple[float, ...]
    seed: int = 1
    signs: str = "literal"


def draw_errors(robot: Robot, draw: ErrorDraw) -> NDArray:
    """Return the errors of one draw.

    Absolute values are uniform between ``least`` and ``most``, drawn frame by frame.
    The signs are drawn afterwards from the same generator.  Both values of ``signs``
    therefore lead to equal absolute values.

    Args:
        robot: robot of n frames.
        draw: frames, sizes, seed and signs.

    Returns:
        (n, 6) [rad, m] errors; zero for frames without a drawn error.

    Raises:
        BadInput: a frame does not exist in the robot.
        ValueError: ``signs`` is unknown.
    """
    if draw.signs not in SIGNS:
        raise ValueError(f"signs is {draw.signs!r}, expected one of {SIGNS}")
    places = [place for name in draw.frames for place in error_rows(robot, name)]
    rng = np.random.default_rng(draw.seed)
    sizes = rng.uniform(draw.least, draw.most, size=(len(places), 6))
    if draw.signs == "signed":
        sizes = sizes * rng.choice([-1.0, 1.0], size=sizes.shape)
    errors = np.zeros((len(robot.frames), 6))
    for (row, order), size in zip(places, sizes, strict=True):
        errors[row, order] = size
    return errors


def frames_named(robot: Robot, names: Sequence[str]) -> tuple[str, ...]:
    """Return frames and joints by full name, or by the part after a leg's dot.

    Args:
        robot: any robot.
        names: names such as ``["leg1.link_a"]``, or ``["link_a"]`` for all legs.

    Returns:
        Full names of frames, and of joints of several frames, in the robot's order.

    Raises:
        BadInput: a name matches neither a frame nor a joint.
    """
    known = names_of(robot)
    frames = known[: len(robot.frames)]
    chosen = set()
    for name in names:
        # a name that matches a frame does not select a joint
        among = frames if name in frames else known
        fits = {k for k in among if k == name or k.split(".", 1)[-1] == name}
        if not fits:
            hint = nearest(name, known)
            raise BadInput(f"{robot.name}: no frame {quoted(name)}{hint}")
        chosen |= fits
    return tuple(sorted(chosen, key=lambda k: (row_of(robot, k), known.index(k))))
