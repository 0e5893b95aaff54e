"""Lagged variables, compared with the differential equation."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from forcefit.assembly.measurement.history import in_order

TIMES = np.array([3.0, 10.0, 10.0, 35.0, 36.0, 90.0])
VALUES = np.array([1.0, 4.0, -2.0, -2.0, 5.0, 5.0])


def by_integration(times, values, time_constant, held):
    """Return the solution of tau y' = u - y with y = 0 at time 0."""
    state, answers = 0.0, []
    before, last = values[0], 0.0
    for time, value in zip(times, values, strict=True):
        start = value if held else before

        def slope(t, y, start=start, last=last, time=time, value=value):
            share = (t - last) / (time - last)
            return (start + share * (value - start) - y) / time_constant

        if time > last:
            found = solve_ivp(slope, (last, time), [state], rtol=1e-10, atol=1e-12)
            state = float(found.y[0, -1])
        answers.append(state)
        before, last = value, time
    return answers


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("time_constant", [0.5, 20.0, 1e4])
def test_lagged_variable_equals_the_solution_of_its_equation(held, time_constant):
    """Two readings have the same time."""
    history, row = in_order({"time": TIMES, "u": VALUES}, None)
    assert row.tolist() == [*range(6)]
    found = history.lagged("u", time_constant, held=held)
    expected = by_integration(TIMES, VALUES, time_constant, held)
    assert found == pytest.approx(expected, rel=1e-7, abs=1e-9)
    assert history.fading(time_constant) == pytest.approx(
        np.exp(-TIMES / time_constant)
    )


def test_history_does_not_depend_on_other_sessions_and_row_order(rng):
    """The state at each reading depends only on readings of the same session."""
    mixed = rng.permutation(12)
    times, values = np.tile(TIMES, 2)[mixed], np.r_[VALUES, 2 * VALUES][mixed]
    session = np.repeat(["warm", "cold"], 6)[mixed]
    history, row = in_order({"time": times, "u": values}, session)
    found = history.lagged("u", 20.0)[row]
    for name in ("warm", "cold"):
        own = np.flatnonzero(session == name)
        own = own[np.argsort(times[own], kind="stable")]
        by_itself, _ = in_order({"time": times[own], "u": values[own]}, None)
        assert found[own] == pytest.approx(by_itself.lagged("u", 20.0))


def directions_by_hand(values, session, approach):
    """Return the sign of the last change, or the approach direction."""
    found = []
    for i, value in enumerate(values):
        if i == 0 or session[i] != session[i - 1]:
            sign = approach[i]
            known = False
        elif abs(value - values[i - 1]) > 1e-9:
            sign, known = np.sign(value - values[i - 1]), True
        elif not known:
            sign = approach[i]
        found.append(sign)
    return found


def test_approach_direction_equals_that_of_the_last_motion(rng):
    """Sessions start at arbitrary readings, and some changes are negligible."""
    for _ in range(30):
        count = int(rng.integers(1, 9))
        values = np.cumsum(rng.choice([-1.0, 0.0, 0.0, 5e-10, 1.0], count))
        session = np.sort(rng.integers(0, 3, count))
        approach = rng.choice([-1.0, 1.0], count)
        given = {"time": np.arange(count), "u": values, "approach": approach}
        history, row = in_order(given, session)
        assert row.tolist() == list(range(count))
        expected = directions_by_hand(values, session, approach)
        assert history.direction("u").tolist() == expected
        assert history.direction("approach").tolist() == approach.tolist()
