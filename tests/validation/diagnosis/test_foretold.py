"""What is foretold of other rows, and what is worth it, by systems written out."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.validation.diagnosis.test_remainder import CELLS, ROWS, SIZES, AnyColumns
from tests.validation.diagnosis.test_remainder import remainder as remainder_of
from validation.diagnosis.evidence import Evidence, Prior
from validation.diagnosis.holdout import gain_over_blocks
from validation.diagnosis.remainder import (
    Remainder,
    Unexplained,
    _foretold,
    _seen,
    function_term,
    in_cells,
)
from validation.diagnosis.small_terms import GEOMETRY, SmallTerm


@pytest.mark.parametrize("noise", [0.7, 2.0, 3.0])
def test_noise_is_what_a_candidate_leaves_and_no_less_than_sigma(noise, rng):
    """Within what was left before it: v of the largest likelihood in that range."""
    B = rng.normal(size=(CELLS, 3))
    stated = max(1.0, 1.5 * noise)
    here, z, E, small = remainder_of(rng, noise, signal=5 * B @ [0.5, -0.4, 0.2])
    # what stays without the candidate is more than noise
    here = Remainder(here.campaign, here.sensitivities, here._all, here._cells,
                     here._prior, stated)  # fmt: skip
    flat = stated**2 * np.eye(CELLS) + small + 1e7 * E @ E.T
    norm = np.linalg.norm(B, axis=0).max()
    squares = z @ np.linalg.solve(flat, z)
    expected = []
    for t in SIZES:
        C = flat + (t * stated / norm) ** 2 * B @ B.T
        left = z @ np.linalg.solve(C, z)
        v = np.clip(left / CELLS, stated**-2, 1.0)
        grown = np.linalg.slogdet(C)[1] - np.linalg.slogdet(flat)[1]
        expected.append((squares - left / v - CELLS * np.log(v) - grown) / 2)
    one = here.sensitivities.candidate(B)
    assert here.worths([one])[0] == pytest.approx(max(expected), rel=1e-3)


def test_errors_of_a_fold_are_those_of_a_fit_to_the_others(rng):
    """Unknowns of size one: ridge regressions, one for each fold and each set."""
    X, z = rng.normal(size=(20, 4)) * [1.0, 30.0, 0.1, 2.0], rng.normal(size=20)
    ends = np.array([0, 3, 4, 11, 20])
    found = _foretold(X, z, ends, 2)
    for begin, end in zip(ends[:-1], ends[1:], strict=True):
        own = np.zeros(20, bool)
        own[begin:end] = True
        for row, count in zip(found, (2, 4), strict=True):
            A = X[~own, :count]
            x = np.linalg.solve(A.T @ A + np.eye(count), A.T @ z[~own])
            np.testing.assert_allclose(row[own], (z[own] - X[own, :count] @ x) ** 2)


def test_nearly_equal_columns_foretell_what_their_sum_and_difference_do(rng):
    """Of 1e6 sigma, alike to 1e-6: the second time recovers what rounding took."""
    a, d = rng.normal(size=(2, 60))
    X = np.column_stack([1e6 * a, 1e6 * a + d])
    z = 3 * a + 1.4 * d + 0.01 * rng.normal(size=60)
    turn = np.array([[1.0, -1.0], [1.0, 1.0]]) / np.sqrt(2)  # of unknowns
    ends = np.array([0, 20, 40, 60])
    one, other = _foretold(X, z, ends, 0), _foretold(X @ turn, z, ends, 0)
    np.testing.assert_allclose(one[0], z**2)
    assert np.sum(one[1]) == pytest.approx(np.sum(other[1]), rel=1e-2)


def test_unknowns_of_size_one_do_what_they_may_and_no_more(rng):
    """Effects all of 1e4 sigma; what is larger than that or the residual is cut."""
    here, z, E, _ = remainder_of(rng)
    order = rng.permutation(CELLS)
    J = here._all.terms[0].columns * np.array([0.3, 0.3, 2.0, 2.0])
    further = rng.normal(size=(CELLS, 3)) * [1.0, 1e9, 0.0]
    found = here._beside(order, further)
    expected = np.hstack([J[order], (E / np.linalg.norm(E, axis=0))[order], further])
    expected[:, 4:6] *= 1e4
    most = 100 * np.linalg.norm(z)
    assert 1e4 < most < 1e6
    expected[:, 7] *= most / np.linalg.norm(further[:, 1])
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    for size, limit in ((1e-3, 1e4), (1e6, 1e6)):
        left = Unexplained(here._all.terms, size * z, 0 * E)
        other = Remainder(here.campaign, here.sensitivities, left, here._cells,
                          here._prior, 1.0)  # fmt: skip
        columns = other._beside(order, further)
        assert np.linalg.norm(columns[:, 7]) == pytest.approx(limit)
        assert not columns[:, 4:6].any()


def test_small_columns_in_use_are_as_large_as_their_prior(rng):
    """Of some cells, term by term, and others beside them."""
    made = [
        SmallTerm(name, np.zeros(3, int), np.array([0, 3, 4]),
                  rng.normal(size=(9, 3)), np.full(3, np.nan), -np.inf)
        for name in "ab"
    ]  # fmt: skip
    used = np.array([True, False, True]), np.ones(3, bool)
    prior = Prior(used, {"a": (2.0, 3.0), "b": (5.0, 7.0)}, 0.0, 0.0)
    left = Unexplained(made, np.zeros(9), np.zeros((9, 0)))
    cells, more = np.array([7, 2]), rng.normal(size=(2, 2, 1))
    found = left.scaled(prior, cells, *more)
    a, b = (term.columns[cells] for term in made)
    expected = [a[:, [0]] * 2, a[:, [2]] * 3, b * [5.0, 7.0, 7.0], *more]
    np.testing.assert_allclose(found, np.hstack(expected))


def test_likeliest_sizes_are_those_of_columns_without_what_is_known(rng):
    """Two candidates side by side, by P^1/2 of their columns over the noise."""
    A, B = rng.normal(size=(2, CELLS, 2))
    here, z, E, small = remainder_of(rng, 2.0, signal=A @ [3.0, -2.0])
    candidate = here.sensitivities.candidate
    flat = 4.0 * np.eye(CELLS) + small + 1e9 * E @ E.T
    values, vectors = np.linalg.eigh(np.linalg.inv(flat))
    root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    terms = [
        function_term(str(k), np.zeros(2, int), root @ C) for k, C in enumerate((A, B))
    ]
    expected = Evidence(terms, CELLS).best(root @ z).scales
    sizes = here._likeliest([candidate(A), candidate(B)], [A, B])
    assert sizes[:2] == pytest.approx([expected["0"][0]] * 2, rel=1e-3)
    assert sizes[2:] == pytest.approx([expected["1"][0]] * 2, rel=0.05, abs=1e-3)
    order = rng.permutation(CELLS)
    found = here._columns([candidate(A), candidate(B)], order)
    np.testing.assert_allclose(found, np.hstack([A, B])[order] * sizes)


def test_the_gain_of_candidates_is_that_of_foretold_errors(rng):
    """In folds over blocks of rows, drawn once; over the noise."""
    B = rng.normal(size=(CELLS, 2))
    here, z, *_ = remainder_of(rng, 2.0, signal=B @ [2.0, -1.0])
    one = here.sensitivities.candidate(B)
    folds = here._folds()
    where = np.repeat(np.arange(ROWS), 6)
    assert len(folds) == 5
    assert sorted(np.concatenate(folds).tolist()) == list(range(CELLS))
    for fold in folds:  # rows whole, three in each
        assert len(np.unique(where[fold])) == 3
        assert len(fold) == 18
    order = np.concatenate(folds)
    X = here._beside(order, here._columns([one], order))
    ends = np.cumsum([0, *map(len, folds)])
    squares = _foretold(X, z[order], ends, X.shape[1] - 2) / 2.0**2
    expected = gain_over_blocks(*squares, where[order])
    assert here.gain([one]) == pytest.approx(expected)
    assert expected[0] > 0


def test_one_block_foretells_nothing(rng):
    """A row alone, of six readings."""
    campaign = SimpleNamespace(
        cells=np.ones((1, 6), bool), sigma=np.ones((1, 6)), configuration=np.zeros(1),
        covariates={},
    )  # fmt: skip
    campaign = type("Row", (SimpleNamespace,), {"__len__": lambda self: 1})(
        **vars(campaign)
    )
    made = SmallTerm(GEOMETRY, np.zeros(1, int), np.zeros(1, int),
                     rng.normal(size=(6, 1)), np.full(1, np.nan), -np.inf)  # fmt: skip
    prior = Prior((np.ones(1, bool),), {GEOMETRY: (1.0, 1.0)}, 0.0, 0.0)
    left = Unexplained([made], rng.normal(size=6), np.zeros((6, 0)))
    columns = AnyColumns()
    columns.rows = np.arange(1)
    here = Remainder(campaign, columns, left, np.ones(6, bool), prior, 1.0)
    assert here.successive
    assert here.forecast() == 0.0
    assert here.gain([]) == (0.0, 0.0)


@pytest.mark.parametrize(("gain", "proven"), [(1.9, False), (2.1, True), (-5.0, False)])
def test_two_standard_errors_are_proof(gain, proven):
    made = SimpleNamespace(gain=lambda some: (gain, 1.0))
    assert Remainder.foretells(made, []) == proven


def test_columns_of_a_candidate_are_of_measured_cells_over_sigma(rng):
    changes = rng.normal(size=(4, 6, 2))
    cells = rng.random((4, 6)) < 0.6
    campaign = SimpleNamespace(cells=cells, sigma=rng.uniform(1, 2, (4, 6)))
    s = SimpleNamespace(changes=lambda one: changes)
    found = in_cells(s, None, campaign)
    np.testing.assert_allclose(found, (changes / campaign.sigma[:, :, None])[cells])


def test_directions_that_rounding_may_have_made_are_not_seen():
    """Ten times the least eigenvalue, where that is negative; none if all are clear."""
    gram = np.diag([-1e-3, 9e-3, 1.1e-2, 5.0])
    values, vectors = _seen(gram)
    assert values == pytest.approx([1.1e-2, 5.0])
    assert np.abs(vectors) == pytest.approx(np.eye(4)[:, 2:])
    values, _ = _seen(np.diag([1e-9, 5.0]))
    assert values == pytest.approx([1e-9, 5.0])
