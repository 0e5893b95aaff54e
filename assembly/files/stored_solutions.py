"""Cache for the finite-element solutions of mesh links.

A solution is identified by a hash of all data on which it depends.  Invalid files are
ignored.
"""

import hashlib
import io
import json
import logging
import os
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import forcefit.assembly.files
import forcefit.inputs
import forcefit.stiffness
from forcefit.assembly.model.link_kinds import MeshLink, MeshSolution
from forcefit.inputs.cache_folder import cache_folder
from forcefit.inputs.locking import locked_file
from forcefit.inputs.program import sources_hash
from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import whole_file

_CACHE = logging.getLogger("forcefit.cache")
# packages whose version can change a solution
_LIBRARIES = ("numpy", "scipy", "pytetwild", "pypardiso", "mkl", "pyvista", "vtk",
              "gmsh", "meshio")  # fmt: skip
_UNUSED = 90 * 86_400  # [s] time after which an unused solution is deleted


def solution_key(link: MeshLink, digest: str, options: object) -> str:
    """Return the cache key for the solution of a link.

    Args:
        link: link to be solved.  The solution does not depend on the path of its
            surface.  Because it is in mesh axes, it does not depend on the orientation
            of its mesh either.
        digest: SHA-256 hash of the surface file.
        options: :class:`forcefit.stiffness.fem.fea.FemOptions` of the solution.

    Returns:
        Hash of the link, the options and the program.
    """
    from forcefit.stiffness.surface.surface_files import named_solid

    file, solid = named_solid(link.surface)
    # the suffix of the file determines its reader
    name = Path(f"{file.suffix.lower()}#{solid}")
    content = replace(link, surface=name, up=None, frame_up=None, axis=None)
    text = "\n".join([digest, repr(content), repr(options), _program()])
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def _program() -> str:
    """Return the SHA-256 hash of the code that reads surfaces and solves links."""
    return sources_hash(
        (forcefit.inputs, forcefit.stiffness, forcefit.assembly.files), _LIBRARIES
    )


def stored_solution(key: str, solve: Callable[[], MeshSolution]) -> MeshSolution:
    """Return a cached solution, or compute and store it.

    Args:
        key: result of :func:`solution_key`.
        solve: function that computes the solution if it is not cached.  Other processes
            wait until it returns.

    Returns:
        Solution. Stored and computed solutions are bit-identical.
    """
    folder = cache_folder()
    if folder is None:
        return solve()
    path = folder / f"link-{key[:32]}.npz"
    found = _read(path, key)
    if found is not None:
        _CACHE.info("finite elements of a link: stored in %s", path)
    else:
        with _one_process(path.with_suffix(".solving")):
            # another process may have stored the solution in the meantime
            found = _read(path, key)
            if found is None:
                found = solve()
                _write(path, key, found)
    return found


@contextmanager
def _one_process(mark: Path) -> Generator[None, None, None]:
    """Lock a file, if possible, so that only one process computes a solution."""
    with ExitStack() as stack:
        with suppress(OSError):
            stack.enter_context(locked_file(mark))
        try:
            yield
        finally:
            with suppress(OSError):
                mark.unlink()


def _read(path: Path, key: str) -> MeshSolution | None:
    """Read a cached solution, or return None if it is absent or invalid."""
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as stored:
            content = json.loads(str(stored["content"]))
            if content["key"] != key:
                return None
            solution = _decoded(content["solution"], stored)
    except Exception:  # NumPy, zipfile and json raise exceptions of various types
        return None
    if not isinstance(solution, MeshSolution):
        return None
    with suppress(OSError):
        os.utime(path)
    return solution


def _write(path: Path, key: str, solution: MeshSolution) -> None:
    """Write a solution; errors such as a full disk are ignored."""
    arrays: list[NDArray] = []
    content = json.dumps({"key": key, "solution": _encoded(solution, arrays)})
    named: dict[str, Any] = {str(k): array for k, array in enumerate(arrays)}
    try:
        with whole_file(path) as part, part.open("wb") as file:
            np.savez(file, content=np.array(content), **named)
        _remove_unused(path.parent)
    except (OSError, BadInput):
        return


def _remove_unused(folder: Path) -> None:
    """Delete solutions that have not been used for 90 days."""
    for path in folder.glob("link-*.npz"):
        if time.time() - path.stat().st_mtime > _UNUSED:
            path.unlink()


def _encoded(value: Any, arrays: list[NDArray]) -> Any:
    """Encode a value for JSON, with arrays replaced by indices into ``arrays``."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": str(len(arrays) - 1)}
    if is_dataclass(value):
        given = {
            f.name: _encoded(getattr(value, f.name), arrays)
            for f in fields(value)
            if f.init
        }
        return {"kind": type(value).__name__, "given": given}
    if isinstance(value, Mapping):
        return {"table": {k: _encoded(v, arrays) for k, v in value.items()}}
    if isinstance(value, tuple):
        return {"tuple": [_encoded(v, arrays) for v in value]}
    if isinstance(value, list):
        return [_encoded(v, arrays) for v in value]
    return value.item() if isinstance(value, np.generic) else value


def _decoded(value: Any, arrays: Mapping[str, NDArray]) -> Any:
    """Decode a value that was encoded by :func:`_encoded`."""
    if isinstance(value, list):
        return [_decoded(v, arrays) for v in value]
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return arrays[value["array"]]
    if "tuple" in value:
        return tuple(_decoded(value["tuple"], arrays))
    if "table" in value:
        return {k: _decoded(v, arrays) for k, v in value["table"].items()}
    given = {k: _decoded(v, arrays) for k, v in value["given"].items()}
    return _kinds()[value["kind"]](**given)


@cache
def _kinds() -> dict[str, Any]:
    """Return the classes that occur in a solution, by name."""
    from forcefit.stiffness.fem.adaptive_step import Level
    from forcefit.stiffness.fem.condensation import Condensed
    from forcefit.stiffness.fem.elements import Elements
    from forcefit.stiffness.fem.fea import MeshedLink
    from forcefit.stiffness.link import LinkStiffness
    from forcefit.stiffness.mesh.solid import Solid
    from forcefit.stiffness.surface.facets import Facets
    from forcefit.stiffness.surface.primitives import Cone, Plane, Sphere, Torus

    kinds = (MeshSolution, MeshedLink, LinkStiffness, Level, Solid, Elements, Condensed,
             Plane, Cone, Sphere, Torus, Facets)  # fmt: skip
    return {kind.__name__: kind for kind in kinds}
