"""Geometric errors drawn at random as in the paper's section IV, with a seed."""

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
        frames: names of the frames that get an error, in the order of drawing.
        least: (6,) [rad, m] smallest size of each component.
        most: (6,) [rad, m] largest size.
        seed: seed of the random numbers.
        signs: ``"literal"``, all positive as the paper's interval reads, or
            ``"signed"``, the same sizes with random signs.  The paper does not state
            which; the median energy differs five-fold.
    """

    frames: tuple[str, ...]
    least: tuple[float, ...]
    most: tuple[float, ...]
    seed: int = 1
    signs: str = "literal"


def draw_errors(robot: Robot, draw: ErrorDraw) -> NDArray:
    """Return the errors of one draw.

    Sizes are uniform between ``least`` and ``most``, frame by frame.  The signs come
    from the same generator afterwards, so both conventions have equal sizes.

    Args:
        robot: robot of n frames.
        draw: frames, sizes, seed and signs.

    Returns:
        (n, 6) [rad, m]; zero for frames without a drawn error.

    Raises:
        BadInput: a frame is not the robot's.
        ValueError: ``signs`` is neither of the two.
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
    """Return frames by full name, or by the part after a leg's dot in every leg.

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
        chosen |= fits or {known[robot.index(name)]}  # index() names the nearest
    return tuple(k for k in known if k in chosen)
