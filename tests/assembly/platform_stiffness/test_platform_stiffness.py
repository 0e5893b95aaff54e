"""Tests of the stiffness K_C against closed forms and finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.evidence.stiffness_random_robots import by_differences
from forcefit import load_robot, platform_stiffness, solve_assembly, solve_exact
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.kinematics.se3 import turn_jacobian
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.platform_stiffness.active_set import contacts
from forcefit.assembly.platform_stiffness.matrices import Part
from forcefit.stiffness.screws import screw_map
from tests.assembly.exact.test_exact import only
from tests.robots_for_tests import NUMBERS, irsbot2_with, random_robot
from tests.tolerances_for_tests import without_clearances

UNIT = np.eye(6)
SPRING = MatrixLink(np.diag([20.0, 30.0, 40.0, 1e4, 2e4, 3e4]))
STIFF = MatrixLink(np.diag([1e3, 1e3, 1e3, 1e5, 1e5, 1e5]))


def assert_same_matrix(M, expected, tolerance):
    """Assert that two matrices agree, relative to sqrt(M_ii M_jj)."""
    size = np.sqrt(np.abs(np.diag(expected)))
    np.testing.assert_allclose(
        M / np.outer(size, size), expected / np.outer(size, size), atol=tolerance
    )


def serial(*frames):
    """Return a serial chain of frames from the base to the platform."""
    chain, above = [], "base"
    for frame in frames:
        chain.append(replace(frame, parent=above))
        above = frame.name
    return home_posture(Robot("chain", above, tuple(chain)))


def test_cantilever_compliance_equals_beam_theory():
    """The entries are L/EA, L/GJ, L^3/3EI + 6/5 L/GA, L^2/2EI and L/EI."""
    L, a, E = 0.8, 0.02, 70e9
    A, inertia, G, J = a**2, a**4 / 12, E / 2, 0.1406 * a**4
    section = {"area": A, "I_y": inertia, "I_z": inertia, "J": J,
               "shear_y": 5 / 6, "shear_z": 5 / 6}  # fmt: skip
    beam = Frame("beam", translation=[L, 0, 0], link=BeamLink(section, E, 0.0))
    C = platform_stiffness(serial(beam)).compliance
    bend, slope = L**3 / (3 * E * inertia) + 1.2 * L / (G * A), L**2 / (2 * E * inertia)
    expected = np.diag([L / (G * J), *[L / (E * inertia)] * 2, L / (E * A), bend, bend])
    expected[1, 5] = expected[5, 1] = -slope
    expected[2, 4] = expected[4, 2] = slope
    assert_same_matrix(C, expected, 1e-12)


def test_compliance_of_serial_chain_is_sum_of_link_compliances():
    """C is the sum of X C_i X', where X transforms screws of link i to the tip."""
    rng = np.random.default_rng(1)
    steps, expected = rng.normal(size=(3, 3)), np.zeros((6, 6))
    springs = [B @ B.T + UNIT for B in rng.normal(size=(3, 6, 6))]
    frames = [
        Frame(f"f{k}", translation=steps[k], link=MatrixLink(springs[k]))
        for k in range(3)
    ]
    for k, K in enumerate(springs):
        X = screw_map(-steps[k + 1 :].sum(axis=0))
        expected += X @ np.linalg.inv(K) @ X.T
    tangent = platform_stiffness(serial(*frames))
    assert_same_matrix(tangent.compliance, expected, 1e-12)
    assert_same_matrix(tangent.stiffness, np.linalg.inv(expected), 1e-9)


@pytest.mark.parametrize("name", ["3rrr", "delta"])
def test_stiffness_with_three_equal_legs_has_threefold_symmetry(name):
    K = platform_stiffness(home_posture(load_robot(name))).stiffness
    turn = np.array([[-1, -np.sqrt(3), 0], [np.sqrt(3), -1, 0], [0, 0, 2]]) / 2
    X = np.kron(np.eye(2), turn)
    assert_same_matrix(X @ K @ X.T, K, 1e-9)


def test_stiffness_of_orthoglide_is_isotropic_in_home_pose():
    """The robot is isotropic by design (Wenger and Chablat)."""
    K = platform_stiffness(home_posture(load_robot("orthoglide"))).stiffness
    assert_same_matrix(K, np.diag([K[0, 0]] * 3 + [K[3, 3]] * 3), 1e-9)


@pytest.mark.parametrize("name", ["irsbot2", "hexapod", "four_bar", "delta", "arm6"])
def test_displacement_under_a_unit_load_equals_the_compliance(name):
    """The displacement is computed by a solver that does not use the compliance."""
    posture = home_posture(without_clearances(load_robot(name)))
    C = platform_stiffness(posture).compliance
    for row in range(6):
        moved = solve_assembly(posture, UNIT[row]).platform_screw
        size = np.sqrt(np.diag(C) * C[row, row])
        np.testing.assert_allclose(moved / size, C[row] / size, atol=1e-8)


def differences(solve, posture, load, step):
    """Return central differences of the platform screw for changes of the load."""
    columns = []
    for h, change in zip(step, np.diag(step), strict=True):
        ahead, back = (
            solve(posture, load + c).platform_screw for c in (change, -change)
        )
        columns.append((ahead - back) / (2 * h))
    return np.column_stack(columns)


def as_small_motion(C, screw):
    """Return the compliance for small rotations instead of rotation vectors."""
    J = np.eye(6)
    J[:3, :3] = turn_jacobian(screw[:3])
    return J @ C @ J.T


LOAD = np.array([3.0, -5.0, 2.0, 150.0, 80.0, -200.0])


@pytest.mark.parametrize("case", NUMBERS["cases"], ids=lambda case: case["name"])
def test_stiffness_of_irsbot2_equals_finite_differences(case):
    """The robot has the errors of the paper, and contacts in its clearances.

    The cone solver has a tolerance of 1e-8 of the energy, or 1e-4 of the screws.
    """
    posture = place_robot(irsbot2_with(case), {"tx": 0.1, "tz": -0.5})
    linear, exact = solve_assembly(posture, LOAD), solve_exact(posture, LOAD)
    assert contacts(linear)[0].any()
    step = np.array([1e-2] * 3 + [1e-1] * 3)
    C = platform_stiffness(posture, "contact", LOAD).compliance
    assert_same_matrix(C, differences(solve_assembly, posture, LOAD, step), 1e-4)
    C = platform_stiffness(posture, "exact", LOAD).compliance
    by_load = differences(solve_exact, posture, LOAD, step)
    assert_same_matrix(C, as_small_motion(by_load, exact.platform_screw), 1e-5)


@pytest.mark.parametrize(
    "seed",
    [0, 1, 2, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (3, 4, 5))],
)
def test_stiffness_of_random_robots_equals_finite_differences(seed):
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, legs=3)
    posture = home_posture(robot.with_errors(0.3 * robot.errors))
    load = rng.normal(size=6) * [1, 1, 1, 20, 20, 20]
    exact = solve_exact(posture, load)
    tangent = platform_stiffness(posture, "exact", load)
    step = 1e-4 * np.array([1, 1, 1, 20, 20, 20])
    by_load = differences(solve_exact, posture, load, step)
    by_load = as_small_motion(by_load, exact.platform_screw)
    finite = np.isfinite(tangent.compliance).all(axis=0)
    assert finite.any()
    part = np.ix_(finite, finite)
    assert_same_matrix(tangent.compliance[part], by_load[part], 1e-4)


@pytest.mark.parametrize(
    "seed", [12, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (42, 65))]
)
def test_stiffness_at_large_rotations_equals_finite_differences(seed):
    """The platform rotates by more than 0.5 rad.

    The finite differences are extrapolated to a step of zero.
    """
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, legs=int(rng.integers(1, 4)))
    posture = home_posture(robot)
    load = rng.normal(size=6) * [1, 1, 1, 20, 20, 20]
    assert np.linalg.norm(solve_exact(posture, load).platform_screw[:3]) > 0.5
    assert by_differences(posture, load)[0] < 1e-8


def test_compliance_at_another_point_equals_transformed_compliance():
    """w . s does not depend on the reference point, so C becomes X C X'."""
    posture = home_posture(load_robot("irsbot2"))
    at_origin, r = platform_stiffness(posture), np.array([0.1, -0.2, 0.05])
    at_point = platform_stiffness(posture, at=r)
    X = screw_map(-r)  # base axes and platform axes are parallel
    assert_same_matrix(at_point.compliance, X @ at_origin.compliance @ X.T, 1e-12)
    K = np.linalg.inv(X).T @ at_origin.stiffness @ np.linalg.inv(X)
    assert_same_matrix(at_point.stiffness, K, 1e-9)
    np.testing.assert_allclose(at_point.centre, at_origin.centre, atol=1e-9)


def test_centre_of_stiffness_is_at_single_spring():
    """A rigid arm connects the spring to the platform."""
    spring = Frame("spring", translation=[0.3, 0.1, 0.2], link=SPRING)
    arm = Frame("arm", translation=[0.5, -0.4, 0.1])
    centre = platform_stiffness(serial(spring, arm)).centre
    np.testing.assert_allclose(centre, [0.3, 0.1, 0.2], atol=1e-9)


def test_eigen_stiffnesses_of_diagonal_matrix_equal_its_entries():
    """Rotational stiffnesses are divided by the squared characteristic length."""
    spring = Frame("spring", translation=[0.5, 0, 0], link=SPRING)
    eigen = platform_stiffness(serial(spring)).eigen
    expected = [20 / 0.25, 30 / 0.25, 40 / 0.25, 1e4, 2e4, 3e4]
    np.testing.assert_allclose(eigen.values, expected)


def test_compliance_shares_sum_to_one():
    tangent = platform_stiffness(home_posture(load_robot("irsbot2")))
    for row in range(6):
        assert sum(tangent.shares(UNIT[row]).values()) == pytest.approx(1.0, rel=1e-12)
    whole = sum(tangent.contributions().values())
    assert_same_matrix(whole, tangent.compliance, 1e-12)
    beam = Frame("beam", translation=[1, 0, 0], link=MatrixLink(UNIT))
    alone = platform_stiffness(serial(beam))
    assert alone.shares(UNIT[4]) == {Part("beam", "link"): pytest.approx(1.0)}


def test_compliance_along_free_motion_is_nan():
    """The platform slides freely along x on a spring."""
    spring = Frame("spring", rotation=[0, np.pi / 2, 0], joint="prismatic",
                   link=SPRING)  # fmt: skip
    tangent = platform_stiffness(serial(spring, Frame("tip")))
    np.testing.assert_allclose(np.abs(tangent.free), UNIT[:, [3]], atol=1e-12)
    x = np.arange(6) == 3
    np.testing.assert_array_equal(np.isnan(tangent.compliance), x[:, None] | x)
    np.testing.assert_allclose(tangent.stiffness[3], 0.0, atol=1e-6)
    assert tangent.eigen.values[0] == 0.0
    assert tangent.along(UNIT[3])[0] == 0.0
    assert np.isnan([*tangent.shares(UNIT[3]).values()]).all()


def test_rigid_direction_has_zero_compliance_and_infinite_stiffness():
    """A rigid arm along x rotates about z against a torsion spring."""
    hinge = Frame("hinge", joint="revolute", joint_stiffness=only(2, 50.0))
    tangent = platform_stiffness(serial(hinge, Frame("arm", translation=[0.4, 0, 0])))
    screw = np.array([0, 0, 1, 0, 0.4, 0])
    np.testing.assert_allclose(tangent.compliance, np.outer(screw, screw) / 50.0)
    K = tangent.stiffness
    assert np.isnan(K[2]).all()
    assert np.isnan(K[4]).all()
    assert tangent.along(UNIT[4]) == (pytest.approx(50.0 / 0.4**2), np.inf)
    assert tangent.eigen.condition == np.inf


def test_stiffness_of_column_is_zero_at_buckling_load():
    """The stiffness is k/L^2 - F/L for a rigid bar of length L on a spring k."""
    k, L = 50.0, 0.4
    hinge = Frame("hinge", joint="revolute", joint_stiffness=only(2, k))
    posture = serial(hinge, Frame("arm", translation=[L, 0, 0]))
    for share in (0.5, 0.99, 1.5, -1.0):
        load = [0, 0, 0, -share * k / L, 0, 0]
        tangent = platform_stiffness(posture, "exact", load)
        expected = k / L**2 * (1 - share)
        assert tangent.along(UNIT[4])[0] == pytest.approx(expected, rel=1e-9)
        assert tangent.stable == (share < 1)
        shares = tangent.shares(UNIT[4])
        assert sum(shares.values()) == pytest.approx(1.0)
        assert shares["", "forces"] == pytest.approx(-share / (1 - share))


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_stiffness_along_contact_rim_equals_force_over_clearance(state):
    """A force F presses a pin against the rim of its radial clearance c."""
    force, c, k = 30.0, 1e-3, 1e5
    link = MatrixLink(np.diag([1e9, 1e9, 1e9, k, k, k]))  # rotations are negligible
    posture = serial(Frame("spring", link=link, clearance=Clearance(radial=c)),
                     Frame("tip"))  # fmt: skip
    tangent = platform_stiffness(posture, state, [0, 0, 0, force, 0, 0])
    across, along = (tangent.along(UNIT[row])[0] for row in (3, 4))
    assert across == pytest.approx(k, rel=1e-6)
    assert along == pytest.approx(1 / (1 / k + c / force), rel=1e-6)
    assert tangent.along(UNIT[5])[0] == pytest.approx(k, rel=1e-9)


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_stiffness_within_clearance_is_zero(state):
    spring = Frame("spring", link=STIFF, clearance=Clearance(axial=1e-4))
    posture = serial(spring, Frame("tip"))
    tangent = platform_stiffness(posture, state)
    assert tangent.along(UNIT[5])[0] == 0.0
    assert tangent.along(UNIT[3])[0] == pytest.approx(1e5)
    np.testing.assert_allclose(np.abs(tangent.free), UNIT[:, [5]], atol=1e-12)


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_stiffness_at_change_of_contact_differs_for_loading_and_unloading(state):
    """The error equals the clearance, so there is contact without a force.

    The stiffness is infinite towards the stop, and finite in the other direction.
    """
    frames = (
        Frame("bush", clearance=Clearance(axial=1e-4)),
        Frame("tip", "bush", geometric_error=[0, 0, 0, 0, 0, 1e-4]),
        Frame("spring", link=STIFF),
        Frame("other", "spring"),
    )
    posture = home_posture(Robot("pair", "tip", frames, (("tip", "other"),)))
    stop = platform_stiffness(posture, state, side="loading")
    away = platform_stiffness(posture, state, side="unloading")
    assert stop.along(UNIT[5])[0] == np.inf
    assert away.along(UNIT[5])[0] == pytest.approx(1e5)


def test_block_on_plate_slides_freely_and_is_rigid_along_normal(write_file):
    """The joints of the drives have clearances, so they do not resist small motions."""
    text = """
format = 2
name = "block"
platform = "puck"
platform_at = [0, 0, 0.02]
body = [{ name = "puck" }]
joint = [{ name = "table", type = "planar", between = ["base", "puck"], at = [0, 0, 0], axis = [0, 0, 1], clearance = { pad = { gap = 1e-5, length = 0.08, width = 0.06 } } }]
[[leg]]
name = "leg"
repeat = { count = 3, about = [0, 0, 1] }
body = [{ name = "sleeve" }, { name = "rod" }]
joint = [
    { name = "foot", type = "revolute", between = ["base", "sleeve"], at = [0, 0.4, 0], axis = [0, 0, 1], clearance = { radial = 1e-5, axial = 2e-5, tilt = 1e-3 } },
    { name = "push", type = "prismatic", between = ["sleeve", "rod"], at = [0, 0.4, 0], axis = [-0.0643, -0.3234, 0], actuated = true, drive_stiffness = 1e6 },
    { name = "head", type = "revolute", between = ["rod", "puck"], at = [-0.0643, 0.0766, 0], axis = [0, 0, 1], clearance = { radial = 1e-5, axial = 2e-5, tilt = 1e-3 } },
]
"""  # noqa: E501
    posture = home_posture(read_robot(write_file(text)))
    tangent = platform_stiffness(posture, "contact", [0, 0, 0, 0, 0, -50])
    assert tangent.free.shape == tangent.rigid.shape == (6, 3)
    np.testing.assert_allclose(tangent.free[[0, 1, 5]], 0.0, atol=1e-9)
    np.testing.assert_allclose(tangent.rigid[[2, 3, 4]], 0.0, atol=1e-9)
