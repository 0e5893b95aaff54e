"""Sets of platform screws: points within them, and how far they extend."""

import numpy as np
import pytest

from assembly.kinematics.posture import place_robot
from assembly.linear.energy import solve_assembly
from assembly.linear.reach import ReachableSet, reachable_screws
from assembly.solvers.conic import cone_sizes
from tests.answers_for_tests import machine

GROUP = np.array([0, 0, 1, 2, 2, 2])  # a disc, an interval, a ball


def body(rng, rows):
    """Six columns that the platform follows one by one; it starts within the cones."""
    start = rng.normal(size=6)
    start *= (rng.uniform(0.1, 0.9, 3) / cone_sizes(start, GROUP))[GROUP]
    H = np.linalg.qr(rng.normal(size=(6, rows)))[0].T
    return ReachableSet(np.zeros(6), np.eye(6), H, start, GROUP)


@pytest.mark.parametrize("rows", [0, 1, 3])
def test_a_point_is_moved_onto_the_rows_and_as_far_as_the_cones_allow(rng, rows):
    """In the body it stays; from outside it comes to the bound of one cone."""
    for _ in range(20):
        reachable = body(rng, rows)
        step = rng.normal(size=6)
        step -= reachable.rows.T @ (reachable.rows @ step)
        short = reachable.start + 1e-3 * step
        inside = cone_sizes(short, GROUP).max() < 1.0
        v = reachable._screw_near(short) + reachable.start
        assert not inside or v == pytest.approx(short, abs=1e-15)
        v = reachable._screw_near(reachable.start + 30.0 * step) + reachable.start
        sizes = cone_sizes(v, GROUP)
        assert sizes.max() == pytest.approx(1.0, abs=1e-8)
        assert np.abs(reachable.rows @ (v - reachable.start)).max(initial=0.0) < 1e-14
        # along the step, and no less of it than the bound allows
        along = (v - reachable.start) @ step / (step @ step)
        assert v - reachable.start == pytest.approx(along * step, abs=1e-14)
        farther = reachable.start + 1.001 * along * step
        assert cone_sizes(farther, GROUP).max() > 1.0


def test_how_far_a_disc_and_an_interval_extend(rng):
    """Without rows: the centre, and each cone's column along the direction."""
    X = 1e-3 * rng.normal(size=(6, 3))
    start, centre = np.array([0.3, -0.2, 0.5]), 1e-3 * rng.normal(size=6)
    reachable = ReachableSet(
        centre, X, np.zeros((0, 3)), start, np.array([0, 0, 1])
    )  # fmt: skip
    for d in np.eye(6):
        w = X.T @ d
        expected = d @ centre - w @ start + np.hypot(*w[:2]) + abs(w[2])
        found = reachable.support(d)
        assert found.height == pytest.approx(expected, abs=1e-10)
        assert d @ found.screw == pytest.approx(expected, abs=1e-9)


def test_a_screw_attains_what_is_certified_where_many_cones_stay_on_their_bound(rng):
    """The paper's robot within 1.05 times the least energy, along any direction.

    Duality: the largest component is attained.  Hardly ever it is not to 1e-6, where a
    cone that stays on its bound ends the step of all others.
    """
    assembly = solve_assembly(place_robot(machine("irsbot2", 0.0)))
    reachable = reachable_screws(assembly, "budget")
    directions = rng.normal(size=(60, 6)) * [1, 1, 1, 5, 5, 5]
    supports = [reachable.support(d) for d in directions]
    sizes = np.linalg.norm(directions @ reachable.map, axis=1)
    left = [s.height - d @ s.screw for s, d in zip(supports, directions, strict=True)]
    assert np.mean(np.array(left) < 1e-6 * sizes) > 0.9
