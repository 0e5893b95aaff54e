"""Many cone programs with equal matrices, compared with Clarabel."""

import numpy as np
import pytest

from forcefit.assembly.solvers.conic import minimise_energy
from forcefit.assembly.solvers.many_programmes import (
    Minima,
    closest_of_same_energy,
    minimise_energies,
)

GROUPS = {
    "discs and intervals": np.array([0, 0, 1, 2, 2, 3, 4, 4, 5]),
    "a ball": np.array([0, 0, 0, 1, 2, 2, 3, 3, 4]),
}


@pytest.mark.parametrize("group", GROUPS.values(), ids=GROUPS.keys())
@pytest.mark.parametrize("loads", [0.0, 1.0])
@pytest.mark.parametrize("rigid", [0, 2])
def test_energies_of_many_cone_programs_equal_those_of_clarabel(
    rng, group, loads, rigid
):
    """The certified gap is 1e-9 of the energy."""
    n, nu = 23, len(group)
    G, H = rng.normal(size=(4, nu)), rng.normal(size=(rigid, nu))
    h = rng.normal(size=(n, 4)) * np.logspace(-1, 1, n)[:, None]
    d = np.repeat(loads * rng.normal(size=(1, nu)), n, axis=0)
    k = 0.1 * rng.normal(size=(n, rigid))
    found = minimise_energies(G, h, d, H, k, group)
    assert found.feasible.all()
    strains = found.clearances @ G.T + h
    values = np.vecdot(strains, strains) / 2 - np.vecdot(d, found.clearances)
    for i in range(n):
        own = minimise_energy(G, h[i], d[i], H, k[i], group, method="reference")
        assert values[i] == pytest.approx(own.value, rel=2e-8, abs=1e-11 * h[i] @ h[i])
    assert found.clearances @ H.T == pytest.approx(k, abs=1e-9)


def test_equations_outside_the_clearances_are_infeasible():
    """With |u| <= 1, u = 0.5 is feasible and u = 2 is not."""
    none = np.zeros((2, 0))
    H, k = np.ones((1, 1)), np.array([[0.5], [2.0]])
    found = minimise_energies(
        np.zeros((0, 1)), none, np.zeros((2, 1)), H, k, np.zeros(1, dtype=int)
    )
    assert found.feasible.tolist() == [True, False]
    assert found.clearances[0] == pytest.approx([0.5], abs=1e-12)


def unloaded(u):
    """Return points of equal energy as minima."""
    u = np.array(u, dtype=float)
    return Minima(u, np.zeros((len(u), 0)), np.ones(len(u), dtype=bool))


def test_closest_positions_equal_projections():
    """The problem contains a disc with x = 0.6 and two intervals with a given sum."""
    disc, start = np.zeros(2, dtype=int), [[0.6, 0.0]] * 3
    last = np.array([[0.0, 2.0], [0.0, 0.3], [5.0, -1.0]])
    none = np.zeros((0, 2)), np.zeros((3, 0)), np.zeros((3, 2)), np.zeros((0, 2))
    rows = np.array([[1.0, 0.0]])
    found = closest_of_same_energy(unloaded(start), last, rows, (*none, disc))
    assert found == pytest.approx(np.array([[0.6, 0.8], [0.6, 0.3], [0.6, -0.8]]))
    intervals, rows = np.arange(2), np.array([[1.0, 1.0]]) / np.sqrt(2)
    last = np.array([[0.0, 0.0], [1.0, -1.0], [3.0, 0.5]])
    start = [[0.2, 0.8]] * 3
    found = closest_of_same_energy(unloaded(start), last, rows, (*none, intervals))
    # foot of the perpendicular, then corner of the square
    assert found == pytest.approx(np.array([[0.5, 0.5], [1.0, 0.0], [1.0, 0.0]]))


def test_load_on_a_disc_does_not_move_other_discs():
    """The energy (u_x - 3)^2 / 2 is minimal at (1, 0) of the disc."""
    G, h = np.array([[1.0, 0.0, 0.0]]), np.array([[-3.0]])
    group, d, H = np.array([0, 0, 1]), np.zeros((1, 3)), np.zeros((0, 3))
    minima = minimise_energies(G, h, d, H, np.zeros((1, 0)), group)
    last = np.array([[0.0, 0.9, 0.4]])
    found = closest_of_same_energy(minima, last, G, (G, h, d, H, group))
    assert found == pytest.approx(np.array([[1.0, 0.0, 0.4]]), abs=1e-9)
