"""Links as solids of cubic finite elements, free at both rigid ends.

A beam's solid is a prism of its section.  In units of its length and modulus it depends
on the section's proportions and Poisson's ratio alone, so links of one shape are meshed
once.  Ends are held rigidly, as a virtual joint does; how stiff the same solid is with
wrenches spread over its ends is known beside it.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly.model.mesh_link import mesh_turn
from assembly.model.robot import BeamLink, Frame, MeshLink, beam_axis
from stiffness.beam.beam import section_axes
from stiffness.fem.condensation import condense
from stiffness.fem.fea import Budget, FemOptions, MeshedLink, solve_link
from stiffness.fem.material import Material
from stiffness.fem.two_ends import two_ends
from stiffness.surface.interface import parse_interface
from stiffness.surface.surface import Surface, read_surface

_FACETS = 64  # of a circle; the mesh's nodes lie on the circle itself
_KEPT = 32  # shapes
# for a shape; walls of a hundredth of the length take more
_OPTIONS = FemOptions(
    accuracy=0.005,  # of every entry of K_E, over sqrt(K_ii K_jj)
    budget=Budget(seconds=40.0, unknowns=400_000),
)


@dataclass(frozen=True, eq=False)
class SolidLink:
    """A link as a solid, in its own mesh's axes.

    Attributes:
        ends: (12, 12) [N m/rad .. N/m] wrenches that hold unit screws of base and tip,
            each read at its end's centre.
        distributing: (6, 6) K_E at the tip with wrenches spread over both ends.
        span: (3,) [m] from base to tip.
        turn: (3, 3) from the mesh's axes to the frame's.
    """

    ends: NDArray
    distributing: NDArray
    span: NDArray
    turn: NDArray

    @property
    def condensed(self) -> NDArray:
        """(6, 6) K_E at the frame in its axes: the base held."""
        return self._in_frame(self.ends[6:, 6:])

    @property
    def spread(self) -> NDArray:
        """(6, 6) K_E at the frame in its axes, wrenches spread over both ends."""
        return self._in_frame(self.distributing)

    def _in_frame(self, K: NDArray) -> NDArray:
        R = np.kron(np.eye(2), self.turn)
        return R @ K @ R.T


def solid_link(frame: Frame) -> SolidLink | None:
    """A frame's link as a solid.

    Args:
        frame: any.

    Returns:
        The solid; None of a link without a shape: none, a matrix, a library's, or a
        beam given by the constants of its section.

    Raises:
        BadInput: a surface or an interface is not usable, or no mesh can be made.
    """
    link = frame.link
    if isinstance(link, MeshLink):
        ends, distributing, span = _of_mesh(link)
        return SolidLink(ends, distributing, span, mesh_turn(frame, span))
    if not isinstance(link, BeamLink) or "area" in link.section:
        return None
    length, axis = beam_axis(frame)
    shape = tuple((k, round(v / length, 6)) for k, v in sorted(link.section.items()))
    ends, distributing = _of_prism(shape, link.poisson)
    unit = np.repeat([length**1.5, length**0.5], 3)
    both = np.tile(unit, 2)
    x, y, z = section_axes(axis, link.up).T
    return SolidLink(
        link.young * ends * np.outer(both, both),
        link.young * distributing * np.outer(unit, unit),
        np.array([0.0, 0.0, length]), np.column_stack([y, z, x]),
    )  # fmt: skip


@lru_cache(maxsize=_KEPT)
def _of_prism(
    shape: tuple[tuple[str, float], ...], poisson: float
) -> tuple[NDArray, NDArray]:
    """Both stiffnesses of a prism of unit length and modulus along z."""
    surface = prism(dict(shape))
    sides = parse_interface("z=0"), parse_interface("z=1")
    solved = solve_link(surface, *sides, [Material(1.0, poisson)], options=_OPTIONS)
    return two_ends(solved).stiffness, _spread(solved)


_MESHED: dict[tuple, tuple[NDArray, NDArray, NDArray]] = {}  # by this process


def _of_mesh(link: MeshLink) -> tuple[NDArray, NDArray, NDArray]:
    """Both stiffnesses of a meshed link and its span, once for links of one shape."""
    key = (link.surface, link.surface.stat().st_mtime_ns, link.unit, repr(link.base),
           repr(link.tip), link.young, link.poisson)  # fmt: skip
    if key not in _MESHED:
        solved = solve_link(
            read_surface(link.surface, link.unit), parse_interface(link.base),
            parse_interface(link.tip), [Material(link.young, link.poisson)],
            options=_OPTIONS,
        )  # fmt: skip
        span = solved.centers[1] - solved.centers[0]
        _MESHED[key] = two_ends(solved).stiffness, _spread(solved), span
    return _MESHED[key]


def _spread(solved: MeshedLink) -> NDArray:
    """(6, 6) K_E of the same mesh with wrenches spread over both ends."""
    lam, mu = solved.level.material[:, :2].T
    kind = "distributing-both"
    return condense(solved.level.mesh, lam, mu, solved.centers, kind).stiffness


def prism(section: dict[str, float]) -> Surface:
    """A bar of unit length along z, its section's y and z along x and y.

    Args:
        section: ``radius``, with ``inner_radius`` a tube, or ``width`` and ``height``,
            per length.

    Returns:
        Its closed surface.
    """
    if "radius" in section:
        angle = 2 * np.pi * np.arange(_FACETS) / _FACETS
        circle = np.column_stack([np.cos(angle), np.sin(angle)])
        outer, inner = section["radius"] * circle, section.get("inner_radius", 0.0)
    else:
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
        outer, inner = corners * [section["width"], section["height"]], 0.0
    inside = inner / section["radius"] * outer if inner else np.zeros((1, 2))
    count, within = len(outer), len(inside)
    flat = np.vstack([outer, inside])
    points = np.vstack([np.column_stack([flat, np.full(len(flat), z)]) for z in (0, 1)])
    i, j = np.arange(count), np.roll(np.arange(count), -1)
    # on the hole's edge, or the axis of a full section
    a, b = (count + (k if inner else 0 * k) for k in (i, j))
    up = count + within
    triangles = [
        (i, j, j + up),
        (i, j + up, i + up),
        (i, a, j),
        (i + up, j + up, a + up),
    ]
    if inner:
        triangles += [(a, b, j), (j + up, b + up, a + up)]
        triangles += [(b, a, a + up), (b, a + up, b + up)]
    faces = np.vstack([np.column_stack(corners) for corners in triangles])
    return Surface(points, faces, "prism of a beam's section")
