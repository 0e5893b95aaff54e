"""Compliances of the bodies and joints of a robot."""

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
    """Return the compliances of all bodies, the inverse of K_E in eq. (6).

    Args:
        robot: robot with n frames.

    Returns:
        Compliances (n, 6, 6) [rad/(N m) .. m/N] at each frame, in its axes; zero for
        rigid bodies.

    Raises:
        BadInput: a mesh was not solved, or a library was not read, when the robot was
            loaded.
    """
    C = np.zeros((len(robot.frames), 6, 6))
    for i, frame in enumerate(robot.frames):
        if frame.link is not None:
            C[i] = link_compliance(frame)
    return C


# Cached by frame, because robots often share frames.
@lru_cache(maxsize=4096)
def link_compliance(frame: Frame) -> NDArray:
    """Return the read-only compliance (6, 6) of a frame's body, in the frame axes."""
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
    """Return the compliances of all joints, the inverse of K_B.

    Args:
        robot: robot with n frames.

    Returns:
        Compliances (n, 6, 6) [rad/(N m) .. m/N] at each frame, in its axes; zero for
        directions that are rigid, free or not specified.
    """
    C = spring_compliances(robot)
    for i, frame in enumerate(robot.frames):
        if frame.pitch:
            S = motion_map(frame)
            C[i] = S @ C[i] @ S.T
    return C


def spring_compliances(robot: Robot) -> NDArray:
    """Return the compliances of all joints in joint components.

    Args:
        robot: robot with n frames.

    Returns:
        Compliances (n, 6, 6) [rad/(N m) .. m/N], for the components of
        :func:`motion_map`; zero for directions that are rigid, free or not specified.
    """
    C = np.zeros((len(robot.frames), 6, 6))
    for i, frame in enumerate(robot.frames):
        K = frame.springs
        if K is not None:
            soft = np.ix_(*[np.isfinite(np.diag(K))] * 2)
            C[i][soft] = np.linalg.inv(K[soft])
    return C


def compliance_factor(C: NDArray) -> NDArray:
    """Factorise a compliance as C = L L^T, so that a screw L y has the energy y.y/2.

    Args:
        C: symmetric positive semidefinite compliance (6, 6) in mixed units.

    Returns:
        Factor L (6, r) with full column rank r.
    """
    size = np.sqrt(np.diag(C))
    soft = np.flatnonzero(size > 0)
    # The diagonal is scaled to 1, because angular and linear compliances differ by
    # orders of magnitude.
    scaled = C[np.ix_(soft, soft)] / np.outer(size[soft], size[soft])
    L = np.zeros((6, len(soft)))
    L[soft] = size[soft, None] * np.linalg.cholesky(scaled)
    return L


def own_screw(frame: Frame) -> NDArray:
    """Return the unit screw of the joint motion (6,)."""
    return motion_map(frame)[:, frame.own_axis]


def own_screws(robot: Robot) -> NDArray:
    """Return the unit screws of all joint motions (n, 6)."""
    frames = robot.frames
    screws = np.zeros((len(frames), 6))
    screws[np.arange(len(frames)), [frame.own_axis for frame in frames]] = 1.0
    screws[:, 5] += [frame.lead for frame in frames]
    return screws


def motion_map(frame: Frame) -> NDArray:
    """Return the map from joint components to the joint screw in the frame axes.

    The map is the identity except for helical joints.  Component RZ of a helical joint
    is the motion along the thread, [0 0 1 0 0 h], and component TZ is the additional
    translation, TZ - h RZ.  K_B and clearances refer to these components.

    Args:
        frame: frame with the joint.

    Returns:
        Matrix (6, 6) [-; m/rad in row TZ, column RZ].
    """
    S = np.eye(6)
    S[5, 2] = frame.lead
    return S


def in_series(stiffness: NDArray | None, row: int, compliance: float) -> NDArray:
    """Add a spring in series with a joint in one direction.

    Args:
        stiffness: stiffness K_B of the joint (6, 6); None if rigid.
        row: index of the direction.
        compliance: compliance of the added spring [rad/(N m) or m/N].

    Returns:
        Stiffness (6, 6), with ``inf`` on the diagonal for rigid directions.
    """
    K = np.diag(np.full(6, np.inf)) if stiffness is None else np.array(stiffness)
    free = np.diag(K) == 0.0  # Free motions remain free with a spring in series.
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
