"""Command ``forcefit assembly sweep``."""

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from forcefit.commands.options import (
    FigureOption,
    GravityOption,
    JsonOption,
    LoadOption,
    MismatchOption,
    RestOption,
    RobotArgument,
    SeedOption,
    UnderOption,
    note_closing,
    note_loose,
    note_massless,
    parse_covariates,
    parse_gravity,
    parse_load,
)
from forcefit.commands.plot import CsvOption
from forcefit.commands.progress import progress_bars
from forcefit.inputs.errors import BadInput
from forcefit.inputs.packages import need
from forcefit.inputs.writing import (
    PICTURE,
    check_writable,
    save_figure,
    write_json,
)

if TYPE_CHECKING:
    from forcefit.assembly.sweeps.sweep import Solver


def _list_quantities(names: list[str] | None) -> list[str] | None:
    """Print the names of all sweep variables if the value is ``list``."""
    if names == ["list"]:
        from forcefit.assembly.sweeps.selection import quantities_text

        print(quantities_text())
        raise typer.Exit
    return names


def sweep(
    robot: RobotArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="NetCDF file to write.")
    ],
    grid: Annotated[
        str | None,
        typer.Option(
            help="Grid of postures, for example tx=-0.2:0.2:0.025,tz=-0.5, or "
            "q.<frame>=.. for joints."
        ),
    ] = None,
    poses: Annotated[
        Path | None,
        typer.Option(
            help="CSV table of postures, with columns pose.tx .. or q.<frame>, and "
            "optionally id."
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="Values in the robot file to vary: PATH=VALUE,.. or "
            "PATH=FIRST:LAST:STEP."
        ),
    ] = None,
    errors: Annotated[
        Path | None, typer.Option(help="Error distributions (TOML).")
    ] = None,
    draws: Annotated[
        int | None,
        typer.Option(help="Number of error draws at each point.", min=1, max=10**9),
    ] = None,
    seed: SeedOption = 1,
    assumption: Annotated[
        str,
        typer.Option(
            help="Assumption about open clearances in the pose error bounds: frozen | "
            "free | budget | none."
        ),
    ] = "frozen",
    quantities: Annotated[
        list[str] | None,
        typer.Option(
            help="Variables to compute and store, for example energy,margin; default "
            "stands for the default variables. list prints all names.",
            callback=_list_quantities,
            is_eager=True,
        ),
    ] = None,
    wrench_of: Annotated[
        list[str] | None, typer.Option(help="Name of a frame whose wrench is stored.")
    ] = None,
    state: Annotated[
        str | None,
        typer.Option(
            help="Also compute K_C and the compliance due to each link and joint in "
            "this state: nominal (clearances at zero) | contact | exact (the last two "
            "with errors, loads and clearances)."
        ),
    ] = None,
    frequencies: Annotated[
        int | None, typer.Option(help="Number of natural frequencies.", min=1, max=1000)
    ] = None,
    near: Annotated[
        float,
        typer.Option(help="Report singularities closer than this distance [-]."),
    ] = 0.02,
    yield_strength: Annotated[
        float | None,
        typer.Option(
            help="[Pa] Yield strength of the links; also compute stress and safety "
            "factor."
        ),
    ] = None,
    load: LoadOption = None,
    gravity: GravityOption = None,
    under: UnderOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    workers: Annotated[
        int | None,
        typer.Option(help="Number of processes on this machine.", min=1, max=1024),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Address of a Dask cluster, for example tcp://HOST:PORT."),
    ] = None,
    figure: FigureOption = None,
    csv: CsvOption = None,
    json: JsonOption = None,
) -> None:
    """Compute margins, energies, errors over postures and designs.

    Finished points are stored in OUTPUT.journal.  After an interruption, the same
    command continues from this journal and produces the same file.
    """
    from forcefit.assembly.model.statuses import UNUSABLE
    from forcefit.assembly.sweeps.dataset import check_dataset, open_dataset
    from forcefit.assembly.sweeps.maps import check_axes, figure_of
    from forcefit.assembly.sweeps.netcdf import stored_dataset
    from forcefit.assembly.sweeps.point_table import write_point_table
    from forcefit.assembly.sweeps.request import (
        SweepOptions,
        ask_sweep,
        summary_of,
        summary_text,
    )
    from forcefit.assembly.sweeps.sweep import journal_path, run_sweep

    if workers is not None and scheduler is not None:
        raise BadInput(
            "sweep: found both --workers and --scheduler, expected only one of them"
        )
    check_dataset(output, "a sweep")
    if figure is not None:
        check_writable(figure, PICTURE)
    wrench, g = parse_load(load), parse_gravity(gravity)
    covariates = parse_covariates(under)
    with progress_bars() as update:
        update("robot", 0, 1)  # may take long if code is compiled
        asked = ask_sweep(
            robot,
            SweepOptions(
                grid=grid, poses=poses, vary=vary or (), errors=errors, draws=draws,
                seed=seed, assumption=assumption, quantities=quantities or (),
                wrench_of=wrench_of or (), near=near,
                yield_strength=yield_strength, load=wrench or (0.0,) * 6,
                gravity=g or (0.0,) * 3, under=covariates or {}, state=state,
                frequencies=frequencies, rest=rest, mismatch=mismatch,
            ),
        )  # fmt: skip
        if figure is not None:
            check_axes(dict(zip(asked.dims, asked.shape, strict=True)))
        update("robot", 1, 1)
    note_massless(asked.question.robot, g)
    note_loose(asked.question.robot)
    note_closing(asked.question.robot, rest, mismatch)
    if frequencies is not None and (any(wrench or ()) or any(g or ())):
        print(
            "forcefit: note: the frequencies neglect load and gravity; to include "
            "them, use assembly frequencies --state exact",
            file=sys.stderr,
        )
    done = [0]
    solver = _solver(workers, scheduler)
    held = ExitStack()  # keeps the journal open until all files are written
    try:
        with progress_bars() as update:

            def note(finished: int, total: int) -> None:
                done[0] = finished
                update("points", finished, total)

            run_sweep(asked, output, note, solver, held)
    except KeyboardInterrupt:
        print(
            f"forcefit: interrupted; {done[0]} of {asked.size} points are stored "
            f"in {journal_path(output)}: run the same command again to continue",
            file=sys.stderr,
        )
        raise typer.Exit(130) from None
    data = stored_dataset(output)
    if figure is not None:
        save_figure(figure_of(open_dataset(output)), figure)
    if csv is not None:
        write_point_table(output, csv)
    summary = {"output": str(output)} | summary_of(data)
    write_json(summary, json)
    held.close()
    if json != "-":
        print(summary_text(summary, data))
    if set(summary["status"]) <= UNUSABLE:
        raise typer.Exit(1)


def _solver(workers: int | None, scheduler: str | None) -> "Solver":
    """Return a solver that runs in this process, in several, or on a cluster."""
    if workers is None and scheduler is None:
        from forcefit.assembly.sweeps.sweep import solve_here

        return solve_here
    from forcefit.assembly.sweeps.cluster import cluster_solver

    need("distributed")
    return cluster_solver(workers, scheduler)
