"""Joint clearances, compared with hand calculations, sampling and other solvers.

The hand calculations use the displacement of the axis at height z,
``e(z) = (TX + z RY, TY - z RX)``.
"""

import numpy as np
import pytest

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.closure import linearise
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.pose_error import reachable_screws
from forcefit.assembly.statistics.clearance_positions import position_clearances
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.validation.assumptions.bushes import solve_bushes
from forcefit.validation.crosscheck.crosscheck import crosscheck
from forcefit.validation.crosscheck.pair import scaled

C, L = 10e-6, 40e-3  # [m]
BORE = 'radial = "10 um", length = "40 mm"'
GUIDE = "guide = { gap = 1e-5, length = 0.08, width = 0.04, height = 0.03 }"
PAD = "pad = { gap = 1e-5, length = 0.06, width = 0.04 }"


@pytest.fixture
def one_joint(tmp_path):
    """Return a function that reads a robot with one joint."""

    def read(kind, clearance, at=(0, 0, 0), keys="axis = [0, 0, 1]", reverse=False):
        ends = ("table", "base") if reverse else ("base", "table")
        if clearance and not clearance.startswith("["):
            clearance = f"{{ {clearance} }}"
        given = f"clearance = {clearance}" if clearance else ""
        file = tmp_path / "one.toml"
        file.write_text(f"""
            format = 2
            platform = "table"
            platform_at = {[float(x) for x in at]}
            [[body]]
            name = "table"
            [[joint]]
            name = "j"
            type = "{kind}"
            between = ["{ends[0]}", "{ends[1]}"]
            at = [0, 0, 0]
            {keys}
            {given}
        """)
        return home_posture(read_robot(file))

    return read


def reach(posture):
    """Return the lower and upper bound of the largest translation error [m]."""
    found = bound_pose_error(solve_assembly(posture), tolerance_translation=1e-9)
    return found.translation_error


def heights(posture, directions):
    """Return the support function of the reachable screws for wrenches, (k, 6)."""
    reachable = reachable_screws(solve_assembly(posture), "frozen")
    return np.array([reachable.support(w).height for w in np.array(directions)])


@pytest.mark.parametrize("kind", ["revolute", "cylindrical"])
@pytest.mark.parametrize(("height", "expected"), [
    (0.0, 10e-6), (0.02, 10e-6), (0.1, 50e-6), (-0.1, 50e-6)
])  # fmt: skip
def test_displacement_of_a_shaft_in_a_bore_equals_hand_calculation(
    kind, height, expected, one_joint
):
    """The displacement of the axis at height h is at most c max(1, 2 |h| / L)."""
    posture = one_joint(kind, BORE, [0, 0, height])
    if kind == "revolute":
        assert reach(posture) == pytest.approx(expected, abs=1e-9)
    for angle in (0.0, 0.7, 2.0):
        across = [0, 0, 0, np.cos(angle), np.sin(angle), 0]
        assert heights(posture, [across])[0] == pytest.approx(expected, rel=1e-7)


def bore_support(w, c=C, length=L):
    """Return the support function for |e(L/2)| <= c and |e(-L/2)| <= c."""
    force, moment = w[3:5], np.array([w[1], -w[0]])
    ends = force / 2 + moment / length, force / 2 - moment / length
    return c * sum(np.linalg.norm(end) for end in ends)


@pytest.mark.parametrize("reverse", [False, True])
def test_reachable_screws_of_a_bore_equal_hand_calculation(reverse, one_joint, rng):
    """The support function, the volume and random screws are compared."""
    wrenches = rng.normal(size=(40, 6)) * [1 / L, 1 / L, 0, 1, 1, 0]
    posture = one_joint("revolute", BORE, reverse=reverse)
    found = heights(posture, wrenches)
    np.testing.assert_allclose(found, [bore_support(w) for w in wrenches], rtol=1e-7)
    # the volume is (pi c^2)^2 / L^2
    answer = solve_assembly(posture)
    to_screw = linearise(posture).platform @ answer.joints.cones
    volume = np.pi**2 * abs(np.linalg.det(to_screw[[0, 1, 3, 4]]))
    assert volume == pytest.approx((np.pi * C**2) ** 2 / L**2, rel=1e-12)
    drawn = rng.uniform(-1, 1, size=(200_000, 4)) * [2 * C / L, 2 * C / L, C, C]
    tilt, shift = drawn[:, :2], drawn[:, 2:]
    apart = np.hypot(*tilt.T) <= 2 * C / L
    apart &= np.hypot(*shift.T) <= C
    turned = np.stack([tilt[:, 1], -tilt[:, 0]], axis=1) * L / 2
    inside = np.maximum(*(np.hypot(*(shift + s * turned).T) for s in (1, -1))) <= C
    assert inside.sum() / apart.sum() == pytest.approx(0.25, abs=0.005)
    screws = np.zeros((inside.sum(), 6))
    screws[:, [0, 1, 3, 4]] = drawn[inside]
    assert ((screws @ wrenches.T) <= found * (1 + 1e-7)).all()


def test_largest_displacement_in_a_bore_agrees_with_finite_geometry(one_joint):
    """The axis is a straight line through points on the circles at both ends."""
    angles = np.linspace(0, 2 * np.pi, 61)
    rim = C * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    low, high = (np.insert(rim, 2, z, axis=1) for z in (-L / 2, L / 2))
    along = high[None] - low[:, None]
    middle, unit = (
        (high[None] + low[:, None]) / 2,
        along / np.linalg.norm(along, axis=2, keepdims=True),
    )
    for height in (0.0, 0.03, 0.1):
        off = middle + height * unit - [0, 0, height]
        found = reach(one_joint("revolute", BORE, [0, 0, height]))
        assert np.linalg.norm(off, axis=2).max() == pytest.approx(found[1], rel=2e-4)


BEARINGS = (
    'bearings = [{ z = "-20 mm", radial = "10 um" }, { z = "60 mm", radial = "5 um" }]'
)


@pytest.mark.parametrize("reverse", [False, True])
def test_displacement_of_a_shaft_in_two_bearings_equals_hand_calculation(
    reverse, one_joint
):
    """The displacement is linear in h and limited to 10 um and 5 um in the bearings."""
    for h, expected in ((-0.02, 10e-6), (0.06, 5e-6), (0.14, 20e-6), (-0.1, 25e-6)):
        posture = one_joint("cylindrical", BEARINGS, [0, 0, h], reverse=reverse)
        for direction in ([1, 0], [0.6, 0.8]):
            found = heights(posture, [[0, 0, 0, *direction, 0]])[0]
            assert found == pytest.approx(expected, rel=1e-7)


def test_axial_and_spin_bounds_of_a_bore_are_independent(one_joint):
    posture = one_joint("revolute", BORE + ', axial = "5 um", spin = "1 mrad"')
    along, turn = heights(posture, [[0, 0, 0, 0, 0, 1], [0, 0, 1, 0, 0, 0]])
    assert along == pytest.approx(5e-6, rel=1e-7)
    assert turn == pytest.approx(1e-3, rel=1e-7)


def test_spin_bound_limits_rotation_in_a_round_guide(one_joint):
    """A gap of 20 um at a radius of 20 mm limits the rotation about z to 1 mrad."""
    posture = one_joint("prismatic", BORE + ", spin = 1e-3")
    turn, aside = heights(posture, [[0, 0, 1, 0, 0, 0], [0, 0, 0, 0.6, 0.8, 0]])
    assert turn == pytest.approx(1e-3, rel=1e-7)
    assert aside == pytest.approx(C, rel=1e-7)
    assert mobility(posture).freedoms == 1


@pytest.mark.parametrize("driven", [False, True])
def test_clearance_of_a_nut_with_bore_equals_hand_calculation(driven, one_joint):
    """The axial clearance is |TZ - h RZ| <= 25 um with the lead h = 4 mm / (2 pi)."""
    keys = 'axis = [0, 0, 1]\npitch = "4 mm"'
    keys += "\nactuated = true" if driven else ""
    text = BORE + ', axial = "25 um"'
    posture = one_joint("helical", text, [0, 0, 0.1], keys)
    along_thread = [0, 0, -4e-3 / (2 * np.pi), 0, 0, 1]
    found = heights(posture, [along_thread, [0, 0, 0, 0.6, 0.8, 0]])
    np.testing.assert_allclose(found, [25e-6, 50e-6], rtol=1e-7)
    assert mobility(posture).drives == driven


def test_driven_joint_with_contacts_has_one_driven_frame(one_joint):
    keys = "axis = [0, 0, 1]\nactuated = true\nposition = 0.1\nlimits = [0, 1]"
    for text in (BORE, GUIDE):
        posture = one_joint("prismatic", text, keys=keys)
        assert mobility(posture).drives == 1
        assert [f.name for f in posture.robot.frames if f.actuated] == ["j"]
        assert [f.name for f in posture.robot.frames if f.limits] == ["j"]
        assert mobility(posture).freedoms == 1


@pytest.mark.parametrize("axis2", [[0, 1, 0], [1, 1, 0]])
def test_clearances_of_universal_joint_bearings_add_up(axis2, one_joint):
    """The clearances are 20 um along each axis and 1.33 mrad about the normal."""
    clearance = 'radial = "10 um", axial = "10 um", length = "30 mm"'
    keys = f"axis = [1, 0, 0]\naxis2 = {axis2}"
    posture = one_joint("universal", clearance, keys=keys)
    a1, a2 = np.array([1.0, 0, 0]), np.array(axis2) / np.linalg.norm(axis2)
    n = np.cross(a1, a2) / np.linalg.norm(np.cross(a1, a2))
    normal, about = heights(posture, [[0, 0, 0, *n], [*n, 0, 0, 0]])
    assert normal == pytest.approx(20e-6, rel=1e-7)
    assert about == pytest.approx(4 * 10e-6 / 30e-3, rel=1e-7)
    for along, other in ((a1, a2), (a2, a1)):
        # axial and radial clearance of the other bearing, projected on this direction
        c = abs(along @ other)
        expected = 10e-6 * (1 + c + np.sqrt(1 - c**2))
        found = heights(posture, [[0, 0, 0, *along]])[0]
        assert found == pytest.approx(expected, rel=1e-7)


def test_ball_joint_has_clearance_in_all_directions(one_joint, rng):
    posture = one_joint("spherical", 'ball = "10 um"', keys="")
    assert reach(posture) == pytest.approx(C, abs=1e-9)
    directions = rng.normal(size=(10, 3))
    found = heights(posture, [[0, 0, 0, *d] for d in directions])
    np.testing.assert_allclose(found, C * np.linalg.norm(directions, axis=1), rtol=1e-7)
    assert mobility(posture).freedoms == 3


def test_guide_has_different_gaps_along_x_and_y(one_joint):
    """The gaps are 10 um along x, which is the direction of ``axis2``, and 4 um."""
    text = GUIDE.replace("1e-5", '["10 um", "4 um"]')
    keys = "axis = [0, 0, 1]\naxis2 = [0, 1, 0]"
    posture = one_joint("prismatic", text, keys=keys)
    expected = [0.25e-3, 0.1e-3, 0.2e-3, 4e-6, 10e-6]
    found = heights(posture, np.eye(6)[:5])
    np.testing.assert_allclose(found, expected, rtol=1e-7)


@pytest.mark.parametrize(("kind", "clearance"), [
    ("revolute", BORE), ("cylindrical", BORE), ("universal", BORE),
    ("spherical", 'ball = "10 um"'), ("prismatic", GUIDE), ("planar", PAD),
    ("revolute", BEARINGS),
])  # fmt: skip
def test_mobility_does_not_depend_on_contacts(kind, clearance, one_joint, tmp_path):
    """The mobility is preserved if the robot is written to a file with frames."""
    keys = "axis = [0, 0, 1]\naxis2 = [0, 1, 0]"
    bare, own = (mobility(one_joint(kind, text, keys=keys)) for text in ("", clearance))
    assert vars(bare) == vars(own)
    posture = one_joint(kind, clearance, [0, 0, 0.1], keys)
    write_robot(posture.robot, tmp_path / "frames.toml")
    again = read_robot(tmp_path / "frames.toml")
    frames = zip(again.frames, posture.robot.frames, strict=True)
    assert all(a.clearance == b.clearance for a, b in frames)
    change = home_posture(again).transforms - posture.transforms
    assert np.abs(change).max() == 0.0


@pytest.fixture
def held_shaft(tmp_path):
    """Return a function that reads a loop of a spring, a bore and an error."""

    def read(error, clearance):
        file = tmp_path / "held.toml"
        file.write_text(f"""
            format = 2
            platform = "shaft"
            platform_at = [0, 0, 0]
            [[body]]
            name = "bush"
            [[body]]
            name = "shaft"
            [[joint]]
            name = "spring"
            type = "fixed"
            between = ["base", "bush"]
            at = [0, 0, 0]
            joint_stiffness = {STIFFNESS}
            [[joint]]
            name = "bore"
            type = "revolute"
            between = ["bush", "shaft"]
            at = [0, 0, 0]
            axis = [0, 0, 1]
            clearance = {{ {clearance} }}
            [[joint]]
            name = "mount"
            type = "fixed"
            between = ["shaft", "base"]
            at = [0, 0, 0]
            geometric_error = {[float(x) for x in error]}
        """)
        return home_posture(read_robot(file))

    return read


STIFFNESS = [2e3, 3e3, 1e3, 2e6, 1e6, 4e6]


@pytest.mark.parametrize("seed", range(4))
def test_energy_of_a_pin_in_a_bore_agrees_with_cvxpy(seed, held_shaft):
    """The energy is the minimum of v K v / 2 with v + clearance + error = 0."""
    import cvxpy as cp

    rng = np.random.default_rng(seed)
    error = rng.normal(size=6) * [1e-3, 1e-3, 1e-3, 2e-5, 2e-5, 2e-5]
    v, c = cp.Variable(6), cp.Variable(6)  # [mrad, um]
    unit = np.array([1e-3] * 3 + [1e-6] * 3)
    offsets = [
        cp.hstack([c[3] + z * c[1], c[4] - z * c[0]]) for z in (20.0, -20.0)  # [mm]
    ]  # fmt: skip
    within = [cp.norm(e) <= 10 for e in offsets]
    within += [cp.abs(c[5]) <= 5, v + c + error / unit == 0]
    root = np.sqrt(np.array(STIFFNESS)) * unit * 1e3
    problem = cp.Problem(cp.Minimize(cp.sum_squares(cp.multiply(root, v)) / 2), within)
    problem.solve(solver=cp.CLARABEL, tol_gap_rel=1e-11, tol_feas=1e-11)
    found = solve_assembly(held_shaft(error, BORE + ', axial = "5 um"'))
    assert found.energy == pytest.approx(problem.value * 1e-6, rel=1e-6)


def test_energy_of_a_bore_equals_that_of_two_bushes(held_shaft, rng):
    """The bushes at +-20 mm have a radial clearance of 10 um."""
    for _ in range(4):
        error = rng.normal(size=6) * [1e-3, 1e-3, 1e-3, 2e-5, 2e-5, 2e-5]
        bushes = solve_bushes(held_shaft(error, 'radial = "10 um", tilt = "0.5 mrad"'))
        found = solve_assembly(held_shaft(error, BORE))
        assert found.energy == pytest.approx(bushes.energy, rel=1e-7)


@pytest.mark.exudyn
def test_multibody_simulation_of_a_bore_agrees(held_shaft):
    """The multibody simulation includes finite rotations of the contact frames."""
    error = [4e-3, -7e-3, 2e-3, 9e-5, -6e-5, 7e-5]
    check = crosscheck(held_shaft(error, BORE), (1.0, 0.5, 0.25), clearances=True)
    assert check.passed, check.checks


@pytest.mark.parametrize("clearance", [BORE, 'ball = "10 um"'])
def test_exact_methods_agree_for_bore_and_ball(clearance, held_shaft):
    posture = held_shaft([4e-3, -7e-3, 2e-3, 90e-6, -60e-6, 70e-6], clearance)
    one, other = (solve_exact(posture, method=m) for m in ("compiled", "reference"))
    assert one.energy == pytest.approx(other.energy, rel=1e-9)
    np.testing.assert_allclose(
        one.clearance_screws, other.clearance_screws, rtol=1e-6, atol=1e-9
    )


@pytest.mark.parametrize("clearance", [BORE, 'ball = "10 um"'])
def test_exact_solution_with_contacts_differs_by_second_order(clearance, held_shaft):
    """If errors and clearances are scaled by s, the difference is O(s^2)."""
    error = np.array([4e-3, -7e-3, 2e-3, 90e-6, -60e-6, 70e-6])
    posture, sizes = held_shaft(error, clearance), []
    for scale in (1.0, 0.5, 0.25):
        found = solve_exact(scaled(posture, scale))
        assert found.clearance_excess() < 1e-9
        assert found.closure_residual() < 1e-12
        screw = found.platform_screw - found.linear.platform_screw
        sizes.append(np.linalg.norm(screw * ([1e-3] * 3 + [1.0] * 3)))
    slopes = np.diff(np.log(sizes)) / np.log(0.5)
    np.testing.assert_allclose(slopes, 2.0, atol=0.1)


def drawn_positions(posture, model, count=3000):
    """Return random platform screws for a clearance model, (count, 6)."""
    prepared = linear_response(posture)
    draws = prepared.solve(np.zeros((count, len(posture.robot.frames), 6)))
    rngs = [np.random.default_rng([5, k]) for k in range(count)]
    screws, mixed = position_clearances(prepared, draws, model, rngs)
    assert mixed.all()
    return screws


def test_random_positions_in_a_ball_joint_are_uniform(one_joint):
    from scipy import stats

    at = drawn_positions(one_joint("fixed", 'ball = "10 um"'), "uniform")[:, 3:] / C
    radius = np.linalg.norm(at, axis=1)
    assert stats.kstest(radius**3, "uniform").pvalue > 1e-3
    assert stats.kstest(at[:, 2] / radius / 2 + 0.5, "uniform").pvalue > 1e-3


def test_contact_positions_of_a_ball_joint_are_uniform_on_sphere(one_joint):
    from scipy import stats

    at = drawn_positions(one_joint("fixed", 'ball = "10 um"'), "contact")[:, 3:] / C
    assert np.linalg.norm(at, axis=1) == pytest.approx(1.0, rel=1e-9)
    for x in at.T:
        assert stats.kstest(x / 2 + 0.5, "uniform").pvalue > 1e-3


def test_standard_deviations_in_a_bore_equal_hand_calculation(one_joint):
    """The standard deviations are c / (2 sqrt 2) and c / (sqrt 2 L).

    The magnitudes of tilt and shift have a correlation of -0.52.
    """
    at = drawn_positions(one_joint("fixed", BORE), "uniform")
    tilt, shift = at[:, :2], at[:, 3:5]
    np.testing.assert_allclose(shift.std(axis=0), C / np.sqrt(8), rtol=0.04)
    np.testing.assert_allclose(tilt.std(axis=0), C / (np.sqrt(2) * L), rtol=0.04)
    sizes = np.hypot(*tilt.T), np.hypot(*shift.T)
    assert np.corrcoef(*sizes)[0, 1] == pytest.approx(-0.52, abs=0.05)
