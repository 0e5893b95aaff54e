"""Small unknowns with a Gaussian prior, against the normal distribution itself."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from validation.diagnosis.background import NOTHING, background
from validation.diagnosis.evidence import Evidence, Prior
from validation.diagnosis.remainder import function_term
from validation.diagnosis.small_terms import GEOMETRY, SPRINGS, SmallTerm

CELLS = 300


def term(rng, name, count, lower=-np.inf, given=np.nan):
    """A term of as many rotations as translations, columns of very unlike size."""
    axis = np.arange(count) % 6
    size = np.where(axis < 3, 1e4, 3e5)
    return SmallTerm(
        name, np.arange(count) // 6, axis, rng.normal(size=(CELLS, count)) * size,
        np.full(count, given), lower, bool(np.isfinite(given)),
    )  # fmt: skip


def covariance(behind):
    """(N, N) of what is read, from the definition."""
    J = np.hstack([t.columns for t in behind.terms]) * behind.size
    return np.eye(CELLS) + J @ J.T


@pytest.fixture
def drawn(rng):
    """Two terms and readings of unknowns drawn from known sizes."""
    terms = [term(rng, GEOMETRY, 60), term(rng, SPRINGS, 24)]
    size = np.where(terms[0].axis < 3, 2e-3, 5e-5)
    z = terms[0].columns @ (size * rng.normal(size=60)) + rng.normal(size=CELLS)
    prior = Evidence(terms, CELLS).best(z)
    return terms, z, prior, background(terms, prior)


def test_evidence_is_the_density_of_the_readings(drawn):
    """Up to (n/2) ln 2 pi and what choosing sizes costs; rounding alone between."""
    _, z, prior, behind = drawn
    C = covariance(behind)
    density = multivariate_normal(np.zeros(CELLS), C).logpdf(z)
    density += CELLS / 2 * np.log(2 * np.pi)
    half = np.linalg.slogdet(C)[1] / 2
    chosen = -prior.cost - half  # half ln n for each of two sizes, ln 10 for a term
    assert chosen == pytest.approx(np.log(CELLS) + np.log(10.0), rel=1e-9)
    assert prior.evidence == pytest.approx(density - chosen, rel=1e-9)


def test_sizes_of_two_kinds_are_found_and_what_is_not_there_is_left_out(drawn):
    """30 unknowns of a kind: their rms is known to 13 %, and lies within 3 of that."""
    _, _, prior, behind = drawn
    rotation, translation = prior.scales[GEOMETRY]
    assert rotation == pytest.approx(2e-3, rel=0.4)
    assert translation == pytest.approx(5e-5, rel=0.4)
    assert [t.name for t in behind.terms] == [GEOMETRY]


def test_whitening_and_posterior_are_those_of_the_normal_distribution(drawn, rng):
    """W C W = 1, g = S J' C^-1 r, and its covariance; rounding of condition 1e6."""
    terms, z, _, behind = drawn
    C, J = covariance(behind), terms[0].columns
    W = behind.whitened(np.eye(CELLS))
    assert np.allclose(W @ C @ W, np.eye(CELLS), atol=1e-7)
    assert np.allclose(behind.raw(W @ z), z, atol=1e-9)
    S2 = np.diag(behind.size**2)
    (values,), (stds,) = behind.values(W @ z), behind.deviations()
    gain = S2 @ J.T @ np.linalg.inv(C)
    assert np.allclose(values / behind.size, gain @ z / behind.size, atol=1e-7)
    posterior = np.diag(S2 - gain @ J @ S2)
    assert np.allclose(stds**2 / behind.size**2, posterior / behind.size**2, atol=1e-7)
    assert np.allclose(behind.left(W @ z), z - J @ values, atol=1e-7)


def test_the_most_probable_unknowns_lose_least_and_that_is_the_residuals_square(
    drawn, rng
):
    """Squares of r - J g and of g / S at g = S J' C^-1 r: r' C^-1 r; more elsewhere."""
    terms, z, _, behind = drawn
    values = behind.values(behind.whitened(z))
    least = behind.lost(z, values)
    assert least == pytest.approx(z @ np.linalg.solve(covariance(behind), z), rel=1e-9)
    assert behind.lost(z, [0 * x for x in values]) == pytest.approx(z @ z, rel=1e-12)
    J, size = terms[0].columns, behind.size
    for _ in range(5):
        step = size * rng.normal(size=len(size))
        further = np.sum((J @ step) ** 2) + np.sum((step / size) ** 2)
        assert behind.lost(z, [values[0] + step]) == pytest.approx(
            least + further, rel=1e-9
        )


def test_an_unknown_of_no_size_costs_nothing_and_stays_zero(drawn):
    terms, z, prior, _ = drawn
    rotations = replace(prior, scales={GEOMETRY: (prior.scales[GEOMETRY][0], 0.0)})
    behind = background(terms, rotations)
    (values,) = behind.values(behind.whitened(z))
    exact = terms[0].axis >= 3
    assert not values[exact].any()
    assert behind.lost(z, [values]) == pytest.approx(
        z @ np.linalg.solve(covariance(behind), z), rel=1e-9
    )
    assert behind.identified()[0][exact].max() < 1e-12
    assert not behind.deviations()[0][exact].any()
    assert behind.unknowns == pytest.approx(behind.identified()[0].sum(), rel=1e-9)


def test_springs_stiffer_than_declared_are_left_out(rng):
    springs = term(rng, SPRINGS, 12, lower=0.0)
    truth = np.where(np.arange(12) % 2, 1.0, -1.0) * np.where(
        springs.axis < 3, 1e-3, 4e-5
    )
    z = springs.columns @ truth + rng.normal(size=CELLS)
    behind = background([springs], Evidence([springs], CELLS).best(z))
    (values,) = behind.values(behind.whitened(z))
    assert np.all(values > 0)
    assert len(values) < 12


def test_springs_left_out_come_in_when_what_hid_them_is_explained(rng):
    """All twelve are soft; half of them look stiffer until something else is known."""
    springs = term(rng, SPRINGS, 12, lower=0.0)
    soft = np.where(springs.axis < 3, 1e-3, 4e-5)
    hidden = springs.columns[:, ::2] @ (-2 * soft[::2])
    noise = rng.normal(size=CELLS)
    evidence = Evidence([springs], CELLS)
    before = evidence.best(springs.columns @ soft + hidden + noise)
    assert before.used[0].sum() < 12
    z = springs.columns @ soft + noise
    along, squares = springs.columns.T @ z, float(z @ z)
    anew, after = evidence.best(z), evidence.best_of(along, squares, before)
    assert after.used[0].all()
    assert after.evidence == pytest.approx(anew.evidence, rel=1e-6)


@pytest.mark.parametrize("there", [True, False])
def test_a_term_comes_and_goes_with_what_is_left(there, rng):
    """From the prior of other readings: the choice is that of a search from nothing."""
    geometry = term(rng, GEOMETRY, 60)
    evidence = Evidence([geometry], CELLS)
    noise = rng.normal(size=CELLS)
    moved = noise + geometry.columns @ np.where(geometry.axis < 3, 2e-3, 5e-5)
    was, now = (noise, moved) if there else (moved, noise)
    before = evidence.best(was)
    assert before.used[0].all() != there
    along, squares = geometry.columns.T @ now, float(now @ now)
    after = evidence.best_of(along, squares, before)
    assert after.used[0].all() == there
    assert after.evidence == pytest.approx(evidence.best(now).evidence, rel=1e-6)


def test_a_term_that_shows_by_rounding_alone_stays_away(rng):
    """What is left of it has products with a function beyond its own size."""
    ghost, function = term(rng, GEOMETRY, 2), replace(term(rng, "f", 1), sure=True)
    gram = np.full((3, 3), 1.92e-20)
    gram[2] = gram[:, 2] = 3.45e-5  # more than (1.92e-20 5.04e10)^1/2
    gram[2, 2] = 5.04e10
    evidence = Evidence([ghost, function], CELLS, gram)
    start = Prior((np.zeros(2, bool), np.ones(1, bool)), {}, 0.0, 0.0)
    after = evidence.best_of(np.array([-5.8e-11, -5.8e-11, 2.4e6]), 400.0, start)
    assert not after.used[0].any()
    assert after.used[1].all()


def test_functions_of_nearly_equal_columns_are_sized_whatever_rounding_says(rng):
    """Products of columns up to 1e9, alike to 1e-12: none is definite by rounding.

    Together they do what one column of twice the variance does.
    """
    column = rng.normal(size=CELLS)
    J = 1e9 * column[:, None] * [1.0, 1.0] + rng.normal(size=(CELLS, 2)) * [0.0, 1e-3]
    twin = function_term("f", np.zeros(2, int), J)
    alone = function_term("f", np.zeros(1, int), np.sqrt(2) * J[:, :1])
    z = 30.0 * column + rng.normal(size=CELLS)
    gram = J.T @ J
    gram[0, 1] = gram[1, 0] = gram[0, 0] * (1 + 1e-9)  # what rounding makes of it
    used = Prior((np.ones(2, bool),), {}, 0.0, 0.0)
    square = float(z @ z)
    pair = Evidence([twin], CELLS, gram).best_of(J.T @ z, square, used)
    one = Evidence([alone], CELLS).best(z)
    assert pair.scales["f"][0] == pytest.approx(one.scales["f"][0], rel=1e-3)
    assert pair.evidence == pytest.approx(one.evidence, rel=1e-5)


def test_noise_has_no_small_terms(rng):
    """One size in 100 draws would be much for a penalty of 8 nats and more."""
    evidence = Evidence([term(rng, GEOMETRY, 60), term(rng, SPRINGS, 24, 0.0)], CELLS)
    for _ in range(20):
        assert not background(evidence.terms, evidence.best(rng.normal(size=CELLS)))


def test_each_term_has_its_own_unknowns_back(rng):
    terms = [term(rng, GEOMETRY, 12, given=1e-4), term(rng, SPRINGS, 6, given=2e-4)]
    behind = background(terms, Evidence(terms, CELLS).best(rng.normal(size=CELLS)))
    z = behind.whitened(rng.normal(size=CELLS))
    for parts in (behind.values(z), behind.deviations(), behind.identified()):
        assert [len(part) for part in parts] == [12, 6]
    stacked = np.hstack([t.columns for t in terms]) @ np.concatenate(behind.values(z))
    assert np.allclose(behind.raw(z) - behind.left(z), stacked, atol=1e-7)


def test_a_tolerance_given_is_used_whatever_the_readings_say(rng):
    given = term(rng, GEOMETRY, 12, given=1e-4)
    behind = background([given], Evidence([given], CELLS).best(rng.normal(size=CELLS)))
    assert np.array_equal(behind.size, np.full(12, 1e-4))
    assert NOTHING.unknowns == 0.0


def test_a_machine_made_as_declared_has_no_small_unknowns_and_they_cost_nothing(drawn):
    terms, z, _, _ = drawn
    none = Evidence(terms, CELLS).none()
    assert (none.cost, none.evidence, none.scales) == (0.0, 0.0, {})
    behind = background(terms, none)
    assert not any(used.any() for used in none.used)
    np.testing.assert_array_equal(behind.whitened(z), z)
