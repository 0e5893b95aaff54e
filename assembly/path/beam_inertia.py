r"""Inertial loads and weight of a moving beam.

A beam moves approximately as a rigid body.  Its load per length is linear along the
beam, q(x) = rho A (g - a(x)).  Its moment per length is constant, m = -rho (J alpha +
omega x J omega).  At the tip of a beam clamped at its base, this load causes the same
deflection as the wrench

    F_x = Q_0 / 2 + Q_1 / 3                M_x = m_x L / 2
    F_y = Q_0 / 2 + Q_1 (7/20 + phi/3) / (1 + phi) + m_z / (1 + phi)
    M_z = Q_0 L / 12 + Q_1 L / 8 - L (F_y - m_z) / 2 + ..

where Q_0 = q(0) L, Q_1 = (q(L) - q(0)) L and phi = 12 E I / (k G A L^2).  The other
components are similar.  For phi = 0, this wrench is the product of the consistent mass
matrix and the accelerations of both ends.  The total load minus this wrench acts at the
base.

======  =======================================================  ==============
symbol  meaning                                                  unit
======  =======================================================  ==============
x y z   axes of the section: x from base to tip                  -
q0, q1  load per length at the base, its increase to the tip     N/m
m       moment per length                                        N
======  =======================================================  ==============

Sources:
    Przemieniecki (1968), Theory of Matrix Structural Analysis, chapter 11 (consistent
    mass, with shear).
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.robot import BeamLink, Frame, beam_axis
from forcefit.assembly.path.motion import Motion
from forcefit.stiffness.beam.beam import section_axes
from forcefit.stiffness.beam.beam_stress import peak_beam_stress, section_stress
from forcefit.stiffness.beam.sections import declared_section

_ALONG = 33  # number of sections at which the stress is computed
_FEW = 34  # number of fibres used to locate the section with the largest stress


@dataclass(frozen=True, eq=False)
class BeamData:
    """Properties of a beam with a density.

    Attributes:
        length: [m] length of the beam.
        axes: (3, 3) axes of the section as columns, in the frame's axes.
        mass: [kg/m] mass per length.
        inertia: (3,) [kg m] moments of inertia per length about the section's axes.
        shear: (2,) [-] shear parameter phi for bending in the planes x y and x z.
    """

    length: float
    axes: NDArray
    mass: float
    inertia: NDArray
    shear: NDArray


@dataclass(frozen=True, eq=False)
class BeamLoad:
    """Distributed load of a beam at k points, in section axes.

    Attributes:
        data: the beam.
        q0: (k, 3) [N/m] load per length at the base.
        q1: (k, 3) [N/m] increase of the load per length from base to tip.
        m: (k, 3) [N] moment per length.
    """

    data: BeamData
    q0: NDArray
    q1: NDArray
    m: NDArray

    def rows(self, which: NDArray) -> "BeamLoad":
        """Return the beam's load at selected points of the path."""
        return replace(self, q0=self.q0[which], q1=self.q1[which], m=self.m[which])

    def at_tip(self) -> NDArray:
        """Return the equivalent wrench at the tip, section axes, (k, 6) [N m, N]."""
        L, phi = self.data.length, self.data.shear
        Q0, Q1, m = self.q0 * L, self.q1 * L, self.m
        wrench = np.zeros((len(Q0), 6))
        wrench[:, 0] = m[:, 0] * L / 2
        wrench[:, 3] = Q0[:, 0] / 2 + Q1[:, 0] / 3
        # a positive moment about z bends the beam towards y, but about y away from z
        for plane, across, about, sign in ((0, 1, 2, 1.0), (1, 2, 1, -1.0)):
            p = phi[plane]
            of_increase = Q1[:, across] * (7 / 20 + p / 3) / (1 + p)
            turned = sign * m[:, about] / (1 + p)
            wrench[:, 3 + across] = Q0[:, across] / 2 + of_increase + turned
            moment = -Q0[:, across] * L / 12 + Q1[:, across] * L / 8
            moment += -of_increase * L / 2 + turned * p * L / 2
            wrench[:, about] = sign * moment
        return wrench

    def at_base(self, tip: NDArray) -> NDArray:
        """Return the equivalent wrench at the base.

        Args:
            tip: equivalent wrench at the tip, from :meth:`at_tip`.

        Returns:
            (k, 6) [N m, N] total load minus tip wrench, in section axes.
        """
        L = self.data.length
        x = np.array([1.0, 0.0, 0.0])
        force = self.q0 * L + self.q1 * L / 2
        moment = np.cross(x, self.q0 * L**2 / 2 + self.q1 * L**2 / 3) + self.m * L
        moment -= tip[:, :3] + L * np.cross(x, tip[:, 3:])
        return np.concatenate([moment, force - tip[:, 3:]], axis=1)

    def on_sections(self, tip: NDArray, count: int = _ALONG) -> NDArray:
        """Return the internal wrenches at sections from the base to the tip.

        Args:
            tip: (k, 6) [N m, N] internal wrench at the tip, section axes.
            count: number of equally spaced sections.

        Returns:
            (k, count, 6) [N m, N] wrenches, with the sign convention of ``tip``.
        """
        L, x = self.data.length, np.array([1.0, 0.0, 0.0])
        s = L * np.linspace(1, 0, count)[:, None]  # distance from the tip
        q0, q1, m = (part[:, None] for part in (self.q0, self.q1, self.m))
        F = tip[:, None, 3:] + (q0 + q1) * s - q1 / L * s**2 / 2
        arms = s * tip[:, None, 3:] + (q0 + q1) * s**2 / 2 - q1 / L * s**3 / 6
        M = tip[:, None, :3] + np.cross(x, arms) + m * s
        return np.concatenate([M, F], axis=2)


@lru_cache(maxsize=256)
def beam_data(frame: Frame) -> BeamData | None:
    """Return the properties of a frame's beam, or None without a beam or a density."""
    link = frame.link
    if not isinstance(link, BeamLink) or not link.density:
        return None
    length, axis = beam_axis(frame)
    axes = section_axes(axis, link.up)
    section = declared_section(link.section, link.poisson)
    second = np.array([section.I_y + section.I_z, section.I_y, section.I_z])
    turned = np.kron(np.eye(2), axes)
    C = turned.T @ link_compliance(frame) @ turned
    # The tip compliance is L^3 / 3 E I + L / k G A for a force, and L / E I for a
    # moment.
    bending, turning = np.diag(C)[[4, 5]], np.diag(C)[[2, 1]]
    shear = 12 * (bending - turning * length**2 / 3) / (turning * length**2)
    return BeamData(
        length, axes, link.density * section.area, link.density * second, shear
    )


def beam_load(motion: Motion, body: int, gravity: NDArray) -> BeamLoad | None:
    """Return the inertial load and the weight of a beam.

    Args:
        motion: motion at k points.
        body: index of the beam's frame.
        gravity: (3,) [m/s^2] gravity in base axes.

    Returns:
        The load, or None without a beam or a density.
    """
    data = beam_data(motion.postures.robot.frames[body])
    if data is None:
        return None
    T = motion.postures.transforms[:, body]
    R = T[:, :3, :3] @ data.axes
    tip = T[:, :3, 3]
    base = tip - data.length * R[:, :, 0]

    def load(points: NDArray) -> NDArray:
        missing = gravity - motion.acceleration_of(body, points)
        return data.mass * np.einsum("kji,kj->ki", R, missing)

    q0 = load(base)
    omega, alpha = (
        np.einsum("kji,kj->ki", R, part[:, body, :3])
        for part in (motion.twists, motion.accelerations)
    )
    J = data.inertia
    m = -(J * alpha + np.cross(omega, J * omega))
    return BeamLoad(data, q0, load(tip) - q0, m)


def beam_stress(frame: Frame, load: BeamLoad, tip: NDArray) -> NDArray:
    """Return the largest von Mises stress of a beam under its distributed load.

    The stress in 34 fibres is evaluated at 33 sections.  At the section with the
    largest stress, all fibres are evaluated.

    Args:
        frame: frame of a beam with a declared cross-section.
        load: distributed load at k points of the path.
        tip: (k, 6) [N m, N] internal wrench at the tip, in the frame's axes.

    Returns:
        (k,) [Pa] stress.
    """
    assert isinstance(frame.link, BeamLink)
    R = load.data.axes
    wrenches = load.on_sections(np.hstack([tip[:, :3] @ R, tip[:, 3:] @ R]))
    _, influence = section_stress(frame.link.section)
    few = influence[:: max(1, len(influence) // _FEW)]
    sigma, tau_y, tau_z = (wrenches @ few[:, k].T for k in range(3))
    size = (sigma**2 + 3 * (tau_y**2 + tau_z**2)).max(axis=2)
    worst = wrenches[np.arange(len(wrenches)), size.argmax(axis=1)]
    return peak_beam_stress(frame.link.section, 0.0, worst)[0]
