"""Test the conversion of a diagnosis to plain values."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.validation.diagnosis import results as module
from forcefit.validation.diagnosis.fit import MachineFit
from forcefit.validation.diagnosis.nuisance import GEOMETRY, SPRINGS
from forcefit.validation.diagnosis.unknowns import Acting, Small, Unknowns
from tests.bar_for_tests import LONGER, TURNED, bar


def fitted(robot, parts, x, std):
    """Return a fitted machine with given parameters and standard deviations."""
    effects = tuple(Acting(p, np.zeros(1)) for p in parts if not isinstance(p, Small))
    small = tuple(p for p in parts if isinstance(p, Small))
    unknowns = Unknowns(robot, effects, small)
    C, nothing = np.diag(np.array(std) ** 2), np.zeros((1, len(x)))
    return MachineFit(unknowns, np.array(x), C, nothing, np.zeros(1))


def diagnosis(campaign, fit, **more):
    return SimpleNamespace(campaign=campaign, fit=fit, robot=fit.robot, **more)


def test_effect_has_value_standard_deviation_and_90_per_cent_interval():
    """The half width of the interval is 1.645 standard deviations."""
    fit = fitted(bar().robot, [TURNED, LONGER], [3e-4, -2e-4], [2e-5, 1e-5])
    one = diagnosis(bar(), fit, probability={"link_length": 0.9})
    turned, length = module.effects(one)
    assert (length["name"], length["where"]) == ("link_length", ["tip"])
    assert (length["probability"], turned["probability"]) == (0.9, 0.0)
    (number,) = length["parameters"]
    assert (number["name"], number["unit"]) == ("tip", "m")
    assert number["value"] == pytest.approx(-2e-4)
    assert number["std"] == pytest.approx(1e-5)
    interval = [-2e-4 - 1.645e-5, -2e-4 + 1.645e-5]
    assert number["interval_90"] == pytest.approx(interval)
    assert "found" not in number


def test_declared_effect_has_declared_value_difference_and_sum():
    """The declared value is 0.5 mrad, and the difference is 0.3 mrad."""
    campaign = bar()
    robot = replace(campaign.robot, effects={"encoder_offset": {"drive": 5e-4}})
    campaign = replace(campaign, robot=robot)
    fit = fitted(robot, [TURNED], [3e-4], [2e-5])
    (turned,) = module.effects(diagnosis(campaign, fit, probability={}))
    (number,) = turned["parameters"]
    assert number["value"] == pytest.approx(8e-4)
    assert number["interval_90"] == pytest.approx([8e-4 - 3.29e-5, 8e-4 + 3.29e-5])
    expected = {"declared": 5e-4, "difference": 3e-4, "corrected": 8e-4}
    assert number["found"] == pytest.approx(expected)


def test_nuisance_parameters_are_listed_with_determined_fractions():
    """The fraction is 1 minus the posterior variance over the prior variance.

    Frames with a small fraction are omitted from the list of frames.
    """
    geometry = Small(GEOMETRY, np.array([0, 0, 1, 1]), np.array([2, 3, 0, 5]),
                     np.array([1e-4, 2e-4, 1e-4, 2e-4]))  # fmt: skip
    springs = Small(SPRINGS, np.zeros(2, int), np.array([1, 4]), np.array([1e-7, 1e-9]))
    share = np.array([0.5, 0.25, 0.03, 0.01, 0.9, 0.06])
    prior = np.concatenate([geometry.std, springs.std])
    x = np.array([1e-4, 2e-4, 3e-5, 4e-5, 5e-8, 6e-10])
    fit = fitted(bar().robot, [geometry, springs], x, prior * np.sqrt(1 - share))
    one = diagnosis(bar(), fit)
    told = module.small(one, GEOMETRY)
    assert told["scale"] == {"rotation": 1e-4, "translation": 2e-4}
    assert told["unit"] == {"rotation": "rad", "translation": "m"}
    assert (told["unknowns"], told["identifiable"]) == (4, pytest.approx(0.79))
    assert told["where"] == ["drive"]
    ((name, known),) = [one.values() for one in told["frames"]]
    assert (name, known) == ("drive", pytest.approx(0.75))
    assert [
        (p["frame"], p["component"], p["value"], p["unit"]) for p in told["parameters"]
    ] == [
        ("drive", "rz", 1e-4, "rad"), ("drive", "tx", 2e-4, "m"),
        ("tip", "rx", 3e-5, "rad"), ("tip", "tz", 4e-5, "m"),
    ]  # fmt: skip
    assert [p["identified"] for p in told["parameters"]] == pytest.approx(share[:4])
    told = module.small(one, SPRINGS)
    assert [p["unit"] for p in told["parameters"]] == ["rad/(N m)", "m/N"]
    assert told["scale"] == {"rotation": 1e-7, "translation": 1e-9}
    assert told["identifiable"] == pytest.approx(0.96)
    assert module.small(one, "nothing") is None
