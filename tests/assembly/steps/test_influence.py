"""Tests of the influence of joins on each other."""

from itertools import permutations

import numpy as np
import pytest

from forcefit.assembly.report.steps import steps_of
from forcefit.assembly.steps.influence import influences
from forcefit.assembly.steps.machine import machine_at
from forcefit.assembly.steps.plan import Join, Measure, Plan
from forcefit.assembly.steps.run import assemble_in_steps, carry_out
from forcefit.assembly.steps.state import first_state
from tests.assembly.steps.robots_for_steps import planar_platform, three_legs

Z = ("TZ",)


def join(i, locked=()):
    return Join(f"join {i}", (f"seat{i}", f"end{i}"), locked=locked)


def after(posture, *done, run=()):
    """Return the influences of the joins ``run`` after the joins ``done``."""
    plan, machine = Plan((*done, *run)), machine_at(posture)
    state = first_state(machine, plan, None, None)
    for step in done:
        state, _ = carry_out(machine, state, step)
    return influences(machine, state, run)


@pytest.mark.parametrize(("place", "expected"), [(0.3, 3.75e-7), (0.6, 0.0)])
def test_influence_of_pin_on_slot_equals_closed_form(place, expected):
    """For springs at 0 and L, it is ((1 - a/L)(1 - s/L) + a s / L^2) / k."""
    by_hand = ((1 - 0.1 / 0.4) * (1 - place / 0.4) + 0.1 * place / 0.16) / 1e6
    assert by_hand == pytest.approx(expected, abs=1e-20)
    posture = planar_platform([0.0, 0.4, 0.1, place], [0, 0, 40e-6, 0])
    (pair,) = after(posture, join(1), join(2), run=(join(3), join(4, Z)))
    assert (pair.locked, pair.joined) == ("join 4", "join 3")
    assert abs(pair.coefficients[0, 5]) == pytest.approx(expected, rel=1e-6, abs=1e-15)
    assert pair.zero == (expected == 0.0)


def test_influence_by_free_motion_is_not_zero():
    """The platform can move freely before the first leg is joined."""
    run = [Join(f"{i}", ("platform", f"leg{i}"), Z * (i == 3)) for i in (1, 2, 3)]
    for pair in after(three_legs(), run=run):
        assert pair.free
        assert not pair.zero


@pytest.mark.parametrize("places", [(0.1, 0.6), (0.1, 0.3), (0.2, 0.25)])
def test_order_matters_only_with_nonzero_influence(places, rng):
    """The results of all orders of two pins and a slot are compared."""
    posture = planar_platform([0.0, 0.4, *places, 0.1], rng.normal(size=5) * 3e-5)
    first, run = (join(1), join(2)), (join(3), join(4, Z), join(5))
    zero = all(pair.zero for pair in after(posture, *first, run=run))
    ends = [
        assemble_in_steps(Plan((*first, *order)), posture)[-1].platform_screw[0]
        for order in permutations(run)
    ]
    spread = np.ptp(ends, axis=0).max()
    assert zero == (spread < 1e-12)
    assert zero == (places[1] == 0.6)


def test_remarks_list_steps_that_move_a_slot():
    slot, pins = join(4, Z), (join(1), join(2))
    still = planar_platform([0.0, 0.4, 0.1, 0.6], [0, 0, 40e-6, 0])
    moved = planar_platform([0.0, 0.4, 0.1, 0.3], [0, 0, 40e-6, 0])
    plan = Plan((*pins, join(3), slot))
    remarks = steps_of(plan, moved)["remarks"]
    assert "order matters" in remarks[0]
    assert remarks[1].endswith("position, moved by join 1, join 2, join 3")
    look = Measure("look", "platform")
    remarks = steps_of(Plan((*pins, look, join(3), slot)), still)["remarks"]
    assert "does not change the assembled machine" in remarks[0]
    assert "found by join 4 (zero influence coefficients)" in remarks[0]
