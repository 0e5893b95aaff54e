"""Tests of assembly in steps against closed-form solutions for springs.

The position of a platform on three legs is x = sum k d / sum k.
"""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

import forcefit as ff
from forcefit import BadInput, Clearance, Frame, Robot, load_robot, solve_assembly
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.placed_frames import place_frames
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
from forcefit.stiffness.screws import SCREW
from tests.assembly.steps.robots_for_steps import (
    gough_points,
    guided,
    leg,
    planar_platform,
    portal,
    spring,
    three_legs,
    two_bars,
)

LEG = {i: ("platform", f"leg{i}") for i in (1, 2, 3)}
Z = ("TZ",)
SHIM = Adjust("shim", "leg2", Z, Measure("gap", LEG[2]))


def join_leg(i, **more):
    return Join(f"join {i}", LEG[i], **more)


def weight(force):
    """Return a preload along z on the platform."""
    return Preload("weight", "platform", np.array([0, 0, 0, 0, 0, force]))


def test_energy_of_two_bars_equals_closed_form():
    """The force is F = g k1 k2 / (k1 + k2), and the energy is E = F g / 2."""
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


def test_energy_of_plan_from_file_equals_closed_form(tmp_path):
    """The force is 150 N, and the energy half of its product with the gap of 0.2 mm."""
    file = tmp_path / "steps.toml"
    file.write_text('[[step]]\njoin = ["wall", "bar2"]\n')
    (closed,) = ff.assemble_in_steps(file, two_bars(2e-4))
    assert closed.closing_force == pytest.approx(150.0)
    assert closed.energy == pytest.approx(15e-3)


def test_opening_that_remains_at_force_limit_equals_closed_form():
    """A force of 90 N, 60 % of 150 N, closes 60 % of the gap of 200 um."""
    bolt = Join("bolt", ("wall", "bar2"), force_limit=90.0, leave_open=True)
    (closed,) = assemble_in_steps(Plan((bolt,)), two_bars(2e-4))
    assert closed.exceeded.all()
    assert closed.closing_force == pytest.approx(90.0)
    assert abs(closed.left_open[0, 5]) == pytest.approx(8e-5)
    assert closed.energy == pytest.approx(5.4e-3)


@pytest.mark.parametrize("order", list(permutations((1, 2, 3))))
def test_final_state_of_pinned_legs_does_not_depend_on_order(order):
    """The forces of the legs are k (x - d) with x = sum k d / sum k."""
    last = assemble_in_steps(Plan(tuple(join_leg(i) for i in order)), three_legs())[-1]
    assert last.platform_screw[0, 5] == pytest.approx(140 / 6 * 1e-6)
    assert last.energy == pytest.approx(2.966667e-3, rel=1e-6)
    forces = [abs(last.wrenches[f"join {i}"][0, 5]) for i in (1, 2, 3)]
    assert forces == pytest.approx([6.666667, 86.666667, 80.0], rel=1e-6)


@pytest.mark.parametrize(
    ("last", "x", "energy"),
    [(1, 22.0e-6, 2.94e-3), (2, 45.0e-6, 0.15e-3), (3, -10e-6 / 3, 0.8333333e-3)],
)
def test_bolting_the_last_leg_does_not_change_the_pose(last, x, energy):
    first = [i for i in (1, 2, 3) if i != last]
    steps = (*(join_leg(i) for i in first), join_leg(last, locked=Z))
    result = assemble_in_steps(Plan(steps), three_legs())[-1]
    assert result.platform_screw[0, 5] == pytest.approx(x)
    assert result.energy == pytest.approx(energy, rel=1e-6)
    assert result.closing_force == pytest.approx(0.0, abs=1e-9)


def test_clamped_platform_springs_back_after_release():
    """Leg 3 is bolted at 10 um without a force."""
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
def test_result_depends_on_order_if_pin_moves_slot(place, order, z, turn, energy):
    """A pin at 0.1 m with an error of 40 um moves the slot at 0.3 m."""
    posture = planar_platform([0.0, 0.4, 0.1, place], [0, 0, 40e-6, 0])
    steps = tuple(
        Join(f"join {i}", (f"seat{i}", f"end{i}"), locked=Z if i == 4 else ())
        for i in (1, 2, *order)
    )
    result = assemble_in_steps(Plan(steps), posture)[-1]
    slope = -result.platform_screw[0, 1]  # a positive RY moves points with x > 0 down
    assert slope == pytest.approx(turn)
    assert result.energy == pytest.approx(energy, rel=1e-6)
    assert result.platform_screw[0, 5] == pytest.approx(z)


def test_portal_welded_to_bent_base_springs_back():
    """The stiffness of the bent base is 2 EI / L, in parallel with the portal."""
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
        weight(-30.0), join_leg(3, locked=Z), Release("free", ("clamp",)),
        Release("end", ("weight",)),
    )  # fmt: skip
    results = assemble_in_steps(Plan(steps), three_legs())
    work = sum(r.work + r.load_work for r in results)
    lost = sum(r.lost for r in results)
    assert work == pytest.approx(results[-1].energy + lost, rel=1e-9)
    assert lost > 0
    for result in results:
        assert np.abs(result.balance).max() < 1e-12 * 0.01 + 1e-15


def legs_with_pins(places, bounds, k=(None, None, 2e6)):
    """Return a platform that moves along z, with pins and elastic legs."""
    gaps = [None if bound is None else Clearance(axial=bound) for bound in bounds]
    legs = enumerate(zip(k, places, gaps, strict=False), 1)
    return guided([leg(f"leg{i}", k, d, clearance=gap) for i, (k, d, gap) in legs])


@pytest.mark.parametrize("order", [(1, 2), (2, 1)])
def test_platform_on_two_pins_is_within_both_clearances(order):
    """Pins at 0 +- 20 um and 30 +- 20 um allow positions between 10 and 20 um."""
    posture = legs_with_pins((0.0, 30e-6), (20e-6, 20e-6))
    results = assemble_in_steps(Plan(tuple(join_leg(i) for i in order)), posture)
    z = results[-1].platform_screw[0, 5]
    assert 10e-6 - 1e-12 < z < 20e-6 + 1e-12
    assert results[-1].energy == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("at", "force"), [(-20e-6, 60.0), (0.0, 20.0), (10e-6, 0.0), (15e-6, 0.0)]
)
def test_energy_with_slot_bolted_after_first_pin_equals_closed_form(at, force):
    """Pin 2 moves the platform to 10 um or more, against a spring of 2e6 N/m."""
    posture = legs_with_pins((0.0, 30e-6, 0.0), (20e-6, 20e-6, None))
    steps = (
        join_leg(1), Fix("clamp", "platform", {"TZ": at}), join_leg(3, locked=Z),
        Release("free", ("clamp",)), join_leg(2),
    )  # fmt: skip
    last = assemble_in_steps(Plan(steps), posture)[-1]
    assert abs(last.wrenches["join 3"][0, 5]) == pytest.approx(force, abs=1e-3)
    assert last.energy == pytest.approx(force**2 / 4e6, abs=1e-7)


def test_bolted_joint_keeps_its_position():
    """Pin 1 is bolted at the position -20 um."""
    posture = legs_with_pins((0.0, 30e-6), (20e-6, None), k=(1e6, None))
    steps = (join_leg(1), weight(-5.0), Join("bolt", "leg1"),
             Release("no weight", ("weight",)), join_leg(2))  # fmt: skip
    last = assemble_in_steps(Plan(steps), posture)[-1]
    # pin 2 lifts the platform from -20 um to 30 um
    assert abs(last.wrenches["join 1"][0, 5]) == pytest.approx(50.0, rel=1e-6)


def gough(errors, seventh=False):
    """Return a Gough platform whose legs have a stiffness of 5e6 N/m."""
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
    """Return the matrix that converts leg lengths to the platform screw."""
    base, top = gough_points()
    along = (top - base) / np.linalg.norm(top - base, axis=1, keepdims=True)
    arms = top - [0, 0, 0.5]
    return np.linalg.inv(np.hstack([np.cross(arms, along), along]))


JOIN_LEGS = tuple(Join(f"join {i}", (f"seat{i}", f"end{i}")) for i in range(1, 7))


def test_displacement_of_gough_platform_agrees_with_jacobian():
    last = assemble_in_steps(Plan(JOIN_LEGS), gough(LENGTHS))[-1]
    expected = inverse_jacobian() @ LENGTHS
    assert last.platform_screw[0] == pytest.approx(expected, rel=1e-9)
    assert np.linalg.norm(expected[3:]) == pytest.approx(23.3e-6, abs=0.05e-6)
    assert np.linalg.norm(expected[:3]) == pytest.approx(189e-6, abs=0.5e-6)
    assert last.energy == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(("rows", "change"), [([5], -40.0e-6), ([3, 4, 5], -34.1e-6)])
def test_adjusted_leg_minimises_the_measured_pose_components(rows, change):
    """A change c of leg 6 minimises |J (L + c e6)| over the measured components."""
    J = inverse_jacobian()
    along, error = J[rows, 5], (J @ LENGTHS)[rows]
    expected = -(along @ error) / (along @ along)
    assert expected == pytest.approx(change, abs=0.05e-6)
    components = tuple(SCREW[row] for row in rows)
    steps = Adjust("shim", "leg6", ("TZ",), Measure("pose", "platform", components))
    last = assemble_in_steps(Plan((*JOIN_LEGS, steps)), gough(LENGTHS))[-1]
    assert last.adjustment[0, 0] == pytest.approx(expected, rel=1e-6)
    lengths = LENGTHS + expected * np.eye(6)[5]
    np.testing.assert_allclose(
        last.platform_screw[0], J @ lengths, rtol=1e-6, atol=1e-12
    )


def test_adjusted_seventh_leg_has_no_closing_force():
    """Without an adjustment, the closing force is S gamma for an opening gamma."""
    J = inverse_jacobian()
    a, b = map(np.array, SEVENTH)
    along = (b - a) / np.linalg.norm(b - a)
    line = np.r_[np.cross(b - [0, 0, 0.5], along), along]
    shares = line @ J
    gamma = shares @ LENGTHS
    S = 5e6 / (1 + shares @ shares)
    posture, last = gough(np.r_[LENGTHS, 0.0], seventh=True), ("seat7", "end7")
    pinned = assemble_in_steps(Plan((*JOIN_LEGS, Join("last", last))), posture)[-1]
    assert pinned.closing_force == pytest.approx(S * abs(gamma), rel=1e-6)
    assert pinned.work == pytest.approx(S * gamma**2 / 2, rel=1e-6)
    assert np.linalg.norm(pinned.opening[0, 3:]) == pytest.approx(abs(gamma), rel=1e-6)
    cut = Adjust("cut", "leg7", ("TZ",), Measure("gap", last))
    results = assemble_in_steps(Plan((*JOIN_LEGS, cut, Join("last", last))), posture)
    assert abs(results[-2].adjustment[0, 0]) == pytest.approx(abs(gamma), rel=1e-6)
    assert results[-1].closing_force == pytest.approx(0.0, abs=1e-6)
    assert results[-1].platform_screw[0] == pytest.approx(J @ LENGTHS, rel=1e-6)


def test_closing_force_with_elastic_fixture_equals_closed_form():
    """The leg and the fixture are springs in series."""
    fix = Fix("fixture", "platform", {"TZ": 0.0}, {"TZ": 2e6})
    one_leg = legs_with_pins((30e-6,), (None,), k=(1e6,))
    results = assemble_in_steps(Plan((fix, join_leg(1))), one_leg)
    series = 1e6 * 2e6 / 3e6
    assert results[-1].closing_force == pytest.approx(series * 30e-6)
    assert results[-1].energy == pytest.approx(series * 30e-6**2 / 2)
    assert results[-1].platform_screw[0, 5] == pytest.approx(10e-6)


def test_weight_compresses_leg_before_slot_is_bolted():
    """A weight of 100 N compresses leg 1 by 100 um before leg 2 is joined."""
    posture = legs_with_pins((0.0, 0.0), (None, None), k=(1e6, 1e6))
    guide, platform, *legs = posture.robot.frames
    frames = (guide, replace(platform, mass=10.0), *legs)
    posture = home_posture(replace(posture.robot, frames=frames))
    for second, expected in ((join_leg(2, locked=Z), -100e-6), (join_leg(2), -50e-6)):
        plan = Plan((join_leg(1), second))
        results = assemble_in_steps(plan, posture, gravity=[0, 0, -10.0])
        assert results[0].platform_screw[0, 5] == pytest.approx(-100e-6)
        assert results[1].platform_screw[0, 5] == pytest.approx(expected)


def test_preload_on_free_platform_is_rejected():
    with pytest.raises(FreeMotion, match="nothing resists"):
        assemble_in_steps(Plan((weight(-10.0),)), guided([]))


def test_pose_error_equals_jacobian_times_rounding_of_lengths(rng):
    """The leg lengths are adjusted in increments of 10 um, so x = J r, |r| <= 5 um."""
    cuts = tuple(
        Adjust(f"cut {i}", f"leg{i}", Z, Measure("gap", (f"seat{i}", f"end{i}")), 1e-5)
        for i in range(1, 7)
    )
    held = Fix("fixture", "platform", dict.fromkeys(SCREW, 0.0))
    plan = Plan((held, *cuts, *JOIN_LEGS, Release("free", ("fixture",))))
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
def test_shim_makes_closing_force_zero(increment, change):
    """Leg 2 is too long by 50 um, and pin 1 has a clearance of +- 20 um.

    If the shim is rounded to 40 um, the clearance compensates the other 10 um.
    """
    posture = legs_with_pins((0.0, 50e-6), (20e-6, None), k=(1e6, 1e6))
    shim = Adjust("shim", "leg2", ("TZ",), Measure("gap", LEG[2]), increment)
    steps = (join_leg(1), shim, join_leg(2))
    results = assemble_in_steps(Plan(steps), posture)
    assert results[1].adjustment[0, 0] == pytest.approx(change, rel=1e-6)
    assert results[2].closing_force == pytest.approx(0.0, abs=1e-5)
    alone = assemble_in_steps(Plan((join_leg(1), join_leg(2))), posture)
    assert alone[-1].closing_force == pytest.approx(15.0)  # 30 um x 5e5 N/m


@pytest.mark.parametrize(
    ("name", "component"), [("four_bar", "TZ"), ("3rrr", "RX"), ("four_bar", "TX")]
)
def test_shim_minimises_energy_of_robot_with_clearances(name, component, rng):
    """The energy is compared with the energies for other lengths of the shim."""
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
    if component == "TX":  # the loop closes without a shim in the plane
        assert change == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("stiffness", [(1e6, 1e6), (1e6, 3e6)])
@pytest.mark.parametrize("force", [10.0, -10.0])
def test_shim_under_weight_minimises_energy(stiffness, force):
    """The weight moves pin 1 to the end of its clearance of +- 20 um.

    The energy is minimal if both legs have the same deformation F / (k1 + k2).
    """
    posture = legs_with_pins((0.0, 50e-6), (20e-6, None), k=stiffness)
    load = weight(force)
    results = assemble_in_steps(Plan((join_leg(1), load, SHIM, join_leg(2))), posture)
    end = np.copysign(20e-6, force)
    assert results[2].adjustment[0, 0] == pytest.approx(end - 50e-6, rel=1e-6)
    expected = force**2 / (2 * sum(stiffness))
    assert results[3].energy[0] == pytest.approx(expected, rel=1e-6)


def test_shim_compensates_height_under_weight():
    """A load of 10 N compresses leg 1 by 10 um and moves pin 1 by 20 um."""
    posture = legs_with_pins((0.0, 50e-6), (20e-6, None), k=(1e6, 1e6))
    load = weight(-10.0)
    shim = Adjust("shim", "leg1", Z, Measure("z", "platform", Z))
    results = assemble_in_steps(Plan((join_leg(1), load, shim, join_leg(2))), posture)
    assert results[2].adjustment[0, 0] == pytest.approx(30e-6, rel=1e-6)
    assert results[2].platform_screw[0, 5] == pytest.approx(0.0, abs=1e-11)


def test_shims_of_many_machines_equal_length_differences(rng):
    """The shim is compared with the length error of each machine."""
    posture = legs_with_pins((0.0, 0.0), (20e-6, None), k=(1e6, 2e6))
    load = weight(-10.0)
    lengths = rng.uniform(-1e-4, 1e-4, (20, 2))
    errors = np.zeros((20, len(posture.robot.frames), 6))
    for i in (1, 2):
        errors[:, posture.robot.index(f"leg{i}"), 5] = lengths[:, i - 1]
    steps = (join_leg(1), load, SHIM, join_leg(2))
    found = assemble_in_steps(Plan(steps), posture, errors)[2].adjustment[:, 0]
    assert found == pytest.approx(lengths[:, 0] - 20e-6 - lengths[:, 1], abs=1e-10)


def test_shim_in_bolted_joint_is_rejected():
    posture = legs_with_pins((0.0, 30e-6), (20e-6, 20e-6))
    steps = (join_leg(1), Join("bolt", "leg2"), SHIM, join_leg(2))
    with pytest.raises(BadInput, match="whose joint is bolted"):
        assemble_in_steps(Plan(steps), posture)


@pytest.mark.parametrize("name", ["four_bar", "five_bar", "3rrr", "irsbot2", "delta"])
def test_energy_of_pinned_robot_agrees_with_solve_assembly(name, rng):
    """The energy after random orders of joining is compared."""
    robot = load_robot(name)
    errors = rng.normal(size=robot.errors.shape) * np.repeat([3e-3, 3e-4], 3)
    if name == "irsbot2":  # errors of rigid loops cannot be closed
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
