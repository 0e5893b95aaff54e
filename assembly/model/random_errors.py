"""Random geometric errors as in the paper's section IV, from a seed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Robot

SIGNS = ("literal", "signed")


@dataclass(frozen=True)
class ErrorDraw:
    """Parameters of a draw of geometric errors delta l.

    Attributes:
        frames: names of the frames with an error, in the order of drawing.
        least: (6,) [rad, m] smallest size of each component.
        most: (6,) [rad, m] largest size of each component.
        seed: seed of the random numbers.
        signs: ``"literal"`` for positive errors, as the paper's interval is printed, or
            ``"signed"`` for the same sizes with random signs.  The paper does not state
            which is meant; the median energies differ by a factor of five.
    """

    frames: tuple[str, ...]
    least: tuple[float, ...]
    most: tuple[float, ...]
    seed: int = 1
    signs: str = "literal"


def draw_errors(robot: Robot, draw: ErrorDraw) -> NDArray:
    """Return the errors of one draw.

    Sizes are uniform between ``least`` and ``most``, frame by frame.  The signs are
    drawn afterwards from the same generator, so both conventions have equal sizes.

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
    rows = [robot.index(name) for name in draw.frames]
    rng = np.random.default_rng(draw.seed)
    sizes = rng.uniform(draw.least, draw.most, size=(len(rows), 6))
    if draw.signs == "signed":
        sizes = sizes * rng.choice([-1.0, 1.0], size=sizes.shape)
    errors = np.zeros((len(robot.frames), 6))
    errors[rows] = sizes
    return errors


def frames_named(robot: Robot, names: Sequence[str]) -> tuple[str, ...]:
    """Return frames by full name, or by the part after the dot in every leg.

    Args:
        robot: any robot.
        names: names such as ``["leg1.link_a"]``, or ``["link_a"]`` for all legs.

    Returns:
        Full names in the robot's order.

    Raises:
        BadInput: a name matches no frame.
    """
    known = [f.name for f in robot.frames]
    chosen = set()
    for name in names:
        fits = {k for k in known if k == name or k.split(".", 1)[-1] == name}
        chosen |= fits or {known[robot.index(name)]}  # index() suggests a similar name
    return tuple(k for k in known if k in chosen)
