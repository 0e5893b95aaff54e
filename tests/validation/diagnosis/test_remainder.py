"""What a candidate is worth and foretells, against the normal distribution itself."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from tests.validation.diagnosis.test_candidates import arm_sensitivities
from validation.diagnosis import learning
from validation.diagnosis.candidates import Candidate, CandidatePart
from validation.diagnosis.evidence import Prior
from validation.diagnosis.forms_tried import CandidateShape
from validation.diagnosis.learning import Learned, learn
from validation.diagnosis.remainder import Remainder, Unexplained
from validation.diagnosis.small_terms import GEOMETRY, SmallTerm

ROWS = 15
CELLS = 6 * ROWS
SCALES = (0.3, 2.0)
SIZES = 10.0 ** np.arange(-0.5, 4.1, 0.5)


class AnyColumns:
    """Sensitivities whose candidates have any columns, each as a place of its own."""

    rows = np.arange(ROWS)

    def __init__(self):
        self.columns = []

    def candidate(self, B):
        """One of columns B (6 R, m)."""
        begin = len(self.columns)
        self.columns += list(B.T.reshape(-1, ROWS, 6))
        names = range(begin, len(self.columns))
        parts = tuple(CandidatePart(str(k), ("rx",), "nothing") for k in names)
        return Candidate(parts, "screw", CandidateShape("powers", ("0",)))

    def sensitivity(self, where, component, kind):
        return self.columns[int(where)]

    def basis(self, variable, shape):
        return np.ones((ROWS, 1)), np.eye(1)

    def changes(self, one):
        return np.stack([self.columns[int(part.where)] for part in one.parts], axis=-1)

    def axes(self, one):
        return np.zeros(len(one.parts), int)


def remainder(rng, noise=1.0, signal=0.0):
    """Six configurations of readings: two effects, four small unknowns and noise."""
    axis = np.array([0, 1, 3, 4])
    J, E = rng.normal(size=(CELLS, 4)), rng.normal(size=(CELLS, 2))
    size = np.array(SCALES)[axis // 3]
    z = J @ (size * rng.normal(size=4)) + E @ [300.0, -200.0] + signal
    z = z + noise * rng.normal(size=CELLS)
    term = SmallTerm(GEOMETRY, np.arange(4), axis, J, np.full(4, np.nan), -np.inf)
    prior = Prior((np.ones(4, bool),), {GEOMETRY: SCALES}, 0.0, 0.0)
    campaign = SimpleNamespace(
        cells=np.ones((ROWS, 6), bool), sigma=np.ones((ROWS, 6)),
        configuration=np.arange(ROWS),
    )  # fmt: skip
    left = Unexplained([term], z, E)
    here = Remainder(
        campaign, AnyColumns(), left, np.ones(CELLS, bool), prior, noise
    )  # fmt: skip
    return here, z, E, (J * size) @ (J * size).T


def worth(here, B):
    """Of columns B (N, m)."""
    return here.worths([here.sensitivities.candidate(B)])[0]


def test_worth_is_the_ratio_of_two_normal_densities():
    """Effects with a nearly flat prior; of the sizes tried, the best."""
    rng = np.random.default_rng(1)
    B = rng.normal(size=(CELLS, 3))
    here, z, E, small = remainder(rng, signal=B @ [0.5, -0.4, 0.2])
    flat = np.eye(CELLS) + small + 1e6 * E @ E.T
    norm = np.linalg.norm(B, axis=0).max()
    with_it = max(
        multivariate_normal.logpdf(z, cov=flat + (t / norm) ** 2 * B @ B.T)
        for t in SIZES
    )
    expected = with_it - multivariate_normal.logpdf(z, cov=flat)
    assert expected > 3
    # what is left is less than sigma says, so that the noise is sigma
    assert worth(here, B) == pytest.approx(expected, rel=1e-4)


def test_worths_do_not_hang_on_company():
    """One candidate alone and among four hundred, of which the last shows nothing."""
    rng = np.random.default_rng(2)
    here = remainder(rng)[0]
    every = [rng.normal(size=(CELLS, m)) for m in rng.integers(1, 6, 400)]
    every.append(np.zeros((CELLS, 2)))
    every = [here.sensitivities.candidate(B) for B in every]
    worths = here.worths(every)
    assert worths[-1] == -np.inf
    for k in (0, 7, 399):
        assert here.worths([every[k]])[0] == pytest.approx(worths[k], rel=1e-9)


def test_two_together_are_worth_what_their_columns_side_by_side_are():
    """Each made as large as the other, in any order."""
    rng = np.random.default_rng(15)
    A, B = rng.normal(size=(CELLS, 2)), 1e3 * rng.normal(size=(CELLS, 1))
    here = remainder(rng, signal=A @ [0.5, -0.4] + 1e-3 * B[:, 0])[0]
    candidate = here.sensitivities.candidate
    some = [candidate(A), candidate(np.zeros((CELLS, 1))), candidate(B)]
    beside = np.hstack([A / np.linalg.norm(A), B / np.linalg.norm(B)])
    worths = here.worths_of_pairs(some, [(0, 2), (2, 0), (0, 1)])
    # a block is made as large as its largest column, which moves the sizes tried
    scale = np.linalg.norm(beside, axis=0).max()
    assert scale == pytest.approx(1.0)
    assert worths[0] == pytest.approx(worth(here, beside), rel=1e-9)
    assert worths[1] == pytest.approx(worths[0], rel=1e-9)
    assert worths[0] > worths[2] + 3


def test_two_foretell_what_neither_does_alone():
    rng = np.random.default_rng(16)
    A, B = rng.normal(size=(2, CELLS, 1))
    here = remainder(rng, signal=2 * A[:, 0] - 1.5 * B[:, 0])[0]
    a, b = here.sensitivities.candidate(A), here.sensitivities.candidate(B)
    both = here.gain([a, b])[0]
    assert both > here.gain([a])[0] + 10
    assert both > here.gain([b])[0] + 10
    assert here.gain([b, a])[0] == pytest.approx(both, rel=1e-6)
    assert here.gain([a, b], [a])[0] == pytest.approx(both - here.gain([a])[0])


def test_nothing_known_can_be_worth_anything():
    """What effects or small unknowns of any size do is no news."""
    rng = np.random.default_rng(3)
    here, _, E, _ = remainder(rng)
    assert worth(here, E) == pytest.approx(0.0, abs=1e-4)


def test_a_block_that_is_known_but_for_rounding_is_worth_nothing():
    """Large unknowns: what cancels leaves products of either sign, and no news."""
    rng = np.random.default_rng(13)
    campaign = SimpleNamespace(
        cells=np.ones((ROWS, 6), bool), sigma=np.ones((ROWS, 6)),
        configuration=np.arange(ROWS),
    )  # fmt: skip
    J = 1e7 * rng.normal(size=(CELLS, 4))
    J[:, 3] = J[:, 0] + 1e-3 * rng.normal(size=CELLS)
    term = SmallTerm(GEOMETRY, np.arange(4), np.array([0, 1, 3, 4]), J,
                     np.full(4, np.nan), -np.inf)  # fmt: skip
    prior = Prior((np.ones(4, bool),), {GEOMETRY: (3.0, 3.0)}, 0.0, 0.0)
    z = J @ rng.normal(size=4) + rng.normal(size=CELLS)
    left = Unexplained([term], z, np.zeros((CELLS, 0)))
    here = Remainder(campaign, AnyColumns(), left, np.ones(CELLS, bool), prior, 1.0)
    known = here.sensitivities.candidate(J[:, :3] @ rng.normal(size=(3, 3)))
    assert here.worths([known])[0] < 3.0
    gain, error = here.gain([known])
    assert gain <= 2 * error + 3.0


def test_a_forecast_is_the_cost_of_what_the_other_folds_say():
    """By the posterior mean of all unknowns, one linear system for each fold."""
    rng = np.random.default_rng(14)
    here, z, E, _ = remainder(rng)
    J = here._all.terms[0].columns * np.array(SCALES)[[0, 0, 1, 1]]
    flat = E / np.linalg.norm(E, axis=0) * 1e4
    X = np.hstack([J, flat])
    rows = np.repeat(np.arange(ROWS), 6)
    parts = np.array_split(np.random.default_rng(1).permutation(np.arange(ROWS)), 5)
    expected = 0.0
    for part in parts:
        apart = np.isin(rows, part)
        A = X[~apart].T @ X[~apart] + np.eye(X.shape[1])
        x = np.linalg.solve(A, X[~apart].T @ z[~apart])
        expected += 5 * np.log1p((z - X @ x)[apart] ** 2 / 4).sum()
    assert here.forecast() == pytest.approx(expected, rel=1e-6)


def test_noise_beyond_sigma_makes_a_candidate_worth_less():
    """The same readings in a sigma three times as large: a ninth of the squares."""
    worths = []
    for noise in (1.0, 3.0):
        rng = np.random.default_rng(4)
        B = rng.normal(size=(CELLS, 2))
        here = remainder(rng, noise, signal=B @ [1.0, -1.0])[0]
        worths.append(worth(here, B))
    assert 0 < worths[1] < worths[0] / 2


def test_what_acts_foretells_other_rows_and_noise_does_not():
    rng = np.random.default_rng(5)
    B = rng.normal(size=(CELLS, 2))
    here = remainder(rng, signal=B @ [1.0, -0.8])[0]
    assert here.foretells([here.sensitivities.candidate(B)])
    noise = here.sensitivities.candidate(rng.normal(size=(CELLS, 2)))
    assert not here.foretells([noise])


def test_four_functions_are_learned_at_most(monkeypatch):
    """However many more would be worth it."""
    monkeypatch.setattr(learning, "_School", _Endless)
    monkeypatch.setattr(learning, "variables_of", lambda conditions: [])
    monkeypatch.setattr(learning, "places_of", lambda robot, names: [])
    three = [Learned(None, (), 9.0 - k) for k in range(3)]
    monkeypatch.setattr(learning, "_best", lambda *given: three)
    asked = SimpleNamespace(conditions=SimpleNamespace(take=lambda rows: None))
    campaign = SimpleNamespace(robot=None)
    lesson = learn(campaign, None, asked, None, lambda *told: None)
    assert [one.gain for one in lesson.learned] == [9.0, 8.0, 7.0, 9.0]


class _Endless:
    """Rows that never become noise."""

    done, terms, prior, left, unknowns = False, (), None, 1.0, 0.0
    fitting = SimpleNamespace(configuration=np.arange(ROWS))
    effects = np.zeros((1, 0))

    def __init__(self, *given):
        self.learned = []

    def believe(self, functions):
        self.learned += functions

    def part(self, most):
        return None


@pytest.fixture
def sensitivities(tmp_path):
    """Both drives turn."""
    return arm_sensitivities(tmp_path, bend=1.3)


def test_powers_are_orthonormal_over_the_rows(sensitivities):
    """1, q, q^2, q^3, so that none stands for the one below it; T says which."""
    s, q = sensitivities
    shape = CandidateShape("powers", ("0", "1", "2", "3"))
    columns, mixed = s.basis(("q.one",), shape)
    np.testing.assert_allclose(columns.T @ columns / 12, np.eye(4), atol=1e-10)
    powers = q[:, None] ** np.arange(4)
    np.testing.assert_allclose(powers @ mixed, columns, atol=1e-8)


def test_a_single_power_has_mean_square_one(sensitivities):
    s, q = sensitivities
    columns, mixed = s.basis(("q.one",), CandidateShape("powers", ("2",)))
    assert mixed.shape == (1, 1)
    assert mixed[0, 0] == pytest.approx(1 / np.sqrt(np.mean(q**4)), rel=1e-6)
    np.testing.assert_allclose(columns[:, 0], q**2 * mixed[0, 0], rtol=1e-6)


def test_some_rows_have_the_columns_of_all(sensitivities):
    """Forms are normalised over all rows; moved is changes times numbers."""
    s, _ = sensitivities
    part = CandidatePart("one", ("rz", "tx"), "q.two")
    one = Candidate((part,), "screw", CandidateShape("powers", ("1", "2")))
    rows = np.array([3, 4, 9])
    x = np.array([1.0, -2.0, 0.5, 0.25])
    every = s.changes(one)
    np.testing.assert_allclose(s.take(rows).changes(one), every[rows], atol=1e-15)
    np.testing.assert_allclose(s.moved(one, x), every @ x, atol=1e-12)
    assert s.axes(one).tolist() == [2, 2, 3, 3]
