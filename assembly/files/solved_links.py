"""Stiffness of links that are described by a mesh or a library.

The stiffness is computed when a robot is loaded, so that solvers do not read files or
solve finite-element models.
"""

import hashlib
import logging
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.files.stored_solutions import solution_key, stored_solution
from forcefit.assembly.model.frame import between_origins
from forcefit.assembly.model.link_kinds import MeshSolution
from forcefit.assembly.model.mesh_link import mesh_turn
from forcefit.assembly.model.robot import Frame, LibraryLink, Link, MeshLink, Robot
from forcefit.inputs.table import BadInput, quoted
from forcefit.stiffness.beam.beam import section_axes

if TYPE_CHECKING:
    from forcefit.stiffness.fem.fea import FemOptions, MeshedLink

_LOG = logging.getLogger("forcefit.links")
_CACHE = logging.getLogger("forcefit.cache")
# solutions in this process, by the key of their shape and material
_SOLVED: dict[str, MeshSolution] = {}


def solve_links(robot: Robot) -> Robot:
    """Compute the stiffness of all links that are described by a mesh or a library.

    Args:
        robot: robot from a file or created in Python.

    Returns:
        Robot with the computed stiffness; the same object if it has no such links.

    Raises:
        BadInput: a file is unreadable or unusable, or an interface is invalid.
    """
    # libraries are read first to report their errors without a long computation
    frames = [
        frame
        for frame in sorted(robot.frames, key=lambda f: isinstance(f.link, MeshLink))
        if (isinstance(frame.link, MeshLink) and frame.link.solution is None)
        or (isinstance(frame.link, LibraryLink) and frame.link.compliance is None)
    ]
    links, total = {}, len(frames)
    try:
        for done, frame in enumerate(frames):
            _note(done, total)
            links[frame.name] = solved_link(frame)
    finally:
        _note(total, total)
    return robot.with_links(links) if links else robot


def _note(done: int, total: int) -> None:
    """Report the number of solved links to a progress display."""
    known = {"done": done, "total": total}
    _LOG.debug("%d of %d links", done, total, extra=known)


def solved_link(frame: Frame, accuracy: float = 0.005) -> Link:
    """Compute the stiffness of a mesh link, or read the stiffness of a library link.

    Args:
        frame: frame with a mesh or library link.
        accuracy: accepted finite-element error of each entry of K_E relative to
            sqrt(K_ii K_jj).

    Returns:
        Link with its stiffness.

    Raises:
        BadInput: a file is unreadable or unusable, an interface is invalid, ``up`` is
            parallel to the link, or the distance between the interfaces differs from
            the distance between the origins.
        ValueError: the frame has neither a mesh nor a library link.
    """
    link, place = frame.link, f"frame {quoted(frame.name)}.link"
    try:
        if isinstance(link, LibraryLink):
            place += ".library"
            return _from_library(link)
        if isinstance(link, MeshLink):
            place += ".mesh"
            return replace(link, solution=_solution(frame, link, accuracy))
    except BadInput as error:
        raise BadInput(f"{place}: {error}") from None
    raise ValueError(f"frame '{frame.name}' has neither a mesh nor a library link")


def _from_library(link: LibraryLink) -> LibraryLink:
    """Read the compliance of a link from a library."""
    from forcefit.stiffness.report.library import read_compliance

    C = read_compliance(link.library, link.key)
    C.setflags(write=False)
    return replace(link, compliance=C)


def _solution(frame: Frame, link: MeshLink, accuracy: float) -> MeshSolution:
    """Return the finite-element solution of a mesh link, if possible from a cache."""
    from forcefit.stiffness.fem.fea import FemOptions
    from forcefit.stiffness.surface.surface_files import named_solid

    digest = _digest(named_solid(link.surface)[0])
    options = FemOptions(accuracy, link.interface)
    key = solution_key(link, digest, options)
    if key in _SOLVED:
        _CACHE.info("link of %s: known in this process", link.surface)
    else:
        _SOLVED[key] = stored_solution(
            key, lambda: _solve(frame, link, digest, options)
        )
    base, tip = _SOLVED[key].solved.centers
    _check_place(frame, link, tip - base)
    return _SOLVED[key]


def _solve(
    frame: Frame, link: MeshLink, digest: str, options: "FemOptions"
) -> MeshSolution:
    """Mesh the surface of a link and solve the finite-element model."""
    from forcefit.stiffness.fem.fea import interface_center, solve_link
    from forcefit.stiffness.fem.material import Material
    from forcefit.stiffness.fem.part_text import parse_part
    from forcefit.stiffness.fem.two_ends import two_ends
    from forcefit.stiffness.surface.interface import parse_interface
    from forcefit.stiffness.surface.surface import read_surface

    surface = read_surface(link.surface, link.unit)
    ends = parse_interface(link.base, "base"), parse_interface(link.tip, "tip")
    base = interface_center(surface, ends[0], "base")
    tip = interface_center(surface, ends[1], "tip")
    # this check is faster than the finite-element solution
    _check_place(frame, link, tip - base)
    material = Material(link.young, link.poisson, link.density or 0.0)
    parts = [parse_part("parts", text) for text in link.parts]
    _LOG.info("finite elements of frame %s, %s", quoted(frame.name), link.surface)
    solved = _as_stored(solve_link(surface, *ends, (material, *parts), options=options))
    mass = np.zeros((12, 12)) if link.density is None else two_ends(solved).mass
    return MeshSolution(solved, link.young, digest, mass)


def _as_stored(solved: "MeshedLink") -> "MeshedLink":
    """Remove the surface from a solution, because only mesh refinement requires it."""
    solid = replace(solved.level.solid, walls={}, surface=None)
    return replace(solved, level=replace(solved.level, solid=solid))


def _digest(path: Path) -> str:
    """Return the SHA-256 hash of a file."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise BadInput(f"surface {path} cannot be read: {error.strerror}") from None


def _check_place(frame: Frame, link: MeshLink, mesh_span: NDArray) -> None:
    """Check that the vector between interfaces equals that between frame origins."""
    try:
        section_axes(mesh_span, link.up)
    except BadInput as error:
        raise BadInput(f'{error}; expected a different direction "up"') from None
    tip, wanted = mesh_turn(frame, mesh_span) @ mesh_span, between_origins(frame)
    most = 1e-6 + 1e-3 * float(np.linalg.norm(wanted))
    if link.axis is None and np.linalg.norm(tip - wanted) > most:
        raise BadInput(
            f"the centre of the mesh's tip interface is at {_point(tip)} relative to "
            f"the base interface, but the frame's origin is at {_point(wanted)} "
            "relative to the parent's origin; expected equal positions within 1e-6 m "
            "+ 0.1 % of the length"
        )


def _point(p: NDArray) -> str:
    """Return the text of a point for a message."""
    return "(" + ", ".join(f"{x:.6g}" for x in p) + ") m"
