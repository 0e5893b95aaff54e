"""Test the choice of the next measurement with analytical solutions for a bar."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.validation.diagnosis.next_measurement import next_measurement
from forcefit.validation.diagnosis.signatures import conditions_of
from tests.bar_for_tests import (
    BEAM,
    ECCENTRIC,
    LENGTH,
    LONGER,
    SOFTER,
    TURNED,
    WARMER,
    bar,
    fit_of,
    gives_way,
    machine,
)
from tests.planar_arm_for_tests import SIGMA


def test_next_measurement_at_other_temperature_separates_expansion_from_length():
    """The non-centrality d'(I + J C J')^-1 d is calculated by hand.

    The difference along the bar is d = alpha L 10 K / sigma.  The predicted expansion
    at T + 10 K has the variance ((T + 10) / T)^2 / R from R readings at T.
    """
    R, T, alpha = 8, 5.0, 2e-5
    heat = {"temperature": np.full(R, T)}
    plain = bar(link=BEAM, **heat)
    campaign = bar(link=BEAM, measured=fit_of(plain, alpha * LENGTH * T), **heat)
    here = conditions_of(campaign)
    longer, warmer = machine(campaign, LONGER), machine(campaign, WARMER)
    # The first rival is equal to the fit, so the second one is used.
    found = next_measurement(campaign, here, longer, [longer, warmer])
    assert found.covariates == {"temperature": T + 10}
    d = alpha * LENGTH * 10 / SIGMA[3]
    assert found.power == pytest.approx(d**2 / (1 + ((T + 10) / T) ** 2 / R), rel=1e-3)
    assert set(found.configuration) == {"q.drive"}
    assert "link_length and thermal_expansion" in found.why


def test_next_configuration_is_between_measured_configurations():
    """An encoder offset e and an eccentricity e cos q are equal at 0 and 2 pi.

    Elsewhere they differ by e (1 - cos q). The information of one reading is I = 1 /
    sr^2 + L^2 / st^2, and the variance of the offset is 1 / (2 I).
    """
    e = 3e-4
    seen = np.tile([0, 0, e, 0, LENGTH * e, 0], (2, 1))
    campaign = bar(rows=2, spread=2 * np.pi, measured=seen)
    here = conditions_of(campaign)
    turned = machine(campaign, TURNED)
    eccentric = machine(campaign, ECCENTRIC)
    found = next_measurement(campaign, here, turned, [eccentric])
    q = found.configuration["q.drive"]
    assert abs(q - np.pi) < 0.2
    information = 1 / SIGMA[2] ** 2 + LENGTH**2 / SIGMA[4] ** 2
    power = (e * (1 - np.cos(q))) ** 2 * information / 1.5
    assert found.power == pytest.approx(power, rel=1e-3)
    by_pose = next_measurement(
        replace(campaign, commanded="pose"), here, turned, [eccentric]
    )
    pose = [by_pose.configuration[f"pose.{k}"] for k in ("tx", "ty", "tz")]
    expected = [LENGTH * np.cos(q), LENGTH * np.sin(q), 0]
    assert pose == pytest.approx(expected, abs=1e-9)
    turn = [by_pose.configuration[f"pose.{k}"] for k in ("rx", "ry", "rz")]
    assert Rotation.from_rotvec(turn).as_matrix() == pytest.approx(
        Rotation.from_rotvec([0, 0, q]).as_matrix(), abs=1e-9
    )


def test_next_temperature_exceeds_the_measured_range_by_half():
    """The range is 20 K to 60 K, so the highest candidate is 80 K."""
    heat = {"temperature": np.linspace(20.0, 60.0, 8)}
    plain = bar(link=BEAM, **heat)
    seen = fit_of(plain, 2e-6 * LENGTH) * heat["temperature"][:, None]
    campaign = bar(link=BEAM, measured=seen, **heat)
    here = conditions_of(campaign)
    longer, warmer = machine(campaign, LONGER), machine(campaign, WARMER)
    for fit, rival in ((longer, warmer), (warmer, longer)):
        found = next_measurement(campaign, here, fit, [rival])
        assert found.covariates == {"temperature": 80.0}


def test_next_load_is_1_5_times_the_largest_load():
    """The models are a compliant drive under a moment M and an encoder offset."""
    M, k = 30.0, 2e5
    campaign = gives_way(M, k)
    here = conditions_of(campaign)
    softer, turned = machine(campaign, SOFTER, start=1e-6), machine(campaign, TURNED)
    found = next_measurement(campaign, here, softer, [turned])
    assert np.abs(found.load) == pytest.approx([0, 0, 1.5 * M, 0, 0, 0])
    assert found.load[2] < 0  # the models differ most for the opposite load
