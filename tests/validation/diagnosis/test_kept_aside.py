"""Every step up to a model, against least squares with Gaussian priors by numpy."""

from dataclasses import replace

import numpy as np
import pytest

from tests.bar_for_tests import ECCENTRIC, LENGTH, along, bar
from tests.planar_arm_for_tests import SIGMA
from validation.diagnosis.background import background
from validation.diagnosis.candidates import Candidate, CandidatePart, Sensitivities
from validation.diagnosis.evidence import Evidence, Prior, sizes_of
from validation.diagnosis.forms_tried import CandidateShape
from validation.diagnosis.kept_aside import FittedModel, RowSets, ladder
from validation.diagnosis.learning import Learned
from validation.diagnosis.refit import refit
from validation.diagnosis.registration import device_frame
from validation.diagnosis.remainder import function_term, in_cells
from validation.diagnosis.responses import responses
from validation.diagnosis.signatures import conditions_of
from validation.diagnosis.small_terms import GEOMETRY, SPRINGS, small_terms

ROWS = 12
FITTED = np.arange(ROWS) % 4 > 0
CELLS = np.repeat(FITTED, 6)
LOAD = [0.0, 0, 4.0, 0, 0, 30.0]
STIFFNESS = 2e5  # [N m/rad] of the drive, as declared
SECOND = 3 * SIGMA  # what errors of the declared frames do to second order
SCALES = {
    GEOMETRY: (4e-5, 3e-5), SPRINGS: (3e-5, 2e-6),
    "function 1": (1.0, 2e-5), "function 2": (3e-5, 1.0),
}  # fmt: skip
FUNCTIONS = tuple(
    Candidate(
        (CandidatePart("reading", (axis,), "cov.temperature"),),
        "screw",
        CandidateShape("powers", (power,)),
    )
    for axis, power in (("tz", "1"), ("rx", "2"))
)
RANK = 5


def flat_columns(campaign, unknown, effects):
    """(6 R, k) readings over sigma per unit of the device's frame, and of the drive.

    The drive turns by the cosine of its command more than it should.
    """
    place = LENGTH * along(campaign)
    turns = [np.tile(axis, (ROWS, 1)) for axis in np.eye(3)] if unknown else []
    screws = [np.hstack([turn, np.cross(turn, place)]) for turn in turns]
    if unknown:
        screws += [np.tile(axis, (ROWS, 1)) for axis in np.eye(6)[3:]]
    if effects:
        turn = np.cos(campaign.coordinates[:, :1]) * [0, 0, 1.0]
        screws.append(np.hstack([turn, np.cross(turn, place)]))
    columns = [(screw / SIGMA).ravel() for screw in screws]
    return np.array(columns).reshape(-1, 6 * ROWS).T


class Case:
    """A bar with all of that, or some, wrong; its rows, its terms, and its model."""

    def __init__(self, unknown, effects, names):
        rng = np.random.default_rng(7)
        spring = np.diag([np.inf, np.inf, STIFFNESS, np.inf, np.inf, np.inf])
        heat = rng.normal(size=ROWS)
        campaign = bar(LOAD, rows=ROWS, spring=spring, temperature=heat)
        self.conditions = replace(
            conditions_of(campaign), second_order=np.tile(SECOND, (ROWS, 1))
        )
        self.declared = conditions_of(campaign)
        response = responses(self.conditions)
        sensitivities = Sensitivities(self.conditions, campaign.robot, response)
        every = small_terms(campaign, self.conditions, response)
        for k, one in enumerate(FUNCTIONS):
            columns = in_cells(sensitivities, one, campaign)
            axis = sensitivities.axes(one)
            every.append(function_term(f"function {k + 1}", axis, columns))
        self.terms = [term for term in every if term.name in names]
        self.flat = flat_columns(campaign, unknown, effects)
        read = rng.normal(size=6 * ROWS) + self.flat @ np.append(
            20e-5 * rng.normal(size=6 * int(unknown)), 40e-5 * np.ones(int(effects))
        )
        for term in self.terms:
            x = sizes_of(term, SCALES[term.name]) * rng.normal(size=len(term))
            read += term.columns @ (np.abs(x) if term.name == SPRINGS else x)
        turn = LOAD[2] / STIFFNESS * np.array([0, 0, 1.0])
        gives = [np.tile(turn, (ROWS, 1)), np.cross(turn, LENGTH * along(campaign))]
        measured = np.hstack(gives) + SECOND + read.reshape(ROWS, 6) * SIGMA
        registration = "unknown" if unknown else "known"
        self.campaign = replace(campaign, measured=measured, registration=registration)
        self.read = read
        self.fitting = self.campaign.take(FITTED)
        own = [t.take(np.ones(len(t), bool), np.flatnonzero(CELLS)) for t in self.terms]
        self.own = own
        scales = {t.name: SCALES[t.name] for t in own}
        used = tuple(np.ones(len(t), bool) for t in own)
        behind = background(own, Prior(used, scales, 0.0, 0.0))
        some = self.conditions.take(FITTED)
        members = [device_frame(some)] if unknown else []
        members += [ECCENTRIC] if effects else []
        start = np.concatenate([np.zeros(0), *(h.start for h in members)])
        fit = refit(self.fitting, some, members, start, behind=behind)
        learned = tuple(Learned(one, (), 1.0) for one in FUNCTIONS)
        self.model = FittedModel(self.conditions, response, fit, behind, learned)

    def steps(self):
        rows = RowSets(FITTED, ~FITTED)
        small = [term for term in self.own if term.name in {GEOMETRY, SPRINGS}]
        return ladder(
            self.campaign, self.declared, self.model, small, rows, RANK,
            self.model.residual(self.campaign),
        )  # fmt: skip

    def sizes(self, count, first):
        """Of the first terms; the likeliest, zero of what is not in use, at a step."""
        if not first or not count:
            return [sizes_of(t, SCALES[t.name]) for t in self.terms[:count]]
        own = self.own[:count]
        prior = Evidence(own, int(CELLS.sum())).best(self.read[CELLS])
        scales = dict.fromkeys(SCALES, (0.0, 0.0)) | prior.scales
        return [
            np.where(used, sizes_of(term, scales[term.name]), 0.0)
            for term, used in zip(own, prior.used, strict=True)
        ]

    def left(self, flat, sizes, shift=0.0):
        """(6 R,) what the most probable unknowns leave, fitted to some rows."""
        used = self.terms[: len(sizes)]
        small = [t.columns * size for t, size in zip(used, sizes, strict=True)]
        A = np.hstack([flat, *small])
        norm = np.linalg.norm(A, axis=0)
        scale = np.where(norm > 0, norm, 1.0)
        prior = np.repeat([0.0, 1.0], [flat.shape[1], A.shape[1] - flat.shape[1]])
        A = A / scale
        z = self.read + shift
        above = np.vstack([A[CELLS], np.diag(np.sqrt(prior) / scale)])
        x = np.linalg.lstsq(above, np.append(z[CELLS], 0 * prior), rcond=1e-10)[0]
        return (z - A @ x).reshape(ROWS, 6)

    def said(self, sizes):
        """How many combinations of the small unknowns the readings say."""
        used = self.own[: len(sizes)]
        small = [t.columns * size for t, size in zip(used, sizes, strict=True)]
        gains = np.linalg.svd(np.hstack([np.zeros((CELLS.sum(), 1)), *small]))[1] ** 2
        return float(np.sum(gains / (1 + gains)))


def assert_left(rung, left):
    """Root mean squares over the rows kept aside, to what is of second order."""
    z = left[~FITTED]
    rotation, position = z[:, :3] * SIGMA[:3], z[:, 3:] * SIGMA[3:]
    assert rung.error.rotation == pytest.approx(np.sqrt(np.mean(rotation**2)), rel=0.01)
    assert rung.error.position == pytest.approx(np.sqrt(np.mean(position**2)), rel=0.01)
    assert rung.error.normalised == pytest.approx(np.sqrt(np.mean(z**2)), rel=0.01)


@pytest.mark.parametrize("unknown", [False, True])
@pytest.mark.parametrize("effects", [False, True])
@pytest.mark.parametrize("names", [
    (), (GEOMETRY,), (GEOMETRY, SPRINGS), (SPRINGS,), ("function 1",),
    (GEOMETRY, "function 1"), (GEOMETRY, SPRINGS, "function 1", "function 2"),
])  # fmt: skip
def test_a_step_leaves_what_its_unknowns_cannot_explain(unknown, effects, names):
    """Each fitted with all before it, to rows that do not judge; then its own count."""
    case = Case(unknown, effects, names)
    steps = iter(case.steps())
    device, every = case.flat[:, : 6 * unknown], case.flat
    second = np.tile(SECOND / SIGMA, ROWS)
    rung = next(steps)
    assert (rung.term, rung.unknowns) == ("declared", 0)
    assert_left(rung, (case.read + second).reshape(ROWS, 6))
    if unknown:
        rung = next(steps)
        assert (rung.term, rung.unknowns) == ("registration", 6)
        assert_left(rung, case.left(device, [], second))
    said, count = 0.0, 0
    for name in (GEOMETRY, SPRINGS):
        before, rung = rung, next(steps)
        assert rung.term == name
        if name not in names:
            assert (rung.unknowns, rung.error) == (0, before.error)
            continue
        count += 1
        sizes = case.sizes(count, first=True)
        assert rung.unknowns == pytest.approx(case.said(sizes) - said, rel=1e-4)
        assert_left(rung, case.left(device, sizes))
        said = case.said(sizes)
    before, rung = rung, next(steps)
    assert rung.term == "library effects"
    assert rung.unknowns == (RANK if effects else 0)
    if effects:
        assert_left(rung, case.left(every, case.sizes(count, first=False)))
    else:
        assert rung.error == before.error
    for k in range(count, len(names)):
        rung = next(steps)
        assert rung.term == "learned effects"
        sizes = case.sizes(k + 1, first=False)
        said = case.said(sizes) - case.said(sizes[:-1])
        assert rung.unknowns == pytest.approx(said, rel=1e-4)
        assert_left(rung, case.left(every, sizes))
    assert list(steps) == []
