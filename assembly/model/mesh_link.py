"""Stiffness and mass of mesh links in frame axes.

The finite elements are solved by
:func:`forcefit.assembly.files.solved_links.solve_links` when a robot is loaded.
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
        Solution.  Its stiffness times :func:`modulus_factor` is the stiffness of the
        link.

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
    """Return Young's modulus of a mesh link over the modulus used in its solution."""
    return _mesh(frame).young / mesh_solution(frame).young


def mesh_link_stiffness(frame: Frame) -> LinkStiffness:
    """Return the finite-element stiffness of a frame's mesh link, in the frame axes.

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
    """Return the consistent mass matrix of a frame's mesh link.

    Args:
        frame: frame whose link is a :class:`forcefit.assembly.model.robot.MeshLink`
            with a density.

    Returns:
        Mass matrix (12, 12) [kg m^2 .. kg] for the screws of base and tip, each at its
        own interface, and the vector from base to tip (3,) [m]; both in the frame axes.

    Raises:
        BadInput: the link was not solved when the robot was loaded.
    """
    solution = mesh_solution(frame)
    span = solution.solved.centers[1] - solution.solved.centers[0]
    turn = mesh_turn(frame, span)
    R = np.kron(np.eye(4), turn)
    return R @ solution.mass @ R.T, turn @ span


def mesh_turn(frame: Frame, mesh_span: NDArray) -> NDArray:
    """Return the rotation from the mesh axes to the frame axes.

    Args:
        frame: frame whose link is a :class:`forcefit.assembly.model.robot.MeshLink`.
        mesh_span: vector from base to tip in the mesh axes (3,) [m].

    Returns:
        Rotation matrix (3, 3) that aligns the span with ``axis`` of the link or, by
        default, with the line from the parent origin to the frame origin.
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
    """Return the rotation from mesh axes to frame axes that aligns two vectors.

    Args:
        mesh_span: vector from base to tip in the mesh axes (3,) [m].
        span: direction from base to tip in the frame axes (3,).
        up: direction in the mesh axes that fixes the rotation about the span.
        frame_up: direction that corresponds to ``up`` in the frame axes.

    Returns:
        Rotation matrix (3, 3).  Without ``up``, the rotation with the smallest angle.
    """
    a, b = mesh_span / np.linalg.norm(mesh_span), span / np.linalg.norm(span)
    if up is not None and frame_up is not None:
        return _triad(b, np.array(frame_up)) @ _triad(a, np.array(up)).T
    axis = np.cross(a, b)
    sine, cosine = float(np.linalg.norm(axis)), float(a @ b)
    if sine < 1e-15:
        if cosine > 0:
            return np.eye(3)
        # For opposite spans, rotate by pi about a perpendicular axis.
        axis = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        return rotation_matrix(np.pi * axis / np.linalg.norm(axis))
    return rotation_matrix(np.arctan2(sine, cosine) * axis / sine)


def _triad(along: NDArray, up: NDArray) -> NDArray:
    """Return right-handed axes, the first along a span, the third close to ``up``."""
    side = np.cross(up, along)
    side = side / np.linalg.norm(side)
    return np.column_stack([along, side, np.cross(along, side)])


def _mesh(frame: Frame) -> MeshLink:
    """Return the mesh link of a frame; raise ValueError if there is none."""
    if not isinstance(frame.link, MeshLink):
        raise ValueError(f"frame '{frame.name}' has no mesh link")
    return frame.link
