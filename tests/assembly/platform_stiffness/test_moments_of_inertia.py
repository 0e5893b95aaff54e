"""Natural frequencies of bodies with moments of inertia, compared with closed forms."""

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
    """A body on springs with equal stiffness about and along all axes."""
    seat = Frame(
        "seat", joint_stiffness=np.diag([rotation] * 3 + [translation] * 3),
        rotation=rotation_vector(TURN),
    )  # fmt: skip
    return frequencies(seat, Frame("body", "seat", **keys))


def test_body_on_a_hinge_spring_oscillates_with_the_moment_about_the_hinge():
    """omega^2 = k / (n J n + m r^2), where n is the hinge axis in body axes."""
    hinge = Frame("hinge", joint="revolute", joint_stiffness=only(2, 50.0))
    J = TURN @ np.diag(PRINCIPAL) @ TURN.T
    R = rotation_matrix([0.3, 1.1, -0.5])
    arm = Frame("arm", "hinge", [0.4, 0, 0.2], rotation_vector(R), mass=2.0,
                centre_of_mass=R.T @ [0.1, 0.3, 0.7], inertia=J)  # fmt: skip
    n = R.T[:, 2]
    expected = hertz(50.0 / (n @ J @ n + 2.0 * (0.5**2 + 0.3**2)))
    np.testing.assert_allclose(frequencies(hinge, arm), expected, rtol=1e-9)


def test_torsion_pendulum_has_the_frequency_of_the_textbook():
    """A 3 kg disc on a massless wire: omega^2 = G I_p / (L J)."""
    length, radius, G = 1.5, 0.002, 8e10
    wire = BeamLink({"radius": radius}, 2.6 * G, 0.3, None, "euler")
    disc = 3.0 * 0.1**2 / 2
    J = np.diag([disc, disc / 2, disc / 2])
    body = Frame("disc", translation=[length, 0, 0], link=wire, mass=3.0, inertia=J)
    found = frequencies(body)
    expected = hertz(G * np.pi * radius**4 / 2 / (length * disc))
    assert np.abs(found / expected - 1).min() < 1e-9


def test_disc_on_a_cantilever_couples_bending_and_rotation():
    """Deflection w and slope at the tip are coupled by K = EI [[12, -6L], ..]."""
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
def test_products_of_inertia_do_not_change_the_modes_of_equal_springs(mass):
    """omega^2 = k / principal moment, with the centre of mass at the springs."""
    J = TURN @ np.diag(PRINCIPAL) @ TURN.T
    found = mount(200.0, 3e5, mass=mass, inertia=J)
    shifts = [3e5 / mass] * 3 if mass else []
    np.testing.assert_allclose(found, hertz([*200.0 / PRINCIPAL, *shifts]), rtol=1e-9)


def test_centre_of_mass_away_from_the_springs_couples_rotation_and_translation():
    """Along the arm r: k_t / m and k_r / J; across it: [[k_t, k_t r], [k_t r, ..]]."""
    k_r, k_t, m, J, r = 200.0, 3e5, 5.0, 0.04, 0.03
    # unknowns at the springs: x and the rotation t; kinetic energy m (x + r t)^2 + J
    # t^2
    M = np.array([[m, m * r], [m * r, J + m * r**2]])
    both = np.linalg.eigvals(np.linalg.solve(M, np.diag([k_t, k_r])))
    expected = hertz([k_t / m, k_r / J, *both, *both])
    found = mount(k_r, k_t, mass=m, inertia=J * np.eye(3), centre_of_mass=[0, r, 0])
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_two_rotors_on_a_shaft_oscillate_in_opposition():
    """Free ends: omega^2 is 0 and k (1/J1 + 1/J2), for rotors with inertia only."""
    k, J1, J2 = 900.0, 0.02, 0.05
    bearing = Frame("bearing", joint="revolute")
    first = Frame("first", "bearing", joint="revolute", joint_stiffness=only(2, k),
                  inertia=J1 * np.eye(3))  # fmt: skip
    second = Frame("second", "first", [0, 0, 0.3], mass=2.0,
                   inertia=J2 * np.diag([0.5, 0.5, 1]))  # fmt: skip
    expected = hertz([0.0, k * (1 / J1 + 1 / J2)])
    found = frequencies(bearing, first, second)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_two_coupled_bodies_on_hinges_have_the_modes_of_the_double_pendulum():
    """Two links in a plane with springs at both hinges."""
    k1, k2, m1, m2, l1, c1, c2, J1, J2 = 80, 30, 3, 2, 0.4, 0.25, 0.1, 0.05, 0.02
    a, b, c = J1 + m1 * c1**2 + m2 * l1**2, m2 * l1 * c2, J2 + m2 * c2**2
    M = np.array([[a + 2 * b + c, b + c], [b + c, c]])  # relative angles, stretched out
    expected = hertz(np.linalg.eigvals(np.linalg.solve(M, np.diag([k1, k2]))))
    first = Frame("one", joint="revolute", joint_stiffness=only(2, k1))
    second = Frame("two", "one", [l1, 0, 0], joint="revolute", mass=m1,
                   centre_of_mass=[c1 - l1, 0, 0], inertia=J1 * np.eye(3),
                   joint_stiffness=only(2, k2))  # fmt: skip
    tip = Frame("tip", "two", [c2, 0, 0], mass=m2, inertia=J2 * np.eye(3))
    np.testing.assert_allclose(frequencies(first, second, tip), expected, rtol=1e-9)


def test_moments_of_inertia_do_not_change_the_equilibrium_under_weight():
    """A uniform field exerts no moment about the centre of mass."""
    screws = []
    for J in (np.zeros((3, 3)), 7.0 * np.eye(3)):
        seat = Frame("seat", joint_stiffness=np.diag([50.0] * 3 + [1e4] * 3))
        body = Frame("body", "seat", mass=2.0, centre_of_mass=[0.2, 0, 0], inertia=J)
        posture = home_posture(Robot("weight", "body", (seat, body)))
        answer = solve_exact(posture, gravity=[0, 0, -9.81])
        screws.append(answer.platform_screw)
    np.testing.assert_array_equal(screws[0], screws[1])
    assert screws[0][5] == pytest.approx(-2 * 9.81 / 1e4, rel=0.01)
