"""Commands ``forcefit assembly statistics`` and ``forcefit assembly tolerances``."""

import sys
from collections.abc import Generator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

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
    SeedOption,
    declared_posture,
    note_closing,
    note_loose,
    note_massless,
    parse_gravity,
    parse_load,
)
from forcefit.commands.plot import CsvOption
from forcefit.commands.progress import progress_bars
from forcefit.commands.report import ReportOption, provenance
from forcefit.inputs.errors import BadInput, nearest
from forcefit.inputs.packages import need
from forcefit.inputs.writing import (
    PICTURE,
    check_writable,
    save_figure,
    write_json,
    write_text,
)

if TYPE_CHECKING:
    from forcefit.assembly.statistics.allocation import Allocation

ClearanceOption = Annotated[
    str,
    typer.Option(
        help="Positions within the clearances, for pose errors: worst (largest error) "
        "| uniform | contact (closed by a wrench of random direction; specify a known "
        "load with --load) | least (of the minimum-energy solution)."
    ),
]
ContactLengthOption = Annotated[
    float | None,
    typer.Option(
        help="[m] With --clearance contact: ratio of the random moments to the random "
        "forces. Default: length of the longest body."
    ),
]


def statistics(
    robot: RobotArgument,
    errors: Annotated[
        Path | None,
        typer.Option(
            help="Error distributions (TOML), in addition to the [[tolerance]] entries "
            "of the robot file."
        ),
    ] = None,
    pose: PoseOption = None,
    joint: JointOption = None,
    load: LoadOption = None,
    drive_force: DriveForceOption = None,
    gravity: GravityOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    draws: Annotated[
        int, typer.Option(help="Number of random error draws.", min=2, max=10**9)
    ] = 10_000,
    seed: SeedOption = 1,
    clearance: ClearanceOption = "worst",
    contact_length: ContactLengthOption = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            help="Limit on a result in SI units, for example energy=5 or "
            "translation=2e-4; may be repeated."
        ),
    ] = None,
    yield_strength: Annotated[
        float | None,
        typer.Option(
            help="[Pa] Yield strength of the links, used as the stress limit."
        ),
    ] = None,
    importance: Annotated[
        int | None,
        typer.Option(
            help="Number of base draws for the Sobol indices of the errors.",
            min=16,
            max=1_000_000,
        ),
    ] = None,
    by: Annotated[
        str,
        typer.Option(
            help="Groups of errors in the Sobol indices: source | frame | kind."
        ),
    ] = "kind",
    margins: Annotated[
        bool, typer.Option("--margins/--no-margins", help="Also compute zone margins.")
    ] = True,
    state: Annotated[
        str | None,
        typer.Option(
            help="Also compute the distribution of the platform stiffness in this "
            "state: contact (each clearance open or closed) | exact (includes internal "
            "forces)."
        ),
    ] = None,
    capability: Annotated[
        bool,
        typer.Option(
            "--capability",
            help="Also compute Cp, Cpk and parts per million for each --limit.",
        ),
    ] = False,
    worst_case: Annotated[
        bool,
        typer.Option(
            "--worst-case",
            help="Also compute the largest pose errors over all geometric errors "
            "within tolerance and all positions within the clearances.",
        ),
    ] = False,
    confidence: Annotated[
        float, typer.Option(help="Confidence level of all intervals.")
    ] = 0.95,
    workers: Annotated[
        int, typer.Option(help="Number of threads.", min=1, max=1024)
    ] = 1,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="NetCDF file for the results of all draws."
        ),
    ] = None,
    figure: FigureOption = None,
    report: ReportOption = None,
    csv: CsvOption = None,
    json: JsonOption = None,
) -> None:
    """Estimate yield and pose errors from random draws.

    If OUTPUT is given, finished draws are stored in OUTPUT.journal.  After an
    interruption, the same command continues from this journal and produces the same
    file.
    """
    from forcefit.assembly.effects.robot_effects import (
        errors_of_effects,
        with_effects_applied,
    )
    from forcefit.assembly.report.first_order import posture_status
    from forcefit.assembly.report.results import status_line
    from forcefit.assembly.statistics.callout_sources import sources_of
    from forcefit.assembly.statistics.experiment import Experiment, precision_for
    from forcefit.assembly.statistics.importance_table import ImportanceOptions
    from forcefit.assembly.statistics.monte_carlo import run_draws
    from forcefit.assembly.statistics.plot import histogram_figure
    from forcefit.assembly.statistics.quantities import parse_limit
    from forcefit.assembly.statistics.summary import summarise, summary_text
    from forcefit.assembly.sweeps.dataset import check_dataset
    from forcefit.assembly.sweeps.point_table import write_point_table

    _check_clearance_model(clearance, contact_length)
    _check_word("--by", by, ("source", "frame", "kind"))
    if state is not None:
        _check_word("--state", state, ("contact", "exact"))
    if not 0 < confidence < 1:
        raise BadInput(
            f"--confidence: found {confidence}, expected a number between 0 and 1"
        )
    if yield_strength is not None and not 0 < yield_strength < float("inf"):
        raise BadInput(f"--yield-strength: found {yield_strength}, expected > 0")
    limits = dict(map(parse_limit, limit or ()))
    if capability and not limits:
        raise BadInput("--capability: found no --limit, expected one or more")
    if output is not None:
        check_dataset(output, "draws")
    if figure is not None:
        check_writable(figure, PICTURE)
    closing = rest is not None or mismatch is not None
    declared = declared_posture(
        robot, pose, joint, rest, mismatch, own_errors=not closing, note=False,
        drive_force=drive_force,
    )  # fmt: skip
    posture = with_effects_applied(declared)
    fixed = errors_of_effects(declared, posture)
    if closing:
        fixed = posture.robot.declared_errors
    sources = sources_of(posture.robot, errors, fixed)
    wrench, g = parse_load(load), parse_gravity(gravity)
    note_closing(posture.robot, rest, mismatch)
    note_massless(posture.robot, g)
    if failure := posture_status(posture, wrench, g):
        whose = {"robot": posture.robot.name, "pose": posture.pose()}
        write_json(whose | failure, json)
        if json != "-":
            print(status_line(failure))
        raise typer.Exit(1)
    experiment = Experiment(
        posture, sources, seed, clearance, margins,
        load=tuple(wrench) if wrench else None, gravity=tuple(g) if g else None,
        stiffness=state or "", precision=precision_for(limits),
        contact_length=contact_length,
    )  # fmt: skip
    experiment.check_limits([*limits, *(["stress"] if yield_strength else [])])
    worst = None
    if worst_case:
        from forcefit.assembly.statistics.worst_pose_report import worst_results

        worst = worst_results(experiment.energies, sources, seed)
    options = None
    if importance is not None:
        options = ImportanceOptions(importance, by, confidence)
    held = ExitStack()  # keeps the journal open until all files are written
    with _interruptible(output), progress_bars() as update:
        data = run_draws(
            experiment, draws, output, workers, lambda d, n: update("draws", d, n),
            options, held,
        )  # fmt: skip
    if figure is not None:
        save_figure(histogram_figure(data), figure)
    if csv is not None:
        write_point_table(data, csv)
    summary = {
        "robot": posture.robot.name, "pose": posture.pose(), "seed": seed,
        "load": wrench, "gravity": g,
        **summarise(data, limits, yield_strength, confidence, capability),
    }  # fmt: skip
    if worst is not None:
        summary["worst_case"] = worst
    write_json(summary, json)
    if report is not None:
        from forcefit.assembly.statistics.report import draws_page
        from forcefit.assembly.statistics.scenes import drawn_robot

        scene = drawn_robot(experiment, data)
        write_text(draws_page(summary, data, provenance(robot, errors), scene), report)
    held.close()
    if json != "-":
        print(summary_text(summary))


def _check_word(option: str, word: str, valid: Sequence[str]) -> None:
    """Raise BadInput if the value of an option is not valid."""
    if word not in valid:
        raise BadInput(f'{option}: found "{word[:60]}"{nearest(word, valid)}')


def _check_clearance_model(clearance: str, contact_length: float | None) -> None:
    """Raise BadInput for an unknown clearance model or an inapplicable length."""
    from forcefit.assembly.statistics.clearance_positions import CLEARANCE_MODELS

    _check_word("--clearance", clearance, tuple(CLEARANCE_MODELS))
    if contact_length is None:
        return
    if clearance != "contact":
        raise BadInput(
            f"--contact-length: found with --clearance {clearance}, expected "
            "--clearance contact"
        )
    if not 0 < contact_length < float("inf"):
        raise BadInput(f"--contact-length: found {contact_length}, expected > 0 m")


@contextmanager
def _interruptible(output: Path | None) -> Generator[None, None, None]:
    """After Ctrl-C, print where results are stored, and exit with status 130."""
    try:
        yield
    except KeyboardInterrupt:
        kept = f"; finished results are stored in {output}.journal" if output else ""
        print(f"forcefit: interrupted{kept}", file=sys.stderr)
        raise typer.Exit(130) from None


def tolerances(
    robot: RobotArgument,
    grid: Annotated[
        str, typer.Option(help="Workspace, for example tx=-0.2:0.2:0.1,tz=-0.5.")
    ],
    plan: Annotated[
        Path | None,
        typer.Option(help="Plan with tolerance costs and limits on results (TOML)."),
    ] = None,
    quantities: Annotated[
        str,
        typer.Option(
            help="Zone margin for the declared errors: margin_free (compliant joints "
            "turn freely about their own axes) | margin (compliant joints are rigid)."
        ),
    ] = "margin_free",
    clearance: ClearanceOption = "worst",
    contact_length: ContactLengthOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    draws: Annotated[
        int,
        typer.Option(
            help="Number of draws used to verify the tolerances.", min=0, max=10**9
        ),
    ] = 2000,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="NetCDF file.")
    ] = None,
    figure: FigureOption = None,
    report: ReportOption = None,
    csv: CsvOption = None,
    json: JsonOption = None,
) -> None:
    """Assess declared errors; with a plan, allocate tolerances.

    Without --plan, the command computes the largest factor on the declared errors for
    which the robot can be assembled in all postures, and the errors that govern this
    margin.  If OUTPUT is given, finished results are stored in OUTPUT.journal.  After
    an interruption, the same command continues from this journal and produces the same
    file.
    """
    from dataclasses import replace

    from forcefit.assembly.exchange.robot_files import load_robot
    from forcefit.assembly.kinematics.closing import closing_of
    from forcefit.assembly.linear.zone import MARGINS
    from forcefit.assembly.model.statuses import SINGULAR
    from forcefit.assembly.statistics.allocated_tolerances import (
        allocation_of,
        allocation_text,
    )
    from forcefit.assembly.statistics.allocation import allocate
    from forcefit.assembly.statistics.replay import journalled
    from forcefit.assembly.statistics.tolerance_file import read_plan
    from forcefit.assembly.statistics.tolerances import (
        grid_postures,
        identity_of,
        left_out_text,
        present_errors,
        present_text,
    )
    from forcefit.assembly.sweeps.dataset import check_dataset

    _check_clearance_model(clearance, contact_length)
    _check_word("--quantities", quantities, tuple(MARGINS))
    if plan is None and (output or figure or csv):
        raise BadInput(
            "tolerances: found --output, --figure or --csv without --plan; add "
            "--plan FILE, because these options write the tolerances of a plan"
        )
    if output or figure or csv:
        need("xarray")
    if output is not None:
        check_dataset(output, "tolerances")
    if figure is not None:
        check_writable(figure, PICTURE)
    machine = load_robot(robot, closing_of(rest, mismatch))
    note_closing(machine, rest, mismatch)
    note_loose(machine)
    asked_plan = (
        None
        if plan is None
        else replace(
            read_plan(plan, machine),
            clearance=clearance,
            contact_length=contact_length,
        )
    )
    postures, left_out = grid_postures(machine, grid)
    results: dict = {
        "robot": machine.name, "postures": len(postures), "left_out": left_out,
        "grid": grid,
    }  # fmt: skip
    texts = [left_out_text(left_out)] if left_out else []
    if not postures:
        write_json(results, json)
        if json != "-":
            print(texts[0])
        raise typer.Exit(1)
    held = ExitStack()  # keeps the journal open until all files are written
    with _interruptible(output), progress_bars() as update:
        if machine.errors.any():
            results["present"] = present_errors(
                postures,
                MARGINS[quantities],
                lambda d, n: update("present errors", d, n),
            )
            texts.append(present_text(results["present"]))
        elif asked_plan is None:
            raise BadInput(
                f"{machine.name}: found no geometric_error in any frame; expected at "
                "least one, for comparison with the zone margin, or --plan"
            )
        if asked_plan is not None:
            whose = identity_of(postures, asked_plan, draws)
            replay = held.enter_context(journalled(output, whose))
            allocation = allocate(postures, asked_plan, draws, update, replay)
            results["allocation"] = allocation_of(allocation)
            texts.append(allocation_text(results["allocation"]))
            _save_allocation(allocation, output, figure, csv)
    write_json(results, json)
    if report is not None:
        from forcefit.assembly.statistics.scenes import margin_map, tightest_robot
        from forcefit.assembly.statistics.tolerances_report import tolerances_page

        drawings = (margin_map, tightest_robot) if "present" in results else ()
        pictures = [draw(postures, results["present"]) for draw in drawings]
        source = provenance(robot, plan)
        write_text(tolerances_page(results, source, pictures), report)
    held.close()
    if json != "-":
        print("\n".join(texts))
    check = results.get("allocation", {}).get("verification") or {}
    if check.get("verdict") == "contradicted" or SINGULAR in left_out:
        raise typer.Exit(1)


def _save_allocation(
    allocation: "Allocation", output: Path | None, figure: Path | None,
    csv: Path | None,
) -> None:  # fmt: skip
    """Write the tolerances as a data set, a figure and a table, where requested."""
    from forcefit.assembly.statistics.allocated_tolerances import tolerance_dataset
    from forcefit.assembly.statistics.plot import allocation_figure
    from forcefit.assembly.sweeps.dataset import save_dataset
    from forcefit.assembly.sweeps.point_table import write_point_table

    data = tolerance_dataset(allocation)
    if output is not None:
        save_dataset(data, output)
    if figure is not None:
        save_figure(allocation_figure(data), figure)
    if csv is not None:
        write_point_table(data, csv)
