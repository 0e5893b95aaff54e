"""What is known while functions are looked for, against plain least squares."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from tests.campaigns_for_tests import campaign_of
from validation.diagnosis import learning as module
from validation.diagnosis.candidates import CandidatePart
from validation.diagnosis.evidence import Evidence, Prior
from validation.diagnosis.forms_tried import CandidateShape
from validation.diagnosis.learning import Learned, Lesson, _School, cost, learn
from validation.diagnosis.remainder import Unexplained, function_term
from validation.diagnosis.small_terms import GEOMETRY, SPRINGS, SmallTerm

ROWS = 25
CELLS = 6 * ROWS


@pytest.mark.parametrize("left", [40.0, 60.0, 500.0])
def test_a_lesson_costs_as_in_bic_with_no_less_noise_than_stated(left):
    """n ln(left / n) + k ln n; below one sigma the noise is one."""
    expected = 50 * np.log(max(left, 50.0) / 50) + 3.5 * np.log(50)
    assert cost(50, left, 3.5) == pytest.approx(expected)
    term = function_term("f", np.zeros(1, int), np.zeros((50, 1)))
    lesson = Lesson((), (term,), Prior((), {}, 0.0, 0.0), left, 3.5, None)
    assert lesson.cost == pytest.approx(expected)
    told = Lesson((), (term,), Prior((), {}, 0.0, 0.0), left, 3.5, 0.0)
    assert told.cost == 0.0


class Rows:
    """Sensitivities of which no more is asked than rows and columns."""

    def __init__(self):
        self.taken = []

    def take(self, rows):
        self.taken.append(rows.tolist())
        return self

    def axes(self, one):
        return np.zeros(2, int)


@pytest.fixture
def school(monkeypatch, rng):
    """Two effects, a large term of one size, one of given sizes, and of noise ``s``."""

    def begin(noise=1.0, large=4, signal=0.0):
        monkeypatch.setattr(module, "_LARGE", large)
        monkeypatch.setattr(module, "Remainder", lambda *given: given)
        E = rng.normal(size=(CELLS, 2))
        terms = [
            SmallTerm(GEOMETRY, np.zeros(9, int), np.repeat([0, 3], [5, 4]),
                      rng.normal(size=(CELLS, 9)), np.full(9, np.nan), -np.inf),
            SmallTerm(SPRINGS, np.zeros(5, int), np.arange(5),
                      rng.normal(size=(CELLS, 5)), np.full(5, np.nan), 0.0),
            SmallTerm("given", np.zeros(5, int), np.arange(5),
                      rng.normal(size=(CELLS, 5)), np.full(5, 0.3), -np.inf, True),
        ]  # fmt: skip
        z = E @ [50.0, -20.0] + noise * rng.normal(size=CELLS) + signal
        z += terms[0].columns @ rng.normal(size=9)
        z += terms[1].columns @ rng.uniform(0.5, 1, 5)
        campaign = campaign_of(np.zeros((ROWS, 6)))
        left = Unexplained(terms, z, E)
        return _School(campaign, np.ones(ROWS, bool), Rows(), left), E, z

    return begin


@pytest.mark.parametrize("large", [3, 5, 6])
@pytest.mark.parametrize("noise", [0.5, 3.0])
def test_what_is_left_is_that_of_the_posterior(school, large, noise):
    """Of (C + flat effects)^-1 by sizes found, times the noise where it is larger."""
    s, E, z = school(noise, large)
    Q = np.linalg.qr(E)[0]
    free = np.eye(CELLS) - Q @ Q.T
    J = free @ np.hstack([t.columns for t in s.terms])
    assert s.without_effects(z) == pytest.approx(free @ z)
    size = np.concatenate([
        np.where(used, np.where(np.isfinite(t.given), t.given,
                 np.array(s.prior.scales.get(t.name, (0, 0)))[t.axis // 3]), 0.0)
        for t, used in zip(s.terms, s.prior.used, strict=True)
    ])  # fmt: skip
    # the last turn took the noise of the turn before, which it hardly changes
    v = s.noise**2
    C = v * np.eye(CELLS) + (J * size**2) @ J.T
    values = size**2 * (J.T @ np.linalg.solve(C, free @ z))
    left = free @ z - J @ values
    assert s.left == pytest.approx(left @ left, rel=0.02)
    known = np.trace(np.linalg.solve(C, (J * size**2) @ J.T))
    assert s.unknowns == pytest.approx(known, rel=0.02)
    assert s.freedom == round(CELLS - 2 - s.unknowns)
    assert s.noise == pytest.approx(max(1.0, np.sqrt(s.left / s.freedom)))
    assert s.noise == pytest.approx(max(1.0, noise), rel=0.2)
    of_one = [replace(t, columns=free @ t.columns / s.noise) for t in s.terms]
    likeliest = Evidence(of_one, CELLS).best(free @ z / s.noise)
    for name, sizes in likeliest.scales.items():
        assert s.prior.scales[name] == pytest.approx(sizes, rel=0.1)
    # columns of large groups are turned so that their products are diagonal
    assert [turn is not None for turn in s._turns] == [large <= 5, False, False]
    gram = J.T @ J
    turn = np.eye(19)
    if s._turns[0] is not None:
        turn[:9, :9] = s._turns[0]
    np.testing.assert_allclose(s._gram, turn.T @ gram @ turn, atol=1e-9)
    np.testing.assert_allclose(s._along, turn.T @ (J.T @ (free @ z)), atol=1e-9)


def test_what_is_left_is_noise_or_not_by_its_squares(school):
    """Beyond what noise leaves in one case of twenty."""
    s, *_ = school()
    s.freedom = 100
    for chance, done in ((0.06, True), (0.04, False)):
        s.left = float(chi2.isf(chance, 100))
        assert s.done == done


def test_functions_believed_are_terms_from_then_on(school, monkeypatch, rng):
    """And in use whatever the readings say; numbered in the order found."""
    B = rng.normal(size=(2, CELLS, 2))
    s, *_ = school(signal=3 * B[0, :, 0])
    before = s.left
    monkeypatch.setattr(module, "in_cells", lambda rows, one, campaign: B[one])
    s.believe([Learned(0, (), 9.0), Learned(1, (), 8.0)])
    assert [t.name for t in s.terms[3:]] == ["function 1", "function 2"]
    assert [one.candidate for one in s.learned] == [0, 1]
    assert s.left < before / 2
    assert s.prior.used[3].all()
    was = s.left
    s.believe([])
    assert s.left == was
    again = s._with_new(Prior(s.prior.used[:3], {}, 0.0, 0.0))
    assert [used.all() for used in again.used[3:]] == [True, True]


@pytest.mark.parametrize(("most", "count"), [(1000, 25), (CELLS, 25), (66, 11), (6, 1)])
def test_some_of_the_rows_are_looked_at(school, most, count):
    """As many readings as asked for, from the first row to the last."""
    s, *_ = school()
    campaign, rows, left, cells, prior, noise = s.part(most)
    (taken,) = rows.taken[1:]
    assert len(campaign) == len(taken) == count
    assert taken[0] == 0
    assert count == 1 or taken[-1] == ROWS - 1
    assert np.max(np.diff(taken), initial=0) - np.min(np.diff(taken), initial=9) <= 1
    assert np.flatnonzero(cells).tolist() == [
        6 * r + c for r in taken for c in range(6)
    ]
    assert (left.residual is s.residual, prior, noise) == (True, s.prior, s.noise)


def test_no_turn_where_groups_are_small(monkeypatch, rng):
    monkeypatch.setattr(module, "_LARGE", 3)
    A = rng.normal(size=(20, 6))
    gram, group = A.T @ A, np.array([0, 1, 0, 1, 0, 1])
    turned, turn = module._diagonal(gram, group)
    np.testing.assert_allclose(turned, turn.T @ gram @ turn, atol=1e-12)
    for own in (slice(0, 6, 2), slice(1, 6, 2)):
        block = turned[own, own]
        assert np.count_nonzero(block) == 3
        np.testing.assert_allclose(np.diag(block), np.linalg.eigvalsh(gram[own, own]))
    same, none = module._diagonal(gram, np.array([0, 0, 1, 1, 2, 2]))
    assert (same is gram, none) == (True, None)


@pytest.mark.parametrize("known", [None, (), ("f",)])
def test_a_lesson_is_of_all_that_is_believed(monkeypatch, known):
    """What is known is believed, and no other looked for; effects count as unknowns."""
    believed, looked = [], []

    class Done:
        done, terms, prior, left, unknowns = False, [], "prior", 7.0, 2.5
        effects, fitting = np.zeros((9, 3)), "rows"

        def __init__(self, *given):
            self.learned = []

        def believe(self, functions):
            believed.append(list(functions))
            self.learned += functions

        def part(self, most):
            return SimpleNamespace(forecast=lambda: 11.0)

    def best(*given):
        looked.append(given)
        return ["g"] if len(looked) == 1 else []

    monkeypatch.setattr(module, "_School", Done)
    monkeypatch.setattr(module, "_best", best)
    monkeypatch.setattr(module, "variables_of", lambda conditions: [])
    monkeypatch.setattr(module, "places_of", lambda robot, names: [])
    asked = SimpleNamespace(conditions=SimpleNamespace(take=lambda rows: None))
    told = []
    for kind, forecast in ((module.SPANS, 11.0), ("configurations", None)):
        monkeypatch.setattr(module, "blocks_of", lambda rows, kind=kind: (None, kind))
        looked.clear()
        lesson = learn(
            SimpleNamespace(robot=None), None, asked, None,
            lambda *now: told.append(now[1:]), known,
        )  # fmt: skip
        assert lesson.learned == (("g",) if known is None else known)
        assert len(looked) == (2 if known is None else 0)
        assert (lesson.left, lesson.unknowns) == (7.0, 5.5)
        assert lesson.forecast == forecast
    assert told[-1] == (module.MOST, module.MOST)
    Done.done = True
    looked.clear()
    learn(SimpleNamespace(robot=None), None, asked, None, lambda *now: None, known)
    assert not looked


PARTS = [(CandidatePart("reading", (f"t{k}",), "q.one"),) for k in "xyz"]


def best_of(
    monkeypatch, worths, successive=False, foretold=True, chosen=(), every=PARTS
):
    """The best of three places in two forms of which one has no name."""
    forms = [CandidateShape("powers", ("1",)), CandidateShape("spline", ("1", "2"))]
    monkeypatch.setattr(module, "first_shapes", lambda robot, name: forms)
    monkeypatch.setattr(module, "all_shapes", lambda rows, name, kind: forms)
    monkeypatch.setattr(module, "simplest", lambda judged, some, worth: chosen)
    every = [("screw", parts) for parts in every]
    rows = SimpleNamespace(
        robot=None, rows=None, conditions=SimpleNamespace(take=lambda rows: None)
    )
    looked = SimpleNamespace(worths=lambda some: np.arange(float(len(some))))
    school = SimpleNamespace(sensitivities=rows, part=lambda most: looked)
    judged = SimpleNamespace(
        sensitivities=rows, count=100, successive=successive,
        worths=lambda some: np.array([worths[c.parts[0].components[0], c.shape.form]
                                      for c in some]),
        foretells=lambda some: foretold,
    )  # fmt: skip
    return module._best(school, judged, every)


def table(**worths):
    """Of powers at tx, ty, tz, and of splines; -9 of others."""
    names = [(f"t{k}", form) for k in "xyz" for form in ("powers", "spline")]
    return {one: worths.get(f"{one[0]}_{one[1]}", -9.0) for one in names}


@pytest.mark.parametrize(("above", "learned"), [(2.9, False), (3.1, True)])
def test_a_function_must_be_worth_what_was_tried_and_its_size(
    monkeypatch, above, learned
):
    """ln(6 candidates in 2 forms each) and half ln n, and e^3 more."""
    price = np.log(6 * 2) + 0.5 * np.log(100)
    found = best_of(monkeypatch, table(ty_powers=price + above))
    assert [one.candidate.parts for one in found] == ([PARTS[1]] if learned else [])
    for one in found:
        assert one.gain == pytest.approx(above)
        assert one.candidate.shape.form == "powers"
    assert best_of(monkeypatch, table(ty_powers=90.0), foretold=False) == []


@pytest.mark.parametrize(("more", "form"), [(2.9, "powers"), (3.1, "spline")])
def test_a_form_without_a_name_must_be_clearly_better(monkeypatch, more, form):
    worths = table(tx_powers=50.0, tx_spline=50.0 + more)
    (one,) = best_of(monkeypatch, worths)
    assert one.candidate.shape.form == form
    assert one.equivalent == ()


def test_places_that_do_as_well_are_told_the_likelier_first(monkeypatch):
    """Within three of the best, each once; splines three less."""
    worths = table(tx_powers=50.0, ty_powers=47.5, tz_powers=46.5, tz_spline=52.5)
    (one,) = best_of(monkeypatch, worths)
    assert one.candidate.parts == PARTS[0]
    assert one.equivalent == (PARTS[2], PARTS[1])
    (one,) = best_of(monkeypatch, table(tx_powers=50.0, ty_powers=46.9))
    assert one.equivalent == ()


def test_where_rows_follow_one_another_the_simplest_are_chosen(monkeypatch):
    """Among those that are worth it, by their places there."""
    worths = table(tx_powers=50.0, ty_powers=5.0, tz_powers=40.0)
    found = best_of(monkeypatch, worths, successive=True, chosen=(1, 0))
    # of the two the last place looked at comes first
    assert [one.candidate.parts for one in found] == [PARTS[0], PARTS[2]]
    assert best_of(monkeypatch, worths, successive=True, foretold=False) == []


def test_where_nothing_may_act_nothing_is_found(monkeypatch):
    assert best_of(monkeypatch, {}, every=()) == []
