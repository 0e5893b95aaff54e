"""States that lag behind what was varied, against the differential equation itself."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from assembly.measurement.history import in_order

TIMES = np.array([3.0, 10.0, 10.0, 35.0, 36.0, 90.0])
VALUES = np.array([1.0, 4.0, -2.0, -2.0, 5.0, 5.0])


def by_integration(times, values, time_constant, held):
    """tau y' = u - y from y = 0 at time 0: u held from the row before, or even."""
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
def test_a_lag_solves_its_equation(held, time_constant):
    """Rows of one moment too, between which nothing settles."""
    history, row = in_order({"time": TIMES, "u": VALUES}, None)
    assert row.tolist() == [*range(6)]
    found = history.lagged("u", time_constant, held=held)
    expected = by_integration(TIMES, VALUES, time_constant, held)
    assert found == pytest.approx(expected, rel=1e-7, abs=1e-9)
    assert history.fading(time_constant) == pytest.approx(
        np.exp(-TIMES / time_constant)
    )


def test_sessions_begin_anew_and_rows_may_come_in_any_order(rng):
    """Each row has the state that its own session gives it, whatever the others do."""
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
