"""The commands ``forcefit assembly ...``: parse, call one function, print or save."""

import os
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from assembly.posture import parse_assignments
from stiffness.reading import BadInput, nearest
from stiffness.screws import WRENCH
from stiffness.writing import check_writable, write_json

app = typer.Typer(no_args_is_help=True)

RobotArgument = Annotated[
    str, typer.Argument(metavar="ROBOT", help="A robot file, or a built-in name.")
]
PoseOption = Annotated[
    list[str] | None,
    typer.Option("--pose", help="Nominal platform pose, such as tx=0.1,tz=-0.5."),
]
JointOption = Annotated[
    list[str] | None,
    typer.Option("--joint", help="Actuated coordinates, such as leg1.drive=0.1."),
]
LoadOption = Annotated[
    list[str] | None,
    typer.Option("--load", help="Load on the platform, such as fx=10,mz=1."),
]
GravityOption = Annotated[
    list[str] | None,
    typer.Option("--gravity", help="Gravity in base axes [m/s^2], such as z=-9.81."),
]
JsonOption = Annotated[
    str | None,
    typer.Option("--json", help="Write results as JSON to a file; - is stdout."),
]


def parse_load(texts: list[str] | None) -> list[float] | None:
    """Wrench ``[mx my mz fx fy fz]`` from ``--load``; None if not given.

    Args:
        texts: such as ``["fx=10,mz=1"]``.

    Returns:
        Six numbers [N m, N].

    Raises:
        BadInput: an unknown component or not a number.
    """
    if not texts:
        return None
    names = [name.lower() for name in WRENCH]
    given = parse_assignments(texts, "--load")
    for name in given:
        if name not in names:
            hint = nearest(name, names)
            raise BadInput(f'--load: unknown component "{name}"{hint}')
    return [given.get(name, 0.0) for name in names]


def parse_gravity(texts: list[str] | None) -> list[float] | None:
    """Gravity (3,) [m/s^2] from ``--gravity``; None if not given.

    Args:
        texts: such as ``["z=-9.81"]``.

    Returns:
        Three numbers in base axes.

    Raises:
        BadInput: a name other than x, y, z, or not a number.
    """
    if not texts:
        return None
    given = parse_assignments(texts, "--gravity")
    for name in given:
        if name not in "xyz":
            raise BadInput(
                f'--gravity: unknown component "{name[:60]}"; valid: x, y, z'
            )
    return [given.get(name, 0.0) for name in "xyz"]


def posture_of(robot: str, pose: list[str] | None, joint: list[str] | None) -> Any:
    """The posture that ``--pose`` or ``--joint`` asks for; home if neither."""
    from assembly.posture import place_robot
    from assembly.robots import load_robot

    return place_robot(
        load_robot(robot),
        pose=parse_assignments(pose, "--pose") if pose else None,
        joints=parse_assignments(joint, "--joint") if joint else None,
    )


@contextmanager
def progress_bars() -> Generator[Any, None, None]:
    """Progress bars on stderr; yields ``update(what, done, total)``, a bar for each."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
        TimeElapsedColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    tasks: dict[str, Any] = {}
    with Progress(*columns, console=Console(stderr=True)) as bars:

        def update(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = bars.add_task(what, total=total)
            bars.update(tasks[what], completed=done, total=total)

        yield update


@app.command()
def solve(
    robot: RobotArgument,
    pose: PoseOption = None,
    joint: JointOption = None,
    load: LoadOption = None,
    gravity: GravityOption = None,
    json: JsonOption = None,
) -> None:
    """Close the robot at least energy: pose error, energy, wrenches, zone margin."""
    from assembly.results import solution_of, solution_text

    results = solution_of(
        posture_of(robot, pose, joint), parse_load(load), parse_gravity(gravity)
    )
    write_json(results, json)
    if json != "-":
        print(solution_text(results))
    if results["status"] != "ok":
        raise typer.Exit(1)


@app.command()
def zone(
    robot: RobotArgument,
    pose: PoseOption = None,
    joint: JointOption = None,
    json: JsonOption = None,
) -> None:
    """Say whether the rigid robot goes together by its play alone, and the margin."""
    from assembly.results import zone_of, zone_text

    found = zone_of(posture_of(robot, pose, joint))
    write_json({"robot": robot, "zone": found}, json)
    if json != "-":
        print(zone_text(found))


@app.command()
def exact(
    robot: RobotArgument,
    pose: PoseOption = None,
    joint: JointOption = None,
    load: LoadOption = None,
    json: JsonOption = None,
) -> None:
    """Close the robot with finite motions: closures hold exactly."""
    from assembly.results import exact_of, exact_text

    results = exact_of(posture_of(robot, pose, joint), parse_load(load))
    write_json(results, json)
    if json != "-":
        print(exact_text(results))
    if results["status"] != "ok":
        raise typer.Exit(1)


@app.command()
def error(
    robot: RobotArgument,
    pose: PoseOption = None,
    joint: JointOption = None,
    reading: Annotated[
        list[str] | None, typer.Option(help="frozen | free | budget; default all.")
    ] = None,
    energy_budget: Annotated[
        float, typer.Option(help="eta of the budget reading: E <= (1 + eta) E*.")
    ] = 0.05,
    tolerance_rotation: Annotated[
        float, typer.Option(help="[rad] upper minus lower bound.")
    ] = 1e-6,
    tolerance_translation: Annotated[
        float, typer.Option(help="[m] upper minus lower bound.")
    ] = 1e-6,
    json: JsonOption = None,
) -> None:
    """Certified bounds of the platform's largest pose error, problem (27)."""
    from assembly.pose_error import READINGS
    from assembly.results import pose_error_of, pose_error_text

    for name in reading or ():
        if name not in READINGS:
            hint = nearest(name, READINGS)
            raise BadInput(f'--reading: found "{name[:60]}"{hint}')
    options = {
        "energy_budget": energy_budget,
        "tolerance_rotation": tolerance_rotation,
        "tolerance_translation": tolerance_translation,
    }
    for key, value in options.items():
        if not 0 < value < float("inf"):
            option = "--" + key.replace("_", "-")
            raise BadInput(f"{option}: found {value}, expected a finite number > 0")
    results = pose_error_of(
        posture_of(robot, pose, joint), reading or READINGS, **options
    )
    write_json(results, json)
    if json != "-":
        print(pose_error_text(results))
    if results["status"] != "ok":
        raise typer.Exit(1)


@app.command()
def sweep(
    robot: RobotArgument,
    grid: Annotated[
        str, typer.Option(help="Such as tx=-0.2:0.2:0.025,tz=-0.6:-0.3:0.025.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="NetCDF file.")],
    reading: Annotated[
        str, typer.Option(help="Of the pose error: frozen | free | budget | none.")
    ] = "frozen",
    figure: Annotated[
        Path | None, typer.Option(help="Also draw the maps, as PNG, SVG or PDF.")
    ] = None,
) -> None:
    """Margins, energy and platform error over a grid of platform poses."""
    from assembly.plot import map_figure
    from assembly.pose_error import READINGS
    from assembly.robots import load_robot
    from assembly.dataset import save_dataset
    from assembly.sweep import sweep_poses
    from assembly.targets import parse_grid

    machine, axes = load_robot(robot), parse_grid(grid)
    if reading not in (*READINGS, "none"):
        hint = nearest(reading, [*READINGS, "none"])
        raise BadInput(f'--reading: found "{reading[:60]}"{hint}')
    wanted = None if reading == "none" else reading
    for path in filter(None, (output, figure)):
        check_writable(path)
    with progress_bars() as update:
        data = sweep_poses(machine, axes, lambda d, n: update("postures", d, n), wanted)
    save_dataset(data, output)
    if figure is not None:
        map_figure(data).savefig(figure, dpi=150)
    counts = data["status"].to_series().value_counts()
    print(", ".join(f"{name}: {count}" for name, count in counts.items()))


@app.command()
def show(
    robot: RobotArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="PNG file; a window opens without one."),
    ] = None,
    pose: PoseOption = None,
    joint: JointOption = None,
    load: LoadOption = None,
    exaggeration: Annotated[
        float | None, typer.Option(help="Factor on displacements.", min=1e-6)
    ] = None,
    errors: Annotated[
        str | None,
        typer.Option(help="Also the body of possible errors: translation | rotation."),
    ] = None,
    reading: Annotated[
        str, typer.Option(help="Of the errors: frozen | free | budget.")
    ] = "budget",
) -> None:
    """Draw the nominal and the forced robot, and the errors its platform can have."""
    from assembly.energy import solve_assembly
    from assembly.error_body import PARTS
    from assembly.plot import draw_assembly
    from assembly.pose_error import READINGS

    if output is not None:
        check_writable(output)
    elif not (os.environ.get("DISPLAY") or sys.platform in {"win32", "darwin"}):
        raise BadInput("no display to open a window on; name a file with --output")
    for option, value, valid in (
        ("--errors", errors, PARTS), ("--reading", reading, READINGS)
    ):  # fmt: skip
        if value is not None and value not in valid:
            raise BadInput(f'{option}: found "{value[:60]}"{nearest(value, valid)}')
    answer = solve_assembly(posture_of(robot, pose, joint), parse_load(load))
    plotter = draw_assembly(answer, exaggeration, errors, reading, output is not None)
    if output is None:
        plotter.show()
    else:
        plotter.screenshot(str(output))
    plotter.close()
