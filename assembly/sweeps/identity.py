"""Digests (SHA-256) that identify program, robot and inputs of a computation.

They are compared before a journal is resumed and by the workers of a cluster.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import chain
from typing import Any

import numpy as np

import forcefit.assembly
import forcefit.inputs
import forcefit.stiffness
from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.files.robot_file import robot_table
from forcefit.assembly.kernels.choice import kernels
from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.mesh_link import mesh_solution
from forcefit.assembly.model.robot import LibraryLink, MeshLink, Robot
from forcefit.assembly.sweeps.parameters import Design
from forcefit.inputs.program import sources_hash

# libraries whose version may affect the results
_LIBRARIES = ("numpy", "scipy", "clarabel")


@cache
def program_hash() -> str:
    """Return the digest of the program's sources and library versions."""
    packages = forcefit.inputs, forcefit.stiffness, forcefit.assembly
    own = sources_hash(packages, _LIBRARIES)
    return hashlib.sha256((own + kernels.sources).encode()).hexdigest()


def robot_hash(robot: Robot) -> str:
    """Return the digest of a robot, including meshes and stiffness libraries.

    If the robot has effects from other packages, the digest depends on their versions.

    Args:
        robot: the robot.

    Returns:
        The digest.

    Raises:
        BadInput: a mesh or a stiffness library has not been read.
    """
    table = robot_table(robot)
    table.pop("description", None)
    digest = hashlib.sha256(json.dumps(table, default=str).encode())
    for frame in robot.frames:
        if isinstance(frame.link, MeshLink):
            digest.update(mesh_solution(frame).digest.encode())
        if isinstance(frame.link, LibraryLink):
            digest.update(link_compliance(frame).tobytes())
    for name in (*robot.effects, *chain(*robot.session_effects.values())):
        digest.update(LIBRARY.version(name).encode())  # empty for effects of forcefit
    return digest.hexdigest()


def question_hash(question: Any) -> str:
    """Return the digest of an object's attributes.

    Args:
        question: a dataclass or dictionary of plain values, arrays, robots and designs.

    Returns:
        The digest.
    """
    return hashlib.sha256(json.dumps(_as_json(question)).encode()).hexdigest()


def _as_json(value: Any) -> Any:
    """Return a unique JSON-serializable representation of a value."""
    if isinstance(value, Robot):
        return ["robot", robot_hash(value)]
    if isinstance(value, Design):  # the path of the file is omitted
        return ["design", _as_json(value.content)]
    if isinstance(value, np.ndarray):
        content = np.ascontiguousarray(value)
        digest = hashlib.sha256(content.tobytes()).hexdigest()
        return ["array", content.dtype.str, content.shape, digest]
    if is_dataclass(value):
        return [[f.name, _as_json(getattr(value, f.name))] for f in fields(value)]
    if isinstance(value, Mapping):
        return [[str(k), _as_json(v)] for k, v in value.items()]
    if isinstance(value, list | tuple):
        return [_as_json(v) for v in value]
    return repr(value)
