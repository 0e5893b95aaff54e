"""Import of robots from other programs, with a home pose in which loops are closed."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from numpy.typing import NDArray

from forcefit.assembly.exchange.as_robot import (
    RobotAndMechanism,
    points_as_joints,
    robot_of_mechanism,
)
from forcefit.assembly.exchange.comparison import Comparison, compare
from forcefit.assembly.exchange.conversion import Conversion
from forcefit.assembly.exchange.home_pose import close_loops, loop_residual
from forcefit.assembly.exchange.loops_file import (
    LoopsFile,
    find_loops_file,
    read_loops,
    with_points,
)
from forcefit.assembly.exchange.mechanism import Mechanism
from forcefit.assembly.exchange.mjcf import read_mjcf
from forcefit.assembly.exchange.overlay import lay_over
from forcefit.assembly.exchange.sdf import read_sdf
from forcefit.assembly.exchange.urdf import read_urdf
from forcefit.assembly.exchange.xml_file import counted
from forcefit.assembly.files.robot_file import MOST_FRAMES, robot_of, robot_table
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.errors import BadInput
from forcefit.inputs.table import Table, read_toml

READERS = {".urdf": read_urdf, ".xml": read_mjcf, ".sdf": read_sdf}


def robot_of_file(
    source: Path,
    loops: Path | str | None = None,
    overlay: Path | str | None = None,
    points: Sequence[str] | None = None,
    ask: bool = True,
) -> tuple[Conversion, RobotAndMechanism]:
    """Read a robot from a file of another program.

    Args:
        source: URDF, MJCF or SDF file.
        loops: YAML file with ``closed_loop``; by default, the file in the same folder
            as a URDF.
        overlay: TOML file with elasticity, clearances and errors, by frame name.
        points: names of loops that are closed only at a point.
        ask: whether MuJoCo also reads the file for a comparison.

    Returns:
        Result of the conversion, which contains the robot, and the robot together with
        its mechanism.

    Raises:
        BadInput: a file is invalid, or a loop cannot be closed.
    """
    if loops is None and source.suffix.lower() == ".urdf":
        loops = find_loops_file(source)
    beside = None if loops is None else read_loops(loops)
    if points:
        if beside is None:
            raise BadInput(
                f"--points: found loops, but {source} has no loops file; add "
                "--loops FILE or remove --points"
            )
        beside = with_points(beside, points)
    mechanism = READERS[source.suffix.lower()](source, beside)
    if len(mechanism.joints) > MOST_FRAMES:
        raise BadInput(
            f"{source}: found {len(mechanism.joints)} joints, expected at most "
            f"{MOST_FRAMES}"
        )
    comparison = Comparison("", source.name, "the comparison was not requested")
    if ask or mechanism.unweighed:
        comparison = compare(mechanism, source)
    mechanism = _weighed(mechanism, comparison)
    home, held, taken = mechanism.home, True, tuple[str, ...]()
    if mechanism.loops:
        undecided = points is None and beside is not None and beside.as_generated
        pairs = beside if undecided else None
        mechanism, home, held, taken = _closed(mechanism, source, pairs)
    before = loop_residual(mechanism, mechanism.home)
    mechanism = points_as_joints(mechanism, home)
    named = None if overlay is None else _named_platform(overlay)
    if named in mechanism.bodies:
        mechanism = replace(mechanism, platform=named)
    placed = robot_of_mechanism(mechanism)
    robot = _laid_over(placed, source, overlay, named)
    conversion = Conversion(
        robot=robot,
        files=(),
        open_before=before,
        open_after=home_posture(robot).mismatch,
        drives_held=held,
        difference=0.0,
        left_out=_left_out(placed, mechanism.platform or named),
        taken=taken + placed.mechanism.taken,
        comparisons=(comparison,),
    )
    return conversion, placed


def _closed(
    mechanism: Mechanism, source: Path, beside: LoopsFile | None
) -> tuple[Mechanism, NDArray, bool, tuple[str, ...]]:
    """Find a home pose in which the loops of a mechanism are closed.

    Args:
        mechanism: mechanism as read from the file.
        source: path of the file.
        beside: loops file whose loop types may be default values.  If the loops cannot
            be closed with these types, all loops are closed only at a point.  None if
            the types were chosen by a user.

    Returns:
        Mechanism, its home coordinates (n,) [rad or m], whether the drive coordinates
        of the file are unchanged, and descriptions of the assumptions.

    Raises:
        BadInput: the loops cannot be closed.
    """
    try:
        return mechanism, *close_loops(mechanism, str(source)), ()
    except BadInput as error:
        if beside is None:
            raise
        read = READERS[source.suffix.lower()]
        loose = read(source, with_points(beside, ["all"]))
        loose = replace(mechanism, bodies={**loose.bodies, **mechanism.bodies},
                        joints=loose.joints, loops=loose.loops)  # fmt: skip
        try:
            home, held = close_loops(loose, str(source))
        except BadInput:
            raise error from None
        reason = str(error).removeprefix(f"{source}: ")
        taken = (
            (
                "all loops as 3d (closed at a point with free orientation), because "
                "they cannot be closed as 6d, which generators write by default "
                f"({reason}); use --points to declare the 3d loops"
            ),
        )
        return loose, home, held, taken


def _named_platform(overlay: Path | str) -> str | None:
    """Return the name of the platform in an overlay, or None."""
    given = read_toml(overlay)
    if not given.has("platform"):
        return None
    return given.text("platform", expected="the name of a frame")


def _laid_over(
    placed: RobotAndMechanism, source: Path, overlay: Path | str | None,
    named: str | None,
) -> Robot:  # fmt: skip
    """Apply an overlay to a robot; the overlay may specify the platform."""
    content = robot_table(placed.robot)
    if overlay is None:
        return robot_of(Table(content, str(source), ""), source.stem)
    root = lay_over(content, overlay)
    if named is not None and named in placed.places:
        root.content["platform"] = placed.places[named][0]
    return robot_of(root, source.stem)


def _left_out(placed: RobotAndMechanism, named: str | None) -> tuple[str, ...]:
    """Describe the content of a file that a robot with frames cannot represent."""
    mechanism = placed.mechanism
    weight = mechanism.bodies[mechanism.root].mass
    lines = list(mechanism.left_out)
    if weight:
        lines.append(f"mass of the root link {mechanism.root}: {weight:g} kg")
    if named is None:
        lines.append(
            f"no platform is named: {placed.robot.platform}, the end of the "
            "longest chain, is used; to select a different platform, use an overlay "
            'with platform = "NAME"'
        )
    return tuple(lines)


def _weighed(mechanism: Mechanism, comparison: Comparison) -> Mechanism:
    """Use the masses of meshes from MuJoCo, or report that they are missing."""
    known = comparison.weights
    bodies = dict(mechanism.bodies)
    for name, (mass, centre, J) in known.items():
        bodies[name] = replace(bodies[name], mass=mass, centre=centre, inertia=J)
    unknown = [name for name in mechanism.unweighed if name not in known]
    what = "masses of mesh shapes"
    return replace(
        mechanism, bodies=bodies,
        taken=mechanism.taken + counted(f"{what}, by {comparison.reader}", list(known)),
        left_out=mechanism.left_out + counted(what, unknown),
    )  # fmt: skip
