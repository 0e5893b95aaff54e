"""Worked examples of assembly orders, each built as a robot. The expected numbers
follow by hand from springs in one direction (see each test); a platform on three legs
rests at x = sum k d / sum k.
"""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

import forcefit as ff
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.placed_frames import place_frames
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from forcefit.assembly.robots import load_robot
from forcefit.assembly.robots.placing import at, ball_joint, cardan_joint
from forcefit.assembly.steps.plan import (
    Adjust,
    Fix,
    Join,
    Measure,
    Plan,
    Preload,
    Release,
)
from forcefit.assembly.steps.run import assemble_in_steps
from forcefit.inputs.table import BadInput
from forcefit.stiffness.screws import SCREW
from tests.assembly.steps.robots_for_steps import (
    gough_points,
    planar_platform,
    portal,
    spring,
    three_legs,
    two_bars,
)

LEG = {i: ("platform", f"leg{i}") for i in (1, 2, 3)}
Z = ("TZ",)


def join_leg(i, **more):
    return Join(f"join {i}", LEG[i], **more)


def test_two_bars_and_a_gap_store_and_dissipate_the_energy_of_the_springs():
    """F = g k1 k2 / (k1 + k2) and E = F g / 2, all of which is lost when a wall is
    removed.
    """
    bolt = Join("bolt", ("wall", "bar2"))
    plan = Plan((bolt, Release("wall removed", ("bolt",))))
    closed, released = assemble_in_steps(plan, two_bars(2e-4))
    assert closed.closing_force == pytest.approx(150.0)
    assert closed.energy == pytest.approx(15e-3)
    assert closed.work == pytest.approx(15e-3)
    assert abs(closed.opening[0, 5]) == pytest.approx(2e-4)
    assert released.energy == pytest.approx(0.0, abs=1e-15)
    assert released.lost == pytest.approx(15e-3)
    assert abs(released.spring_back[0, 5]) == pytest.approx(2e-4)


def test_plan_of_a_file_stores_the_energy_of_the_springs(tmp_path):
    """As above: 150 N, and half of this force times the gap of 0.2 mm."""
    file = tmp_path / "steps.toml"
    file.write_text('[[step]]\njoin = ["wall", "bar2"]\n')
    (closed,) = ff.assemble_in_steps(file, two_bars(2e-4))
    assert closed.closing_force == pytest.approx(150.0)
    assert closed.energy == pytest.approx(15e-3)


def test_opening_left_by_a_limited_force_equals_spring_calculation():
    """90 N of 150 N close 120 um of 200 um, so 80 um stay open and E = 0.36 * 15 mJ."""
    bolt = Join("bolt", ("wall", "bar2"), force_limit=90.0, leave_open=True)
    (closed,) = assemble_in_steps(Plan((bolt,)), two_bars(2e-4))
    assert closed.exceeded.all()
    assert closed.closing_force == pytest.approx(90.0)
    assert abs(closed.left_open[0, 5]) == pytest.approx(8e-5)
    assert closed.energy == pytest.approx(5.4e-3)


@pytest.mark.parametrize("order", list(permutations((1, 2, 3))))
def test_pinned_legs_end_in_the_same_state_in_every_order(order):
    """x = sum k d / sum k = 23.33 um, E = 2.967 mJ, forces k (x - d)."""
    last = assemble_in_steps(Plan(tuple(join_leg(i) for i in order)), three_legs())[-1]
    assert last.platform_screw[0, 5] == pytest.approx(140 / 6 * 1e-6)
    assert last.energy == pytest.approx(2.966667e-3, rel=1e-6)
    forces = [abs(last.wrenches[f"join {i}"][0, 5]) for i in (1, 2, 3)]
    assert forces == pytest.approx([6.666667, 86.666667, 80.0], rel=1e-6)


@pytest.mark.parametrize(
    ("last", "x", "energy"),
    [(1, 22.0e-6, 2.94e-3), (2, 45.0e-6, 0.15e-3), (3, -10e-6 / 3, 0.8333333e-3)],
)
def test_last_leg_bolted_without_force_does_not_change_the_pose(last, x, energy):
    first = [i for i in (1, 2, 3) if i != last]
    steps = (*(join_leg(i) for i in first), join_leg(last, locked=Z))
    result = assemble_in_steps(Plan(steps), three_legs())[-1]
    assert result.platform_screw[0, 5] == pytest.approx(x)
    assert result.energy == pytest.approx(energy, rel=1e-6)
    assert result.closing_force == pytest.approx(0.0, abs=1e-9)


def test_leg_bolted_while_the_platform_is_clamped_springs_back_by_its_share():
    """Leg 3 carries no force at 10 um: x = (k1 d1 + k2 d2 + k3 10) / sum k."""
    steps = (
        join_leg(1), join_leg(2), Fix("clamp", "platform", {"TZ": 10e-6}),
        join_leg(3, locked=Z), Release("free", ("clamp",)),
    )  # fmt: skip
    result = assemble_in_steps(Plan(steps), three_legs())[-1]
    assert result.platform_screw[0, 5] == pytest.approx(10e-6 / 3)
    forces = [abs(result.wrenches[f"join {i}"][0, 5]) for i in (1, 2, 3)]
    assert forces == pytest.approx([26.66667, 46.66667, 20.0], rel=1e-6)


@pytest.mark.parametrize(("place", "order", "z", "turn", "energy"), [
    (0.3, (3, 4), 18.46154e-6, -30.76923e-6, 0.4923077e-3),
    (0.3, (4, 3), 18.0e-6, -40.0e-6, 0.52e-3),
])  # fmt: skip
def test_result_of_bolting_the_slot_first_differs_if_the_pin_moves_the_slot(
    place, order, z, turn, energy
):
    """Legs at 0 and 0.4 m, 40 um pinned at 0.1 m, a slot at 0.3 m; read at 0 m."""
    posture = planar_platform([0.0, 0.4, 0.1, place], [0, 0, 40e-6, 0])
    ways = {3: (), 4: Z}
    steps = tuple(
        Join(f"join {i}", (f"seat{i}", f"end{i}"), locked=ways.get(i, ()))
        for i in (1, 2, *order)
    )
    result = assemble_in_steps(Plan(steps), posture)[-1]
    slope = -result.platform_screw[0, 1]  # +RY lowers positive x
    assert slope == pytest.approx(turn)
    assert result.energy == pytest.approx(energy, rel=1e-6)
    assert result.platform_screw[0, 5] == pytest.approx(z)


def test_portal_welded_to_a_bent_base_retains_its_part_of_the_rotation():
    """k_base = 2 EI / L acts together with the portal's stiffness against rotation of
    its feet.
    """
    E = 2.1e11
    I_b, I_c = 0.06 * 0.03**3 / 12, 0.03**4 / 12
    h, L = 0.4, 0.6
    k_b = 2 * E * I_b / L
    inner = (2 * I_c / h) / (4 * I_c / h + 2 * I_c / L)
    k_p = (2 * E * I_c / h) * (2 - inner)
    kept = 1e-3 * k_p / (k_b + k_p)
    bent = {"TX": 0.0, "TZ": 0.0, "RY": 1e-3}
    steps = (
        Fix("clamp 1", "foot1", bent), Fix("clamp 2", "foot2", {"RY": -1e-3}),
        Join("weld", ("corner", "top2"), locked=("RX", "RY", "RZ", "TX", "TY", "TZ")),
        Release("free", ("clamp 1", "clamp 2")),
        Measure("foot 1", "foot1", ("RY",)), Measure("foot 2", "foot2", ("RY",)),
    )  # fmt: skip
    results = assemble_in_steps(Plan(steps), portal())
    assert results[1].energy == pytest.approx(k_b * 1e-3**2, rel=1e-6)
    assert results[2].work == pytest.approx(0.0, abs=1e-12)
    turn = results[4].reading - results[5].reading
    assert turn[0, 0] == pytest.approx(2 * kept, rel=1e-5)
    assert results[3].energy == pytest.approx(k_b * 1e-3 * kept, rel=1e-5)


def test_total_work_equals_final_energy_plus_losses():
    steps = (
        join_leg(1), join_leg(2), Fix("clamp", "platform", {"TZ": 10e-6}),
        Preload("press", "platform", np.array([0, 0, 0, 0, 0, -30.0])),
        join_leg(3, locked=Z), Release("free", ("clamp",)), Release("end", ("press",)),
    )  # fmt: skip
    results = assemble_in_steps(Plan(steps), three_legs())
    work = sum(r.work + r.load_work for r in results)
    lost = sum(r.lost for r in results)
    assert work == pytest.approx(results[-1].energy + lost, rel=1e-9)
    assert lost > 0
    for result in results:
        assert np.abs(result.balance).max() < 1e-12 * 0.01 + 1e-15


def legs_with_pins(places, bounds, k=(None, None, 2e6)):
    """Legs on the platform of a guide: pins are rigid, other legs elastic."""
    frames = [Frame("guide", "base", joint="prismatic"), Frame("platform", "guide")]
    for i, (d, bound, stiffness) in enumerate(zip(places, bounds, k, strict=False), 1):
        frames.append(
            Frame(
                f"leg{i}",
                "base",
                geometric_error=[0, 0, 0, 0, 0, d],
                clearance=None if bound is None else Clearance(axial=bound),
                link=None if stiffness is None else spring(stiffness, 5),
            )  # fmt: skip
        )
    closures = tuple(("platform", f"leg{i + 1}") for i in range(len(places)))
    return home_posture(Robot("pins", "platform", tuple(frames), closures))


@pytest.mark.parametrize("order", [(1, 2), (2, 1)])
def test_platform_on_two_pins_with_clearance_is_at_a_position_that_both_allow(order):
    """Pins at 0 +- 20 um and 30 +- 20 um allow platform positions in [10, 20] um."""
    posture = legs_with_pins((0.0, 30e-6), (20e-6, 20e-6))
    results = assemble_in_steps(Plan(tuple(join_leg(i) for i in order)), posture)
    z = results[-1].platform_screw[0, 5]
    assert 10e-6 - 1e-12 < z < 20e-6 + 1e-12
    assert results[-1].energy == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("at", "force"), [(-20e-6, 60.0), (0.0, 20.0), (10e-6, 0.0), (15e-6, 0.0)]
)
def test_energy_of_a_slot_bolted_after_one_pin_follows_from_its_position(at, force):
    """Pin 2 then forces the platform to 10 um against a leg of 2e6 N/m at x3."""
    posture = legs_with_pins((0.0, 30e-6, 0.0), (20e-6, 20e-6, None))
    steps = (
        join_leg(1), Fix("clamp", "platform", {"TZ": at}), join_leg(3, locked=Z),
        Release("free", ("clamp",)), join_leg(2),
    )  # fmt: skip
    last = assemble_in_steps(Plan(steps), posture)[-1]
    assert abs(last.wrenches["join 3"][0, 5]) == pytest.approx(force, abs=1e-3)
    assert last.energy == pytest.approx(force**2 / 4e6, abs=1e-7)


def test_bolted_joint_with_clearance_retains_its_position():
    """Pin 1 bolted at -20 um acts as a rigid pin there."""
    posture = legs_with_pins((0.0, 30e-6), (20e-6, None), k=(1e6, None))
    down = np.array([0, 0, 0, 0, 0, -5.0])
    steps = (
        join_leg(1), Preload("weight", "platform", down), Join("bolt", "leg1"),
        Release("no weight", ("weight",)), join_leg(2),
    )  # fmt: skip
    last = assemble_in_steps(Plan(steps), posture)[-1]
    # the leg's end rests 20 um below, so pin 2 lifts it by 50 um
    assert abs(last.wrenches["join 1"][0, 5]) == pytest.approx(50.0, rel=1e-6)


def gough(errors, seventh=False):
    """Legs of a Gough platform, 5e6 N/m each, on a body with six degrees of freedom."""
    base, top = gough_points()
    if seventh:
        base, top = np.vstack([base, SEVENTH[0]]), np.vstack([top, SEVENTH[1]])
    placed = [
        (Frame("y", "base", joint="prismatic"), at([0, 0, 0.5], [0, 1, 0])),
        (Frame("x", "y", joint="prismatic"), at([0, 0, 0.5], [1, 0, 0], [0, 1, 0])),
        (Frame("z", "x", joint="prismatic"), at([0, 0, 0.5])),
        *ball_joint("turn", "z", np.array([0, 0, 0.5]), X, Y),
        (Frame("platform", "turn_3"), at([0, 0, 0.5])),
    ]
    closures = []
    for i, (a, b) in enumerate(zip(base, top, strict=True), 1):
        along = (b - a) / np.linalg.norm(b - a)
        first = np.cross([0.0, 0.0, 1.0], along)
        second = np.cross(along, first)
        axial = at(b, along, first)
        length = Frame(
            f"leg{i}", f"foot{i}_2", link=spring(5e6, 5),
            geometric_error=[0, 0, 0, 0, 0, errors[i - 1]],
        )  # fmt: skip
        placed += [
            *cardan_joint(f"foot{i}", "base", a, first, second),
            (length, axial),
            *ball_joint(f"head{i}", f"leg{i}", b, first, second),
            (Frame(f"end{i}", f"head{i}_3"), axial),
            (Frame(f"seat{i}", "platform"), axial),
        ]
        closures.append((f"seat{i}", f"end{i}"))
    frames = place_frames(placed)
    return home_posture(Robot("gough", "platform", frames, tuple(closures)))


X, Y = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
SEVENTH = ([0.0, 0.0, 0.0], [0.1, 0.0, 0.5])
LENGTHS = np.array([40, -25, 10, -35, 20, 30]) * 1e-6


def inverse_jacobian():
    """Compute the map from leg lengths to the platform screw from Pluecker lines."""
    base, top = gough_points()
    along = (top - base) / np.linalg.norm(top - base, axis=1, keepdims=True)
    arms = top - [0, 0, 0.5]
    return np.linalg.inv(np.hstack([np.cross(arms, along), along]))


def join_legs(count, but=()):
    return tuple(
        Join(f"join {i}", (f"seat{i}", f"end{i}"))
        for i in range(1, count + 1)
        if i not in but
    )


def test_gough_platform_moves_by_the_inverse_jacobian_without_force():
    last = assemble_in_steps(Plan(join_legs(6)), gough(LENGTHS))[-1]
    expected = inverse_jacobian() @ LENGTHS
    assert last.platform_screw[0] == pytest.approx(expected, rel=1e-9)
    assert np.linalg.norm(expected[3:]) == pytest.approx(23.3e-6, abs=0.05e-6)
    assert np.linalg.norm(expected[:3]) == pytest.approx(189e-6, abs=0.5e-6)
    assert last.energy == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(
    ("components", "change", "left"),
    [(("TZ",), -40.0e-6, 6.6e-6), (("TX", "TY", "TZ"), -34.1e-6, 5.4e-6)],
)
def test_one_adjustable_leg_corrects_one_reading_but_not_the_whole_pose(
    components, change, left
):
    reading = Measure("pose", "platform", components)
    steps = (*join_legs(6), Adjust("shim", "leg6", ("TZ",), reading))
    last = assemble_in_steps(Plan(steps), gough(LENGTHS))[-1]
    assert last.adjustment[0, 0] == pytest.approx(change, abs=0.05e-6)
    assert np.linalg.norm(last.platform_screw[0, 3:]) == pytest.approx(left, abs=5e-8)


def test_seventh_leg_cut_to_the_measured_length_is_free_of_force():
    """If pinned, it is open by gamma: S = k / (1 + sum of shares^2), W = S
    gamma^2/2.
    """
    J = inverse_jacobian()
    a, b = map(np.array, SEVENTH)
    along = (b - a) / np.linalg.norm(b - a)
    line = np.r_[np.cross(b - [0, 0, 0.5], along), along]
    shares = line @ J
    gamma = shares @ LENGTHS
    S = 5e6 / (1 + shares @ shares)
    posture, last = gough(np.r_[LENGTHS, 0.0], seventh=True), ("seat7", "end7")
    pinned = assemble_in_steps(Plan((*join_legs(6), Join("last", last))), posture)[-1]
    assert pinned.closing_force == pytest.approx(S * abs(gamma), rel=1e-6)
    assert pinned.work == pytest.approx(S * gamma**2 / 2, rel=1e-6)
    assert np.linalg.norm(pinned.opening[0, 3:]) == pytest.approx(abs(gamma), rel=1e-6)
    cut = Adjust("cut", "leg7", ("TZ",), Measure("gap", last))
    results = assemble_in_steps(Plan((*join_legs(6), cut, Join("last", last))), posture)
    assert abs(results[-2].adjustment[0, 0]) == pytest.approx(abs(gamma), rel=1e-6)
    assert results[-1].closing_force == pytest.approx(0.0, abs=1e-6)
    assert results[-1].platform_screw[0] == pytest.approx(J @ LENGTHS, rel=1e-6)


def test_spring_of_a_fixture_shares_the_closing_force():
    """A leg is closed against a fixture of 2e6 N/m, in series with it."""
    fix = Fix("fixture", "platform", {"TZ": 0.0}, {"TZ": 2e6})
    results = assemble_in_steps(Plan((fix, join_leg(1))), three_legs_alone())
    series = 1e6 * 2e6 / 3e6
    assert results[-1].closing_force == pytest.approx(series * 30e-6)
    assert results[-1].energy == pytest.approx(series * 30e-6**2 / 2)
    assert results[-1].platform_screw[0, 5] == pytest.approx(10e-6)


def three_legs_alone():
    """Leg 1 of the three legs."""
    return legs_with_pins((30e-6,), (None,), k=(1e6,))


def test_weight_bends_the_leg_before_the_slot_is_bolted():
    """100 N on leg 1 of 1e6 N/m move it down by 100 um, where leg 2 is bolted in its
    slot.
    """
    posture = legs_with_pins((0.0, 0.0), (None, None), k=(1e6, 1e6))
    frames = [
        replace(f, mass=10.0) if f.name == "platform" else f
        for f in posture.robot.frames
    ]
    posture = home_posture(replace(posture.robot, frames=tuple(frames)))
    down = [0, 0, -10.0]
    for second, expected in (
        (join_leg(2, locked=Z), -100e-6),
        (join_leg(2), -50e-6),
    ):
        plan = Plan((join_leg(1), second))
        results = assemble_in_steps(plan, posture, gravity=down)
        assert results[0].platform_screw[0, 5] == pytest.approx(-100e-6)
        assert results[1].platform_screw[0, 5] == pytest.approx(expected)


def test_preload_on_a_part_without_support_is_rejected():
    press = Preload("press", "platform", np.array([0, 0, 0, 0, 0, -10.0]))
    with pytest.raises(FreeMotion, match="nothing resists"):
        assemble_in_steps(Plan((press,)), legs_open())


def legs_open():
    """Three legs on a platform that is free before the first leg is joined."""
    posture = three_legs()
    return replace(posture, robot=replace(posture.robot, closures=()))


def test_pose_errors_of_legs_cut_to_increments_follow_from_length_rounding(rng):
    """All six legs are cut in increments of 10 um: x = J r, |r| <= 5 um; at most 11.9,
    12.4, 6.1 um.
    """
    cuts = tuple(
        Adjust(
            f"cut {i}",
            f"leg{i}",
            ("TZ",),
            Measure("gap", (f"seat{i}", f"end{i}")),
            1e-5,
        )  # fmt: skip
        for i in range(1, 7)
    )
    held = Fix("fixture", "platform", dict.fromkeys(SCREW, 0.0))
    plan = Plan((held, *cuts, *join_legs(6), Release("free", ("fixture",))))
    posture = gough(np.zeros(6))
    lengths = rng.uniform(-1e-4, 1e-4, (50, 6))
    errors = np.zeros((50, len(posture.robot.frames), 6))
    for i in range(6):
        errors[:, posture.robot.index(f"leg{i + 1}"), 5] = lengths[:, i]
    last = assemble_in_steps(plan, posture, errors)[-1]
    J = inverse_jacobian()
    rounding = lengths - 1e-5 * np.round(lengths / 1e-5)
    assert last.platform_screw == pytest.approx(rounding @ J.T, abs=1e-12)
    most = 5e-6 * np.abs(J).sum(axis=1)
    assert most[3:] == pytest.approx([11.9e-6, 12.4e-6, 6.1e-6], abs=0.05e-6)
    assert (np.abs(last.platform_screw) <= most).all()


@pytest.mark.parametrize(("increment", "change"), [(0.0, -50e-6), (40e-6, -40e-6)])
def test_shim_closes_a_loop_without_force_at_the_clearance_position(increment, change):
    """Pin 1 lies in the middle of +- 20 um: leg 2, 50 um long, is cut to it; rounded to
    40 um, the clearance takes up the remaining 10 um.
    """
    posture = legs_with_pins((0.0, 50e-6), (20e-6, None), k=(1e6, 1e6))
    shim = Adjust("shim", "leg2", ("TZ",), Measure("gap", LEG[2]), increment)
    steps = (join_leg(1), shim, join_leg(2))
    results = assemble_in_steps(Plan(steps), posture)
    assert results[1].adjustment[0, 0] == pytest.approx(change, rel=1e-6)
    assert results[2].closing_force == pytest.approx(0.0, abs=1e-5)
    alone = assemble_in_steps(Plan((join_leg(1), join_leg(2))), posture)
    assert alone[-1].closing_force == pytest.approx(15.0)  # 30 um on 5e5 N/m


@pytest.mark.parametrize(
    ("name", "component"), [("four_bar", "TZ"), ("3rrr", "RX"), ("four_bar", "TX")]
)
def test_computed_shim_minimises_the_energy_of_a_robot_with_clearances(
    name, component, rng
):
    """The reference is a scan of shim lengths, each closed with loose clearances."""
    robot = load_robot(name)
    errors = rng.normal(size=robot.errors.shape) * np.repeat([3e-3, 3e-4], 3)
    posture = home_posture(robot.with_errors(errors))
    *others, last = robot.closures
    frame = robot.frame(last[1])
    joins = tuple(Join(f"{i}", part) for i, part in enumerate(others))
    shim = Adjust("shim", frame.name, (component,), Measure("gap", last))
    results = assemble_in_steps(Plan((*joins, shim, Join("last", last))), posture)
    change, found = results[-2].adjustment[0, 0], results[-1].energy[0]
    energies = []
    for other in change + np.array([-1e-4, -1e-5, 1e-5, 1e-4]):
        moved = errors.copy()
        moved[robot.index(frame.name), SCREW.index(component)] += other
        other_posture = home_posture(robot.with_errors(moved))
        closed = assemble_in_steps(Plan((*joins, Join("last", last))), other_posture)
        energies.append(closed[-1].energy[0])
    assert found <= min(energies) * (1 + 1e-6) + 1e-10
    if component == "TX":  # in the plane, where the joints close without a shim
        assert change == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("stiffness", [(1e6, 1e6), (1e6, 3e6)])
@pytest.mark.parametrize("weight", [10.0, -10.0])
def test_shim_under_a_weight_distributes_it_by_stiffness(stiffness, weight):
    """The weight presses pin 1 to an end of +-20 um; the energy of both legs is minimal
    where both have equal deformation F / (k1 + k2): leg 2 is cut to that end.
    """
    posture = legs_with_pins((0.0, 50e-6), (20e-6, None), k=stiffness)
    load = Preload("weight", "platform", np.array([0, 0, 0, 0, 0, weight]))
    shim = Adjust("shim", "leg2", ("TZ",), Measure("gap", LEG[2]))
    results = assemble_in_steps(Plan((join_leg(1), load, shim, join_leg(2))), posture)
    end = np.copysign(20e-6, weight)
    assert results[2].adjustment[0, 0] == pytest.approx(end - 50e-6, rel=1e-6)
    expected = weight**2 / (2 * sum(stiffness))
    assert results[3].energy[0] == pytest.approx(expected, rel=1e-6)


def test_shim_under_a_platform_that_rests_on_a_pin_restores_its_height():
    """10 N compress leg 1 by 10 um and move pin 1 to -20 um, so 30 um are missing at 0
    um.
    """
    posture = legs_with_pins((0.0, 50e-6), (20e-6, None), k=(1e6, 1e6))
    load = Preload("weight", "platform", np.array([0, 0, 0, 0, 0, -10.0]))
    shim = Adjust("shim", "leg1", ("TZ",), Measure("z", "platform", Z))
    results = assemble_in_steps(Plan((join_leg(1), load, shim, join_leg(2))), posture)
    assert results[2].adjustment[0, 0] == pytest.approx(30e-6, rel=1e-6)
    assert results[2].platform_screw[0, 5] == pytest.approx(0.0, abs=1e-11)


def test_shims_of_many_machines_under_a_weight_are_computed_together(rng):
    """Leg 2 is cut to the end of pin 1 in every machine, whatever their lengths."""
    posture = legs_with_pins((0.0, 0.0), (20e-6, None), k=(1e6, 2e6))
    load = Preload("weight", "platform", np.array([0, 0, 0, 0, 0, -10.0]))
    shim = Adjust("shim", "leg2", ("TZ",), Measure("gap", LEG[2]))
    lengths = rng.uniform(-1e-4, 1e-4, (20, 2))
    errors = np.zeros((20, len(posture.robot.frames), 6))
    for i in (1, 2):
        errors[:, posture.robot.index(f"leg{i}"), 5] = lengths[:, i - 1]
    steps = (join_leg(1), load, shim, join_leg(2))
    found = assemble_in_steps(Plan(steps), posture, errors)[2].adjustment[:, 0]
    assert found == pytest.approx(lengths[:, 0] - 20e-6 - lengths[:, 1], abs=1e-10)


def test_shim_in_a_bolted_joint_among_loose_clearances_is_rejected():
    posture = legs_with_pins((0.0, 30e-6), (20e-6, 20e-6))
    shim = Adjust("shim", "leg2", ("TZ",), Measure("gap", LEG[2]))
    steps = (join_leg(1), Join("bolt", "leg2"), shim, join_leg(2))
    with pytest.raises(BadInput, match="whose joint is bolted"):
        assemble_in_steps(Plan(steps), posture)


@pytest.mark.parametrize("name", ["four_bar", "five_bar", "3rrr", "irsbot2", "delta"])
def test_pinned_robots_with_clearances_store_the_energy_of_solve_assembly(name, rng):
    """The compiled solver eliminates independently; every order leads to its energy."""
    robot = load_robot(name)
    errors = rng.normal(size=robot.errors.shape) * np.repeat([3e-3, 3e-4], 3)
    if name == "irsbot2":  # other parts of its parallelograms are rigid
        known = ("elbow_a", "link_a", "elbow_b", "link_b", "loop2_platform", "tip")
        errors[[not f.name.endswith(known) for f in robot.frames]] = 0.0
    posture = home_posture(robot.with_errors(errors))
    order = rng.permutation(len(robot.closures))
    joins = (Join(f"{i}", robot.closures[i]) for i in order)
    results = assemble_in_steps(Plan(tuple(joins)), posture)
    expected = solve_assembly(posture)
    assert results[-1].energy[0] == pytest.approx(expected.energy, rel=1e-5, abs=1e-9)
    work = sum(result.work + result.load_work for result in results)
    assert work == pytest.approx(results[-1].energy, rel=1e-9, abs=1e-12)
