"""Inspections of campaigns that another, geometrically exact program simulated.

The truth it wrote down has, for each effect of the library, the cosine between what the
hidden effect did and what that effect could have done: both worked out by that program.
"""

import json

import numpy as np
import pytest
from scipy.stats import chi2

from examples.campaign_folder import data_folder
from forcefit.inputs.table import BadInput
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.diagnosis.derivatives import Derivatives
from forcefit.validation.diagnosis.signatures import Tangents, conditions_of
from forcefit.validation.inspection.inspection import inspect_campaign

try:
    PRACTICE = data_folder("practice")
except BadInput as error:
    pytest.skip(str(error), allow_module_level=True)
TRUTH = json.loads((PRACTICE / "truth_practice.json").read_text())
NAMES = sorted(TRUTH)


@pytest.fixture(scope="module")
def inspections():
    """Inspections of all campaigns."""
    return {n: inspect_campaign(read_campaign(PRACTICE / n)) for n in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_noise_from_repeats_agrees_with_the_simulated_noise(name, inspections):
    """The true ratio is 1;
    the bounds are chi-square tails of 1/1000 each, for six campaigns."""
    noise = inspections[name].noise
    squares = noise.degrees * noise.ratio**2
    assert 1e-3 < chi2.cdf(squares, noise.degrees) < 1 - 1e-3
    assert noise.suspects == ()
    assert inspections[name].repeats.order == "interleaved"


@pytest.mark.parametrize("name", NAMES)
def test_angles_between_signatures_agree_with_the_exact_program(name, inspections):
    """To 4e-4, the difference between finite motions and secants, for effects with
    equal unknowns: contacts have another exponent there, and moduli may be grouped."""
    hidden = {
        e["name"]: {p["name"]: p["value"] for p in e["parameters"]}
        for e in TRUTH[name]["effects"]
        if not e["name"].startswith("_")
    }
    campaign = inspections[name].campaign
    columns = inspections[name].signatures.columns
    tangents = Tangents(campaign, Derivatives(conditions_of(campaign)))
    done = tangents.model(hidden) - tangents.declared if hidden else None
    compared = 0
    for other in TRUTH[name]["alternatives"] if hidden else ():
        if not set(other["names"]) <= set(columns):
            continue
        if "contact_stiffening" in other["names"]:
            continue
        A = np.hstack([columns[n] for n in other["names"]])
        if A.shape[1] != other["parameters"]:
            continue
        x, *_ = np.linalg.lstsq(A / np.linalg.norm(A, axis=0), done, rcond=1e-6)
        fit = A / np.linalg.norm(A, axis=0) @ x
        cosine = np.linalg.norm(fit) / np.linalg.norm(done)
        assert cosine == pytest.approx(other["cosine"], abs=4e-4), other["names"]
        compared += 1
    assert compared >= 7 or not hidden


def test_expansion_at_constant_temperature_is_equivalent_to_a_longer_link(inspections):
    classes = inspections["p06_confounded"].separability.classes()
    assert ("thermal_expansion", "delayed_expansion", "link_length") in classes
    for name in ("p02_self_weight", "p03_thermal_expansion"):
        found = inspections[name].separability.classes()
        assert not any("thermal_expansion" in c for c in found)
