"""The commands ``forcefit assembly ...``: parse, call one function, print or save."""

import math
import os
import sys
import time
from collections.abc import Generator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from threading import Timer
from typing import Annotated, Any

import typer

from stiffness.message import BadInput, nearest
from stiffness.writing import (
    PIXELS,
    check_json,
    check_writable,
    save_pixels,
    write_json,
)

app = typer.Typer(no_args_is_help=True)

_MOMENT = 2.0  # [s] that may pass without a word


def _built_in_names(incomplete: str) -> list[str]:
    """What a shell offers beside files."""
    from assembly.robots import BUILT_IN

    return [name for name in BUILT_IN if name.startswith(incomplete)]


RobotArgument = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="A robot file, or a built-in name.",
        autocompletion=_built_in_names,
    ),
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
UnderOption = Annotated[
    list[str] | None,
    typer.Option(
        "--under",
        help="What the robot's effects depend on: temperature=5,time=0,approach=1.",
    ),
]
JsonOption = Annotated[
    str | None,
    typer.Option(
        "--json",
        help="Write results as JSON to a file; - is stdout.",
        callback=check_json,
    ),
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
    from assembly.joint_file import LARGEST
    from stiffness.screws import WRENCH

    names = [name.lower() for name in WRENCH]
    given = _components(texts, "--load", names, LARGEST)
    return [given.get(name, 0.0) for name in names]


def _components(
    texts: list[str], option: str, names: Sequence[str], largest: float
) -> dict[str, float]:
    """Numbers given by component, of a known few."""
    from assembly.posture import parse_assignments

    given = parse_assignments(texts, option, largest)
    for name in given:
        if name not in names:
            hint = nearest(name, names)
            raise BadInput(f'{option}: unknown component "{name[:60]}"{hint}')
    return given


def parse_gravity(texts: list[str] | None) -> list[float] | None:
    """Gravity (3,) [m/s^2] from ``--gravity``; see :func:`parse_vector`."""
    return parse_vector(texts, "--gravity")


def parse_vector(texts: list[str] | None, option: str) -> list[float] | None:
    """Three numbers given by component; None if not given.

    Args:
        texts: such as ``["z=-9.81"]``.
        option: whose they are, for messages.

    Returns:
        The numbers along x, y and z.

    Raises:
        BadInput: a name other than x, y, z, or not a number of at most 1e6.
    """
    if not texts:
        return None
    from assembly.joint_file import LARGEST_LENGTH
    from assembly.posture import parse_assignments

    given = parse_assignments(texts, option, LARGEST_LENGTH)
    for name in given:
        if name not in {"x", "y", "z"}:
            raise BadInput(f'{option}: unknown component "{name[:60]}"; valid: x, y, z')
    return [given.get(name, 0.0) for name in "xyz"]


def parse_direction(texts: list[str] | None) -> list[float] | None:
    """Direction of a platform screw from ``--direction``, as a unit vector.

    Args:
        texts: such as ``["tx=1,tz=-1"]``.

    Returns:
        Six numbers ``[rx ry rz tx ty tz]``; None if not given.

    Raises:
        BadInput: an unknown component, all zero, or rotation mixed with translation.
    """
    if not texts:
        return None
    from assembly.joint_file import LARGEST_LENGTH
    from stiffness.screws import SCREW

    names = [name.lower() for name in SCREW]
    given = _components(texts, "--direction", names, LARGEST_LENGTH)
    length = math.hypot(*given.values())
    if length == 0.0 or len({name[0] for name, value in given.items() if value}) > 1:
        raise BadInput(
            "--direction: expected components of a translation or of a rotation, not "
            "all zero, not of both"
        )
    return [given.get(name, 0.0) / length for name in names]


def posture_of(robot: str, pose: list[str] | None, joint: list[str] | None) -> Any:
    """The posture that ``--pose`` or ``--joint`` asks for; home if neither.

    Args:
        robot: name or file.
        pose: of the platform.
        joint: coordinates.

    Returns:
        The posture, of the robot as the effects of its file make it.

    Raises:
        BadInput: an effect loads the robot, which the command asking does not know.
    """
    from assembly.effects.acting import act

    acting = act(declared_posture(robot, pose, joint))
    if acting.gravity is not None or acting.load.any():
        raise BadInput(
            f"{robot}: its effects load it; expected assembly solve or exact, or "
            "validation crosscheck, which know loads"
        )
    return acting.posture


def declared_posture(
    robot: str, pose: list[str] | None, joint: list[str] | None
) -> Any:
    """The posture asked for, of the robot without the effects of its file."""
    from assembly.joint_file import LARGEST_LENGTH
    from assembly.posture import parse_assignments, place_robot
    from assembly.robots import load_robot

    return place_robot(
        load_robot(robot),
        pose=parse_assignments(pose, "--pose", LARGEST_LENGTH) if pose else None,
        joints=parse_assignments(joint, "--joint", LARGEST_LENGTH) if joint else None,
    )


def parse_covariates(texts: list[str] | None) -> dict[str, float]:
    """Covariates from ``--under``.

    Args:
        texts: such as ``["temperature=5,approach=1"]``.

    Returns:
        Numbers by name.

    Raises:
        BadInput: not of that form.
    """
    if not texts:
        return {}
    from assembly.posture import parse_assignments

    return parse_assignments(texts, "--under")


def one_thread() -> AbstractContextManager:
    """Linear algebra on one thread: a posture's matrices are too small for more.

    The others would spin while they wait for work, at the cost of this one's time.
    """
    from threadpoolctl import threadpool_limits

    return threadpool_limits(1)


@contextmanager
def progress_bars() -> Generator[Any, None, None]:
    """Progress bars on stderr; yields ``update(what, done, total)``, a bar for each.

    Where stderr is no terminal, bars show at the end alone: a line says what takes
    longer than a moment.  Bad input leaves none, its message is enough.
    """
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
        TextColumn("{task.fields[rate]}"), TimeElapsedColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    tasks: dict[str, Any] = {}
    began: dict[str, tuple[float, int]] = {}
    waiting: list[Timer] = []
    console = Console(stderr=True)
    with Progress(*columns, console=console) as bars:

        def update(what: str, done: int, total: int) -> None:
            if what not in tasks:
                if not console.is_terminal:
                    said = f"{what}: {done} of {total}"
                    waiting.append(Timer(_MOMENT, print, [said], {"file": sys.stderr}))
                    waiting[-1].daemon = True
                    waiting[-1].start()
                # what was done in an earlier run does not count in the rate
                tasks[what] = bars.add_task(what, total=total, completed=done, rate="")
                began[what] = time.monotonic(), done
            start, before = began[what]
            passed = time.monotonic() - start
            rate = f"{(done - before) / passed:.3g}/s" if done > before else ""
            bars.update(tasks[what], completed=done, total=total, rate=rate)

        try:
            yield update
        except BadInput:
            bars.live.transient = True
            bars.live.stop()
            bars.disable = True  # or it ends with an empty line
            raise
        finally:
            for line in waiting:
                line.cancel()


@app.command()
def solve(
    robot: RobotArgument,
    pose: PoseOption = None,
    joint: JointOption = None,
    load: LoadOption = None,
    gravity: GravityOption = None,
    under: UnderOption = None,
    json: JsonOption = None,
) -> None:
    """Close at least energy: pose error, energy, wrenches, margin."""
    from assembly.effects.acting import act
    from assembly.results import solution_of, solution_text

    acting = act(
        declared_posture(robot, pose, joint), parse_load(load), parse_gravity(gravity),
        parse_covariates(under),
    )  # fmt: skip
    with one_thread():
        results = solution_of(acting.posture, acting.load, acting.gravity)
    if results["status"] == "ok" and acting.conditions.reads_otherwise:
        results["reading"] = acting.reading(results["platform_screw"])
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
    """Whether the robot goes together by play alone; the margin."""
    from assembly.results import zone_of, zone_text

    found = zone_of(posture_of(robot, pose, joint))
    write_json({"robot": robot, "zone": found}, json)
    if json != "-":
        print(zone_text(found))
    if found["status"] != "ok":
        raise typer.Exit(1)


@app.command()
def exact(
    robot: RobotArgument,
    pose: PoseOption = None,
    joint: JointOption = None,
    load: LoadOption = None,
    gravity: GravityOption = None,
    under: UnderOption = None,
    json: JsonOption = None,
) -> None:
    """Close the robot with finite motions: closures hold exactly."""
    from assembly.effects.acting import act
    from assembly.results import exact_of, exact_text

    acting = act(
        declared_posture(robot, pose, joint), parse_load(load), parse_gravity(gravity),
        parse_covariates(under), finite=True,
    )  # fmt: skip
    with one_thread():
        results = exact_of(acting.posture, acting.load, acting.gravity)
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
        list[str] | None,
        typer.Option(
            help="frozen | free | budget; default all, under a load the first two."
        ),
    ] = None,
    load: LoadOption = None,
    gravity: GravityOption = None,
    under: UnderOption = None,
    energy_budget: Annotated[
        float, typer.Option(help="eta of the budget reading: E <= (1 + eta) E*.")
    ] = 0.05,
    tolerance_rotation: Annotated[
        float, typer.Option(help="[rad] upper minus lower bound.")
    ] = 1e-6,
    tolerance_translation: Annotated[
        float, typer.Option(help="[m] upper minus lower bound.")
    ] = 1e-6,
    point: Annotated[
        list[str] | None,
        typer.Option(help="Of the platform, in its axes [m], such as x=0.1,z=-0.05."),
    ] = None,
    direction: Annotated[
        list[str] | None,
        typer.Option(help="Also the largest error along it, such as tx=1,tz=-1."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Certified bounds of the largest pose error, problem (27)."""
    from assembly.effects.acting import act
    from assembly.joint_file import LARGEST_LENGTH
    from assembly.reach import READINGS
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
        if not 0 < value <= LARGEST_LENGTH:
            option = "--" + key.replace("_", "-")
            expected = f"a finite number > 0, at most {LARGEST_LENGTH:g}"
            raise BadInput(f"{option}: found {value}, expected {expected}")
    acting = act(
        declared_posture(robot, pose, joint), parse_load(load), parse_gravity(gravity),
        parse_covariates(under),
    )  # fmt: skip
    with one_thread():
        results = pose_error_of(
            acting.posture, reading or None, load=acting.load, gravity=acting.gravity,
            point=parse_vector(point, "--point") or (0.0, 0.0, 0.0),
            direction=parse_direction(direction), **options,
        )  # fmt: skip
    write_json(results, json)
    if json != "-":
        print(pose_error_text(results))
    if results["status"] != "ok":
        raise typer.Exit(1)


@app.command()
def show(
    robot: RobotArgument,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="PNG, JPEG, BMP or TIFF; a window opens without."
        ),
    ] = None,
    pose: PoseOption = None,
    joint: JointOption = None,
    load: LoadOption = None,
    exaggeration: Annotated[
        float | None, typer.Option(help="Factor on displacements.", min=1e-6)
    ] = None,
    error_body: Annotated[
        str | None,
        typer.Option(help="Also the body of possible errors: translation | rotation."),
    ] = None,
    reading: Annotated[
        str | None,
        typer.Option(
            help="Of that body: frozen | free | budget; default budget, of a loaded "
            "robot frozen."
        ),
    ] = None,
) -> None:
    """Draw the nominal and the forced robot, and its errors."""
    from assembly.energy import CannotAssemble, solve_assembly
    from assembly.error_body import PARTS
    from assembly.plot import draw_assembly
    from assembly.reach import READINGS
    from assembly.results import failure_status, remark_lines
    from assembly.solvers.conic import SolverFailed
    from assembly.solvers.reduction import FreeMotion

    if output is not None:
        check_writable(output, PIXELS)
    elif not (os.environ.get("DISPLAY") or sys.platform in {"win32", "darwin"}):
        raise BadInput("no display to open a window on; name a file with --output")
    for option, value, valid in (
        ("--error-body", error_body, PARTS), ("--reading", reading, READINGS)
    ):  # fmt: skip
        if value is not None and value not in valid:
            raise BadInput(f'{option}: found "{value[:60]}"{nearest(value, valid)}')
    if exaggeration is not None and not exaggeration < float("inf"):
        raise BadInput(f"--exaggeration: found {exaggeration}, expected a finite one")
    wrench = parse_load(load)
    loaded = wrench is not None and any(wrench)
    if loaded and error_body is not None and reading == "budget":
        raise BadInput(
            "--reading: found budget with --load, and a loaded robot has no such "
            "reading; expected frozen or free"
        )
    reading = reading or ("frozen" if loaded else "budget")
    posture = posture_of(robot, pose, joint)
    for line in remark_lines(posture.robot.remarks):
        print(line)
    try:
        answer = solve_assembly(posture, wrench)
        plotter = draw_assembly(
            answer, exaggeration, error_body, reading, output is not None
        )
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        print(f"{failure_status(error)}: {error}")
        raise typer.Exit(1) from None
    if output is None:
        plotter.show()
    else:
        save_pixels(plotter.screenshot(return_img=True), output)
    plotter.close()
