"""The commands ``forcefit validation ...``: parse options, call a function, print."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from forcefit.commands.correction import carry, compensate, explain, predict
from forcefit.commands.diagnose import diagnose
from forcefit.commands.exchange import import_
from forcefit.commands.generate import generate
from forcefit.commands.help import Commands
from forcefit.commands.inspect import inspect
from forcefit.commands.options import (
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
    declared_posture,
    parse_covariates,
    parse_gravity,
    parse_load,
    parse_state,
    posture_of,
)
from forcefit.commands.plan import plan
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
    from numpy.typing import NDArray

    from forcefit.assembly.kinematics.posture import Posture
    from forcefit.assembly.model.robot import Robot
    from forcefit.page.page import Provenance
    from forcefit.validation.crosscheck.crosscheck import Crosscheck
    from forcefit.validation.crosscheck.stiffness_check import StiffnessCheck

app = Commands(no_args_is_help=True)
app.command()(diagnose)
app.command()(generate)
app.command()(inspect)
app.command()(plan)
app.command("import")(import_)
app.command()(carry)
app.command()(explain)
app.command()(predict)
app.command()(compensate)


@app.callback()
def validation() -> None:
    """Validation by simulation and measured data."""


ErrorsOption = Annotated[
    Path | None,
    typer.Option(
        help="Distributions of errors (TOML); one draw from them replaces the robot's "
        "declared errors."
    ),
]
SeedOption = Annotated[
    int, typer.Option(help="Seed of the draw from --errors.", min=0, max=2**63 - 1)
]


def _with_errors(
    posture: "Posture", errors: Path | None, seed: int, fixed: "NDArray | None"
) -> "Posture":
    """Return the posture with one draw of errors, or with the declared errors."""
    if errors is None:
        return posture
    from forcefit.assembly.model.error_distributions import read_sources
    from forcefit.assembly.steps.bolted import bolt_joints

    sources = read_sources(errors, posture.robot, fixed)
    errors_drawn = sources.errors(sources.draw(0, 1, seed)[0])
    return replace(posture, robot=bolt_joints(posture.robot.with_errors(errors_drawn)))


def parse_scales(text: str) -> list[float]:
    """Return the factors on the errors and loads that ``--scale`` lists.

    Args:
        text: text such as ``"1,0.5,0.25"``.

    Returns:
        The factors.

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


@app.command()
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
            help="Scales: factors on errors and load. Smaller ones are added if a "
            "check is "
            "undecided."
        ),
    ] = "1,0.5,0.25,0.125",
    links: Annotated[
        str, typer.Option(help="How the simulation models links: beam | spring | fem.")
    ] = "beam",
    with_clearance: Annotated[
        bool,
        typer.Option(
            "--with-clearance", help="Keep the joints' clearances in both models."
        ),
    ] = False,
    state: Annotated[
        str | None,
        typer.Option(
            help="Compare the platform's stiffness instead of the pose, in the state "
            "exact (around the equilibrium with errors and loads).",
        ),
    ] = None,
    grid: Annotated[
        str | None,
        typer.Option(help="Grid of poses, such as tx=-0.2:0.2:0.1,tz=-0.5."),
    ] = None,
    json: JsonOption = None,
    figure: FigureOption = None,
    report: ReportOption = None,
    time_limit: Annotated[
        float, typer.Option(min=0.0, help="Time limit of each simulation [s].")
    ] = 600.0,
) -> None:
    """Compare with a multibody simulation at several scales.

    Errors and loads are multiplied by each scale.  Joint clearances are left out in
    both models, unless --with-clearance is given.  Then energies and springs are
    compared instead of poses.  The exit status is 1 if a check fails.  It is also 1 if
    the robot has neither errors nor a load, because then nothing can be compared.
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
            "--figure: found together with --with-clearance; no slope is computed "
            "with clearances: remove one of the two"
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
        fixed = None if own else posture.robot.declared_errors
        with_errors = _with_errors(posture, errors, seed, fixed)
        applied = apply_robot_effects(with_errors, wrench, g, covariates)
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
    """Return the report page of a comparison at one pose."""
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
    """Compare at every pose of a grid; show a progress bar."""
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


@app.command()
def validity(
    robot: RobotArgument,
    pose: PoseOption = None,
    joint: JointOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    errors: ErrorsOption = None,
    seed: SeedOption = 1,
    load: LoadOption = None,
    gravity: GravityOption = None,
    solids: Annotated[
        bool,
        typer.Option(
            "--solids",
            help="Also mesh links as solids, which takes seconds for each shape.",
        ),
    ] = False,
    grid: Annotated[
        str | None,
        typer.Option(help="Grid of poses, such as tx=-0.2:0.2:0.1,tz=-0.5."),
    ] = None,
    poses: Annotated[
        Path | None,
        typer.Option(help="CSV table of poses: pose.tx .. or q.*."),
    ] = None,
    json: JsonOption = None,
    figure: FigureOption = None,
    report: ReportOption = None,
) -> None:
    """Estimate the errors due to the assumptions of the model.

    The errors of position, rotation and energy are estimated at one pose or at many.
    Four assumptions are tested: linear closures, beams instead of solids, weights at
    the ends of links, and a disc and a cone as clearance zone of a pin in two bushes.
    Errors above 20 um or 1 % are marked.  With --solids, errors of the stiffness of the
    platform are also estimated.  The exit status is 1 if the robot has neither errors
    nor a load, because then nothing can be compared.
    """
    from forcefit.assembly.sweeps.targets import grid_targets, parse_grid, read_targets
    from forcefit.validation.assumptions.over_poses import costs_at, costs_over_poses
    from forcefit.validation.assumptions.platform_cost import PlatformCosts
    from forcefit.validation.assumptions.plot import platform_cost_figure
    from forcefit.validation.assumptions.report import (
        costs_table,
        costs_text,
        over_poses_table,
        over_poses_text,
    )

    given = [bool(pose or joint), grid is not None, poses is not None]
    if sum(given) > 1:
        raise BadInput(
            "found more than one option for poses; expected one of --pose or "
            "--joint, --grid, --poses"
        )
    if figure is not None:
        if not solids:
            raise BadInput(
                "--figure: found without --solids; add --solids, because the figure "
                "shows the error that solids reveal"
            )
        check_writable(figure, PICTURE)
    wrench, g = parse_load(load), parse_gravity(gravity)
    own = errors is None or rest is mismatch is None
    posture = posture_of(robot, pose, joint, rest, mismatch, own)
    fixed = None if own else posture.robot.declared_errors
    posture = _with_errors(posture, errors, seed, fixed)
    if grid is None and poses is None:
        costs = costs_at(posture, wrench, g, solids)
        table, text = costs_table(costs), costs_text(costs)
    else:
        machine = posture.robot
        targets = (
            grid_targets(parse_grid(grid, machine))
            if grid is not None
            else read_targets(poses or "", machine)
        )
        with progress_bars() as update:
            costs = costs_over_poses(
                machine, targets, wrench, g, solids,
                lambda done, total: update("poses", done, total),
            )  # fmt: skip
        table, text = over_poses_table(costs), over_poses_text(costs)
    if report is not None:
        from forcefit.validation.assumptions.costs_page import costs_page

        source = provenance(robot, errors, poses)
        write_text(costs_page(costs, table, source), report)
    write_json(table, json)
    if json != "-":
        print(text)
    if figure is not None and isinstance(costs.platform, PlatformCosts):
        name = posture.robot.name
        save_figure(platform_cost_figure(costs.platform, costs.reached, name), figure)
    if not costs.known:
        raise typer.Exit(1)
