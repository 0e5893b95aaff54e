"""Command ``forcefit assembly solve``."""

from typing import Annotated, Any

import typer

from forcefit.commands.answer import answer
from forcefit.commands.options import (
    DriveForceOption,
    GravityOption,
    JointOption,
    JsonOption,
    LoadOption,
    MismatchOption,
    PoseOption,
    RestOption,
    RobotArgument,
    UnderOption,
    declared_under,
    parse_state,
    posture_of,
)
from forcefit.commands.progress import one_thread, progress_lines
from forcefit.inputs.errors import BadInput, nearest

_MARGINS = ("margin", "margin_free")


def solve(
    robot: RobotArgument,
    pose: PoseOption = None,
    joint: JointOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    load: LoadOption = None,
    drive_force: DriveForceOption = None,
    gravity: GravityOption = None,
    under: UnderOption = None,
    state: Annotated[
        str,
        typer.Option(
            help="contact (small motions) | exact (finite motions, which satisfy the "
            "loop closures exactly)."
        ),
    ] = "contact",
    quantities: Annotated[
        str | None,
        typer.Option(
            help="margin: compute only the zone margins, that is, the factors on all "
            "clearances at which the robot can just be assembled without force."
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Solve the forced assembly: mobility, energy, pose, wrenches."""
    exact = parse_state(state, ("contact", "exact")) == "exact"
    if quantities is not None:
        _check_margins(quantities, exact, load=load, gravity=gravity, under=under)
        _solve_margins(robot, pose, joint, rest, mismatch, drive_force, json)
        return
    applied = declared_under(
        robot, pose, joint, load, gravity, under, finite=exact, rest=rest,
        mismatch=mismatch, note=exact, drive_force=drive_force,
    )  # fmt: skip
    results, text = _exact_results(applied) if exact else _results(applied)
    answer(results, text, results["status"], json)


def _results(applied: Any) -> tuple[dict[str, Any], str]:
    """Return results for small motions, problem (22), also as text."""
    from forcefit.assembly.model.statuses import OK
    from forcefit.assembly.report.results import solution_of, solution_text

    with one_thread():
        results = solution_of(applied.posture, applied.load, applied.gravity)
    if results["status"] == OK and applied.conditions.reads_otherwise:
        results["reading"] = applied.reading(results["platform_screw"])
    return results, solution_text(results)


def _exact_results(applied: Any) -> tuple[dict[str, Any], str]:
    """Return results for finite motions, also as text."""
    from forcefit.assembly.report.results import exact_of, exact_text

    with one_thread(), progress_lines() as update:
        results = exact_of(
            applied.posture, applied.load, applied.gravity,
            lambda done, most: update("steps", done, most),
        )  # fmt: skip
    return results, exact_text(results)


def _check_margins(quantities: str, exact: bool, **loads: list[str] | None) -> None:
    """Raise BadInput for quantities other than margins and for inapplicable options."""
    for name in (part.strip() for part in quantities.split(",")):
        if name not in _MARGINS:
            hint = nearest(name, _MARGINS)
            raise BadInput(f'--quantities: found "{name[:60]}"{hint}')
    given = [name for name, texts in loads.items() if texts]
    for name in [*given, *(["state"] if exact else [])]:
        raise BadInput(
            f"--{name}: found together with --quantities {quantities}; the margins "
            f"are computed without loads and for small motions: remove --{name}"
        )


def _solve_margins(
    robot: str, pose: list[str] | None, joint: list[str] | None, rest: str | None,
    mismatch: str | None, drive_force: list[str] | None, json: str | None,
) -> None:  # fmt: skip
    """Write and print the zone margins, without computing link stiffnesses."""
    from forcefit.assembly.report.first_order import singular_status
    from forcefit.assembly.report.results import zone_of, zone_text

    posture = posture_of(
        robot, pose, joint, rest, mismatch, links=False, drive_force=drive_force
    )
    margins = zone_of(posture) | singular_status(posture)
    results = {"robot": robot, "zone": margins}
    answer(
        results, zone_text(results | {"pose": posture.pose()}), margins["status"], json
    )
