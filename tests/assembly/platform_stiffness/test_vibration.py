"""Tests of natural frequencies against closed forms."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forcefit import BadInput, load_robot, natural_modes
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.files.solved_links import solved_link
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.mesh_link import mesh_link_mass
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, MeshLink, Robot
from forcefit.assembly.platform_stiffness.vibration import discretisation_errors
from forcefit.stiffness.screws import rotation_matrix
from tests.assembly.exact.test_exact import only

MESHES = Path(__file__).parents[3] / "meshes"
LENGTH, SIDE, E, RHO = 1.0, 0.02, 70e9, 2700.0


def cantilever(pieces, axis=(1.0, 0.0, 0.0)):
    link = BeamLink({"width": SIDE, "height": SIDE}, E, 0.3, RHO, "euler",
                    pieces=pieces)  # fmt: skip
    tip = Frame("tip", translation=LENGTH * np.array(axis), link=link)
    return home_posture(Robot("cantilever", "tip", (tip,)))


def bending(root):
    """Return the bending frequency [Hz] of a cantilever with rotary inertia.

    It is Rayleigh's quotient for the mode shape of an Euler beam, whose ``root`` is a
    solution of cos x cosh x = -1.
    """
    inertia, area = SIDE**4 / 12, SIDE**2
    speed = np.sqrt(E * inertia / (RHO * area)) / LENGTH**2
    x = np.linspace(0.0, root, 20_001)
    ratio = (np.cosh(root) + np.cos(root)) / (np.sinh(root) + np.sin(root))
    shape = np.cosh(x) - np.cos(x) - ratio * (np.sinh(x) - np.sin(x))
    slope = np.gradient(shape, x) * root / LENGTH
    turning = inertia / area * np.trapezoid(slope**2, x) / np.trapezoid(shape**2, x)
    return root**2 * speed / (2 * np.pi) / np.sqrt(1 + turning)


def test_frequency_of_mass_on_torsion_spring_equals_closed_form():
    """omega^2 = k / (m l^2)."""
    hinge = Frame("hinge", joint="revolute", joint_stiffness=only(2, 50.0))
    arm = Frame("arm", "hinge", [0.4, 0, 0], mass=2.0, centre_of_mass=[0.1, 0, 0])
    modes = natural_modes(home_posture(Robot("arm", "arm", (hinge, arm))))
    expected = np.sqrt(50.0 / (2.0 * 0.5**2)) / (2 * np.pi)
    np.testing.assert_allclose(modes.frequencies, [expected], rtol=1e-9)
    assert modes.shares[0] == {("hinge", "joint"): pytest.approx(1.0)}


@pytest.mark.parametrize("moment", [0.0, 0.1])
def test_gravity_lowers_frequency_of_inverted_pendulum(moment):
    """omega^2 = (k - m g l) / (m l^2 + J)."""
    k, m, length, g = 50.0, 2.0, 0.4, 9.81
    hinge = Frame("hinge", joint="revolute", joint_stiffness=only(2, k))
    arm = Frame("arm", "hinge", [length, 0, 0], mass=m, inertia=moment * np.eye(3))
    posture = home_posture(Robot("arm", "arm", (hinge, arm)))
    modes = natural_modes(posture, gravity=[-g, 0, 0], state="exact")
    expected = np.sqrt((k - m * g * length) / (m * length**2 + moment)) / (2 * np.pi)
    np.testing.assert_allclose(modes.frequencies, [expected], rtol=1e-9)


@pytest.mark.parametrize(
    ("pieces", "first", "second"),
    [(1, 6e-3, 0.6), (2, 6e-3, 0.6), (4, 5e-5, 2e-3), (8, 4e-6, 2e-4)],
)
def test_bending_frequencies_of_cantilever_converge_to_closed_form(
    pieces, first, second
):
    """The frequencies are too high, with errors of order 1/n^4 for n elements.

    With one element, the estimate of the error of the second mode lacks higher orders.
    """
    modes = natural_modes(cantilever(pieces), 4)
    off = modes.frequencies / np.repeat([bending(1.8751041), bending(4.6940911)], 2) - 1
    assert (off > 0).all()
    assert off[:2].max() < first
    assert off[2:].max() < second
    if pieces < 8:
        tolerance = 0.5 if pieces == 1 else 0.1
        np.testing.assert_allclose(discretisation_errors(modes), off, rtol=tolerance)


@pytest.mark.parametrize("pieces", [4, 8])
def test_discretisation_error_of_waves_equals_that_of_linear_elements(pieces):
    """The eigenvalue of n linear elements of a rod is 6 (1 - cos a)/(2 + cos a).

    Here a = pi/2n.  Both longitudinal and torsional waves have this error.
    """
    a = np.pi / (2 * pieces)
    error = np.sqrt(6 * (1 - np.cos(a)) / (2 + np.cos(a))) / a - 1
    modes = natural_modes(cantilever(pieces), 20)
    estimates = discretisation_errors(modes)
    turn, shift = modes.platform_screws[0], modes.platform_screws[3]
    for motion in (turn, shift):
        first = np.flatnonzero(np.abs(motion) > 1e-6 * np.abs(motion).max())[0]
        np.testing.assert_allclose(estimates[first], error, rtol=0.01)


def test_frequency_errors_near_buckling_belong_to_the_same_modes():
    """One spring in place of a column buckles at 3 EI/2L^2, below pi^2 EI/4L^2."""
    posture = cantilever(1)
    load = {"fx": -2.0 * E * SIDE**4 / 12 / LENGTH**2}
    modes = natural_modes(posture, 4, load, state="exact")
    estimates = discretisation_errors(modes, load, state="exact")
    unstable = np.isnan(modes.frequencies)
    assert unstable.any()
    np.testing.assert_array_equal(np.isnan(estimates), unstable)
    assert np.nanmax(np.abs(estimates)) < 1.0


def test_axial_and_torsional_frequencies_agree_with_closed_form():
    """The frequencies are (1/4L) sqrt(E / rho) and (1/4L) sqrt(GJ / rho I_p)."""
    modes = natural_modes(cantilever(8), 60)
    G, J = E / 2.6, 0.140577 * SIDE**4
    twist = np.sqrt(G * J / (RHO * SIDE**4 / 6)) / (4 * LENGTH)
    stretch = np.sqrt(E / RHO) / (4 * LENGTH)
    for expected in (twist, stretch):
        nearest = np.abs(modes.frequencies / expected - 1).min()
        assert nearest < 2e-3


def test_frequencies_do_not_depend_on_orientation_of_beam():
    R = rotation_matrix([0.3, -1.0, 0.7])
    straight = natural_modes(cantilever(3), 6).frequencies
    turned = natural_modes(cantilever(3, tuple(R[:, 0])), 6).frequencies
    np.testing.assert_allclose(turned, straight, rtol=1e-6)


def test_free_motion_has_zero_frequency():
    slide = Frame("slide", joint="prismatic")
    body = Frame("body", "slide", mass=1.0)
    modes = natural_modes(home_posture(Robot("slider", "body", (slide, body))))
    np.testing.assert_array_equal(modes.frequencies, [0.0])


def test_natural_modes_ignore_clearances_and_require_a_mass():
    posture = cantilever(1)
    (tip,) = posture.robot.frames
    loose = replace(tip, name="beam", clearance=Clearance(radial=1e-4))
    robot = Robot("loose", "end", (loose, Frame("end", "beam")))
    both = natural_modes(home_posture(robot), 2), natural_modes(posture, 2)
    one, other = (modes.frequencies for modes in both)
    np.testing.assert_allclose(one, other, rtol=1e-9)
    with pytest.raises(BadInput, match="found no moving mass"):
        natural_modes(home_posture(load_robot("irsbot2")))


@pytest.mark.slow
def test_frequencies_of_meshed_bar_agree_with_beam():
    """The rigid end faces of the mesh increase the frequencies by less than 2 %.

    The mass is compared with the mass of a cylinder.
    """
    length, radius = 0.452, 0.04
    solid = MeshLink(MESHES / "distal_plain.stl", "z=0", "z=0.452", E, 0.3, RHO)
    beam = Frame("tip", translation=[length, 0, 0],
                 link=BeamLink({"radius": radius}, E, 0.3, RHO))  # fmt: skip
    solid = replace(beam, link=solved_link(replace(beam, link=solid)))
    mass, span = mesh_link_mass(solid)
    np.testing.assert_allclose(span, [length, 0, 0], atol=1e-9)
    volume = np.pi * radius**2 * length
    for row in range(3):
        shift = np.tile(np.eye(6)[3 + row], 2)
        assert shift @ mass @ shift == pytest.approx(RHO * volume, rel=2e-3)
    spin = np.tile(np.eye(6)[0], 2)
    expected = RHO * volume * radius**2 / 2
    assert spin @ mass @ spin == pytest.approx(expected, rel=3e-3)
    by_mesh, by_beam = (
        natural_modes(home_posture(Robot("bar", "tip", (frame,))), 3).frequencies
        for frame in (solid, beam)
    )
    np.testing.assert_allclose(by_mesh, by_beam, rtol=0.02)


SCREWS_AND_RODS = """
format = 2
platform = "plate"
platform_at = [0.02, 0.03, 0.35]
body = [{ name = "plate", mass = 2.5, centre = [0.01, 0.02, 0.5], inertia = [0.02, 0.03, 0.025, 0.002, -0.001, 0.003] }]
[[leg]]
name = "screw"
repeat = { count = 3, about = [1, 0.2, 2], at = [0.1, 0, 0.1] }
body = [
    { name = "low" },
    { name = "high", link = { beam = { radius = 0.012 }, young = 2.1e11, poisson = 0.3 } },
]
joint = [
    { name = "u", type = "universal", between = ["low", "base"], at = [0.3, 0, 0], axis = [1, 0, 0.2], axis2 = [0, 1, 0] },
    { name = "nut", type = "helical", between = ["high", "low"], at = [0.25, 0, 0.1], axis = [-0.1, 0, 0.3], pitch = -0.005, actuated = true, drive_stiffness = 200 },
    { name = "s", type = "spherical", between = ["plate", "high"], at = [0.2, 0, 0.3] },
]
[[leg]]
name = "tie"
repeat = { count = 3, about = [1, 0.2, 2], at = [0.1, 0, 0.1] }
body = [{ name = "rod", link = { beam = { radius = 0.03, inner_radius = 0.024 }, young = 7e10, poisson = 0.33 } }]
joint = [
    { name = "x", type = "spherical", between = ["base", "rod"], at = [0.3, 0.1, 0] },
    { name = "y", type = "spherical", between = ["rod", "plate"], at = [0.1, 0.15, 0.3], joint_stiffness = [0, 0, 0, 1e8, 1e8, 1e8] },
]
"""  # noqa: E501


def test_frequencies_of_robot_with_screw_drives_agree_with_reference(write_file):
    """The reference uses stiffness and mass matrices in the twists of all bodies.

    The rods are massless and can spin freely.
    """
    modes = natural_modes(home_posture(read_robot(write_file(SCREWS_AND_RODS))), 3)
    expected = [241.53112443, 349.76392046, 970.11496002]
    np.testing.assert_allclose(modes.frequencies, expected, rtol=1e-8)


LINEAR_DELTA = """
format = 2
platform = "plate"
platform_at = [0, 0, -0.1]
body = [{ name = "plate", mass = 1.5, centre = [0, 0, -0.1] }]
[[leg]]
name = "axis"
repeat = { count = 3, about = [0, 0, 1] }
body = [
    { name = "slider" },
    { name = "left", link = { beam = { radius = 0.008 }, young = 7e10, poisson = 0.3 } },
    { name = "right", link = { beam = { radius = 0.008 }, young = 7e10, poisson = 0.3 } },
]
joint = [
    { name = "motor", type = "prismatic", between = ["base", "slider"], at = [0.4, 0, 0.4], axis = [0, 0, 1], actuated = true, drive_stiffness = 1e7 },
    { name = "a", type = "spherical", between = ["slider", "left"], at = [0.35, 0.06, 0.4] },
    { name = "b", type = "spherical", between = ["left", "plate"], at = [0.08, 0.06, -0.1] },
    { name = "c", type = "spherical", between = ["slider", "right"], at = [0.35, -0.06, 0.4] },
    { name = "d", type = "spherical", between = ["right", "plate"], at = [0.08, -0.06, -0.1] },
]
"""  # noqa: E501


def test_point_mass_on_six_rods_has_three_modes(write_file):
    """The expected stiffness is condensed to the translations of the mass.

    The two bars of a leg are springs EA/L on a drive, which is a spring along z.
    """
    rod = np.array([-0.27, 0.0, -0.5])
    length = np.linalg.norm(rod)
    bar = length / (7e10 * np.pi * 0.008**2)
    drive = (rod[2] / length) ** 2 / 1e7
    leg = np.linalg.inv(bar * np.eye(2) + drive * np.ones((2, 2)))
    K = np.zeros((6, 6))
    for k in range(3):
        R = rotation_matrix([0.0, 0.0, 2 * np.pi * k / 3])
        u = R @ rod / length
        arms = [R @ [0.08, 0.06, 0.0], R @ [0.08, -0.06, 0.0]]
        wrenches = np.array([[*np.cross(p, u), *u] for p in arms])
        K += wrenches.T @ leg @ wrenches
    condensed = K[3:, 3:] - K[3:, :3] @ np.linalg.solve(K[:3, :3], K[:3, 3:])
    expected = np.sqrt(np.linalg.eigvalsh(condensed) / 1.5) / (2 * np.pi)
    modes = natural_modes(home_posture(read_robot(write_file(LINEAR_DELTA))), 6)
    np.testing.assert_allclose(modes.frequencies, expected, rtol=1e-8)
