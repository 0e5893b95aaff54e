"""Peak stress in each link, computed from the wrench that the link transmits.

A link is clamped at its base and loaded at the tip by the wrench at its frame; a beam
with a density is also loaded by its own weight.  Beams are evaluated with the formulas
in :mod:`forcefit.stiffness.beam.beam_stress`.  For links given by a surface, the
stresses due to unit wrenches are computed by finite elements
(:mod:`forcefit.stiffness.fem.stress`).  The stress is singular at the edge of a clamped
interface, so points that are closer to the edge than the interface radius are omitted.
No stress is computed for a link that is given by its stiffness.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.model.mesh_link import mesh_solution, mesh_turn
from forcefit.assembly.model.robot import BeamLink, Frame, MeshLink, Robot, beam_axis
from forcefit.stiffness.beam.beam import section_axes
from forcefit.stiffness.beam.beam_stress import peak_beam_stress

WEIGHTLESS = np.zeros(6)  # wrench of a link without weight [N m, N]
_CHUNK = 64  # number of wrenches that are evaluated together, limited by memory


@dataclass(frozen=True, eq=False)
class LinkStress:
    """Peak stress in a link as a function of its wrench.

    Attributes:
        frame: name of the frame to which the link belongs.
        row: index of this frame.
        method: ``"beam"`` or ``"finite elements"``, with a remark on omitted points.
        peak: function that returns the peak stress (k,) [Pa] for wrenches of the link
            spring (k, 6) [N m, N].  The second argument (k, 6) or (6,) contains the
            wrenches due to the link's weight.
        relative_error: estimated relative error due to the mesh [-]; 0 for beams.
    """

    frame: str
    row: int
    method: str
    peak: Callable[..., NDArray]
    relative_error: float = 0.0


@lru_cache(maxsize=16)
def stressed_links(robot: Robot) -> tuple[LinkStress, ...]:
    """Return the links whose stress can be computed, in frame order.

    Args:
        robot: robot with the links.

    Returns:
        Beams with a known cross section, and links given by a surface.

    Raises:
        BadInput: a mesh was not solved when the robot was loaded.
    """
    return tuple(
        _of_mesh(robot.frame(name), robot.index(name))
        if isinstance(robot.frame(name).link, MeshLink)
        else LinkStress(name, robot.index(name), "beam", _of_beam(robot.frame(name)))
        for name in stressed_names(robot)
    )


def stressed_names(robot: Robot) -> tuple[str, ...]:
    """Return the names of the frames whose links have a computable stress."""
    return tuple(
        frame.name for frame in robot.frames
        if isinstance(frame.link, MeshLink)
        or (isinstance(frame.link, BeamLink) and "area" not in frame.link.section)
    )  # fmt: skip


def peak_stresses(
    robot: Robot, wrenches: ArrayLike, at_tips: ArrayLike = 0.0
) -> NDArray:
    """Return the peak von Mises stress in each link of :func:`stressed_links`.

    Args:
        robot: robot with n frames.
        wrenches: wrenches of the link springs (..., n, 6) [N m, N], at each frame in
            its axes; see
            :attr:`forcefit.assembly.linear.assembled.Assembly.wrenches`.
        at_tips: wrenches due to the weight of the links (..., n, 6) [N m, N]; see
            :attr:`forcefit.assembly.linear.load.FrameLoads.at_tips`.

    Returns:
        Peak stresses (..., links) [Pa], in the order of :func:`stressed_links`.

    Raises:
        BadInput: a mesh was not solved when the robot was loaded.
        ValueError: the shape of ``wrenches`` does not match the robot.
    """
    w = np.asarray(wrenches, dtype=float)
    if w.shape[-2:] != (len(robot.frames), 6):
        raise ValueError(
            f"wrenches have shape {w.shape}, expected (..., {len(robot.frames)}, 6)"
        )
    links = stressed_links(robot)
    flat = w.reshape(-1, *w.shape[-2:])
    own = np.broadcast_to(at_tips, w.shape).reshape(flat.shape)
    peaks = np.full((len(flat), len(links)), np.nan)
    solved = np.isfinite(flat).all(axis=(1, 2))
    for i, link in enumerate(links):
        peaks[solved, i] = link.peak(flat[solved, link.row], own[solved, link.row])
    return peaks.reshape(*w.shape[:-2], len(links))


def _of_beam(frame: Frame) -> Callable[..., NDArray]:
    """Return the peak stress in a beam as a function of its wrench."""
    assert isinstance(frame.link, BeamLink)
    length, axis = beam_axis(frame)
    section, R = frame.link.section, section_axes(axis, frame.link.up)

    def peak(wrench: NDArray, at_tip: NDArray = WEIGHTLESS) -> NDArray:
        tip = wrench - at_tip
        in_section_axes = np.hstack([tip[:, :3] @ R, tip[:, 3:] @ R])
        # The equivalent load at the tip contains half of the weight.
        weight = 2 * at_tip[..., 3:] @ R
        return peak_beam_stress(section, length, in_section_axes, weight)[0]

    return peak


def _of_mesh(frame: Frame, row: int) -> LinkStress:
    """Return the peak stress in a mesh link as a function of its wrench."""
    from forcefit.stiffness.fem.stress import stress_influence, von_mises

    solved = mesh_solution(frame).solved
    influence = stress_influence(solved)
    R = mesh_turn(frame, solved.link.tip - solved.link.base)

    def peak(wrench: NDArray, at_tip: NDArray = WEIGHTLESS) -> NDArray:
        wrench = wrench - at_tip
        in_mesh_axes = np.hstack([wrench[:, :3] @ R, wrench[:, 3:] @ R])
        peaks = np.zeros(len(in_mesh_axes))
        for first in range(0, len(in_mesh_axes), _CHUNK):
            chunk = in_mesh_axes[first : first + _CHUNK]
            stress = np.tensordot(chunk, influence.influence, axes=(1, 1))
            peaks[first : first + _CHUNK] = von_mises(stress).max(axis=1)
        return peaks

    method = f"finite elements: {influence.region}"
    return LinkStress(frame.name, row, method, peak, influence.relative_error())
