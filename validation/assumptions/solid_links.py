"""Model links as solids of cubic finite elements with two movable rigid ends.

The solid of a beam is a straight bar with the cross-section of the beam.  The stiffness
of a bar of unit length and unit modulus depends only on the proportions of the
cross-section and on Poisson's ratio, so the equations are solved only once for links of
equal proportions. K_E is computed with rigid ends, as for virtual joints, and with
wrenches distributed over the ends.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.mesh_link import mesh_solution, mesh_turn, modulus_factor
from forcefit.assembly.model.robot import BeamLink, Frame, MeshLink, Robot, beam_axis
from forcefit.stiffness.beam.beam import section_axes
from forcefit.stiffness.fem.condensation import condense
from forcefit.stiffness.fem.fea import Budget, FemOptions, MeshedLink, solve_bar
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.fem.two_ends import two_ends
from forcefit.stiffness.link import scaled

_KEPT = 32  # largest number of cross-sections in the cache
_OPTIONS = FemOptions(
    # At this accuracy, the error of K_E is below 1e-3 of sqrt(K_ii K_jj).
    accuracy=5e-4,
    budget=Budget(seconds=40.0, unknowns=250_000),
)


@dataclass(frozen=True, eq=False)
class SolidLink:
    """Stiffness matrices of a link modelled as a solid, in the axes of its mesh.

    Attributes:
        ends: (12, 12) [N m/rad .. N/m] stiffness matrix of base and tip, at the centres
            of their interfaces.
        distributing: (6, 6) [N m/rad .. N/m] K_E at the tip for wrenches distributed
            over both ends.
        span: (3,) [m] vector from base to tip.
        turn: (3, 3) rotation matrix from mesh axes to frame axes.
        error: [-] estimated largest error of the entries of the mesh's K_E, divided by
            sqrt(K_ii K_jj).
    """

    ends: NDArray
    distributing: NDArray
    span: NDArray
    turn: NDArray
    error: float

    @property
    def condensed(self) -> NDArray:
        """Stiffness K_E for rigid ends, in frame axes, (6, 6)."""
        return self._in_frame(self.ends[6:, 6:])

    @property
    def spread(self) -> NDArray:
        """Stiffness K_E for wrenches distributed over the ends, frame axes, (6, 6)."""
        return self._in_frame(self.distributing)

    def _in_frame(self, K: NDArray) -> NDArray:
        R = np.kron(np.eye(2), self.turn)
        return R @ K @ R.T


def solid_link(frame: Frame) -> SolidLink | None:
    """Return a frame's link as a solid.

    Args:
        frame: frame of a robot.

    Returns:
        The solid.  None if the frame has no link or the shape of the link is unknown,
        as for a stiffness matrix, a library link, or a beam with section constants.

    Raises:
        BadInput: the link cannot be meshed, or K_E of its mesh was not computed when
            the robot was loaded.
    """
    link = frame.link
    if isinstance(link, MeshLink):
        solved, factor = mesh_solution(frame).solved, modulus_factor(frame)
        span = solved.centers[1] - solved.centers[0]
        ends, distributing = _stiffnesses(solved)
        return SolidLink(
            factor * ends, factor * distributing, span, mesh_turn(frame, span),
            _mesh_error(solved),
        )  # fmt: skip
    if not isinstance(link, BeamLink) or "area" in link.section:
        return None
    length, axis = beam_axis(frame)
    solved = _bar(
        tuple((k, round(v / length, 6)) for k, v in sorted(link.section.items())),
        link.poisson,
    )
    ends, distributing = _stiffnesses(solved)
    unit = np.repeat([length**1.5, length**0.5], 3)
    both = np.tile(unit, 2)
    x, y, z = section_axes(axis, link.up).T
    return SolidLink(
        link.young * ends * np.outer(both, both),
        link.young * distributing * np.outer(unit, unit),
        np.array([0.0, 0.0, length]), np.column_stack([y, z, x]),
        _mesh_error(solved),
    )  # fmt: skip


def solid_links(robot: Robot) -> Mapping[str, SolidLink]:
    """Return the solids of all links with a known shape.

    Args:
        robot: robot with computed K_E of its meshes.

    Returns:
        Mapping from frame to solid.

    Raises:
        BadInput: a link cannot be meshed, or K_E of its mesh was not computed when the
            robot was loaded.
    """
    solids = {frame.name: solid_link(frame) for frame in robot.frames}
    return {name: solid for name, solid in solids.items() if solid is not None}


def _mesh_error(solved: MeshedLink) -> float:
    """Return the estimated largest relative error of the K_E of the mesh."""
    # The K_E of the mesh is the upper end of the error interval, and ``link.stiffness``
    # is the middle of the interval.
    K = solved.link.stiffness
    above = np.abs(scaled(solved.level.solution.stiffness - K, K))
    return float((above + solved.link.relative_errors).max())


@lru_cache(maxsize=_KEPT)
def _bar(shape: tuple[tuple[str, float], ...], poisson: float) -> MeshedLink:
    """Return the finite-element solution of a bar with unit length and modulus."""
    return solve_bar(dict(shape), Material(1.0, poisson), _OPTIONS)


@lru_cache(maxsize=_KEPT)
def _stiffnesses(solved: MeshedLink) -> tuple[NDArray, NDArray]:
    """Return the stiffness of both ends, and K_E with distributed wrenches."""
    lam, mu = solved.level.material[:, :2].T
    kind = "distributing-both"
    spread = condense(solved.level.mesh, lam, mu, solved.centers, kind).stiffness
    return two_ends(solved).stiffness, spread
