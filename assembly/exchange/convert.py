"""Conversion of robot files for ``forcefit convert``, verified by reading them back.

============  ==========================================================  ==========
kind          read                                                        written
============  ==========================================================  ==========
``.toml``     robot file                                                  yes
``.urdf``     URDF and its loops (``robot.yaml``, ``closed_loop``)        both files
``.xml``      MJCF with connect and weld                                  yes
``.sdf``      SDF of one model, whose joints may close loops              no
============  ==========================================================  ==========
"""

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from forcefit.assembly.drawing.drawing_of_robot import drawing_of_robot
from forcefit.assembly.exchange.as_robot import RobotAndMechanism, mechanism_of_robot
from forcefit.assembly.exchange.calibrated import not_rigid, with_calibration
from forcefit.assembly.exchange.comparison import compare
from forcefit.assembly.exchange.conversion import Conversion
from forcefit.assembly.exchange.fidelity import (
    FAITHFUL,
    drawn_difference,
    largest_difference,
)
from forcefit.assembly.exchange.foreign import READERS, robot_of_file
from forcefit.assembly.exchange.home_pose import CLOSED, loop_residual, nearest_closed
from forcefit.assembly.exchange.loops_file import LoopsFile, loops_text, read_loops
from forcefit.assembly.exchange.mechanism import Mechanism
from forcefit.assembly.exchange.mjcf import read_mjcf
from forcefit.assembly.exchange.mjcf_writing import mjcf_text
from forcefit.assembly.exchange.overlay import lay_over
from forcefit.assembly.exchange.urdf import read_urdf
from forcefit.assembly.exchange.urdf_writing import XML_MARK, loops_of, urdf_text
from forcefit.assembly.files.drawing_writing import drawing_text
from forcefit.assembly.files.robot_file import (
    Closing,
    read_robot,
    robot_of,
    robot_table,
    write_robot,
)
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.robots import load_robot
from forcefit.inputs.errors import BadInput, quoted
from forcefit.inputs.table import Table
from forcefit.inputs.writing import ROBOT, Kind, check_writable, write_text

_BEGINS = (XML_MARK.lower().encode(),)
_KINDS = {
    ".toml": ROBOT,
    ".urdf": Kind("a URDF written by forcefit", (".urdf",), _BEGINS),
    ".xml": Kind("an MJCF file written by forcefit", (".xml",), _BEGINS),
}
_LOOPS = Kind(
    "a loops file written by forcefit", (".yaml",), (b"# written by forcefit",)
)


def convert(
    source: Path | str,
    target: Path | str,
    loops: Path | str | None = None,
    overlay: Path | str | None = None,
    points: Sequence[str] | None = None,
    close: Closing | None = None,
    version: int = 1,
) -> Conversion:
    """Convert a robot between robot files and the formats of other programs.

    Args:
        source: ``.urdf``, ``.xml`` (MJCF), ``.sdf`` or ``.toml`` file, or the name of a
            built-in robot.
        target: ``.toml``, ``.urdf`` or ``.xml`` file.
        loops: YAML file with ``closed_loop``; by default, a file in the same folder as
            the source.
        overlay: TOML file with elasticity, clearances and errors, by frame name.
        points: names of loops that are closed only at a point, in addition to loops of
            type 3d.  If the list is empty, the declared types are used.  By default,
            the declared types are used, unless all loops are declared as 6d and cannot
            be closed.  In this case, all loops are closed only at a point, and the
            result reports this.
        close: for a robot file or built-in robot, the result of
            :func:`forcefit.assembly.kinematics.closing.closing_of`, or None.
        version: version of the robot file format: 1 for frames and closures, 2 for
            bodies and joints.

    Returns:
        Output files, and their difference from the source.

    Raises:
        BadInput: a file is invalid, a loop cannot be closed, or the output differs from
            the source.  No file is written in these cases.
    """
    source, target = Path(source), Path(target)
    check_target(target)
    if version == 2 and target.suffix.lower() != ".toml":
        raise BadInput(
            f"--format 2: found together with the file {target}, expected a robot file "
            "(.toml)"
        )
    if source.suffix.lower() in READERS:
        if close is not None:
            raise BadInput(
                f"{source}: found together with --rest or --mismatch, expected "
                "a robot file (.toml); remove the option, because the "
                "conversion computes a home pose that closes"
            )
        conversion, placed = robot_of_file(source, loops, overlay, points)
        return _written(conversion, placed, target, version)
    for option, given in (("--points", points), ("--loops", loops)):
        if given:
            raise BadInput(
                f"{option}: found together with the robot file {source}, which "
                "contains its own loops or drives; remove the option"
            )
    robot = load_robot(source, close)
    if overlay is not None:
        content = robot_table(robot, Path(overlay).parent)
        robot = robot_of(lay_over(content, overlay), robot.name)
    return write_converted(robot, target, version)


def check_target(target: Path) -> None:
    """Check that the output file can be written.

    Args:
        target: path of the file.  For a URDF, a YAML file is written as well.

    Raises:
        BadInput: the file extension is not supported, a file cannot be written, or a
            file from another program exists at this path.
    """
    ending = target.suffix.lower()
    if ending not in _KINDS:
        given = f"the ending {quoted(target.suffix)}" if target.suffix else "no ending"
        raise BadInput(f"{target}: found {given}, expected {' or '.join(_KINDS)}")
    check_writable(target, _KINDS[ending])
    if ending == ".urdf":
        check_writable(target.with_suffix(".yaml"), _LOOPS)


def write_converted(robot: Robot, target: Path, version: int = 1) -> Conversion:
    """Write a robot to a robot file, URDF or MJCF file, and read it back.

    Args:
        robot: robot to write.
        target: ``.toml``, ``.urdf`` or ``.xml`` file.
        version: version of the robot file format; see :func:`convert`.

    Returns:
        Output files, and their difference from the robot.

    Raises:
        BadInput: the file cannot be written, or the robot that is read back differs.
    """
    mismatch = home_posture(robot).mismatch
    conversion = Conversion(
        robot=robot,
        files=(),
        open_before=mismatch,
        open_after=mismatch,
        drives_held=True,
        difference=0.0,
        left_out=(),
    )
    return _written(conversion, None, target, version)


def _written(
    conversion: Conversion, placed: RobotAndMechanism | None, target: Path,
    version: int = 1,
) -> Conversion:  # fmt: skip
    """Check the conversion in a temporary folder, then write the target files."""
    ending, robot = target.suffix.lower(), conversion.robot
    texts: dict[Path, str] = {}
    with TemporaryDirectory() as folder:
        trial = Path(folder) / target.name
        if version == 2:
            drawn = drawing_of_robot(robot)
            text = drawing_text(robot, drawn.drawing, target.parent)
            texts = {target: text}
            root = Table(tomllib.loads(text), str(target), "")
            difference = drawn_difference(robot, robot_of(root, ""), drawn.frames)
            lost = (*conversion.left_out, *drawn.left_out)
            conversion = replace(conversion, left_out=lost)
        elif ending == ".toml":
            write_robot(robot, trial)
            if placed is None:
                home = home_posture(robot).coordinates
                placed = mechanism_of_robot(robot, home)
            difference = largest_difference(replace(placed, robot=read_robot(trial)))
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
            f"{target}: the output would describe a different robot: body poses "
            f"differ by {difference:.2g} rad or m, expected at most "
            f"{FAITHFUL:g}; nothing is written"
        )
    if not texts:
        write_robot(robot, target)
    for path, text in texts.items():
        write_text(text, path)
    files = tuple(texts) or (target,)
    return replace(conversion, files=files, difference=difference)


def _built_in(conversion: Conversion) -> tuple[Conversion, RobotAndMechanism]:
    """Return the mechanism with the calibrated geometry and closed loops."""
    threads = [quoted(f.name) for f in conversion.robot.frames if f.pitch]
    if threads:
        raise BadInput(
            f"{conversion.robot.name}: found helical joints ({', '.join(threads)}), "
            "which only robot files (.toml) can represent; nothing is written"
        )
    posture = home_posture(conversion.robot)
    robot = with_calibration(posture)
    home = posture.coordinates
    placed = mechanism_of_robot(robot, home)
    mechanism = placed.mechanism
    left_out = [*conversion.left_out, *not_rigid(conversion.robot)]
    after, held = loop_residual(mechanism, home), conversion.drives_held
    if after >= CLOSED:  # loops do not close with the calibrated geometry
        home, after, held = nearest_closed(mechanism, 0)
        pairs = zip(mechanism.joints, home, strict=True)
        joints = tuple(replace(j, position=float(q)) for j, q in pairs)
        placed = replace(placed, mechanism=replace(mechanism, joints=joints))
    if after >= 1e-6:
        left_out.append(
            f"with the calibrated geometry, the loops remain open by {after:.2g} rad "
            "or m, because rigid bodies cannot close them; use forced assembly"
        )
    positions = dict(zip((f.name for f in robot.frames), home, strict=True))
    frames = (replace(f, position=float(positions[f.name])) for f in robot.frames)
    placed = replace(placed, robot=replace(robot, frames=tuple(frames)))
    conversion = replace(
        conversion, open_after=after, drives_held=held, left_out=tuple(left_out)
    )
    return conversion, placed


def _texts(mechanism: Mechanism, target: Path) -> dict[Path, str]:
    """Return the text of each output file."""
    if target.suffix.lower() == ".xml":
        return {target: mjcf_text(mechanism)}
    beside: LoopsFile = loops_of(mechanism)
    return {target: urdf_text(mechanism),
            target.with_suffix(".yaml"): loops_text(beside)}  # fmt: skip


def _read_back(path: Path) -> Mechanism:
    """Read the mechanism from the output files."""
    if path.suffix.lower() == ".xml":
        return read_mjcf(path)
    return read_urdf(path, read_loops(path.with_suffix(".yaml")))
