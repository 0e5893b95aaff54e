"""Robots with linear guides, compared with hand calculations."""

import itertools
from functools import partial

import numpy as np
import pytest
from scipy.spatial import HalfspaceIntersection

from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture, together
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.reference.as_printed import energy_as_printed
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import predict, with_rest_positions
from forcefit.assembly.model.contact_closures import contact_closures, loops
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from forcefit.assembly.path.path_errors import path_errors
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.report.results import solution_of
from forcefit.assembly.statistics.clearance_positions import position_clearances
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.worst_pose import worst_pose
from forcefit.assembly.steps.plan import Join, Plan
from forcefit.assembly.steps.run import assemble_in_steps
from forcefit.assembly.sweeps.robot_sweep import sweep
from forcefit.validation.multibody.simulation import (
    simulate_assembly,
    without_clearance,
)
from tests.assembly.drawing.guides_for_tests import (
    GUIDE,
    PAD,
    C,
    L,
    W,
    Z,
    body,
    drawn_in,
    guide_slabs,
    joint,
)
from tests.assembly.path.moving_robots_for_tests import instants

K = np.array([2e4, 3e4, 1e4, 2e7, 1e7, 4e7])  # [N m/rad, N/m] diagonal stiffness
DRIVEN = "actuated = true"
SLIDE = f"clearance = {{ {GUIDE} }}"


@pytest.fixture
def drawn(tmp_path):
    """Return a function that reads a robot from tables of bodies and joints."""
    return partial(drawn_in, tmp_path)


def sprung_slide(drawn, clearance=SLIDE, mass=""):
    """Return a spring-mounted carrier with a driven table in a guide along z."""
    spring = f"joint_stiffness = {K.tolist()}"
    return drawn(
        body("carrier"), body("table") + mass,
        joint("spring", "fixed", "base", "carrier", spring),
        joint("slide", "prismatic", "carrier", "table", Z, DRIVEN, clearance),
    )  # fmt: skip


def test_force_along_x_closes_three_clearances_of_a_guide(drawn):
    """A force along x closes the clearances in TX, RY and RZ, but not in TY and RX."""
    posture = home_posture(sprung_slide(drawn))
    found = platform_stiffness(posture, "contact", load=[0, 0, 0, 50.0, 0, 0])
    expected = np.diag(np.where([1, 0, 0, 0, 1, 0], 0.0, K))
    scale = np.sqrt(np.outer(K, K))
    np.testing.assert_allclose(found.stiffness / scale, expected / scale, atol=1e-9)
    assert found.free.shape[1] == 2


def test_guide_is_rigid_in_nominal_stiffness(drawn):
    found = platform_stiffness(home_posture(sprung_slide(drawn)))
    np.testing.assert_allclose(found.stiffness, np.diag(K), rtol=1e-9, atol=1e-3)


@pytest.mark.parametrize(("load", "expected"), [
    # displacement along x: gap and spring deflection
    ([0, 0, 0, 100.0, 0, 0], [0, 0, 0, C + 100 / K[3], 0, 0]),
    # rotation about x, which the contacts at both ends limit to 2 c / L
    ([5.0, 0, 0, 0, 0, 0], [2 * C / L + 5 / K[0], 0, 0, 0, 0, 0]),
    # rotation about z, which the contacts at the edges limit to 2 c / w
    ([0, 0, 5.0, 0, 0, 0], [0, 0, 2 * C / W + 5 / K[2], 0, 0, 0]),
])  # fmt: skip
def test_displacement_of_a_loaded_guide_equals_hand_calculation(load, expected, drawn):
    """The platform moves by the gap and the spring deflection."""
    posture = home_posture(sprung_slide(drawn))
    found = solve_assembly(posture, load)
    work = np.dot(load, expected)
    assert found.platform_screw @ load == pytest.approx(work, rel=1e-7)
    assert found.energy == pytest.approx((np.array(load) ** 2 / K).sum() / 2, rel=1e-7)


def test_predicted_readings_include_clearance_of_a_guide(drawn):
    """The readings are the gap plus the spring deflection."""
    loads = np.array([[0, 0, 0, 100.0, 40.0, 0], [0, 0, 0, -100.0, 40.0, 0]])
    posture = home_posture(sprung_slide(drawn))
    rows = as_declared(together([posture, posture]), loads)
    found = predict(rows)
    expected = np.sign(loads[:, 3:5]) * C + loads[:, 3:5] / K[3:5]
    np.testing.assert_allclose(found.deviation[:, 3:5], expected, rtol=1e-6)
    assert not found.reason.any()
    held = predict(with_rest_positions(rows))
    np.testing.assert_allclose(held.deviation, found.deviation, atol=1e-10)


def test_displacement_of_accelerated_block_equals_hand_calculation(drawn):
    """The force m a displaces the block by the gap plus m a / K."""
    robot = sprung_slide(drawn, mass="mass = 4.0\ncentre = [0, 0, 0]\n")
    path = instants(["q.slide"], [[0.0]], [[0.0]], [[3.0]])
    found = path_errors(robot, path, gravity=[0.0, -9.81, 0.0])
    screw = found.arrays["platform_screw"][0]
    assert screw[4] == pytest.approx(-C - 4 * 9.81 / K[4], rel=1e-6)
    assert screw[5] == pytest.approx(-4 * 3.0 / K[5], rel=1e-6)
    assert found.arrays["drive_force"][0, 0] == pytest.approx(12.0, rel=1e-9)


def mounted(drawn, error):
    """Return a guide on a spring, whose block is fixed to the base with an error."""
    off = f"geometric_error = {[float(x) for x in error]}"
    spring = f"joint_stiffness = {K.tolist()}"
    return home_posture(drawn(
        body("carrier"), body("table"),
        joint("spring", "fixed", "base", "carrier", spring),
        joint("slide", "prismatic", "carrier", "table", Z, SLIDE),
        joint("mount", "fixed", "table", "base", off),
    ))  # fmt: skip


ERROR = [5e-4, -8e-4, 9e-4, 3e-5, -4e-5, 0.0]


def test_energy_of_assembly_step_equals_assembly_energy(drawn):
    """The assembly plan has one step, which closes the loop."""
    posture = mounted(drawn, ERROR)
    (pair,) = loops(posture.robot)
    assert len(posture.robot.closures) == 2
    (found,) = assemble_in_steps(Plan((Join("mount", pair),)), posture)
    energy = solve_assembly(posture).energy
    assert energy > 1e-4
    assert found.energy == pytest.approx(energy, rel=1e-6)


def test_energy_of_a_guide_equals_that_of_paper_problem(drawn):
    """The problem of the paper is solved by cvxpy without elimination of variables."""
    posture = mounted(drawn, ERROR)
    printed, _ = energy_as_printed(posture)
    assert solve_assembly(posture).energy == pytest.approx(printed, rel=1e-6)


def test_worst_case_of_a_guide_equals_largest_vertex(drawn):
    """The worst case is the largest sum of an error and a vertex of the clearance."""
    robot = drawn(
        body("table"), joint("slide", "prismatic", "base", "table", Z, SLIDE, DRIVEN)
    )  # fmt: skip
    width = np.array([1e-4, 0, 2e-4, 2e-5, 0, 0])
    sources = tolerance_sources(robot, width, ("table",))
    slabs = guide_slabs()[:, :5] * [1e-4, 1e-4, 1e-4, 1e-5, 1e-5]
    limits = np.vstack([np.c_[slabs, -np.ones(8)], np.c_[-slabs, -np.ones(8)]])
    corners = HalfspaceIntersection(limits, np.zeros(5)).intersections
    corners = np.c_[corners * [1e-4, 1e-4, 1e-4, 1e-5, 1e-5], np.zeros(len(corners))]
    signs = np.array(list(itertools.product((1, -1), repeat=6)))
    for quantity, part in (("rotation", slice(0, 3)), ("translation", slice(3, 6))):
        both = corners[:, None] + signs * width
        most = np.linalg.norm(both[..., part], axis=2).max()
        found = worst_pose(linear_response(home_posture(robot)), sources, quantity)
        assert found.reading == "linear"
        assert found.attained == pytest.approx(most, rel=1e-6)
        assert found.bound == pytest.approx(most, rel=1e-3)
        assert sum(size for _, size in found.shares) == pytest.approx(most, rel=1e-6)


def test_contact_positions_are_vertices_of_guide_clearance(drawn):
    """Five of the eight inequalities are active."""
    posture = home_posture(drawn(
        body("table"), joint("slide", "prismatic", "base", "table", Z, SLIDE, DRIVEN)
    ))  # fmt: skip
    prepared = linear_response(posture)
    draws = prepared.solve(np.zeros((40, len(posture.robot.frames), 6)))
    rngs = [np.random.default_rng(k) for k in range(40)]
    screws, _ = position_clearances(prepared, draws, "contact", rngs)
    touching = np.sort(np.abs(screws @ guide_slabs().T), axis=1)
    assert touching.max() <= 1 + 1e-7
    assert (touching[:, 3:] > 1 - 1e-6).all()


def test_energies_in_a_sweep_equal_hand_calculation(drawn):
    """The energy is F^2 / (2 K_TX) + (q F)^2 / (2 K_RY) for the lever arm q."""
    found = sweep(
        sprung_slide(drawn), grid="q.slide=0:0.04:0.02", assumption="none",
        load=(0, 0, 0, 100.0, 0, 0),
    )  # fmt: skip
    arm = np.array([0.0, 0.02, 0.04])
    expected = 100.0**2 / K[3] / 2 + (100 * arm) ** 2 / K[1] / 2
    np.testing.assert_allclose(found["energy"].values.ravel(), expected, rtol=1e-7)


@pytest.mark.parametrize(("kind", "clearance"), [
    ("prismatic", GUIDE), ("planar", PAD)
])  # fmt: skip
@pytest.mark.parametrize("reverse", [False, True])
def test_errors_of_a_serial_arm_have_zero_margin(kind, clearance, reverse, drawn):
    """Errors of a serial arm only move the platform and do not require clearance."""
    ends = ("table", "base") if reverse else ("base", "table")
    robot = drawn(
        body("table"), joint("j", kind, *ends, Z, f"clearance = {{ {clearance} }}")
    )
    errors = robot.errors.copy()
    outer = {robot.index("table"), 0}
    errors[list(outer)] = [1e-3, -2e-3, 3e-3, 1e-4, 2e-4, -3e-4]
    assert zone_margin(home_posture(robot.with_errors(errors))).margin == 0.0


def test_contact_closures_are_not_exported_as_loops(drawn, tmp_path):
    """The exported robot has one loop, which is the loop of bodies and joints."""
    posture = mounted(drawn, ERROR)
    assert contact_closures(posture.robot).sum() == 1
    write_robot(posture.robot, tmp_path / "frames.toml")
    done = convert(tmp_path / "frames.toml", tmp_path / "robot.xml")
    assert done.table()["closures"] == 1
    assert (tmp_path / "robot.xml").read_text().count("<weld") == 1
    closures = solution_of(posture)["closures"]
    assert [tuple(one["frames"]) for one in closures] == list(loops(posture.robot))


def test_two_bores_have_six_redundant_constraints():
    """Two shafts in bores between the same bodies have six redundant constraints."""
    bore = Clearance(radial=1e-5, tilt=1e-4)
    frames = (
        Frame("first", clearance=bore), Frame("table", "first"),
        Frame("second", clearance=bore), Frame("end", "second"),
    )  # fmt: skip
    robot = Robot("two bores", "table", frames, (("table", "end"),))
    assert not contact_closures(robot).any()
    assert mobility(home_posture(robot)).overconstraint == 6


@pytest.mark.exudyn
def test_simulated_energy_without_clearance_equals_hand_calculation(drawn, rng):
    """Without clearance, the energy is F^2 / (2 K)."""
    robot = without_clearance(sprung_slide(drawn))
    robot = robot.with_errors(1e-4 * rng.uniform(-1, 1, size=(len(robot.frames), 6)))
    found = simulate_assembly(home_posture(robot), load=[0, 0, 0, 100.0, 0, 0])
    assert found.energy == pytest.approx(100.0**2 / K[3] / 2, rel=1e-2)
