"""What must be the same for numbers to be the same: program, robot and question.

Each is a SHA-256, compared by journals and by the workers of a cluster.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

import assembly
import forcefit.inputs
import stiffness
from assembly.files.robot_file import robot_table
from assembly.model.robot import LibraryLink, MeshLink, Robot
from assembly.sweeps.parameters import Design
from forcefit.inputs.table import BadInput

# what computes with our sources: another version may round otherwise
_LIBRARIES = ("numpy", "scipy", "numba", "clarabel")


@cache
def program_hash() -> str:
    """SHA-256 of the sources that numbers come from and of the libraries they use."""
    digest = hashlib.sha256()
    for package in (forcefit.inputs, stiffness, assembly):
        root = Path(str(package.__file__)).parent
        for path in sorted(root.rglob("*.py")):
            # line ends are the checkout's
            source = path.read_bytes().replace(b"\r\n", b"\n")
            name = path.relative_to(root.parent).as_posix()
            digest.update(f"{name} {len(source)}\n".encode() + source)
    said = [f"{name} {version(name)}" for name in ("forcefit", *_LIBRARIES)]
    digest.update("\n".join(said).encode())
    return digest.hexdigest()


def robot_hash(robot: Robot) -> str:
    """SHA-256 of all that a robot file says, and of the meshes it names.

    Args:
        robot: any.

    Returns:
        The digest.

    Raises:
        BadInput: a mesh or a library cannot be read.
    """
    from stiffness.report.library import read_compliance

    table = robot_table(robot)
    table.pop("description", None)
    digest = hashlib.sha256(json.dumps(table, default=str).encode())
    for frame in robot.frames:
        if isinstance(frame.link, MeshLink):
            digest.update(_content(Path(frame.link.surface)))
        if isinstance(frame.link, LibraryLink):
            digest.update(read_compliance(frame.link.library, frame.link.key).tobytes())
    return digest.hexdigest()


def _content(path: Path) -> bytes:
    """What stands in a file."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None


def question_hash(question: Any) -> str:
    """SHA-256 of all that is asked: every attribute of a question, by its name.

    Args:
        question: plain values, arrays, robots, designs and dataclasses of such.

    Returns:
        The digest; meshes and libraries are read where the robot says they are.
    """
    return hashlib.sha256(json.dumps(_said(question)).encode()).hexdigest()


def _said(value: Any) -> Any:
    """A value as JSON can say it, no two different ones alike."""
    if isinstance(value, Robot):
        return ["robot", robot_hash(value)]
    if isinstance(value, Design):  # wherever its file lies
        return ["design", _said(value.content)]
    if isinstance(value, np.ndarray):
        content = np.ascontiguousarray(value)
        digest = hashlib.sha256(content.tobytes()).hexdigest()
        return ["array", content.dtype.str, content.shape, digest]
    if is_dataclass(value):
        return [[f.name, _said(getattr(value, f.name))] for f in fields(value)]
    if isinstance(value, Mapping):
        return [[str(k), _said(v)] for k, v in value.items()]
    if isinstance(value, list | tuple):
        return [_said(v) for v in value]
    return repr(value)
