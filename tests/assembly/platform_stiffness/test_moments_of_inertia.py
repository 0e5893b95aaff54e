"""Tests of natural frequencies of bodies with moments of inertia."""

import numpy as np
import pytest

from forcefit import BeamLink, Frame, Robot, natural_modes, solve_exact
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.stiffness.screws import rotation_matrix, rotation_vector
from tests.assembly.exact.test_exact import only

TURN = rotation_matrix([0.4, -0.9, 1.3])
PRINCIPAL = np.array([0.02, 0.05, 0.06])  # [kg m^2]


def hertz(squares):
    return np.sqrt(np.sort(np.ravel(squares))) / (2 * np.pi)


def frequencies(*frames):
    robot = Robot("test", frames[-1].name, frames)
    return natural_modes(home_posture(robot)).frequencies


def mount(rotation, translation, **keys):
    """Return the frequencies of a body on isotropic springs."""
    K = np.diag([rotation] * 3 + [translation] * 3)
    seat = Frame("seat", joint_stiffness=K, rotation=rotation_vector(TURN))
    return frequencies(seat, Frame("body", "seat", **keys))


def test_frequency_of_hinged_body_depends_on_inertia_about_hinge():
    """omega^2 = k / (n.J n + m r^2), where n is the hinge axis in body axes."""
    hinge = Frame("hinge", joint="revolute", joint_stiffness=only(2, 50.0))
    J = TURN @ np.diag(PRINCIPAL) @ TURN.T
    R = rotation_matrix([0.3, 1.1, -0.5])
    arm = Frame("arm", "hinge", [0.4, 0, 0.2], rotation_vector(R), mass=2.0,
                centre_of_mass=R.T @ [0.1, 0.3, 0.7], inertia=J)  # fmt: skip
    n = R.T[:, 2]
    expected = hertz(50.0 / (n @ J @ n + 2.0 * (0.5**2 + 0.3**2)))
    np.testing.assert_allclose(frequencies(hinge, arm), expected, rtol=1e-9)


def test_frequency_of_torsion_pendulum_equals_closed_form():
    """For a disc on a massless wire, omega^2 = G I_p / (L J)."""
    length, radius, G = 1.5, 0.002, 8e10
    wire = BeamLink({"radius": radius}, 2.6 * G, 0.3, None, "euler")
    disc = 3.0 * 0.1**2 / 2
    J = np.diag([disc, disc / 2, disc / 2])
    body = Frame("disc", translation=[length, 0, 0], link=wire, mass=3.0, inertia=J)
    found = frequencies(body)
    expected = hertz(G * np.pi * radius**4 / 2 / (length * disc))
    assert np.abs(found / expected - 1).min() < 1e-9


def test_frequencies_of_disc_on_cantilever_equal_closed_form():
    """Deflection and slope at the tip are coupled by the stiffness of the beam."""
    length, side, E, m, J = 0.8, 0.02, 7e10, 4.0, 0.3
    EI = E * side**4 / 12
    K = EI / length**3 * np.array([[12, -6 * length], [-6 * length, 4 * length**2]])
    squares = np.linalg.eigvals(np.diag([1 / m, 1 / J]) @ K)
    beam = BeamLink({"width": side, "height": side}, E, 0.3, None, "euler")
    body = Frame("disc", translation=[length, 0, 0], link=beam, mass=m,
                 inertia=np.diag([0.4, J, J]))  # fmt: skip
    found = frequencies(body)
    for value in hertz(squares):
        assert np.sum(np.abs(found / value - 1) < 1e-9) == 2  # both planes


@pytest.mark.parametrize("mass", [0.0, 5.0])
def test_frequencies_depend_on_principal_moments_of_inertia(mass):
    """omega^2 = k / J for each principal moment of inertia J."""
    J = TURN @ np.diag(PRINCIPAL) @ TURN.T
    found = mount(200.0, 3e5, mass=mass, inertia=J)
    shifts = [3e5 / mass] * 3 if mass else []
    np.testing.assert_allclose(found, hertz([*200.0 / PRINCIPAL, *shifts]), rtol=1e-9)


def test_eccentric_mass_couples_rotation_and_translation():
    """The centre of mass is at a distance r from isotropic springs."""
    k_r, k_t, m, J, r = 200.0, 3e5, 5.0, 0.04, 0.03
    # for the motion x and rotation t of the springs, the kinetic energy is
    # (m (x' + r t')^2 + J t'^2) / 2
    M = np.array([[m, m * r], [m * r, J + m * r**2]])
    both = np.linalg.eigvals(np.linalg.solve(M, np.diag([k_t, k_r])))
    expected = hertz([k_t / m, k_r / J, *both, *both])
    found = mount(k_r, k_t, mass=m, inertia=J * np.eye(3), centre_of_mass=[0, r, 0])
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_frequency_of_two_rotors_on_shaft_equals_closed_form():
    """For two rotors on a free shaft, omega^2 = 0 and k (1/J1 + 1/J2)."""
    k, J1, J2 = 900.0, 0.02, 0.05
    bearing = Frame("bearing", joint="revolute")
    first = Frame("first", "bearing", joint="revolute", joint_stiffness=only(2, k),
                  inertia=J1 * np.eye(3))  # fmt: skip
    second = Frame("second", "first", [0, 0, 0.3], mass=2.0,
                   inertia=J2 * np.diag([0.5, 0.5, 1]))  # fmt: skip
    expected = hertz([0.0, k * (1 / J1 + 1 / J2)])
    found = frequencies(bearing, first, second)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_frequencies_of_double_pendulum_equal_closed_form():
    """Two links move in a plane against springs at both hinges."""
    k1, k2, m1, m2, l1, c1, c2, J1, J2 = 80, 30, 3, 2, 0.4, 0.25, 0.1, 0.05, 0.02
    a, b, c = J1 + m1 * c1**2 + m2 * l1**2, m2 * l1 * c2, J2 + m2 * c2**2
    # mass matrix of the straight pendulum for relative joint angles
    M = np.array([[a + 2 * b + c, b + c], [b + c, c]])
    expected = hertz(np.linalg.eigvals(np.linalg.solve(M, np.diag([k1, k2]))))
    first = Frame("one", joint="revolute", joint_stiffness=only(2, k1))
    second = Frame("two", "one", [l1, 0, 0], joint="revolute", mass=m1,
                   centre_of_mass=[c1 - l1, 0, 0], inertia=J1 * np.eye(3),
                   joint_stiffness=only(2, k2))  # fmt: skip
    tip = Frame("tip", "two", [c2, 0, 0], mass=m2, inertia=J2 * np.eye(3))
    np.testing.assert_allclose(frequencies(first, second, tip), expected, rtol=1e-9)


def test_equilibrium_under_gravity_does_not_depend_on_inertia():
    """Gravity exerts no moment about the centre of mass."""
    screws = []
    for J in (np.zeros((3, 3)), 7.0 * np.eye(3)):
        seat = Frame("seat", joint_stiffness=np.diag([50.0] * 3 + [1e4] * 3))
        body = Frame("body", "seat", mass=2.0, centre_of_mass=[0.2, 0, 0], inertia=J)
        posture = home_posture(Robot("weight", "body", (seat, body)))
        answer = solve_exact(posture, gravity=[0, 0, -9.81])
        screws.append(answer.platform_screw)
    np.testing.assert_array_equal(screws[0], screws[1])
    assert screws[0][5] == pytest.approx(-2 * 9.81 / 1e4, rel=0.01)
