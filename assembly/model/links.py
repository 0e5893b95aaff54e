"""The elasticity of every body and joint of a robot, as compliances."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.mesh_link import mesh_link_stiffness, refuse_unsolved
from forcefit.assembly.model.robot import (
    BeamLink,
    Frame,
    LibraryLink,
    MatrixLink,
    MeshLink,
    Robot,
    beam_axis,
)
from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.sections import declared_section


def link_compliances(robot: Robot) -> NDArray:
    """Return the compliance of every body, K_E^-1 of eq. (6).

    Args:
        robot: robot of n frames.

    Returns:
        (n, 6, 6) [rad/(N m) .. m/N] at each frame, in its axes; zero where rigid.

    Raises:
        BadInput: a mesh or a library was not read when the robot was loaded.
    """
    C = np.zeros((len(robot.frames), 6, 6))
    for i, frame in enumerate(robot.frames):
        if frame.link is not None:
            C[i] = link_compliance(frame)
    return C


@lru_cache(maxsize=4096)  # a robot that is changed in one frame keeps its others
def link_compliance(frame: Frame) -> NDArray:
    """Return the (6, 6) compliance of a frame's body in its axes, a read-only array."""
    C = _compliance(frame)
    C.setflags(write=False)
    return C


def _compliance(frame: Frame) -> NDArray:
    link = frame.link
    if isinstance(link, MatrixLink):
        return np.linalg.inv(link.stiffness)
    if isinstance(link, BeamLink):
        length, axis = beam_axis(frame)
        section = declared_section(link.section, link.poisson)
        return beam_compliance(
            length, section, link.young, link.poisson,
            theory=link.theory, axis=axis, up=link.up,
        )  # fmt: skip
    if isinstance(link, MeshLink):
        return mesh_link_stiffness(frame).compliance
    assert isinstance(link, LibraryLink)
    if link.compliance is None:
        refuse_unsolved(frame)
    return link.compliance


def joint_compliances(robot: Robot) -> NDArray:
    """Return compliance of every joint, K_B^-1; zero where rigid, free or not given.

    Args:
        robot: robot of n frames.

    Returns:
        (n, 6, 6) [rad/(N m) .. m/N] at each frame, in its axes.
    """
    C = spring_compliances(robot)
    for i, frame in enumerate(robot.frames):
        if frame.pitch:
            S = motion_map(frame)
            C[i] = S @ C[i] @ S.T
    return C


def spring_compliances(robot: Robot) -> NDArray:
    """Return K_B^-1 of every joint in its components, see :func:`motion_map`.

    Args:
        robot: robot of n frames.

    Returns:
        (n, 6, 6) [rad/(N m) .. m/N], zero where rigid, free or not given.
    """
    C = np.zeros((len(robot.frames), 6, 6))
    for i, frame in enumerate(robot.frames):
        K = frame.springs
        if K is not None:
            soft = np.ix_(*[np.isfinite(np.diag(K))] * 2)
            C[i][soft] = np.linalg.inv(K[soft])
    return C


def compliance_factor(C: NDArray) -> NDArray:
    """Return a factor L of a compliance, C = L L^T: screw = L y stores energy y^2/2.

    Args:
        C: (6, 6) symmetric positive semidefinite, mixed units.

    Returns:
        (6, r) of full column rank r.
    """
    size = np.sqrt(np.diag(C))
    soft = np.flatnonzero(size > 0)
    # scaled to a unit diagonal first: rad and m differ by many orders of magnitude
    scaled = C[np.ix_(soft, soft)] / np.outer(size[soft], size[soft])
    L = np.zeros((6, len(soft)))
    L[soft] = size[soft, None] * np.linalg.cholesky(scaled)
    return L


def own_screw(frame: Frame) -> NDArray:
    """Return the (6,) unit screw of a joint's own motion."""
    return motion_map(frame)[:, frame.own_axis]


def own_screws(robot: Robot) -> NDArray:
    """Return the (n, 6) unit screws of all joints' own motions."""
    frames = robot.frames
    screws = np.zeros((len(frames), 6))
    screws[np.arange(len(frames)), [frame.own_axis for frame in frames]] = 1.0
    screws[:, 5] += [frame.lead for frame in frames]
    return screws


def motion_map(frame: Frame) -> NDArray:
    """Return the (6, 6) map of a joint's components to its screw in the frame's axes.

    The identity; of a helical joint, component RZ is the motion along the thread,
    [0 0 1 0 0 h], and component TZ is the translation in addition, TZ - h RZ.  K_B and
    clearances are in components, so they hold relative to the thread.

    Args:
        frame: frame of a robot.

    Returns:
        (6, 6) [-; m/rad in row TZ, column RZ].
    """
    S = np.eye(6)
    S[5, 2] = frame.lead
    return S


def in_series(stiffness: NDArray | None, row: int, compliance: float) -> NDArray:
    """Return K_B with a spring in series in one direction of its own axes.

    Args:
        stiffness: (6, 6) declared, None if rigid.
        row: index of the direction.
        compliance: [rad/(N m) or m/N] of the spring added.

    Returns:
        (6, 6) with ``inf`` on the diagonal where rigid.
    """
    K = np.diag(np.full(6, np.inf)) if stiffness is None else np.array(stiffness)
    free = np.diag(K) == 0.0  # a spring in series with a free motion leaves it free
    K[free, free] = np.inf
    soft = np.isfinite(np.diag(K))
    C = np.zeros((6, 6))
    if soft.any():
        C[np.ix_(soft, soft)] = np.linalg.inv(K[np.ix_(soft, soft)])
    C[row, row] += compliance
    soft = np.diag(C) > 0
    K = np.diag(np.full(6, np.inf))
    if soft.any():
        K[np.ix_(soft, soft)] = np.linalg.inv(C[np.ix_(soft, soft)])
    K[free], K[:, free] = 0.0, 0.0
    return K
