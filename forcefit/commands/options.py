"""Options that several commands share, and functions that parse their values.

Every error message names the option.
"""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from forcefit.inputs.assignments import check_components, parse_assignments
from forcefit.inputs.errors import BadInput, checked, describe, nearest
from forcefit.inputs.writing import check_json

if TYPE_CHECKING:
    from numpy.typing import NDArray


def _built_in_names(incomplete: str) -> list[str]:
    """Return the names of built-in robots that begin with the given text."""
    from forcefit.assembly.robots import BUILT_IN

    return [name for name in BUILT_IN if name.startswith(incomplete)]


RobotArgument = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="A robot file, a URDF, MJCF or SDF file, or a built-in name.",
        autocompletion=_built_in_names,
    ),
]


PoseOption = Annotated[
    list[str] | None,
    typer.Option(
        "--pose", help="Nominal platform pose [m, rad], such as tx=0.1,tz=-0.5."
    ),
]


JointOption = Annotated[
    list[str] | None,
    typer.Option(
        "--joint", help="Coordinates of the drives [rad or m], such as leg1.drive=0.1."
    ),
]


LoadOption = Annotated[
    list[str] | None,
    typer.Option("--load", help="Load on the platform [N, N m], such as fx=10,mz=1."),
]


DriveForceOption = Annotated[
    list[str] | None,
    typer.Option(
        "--drive-force",
        help="Forces of force-controlled drives [N m or N], such as elbow=200.",
    ),
]


AtOption = Annotated[
    list[str] | None,
    typer.Option(
        "--at",
        help="Point of the platform, in platform axes [m], such as 0,0,-0.1 or z=-0.1.",
    ),
]


AlongOption = Annotated[
    list[str] | None,
    typer.Option(
        "--along", help="Direction of a translation or rotation, such as tx=1,tz=-1."
    ),
]


GravityOption = Annotated[
    list[str] | None,
    typer.Option("--gravity", help="Gravity in base axes [m/s^2], such as z=-9.81."),
]


UnderOption = Annotated[
    list[str] | None,
    typer.Option(
        "--under",
        help="Values of covariates of the robot's effects: "
        "temperature=5,time=0,approach=1; "
        "session=NAME.",
    ),
]


RestOption = Annotated[
    str | None,
    typer.Option(
        "--rest",
        help="Frame in a loop that does not close at home; the gap is added to this "
        "frame's "
        "geometric error.",
    ),
]


MismatchOption = Annotated[
    str | None,
    typer.Option(
        "--mismatch",
        help="spring: redundant elastic drives deform to close the gap of their "
        "coordinates "
        "(--joint, or those at home).",
    ),
]


SeedOption = Annotated[
    int, typer.Option("--seed", help="Seed of the random errors.", min=0, max=2**63 - 1)
]


GridOption = Annotated[
    str | None,
    typer.Option("--grid", help="Grid of poses, such as tx=-0.2:0.2:0.1,tz=-0.5."),
]


FigureOption = Annotated[
    Path | None,
    typer.Option("--figure", help="Also write a figure: PNG, SVG or PDF."),
]


JsonOption = Annotated[
    str | None,
    typer.Option(
        "--json",
        help="Write results as JSON to a file; - is stdout.",
        callback=check_json,
    ),
]


def parse_load(texts: list[str] | None, option: str = "--load") -> list[float] | None:
    """Return the wrench ``[mx my mz fx fy fz]`` of an option, or None if it is absent.

    Args:
        texts: texts such as ``["fx=10,mz=1"]``; omitted components are zero.
        option: name of the option, for messages.

    Returns:
        Six numbers [N m, N].

    Raises:
        BadInput: the name of a component is unknown, or a value is not a number.
    """
    if not texts:
        return None
    from forcefit.assembly.model.given_load import given_load
    from forcefit.assembly.model.largest import LARGEST

    given = parse_assignments(texts, option, LARGEST)
    wrench: list[float] = given_load(given, option).tolist()
    return wrench


def parse_gravity(texts: list[str] | None) -> list[float] | None:
    """Return the gravity (3,) [m/s^2] of ``--gravity``; see :func:`parse_vector`."""
    return parse_vector(texts, "--gravity")


def parse_vector(texts: list[str] | None, option: str) -> list[float] | None:
    """Return three numbers given by component, or None if the option is absent.

    Args:
        texts: texts such as ``["z=-9.81"]``.
        option: name of the option, for messages.

    Returns:
        The numbers along x, y and z.

    Raises:
        BadInput: a name is not x, y or z, or a value is not a number of at most 1e6.
    """
    if not texts:
        return None
    from forcefit.assembly.model.largest import LARGEST_LENGTH

    given = parse_assignments(texts, option, LARGEST_LENGTH)
    for name in given:
        if name not in {"x", "y", "z"}:
            raise BadInput(f'{option}: unknown component "{name[:60]}"; valid: x, y, z')
    return [given.get(name, 0.0) for name in "xyz"]


def parse_state(
    text: str, valid: Sequence[str] = ("nominal", "contact", "exact")
) -> Any:
    """Return the state in which K_C is taken, from ``--state``.

    Args:
        text: value of the option.
        valid: states that the command accepts.

    Returns:
        The state.

    Raises:
        BadInput: the text is not among the valid states.
    """
    if text not in valid:
        raise BadInput(f"--state: found {describe(text)}{nearest(text, valid)}")
    return text


def parse_point(texts: list[str] | None) -> tuple[float, float, float]:
    """Return the point of ``--at``, or the platform's origin if the option is absent.

    Args:
        texts: texts such as ``["0,0,-0.1"]`` or ``["z=-0.1"]``.

    Returns:
        Three coordinates [m].

    Raises:
        BadInput: the text is neither three numbers nor numbers by component, or a
            number is not finite or exceeds 1e6.
    """
    if not texts:
        return 0.0, 0.0, 0.0
    if "=" in texts[0]:
        x, y, z = parse_vector(texts, "--at") or (0.0, 0.0, 0.0)
        return x, y, z
    from forcefit.assembly.model.largest import LARGEST_LENGTH
    from forcefit.inputs.number_arrays import comma_numbers

    text = ",".join(texts)
    point = comma_numbers(text)
    if point.shape != (3,) or not (abs(point) <= LARGEST_LENGTH).all():
        raise BadInput(
            f"--at: found {describe(text)}, expected three numbers of size at most "
            f"{LARGEST_LENGTH:g} [m] such as 0,0,-0.1, or z=-0.1"
        )
    return float(point[0]), float(point[1]), float(point[2])


def parse_direction(texts: list[str] | None) -> list[float] | None:
    """Return the direction of ``--along`` as a unit screw of the platform.

    Args:
        texts: texts such as ``["tx=1,tz=-1"]``.

    Returns:
        Six numbers ``[rx ry rz tx ty tz]``; None if the option is absent.

    Raises:
        BadInput: a component is unknown, all are zero, or rotation and translation are
            mixed.
    """
    if not texts:
        return None
    from forcefit.assembly.model.largest import LARGEST_LENGTH
    from forcefit.stiffness.screws import SCREW

    names = [name.lower() for name in SCREW]
    given = parse_assignments(texts, "--along", LARGEST_LENGTH)
    check_components(given, "--along", names)
    length = math.hypot(*given.values())
    if length == 0.0 or len({name[0] for name, value in given.items() if value}) > 1:
        raise BadInput(
            "--along: expected components of a translation or of a rotation, "
            "such as tx=1,tz=-1: not all zero, and not of both kinds"
        )
    return [given.get(name, 0.0) / length for name in names]


def posture_of(
    robot: str, pose: list[str] | None, joint: list[str] | None,
    rest: str | None = None, mismatch: str | None = None, own_errors: bool = True,
    note: bool = True, links: bool = True, drive_force: list[str] | None = None,
) -> Any:  # fmt: skip
    """Return the posture of ``--pose`` or ``--joint``; home if both are absent.

    Args:
        robot: name or file of the robot.
        pose: value of ``--pose``.
        joint: value of ``--joint``.
        rest: value of ``--rest``.
        mismatch: value of ``--mismatch``.
        own_errors: whether the robot keeps its declared errors in addition.
        note: whether to print remarks on the posture to stderr.
        links: of :func:`forcefit.assembly.exchange.robot_files.load_robot`.
        drive_force: of ``--drive-force``.

    Returns:
        The posture, with the effects of the robot's file applied.

    Raises:
        BadInput: an effect loads the robot, and the command supports no loads.
    """
    from forcefit.assembly.effects.robot_effects import apply_robot_effects

    declared = declared_posture(
        robot, pose, joint, rest, mismatch, own_errors, note, links, drive_force
    )
    applied = apply_robot_effects(declared)
    if applied.gravity is not None or applied.load.any():
        raise BadInput(
            f"{robot}: found effects that load the robot, which this command does not "
            "compute; use assembly solve or validation crosscheck instead"
        )
    return applied.posture


def declared_posture(
    robot: str, pose: list[str] | None, joint: list[str] | None,
    rest: str | None = None, mismatch: str | None = None, own_errors: bool = True,
    note: bool = True, links: bool = True, drive_force: list[str] | None = None,
) -> Any:  # fmt: skip
    """Return the posture of the options, without the effects of the robot's file.

    Remarks on the posture are printed to stderr if ``note`` is true.
    """
    from forcefit.assembly.exchange.robot_files import load_robot
    from forcefit.assembly.kinematics.closing import closing_of
    from forcefit.assembly.kinematics.posture import home_posture, place_robot
    from forcefit.assembly.kinematics.verdict import posture_remarks
    from forcefit.assembly.model.force_control import with_drive_forces
    from forcefit.assembly.model.largest import LARGEST, LARGEST_LENGTH

    joints = parse_assignments(joint, "--joint", LARGEST_LENGTH) if joint else None
    close = closing_of(rest, mismatch, joints, own_errors)
    machine = load_robot(robot, close, links=links)
    if drive_force:
        forces = parse_assignments(drive_force, "--drive-force", LARGEST)
        machine = with_drive_forces(machine, forces)
    if mismatch is not None and not pose:
        posture = home_posture(machine)
    else:
        posture = place_robot(
            machine, joints=joints,
            pose=parse_assignments(pose, "--pose", LARGEST_LENGTH) if pose else None,
        )  # fmt: skip
    for remark in posture_remarks(posture) if note else ():
        print(f"forcefit: note: {machine.name}: {remark}", file=sys.stderr)
    return posture


def declared_under(
    robot: str,
    pose: list[str] | None,
    joint: list[str] | None,
    load: list[str] | None,
    gravity: list[str] | None,
    under: list[str] | None,
    *,
    finite: bool = False,
    rest: str | None = None,
    mismatch: str | None = None,
    note: bool = True,
    drive_force: list[str] | None = None,
) -> Any:
    """Return the robot under loads and covariates, with the effects of its file.

    Args:
        robot: name or file of the robot.
        pose: value of ``--pose``.
        joint: value of ``--joint``.
        load: load on the platform.
        gravity: gravity in base axes.
        under: covariates of the effects.
        finite: whether the exact model is used.
        rest: value of ``--rest``.
        mismatch: value of ``--mismatch``.
        note: whether to print remarks on the posture to stderr.
        drive_force: of ``--drive-force``.

    Returns:
        The posture, loads and conditions with the effects applied.
    """
    from forcefit.assembly.effects.robot_effects import apply_robot_effects

    posture = declared_posture(
        robot, pose, joint, rest, mismatch, note=note, drive_force=drive_force
    )
    g = parse_gravity(gravity)
    note_massless(posture.robot, g)
    return apply_robot_effects(
        posture, parse_load(load), g, parse_covariates(under), finite=finite
    )


def note_massless(robot: Any, gravity: list[float] | None) -> None:
    """Print a note to stderr if gravity is given but no body has a mass."""
    from forcefit.assembly.linear.load import massless

    for remark in massless(robot, gravity):
        print(f"forcefit: note: {robot.name}: {remark}", file=sys.stderr)


def note_loose(robot: Any) -> None:
    """Print a note to stderr if a fixed joint stays loose at every pose."""
    from forcefit.assembly.steps.bolted import loose_over_poses

    for remark in loose_over_poses(robot):
        print(f"forcefit: note: {robot.name}: {remark}", file=sys.stderr)


def note_closing(robot: Any, rest: str | None, mismatch: str | None) -> None:
    """Print to stderr how ``--rest`` or ``--mismatch`` closed the robot's loops."""
    asked = [option for option in (rest, mismatch) if option is not None]
    for remark in robot.remarks[len(robot.remarks) - len(asked) :]:
        print(f"forcefit: note: {robot.name}: {remark}", file=sys.stderr)


def parse_covariates(texts: list[str] | None) -> dict[str, float | str]:
    """Return the values of covariates that ``--under`` sets.

    Args:
        texts: texts such as ``["temperature=5,approach=1"]``.

    Returns:
        Numbers by name; the value of ``session`` is a text.

    Raises:
        BadInput: a text is not of the form ``NAME=VALUE``.
    """
    parts = [part.strip() for text in texts or () for part in text.split(",")]
    named = [part.partition("=")[2].strip() for part in parts if _names_session(part)]
    if len(named) > 1:
        raise BadInput('--under: "session" is given twice')
    numbers = [part for part in parts if not _names_session(part)]
    given = parse_assignments(numbers, "--under") if numbers else {}
    return {**given, **({"session": named[0]} if named else {})}


def _names_session(assignment: str) -> bool:
    return assignment.partition("=")[0].strip() == "session" and "=" in assignment


def parse_axis(option: str, text: str) -> "NDArray":
    """Return a direction given as ``x``, ``-y`` or ``1,0,2``.

    Args:
        option: name of the option, for the message.
        text: value of the option.

    Returns:
        (3,) vector of any length except zero.

    Raises:
        BadInput: the text is neither an axis nor three numbers.
    """
    import numpy as np

    from forcefit.inputs.number_arrays import comma_numbers
    from forcefit.stiffness.screws import UNIT_VECTORS

    name = text.strip().lower()
    if name.lstrip("+-") in UNIT_VECTORS and len(name) <= 2:
        sign = -1.0 if name.startswith("-") else 1.0
        return sign * np.array(UNIT_VECTORS[name.lstrip("+-")])
    vector = comma_numbers(text)
    if vector.shape != (3,) or not vector.any():
        raise BadInput(
            f"{option}: found {describe(text)}, expected x, y, z or three numbers "
            "such as 0,0,1, not all zero"
        )
    largest = np.abs(vector).max()
    # the square of a number such as 1e300 would exceed the range of floats
    return vector if 1e-150 < largest < 1e150 else vector / largest


def parse_sizes(option: str, text: str, unit: str) -> list[float]:
    """Return positive numbers separated by commas, in ascending order.

    Args:
        option: name of the option, for the message.
        text: value of the option.
        unit: unit for the message.

    Returns:
        The numbers.

    Raises:
        BadInput: a number is not finite and > 0, or is given twice.
    """
    try:
        sizes = sorted(float(part) for part in text.split(","))
    except ValueError:
        raise BadInput(
            f"{option}: found {describe(text)}, expected numbers such as 5,10,20"
        ) from None
    for one, other in zip(sizes, [*sizes[1:], math.inf], strict=True):
        checked(option, one, unit, above=0)
        if one == other:
            raise BadInput(f"{option}: {one:g} is given twice")
    return sizes
