"""Option --errors, which replaces the declared errors of a robot by a random draw."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from forcefit.assembly.kinematics.posture import Posture

ErrorsOption = Annotated[
    Path | None,
    typer.Option(
        help="Error distributions (TOML); one random draw replaces the declared errors "
        "of the robot."
    ),
]


def with_errors(
    posture: "Posture", errors: Path | None, seed: int, own: bool
) -> "Posture":
    """Return the posture with one random draw of errors, or with the declared errors.

    Args:
        posture: posture of the robot with its declared errors.
        errors: file with error distributions, or None to use the declared errors.
        seed: random seed of the draw.
        own: whether the draw replaces the declared errors.  Otherwise it is added to
            them, and the declared errors, with which the loops close, stay fixed.
    """
    if errors is None:
        return posture
    from forcefit.assembly.model.error_distributions import read_sources
    from forcefit.assembly.steps.bolted import bolt_joints

    fixed = None if own else posture.robot.declared_errors
    sources = read_sources(errors, posture.robot, fixed)
    errors_drawn = sources.errors(sources.draw(0, 1, seed)[0])
    return replace(posture, robot=bolt_joints(posture.robot.with_errors(errors_drawn)))
