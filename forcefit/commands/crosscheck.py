"""Command ``forcefit validation crosscheck``: compare with a multibody simulation."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from forcefit.commands.errors_options import ErrorsOption, with_errors
from forcefit.commands.options import (
    DriveForceOption,
    FigureOption,
    GravityOption,
    GridOption,
    JointOption,
    JsonOption,
    LoadOption,
    MismatchOption,
    PoseOption,
    RestOption,
    RobotArgument,
    SeedOption,
    UnderOption,
    declared_posture,
    parse_covariates,
    parse_gravity,
    parse_load,
    parse_state,
)
from forcefit.commands.progress import progress_bars
from forcefit.commands.report import ReportOption, provenance
from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import (
    PICTURE,
    check_writable,
    save_figure,
    write_json,
    write_text,
)

if TYPE_CHECKING:
    from forcefit.assembly.kinematics.posture import Posture
    from forcefit.assembly.model.robot import Robot
    from forcefit.page.page import Provenance
    from forcefit.validation.crosscheck.crosscheck import Crosscheck
    from forcefit.validation.crosscheck.stiffness_check import StiffnessCheck


def parse_scales(text: str) -> list[float]:
    """Parse the scale factors on errors and loads given by ``--scale``.

    Args:
        text: comma-separated numbers, for example ``"1,0.5,0.25"``.

    Returns:
        Scale factors.

    Raises:
        BadInput: a value is not a number > 0, or fewer than two values are given.
    """
    try:
        scales = [float(part) for part in text.split(",")]
    except ValueError:
        scales = []
    if len(set(scales)) < 2 or not all(0 < s < float("inf") for s in scales):
        raise BadInput(
            f'--scale: found "{text[:60]}", expected at least two different numbers '
            "> 0, such as 1,0.5,0.25"
        )
    return scales


def crosscheck(
    robot: RobotArgument,
    pose: PoseOption = None,
    joint: JointOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    errors: ErrorsOption = None,
    seed: SeedOption = 1,
    load: LoadOption = None,
    drive_force: DriveForceOption = None,
    gravity: GravityOption = None,
    under: UnderOption = None,
    scale: Annotated[
        str,
        typer.Option(
            help="Scale factors for errors and load. Smaller factors are added if a "
            "check is undecided."
        ),
    ] = "1,0.5,0.25,0.125",
    links: Annotated[
        str, typer.Option(help="Link model of the simulation: beam | spring | fem.")
    ] = "beam",
    with_clearance: Annotated[
        bool,
        typer.Option(
            "--with-clearance", help="Include joint clearances in both models."
        ),
    ] = False,
    state: Annotated[
        str | None,
        typer.Option(
            help="Compare the platform stiffness instead of the pose. The only state "
            "is exact: around the equilibrium with errors and loads.",
        ),
    ] = None,
    grid: GridOption = None,
    json: JsonOption = None,
    figure: FigureOption = None,
    report: ReportOption = None,
    time_limit: Annotated[
        float, typer.Option(min=0.0, help="Time limit of each simulation [s].")
    ] = 600.0,
) -> None:
    """Compare with a multibody simulation at several scales.

    Errors and loads are multiplied by each scale factor.  Both models neglect joint
    clearances, unless --with-clearance is given; in that case, energies and spring
    deflections are compared instead of poses.  The exit status is 1 if a check fails,
    or if the robot has neither errors nor a load, because then there is nothing to
    compare.
    """
    from forcefit.assembly.effects.robot_effects import apply_robot_effects
    from forcefit.assembly.exchange.robot_files import load_robot
    from forcefit.assembly.kinematics.closing import closing_of
    from forcefit.validation.crosscheck.crosscheck import Crosscheck, attempt
    from forcefit.validation.crosscheck.crosscheck import crosscheck as compare_models
    from forcefit.validation.crosscheck.stiffness_check import (
        StiffnessCheck,
        check_stiffness,
    )

    scales, wrench = parse_scales(scale), parse_load(load)
    g, covariates = parse_gravity(gravity), parse_covariates(under)
    if with_clearance and figure is not None:
        raise BadInput(
            "--figure: found together with --with-clearance; remove one of the two, "
            "because no slope is computed with clearances"
        )
    if state is not None:
        parse_state(state, ("exact",))
    if state is not None and (figure is not None or grid is not None):
        raise BadInput(
            "--state: found together with --figure or --grid; remove these options, "
            "because the stiffness is compared at one pose"
        )
    if figure is not None:
        check_writable(figure, PICTURE)
    if grid is not None and (pose or joint or figure or drive_force):
        raise BadInput(
            "--grid: found together with --pose, --joint, --drive-force or --figure; "
            "expected only one of them"
        )

    own = errors is None or rest is mismatch is None
    source = provenance(robot, errors)

    def compare(posture: "Posture") -> Crosscheck | StiffnessCheck:
        drawn = with_errors(posture, errors, seed, own)
        applied = apply_robot_effects(drawn, wrench, g, covariates)
        if state is not None:
            return check_stiffness(
                applied.posture,
                applied.load,
                links,
                applied.gravity,
                time_limit,
                with_clearance,
            )
        return compare_models(
            applied.posture,
            scales,
            applied.load,
            links,
            applied.gravity,
            time_limit,
            with_clearance,
        )

    if grid is not None:
        machine = load_robot(robot, closing_of(rest, mismatch, own_errors=own))
        _crosscheck_grid(machine, grid, compare, json, report, source)
        return
    posture = declared_posture(
        robot, pose, joint, rest, mismatch, own, drive_force=drive_force
    )
    results, failure = attempt(posture.robot.name, lambda: compare(posture))
    if report is not None:
        write_text(_crosscheck_page(results, failure, source), report)
    write_json(failure if results is None else results.table(), json)
    if json != "-":
        print(failure["reason"] if results is None else results.text())
    if figure is not None and isinstance(results, Crosscheck):
        from forcefit.validation.crosscheck.plot import slope_figure

        save_figure(slope_figure(results), figure)
    if results is None or not results.passed:
        raise typer.Exit(1)


def _crosscheck_page(
    results: "Crosscheck | StiffnessCheck | None", failure: "dict[str, Any]",
    source: "Provenance",
) -> str:  # fmt: skip
    """Return the report page for a comparison at one pose."""
    from forcefit.validation.crosscheck.crosscheck import Crosscheck
    from forcefit.validation.crosscheck.report import crosscheck_page, failure_page
    from forcefit.validation.crosscheck.stiffness_page import stiffness_check_page

    if results is None:
        return failure_page(failure, source)
    if isinstance(results, Crosscheck):
        return crosscheck_page(results, source)
    return stiffness_check_page(results, source)


def _crosscheck_grid(
    machine: "Robot", grid: str, compare: "Callable[[Posture], Any]", json: str | None,
    report: Path | None, source: "Provenance",
) -> None:  # fmt: skip
    """Compare at every pose of a grid, with a progress bar."""
    from forcefit.assembly.sweeps.targets import parse_grid
    from forcefit.validation.crosscheck.poses import (
        check_poses,
        poses_table,
        poses_text,
    )

    axes = parse_grid(grid)
    with progress_bars() as update:
        rows = check_poses(machine, axes, compare, lambda d, n: update("poses", d, n))
    if report is not None:
        from forcefit.validation.crosscheck.report import poses_page

        write_text(poses_page(machine.name, rows, source), report)
    write_json(poses_table(rows), json)
    if json != "-":
        print(poses_text(rows))
    if not poses_table(rows)["passed"]:
        raise typer.Exit(1)
