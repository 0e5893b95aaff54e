"""Clearances of guides and pads compared with explicit inequalities.

A guide of length L, width w and height t allows the small screws that satisfy

    |TX + s1 L/2 RY + s2 t/2 RZ| <= c_x,  |TY + s1 L/2 RX + s2 w/2 RZ| <= c_y

for s1, s2 = +-1.  A pad of 2A by 2B allows the octahedron |TZ| + B |RX| + A |RY| <= g.
In these tests, the inequalities are constraints of linear and convex programs, which
are solved by other solvers.
"""

from functools import partial

import numpy as np
import pytest
from scipy.optimize import linprog

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.closure import linearise
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.pose_error import reachable_screws
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.joint_names import joint_of
from forcefit.assembly.statistics.clearance_positions import position_clearances
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.validation.crosscheck.crosscheck import crosscheck
from forcefit.validation.crosscheck.pair import scaled
from tests.assembly.drawing.guides_for_tests import (
    G_PAD,
    GUIDE,
    PAD,
    A,
    B,
    C,
    L,
    W,
    Z,
    at,
    body,
    drawn_in,
    guide_slabs,
    joint,
    pad_slabs,
    support,
)  # fmt: skip

STIFFNESS = [2e4, 3e4, 1e4, 2e7, 1e7, 4e7]  # [N m/rad, N/m]


@pytest.fixture
def drawn(tmp_path):
    """Return a function that reads bodies and joints, the platform being "table"."""
    return partial(drawn_in, tmp_path)


def one_joint(drawn, kind, clearance, reverse=False, keys=Z):
    ends = ("table", "base") if reverse else ("base", "table")
    own = joint("j", kind, *ends, keys, f"clearance = {{ {clearance} }}")
    return home_posture(drawn(body("table"), own))


def heights(posture, directions):
    """Support function of the platform screws that clearances allow."""
    reachable = reachable_screws(solve_assembly(posture), "frozen")
    return np.array([reachable.support(w).height for w in np.array(directions)])


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize(("gap", "gaps"), [
    ("1e-5", (C, C)), ("[1e-5, 4e-6]", (C, 4e-6))
])  # fmt: skip
def test_a_guide_has_the_support_function_of_its_eight_slabs(
    gap, gaps, reverse, drawn, rng
):
    """The support function for 40 wrenches is computed by linear programming."""
    posture = one_joint(drawn, "prismatic", GUIDE.replace("1e-5", gap), reverse)
    wrenches = rng.normal(size=(40, 6)) * [L / 2, L / 2, W / 2, 1, 1, 0]
    expected = [support(w, guide_slabs(gaps)) for w in wrenches]
    np.testing.assert_allclose(heights(posture, wrenches), expected, rtol=1e-7)


@pytest.mark.parametrize("reverse", [False, True])
def test_a_pad_has_the_support_function_of_its_octahedron(reverse, drawn, rng):
    """max(|w_T|, |w_RX| / B, |w_RY| / A) g."""
    wrenches = rng.normal(size=(40, 6)) * [B, A, 0, 0, 0, 1]
    posture = one_joint(drawn, "planar", PAD, reverse)
    expected = G_PAD * (np.abs(wrenches[:, [0, 1, 5]]) / [B, A, 1]).max(axis=1)
    np.testing.assert_allclose(heights(posture, wrenches), expected, rtol=1e-7)


def positions(posture, screws):
    """Largest cone of each platform screw (k, 6): at most 1 inside the clearances."""
    lin, joints = linearise(posture), solve_assembly(posture).joints
    columns = np.hstack([joints.cones, joints.free])
    A_all = np.vstack([lin.rows, lin.platform]) @ columns
    right = np.hstack([np.zeros((len(screws), len(lin.rows))), screws])
    # rows and columns scaled, so that the solution is exact
    size = np.abs(A_all).max(axis=0)
    found = np.linalg.lstsq(A_all / size, right.T, rcond=1e-9)[0].T / size
    return np.abs(found[:, : joints.cones.shape[1]]).max(axis=1)


@pytest.mark.parametrize(("kind", "clearance", "slabs", "box"), [
    ("prismatic", GUIDE, guide_slabs(), [2.5e-4, 2.5e-4, 5e-4, C, C, 0]),
    ("planar", PAD, pad_slabs(), [G_PAD / B, G_PAD / A, 0, 0, 0, G_PAD]),
])  # fmt: skip
def test_every_small_screw_is_inside_exactly_if_it_is_inside_the_slabs(
    kind, clearance, slabs, box, drawn, rng
):
    """Screws are sampled in the bounding box, of which the octahedron is one sixth."""
    screws = rng.uniform(-1, 1, size=(200_000, 6)) * box
    inside = (np.abs(screws @ slabs.T) <= 1).all(axis=1)
    found = positions(one_joint(drawn, kind, clearance), screws) <= 1
    assert np.mean(found != inside) < 1e-4  # at the boundary rounding decides
    if kind == "planar":
        assert found.mean() == pytest.approx(1 / 6, abs=0.004)


def held(drawn, error, kind, clearance):
    """A block in a guide or on a pad; a spring and an error close the loop."""
    K = f"joint_stiffness = {STIFFNESS}"
    off = f"geometric_error = {[float(x) for x in error]}"
    return home_posture(drawn(
        body("carrier"), body("table"), joint("spring", "fixed", "base", "carrier", K),
        joint("j", kind, "carrier", "table", Z, f"clearance = {{ {clearance} }}"),
        joint("mount", "fixed", "table", "base", off),
    ))  # fmt: skip


def errors_of(seed):
    return np.random.default_rng(seed).normal(size=6) * ([1e-3] * 3 + [4e-5] * 3)


@pytest.mark.parametrize(("kind", "clearance", "slabs", "free"), [
    ("prismatic", GUIDE, guide_slabs(), [5]), ("planar", PAD, pad_slabs(), [2, 3, 4])
])  # fmt: skip
@pytest.mark.parametrize("seed", range(3))
def test_energy_of_a_forced_guide_equals_that_of_its_inequalities_solved_by_cvxpy(
    seed, kind, clearance, slabs, free, drawn
):
    """cvxpy minimises v K v / 2, where v + clearance + error closes the loop."""
    import cvxpy as cp

    error, unit = errors_of(seed), np.array([1e-3] * 3 + [1e-6] * 3)
    v, c = cp.Variable(6), cp.Variable(6)  # [mrad, um]
    across = [row for row in range(6) if not slabs[:, row].any() and row not in free]
    within = [cp.abs(slabs * unit @ c) <= 1, v + c + error / unit == 0, c[across] == 0]
    root = np.sqrt(np.array(STIFFNESS)) * unit * 1e3
    problem = cp.Problem(cp.Minimize(cp.sum_squares(cp.multiply(root, v)) / 2), within)
    problem.solve(solver=cp.CLARABEL, tol_gap_rel=1e-11, tol_feas=1e-11)
    posture = held(drawn, error, kind, clearance)
    found = solve_assembly(posture)
    assert problem.value > 0
    assert found.energy == pytest.approx(problem.value * 1e-6, rel=1e-6)
    assert solve_assembly(posture, method="reference").energy == pytest.approx(
        found.energy, rel=1e-8
    )


FEET = ((-0.15, 0.0, 0.0), (0.15, 0.02, 0.0))


def on_two_guides(drawn, error, *keys, passive=True):
    """A table on two parallel guides along z; the second has an error."""
    driven = () if passive else ("actuated = true",)
    slide = f"clearance = {{ {GUIDE} }}"
    off = f"geometric_error = {[float(x) for x in error]}"
    return home_posture(drawn(
        body("table"),
        joint("one", "prismatic", "base", "table", Z, slide, *driven, at=FEET[0]),
        joint("two", "prismatic", "base", "table", Z, slide, off, *keys, at=FEET[1]),
    ))  # fmt: skip


def two_guide_slabs():
    """(16, 6) rows on the table's screw at the origin."""
    return np.vstack([guide_slabs() @ np.linalg.inv(at(foot)) for foot in FEET])


@pytest.mark.parametrize("method", ["compiled", "reference"])
def test_margin_of_two_rigid_guides_equals_that_of_a_linear_programme(
    method, drawn, rng
):
    """The margin is the minimum t with |slabs (x - error)| <= t for both guides."""
    for _ in range(3):
        error = rng.normal(size=6) * ([4e-4] * 3 + [4e-5] * 3)
        error[5] = 0.0
        slabs, none = two_guide_slabs(), np.zeros((8, 6))
        shift = np.vstack([none, guide_slabs()]) @ error
        x = np.array([1e-4] * 3 + [1e-5] * 3)
        both = np.vstack([slabs * x, -slabs * x])
        both = np.hstack([both, -np.ones((len(both), 1))])
        least = linprog(
            np.eye(7)[6], both, np.concatenate([shift, -shift]), bounds=(None, None)
        )
        found = zone_margin(on_two_guides(drawn, error), method=method)
        assert found.margin == pytest.approx(least.fun, rel=1e-6)


def test_pose_errors_of_two_rigid_guides_equal_those_of_a_linear_programme(drawn, rng):
    """The table can reach all screws that are possible in both guides."""
    posture = on_two_guides(drawn, np.zeros(6), passive=False)
    slabs = two_guide_slabs()
    wrenches = rng.normal(size=(20, 6)) * [0.1, 0.1, 0.1, 1, 1, 0]
    held_z = np.array([[0, 0, 0, 0, 0, 1.0]])
    # the drive holds the first guide along z: no turn about x or y moves its point
    held_z = held_z @ np.linalg.inv(at(FEET[0]))
    expected = [support(w, slabs, held_z) for w in wrenches]
    np.testing.assert_allclose(heights(posture, wrenches), expected, rtol=1e-6)
    found = bound_pose_error(
        solve_assembly(posture), tolerance_translation=1e-9, tolerance_rotation=1e-9
    )
    # the largest of 400 random directions is about 0.05 rad off: 1 - 0.05^2 / 2
    sphere = rng.normal(size=(400, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    for (low, high), part in (
        (found.rotation_error, slice(0, 3)), (found.translation_error, slice(3, 6))
    ):  # fmt: skip
        wrench, reach = np.zeros(6), 0.0
        for direction in sphere:
            wrench[part] = direction
            reach = max(reach, support(wrench, slabs, held_z))
        assert reach <= high * (1 + 1e-6)
        assert reach >= low * (1 - 0.02)


def test_energy_of_two_guides_on_springs_equals_that_of_their_inequalities(drawn, rng):
    """The pair is overconstrained, and the errors exceed the gaps."""
    import cvxpy as cp

    K = np.array([2e4, 3e4, 1e4, 2e7, 1e7, 0.0])
    for _ in range(3):
        error = rng.normal(size=6) * [3e-4, 3e-4, 2e-4, 4e-5, 4e-5, 0]
        posture = on_two_guides(drawn, error, f"joint_stiffness = {K.tolist()}")
        unit = np.array([1e-3] * 3 + [1e-6] * 3)
        x, c, v = cp.Variable(6), cp.Variable(6), cp.Variable(6)  # [mrad, um]
        first, second = (np.linalg.inv(at(foot)) for foot in FEET)
        within = [cp.abs(guide_slabs() @ first * unit @ x) <= 1]
        within += [cp.abs(guide_slabs() * unit @ c) <= 1]
        local = cp.multiply(1 / unit, second * unit @ x)
        within += [(local - c - v - error / unit)[:5] == 0]
        root = np.sqrt(K) * unit * 1e3
        stored = cp.sum_squares(cp.multiply(root, v)) / 2
        problem = cp.Problem(cp.Minimize(stored), within)
        problem.solve(solver=cp.CLARABEL, tol_gap_rel=1e-11, tol_feas=1e-11)
        found = solve_assembly(posture)
        assert found.energy == pytest.approx(problem.value * 1e-6, rel=1e-6)


@pytest.mark.parametrize(("kind", "clearance"), [
    ("prismatic", GUIDE), ("planar", PAD)
])  # fmt: skip
def test_both_exact_methods_agree_on_a_forced_guide(kind, clearance, drawn):
    posture = held(drawn, 4 * errors_of(1), kind, clearance)
    one, other = (solve_exact(posture, method=m) for m in ("compiled", "reference"))
    assert one.energy == pytest.approx(other.energy, rel=1e-9)


@pytest.mark.parametrize(("kind", "clearance"), [
    ("prismatic", GUIDE), ("planar", PAD)
])  # fmt: skip
def test_finite_motions_of_a_guide_differ_from_small_ones_by_second_order(
    kind, clearance, drawn
):
    """With errors and clearances scaled by s, the energies differ by O(s^3)."""
    posture, changes = held(drawn, 4 * errors_of(1), kind, clearance), []
    for scale in (1.0, 0.5, 0.25):
        found = solve_exact(scaled(posture, scale))
        assert found.clearance_excess() < 1e-9
        assert found.closure_residual() < 1e-12
        changes.append(abs(found.energy - found.linear.energy))
    slopes = np.diff(np.log(changes)) / np.log(0.5)
    np.testing.assert_allclose(slopes, 3.0, atol=0.1)


@pytest.mark.exudyn
def test_crosscheck_of_a_guide_passes(drawn):
    """The simulation closes both chains of contacts by finite rotations."""
    posture = held(drawn, 4 * errors_of(1), "prismatic", GUIDE)
    check = crosscheck(posture, (1.0, 0.5, 0.25), clearances=True)
    assert check.passed, check.checks


def test_uniform_positions_on_a_pad_fill_the_octahedron_evenly(drawn):
    """Mean squares of TZ / g, B RX / g, A RY / g are 2 / (4 5) = 0.1."""
    posture = one_joint(drawn, "planar", PAD)
    screws = uniform_screws(posture, 1500)[:, [0, 1, 5]] / [G_PAD / B, G_PAD / A, G_PAD]
    assert np.abs(screws).sum(axis=1).max() <= 1 + 1e-9
    # a square has a variance of 24 6 / 5040 - 0.01 = 0.0186
    np.testing.assert_allclose((screws**2).mean(axis=0), 0.1, atol=4 * 0.0036)


def test_uniform_positions_in_a_guide_agree_with_rejection_sampling(drawn, rng):
    """Mean squares of the five small motions, against samples of the slabs."""
    found = uniform_screws(one_joint(drawn, "prismatic", GUIDE), 1500)[:, :5]
    box = np.array([2.5e-4, 2.5e-4, 5e-4, C, C])
    drawn_there = rng.uniform(-1, 1, size=(400_000, 5)) * box
    inside = (np.abs(drawn_there @ guide_slabs()[:, :5].T) <= 1).all(axis=1)
    one, other = ((part / box) ** 2 for part in (found, drawn_there[inside]))
    error = other.std(axis=0) / np.sqrt(len(one))
    assert (np.abs(one.mean(axis=0) - other.mean(axis=0)) < 4 * error).all()


def uniform_screws(posture, count):
    """(count, 6) platform screws of uniform positions in the clearances."""
    prepared = linear_response(posture)
    draws = prepared.solve(np.zeros((count, len(posture.robot.frames), 6)))
    rngs = [np.random.default_rng(k) for k in range(count)]
    return position_clearances(prepared, draws, "uniform", rngs)[0]


@pytest.mark.parametrize("version", [1, 2])
def test_guide_has_the_same_clearance_in_both_file_formats(version, drawn, tmp_path):
    posture = on_two_guides(drawn, [3e-4, 2e-4, 1e-4, 4e-5, -4e-5, 0], passive=False)
    write_robot(posture.robot, tmp_path / "frames.toml")
    convert(tmp_path / "frames.toml", tmp_path / "again.toml", version=version)
    again = home_posture(read_robot(tmp_path / "again.toml"))
    one, other = (zone_margin(own).margin for own in (posture, again))
    assert other == pytest.approx(one, rel=1e-9)
    assert mobility(again).overconstraint == mobility(posture).overconstraint == 5


@pytest.mark.parametrize(("kind", "clearance"), [("prismatic", GUIDE), ("planar", PAD)])
@pytest.mark.parametrize("reverse", [False, True])
def test_every_frame_of_a_contact_belongs_to_the_drawn_joint(
    drawn, kind, clearance, reverse
):
    robot = one_joint(drawn, kind, clearance, reverse).robot
    names = {joint_of(robot, row) for row in range(len(robot.frames))}
    assert names == {"j", "table"}
