"""Tests of the peak stress of beams."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from forcefit.inputs.table import BadInput
from forcefit.stiffness.beam.beam_stress import peak_beam_stress, section_stress
from forcefit.stiffness.beam.sections import declared_section

BAR = {"radius": 0.04}
TUBE = {"radius": 0.04, "inner_radius": 0.034}
PLATE = {"width": 0.02, "height": 0.05}
BOX = {"width": 0.06, "height": 0.04, "wall": 0.004}
SECTIONS = [BAR, TUBE, PLATE, BOX]


def constants(section):
    return declared_section(section, 0.3)


@pytest.mark.parametrize("section", SECTIONS)
def test_tensile_stress_equals_force_over_area(section):
    stress, _ = peak_beam_stress(section, 0.4, [0, 0, 0, -500.0, 0, 0])
    assert stress == pytest.approx(500 / constants(section).area, rel=1e-14)


@pytest.mark.parametrize(("section", "modulus_y", "modulus_z"), [
    (BAR, np.pi * 0.04**3 / 4, np.pi * 0.04**3 / 4),
    (TUBE, *[np.pi * (0.04**4 - 0.034**4) / (4 * 0.04)] * 2),
    (PLATE, 0.02 * 0.05**2 / 6, 0.05 * 0.02**2 / 6),
    (
        BOX,
        (0.06 * 0.04**3 - 0.052 * 0.032**3) / (6 * 0.04),
        (0.04 * 0.06**3 - 0.032 * 0.052**3) / (6 * 0.06),
    ),
])  # fmt: skip
def test_bending_stress_equals_moment_over_section_modulus(
    section, modulus_y, modulus_z
):
    """In a long beam, shear increases the stress by a factor of less than 1 + 3e-4."""
    for moment, modulus in ([7.0, 0.0], modulus_y), ([0.0, 7.0], modulus_z):
        stress, _ = peak_beam_stress(section, 0.0, [0, *moment, 0, 0, 0])
        assert stress == pytest.approx(7 / modulus, rel=1e-12)
    for force, modulus in ([0.0, 10.0], modulus_y), ([10.0, 0.0], modulus_z):
        stress, where = peak_beam_stress(section, 3.0, [0, 0, 0, 0, *force])
        assert stress == pytest.approx(30 / modulus, rel=3e-4)
        assert where[0] == 0.0


@pytest.mark.parametrize(("section", "shape"), [
    (BAR, 4 / 3),  # Gere: 4 V / 3 A
    (TUBE, 4 / 3 * (0.04**2 + 0.04 * 0.034 + 0.034**2) / (0.04**2 + 0.034**2)),
    ({"radius": 0.04, "inner_radius": 0.03999}, 2.0),  # thin tube: 2 V / A
    (PLATE, 1.5),  # 3 V / 2 A
])  # fmt: skip
def test_peak_stress_under_shear_alone_equals_textbook_values(section, shape):
    """The tolerance of 2.5e-4 is the error of the formula for a thin tube."""
    thin = 3e-4 if shape == 2.0 else 1e-12
    for axis in (4, 5):
        wrench = np.zeros(6)
        wrench[axis] = 1.0
        stress, where = peak_beam_stress(section, 0.0, wrench)
        expected = np.sqrt(3) * shape / constants(section).area
        assert stress == pytest.approx(expected, rel=thin)
        assert where[axis - 3] == pytest.approx(0, abs=1e-12)


def test_shear_stress_of_a_box_equals_textbook_formula():
    """Gere's formula is V (b h^2 - b1 h1^2) / 8 I t, where t is twice the wall
    thickness."""
    b, h, b1, h1 = 0.06, 0.04, 0.052, 0.032
    second = (b * h**3 - b1 * h1**3) / 12
    expected = np.sqrt(3) * (b * h**2 - b1 * h1**2) / (8 * second * 0.008)
    stress, where = peak_beam_stress(BOX, 0.0, [0, 0, 0, 0, 0, 1.0])
    assert stress == pytest.approx(expected, rel=1e-12)
    assert np.abs(where[1:]) == pytest.approx([0.03, 0.0], abs=1e-12)


@pytest.mark.parametrize("section", [BAR, TUBE])
def test_torsional_stress_of_a_round_beam_equals_textbook_formula(section):
    second = np.pi / 2 * (0.04**4 - section.get("inner_radius", 0) ** 4)
    stress, _ = peak_beam_stress(section, 0.3, [-3.0, 0, 0, 0, 0, 0])
    assert stress == pytest.approx(np.sqrt(3) * 3 * 0.04 / second, rel=1e-12)


@pytest.mark.parametrize(
    ("ratio", "k"),
    [(1.0, 0.208), (1.5, 0.231), (2.0, 0.246), (3.0, 0.267), (5.0, 0.291), (10, 0.312)],
)
def test_torsional_stress_of_a_rectangle_equals_textbook_values(ratio, k):
    """The stress in the middle of the long side is T / (k b a^2). Tabulated values of k
    have three digits."""
    for sides in ((0.02, 0.02 * ratio), (0.02 * ratio, 0.02)):
        section = dict(zip(("width", "height"), sides, strict=True))
        stress, where = peak_beam_stress(section, 0.3, [1.0, 0, 0, 0, 0, 0])
        expected = np.sqrt(3) / (k * 0.02 * ratio * 0.02**2)
        assert stress == pytest.approx(expected, rel=0.5e-3 / k)
        assert np.abs(where[1:]).max() <= 0.01 * max(1.0, 1e-9 + ratio * (ratio == 1))


@pytest.mark.parametrize("section", [PLATE, {"width": 0.05, "height": 0.02}])
def test_stresses_of_a_rectangle_integrate_to_the_forces(section):
    """The stresses are integrated by Simpson's rule. The tolerance for torsion is 5e-4,
    because the shear stress is not smooth at the short sides.
    """
    fibres, influence = section_stress(section)
    y, z = fibres.reshape(33, 33, 2).transpose(2, 0, 1)
    sigma, tau_y, tau_z = influence.reshape(33, 33, 3, 6).transpose(2, 3, 0, 1)
    weight = np.tile([4.0, 2.0], 17)[:-1] / 3
    weight = np.r_[1 / 3, weight[:31], 1 / 3]
    cell = np.outer(weight, weight) * np.ptp(y) * np.ptp(z) / 32**2
    for stress, forces in (
        (y * tau_z - z * tau_y, [1, 0, 0, 0, 0, 0]),
        (z * sigma, [0, 1, 0, 0, 0, 0]),
        (-y * sigma, [0, 0, 1, 0, 0, 0]),
        (sigma, [0, 0, 0, 1, 0, 0]),
        (tau_y, [0, 0, 0, 0, 1, 0]),
        (tau_z, [0, 0, 0, 0, 0, 1]),
    ):
        total = (stress * cell).sum(axis=(1, 2))
        np.testing.assert_allclose(total, forces, atol=5e-4)
    most = np.abs(tau_z[0]).max()
    # the truncated terms of the series are largest on the short sides
    np.testing.assert_allclose(
        tau_y[0][np.abs(y) == np.abs(y).max()], 0, atol=5e-3 * most
    )
    np.testing.assert_allclose(
        tau_z[0][np.abs(z) == np.abs(z).max()], 0, atol=5e-3 * most
    )


def membrane(section, cells):
    """Return the torsion constant [m^4] of a hollow rectangle, and the shear stresses
    in the middle of the right and the upper side for unit torque [1/m^3]. Prandtl's
    membrane analogy is solved by finite volumes.
    """
    size = section["wall"] / cells
    count = [round(section[k] / size) for k in ("width", "height")]
    hole = np.zeros(count, dtype=bool)
    hole[cells:-cells, cells:-cells] = True
    stiff = np.where(hole, 1e7, 1.0)
    index = np.arange(hole.size).reshape(count)
    diagonal, rows, columns, values = np.zeros(hole.size), [], [], []
    for axis in (0, 1):
        one, other = (np.delete(index, k, axis=axis) for k in (-1, 0))
        a, b = stiff.ravel()[one], stiff.ravel()[other]
        share = 2 * a * b / (a + b)
        rows += [one.ravel(), other.ravel()]
        columns += [other.ravel(), one.ravel()]
        values += [-share.ravel()] * 2
        for place in (one, other):
            np.add.at(diagonal, place.ravel(), share.ravel())
        for end in (0, -1):
            np.add.at(diagonal, np.take(index, end, axis=axis), 2.0)
    rows.append(index.ravel())
    columns.append(index.ravel())
    values.append(diagonal)
    matrix = coo_array((
        np.concatenate(values),
        (np.concatenate(rows), np.concatenate(columns)),
    ))
    phi = spsolve(matrix.tocsc(), np.full(hole.size, 2 * size**2)).reshape(count)
    J = 2 * phi.sum() * size**2
    # the derivative at the face, of a parabola through the face and two cells, is (9 f1
    # - f2) / 3 size
    middle = [n // 2 for n in count]
    right = (9 * phi[-1, middle[1]] - phi[-2, middle[1]]) / (3 * size)
    upper = (9 * phi[middle[0], -1] - phi[middle[0], -2]) / (3 * size)
    return J, right / J, upper / J


@pytest.mark.parametrize("wall", [0.004, 0.002])
def test_torsion_of_a_box_agrees_with_the_membrane_analogy(wall):
    """Bredt's theory neglects the corners, which contribute 2 to 4 % of the torsion
    constant."""
    section = BOX | {"wall": wall}
    J, right, upper = membrane(section, 8)
    stress, _ = peak_beam_stress(section, 0.2, [1.0, 0, 0, 0, 0, 0])
    tolerance = 0.4 * wall / 0.04
    assert constants(section).J == pytest.approx(J, rel=tolerance)
    assert stress / np.sqrt(3) == pytest.approx(max(right, upper), rel=tolerance)


def test_peak_stress_of_a_crank_combines_bending_and_torsion():
    """At the base, sigma is 32 M / pi d^3 and tau is 16 T / pi d^3 (Gere)."""
    stress, where = peak_beam_stress({"radius": 0.02}, 0.3, [30.0, 0, 0, 0, 0, 400.0])
    sigma, tau = 32 * 120 / (np.pi * 0.04**3), 16 * 30 / (np.pi * 0.04**3)
    assert stress == pytest.approx(np.sqrt(sigma**2 + 3 * tau**2), rel=1e-3)
    assert where == pytest.approx([0, 0, 0.02], abs=2e-3)


def test_peak_stress_is_at_the_tip_if_the_base_moment_is_zero():
    """The moment of the tip force and the tip moment cancel at the base."""
    stress, where = peak_beam_stress(BAR, 0.5, [0, 50.0, 0, 0, 0, 100.0])
    assert where[0] == 0.5
    assert stress == pytest.approx(50 / (np.pi * 0.04**3 / 4), rel=1e-3)


@pytest.mark.parametrize(("section", "length", "wrench", "message"), [
    ({"area": 1e-3, "I_y": 1e-8, "I_z": 1e-8, "J": 1e-8}, 0.1, np.zeros(6),
     "whose outline is unknown"),
    (PLATE | {"web": 0.002, "flange": 0.002}, 0.1, np.zeros(6),
     "found a section of width, height, web, flange"),
    ({}, 0.1, np.zeros(6), "found a section of nothing"),
    ({"radius": -1.0}, 0.1, np.zeros(6), "radius = -1"),
    (BOX | {"wall": 0.02}, 0.1, np.zeros(6), "expected less than half"),
    (BAR, -1.0, np.zeros(6), "length = -1 must be >= 0"),
    (BAR, 0.1, np.zeros(5), r"wrench has shape \(5,\)"),
    (BAR, 0.1, np.full(6, np.nan), "finite numbers"),
])  # fmt: skip
def test_invalid_stress_input_is_rejected(section, length, wrench, message):
    with pytest.raises(BadInput, match=message):
        peak_beam_stress(section, length, wrench)


# [N] weight along -z
W, LENGTH = 30.0, 0.8
SUPPORTS = {
    "free": ([0.0] * 6, W * LENGTH / 2, 0.0),
    "pinned at both ends": ([0, 0, 0, 0, 0, W / 2], W * LENGTH / 8, LENGTH / 2),
    "propped": ([0, 0, 0, 0, 0, 3 * W / 8], W * LENGTH / 8, 0.0),
    "clamped at both ends": (
        [0, W * LENGTH / 12, 0, 0, 0, W / 2], W * LENGTH / 12, None,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SUPPORTS)
def test_peak_stress_of_a_heavy_beam_equals_textbook_values(name):
    """The largest moments are q L^2 divided by 2, 8, 8 and 12 (Timoshenko, Strength of
    Materials I)."""
    wrench, moment, place = SUPPORTS[name]
    stress, where = peak_beam_stress(PLATE, LENGTH, wrench, [0, 0, -W])
    sigma = 6 * moment / (0.02 * 0.05**2)
    # shear stresses are zero at the outer fibres, where the bending stress is largest
    assert stress == pytest.approx(sigma, rel=1e-12)
    if place is not None:
        assert where[0] == pytest.approx(place, abs=1e-12)


@pytest.mark.parametrize("section", SECTIONS)
def test_peak_stress_of_a_heavy_beam_is_that_of_one_of_its_parts(section, rng):
    """The outer part exerts a wrench on the tip of the inner part."""
    for _ in range(20):
        wrench, weight = rng.normal(size=6) * [1, 1, 1, 20, 20, 20], rng.normal(size=3)
        weight *= 30
        cut = rng.uniform(0.1, 0.9) * LENGTH
        share = 1 - cut / LENGTH
        at_cut = wrench.copy()
        at_cut[3:] += share * weight
        arm = [LENGTH - cut, 0, 0]
        at_cut[:3] += np.cross(arm, wrench[3:] + share * weight / 2)
        outer, _ = peak_beam_stress(section, LENGTH - cut, wrench, share * weight)
        inner, _ = peak_beam_stress(section, cut, at_cut, (1 - share) * weight)
        whole, _ = peak_beam_stress(section, LENGTH, wrench, weight)
        # the evaluated sections limit the error to 1e-3
        assert whole == pytest.approx(max(outer, inner), rel=1e-3)


@pytest.mark.parametrize("section", [
    {"width": 0.03, "height": 0.05}, {"width": 0.05, "height": 0.03},
    {"width": 0.03, "height": 0.05, "wall": 0.004},
    {"width": 0.05, "height": 0.03, "wall": 0.002},
])  # fmt: skip
@pytest.mark.parametrize("length", [0.0, 0.02, 1.0])
def test_rotating_section_and_wrench_rotates_the_peak_position(section, length):
    """Axes y and z become z and -y. The beams are short, so that shear matters."""
    rng = np.random.default_rng(9)
    turned = section | {"width": section["height"], "height": section["width"]}
    quarter = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    wrenches = rng.normal(size=(200, 6)) * [0.02, 0.01, 0.01, 0.3, 1, 1]
    stress, where = peak_beam_stress(section, length, wrenches)
    moved = wrenches @ np.kron(np.eye(2), quarter).T
    same, there = peak_beam_stress(turned, length, moved)
    np.testing.assert_allclose(same, stress, rtol=1e-9)
    # if two fibres have equal stresses, either of them can be the peak
    alike = np.linalg.norm(there - where @ quarter.T, axis=1) < 1e-9
    assert alike.mean() > 0.9
    sides = {tuple(np.sign(np.round(place[1:], 9))) for place in where}
    assert len(sides) >= 4
