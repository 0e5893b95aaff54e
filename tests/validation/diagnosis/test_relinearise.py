"""Test the linearisation of several effects against finite motions of a bar."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.validation.diagnosis.relinearise import Relinearisation
from forcefit.validation.diagnosis.states import Models
from forcefit.validation.diagnosis.weighted_readings import WeightedReadings
from tests.bar_for_tests import BEAM, LENGTH, bar, columns_of

TURN, LONGER = 6e-3, 5e-3
CAMPAIGN = bar(link=BEAM, rows=20, spread=5.0)


@pytest.fixture(scope="module")
def columns():
    return columns_of(CAMPAIGN)


def moved():
    """Return whitened readings (120,) of a longer bar with an encoder offset."""
    q = CAMPAIGN.coordinates[:, 0]
    still = np.zeros_like(q)
    place = [
        length * np.column_stack([np.cos(angle), np.sin(angle), still])
        for angle, length in ((q + TURN, LENGTH + LONGER), (q, LENGTH))
    ]
    turn = np.column_stack([still, still, still + TURN])
    return (np.hstack([turn, place[0] - place[1]]) / CAMPAIGN.sigma).ravel()


def effects(columns):
    names = {"encoder_offset": TURN, "link_length": LONGER}
    found = [e for e in columns.library if e.name in names]
    return found, [np.array([names[e.name]]) for e in found]


NOTHING = np.zeros(120)


def known(columns, z=NOTHING):
    every = np.ones(120, dtype=bool)
    models = Models(WeightedReadings(columns, z, every, np.ones(120)))
    return Relinearisation(columns.tangents, models)


def test_combined_effects_agree_with_finite_motions(columns):
    elements, xs = effects(columns)
    assert known(columns).combined(elements, xs) == pytest.approx(moved(), abs=0.02)


def test_relinearised_model_is_more_accurate_than_linear_model(columns):
    elements, xs = effects(columns)
    z = moved() + np.random.default_rng(0).normal(size=120)
    again = known(columns, z)
    first = again.models.state(tuple(elements), (False, False))
    last = again.relinearised(first)
    assert last.score > first.score + 3
    for k, (e, x) in enumerate(zip(last.elements, xs, strict=True)):
        mean = last.sizes.mean[last.own(k)]
        spread = np.sqrt(last.sizes.covariance[last.own(k), last.own(k)])[0] * e.scale
        assert abs(e.values(mean) - x) < 4 * spread


def test_drive_stiffness_is_identified_as_a_library_effect(columns):
    loaded = replace(CAMPAIGN, loads=np.tile([0, 0, 5.0, 0, 9.0, 0], (20, 1)))
    loose = columns_of(loaded)
    small, robot = loose.nuisance, CAMPAIGN.robot
    springs = {
        (robot.frames[f].name, int(axis))
        for f, axis in zip(
            small.frame[small.spring], small.axis[small.spring], strict=True
        )
    }
    assert ("drive", 2) not in springs
    assert "drive_compliance" in {e.name for e in loose.library}
