"""Predictions with finite motions and contacts, compared with closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from forcefit.assembly.kinematics.posture import (
    home_posture,
    place_many_joints,
    together,
)
from forcefit.assembly.measurement.conditions import ContactLaw, Yield, as_declared
from forcefit.assembly.measurement.exact_rows import solve_rows
from forcefit.assembly.measurement.predict import (
    assemble_row,
    predict,
    with_finite_motions,
    with_rest_positions,
    with_second_order,
)
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from tests.linkages_for_tests import four_bar

LENGTH, STIFFNESS, FORCE = 0.8, 2e3, 150.0
Q = np.array([0.2, 1.1, 0.2, -0.7])  # [rad] drive commands, one of them repeated


def arm(stiffness=STIFFNESS):
    """Return a rigid bar on an elastic drive about z."""
    K = np.diag([np.inf, np.inf, stiffness, np.inf, np.inf, np.inf])
    return Robot("arm", "tip", (
        Frame("drive", joint="revolute", actuated=True, joint_stiffness=K),
        Frame("tip", "drive", [LENGTH, 0, 0]),
    ))  # fmt: skip


def rows(robot, force=FORCE, error=0.0):
    """Return conditions with a force along y and an angular error of the drive."""
    placed, _ = place_many_joints(robot, np.column_stack([Q, 0 * Q]))
    errors = np.zeros((2, 6))
    errors[0, 2] = error
    several = replace(together(placed), robot=robot.with_errors(errors))
    return as_declared(several, np.tile([0, 0, 0, 0, force, 0], (4, 1)))


def moved(turn):
    """Return exact and first-order tip displacements (4, 6) for rotations (4,)."""
    there = np.stack([np.cos(Q + turn), np.sin(Q + turn)], axis=1)
    slope = np.stack([-np.sin(Q), np.cos(Q)], axis=1) * np.reshape(turn, (-1, 1))
    nominal = np.stack([np.cos(Q), np.sin(Q)], axis=1)
    found = []
    for shift in (there - nominal, slope):
        screws = np.zeros((4, 6))
        screws[:, 2], screws[:, 3:5] = turn, LENGTH * shift
        found.append(screws)
    return found


def test_second_order_part_equals_finite_motion_without_load():
    """The second-order displacement along x is L (cos(q + e) - cos q + e sin q)."""
    e = 0.03
    here = rows(arm(), error=e)
    finite, linear = moved(np.full(4, e))
    found = with_second_order(here)
    assert found.second_order == pytest.approx(finite - linear, abs=1e-9)
    bent = moved(FORCE * LENGTH * np.cos(Q) / STIFFNESS)[1]
    seen = predict(found).deviation
    assert seen == pytest.approx(finite + bent, abs=1e-9)
    loose = replace(arm().frames[0], clearance=Clearance(radial=1e-5))
    same = rows(Robot("loose", "tip", (loose, arm().frames[1])), error=e)
    assert with_second_order(same) is same


@pytest.mark.parametrize("exact", [False, True])
def test_finite_motions_include_the_load_of_each_measurement(exact):
    """The rotation a of the drive satisfies K a = F L cos(q + e + a)."""
    e = 0.03
    here = replace(rows(arm(), error=e), exact=exact)
    turn = np.array([
        e + brentq(lambda a, b=b: STIFFNESS * a - FORCE * LENGTH * np.cos(b + e + a),
                   -1, 1, xtol=1e-14)
        for b in Q
    ])  # fmt: skip
    found = with_finite_motions(here)
    assert not found.exact
    linear = moved(e + FORCE * LENGTH * np.cos(Q) / STIFFNESS)[1]
    assert found.second_order == pytest.approx(moved(turn)[0] - linear, abs=1e-8)
    assert predict(found).deviation == pytest.approx(moved(turn)[0], abs=1e-8)


@pytest.mark.parametrize("exact", [False, True])
def test_measurement_with_a_contact_equals_the_closed_form(exact):
    """The rotation is a = F L cos(q + a) / K + (M / c)^(1/n)."""
    c, n, force = 5e4, 1.5, 20.0
    here = replace(rows(arm(), force), laws=(ContactLaw("drive", c, n),), exact=exact)

    def left(a, q):
        M = force * LENGTH * np.cos(q + a * exact)
        return M / STIFFNESS + np.sign(M) * (abs(M) / c) ** (1 / n) - a

    for k, q in enumerate(Q):
        turn = brentq(left, -1, 1, args=(q,), xtol=1e-14)
        one = assemble_row(here, k)
        # With finite motions, contacts converge to 1e-5.
        rel = 2e-5 if exact else 1e-9
        assert one.platform_screw[2] == pytest.approx(turn, rel=rel)
        assert predict(here).deviation[k, 2] == pytest.approx(turn, rel=1e-6)


def test_function_of_a_wrench_depends_on_finite_motions():
    """The rotation is a = F L cos(q + a) / K + b M^2."""
    b = 2e-6
    one = Yield("drive", 2, (("drive", 2),), np.zeros((4, 1)),
                lambda x, w: b * w[:, 0] ** 2)  # fmt: skip
    here = replace(rows(arm()), yields=(one,))
    for exact in (False, True):

        def left(a, q, exact=exact):
            M = FORCE * LENGTH * np.cos(q + a * exact)
            return M / STIFFNESS + b * M**2 - a

        turn = [brentq(left, -1, 1, args=(q,), xtol=1e-14) for q in Q]
        seen = predict(replace(here, exact=exact))
        assert list(seen.reason) == [""] * 4
        assert seen.deviation[:, 2] == pytest.approx(turn, rel=1e-6)


def test_measurement_with_an_open_loop_has_no_prediction():
    """In one measurement, the coupler of a four-bar has an out-of-plane error."""
    robot = four_bar()
    frames = tuple(
        replace(f, clearance=Clearance(radial=2e-5) if f.name == "wrist" else None)
        for f in robot.frames
    )
    robot = replace(robot, frames=frames)
    three = together([home_posture(robot)] * 3)
    here = as_declared(three, [0, 0, 0, 10.0, -20.0, 0])
    errors = here.errors.copy()
    errors[1, robot.index("elbow"), 5] = 1e-2
    here = replace(here, errors=errors)
    seen = predict(here)
    assert np.isnan(seen.deviation).all(axis=1).tolist() == [False, True, False]
    assert [bool(reason) for reason in seen.reason] == [False, True, False]
    assert seen.deviation[0] == pytest.approx(seen.deviation[2])
    rest = with_rest_positions(here).rest
    assert not rest[1].any()
    wrist = robot.index("wrist")
    assert np.linalg.norm(rest[0, wrist]) == pytest.approx(1.0, abs=1e-6)
    assert rest[0] == pytest.approx(rest[2])
    assert not np.delete(rest[0], wrist, axis=0).any()
    held = predict(replace(here, rest=rest).take([0]))
    assert held.deviation[0] == pytest.approx(seen.deviation[0], abs=1e-9)


@pytest.mark.parametrize("exact", [False, True])
def test_contact_in_parallel_with_a_spring_equals_closed_form(exact):
    """The displacement is x = f / K + (f / c)^(2/3) = (F - f) / K."""
    K, c, forces = 1e6, 3e8, [500.0, -2.0, 40.0]
    spring = np.diag([np.inf] * 5 + [K])
    slides = {"joint": "prismatic", "actuated": True, "joint_stiffness": spring}
    robot = Robot("pair", "end_a", (
        Frame("a", **slides), Frame("end_a", "a", [0.1, 0, 0]),
        Frame("b", **slides), Frame("end_b", "b", [0.1, 0, 0]),
    ), (("end_a", "end_b"),))  # fmt: skip
    three = together([home_posture(robot)] * 3)
    load = np.zeros((3, 6))
    load[:, 5] = forces
    here = replace(as_declared(three, load), laws=(ContactLaw("a", c, 1.5),))
    seen = predict(replace(here, exact=exact)).deviation
    give = np.zeros((3, 1))
    for k, (F, shift) in enumerate(zip(forces, seen[:, 5], strict=True)):
        own = brentq(lambda f, F=F: f / K + (f / c) ** (2 / 3) - (abs(F) - f) / K,
                     0.0, abs(F), xtol=1e-13)  # fmt: skip
        assert shift == pytest.approx(np.sign(F) * (abs(F) - own) / K, rel=1e-6)
        give[k] = np.sign(F) * (own / c) ** (2 / 3)
    # All measurements converge together.
    screws, converged = solve_rows(replace(here, exact=True), give)
    assert converged.all()
    assert screws == pytest.approx(seen, abs=1e-12)
