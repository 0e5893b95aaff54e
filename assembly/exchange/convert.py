"""``forcefit convert``: robots of other programs in and out, read back after writing.

============  ==========================================================  ==========
kind          read                                                        written
============  ==========================================================  ==========
``.toml``     robot file                                                  yes
``.urdf``     URDF and its loops (``robot.yaml``, ``closed_loop``)        both files
``.xml``      MJCF with connect and weld                                  yes
``.sdf``      SDF of one model, whose joints may close loops              no
============  ==========================================================  ==========
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from assembly.exchange.as_robot import (
    RobotAndMechanism,
    mechanism_of_robot,
    points_as_joints,
    robot_of_mechanism,
)
from assembly.exchange.calibrated import not_rigid, with_calibration
from assembly.exchange.fidelity import FAITHFUL, largest_difference
from assembly.exchange.home_pose import (
    CLOSED,
    close_loops,
    loop_residual,
    nearest_closed,
)
from assembly.exchange.loops_file import (
    LoopsFile,
    find_loops_file,
    loops_text,
    read_loops,
    with_points,
)
from assembly.exchange.mechanism import Mechanism
from assembly.exchange.mjcf import read_mjcf
from assembly.exchange.mjcf_writing import mjcf_text
from assembly.exchange.mujoco_reading import Comparison, compare
from assembly.exchange.overlay import lay_over
from assembly.exchange.sdf import read_sdf
from assembly.exchange.urdf import read_urdf
from assembly.exchange.urdf_writing import XML_MARK, loops_of, urdf_text
from assembly.exchange.xml_file import counted
from assembly.files.robot_file import read_robot, robot_of, robot_table, write_robot
from assembly.kinematics.posture import home_posture
from assembly.model.robot import Robot
from assembly.robots import load_robot
from forcefit.inputs.errors import BadInput, quoted
from forcefit.inputs.table import Table
from forcefit.inputs.writing import ROBOT, Kind, check_writable, write_text

_READERS = {".urdf": read_urdf, ".xml": read_mjcf, ".sdf": read_sdf}
_BEGINS = (XML_MARK.lower().encode(),)
_KINDS = {
    ".toml": ROBOT,
    ".urdf": Kind("a URDF written by forcefit", (".urdf",), _BEGINS),
    ".xml": Kind("an MJCF file written by forcefit", (".xml",), _BEGINS),
}
_LOOPS = Kind(
    "a loops file written by forcefit", (".yaml",), (b"# written by forcefit",)
)


@dataclass(frozen=True, eq=False)
class Conversion:
    """What became of a robot.

    Attributes:
        robot: as it stands in the robot file, or as it was read from one.
        files: written.
        open_before: [rad, m] what the loops leave open where the file's own home is.
        open_after: [rad, m] likewise in the home that was found.
        drives_held: whether the drives stand where the file has them.
        difference: largest of any body's pose in 100 random postures, read back.
        comparisons: with what another program reads in the files.
        left_out: what the new file cannot hold, in words.
        taken: what the files leave open, and what was taken, in words.
    """

    robot: Robot
    files: tuple[Path, ...]
    open_before: float
    open_after: float
    drives_held: bool
    difference: float
    left_out: tuple[str, ...]
    taken: tuple[str, ...] = ()
    comparisons: tuple[Comparison, ...] = ()

    @property
    def agrees(self) -> bool:
        """Whether no other program read another robot."""
        return all(comparison.agrees for comparison in self.comparisons)

    def table(self) -> dict[str, Any]:
        """Plain values for ``--json``."""
        return {
            "robot": self.robot.name,
            "platform": self.robot.platform,
            "frames": len(self.robot.frames),
            "closures": len(self.robot.closures),
            "files": [str(path) for path in self.files],
            "home": {
                "open_before": self.open_before,
                "open_after": self.open_after,
                "drives_held": self.drives_held,
            },
            "largest_difference": self.difference,
            "compared": [comparison.table() for comparison in self.comparisons],
            "left_out": list(self.left_out),
            "taken": list(self.taken),
        }

    def text(self) -> str:
        """A few lines for people."""
        robot = self.robot
        count = len(robot.closures)
        lines = [
            f"{robot.name}: {len(robot.frames)} frames, "
            f"{count} loop{'s' * (count != 1)}, platform {quoted(robot.platform)}",
            f"read back in 100 random postures: bodies within {self.difference:.1e} "
            "(by forcefit itself: nothing was lost in writing)",
            *(comparison.text() for comparison in self.comparisons),
        ]
        if count:
            moved = "" if self.drives_held else "; the drives had to move"
            lines.append(
                f"home: loops open by {self.open_before:.2g} rad or m in the file's "
                f"own, {self.open_after:.1e} in the one found{moved}"
            )
        lines += [f"taken: {line}" for line in self.taken]
        lines += [f"left out: {line}" for line in self.left_out]
        return "\n".join([*lines, f"written: {', '.join(map(str, self.files))}"])


def convert(
    source: Path | str,
    target: Path | str,
    loops: Path | str | None = None,
    overlay: Path | str | None = None,
    points: Sequence[str] | None = None,
) -> Conversion:
    """Convert a robot between a robot file and the files of other programs.

    Args:
        source: a ``.urdf``, ``.xml`` (MJCF), ``.sdf`` or ``.toml`` file, or the name of
            a built-in robot.
        target: a ``.toml``, ``.urdf`` or ``.xml`` file.
        loops: YAML with ``closed_loop``, for files that have it not beside them.
        overlay: TOML with elasticity, clearances, errors of frames by name.
        points: names of loops that meet only in a point, beside those of type 3d; an
            empty one takes the types as they stand.  Without it they are taken so too,
            unless every loop is said to be 6d and they cannot close: then all are
            points, and the answer says so.

    Returns:
        What was written and how well it is what was read.

    Raises:
        BadInput: a file breaks a rule, a loop cannot close, or what was written is not
            the same robot; nothing is written then.
    """
    source, target = Path(source), Path(target)
    ending = target.suffix.lower()
    if ending not in _KINDS:
        given = f"the ending {quoted(target.suffix)}" if target.suffix else "no ending"
        raise BadInput(f"{target}: found {given}, expected {' or '.join(_KINDS)}")
    beside = target.with_suffix(".yaml") if ending == ".urdf" else None
    check_writable(target, _KINDS[ending])
    if beside is not None:
        check_writable(beside, _LOOPS)
    if source.suffix.lower() in _READERS:
        conversion, placed = _from_others(source, loops, overlay, points)
    elif points:
        raise BadInput(f"--points: found some beside {source}, which says its own")
    elif loops is not None:
        raise BadInput(f"--loops: found one beside {source}, which says its own loops")
    else:
        conversion, placed = _declared(source, overlay), None
    return _written(conversion, placed, target)


def _from_others(
    source: Path,
    loops: Path | str | None,
    overlay: Path | str | None,
    points: Sequence[str] | None,
) -> tuple[Conversion, RobotAndMechanism]:
    """The robot of a file of another program."""
    ending = source.suffix.lower()
    if loops is None and ending == ".urdf":
        loops = find_loops_file(source)
    beside = None if loops is None else read_loops(loops)
    if points:
        if beside is None:
            raise BadInput(f"--points: found some, but {source} has no loops file")
        beside = with_points(beside, points)
    read = _READERS[ending]
    mechanism, points_taken = read(source, beside), tuple[str, ...]()
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
    if guessed and robot.platform == placed.robot.platform:
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


def _declared(source: Path, overlay: Path | str | None) -> Conversion:
    """The robot of a robot file, or a built-in one."""
    robot = load_robot(source)
    if overlay is not None:
        content = robot_table(robot, Path(overlay).parent)
        robot = robot_of(lay_over(content, overlay), robot.name)
    mismatch = home_posture(robot).mismatch
    return Conversion(
        robot=robot,
        files=(),
        open_before=mismatch,
        open_after=mismatch,
        drives_held=True,
        difference=0.0,
        left_out=(),
    )


def _written(
    conversion: Conversion, placed: RobotAndMechanism | None, target: Path
) -> Conversion:
    """Write, read back and compare in a folder of its own, then where it belongs."""
    ending, robot = target.suffix.lower(), conversion.robot
    with TemporaryDirectory() as folder:
        trial = Path(folder) / target.name
        if ending == ".toml":
            write_robot(robot, trial)
            if placed is None:
                home = home_posture(robot).coordinates
                placed = mechanism_of_robot(robot, home)
            difference = largest_difference(replace(placed, robot=read_robot(trial)))
            texts: dict[Path, str] = {}
        else:
            conversion, built = _built_in(conversion)
            texts = _texts(built.mechanism, target)
            for path, text in texts.items():
                write_text(text, trial.with_suffix(path.suffix))
            back = _read_back(trial)
            difference = largest_difference(replace(built, mechanism=back))
            comparison = compare(built.mechanism, trial)
            comparisons = (*conversion.comparisons, comparison)
            conversion = replace(conversion, comparisons=comparisons)
            if not comparison.agrees:
                raise BadInput(f"{comparison.text()}; nothing is written")
    if not difference <= FAITHFUL:
        raise BadInput(
            f"{target}: what was written is another robot: bodies are off by "
            f"{difference:.2g}, expected at most {FAITHFUL:g}; nothing is written"
        )
    if not texts:
        write_robot(robot, target)
    for path, text in texts.items():
        write_text(text, path)
    files = tuple(texts) or (target,)
    return replace(conversion, files=files, difference=difference)


def _built_in(conversion: Conversion) -> tuple[Conversion, RobotAndMechanism]:
    """The rigid mechanism of a robot, its calibration built in, its loops closed."""
    posture = home_posture(conversion.robot)
    robot = with_calibration(posture)
    home = posture.coordinates
    placed = mechanism_of_robot(robot, home)
    mechanism = placed.mechanism
    left_out = [*conversion.left_out, *not_rigid(conversion.robot)]
    after, held = loop_residual(mechanism, home), conversion.drives_held
    if after >= CLOSED:  # errors pull the loops apart
        home, after, held = nearest_closed(mechanism, 0)
        pairs = zip(mechanism.joints, home, strict=True)
        joints = tuple(replace(j, position=float(q)) for j, q in pairs)
        placed = replace(placed, mechanism=replace(mechanism, joints=joints))
    if after >= 1e-6:
        left_out.append(
            f"loops stay open by {after:.2g} rad or m with the calibrated geometry: "
            "rigid bodies cannot close them, forced assembly does"
        )
    positions = dict(zip((f.name for f in robot.frames), home, strict=True))
    frames = (replace(f, position=float(positions[f.name])) for f in robot.frames)
    placed = replace(placed, robot=replace(robot, frames=tuple(frames)))
    conversion = replace(
        conversion, open_after=after, drives_held=held, left_out=tuple(left_out)
    )
    return conversion, placed


def _texts(mechanism: Mechanism, target: Path) -> dict[Path, str]:
    """Text of each file to be written."""
    if target.suffix.lower() == ".xml":
        return {target: mjcf_text(mechanism)}
    beside: LoopsFile = loops_of(mechanism)
    return {target: urdf_text(mechanism),
            target.with_suffix(".yaml"): loops_text(beside)}  # fmt: skip


def _read_back(path: Path) -> Mechanism:
    """The mechanism of files just written."""
    if path.suffix.lower() == ".xml":
        return read_mjcf(path)
    return read_urdf(path, read_loops(path.with_suffix(".yaml")))
