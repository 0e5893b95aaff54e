"""Command ``forcefit assembly stiffness``."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from forcefit.commands.options import (
    AlongOption,
    AtOption,
    DriveForceOption,
    FigureOption,
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
    parse_assignments,
    parse_covariates,
    parse_direction,
    parse_point,
    parse_state,
)
from forcefit.commands.progress import one_thread
from forcefit.inputs.errors import BadInput, checked
from forcefit.inputs.writing import PICTURE, check_writable, save_figure, write_json

if TYPE_CHECKING:
    from numpy.typing import NDArray


def stiffness(
    robot: RobotArgument,
    pose: PoseOption = None,
    joint: JointOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    load: LoadOption = None,
    drive_force: DriveForceOption = None,
    gravity: GravityOption = None,
    under: UnderOption = None,
    at: AtOption = None,
    along: AlongOption = None,
    state: Annotated[
        str,
        typer.Option(
            help="nominal (clearances at zero; for robots with clearances, contact is "
            "computed as well) | contact (errors, loads, clearances) | exact (includes "
            "stiffening and softening by loads and internal forces)."
        ),
    ] = "nominal",
    length: Annotated[
        float | None,
        typer.Option(
            help="[m] Characteristic length by which angles are multiplied in "
            "eigenstiffnesses."
        ),
    ] = None,
    by: Annotated[
        list[str] | None,
        typer.Option(
            help="Path of a value in the robot file; also compute the derivative of "
            "the compliance with respect to this value."
        ),
    ] = None,
    figure: FigureOption = None,
    json: JsonOption = None,
) -> None:
    """Compute platform stiffness and compliance contributions."""
    from forcefit.assembly.model.statuses import OK
    from forcefit.assembly.report.platform_stiffness import stiffness_of, stiffness_text
    from forcefit.assembly.report.share_pictures import plot_shares

    if figure is not None:
        check_writable(figure, PICTURE)
    if by and drive_force:
        raise BadInput(
            "--by: found together with --drive-force; declare drive_force in the robot "
            "file instead, because the derivatives are computed from this file"
        )
    if length is not None:
        checked("--length", length, "m", above=0)
    point = parse_point(at)
    way = parse_direction(along)
    word = parse_state(state)
    applied = declared_under(
        robot, pose, joint, load, gravity, under, finite=word == "exact", rest=rest,
        mismatch=mismatch, drive_force=drive_force,
    )  # fmt: skip
    with one_thread():
        results = stiffness_of(
            applied.posture, applied.load, applied.gravity, point, word, length,
            way,
        )  # fmt: skip
        if by and "compliance" in results:
            states = {"slopes": word}
            if "contact" in results:
                states["slopes_contact"] = "contact"
            asked = (applied.load, applied.gravity, point)
            for key, one in states.items():
                results[key], results["cannot_change"] = _slopes(
                    robot, by, pose, joint, (one, *asked), under
                )
    write_json(results, json)
    if json != "-":
        print(stiffness_text(results))
        _print_slopes(results)
    if figure is not None and "shares" in results:
        save_figure(plot_shares(results), figure)
    if results["status"] != OK or results.get("cannot_change"):
        raise typer.Exit(1)


def _slopes(
    robot: str,
    by: list[str],
    pose: list[str] | None,
    joint: list[str] | None,
    asked: tuple[Any, ...],
    under: list[str] | None,
) -> "tuple[dict[str, NDArray], dict[str, str]]":
    """Return compliance derivatives in one state, and reasons for missing ones."""
    from forcefit.assembly.platform_stiffness.tangent_slopes import TangentState
    from forcefit.assembly.sweeps.parameters import load_design
    from forcefit.assembly.sweeps.stiffness_slopes import CannotChange, stiffness_slopes

    design, state = load_design(robot), TangentState(*asked)
    at = parse_assignments(pose, "--pose") if pose else None
    joints = parse_assignments(joint, "--joint") if joint else None
    covariates = parse_covariates(under)
    slopes: dict[str, NDArray] = {}
    reasons: dict[str, str] = {}
    for path in by:
        try:
            slopes |= stiffness_slopes(design, [path], at, joints, state, covariates)
        except CannotChange as error:
            reasons[path] = str(error)
    return slopes, reasons


def _print_slopes(results: dict[str, Any]) -> None:
    """Print one line per derivative, or the reason why it is missing."""
    for key in ("slopes", "slopes_contact"):
        name = key.removeprefix("slopes").replace("_", " ")
        for path, slope in results.get(key, {}).items():
            text = f"dC/d({path}){name}"
            if (slope != slope).all():  # NaN
                print(
                    f"{text}: no derivative exists; the platform moves freely, or a "
                    "clearance touches its bound without force"
                )
            else:
                print(f"{text}, diagonal: {slope.diagonal()}")
    for reason in results.get("cannot_change", {}).values():
        print(reason)
