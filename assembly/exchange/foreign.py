"""Robots of other programs' files, with a home pose in which their loops close."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from assembly.exchange.as_robot import (
    RobotAndMechanism,
    guess_platform,
    points_as_joints,
    robot_of_mechanism,
)
from assembly.exchange.conversion import Conversion
from assembly.exchange.home_pose import close_loops, loop_residual
from assembly.exchange.loops_file import find_loops_file, read_loops, with_points
from assembly.exchange.mechanism import Mechanism
from assembly.exchange.mjcf import read_mjcf
from assembly.exchange.mujoco_reading import Comparison, compare
from assembly.exchange.overlay import lay_over
from assembly.exchange.sdf import read_sdf
from assembly.exchange.urdf import read_urdf
from assembly.exchange.xml_file import counted
from assembly.files.robot_file import robot_of, robot_table
from assembly.kinematics.posture import home_posture
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
    """The robot of a file of another program.

    Args:
        source: a URDF, MJCF or SDF file.
        loops: YAML with ``closed_loop``; None: the one beside a URDF.
        overlay: TOML with elasticity, clearances, errors of frames by name.
        points: names of loops that meet only in a point.
        ask: whether another program that is installed reads the file too.

    Returns:
        The robot and what became of it, nothing written, and the mechanism that it is.

    Raises:
        BadInput: a file breaks a rule, or a loop cannot close.
    """
    ending = source.suffix.lower()
    if loops is None and ending == ".urdf":
        loops = find_loops_file(source)
    beside = None if loops is None else read_loops(loops)
    if points:
        if beside is None:
            raise BadInput(f"--points: found some, but {source} has no loops file")
        beside = with_points(beside, points)
    read = READERS[ending]
    mechanism, points_taken = read(source, beside), tuple[str, ...]()
    comparison = Comparison("", source.name, "it was not asked")
    if ask or mechanism.unweighed:
        comparison = compare(mechanism, source)
    mechanism = _weighed(mechanism, comparison)
    before = loop_residual(mechanism, mechanism.home)
    home, held = mechanism.home, True
    if mechanism.loops:
        try:
            home, held = close_loops(mechanism, str(source))
        except BadInput as error:
            if points is not None or beside is None or not beside.as_generated:
                raise
            mechanism = read(source, with_points(beside, ["all"]))
            mechanism = _weighed(mechanism, comparison)
            try:
                home, held = close_loops(mechanism, str(source))
            except BadInput:
                raise error from None
            before = loop_residual(mechanism, mechanism.home)
            points_taken = (
                "every loop for a point (3d): all of them are said to be 6d, which is "
                "what generators write, and so they cannot close "
                f"({str(error).removeprefix(f'{source}: ')}); --points says which are",
            )
    mechanism = points_as_joints(mechanism, home)
    if overlay is not None:
        mechanism = _with_platform(mechanism, overlay)
    guessed = mechanism.platform is None
    placed = robot_of_mechanism(mechanism)
    content = robot_table(placed.robot)
    root = (
        Table(content, str(source), "")
        if overlay is None
        else lay_over(content, overlay)
    )
    robot = robot_of(root, source.stem)
    mechanism = placed.mechanism
    weight = mechanism.bodies[mechanism.root].mass
    left_out = list(mechanism.left_out)
    if weight:
        left_out.append(f"mass of the root link {mechanism.root}: {weight:g} kg")
    if guessed:
        left_out.append(
            f"no platform is named: {robot.platform} was taken, the end of the longest "
            "chain (an overlay's platform says another)"
        )
    after = home_posture(robot).mismatch
    conversion = Conversion(
        robot=robot,
        files=(),
        open_before=before,
        open_after=after,
        drives_held=held,
        difference=0.0,
        left_out=tuple(left_out),
        taken=points_taken + placed.mechanism.taken,
        comparisons=(comparison,),
    )
    return conversion, placed


def _with_platform(mechanism: Mechanism, overlay: Path | str) -> Mechanism:
    """The mechanism with the platform that an overlay names."""
    given = read_toml(overlay)
    if not given.has("platform"):
        return mechanism
    name = given.text("platform", expected="the name of a frame")
    # what is no body may be a frame: that is seen where the overlay is laid over
    guess = guess_platform(mechanism) if name not in mechanism.bodies else name
    return replace(mechanism, platform=guess)


def _weighed(mechanism: Mechanism, comparison: Comparison) -> Mechanism:
    """Masses of meshes as the other program has them, or said to be left out."""
    known = comparison.weights
    bodies = dict(mechanism.bodies)
    for name, (mass, centre) in known.items():
        bodies[name] = replace(bodies[name], mass=mass, centre=centre)
    unknown = [name for name in mechanism.unweighed if name not in known]
    what = "masses of mesh shapes"
    return replace(
        mechanism, bodies=bodies,
        taken=mechanism.taken + counted(f"{what}, by {comparison.reader}", list(known)),
        left_out=mechanism.left_out + counted(what, unknown),
    )  # fmt: skip
