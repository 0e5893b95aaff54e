"""Tests of beams with several elements against published large deflections.

Sources:
    Dowell, Traybar (1975), Princeton beam.  Values by ANSYS from Obrezkov et al.,
    Nonlinear Dynamics (2022).
    Bathe, Bolourchi (1979), curved cantilever.  Values by kynema.
    Wang, Sprague, Jonkman et al., Wind Energy 20 (2017), twisted and composite beams.
    Values by kynema.
    Nachbagauer, Pechstein, Irschik, Gerstmayr (2011), plane cantilever.
    Bauchau et al., Multibody System Dynamics 37 (2016), four-bar with a tilted hinge.
    Values by Exudyn with 64 beam elements per bar.
"""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.optimize import brentq

from benchmarks.evidence.princeton_solids import in_pieces, root_link
from forcefit import BeamLink, Frame, MatrixLink, Robot, solve_assembly, solve_exact
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.platform_stiffness.matrices import Part
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import load_robot
from forcefit.stiffness.screws import screw_map
from forcefit.validation.multibody.simulation import SimulationModel, simulate_assembly

ANGLES = np.radians([0, 15, 30, 45, 60, 75, 90])
# tip deflections [m] along the height and the width for both forces [N]
PRINCETON = {
    8.896: (
        [1.071417630e-2, 1.061328706e-2, 1.011169630e-2, 8.837226265e-3,
         6.604665004e-3, 3.538889001e-3, 0],
        [0, 4.208232124e-2, 7.939482948e-2, 0.108987937, 0.129887616, 0.142194370,
         0.146245978],
    ),
    13.345: (
        [1.606423724e-2, 1.645825752e-2, 1.665873206e-2, 1.518618440e-2,
         1.157837500e-2, 6.248967384e-3, 0],
        [0, 6.435812858e-2, 0.117735994, 0.156467239, 0.181861627, 0.196097131,
         0.200677707],
    ),
}  # fmt: skip
# crank angle [rad] and displacement of hinge C [mm]
BAUCHAU = [
    (0.1, 11.97876, -0.59939, 0.01638),
    (0.3, 35.45846, -5.35851, -0.07994),
    (0.6, 67.74839, -20.95676, -0.56288),
    (0.9, 93.98468, -45.41251, -1.44820),
    (1.2, 111.82358, -76.59788, -2.66044),
    (1.4, 118.22770, -99.95946, -3.55386),
    (1.5, 119.66658, -112.60951, -3.98675),
]


def chain(steps, links):
    """Return a chain of beams that is clamped at the base."""
    frames = tuple(
        Frame(f"f{k}", f"f{k - 1}" if k else "base", step, link=link)
        for k, (step, link) in enumerate(zip(steps, links, strict=True))
    )
    return home_posture(Robot("chain", frames[-1].name, frames))


def cantilever(length, link):
    """Return a beam along x that is clamped at the base."""
    return chain([[length, 0, 0]], [link])


def tip_moved(posture, load):
    """Return the displacement of the platform's origin, (3,) [m]."""
    return solve_exact(posture, load).platform_screw[3:]


def extrapolated(tips):
    """Return the limit for many elements, if each solution has twice as many."""
    return (4 * tips[-1] - tips[-2]) / 3


def test_compliance_does_not_depend_on_number_of_beam_elements():
    """The compliance and the shares of all links are compared."""
    robot = load_robot("delta")
    links = {f.name: replace(f.link, pieces=3) for f in robot.frames if f.link}
    cut = place_robot(robot.with_links(links), {"tx": 0.1})
    whole = platform_stiffness(place_robot(robot, {"tx": 0.1}), "exact", [0] * 5 + [10])
    pieces = platform_stiffness(cut, "exact", [0] * 5 + [10])
    size = np.sqrt(np.diag(whole.compliance))
    difference = (pieces.compliance - whole.compliance) / np.outer(size, size)
    assert np.abs(difference).max() < 1e-5  # the load deforms the rods
    one, other = (s.shares([0, 0, 0, 0, 1, 0]) for s in (whole, pieces))
    assert set(one) == set(other)
    for part, share in one.items():
        assert other[part] == pytest.approx(share, abs=1e-5)
    assert any(part == Part(name, "link") for part in one for name in links)


@pytest.mark.parametrize("force", PRINCETON)
def test_princeton_beam_deflection_agrees_with_ansys(force):
    """Eight elements agree to 1.5 % along the height and 0.3 % along the width.

    The linear model has errors of 9 and 20 %.
    """
    height, width = 12.3777e-3, 3.2024e-3
    link = BeamLink({"width": width, "height": height}, 71.7e9, 0.31, up=(0, 1, 0))
    posture = cantilever(0.508, replace(link, pieces=8))
    moved = np.array([
        tip_moved(posture, [0, 0, 0, 0, force * np.cos(a), force * np.sin(a)])
        for a in ANGLES
    ])
    along, across = PRINCETON[force]
    np.testing.assert_allclose(moved[:-1, 1], along[:-1], rtol=0.015)
    np.testing.assert_allclose(moved[1:, 2], across[1:], rtol=0.003)
    linear = solve_assembly(posture, [0, 0, 0, 0, 0, force]).platform_screw[5]
    off = {8.896: 0.09, 13.345: 0.195}[force]
    assert linear / across[-1] - 1 == pytest.approx(off, abs=0.006)


# tip deflections [m] of a solid, computed by benchmarks.evidence.princeton_solids
SOLID = {
    (8.896, 15): (0.0106000, 0.0419811), (8.896, 45): (0.0088268, 0.1087360),
    (13.345, 45): (0.0151716, 0.1561285), (13.345, 75): (0.0062418, 0.1956991),
}  # fmt: skip


@pytest.mark.slow
def test_princeton_beam_without_warping_at_root_agrees_with_solid():
    """The deflections agree to 0.6 % if warping is prevented at the clamped end."""
    root = root_link()
    for (force, degrees), solid in SOLID.items():
        moved = in_pieces(force, np.radians(degrees), root)
        np.testing.assert_allclose(moved, solid, rtol=0.006)
    free = in_pieces(13.345, np.radians(75))
    assert free[0] / SOLID[13.345, 75][0] - 1 == pytest.approx(0.015, abs=0.001)


def curved_cantilever(chords, pieces):
    """Return an arc of 45 degrees with a radius of 100 in, divided into chords."""
    section = {"area": 1.0, "I_y": 1 / 12, "I_z": 1 / 12, "J": 1 / 6,
               "shear_y": 5 / 6, "shear_z": 5 / 6}  # fmt: skip
    link = BeamLink(section, 1e7, 0.0, up=(0, 0, 1), pieces=pieces)
    angles = np.linspace(0, np.pi / 4, chords + 1)
    nodes = np.column_stack([np.sin(angles), 1 - np.cos(angles), 0 * angles])
    return chain(100.0 * np.diff(nodes, axis=0), [link] * chords)


ACROSS = [0, 0, 0, 0, 0, 600.0]  # [lb] force normal to the plane of the arc


def test_curved_cantilever_deflection_agrees_with_literature():
    """The values of the two publications differ by 1 %.

    The error is inversely proportional to the squared number of chords.
    """
    tips = [tip_moved(curved_cantilever(n, 1), ACROSS) for n in (8, 16, 32)]
    off = [np.linalg.norm(one - two) for one, two in zip(tips, tips[1:], strict=False)]
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.03)
    tip = extrapolated(tips)
    np.testing.assert_allclose(tip, [-23.5, -13.4, 53.4], rtol=0.016)
    np.testing.assert_allclose(tip, [-23.64597, -13.72080, 53.57765], rtol=0.009)


@pytest.mark.exudyn
def test_curved_cantilever_deflection_agrees_with_exudyn():
    """The result is extrapolated to an infinite number of elements."""
    simulated = simulate_assembly(curved_cantilever(8, 1), load=ACROSS)
    tips = [tip_moved(curved_cantilever(8, n), ACROSS) for n in (2, 4)]
    expected = simulated.platform_screw[3:]
    np.testing.assert_allclose(extrapolated(tips), expected, rtol=1e-4)


def twisted_beam(count):
    """Return a beam along x that is twisted by 90 degrees over its length of 10 m."""
    E, nu = 200e9, 0.3
    G = E / (2 * (1 + nu))
    shear = 8.2604167e9 / (G * 0.125)
    section = {"area": 0.125, "I_y": 5.20833e8 / E, "I_z": 1.30208333e8 / E,
               "J": 1.41872656e8 / G, "shear_y": shear, "shear_z": shear}  # fmt: skip
    turns = np.pi / 2 * (np.arange(count) + 0.5) / count
    links = [BeamLink(section, E, nu, up=(0, -np.sin(t), np.cos(t))) for t in turns]
    return chain([[10 / count, 0, 0]] * count, links)


def test_twisted_beam_deflection_agrees_with_literature():
    """Six digits agree with the published beam elements after extrapolation."""
    load = [0, 0, 0, 0, 0, -4e6]
    tips = [tip_moved(twisted_beam(n), load) for n in (8, 16, 32)]
    rate = np.linalg.norm(tips[0] - tips[1]) / np.linalg.norm(tips[1] - tips[2])
    assert rate == pytest.approx(4.0, rel=0.02)
    tip = extrapolated(tips)
    np.testing.assert_allclose(tip, [-1.141526, -1.718053, -3.593213], rtol=3e-6)
    np.testing.assert_allclose(tip, [-1.134192, -1.714467, -3.58423], rtol=7e-3)


def composite_beam(count):
    """Return a beam of 10 in along x whose section couples torsion and bending."""
    section = np.diag([0.0, 0, 0, 1368.17e3, 88.56e3, 38.78e3])
    section[:3, :3] = [
        [16.96e3, 17.61e3, -0.351e3], [17.61e3, 59.12e3, -0.37e3],
        [-0.351e3, -0.37e3, 141.47e3],
    ]  # fmt: skip
    length, C = 10 / count, np.zeros((6, 6))
    for place, weight in zip(*np.polynomial.legendre.leggauss(3), strict=True):
        # transforms the deformation at a point of the beam to the tip
        to_tip = screw_map([-length * (1 - place) / 2, 0, 0])
        C += weight * length / 2 * to_tip @ np.linalg.inv(section) @ to_tip.T
    link = MatrixLink(np.linalg.inv((C + C.T) / 2))
    return chain([[length, 0, 0]] * count, [link] * count)


def test_composite_beam_deflection_agrees_with_literature():
    """Six digits agree after extrapolation."""
    tips = [tip_moved(composite_beam(n), [0, 0, 0, 0, 0, 150.0]) for n in (16, 32)]
    published = [-9.02726627566e-2, -6.47488486259e-2, 1.22973648292]
    np.testing.assert_allclose(extrapolated(tips), published, rtol=1e-6)


def test_plane_cantilever_deflection_agrees_with_literature():
    """The error is inversely proportional to the squared number of elements.

    The beam is very stiff in torsion and lateral bending, which prevents buckling.
    """
    width, height, nu = 0.1, 0.5, 0.3
    shear = 10 * (1 + nu) / (12 + 11 * nu)
    section = {"area": width * height, "I_y": 10.0, "I_z": width * height**3 / 12,
               "J": 10.0, "shear_y": shear, "shear_z": 1.0}  # fmt: skip
    link = BeamLink(section, 2.07e11, nu, up=(0, 0, 1))
    load = [0, 0, 0, 0, 5e8 * height**3, 0]
    beams = [cantilever(2.0, replace(link, pieces=n)) for n in (8, 16)]
    tips = [tip_moved(beam, load)[:2] for beam in beams]
    published = np.array([-0.15097, 0.71057])
    off = [np.abs(tip - published).max() for tip in tips]
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.05)
    np.testing.assert_allclose(extrapolated(tips), published, atol=1e-5)


@pytest.mark.parametrize("angle", [1.0, 3.0])
def test_beam_under_end_moment_bends_to_circular_arc(angle):
    """The tip is at (L sin a / a, L (1 - cos a) / a) with a = M L / EI."""
    length, stiffness = 10.0, 1e4
    link = BeamLink({"width": 1.0, "height": 1.0}, 12 * stiffness, 0.0, theory="euler")
    load = [0, 0, angle * stiffness / length, 0, 0, 0]
    exact = length * np.array([np.sin(angle) / angle - 1, (1 - np.cos(angle)) / angle])
    off = []
    for pieces in (8, 16, 32):
        moved = tip_moved(cantilever(length, replace(link, pieces=pieces)), load)
        off.append(np.abs(moved[:2] - exact).max() / length)
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.05)
    assert off[1] / off[2] == pytest.approx(4.0, rel=0.02)
    assert off[2] < 6e-4


@pytest.mark.parametrize("pieces", [4, 8, 16])
def test_column_of_beam_elements_buckles_at_euler_load(pieces):
    """At the Euler load pi^2 EI / 4 L^2 of a clamped column, the stiffness is zero.

    With n elements, the buckling load is lower by the fraction pi^2 / 24 n^2.
    """
    length, width, E = 1.0, 0.02, 70e9
    link = BeamLink({"width": width, "height": width}, E, 0.3, pieces=pieces)
    link = replace(link, theory="euler")
    posture = cantilever(length, link)
    euler = np.pi**2 * E * width**4 / 12 / (4 * length**2)

    def stiffness(load):
        answer = platform_stiffness(posture, "exact", [0, 0, 0, -load, 0, 0])
        return answer.along([0, 0, 0, 0, 1, 0])[0]

    critical = brentq(stiffness, 0.9 * euler, 1.1 * euler, rtol=1e-10)
    off = critical / euler - 1
    shortened = euler / (E * width**2)  # axial compression of the column
    left = off + np.pi**2 / (24 * pieces**2)
    assert abs(left) < 1.1 * shortened + 0.35 / pieces**4


def bauchau(pieces):
    """Return a four-bar mechanism whose hinge C is tilted by 5 degrees."""
    E, nu = 207e9, 0.3
    G = E / (2 * (1 + nu))

    def bar(EA, GA, GJ, EI):
        shear = GA * E / (G * EA)
        section = {"area": EA / E, "I_y": EI / E, "I_z": EI / E, "J": GJ / G,
                   "shear_y": shear, "shear_z": shear}  # fmt: skip
        return BeamLink(section, E, nu, up=(0, 0, 1), pieces=pieces)

    thick = bar(52.99e6, 16.88e6, 733.5, 1131.0)
    thin = bar(13.25e6, 4.22e6, 45.84, 70.66)
    tilt = np.array([np.radians(5), 0, 0, 0, 0, 0])
    frames = (
        Frame("crank", joint="revolute", actuated=True),
        Frame("B", "crank", [0, 0.12, 0], joint="revolute", link=thick),
        Frame("C", "B", [0.24, 0, 0], joint="revolute", link=thick,
              geometric_error=tilt),
        Frame("end_a", "C", geometric_error=-tilt),
        Frame("D", translation=[0.24, 0, 0], joint="revolute"),
        Frame("end_b", "D", [0, 0.12, 0], link=thin),
    )  # fmt: skip
    return Robot("bauchau", "end_a", frames, (("end_a", "end_b"),))


def assert_published(row, solve, pieces, in_plane, across):
    """Check relative errors of the displacement of hinge C in plane and across it."""
    angle, *published = row
    posture = place_robot(bauchau(pieces), joints={"crank": -angle})
    answer = solve(posture)
    moved = posture.platform[:3, 3] - [0.24, 0.12, 0] + answer.platform_screw[3:]
    off = 1e3 * moved - published
    assert np.linalg.norm(off[:2]) < in_plane * np.linalg.norm(published[:2])
    assert abs(off[2]) < across * abs(published[2])


@pytest.mark.parametrize(
    ("pieces", "in_plane", "across"), [(1, 7e-3, 5e-3), (16, 1e-4, 1e-3)]
)
def test_four_bar_with_tilted_hinge_has_published_deflections(pieces, in_plane, across):
    """With 16 elements, deflections agree to 1e-4 in plane and 0.1 % out of plane."""
    for row in BAUCHAU:
        assert_published(row, solve_exact, pieces, in_plane, across)


@pytest.mark.exudyn
@pytest.mark.parametrize("row", BAUCHAU)
def test_simulated_four_bar_with_tilted_hinge_has_published_deflections(row):
    """Deflections agree to 1e-4 in plane and 0.1 % out of plane."""
    model = SimulationModel(links="beam", elements=8)
    solve = partial(simulate_assembly, model=model)
    assert_published(row, solve, 1, 1e-4, 1e-3)
