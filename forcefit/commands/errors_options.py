"""The option --errors, which replaces the errors of a robot by one draw."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from forcefit.assembly.kinematics.posture import Posture

ErrorsOption = Annotated[
    Path | None,
    typer.Option(
        help="Distributions of errors (TOML); one draw from them replaces the robot's "
        "declared errors."
    ),
]


def with_errors(
    posture: "Posture", errors: Path | None, seed: int, own: bool
) -> "Posture":
    """Return the posture with one draw of errors, or with the declared errors.

    Args:
        posture: with the declared errors of its robot.
        errors: file of the distributions; None for the declared errors.
        seed: of the draw.
        own: whether the draw replaces the declared errors; otherwise it is added to
            them, as errors at rest that close the loops.
    """
    if errors is None:
        return posture
    from forcefit.assembly.model.error_distributions import read_sources
    from forcefit.assembly.steps.bolted import bolt_joints

    fixed = None if own else posture.robot.declared_errors
    sources = read_sources(errors, posture.robot, fixed)
    errors_drawn = sources.errors(sources.draw(0, 1, seed)[0])
    return replace(posture, robot=bolt_joints(posture.robot.with_errors(errors_drawn)))
