"""Apply the effects of a robot file at one posture."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.effects import LIBRARY, apply_known
from forcefit.assembly.effects.functions import covariates_of
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.measurement.conditions import COVARIATES, Conditions, as_declared
from forcefit.assembly.measurement.predict import assemble_row, read
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, nearest, quoted
from forcefit.results.display import html_table, short_repr


@dataclass(frozen=True, eq=False)
class AppliedEffects:
    """Posture, load and gravity with the effects of a robot file.

    Attributes:
        posture: posture of the robot, with the resulting errors, springs, clearances
            and foundation.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity vector in base axes; None without weight.
        conditions: conditions of one measurement, including the errors of the measuring
            device.
    """

    posture: Posture
    load: NDArray
    gravity: NDArray | None
    conditions: Conditions

    __repr__, _repr_html_ = short_repr, html_table

    def reading(self, platform_screw: ArrayLike) -> NDArray:
        """Return the device reading for a platform screw, (6,) [rad, m]."""
        return read(self.conditions, np.array(platform_screw, dtype=float)[None])[0]


def apply_robot_effects(
    posture: Posture,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    covariates: Mapping[str, float | str] | None = None,
    *,
    finite: bool = False,
) -> AppliedEffects:
    """Apply the effects of a robot file at one posture.

    Args:
        posture: posture of the robot without effects.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity vector in base axes, added to the gravity due to
            effects.
        covariates: values by name: ``temperature`` [K] above calibration, ``time`` [s],
            ``approach``, other variables of functions, and ``session``.
        finite: whether the exact model is used.

    Returns:
        Posture, loads and conditions with the effects applied.

    Raises:
        BadInput: an effect requires a missing covariate, or finite motions although
            ``finite`` is False.
    """
    given = dict(covariates or {})
    robot = posture.robot
    check_covariates(robot, given, finite=finite)
    declared_only = replace(posture, robot=robot.without_effects())
    declared = as_declared(
        declared_only,
        load,
        mismatch=posture.mismatch,
        gravity=np.zeros(3) if gravity is None else gravity,
        covariates=given,
    )
    conditions = apply_known(declared, robot)
    g = conditions.gravity[0] if conditions.gravity.any() else None
    effective = conditions.posture(0)
    if conditions.laws or conditions.yields:
        yields_exactly = finite and bool(conditions.yields)
        settled = replace(conditions, exact=yields_exactly)
        effective = assemble_row(settled, 0).posture
    if not robot.has_effects:
        effective = posture
    return AppliedEffects(effective, conditions.load_at_origin()[0], g, conditions)


def with_effects_applied(posture: Posture) -> Posture:
    """Return a posture after applying effects, for results without loads.

    Args:
        posture: posture of the declared robot.

    Returns:
        The posture with the resulting errors, springs, clearances and foundation.

    Raises:
        BadInput: an effect loads the robot, depends on covariates, or requires finite
            motions.
    """
    robot = posture.robot
    needed = dict(covariates_of(robot, []))
    for name in robot.effects:
        needed |= dict.fromkeys(LIBRARY[name].needs, name)
    for covariate, effect in needed.items():
        raise BadInput(
            f'{robot.name}: found effect "{effect}", which depends on {covariate}, but '
            "effects are applied without such conditions here; remove the effect, or "
            f"use assembly solve or validation crosscheck with --under {covariate}=.."
        )
    applied = apply_robot_effects(posture)
    if applied.gravity is not None or applied.load.any():
        raise BadInput(
            f"{robot.name}: found effects that load the robot, which are not supported "
            "here; use assembly solve or validation crosscheck instead"
        )
    return applied.posture


def errors_of_effects(declared: Posture, applied: Posture) -> NDArray | None:
    """Return the errors that effects add, which random errors must not replace.

    Args:
        declared: posture of the declared robot.
        applied: the same posture after applying effects.

    Returns:
        (n, 6) [rad, m] errors of the frames of ``applied``, or None without effects.
    """
    if not declared.robot.has_effects:
        return None
    own = {frame.name: frame.geometric_error for frame in declared.robot.frames}
    frames = applied.robot.frames
    return np.array([f.geometric_error - own.get(f.name, 0.0) for f in frames])


def check_covariates(
    robot: Robot, given: Mapping[str, float | str], *, finite: bool = False
) -> None:
    """Raise BadInput for effects that cannot be applied with the given covariates.

    Args:
        robot: robot with effects.
        given: values of the covariates by name.
        finite: whether the exact model is used.

    Raises:
        BadInput: a covariate is unknown, or an effect requires a missing covariate or
            finite motions.
    """
    session = given.get("session")
    needed = covariates_of(robot, [str(session)])
    known = [*COVARIATES, *needed, *(["session"] if robot.sessions else [])]
    for name in given:
        if name not in known:
            hint = nearest(name, known)
            raise BadInput(f'--under: unknown covariate "{name[:60]}"{hint}')
    if session is not None and session not in robot.sessions:
        hint = nearest(str(session), robot.sessions)
        raise BadInput(f"--under session: found {quoted(str(session))}{hint}")
    finite_ones = [name for name in robot.effects if LIBRARY[name].finite]
    if finite_ones and not finite:
        raise BadInput(
            f'{robot.name}: effect "{finite_ones[0]}" is defined for finite motions '
            "only; expected forcefit assembly solve --state exact"
        )
    for name in (*robot.effects, *robot.session_effects.get(str(session), ())):
        needed |= dict.fromkeys(LIBRARY[name].needs, name)
    for covariate, effect in needed.items():
        if covariate not in given:
            raise BadInput(
                f'{robot.name}: effect "{effect}" depends on {covariate}; '
                f"expected --under {covariate}=NUMBER"
            )
