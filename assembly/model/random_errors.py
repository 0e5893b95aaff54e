"""Reproducible random geometric errors, as in section IV of the paper."""

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
    """Parameters for drawing random geometric errors delta l.

    Attributes:
        frames: names of the frames and joints with errors, in drawing order.
        least: minimum absolute value of each component (6,) [rad, m].
        most: maximum absolute value of each component (6,) [rad, m].
        seed: random seed.
        signs: ``"literal"`` for positive errors only, as the interval is printed in the
            paper, or ``"signed"`` for the same absolute values with random signs.
    """

    frames: tuple[str, ...]
    least: tuple[float, ...]
    most: tuple[float, ...]
    seed: int = 1
    signs: str = "literal"


def draw_errors(robot: Robot, draw: ErrorDraw) -> NDArray:
    """Draw random geometric errors.

    Absolute values are uniformly distributed between ``least`` and ``most`` and are
    drawn frame by frame.  The signs are drawn afterwards from the same generator, so
    that the absolute values do not depend on ``signs``.

    Args:
        robot: robot with n frames.
        draw: frames, magnitudes, seed and signs.

    Returns:
        Errors (n, 6) [rad, m]; zero for all frames that are not listed.

    Raises:
        BadInput: the robot has no frame with one of the given names.
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
    """Expand names without a leg to the full names of frames and joints.

    Args:
        robot: robot with the frames.
        names: full names, for example ``["leg1.link_a"]``, or names without the leg,
            for example ``["link_a"]``, which apply to all legs.

    Returns:
        Full names of frames and of joints with several frames, in frame order.

    Raises:
        BadInput: a name matches neither a frame nor a joint.
    """
    known = names_of(robot)
    frames = known[: len(robot.frames)]
    chosen = set()
    for name in names:
        # A frame takes precedence over a joint with the same name.
        among = frames if name in frames else known
        fits = {k for k in among if k == name or k.split(".", 1)[-1] == name}
        if not fits:
            hint = nearest(name, known)
            raise BadInput(f"{robot.name}: no frame {quoted(name)}{hint}")
        chosen |= fits
    return tuple(sorted(chosen, key=lambda k: (row_of(robot, k), known.index(k))))
