"""Command ``forcefit validation validity``: estimate errors due to assumptions."""

from pathlib import Path
from typing import Annotated

import typer

from forcefit.commands.errors_options import ErrorsOption, with_errors
from forcefit.commands.options import (
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
    declared_posture,
    parse_gravity,
    parse_load,
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
            help="Also mesh links as solids, which takes several seconds per shape.",
        ),
    ] = False,
    grid: GridOption = None,
    poses: Annotated[
        Path | None,
        typer.Option(help="CSV table of poses, with columns pose.tx .. or q.*."),
    ] = None,
    json: JsonOption = None,
    figure: FigureOption = None,
    report: ReportOption = None,
) -> None:
    """Estimate errors due to modelling assumptions.

    Errors in position, rotation and energy are estimated at one or several poses.  Four
    assumptions are tested: linear closures, beams instead of solids, weights lumped at
    the ends of the links, and a disc and a cone as the clearance zone of a pin in two
    bushes.  Errors above 20 um or 1 % are marked.  With --solids, errors in the
    platform stiffness are estimated as well.  The exit status is 1 if the robot has
    neither errors nor a load, because then there is nothing to compare.
    """
    from forcefit.assembly.effects.robot_effects import with_effects_applied
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
            "found several options that define poses; expected only one of --pose (or "
            "--joint), --grid and --poses"
        )
    if figure is not None:
        if not solids:
            raise BadInput(
                "--figure: found without --solids; add --solids, because the figure "
                "shows the errors of beams compared with solids"
            )
        check_writable(figure, PICTURE)
    wrench, g = parse_load(load), parse_gravity(gravity)
    own = errors is None or rest is mismatch is None
    declared = declared_posture(robot, pose, joint, rest, mismatch, own)
    declared = with_errors(declared, errors, seed, own)
    posture = with_effects_applied(declared)
    if grid is None and poses is None:
        costs = costs_at(posture, wrench, g, solids)
        table, text = costs_table(costs), costs_text(costs)
    else:
        machine = declared.robot
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
