"""A mesh link's finite elements, solved once, rotated to its frame's axes."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.model.frame import between_origins
from assembly.model.robot import Frame, MeshLink
from forcefit.inputs.table import BadInput, quoted
from stiffness.beam.beam import section_axes
from stiffness.link import LinkStiffness, turn_link
from stiffness.screws import rotation_matrix

if TYPE_CHECKING:
    from stiffness.fem.fea import MeshedLink
    from stiffness.surface.interface import Interface
    from stiffness.surface.surface import Surface


def mesh_link_stiffness(frame: Frame, accuracy: float = 0.005) -> LinkStiffness:
    """Stiffness of a frame's mesh link by finite elements, in the frame's axes.

    Args:
        frame: one with a :class:`assembly.model.robot.MeshLink`.
        accuracy: asked of every entry, relative to sqrt(K_ii K_jj).

    Returns:
        The link, read at the tip interface's centre, which is the frame's origin.

    Raises:
        BadInput: the surface or an interface is not usable, ``up`` lies along the
            link, or the distance of the interfaces is not that of the two origins.
        ValueError: the frame has no mesh link.
    """
    link = frame.link
    if not isinstance(link, MeshLink):
        raise ValueError(f"frame '{frame.name}' has no mesh link")
    place = f'frame "{frame.name}".link.mesh'
    # what can be refused is refused before the finite elements
    span = _span(link, place)
    turn = mesh_turn(frame, span)
    if link.axis is None:
        _check_tip(place, turn @ span, between_origins(frame))
    return turn_link(solved_mesh(link, place, accuracy).link, turn)


def mesh_compliance(frame: Frame) -> NDArray:
    """(6, 6) compliance of a frame's mesh link; see :func:`mesh_link_stiffness`."""
    return mesh_link_stiffness(frame).compliance


# by this process
_SOLVED: "dict[tuple[object, ...], MeshedLink]" = {}
_SPANS: dict[tuple[object, ...], NDArray] = {}


def solved_mesh(
    link: MeshLink, place: str = "mesh", accuracy: float = 0.005
) -> "MeshedLink":
    """The finite elements of a mesh link, in the mesh's axes.

    Stiffness, mass, stress and the solid itself are all read from the same solution;
    links of one shape and material are solved once.

    Args:
        link: whose surface is meshed.
        place: of the link, for messages.
        accuracy: asked of every entry of K_E, relative to sqrt(K_ii K_jj).

    Returns:
        The link on its finest mesh.

    Raises:
        BadInput: the surface or an interface is not usable.
    """
    from stiffness.fem.fea import FemOptions, solve_link
    from stiffness.fem.material import Material
    from stiffness.fem.part_text import parse_part

    density = link.density or 0.0
    key = (*_shape_key(link, place), link.young, link.poisson, density, link.interface,
           link.parts, accuracy)  # fmt: skip
    if key not in _SOLVED:
        parts = [parse_part(f"{place}.parts", text) for text in link.parts]
        _SOLVED[key] = solve_link(
            *_shape(link, place),
            (Material(link.young, link.poisson, density), *parts),
            options=FemOptions(accuracy, link.interface),
        )
    return _SOLVED[key]


def _span(link: MeshLink, place: str) -> NDArray:
    """(3,) [m] from the base interface's centre to the tip's, in the mesh's axes."""
    from stiffness.fem.fea import interface_center

    key = _shape_key(link, place)
    if key not in _SPANS:
        surface, base, tip = _shape(link, place)
        _SPANS[key] = interface_center(surface, tip, "tip") - interface_center(
            surface, base, "base"
        )
    return _SPANS[key]


def _shape(link: MeshLink, place: str) -> "tuple[Surface, Interface, Interface]":
    """Surface, base and tip, as they are read from its file and its entries."""
    from stiffness.surface.interface import parse_interface
    from stiffness.surface.surface import read_surface

    return (
        read_surface(link.surface, link.unit),
        parse_interface(link.base, f"{place}.base"),
        parse_interface(link.tip, f"{place}.tip"),
    )


def _shape_key(link: MeshLink, place: str) -> tuple[object, ...]:
    """What a link's shape depends on: its entries, and which state of its file."""
    from stiffness.surface.surface_files import named_solid

    try:
        stamp = named_solid(link.surface)[0].stat().st_mtime_ns
    except OSError as error:
        raise BadInput(
            f"{place}: surface {link.surface} cannot be read: {error.strerror}"
        ) from None
    return link.surface, stamp, link.unit, repr(link.base), repr(link.tip)


def mesh_link_mass(frame: Frame) -> tuple[NDArray, NDArray]:
    """Consistent mass of a frame's mesh link, by the finite elements of its K_E.

    Args:
        frame: one with a :class:`assembly.model.robot.MeshLink` that has a density.

    Returns:
        (12, 12) [kg m^2 .. kg] for screws of base and tip, each read at its end, in the
        frame's axes; and (3,) [m] from base to tip, in the frame's axes.

    Raises:
        BadInput: the surface or an interface is not usable.
        ValueError: the frame has no mesh link.
    """
    from stiffness.fem.two_ends import two_ends

    link = frame.link
    if not isinstance(link, MeshLink):
        raise ValueError(f"frame '{frame.name}' has no mesh link")
    solved = solved_mesh(link, f'frame "{frame.name}".link.mesh')
    span = solved.centers[1] - solved.centers[0]
    turn = mesh_turn(frame, span)
    R = np.kron(np.eye(4), turn)
    return R @ two_ends(solved).mass @ R.T, turn @ span


def mesh_turn(frame: Frame, mesh_span: NDArray) -> NDArray:
    """Rotation from a frame's mesh's axes to the frame's.

    Args:
        frame: one with a :class:`assembly.model.robot.MeshLink`.
        mesh_span: (3,) [m] from base to tip in the mesh's axes.

    Returns:
        (3, 3) it lays the span along the link's ``axis``, or along the line from the
        parent's origin to the frame's if it has none.

    Raises:
        BadInput: the mesh's ``up`` lies along the span.
        ValueError: the frame has no mesh link.
    """
    link = frame.link
    if not isinstance(link, MeshLink):
        raise ValueError(f"frame '{frame.name}' has no mesh link")
    if link.up is not None:
        try:
            section_axes(mesh_span, link.up)
        except BadInput as error:
            place = f"frame {quoted(frame.name)}.link.mesh.up"
            raise BadInput(f"{place}: {error}; expected another direction") from None
    span = between_origins(frame) if link.axis is None else np.array(link.axis)
    return mesh_rotation(mesh_span, span, link.up, link.frame_up)


def mesh_rotation(
    mesh_span: NDArray,
    span: NDArray,
    up: tuple[float, float, float] | None = None,
    frame_up: tuple[float, float, float] | None = None,
) -> NDArray:
    """Rotation from mesh axes to frame axes that lays one span along the other.

    Args:
        mesh_span: (3,) [m] base to tip in the mesh's axes.
        span: (3,) its direction in the frame's axes.
        up: a direction in the mesh's axes that fixes the roll, with ``frame_up``.
        frame_up: the same direction in the frame's axes.

    Returns:
        (3, 3) the rotation; the smallest one if no roll is given.
    """
    a, b = mesh_span / np.linalg.norm(mesh_span), span / np.linalg.norm(span)
    if up is not None and frame_up is not None:
        return _triad(b, np.array(frame_up)) @ _triad(a, np.array(up)).T
    axis = np.cross(a, b)
    sine, cosine = float(np.linalg.norm(axis)), float(a @ b)
    if sine < 1e-15:
        if cosine > 0:
            return np.eye(3)
        # half a turn: about any axis across, the one nearest to a coordinate axis
        axis = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        return rotation_matrix(np.pi * axis / np.linalg.norm(axis))
    return rotation_matrix(np.arctan2(sine, cosine) * axis / sine)


def _triad(along: NDArray, up: NDArray) -> NDArray:
    """Right-handed axes: first along, third as near to up as possible."""
    side = np.cross(up, along)
    side = side / np.linalg.norm(side)
    return np.column_stack([along, side, np.cross(along, side)])


def _check_tip(place: str, tip: NDArray, wanted: NDArray) -> None:
    """The interfaces must be as far apart as the origins they stand for."""
    length = float(np.linalg.norm(wanted))
    if np.linalg.norm(tip - wanted) > 1e-6 + 1e-3 * length:
        raise BadInput(
            f"{place}: the tip interface's centre lies at {_point(tip)} from the "
            f"base's, the frame's origin at {_point(wanted)} from its parent's; "
            "expected the same point within 1e-6 m + 0.1 % of the length"
        )


def _point(p: NDArray) -> str:
    """Coordinates for a message."""
    return "(" + ", ".join(f"{x:.6g}" for x in p) + ") m"
