"""Options shared by several commands, and functions that parse their values.

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
    """Complete the name of a built-in robot."""
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
        "--pose", help="Nominal platform pose [m, rad], for example tx=0.1,tz=-0.5."
    ),
]


JointOption = Annotated[
    list[str] | None,
    typer.Option(
        "--joint",
        help="Drive coordinates [rad or m], for example leg1.drive=0.1.",
    ),
]


LoadOption = Annotated[
    list[str] | None,
    typer.Option(
        "--load", help="Load on the platform [N, N m], for example fx=10,mz=1."
    ),
]


DriveForceOption = Annotated[
    list[str] | None,
    typer.Option(
        "--drive-force",
        help="Forces of force-controlled drives [N m or N], for example elbow=200.",
    ),
]


AtOption = Annotated[
    list[str] | None,
    typer.Option(
        "--at",
        help="Point on the platform, in platform axes [m], for example 0,0,-0.1 or "
        "z=-0.1.",
    ),
]


AlongOption = Annotated[
    list[str] | None,
    typer.Option(
        "--along",
        help="Direction of a translation or a rotation, for example tx=1,tz=-1.",
    ),
]


GravityOption = Annotated[
    list[str] | None,
    typer.Option(
        "--gravity", help="Gravity in base axes [m/s^2], for example z=-9.81."
    ),
]


UnderOption = Annotated[
    list[str] | None,
    typer.Option(
        "--under",
        help="Covariates on which the effects of the robot depend: "
        "temperature=5,time=0,approach=1; session=NAME.",
    ),
]


RestOption = Annotated[
    str | None,
    typer.Option(
        "--rest",
        help="Frame in a loop that is open at the home pose; the gap is added to the "
        "geometric error of this frame.",
    ),
]


MismatchOption = Annotated[
    str | None,
    typer.Option(
        "--mismatch",
        help="spring: redundant elastic drives deform to close the gap that their "
        "coordinates (--joint, or those at home) leave open.",
    ),
]


SeedOption = Annotated[
    int,
    typer.Option("--seed", help="Seed for the random errors.", min=0, max=2**63 - 1),
]


GridOption = Annotated[
    str | None,
    typer.Option("--grid", help="Grid of poses, for example tx=-0.2:0.2:0.1,tz=-0.5."),
]


FigureOption = Annotated[
    Path | None,
    typer.Option("--figure", help="Also write a figure: PNG, SVG or PDF."),
]


JsonOption = Annotated[
    str | None,
    typer.Option(
        "--json",
        help="Write results as JSON to a file, or to stdout if the file is -.",
        callback=check_json,
    ),
]


def parse_load(texts: list[str] | None, option: str = "--load") -> list[float] | None:
    """Parse the wrench ``[mx my mz fx fy fz]`` of an option; None if it is absent.

    Args:
        texts: for example ``["fx=10,mz=1"]``; omitted components are zero.
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
    """Parse gravity (3,) [m/s^2] from ``--gravity``; see :func:`parse_vector`."""
    return parse_vector(texts, "--gravity")


def parse_vector(texts: list[str] | None, option: str) -> list[float] | None:
    """Parse a vector given by its components, or return None if the option is absent.

    Args:
        texts: for example ``["z=-9.81"]``; omitted components are zero.
        option: name of the option, for messages.

    Returns:
        Components along x, y and z.

    Raises:
        BadInput: a name is not x, y or z, or a value is not a number whose magnitude is
            at most 1e6.
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
    """Check and return the value of ``--state``, the state for which K_C is computed.

    Args:
        text: value of the option.
        valid: states supported by the command.

    Returns:
        The state.

    Raises:
        BadInput: the command does not support the state.
    """
    if text not in valid:
        raise BadInput(f"--state: found {describe(text)}{nearest(text, valid)}")
    return text


def parse_point(texts: list[str] | None) -> tuple[float, float, float]:
    """Parse the point of ``--at``; the default is the origin of the platform.

    Args:
        texts: for example ``["0,0,-0.1"]`` or ``["z=-0.1"]``.

    Returns:
        Coordinates x, y and z [m].

    Raises:
        BadInput: the text contains neither three numbers nor named components, or a
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
            f"--at: found {describe(text)}, expected three numbers of magnitude at "
            f"most {LARGEST_LENGTH:g} [m], for example 0,0,-0.1, or z=-0.1"
        )
    return float(point[0]), float(point[1]), float(point[2])


def parse_direction(texts: list[str] | None) -> list[float] | None:
    """Parse the direction of ``--along`` as a unit screw of the platform.

    Args:
        texts: for example ``["tx=1,tz=-1"]``.

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
            "--along: expected either translation or rotation components (not both), "
            "at least one of them nonzero, for example tx=1,tz=-1"
        )
    return [given.get(name, 0.0) / length for name in names]


def posture_of(
    robot: str, pose: list[str] | None, joint: list[str] | None,
    rest: str | None = None, mismatch: str | None = None, own_errors: bool = True,
    note: bool = True, links: bool = True, drive_force: list[str] | None = None,
) -> Any:  # fmt: skip
    """Return the posture given by ``--pose`` or ``--joint``, or the home posture.

    Args:
        robot: name or file of the robot.
        pose: value of ``--pose``.
        joint: value of ``--joint``.
        rest: value of ``--rest``.
        mismatch: value of ``--mismatch``.
        own_errors: whether the declared errors of the robot stay in effect in addition
            to those that close its loops.
        note: whether to print remarks on the posture to stderr.
        links: see :func:`forcefit.assembly.exchange.robot_files.load_robot`.
        drive_force: value of ``--drive-force``.

    Returns:
        Posture with the effects of the robot file applied.

    Raises:
        BadInput: an effect loads the robot or depends on covariates, which the calling
            command does not support.
    """
    from forcefit.assembly.effects.robot_effects import with_effects_applied

    declared = declared_posture(
        robot, pose, joint, rest, mismatch, own_errors, note, links, drive_force
    )
    return with_effects_applied(declared)


def declared_posture(
    robot: str, pose: list[str] | None, joint: list[str] | None,
    rest: str | None = None, mismatch: str | None = None, own_errors: bool = True,
    note: bool = True, links: bool = True, drive_force: list[str] | None = None,
) -> Any:  # fmt: skip
    """Return the posture given by the options, without the effects of the robot file.

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
    """Return the loaded robot with the effects of its file applied.

    Args:
        robot: name or file of the robot.
        pose: value of ``--pose``.
        joint: value of ``--joint``.
        load: value of ``--load``.
        gravity: value of ``--gravity``.
        under: value of ``--under``.
        finite: whether the exact model is used.
        rest: value of ``--rest``.
        mismatch: value of ``--mismatch``.
        note: whether to print remarks on the posture to stderr.
        drive_force: value of ``--drive-force``.

    Returns:
        Posture, loads and conditions with the effects applied.
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
    """Print a note to stderr if gravity is given but no body has mass."""
    from forcefit.assembly.linear.load import massless

    for remark in massless(robot, gravity):
        print(f"forcefit: note: {robot.name}: {remark}", file=sys.stderr)


def note_loose(robot: Any) -> None:
    """Print a note to stderr if a fixed joint stays loose at every pose."""
    from forcefit.assembly.steps.bolted import loose_over_poses

    for remark in loose_over_poses(robot):
        print(f"forcefit: note: {robot.name}: {remark}", file=sys.stderr)


def note_closing(robot: Any, rest: str | None, mismatch: str | None) -> None:
    """Print to stderr how ``--rest`` or ``--mismatch`` has closed the loops."""
    asked = [option for option in (rest, mismatch) if option is not None]
    for remark in robot.remarks[len(robot.remarks) - len(asked) :]:
        print(f"forcefit: note: {robot.name}: {remark}", file=sys.stderr)


def parse_covariates(texts: list[str] | None) -> dict[str, float | str]:
    """Parse the covariates given by ``--under``.

    Args:
        texts: for example ``["temperature=5,approach=1"]``.

    Returns:
        Values by name: numbers, except for ``session``, which is a string.

    Raises:
        BadInput: an assignment does not have the form ``NAME=VALUE``.
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
    """Parse a direction given as ``x``, ``-y`` or ``1,0,2``.

    Args:
        option: name of the option, for the message.
        text: value of the option.

    Returns:
        Nonzero vector (3,) of arbitrary length.

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
            f"{option}: found {describe(text)}, expected x, y, z or a nonzero vector "
            "such as 0,0,1"
        )
    largest = np.abs(vector).max()
    # scaled, because the square of 1e300 would overflow
    return vector if 1e-150 < largest < 1e150 else vector / largest


def parse_sizes(option: str, text: str, unit: str) -> list[float]:
    """Parse positive numbers separated by commas and sort them in ascending order.

    Args:
        option: name of the option, for messages.
        text: value of the option.
        unit: unit of the numbers, for messages.

    Returns:
        Sorted numbers.

    Raises:
        BadInput: a number is not finite and positive, or is given twice.
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
