"""Sizes of small unknowns and what is said with them, against matrices written out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from validation.diagnosis import evidence as module
from validation.diagnosis.background import NOTHING, background
from validation.diagnosis.evidence import Evidence, Prior, sizes_in_use
from validation.diagnosis.remainder import function_term
from validation.diagnosis.small_terms import GEOMETRY, SPRINGS, SmallTerm

CELLS = 120


def term(rng, name, count, given=np.nan, **changes):
    """As many rotations as translations, which show 10 times as much."""
    axis = np.arange(count) % 6
    columns = rng.normal(size=(CELLS, count)) * np.where(axis < 3, 1.0, 10.0)
    given = np.broadcast_to(given, count).astype(float)
    made = SmallTerm(name, np.zeros(count, int), axis, columns, given, -np.inf)
    return replace(made, **changes)


def density(columns, size, z):
    """ln of the normal density, its factor of pi left out."""
    C = np.eye(len(z)) + (columns * size) @ (columns * size).T
    return multivariate_normal.logpdf(z, cov=C) + len(z) / 2 * np.log(2 * np.pi)


def test_what_is_always_there_costs_no_choice(rng):
    """Sizes given cost nothing; sizes asked for half ln n each."""
    z = rng.normal(size=CELLS)
    given = term(rng, GEOMETRY, 12, 0.3, sure=True)
    prior = Evidence([given], CELLS).best(z)
    expected = density(given.columns, np.full(12, 0.3), z)
    assert prior.evidence == pytest.approx(expected, rel=1e-9)
    axis = np.array([0, 1, 2])
    function = function_term("f", axis, rng.normal(size=(CELLS, 3)))
    z = z + function.columns @ [3.0, -2.0, 1.0]
    prior = Evidence([function], CELLS).best(z)
    size, none = prior.scales["f"]
    assert none == 0.0
    expected = density(function.columns, size, z) - np.log(CELLS) / 2
    assert prior.evidence == pytest.approx(expected, rel=1e-9)


def test_a_size_of_next_to_nothing_costs_nothing(rng):
    """A function of which the readings say no more than by chance."""
    columns = rng.normal(size=(CELLS, 8))
    Q = np.linalg.qr(columns)[0]
    z = rng.normal(size=CELLS)
    z -= Q @ (Q.T @ z)
    prior = Evidence([function_term("f", np.zeros(8, int), columns)], CELLS).best(z)
    assert prior.scales["f"][0] * np.linalg.norm(columns[:, 0]) < 0.01
    assert prior.cost == pytest.approx(0.0, abs=1e-3)


def test_no_size_is_larger_than_it_may_be(rng):
    large = term(rng, GEOMETRY, 24, sure=True, most=(0.5, np.inf))
    z = large.columns @ np.full(24, 3.0) + rng.normal(size=CELLS)
    rotation, translation = Evidence([large], CELLS).best(z).scales[GEOMETRY]
    assert rotation == pytest.approx(0.5)
    assert translation == pytest.approx(3.0, rel=0.5)


@pytest.mark.parametrize("units", [1e-9, 1e9])
def test_sizes_have_units_and_evidence_has_none(units, rng):
    terms = [term(rng, GEOMETRY, 12), term(rng, SPRINGS, 6)]
    z = sum(t.columns @ rng.normal(size=len(t)) for t in terms)
    z = z + rng.normal(size=CELLS)
    scaled = [replace(t, columns=units * t.columns) for t in terms]
    one, other = Evidence(terms, CELLS).best(z), Evidence(scaled, CELLS).best(z)
    assert other.evidence == pytest.approx(one.evidence, rel=1e-6)
    assert one.scales.keys() == other.scales.keys() == {GEOMETRY, SPRINGS}
    for name, sizes in one.scales.items():
        assert np.array(other.scales[name]) * units == pytest.approx(sizes, rel=1e-3)
    size = sizes_in_use(terms, one)
    assert size.shape == (18,)
    assert size[[0, 3, 12, 15]] == pytest.approx([
        *one.scales[GEOMETRY],
        *one.scales[SPRINGS],
    ])


def test_the_posterior_is_that_of_the_normal_distribution(rng):
    """S J' C^-1 z, of a term in use beside one that is not, and its degrees."""
    terms = [term(rng, SPRINGS, 6), term(rng, GEOMETRY, 12)]
    prior = Prior(
        (np.zeros(6, bool), np.ones(12, bool)), {GEOMETRY: (0.4, 0.02)}, 0.0, 0.0
    )
    z = rng.normal(size=CELLS)
    along = np.hstack([t.columns for t in terms]).T @ z
    values, known = Evidence(terms, CELLS).posterior(prior, along)
    J, size = terms[1].columns, np.tile(np.repeat([0.4, 0.02], 3), 2)
    C = np.eye(CELLS) + (J * size**2) @ J.T
    assert values[:6].tolist() == [0.0] * 6
    assert values[6:] == pytest.approx(size**2 * (J.T @ np.linalg.solve(C, z)))
    assert known == pytest.approx(CELLS - np.trace(np.linalg.inv(C)))
    nothing = Evidence(terms, CELLS).none()
    values, known = Evidence(terms, CELLS).posterior(nothing, along)
    assert (values.tolist(), known) == ([0.0] * 18, 0.0)


def test_a_glance_is_the_density_at_a_few_sizes(rng):
    """Of a further term, the one known as it is; with the largest sizes kept."""
    terms = [
        term(rng, GEOMETRY, 12, most=(1.0, 1.0)),
        term(rng, SPRINGS, 12, most=(0.05, np.inf)),
    ]
    every = Evidence(terms, CELLS)
    J = np.hstack([t.columns for t in terms])
    z = J @ (0.3 * rng.normal(size=24)) + rng.normal(size=CELLS)
    near = Prior(
        (np.ones(12, bool), np.zeros(12, bool)), {GEOMETRY: (0.3, 0.2)}, 0.0, 0.0
    )
    found = every._at_a_glance([True, True], near, J.T @ z, float(z @ z))
    shows = [
        1 / np.sqrt(np.mean(np.sum(terms[1].columns[:, own] ** 2, axis=0)))
        for own in (terms[1].axis < 3, terms[1].axis >= 3)
    ]
    expected = [
        density(J, np.concatenate([
            np.tile(np.repeat([0.3, 0.2], 3), 2),
            np.tile(np.repeat(
                [min(0.05, shows[0] * np.exp(log)), shows[1] * np.exp(log)], 3), 2),
        ]), z)
        for log in module._GLANCES
    ]  # fmt: skip
    assert found == pytest.approx(max(expected), rel=1e-9)


def test_a_search_goes_on_where_another_ended(monkeypatch, rng):
    """From the sizes of a prior of the same readings it has nowhere to go."""
    begun = []

    def minimize(fun, x0, **options):
        begun.append((x0, original(fun, x0, **options).x))
        return original(fun, x0, **options)

    original = module.minimize
    monkeypatch.setattr(module, "minimize", minimize)
    only = term(rng, GEOMETRY, 24, sure=True)
    z = only.columns @ rng.normal(size=24) + rng.normal(size=CELLS)
    every, along, squares = Evidence([only], CELLS), only.columns.T @ z, float(z @ z)
    prior = every.best(z)
    again = every.best_of(along, squares, prior)
    begin, end = begun[-1]
    assert begin == pytest.approx(end, abs=1e-3)
    assert not begun[0][0] == pytest.approx(end, abs=1e-1)
    assert again.evidence == pytest.approx(prior.evidence, rel=1e-9)
    values = every._sized([np.ones(24, bool)], along, squares, np.full(2, np.nan))[1]
    assert values == pytest.approx(every.posterior(prior, along)[0], rel=1e-3)


def test_unknowns_are_called_for_by_what_is_left(rng):
    """Positive products with it, in terms of which others are in use."""
    one, other = term(rng, SPRINGS, 4), term(rng, "f", 2)
    every = Evidence([one, other], CELLS)
    J = np.hstack([one.columns, other.columns])
    used = [np.array([True, False, False, False]), np.zeros(2, bool)]
    values = np.array([0.5, 0, 0, 0, 0, 0])
    # left: minus the second, 0.001 of the third, less than none of the fourth
    left = J @ np.linalg.solve(J.T @ J, [0.0, -1.0, 1e-3, -1e-3, 5.0, 5.0])
    along = J.T @ (J @ values + left)
    found = every._called_for(used, along, values)
    assert found[0].tolist() == [False, False, True, False]
    assert found[1].tolist() == [False, False]


def test_the_largest_diagonal_block_is_set_apart():
    """Of two, three and four unknowns, the four not orthogonal; given ones never."""
    group = np.array([0, 0, 1, 1, 1, 2, 2, 2, 2, -1, -1, -1, -1, -1, 3])
    gram = np.diag(np.arange(1.0, 16.0))
    gram[5, 6] = gram[6, 5] = 0.1
    gram[0, 3] = gram[3, 0] = 0.2  # between blocks it does not count
    found = module._largest_diagonal(gram, group)
    assert np.flatnonzero(found).tolist() == [2, 3, 4]
    every = np.arange(15)  # each alone is none
    assert not module._largest_diagonal(gram, every).any()
    assert module._largest_diagonal(np.eye(2), np.zeros(2, int)).all()


def test_what_hardly_shows_counts_as_much_as_it_shows(rng):
    """Gains of a few tenths and less: W C W = 1 all the same."""
    faint = term(rng, GEOMETRY, 6, 0.02)
    faint = replace(faint, columns=faint.columns * [1.0, 1, 1, 0.1, 0.1, 1e-3])
    prior = Prior((np.ones(6, bool),), {GEOMETRY: (1.0, 1.0)}, -3.0, 0.0)
    behind = background([faint], prior)
    assert 0 < behind.gains.min() < behind.gains.max() < 0.5
    C = np.eye(CELLS) + 0.02**2 * faint.columns @ faint.columns.T
    W = behind.whitened(np.eye(CELLS))
    np.testing.assert_allclose(W @ C @ W, np.eye(CELLS), atol=1e-7)
    assert behind.score == -3.0


def test_nothing_has_no_unknowns_and_costs_nothing():
    assert (len(NOTHING.size), NOTHING.turn.shape, NOTHING.score) == (0, (0, 0), 0.0)
    assert (len(NOTHING.gains), NOTHING.unknowns) == (0, 0.0)
    assert NOTHING.values(np.ones(3)) == NOTHING.deviations() == []
