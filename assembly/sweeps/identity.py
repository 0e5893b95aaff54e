"""Digests of the program, the robot and the computed quantities, to identify results.

Each digest is a SHA-256, which journals and the workers of a cluster compare.
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

# libraries that affect the results, because another version may round differently
_LIBRARIES = ("numpy", "scipy", "clarabel")


@cache
def program_hash() -> str:
    """Return the SHA-256 of the program's sources and the versions of its libraries."""
    packages = forcefit.inputs, forcefit.stiffness, forcefit.assembly
    own = sources_hash(packages, _LIBRARIES)
    return hashlib.sha256((own + kernels.sources).encode()).hexdigest()


def robot_hash(robot: Robot) -> str:
    """Return the SHA-256 of a robot file and of everything it refers to.

    A robot file may refer to meshes, stiffness libraries, and effects from other
    packages, whose version enters the hash.

    Args:
        robot: the robot.

    Returns:
        The digest.

    Raises:
        BadInput: a mesh or a stiffness library was not read when the robot was loaded.
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
        digest.update(LIBRARY.version(name).encode())  # empty for forcefit's effects
    return digest.hexdigest()


def question_hash(question: Any) -> str:
    """Return the SHA-256 of an object's attribute names and values.

    Args:
        question: plain values, arrays, robots, designs, or dataclasses composed of
            these.

    Returns:
        The digest.
    """
    return hashlib.sha256(json.dumps(_as_json(question)).encode()).hexdigest()


def _as_json(value: Any) -> Any:
    """Return a value as JSON-serializable data, different for different values."""
    if isinstance(value, Robot):
        return ["robot", robot_hash(value)]
    if isinstance(value, Design):  # the path of the design's file is irrelevant
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
