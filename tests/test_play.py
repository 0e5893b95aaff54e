"""Play sampled uniformly and at contact, against known volumes and rejection."""

import numpy as np
import pytest
from scipy import stats

from assembly.nominal import size_of
from assembly.posture import place_robot
from assembly.robots import load_robot
from assembly.solvers.one_posture import prepare_energies
from assembly.statistics.distributions import draw_generator, tolerance_sources
from assembly.statistics.hit_and_run import hit_and_run
from assembly.statistics.play import STEPS, loaded_clearances, settle_play


def generators(count, seed=3):
    return [draw_generator(seed, draw, 9) for draw in range(count)]


def walked(rows, starts, count=4000, steps=60, start=None):
    """Many walks, by default from the middle; rows are made orthonormal here."""
    starts = np.array(starts)
    u = np.zeros((count, starts[-1])) if start is None else np.tile(start, (count, 1))
    rows = np.linalg.qr(np.array(rows, dtype=float).reshape(-1, starts[-1]).T)[0].T
    free = np.ones(starts[-1], dtype=bool)
    rows = np.ascontiguousarray(rows)
    for v, rng in zip(u, generators(count), strict=True):
        hit_and_run(rows, starts, free, v, steps, rng)
    return u


def test_in_a_disc_the_squared_radius_is_uniform():
    u = walked([], [0, 2], start=[0.9, 0.0])
    assert stats.kstest((u**2).sum(axis=1), "uniform").pvalue > 1e-3
    assert stats.kstest(np.arctan2(*u.T) / (2 * np.pi) + 0.5, "uniform").pvalue > 1e-3


def test_in_a_box_every_side_is_uniform():
    u = walked([], [0, 1, 2, 3], start=[-0.99, 0.99, 0.0])
    for side in u.T:
        assert stats.kstest(side, stats.uniform(-1, 2).cdf).pvalue > 1e-3


def test_a_cut_disc_agrees_with_rejection():
    """Row u0 = u2 / 2 with |u2| <= 1 leaves the strip |u0| <= 1/2 of the unit disc."""
    u = walked([[1, 0, -0.5]], [0, 2, 3])
    assert np.abs(u[:, 0] - u[:, 2] / 2).max() < 1e-12
    rng = np.random.default_rng(1)
    tried = rng.uniform(-1, 1, size=(60_000, 2))
    kept = tried[(np.hypot(*tried.T) <= 1) & (abs(tried[:, 0]) <= 0.5)]
    # the strip's area is 2 (1/2 sqrt(3)/2 + asin(1/2)) = 1.913 of the square's 4
    area = np.sqrt(3) / 2 + np.pi / 3
    assert len(kept) / len(tried) == pytest.approx(area / 4, abs=0.01)
    for own, other in zip(u.T, kept.T, strict=False):
        assert stats.ks_2samp(own, other).pvalue > 1e-3


def test_a_simplex_like_section_of_a_cube_has_its_known_mean():
    """|u_i| <= 1 with u0 + u1 + u2 = 2.4: a triangle with centroid (0.8, 0.8, 0.8)."""
    u = walked([[1, 1, 1]], [0, 1, 2, 3], start=[0.9, 0.9, 0.6])
    np.testing.assert_allclose(u.sum(axis=1), 2.4, rtol=1e-12)
    # barycentric coordinates of a uniform point: mean 1/3, variance 1/18
    part = (1 - u) / 0.6
    for one in part.T:
        assert stats.kstest(one, stats.beta(1, 2).cdf).pvalue > 1e-3


@pytest.fixture(scope="module")
def drawn():
    robot = load_robot("irsbot2")
    sources = tolerance_sources(robot, [1e-3] * 3 + [1e-4] * 3)
    one = prepare_energies(place_robot(robot))
    errors = sources.errors(sources.draw(0, 600, seed=2))
    return one, one.solve(errors)


@pytest.mark.parametrize("play", ["uniform", "contact"])
def test_play_changes_neither_energy_nor_bounds(drawn, play):
    """Screws moved by clearances that leave every spring as it was."""
    one, found = drawn
    loaded = loaded_clearances(one, found)
    assert not loaded[found.energy < 1e-20].any()
    assert loaded[found.energy > 1e-8].any()
    settled = settle_play(one, found, play, generators(600))
    assert np.isfinite(settled).all()
    assert np.abs(settled - found.platform_screw).max() > 1e-5


def test_contact_goes_at_least_as_far_along_its_push_as_uniform_play(drawn):
    one, found = drawn
    push = np.array([rng.normal(size=6) for rng in generators(600)])
    size = size_of(one.posture.robot)
    push[:, 3:] /= size
    at_contact, anywhere = (
        settle_play(one, found, play, generators(600))
        for play in ("contact", "uniform")
    )
    reach = (push * at_contact).sum(axis=1) - (push * anywhere).sum(axis=1)
    assert reach.min() > -1e-9


def test_longer_walks_change_no_distribution(drawn):
    one, found = drawn
    some, more = (
        settle_play(one, found, "uniform", generators(600, seed), steps)
        for seed, steps in ((3, STEPS), (4, 4 * STEPS))
    )
    for a, b in zip(some.T, more.T, strict=True):
        if np.ptp(a) > 1e-12:
            assert stats.ks_2samp(a, b).pvalue > 1e-3


def test_an_unknown_way_is_refused(drawn):
    one, found = drawn
    with pytest.raises(ValueError, match="play is 'most'"):
        settle_play(one, found, "most", generators(600))
