"""Clearances of guides and pads, compared with explicit inequalities.

A guide of length L, width w and height t permits the small screws that satisfy

    |TX + s1 L/2 RY + s2 t/2 RZ| <= c_x,  |TY + s1 L/2 RX + s2 w/2 RZ| <= c_y

for s1, s2 = +-1.  A pad of 2A by 2B permits the octahedron |TZ| + B |RX| + A |RY| <= g.
In these tests, the inequalities are constraints of linear and convex programmes.
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

STIFFNESS = [2e4, 3e4, 1e4, 2e7, 1e7, 4e7]  # [N m/rad, N/m] diagonal stiffness


@pytest.fixture
def drawn(tmp_path):
    """Return a function that reads a robot from tables of bodies and joints."""
    return partial(drawn_in, tmp_path)


def one_joint(drawn, kind, clearance, reverse=False, keys=Z):
    ends = ("table", "base") if reverse else ("base", "table")
    own = joint("j", kind, *ends, keys, f"clearance = {{ {clearance} }}")
    return home_posture(drawn(body("table"), own))


def heights(posture, directions):
    """Return the support function of the reachable platform screws."""
    reachable = reachable_screws(solve_assembly(posture), "frozen")
    return np.array([reachable.support(w).height for w in np.array(directions)])


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize(("gap", "gaps"), [
    ("1e-5", (C, C)), ("[1e-5, 4e-6]", (C, 4e-6))
])  # fmt: skip
def test_support_function_of_a_guide_agrees_with_linear_programme(
    gap, gaps, reverse, drawn, rng
):
    """The expected support function is computed by linear programming."""
    posture = one_joint(drawn, "prismatic", GUIDE.replace("1e-5", gap), reverse)
    wrenches = rng.normal(size=(40, 6)) * [L / 2, L / 2, W / 2, 1, 1, 0]
    expected = [support(w, guide_slabs(gaps)) for w in wrenches]
    np.testing.assert_allclose(heights(posture, wrenches), expected, rtol=1e-7)


@pytest.mark.parametrize("reverse", [False, True])
def test_support_function_of_a_pad_is_that_of_octahedron(reverse, drawn, rng):
    """The support function is g max(|w_T|, |w_RX| / B, |w_RY| / A)."""
    wrenches = rng.normal(size=(40, 6)) * [B, A, 0, 0, 0, 1]
    posture = one_joint(drawn, "planar", PAD, reverse)
    expected = G_PAD * (np.abs(wrenches[:, [0, 1, 5]]) / [B, A, 1]).max(axis=1)
    np.testing.assert_allclose(heights(posture, wrenches), expected, rtol=1e-7)


def positions(posture, screws):
    """Return the gauge of each platform screw, (k,), which is <= 1 if reachable."""
    lin, joints = linearise(posture), solve_assembly(posture).joints
    columns = np.hstack([joints.cones, joints.free])
    A_all = np.vstack([lin.rows, lin.platform]) @ columns
    right = np.hstack([np.zeros((len(screws), len(lin.rows))), screws])
    # scaling of the columns reduces rounding errors
    size = np.abs(A_all).max(axis=0)
    found = np.linalg.lstsq(A_all / size, right.T, rcond=1e-9)[0].T / size
    return np.abs(found[:, : joints.cones.shape[1]]).max(axis=1)


@pytest.mark.parametrize(("kind", "clearance", "slabs", "box"), [
    ("prismatic", GUIDE, guide_slabs(), [2.5e-4, 2.5e-4, 5e-4, C, C, 0]),
    ("planar", PAD, pad_slabs(), [G_PAD / B, G_PAD / A, 0, 0, 0, G_PAD]),
])  # fmt: skip
def test_reachable_screws_are_those_that_satisfy_inequalities(
    kind, clearance, slabs, box, drawn, rng
):
    """Screws are sampled in a box; the octahedron of a pad is one sixth of this box."""
    screws = rng.uniform(-1, 1, size=(200_000, 6)) * box
    inside = (np.abs(screws @ slabs.T) <= 1).all(axis=1)
    found = positions(one_joint(drawn, kind, clearance), screws) <= 1
    assert np.mean(found != inside) < 1e-4  # screws on the boundary may differ
    if kind == "planar":
        assert found.mean() == pytest.approx(1 / 6, abs=0.004)


def held(drawn, error, kind, clearance):
    """Return a loop of a spring, a guide or pad, and a fixed joint with an error."""
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
def test_energy_of_guide_and_pad_agrees_with_cvxpy(
    seed, kind, clearance, slabs, free, drawn
):
    """The energy is the minimum of v K v / 2 with v + clearance + error = 0."""
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
    """Return a table on two parallel guides along z, the second with an error."""
    driven = () if passive else ("actuated = true",)
    slide = f"clearance = {{ {GUIDE} }}"
    off = f"geometric_error = {[float(x) for x in error]}"
    return home_posture(drawn(
        body("table"),
        joint("one", "prismatic", "base", "table", Z, slide, *driven, at=FEET[0]),
        joint("two", "prismatic", "base", "table", Z, slide, off, *keys, at=FEET[1]),
    ))  # fmt: skip


def two_guide_slabs():
    """Return the inequalities of both guides for a screw at the origin, (16, 6)."""
    return np.vstack([guide_slabs() @ np.linalg.inv(at(foot)) for foot in FEET])


@pytest.mark.parametrize("method", ["compiled", "reference"])
def test_margin_of_two_guides_agrees_with_linear_programme(method, drawn, rng):
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


def test_pose_errors_of_two_guides_agree_with_linear_programme(drawn, rng):
    """The table can reach all screws that are possible in both guides."""
    posture = on_two_guides(drawn, np.zeros(6), passive=False)
    slabs = two_guide_slabs()
    wrenches = rng.normal(size=(20, 6)) * [0.1, 0.1, 0.1, 1, 1, 0]
    held_z = np.array([[0, 0, 0, 0, 0, 1.0]])
    # the drive fixes the displacement along z at the first guide
    held_z = held_z @ np.linalg.inv(at(FEET[0]))
    expected = [support(w, slabs, held_z) for w in wrenches]
    np.testing.assert_allclose(heights(posture, wrenches), expected, rtol=1e-6)
    found = bound_pose_error(
        solve_assembly(posture), tolerance_translation=1e-9, tolerance_rotation=1e-9
    )
    # maximum over 400 random directions, which is at most 2 % too small
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


def test_energy_of_two_guides_agrees_with_cvxpy(drawn, rng):
    """The two guides are overconstrained, and the errors exceed the gaps."""
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
def test_exact_methods_agree_for_guide_and_pad(kind, clearance, drawn):
    posture = held(drawn, 4 * errors_of(1), kind, clearance)
    one, other = (solve_exact(posture, method=m) for m in ("compiled", "reference"))
    assert one.energy == pytest.approx(other.energy, rel=1e-9)


@pytest.mark.parametrize(("kind", "clearance"), [
    ("prismatic", GUIDE), ("planar", PAD)
])  # fmt: skip
def test_exact_energy_of_a_guide_differs_by_third_order(kind, clearance, drawn):
    """If errors and clearances are scaled by s, the energy difference is O(s^3)."""
    posture, changes = held(drawn, 4 * errors_of(1), kind, clearance), []
    for scale in (1.0, 0.5, 0.25):
        found = solve_exact(scaled(posture, scale))
        assert found.clearance_excess() < 1e-9
        assert found.closure_residual() < 1e-12
        changes.append(abs(found.energy - found.linear.energy))
    slopes = np.diff(np.log(changes)) / np.log(0.5)
    np.testing.assert_allclose(slopes, 3.0, atol=0.1)


@pytest.mark.exudyn
def test_multibody_simulation_of_a_guide_agrees(drawn):
    """The multibody simulation includes finite rotations of both chains."""
    posture = held(drawn, 4 * errors_of(1), "prismatic", GUIDE)
    check = crosscheck(posture, (1.0, 0.5, 0.25), clearances=True)
    assert check.passed, check.checks


def test_random_positions_on_a_pad_are_uniform_in_octahedron(drawn):
    """The mean squares of TZ / g, B RX / g and A RY / g are 0.1."""
    posture = one_joint(drawn, "planar", PAD)
    screws = uniform_screws(posture, 1500)[:, [0, 1, 5]] / [G_PAD / B, G_PAD / A, G_PAD]
    assert np.abs(screws).sum(axis=1).max() <= 1 + 1e-9
    # the tolerance is four standard deviations of the mean square
    np.testing.assert_allclose((screws**2).mean(axis=0), 0.1, atol=4 * 0.0036)


def test_random_positions_in_a_guide_agree_with_rejection_sampling(drawn, rng):
    """The mean squares of the five components are compared."""
    found = uniform_screws(one_joint(drawn, "prismatic", GUIDE), 1500)[:, :5]
    box = np.array([2.5e-4, 2.5e-4, 5e-4, C, C])
    drawn_there = rng.uniform(-1, 1, size=(400_000, 5)) * box
    inside = (np.abs(drawn_there @ guide_slabs()[:, :5].T) <= 1).all(axis=1)
    one, other = ((part / box) ** 2 for part in (found, drawn_there[inside]))
    error = other.std(axis=0) / np.sqrt(len(one))
    assert (np.abs(one.mean(axis=0) - other.mean(axis=0)) < 4 * error).all()


def uniform_screws(posture, count):
    """Return platform screws for uniform positions in the clearances, (count, 6)."""
    prepared = linear_response(posture)
    draws = prepared.solve(np.zeros((count, len(posture.robot.frames), 6)))
    rngs = [np.random.default_rng(k) for k in range(count)]
    return position_clearances(prepared, draws, "uniform", rngs)[0]


@pytest.mark.parametrize("version", [1, 2])
def test_clearance_of_a_guide_is_equal_in_both_file_formats(version, drawn, tmp_path):
    posture = on_two_guides(drawn, [3e-4, 2e-4, 1e-4, 4e-5, -4e-5, 0], passive=False)
    write_robot(posture.robot, tmp_path / "frames.toml")
    convert(tmp_path / "frames.toml", tmp_path / "again.toml", version=version)
    again = home_posture(read_robot(tmp_path / "again.toml"))
    one, other = (zone_margin(own).margin for own in (posture, again))
    assert other == pytest.approx(one, rel=1e-9)
    assert mobility(again).overconstraint == mobility(posture).overconstraint == 5


@pytest.mark.parametrize(("kind", "clearance"), [("prismatic", GUIDE), ("planar", PAD)])
@pytest.mark.parametrize("reverse", [False, True])
def test_contact_frames_are_assigned_to_their_joint(drawn, kind, clearance, reverse):
    robot = one_joint(drawn, kind, clearance, reverse).robot
    names = {joint_of(robot, row) for row in range(len(robot.frames))}
    assert names == {"j", "table"}
