"""Stored finite-element solution of a mesh link, in its frame's axes.

:func:`forcefit.assembly.files.solved_links.solve_links` solves the finite elements when
a robot is loaded.
"""

from dataclasses import replace
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.frame import between_origins
from forcefit.assembly.model.link_kinds import MeshSolution
from forcefit.assembly.model.robot import Frame, LibraryLink, MeshLink
from forcefit.inputs.table import BadInput, quoted
from forcefit.stiffness.link import LinkStiffness, turn_link
from forcefit.stiffness.screws import rotation_matrix


def mesh_solution(frame: Frame) -> MeshSolution:
    """Return the finite-element solution of a frame's mesh link.

    Args:
        frame: frame whose link is a :class:`forcefit.assembly.model.robot.MeshLink`.

    Returns:
        The solution.  Its stiffness must be multiplied by :func:`modulus_factor` to
        obtain the stiffness for the link's own modulus.

    Raises:
        BadInput: the link was not solved when the robot was loaded.
    """
    solution = _mesh(frame).solution
    if solution is None:
        refuse_unsolved(frame)
    return solution


def refuse_unsolved(frame: Frame) -> NoReturn:
    """Raise BadInput for a link that was not solved when the robot was loaded."""
    kind = "library" if isinstance(frame.link, LibraryLink) else "mesh"
    raise BadInput(
        f"frame {quoted(frame.name)}.link.{kind}: found no stiffness; expected a robot "
        "returned by load_robot or forcefit.assembly.files.solved_links.solve_links"
    )


def modulus_factor(frame: Frame) -> float:
    """Return the ratio of a mesh link's modulus to that of its solution."""
    return _mesh(frame).young / mesh_solution(frame).young


def mesh_link_stiffness(frame: Frame) -> LinkStiffness:
    """Return the stiffness of a frame's mesh link by finite elements, in frame axes.

    Args:
        frame: frame whose link is a :class:`forcefit.assembly.model.robot.MeshLink`.

    Returns:
        Stiffness at the centre of the tip interface, which is the frame's origin.

    Raises:
        BadInput: the link was not solved when the robot was loaded.
    """
    link, factor = mesh_solution(frame).solved.link, modulus_factor(frame)
    if factor != 1.0:
        link = replace(
            link, compliance=link.compliance / factor,
            stiffness_error=link.stiffness_error * factor,
        )  # fmt: skip
    return turn_link(link, mesh_turn(frame, link.tip - link.base))


def mesh_link_mass(frame: Frame) -> tuple[NDArray, NDArray]:
    """Return the consistent mass of a frame's mesh link, by finite elements.

    Args:
        frame: frame whose link is a :class:`forcefit.assembly.model.robot.MeshLink`
            with a density.

    Returns:
        (12, 12) [kg m^2 .. kg] for screws of base and tip, each at its end, in the
        frame's axes; and the (3,) [m] vector from base to tip, in the frame's axes.

    Raises:
        BadInput: the link was not solved when the robot was loaded.
    """
    solution = mesh_solution(frame)
    span = solution.solved.centers[1] - solution.solved.centers[0]
    turn = mesh_turn(frame, span)
    R = np.kron(np.eye(4), turn)
    return R @ solution.mass @ R.T, turn @ span


def mesh_turn(frame: Frame, mesh_span: NDArray) -> NDArray:
    """Return the rotation from the axes of a frame's mesh to the frame's axes.

    Args:
        frame: frame whose link is a :class:`forcefit.assembly.model.robot.MeshLink`.
        mesh_span: (3,) [m] vector from base to tip in the mesh's axes.

    Returns:
        (3, 3) rotation that aligns the span with the link's ``axis``; without
        ``axis``, with the line from the parent's origin to the frame's.
    """
    link = _mesh(frame)
    span = between_origins(frame) if link.axis is None else np.array(link.axis)
    return mesh_rotation(mesh_span, span, link.up, link.frame_up)


def mesh_rotation(
    mesh_span: NDArray,
    span: NDArray,
    up: tuple[float, float, float] | None = None,
    frame_up: tuple[float, float, float] | None = None,
) -> NDArray:
    """Return the rotation from mesh to frame axes that aligns one span with the other.

    Args:
        mesh_span: (3,) [m] vector from base to tip in the mesh's axes.
        span: (3,) direction of the span in the frame's axes.
        up: direction in the mesh's axes that fixes the rotation about the span.
        frame_up: direction of ``up`` in the frame's axes.

    Returns:
        (3, 3) rotation; the smallest possible rotation if ``up`` is not given.
    """
    a, b = mesh_span / np.linalg.norm(mesh_span), span / np.linalg.norm(span)
    if up is not None and frame_up is not None:
        return _triad(b, np.array(frame_up)) @ _triad(a, np.array(up)).T
    axis = np.cross(a, b)
    sine, cosine = float(np.linalg.norm(axis)), float(a @ b)
    if sine < 1e-15:
        if cosine > 0:
            return np.eye(3)
        # the spans are opposite: rotate by pi about the perpendicular nearest to an
        # axis
        axis = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        return rotation_matrix(np.pi * axis / np.linalg.norm(axis))
    return rotation_matrix(np.arctan2(sine, cosine) * axis / sine)


def _triad(along: NDArray, up: NDArray) -> NDArray:
    """Return right-handed axes: the first along a span, the third near ``up``."""
    side = np.cross(up, along)
    side = side / np.linalg.norm(side)
    return np.column_stack([along, side, np.cross(along, side)])


def _mesh(frame: Frame) -> MeshLink:
    """Return the mesh link of a frame; raise ValueError if it has none."""
    if not isinstance(frame.link, MeshLink):
        raise ValueError(f"frame '{frame.name}' has no mesh link")
    return frame.link
