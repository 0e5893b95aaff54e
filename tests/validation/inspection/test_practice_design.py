"""Test inspections of campaigns that an external program simulated.

The external program computed the cosine between the simulated effect and each library
effect.
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
    """Inspections of all campaigns by name."""
    return {n: inspect_campaign(read_campaign(PRACTICE / n)) for n in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_noise_from_repeats_agrees_with_the_simulated_noise(name, inspections):
    """The true ratio is 1, and the p-value must be above 0.001 on both sides."""
    noise = inspections[name].noise
    squares = noise.degrees * noise.ratio**2
    assert 1e-3 < chi2.cdf(squares, noise.degrees) < 1 - 1e-3
    assert noise.suspects == ()
    assert inspections[name].repeats.order == "interleaved"


@pytest.mark.parametrize("name", NAMES)
def test_angles_between_signatures_agree_with_external_program(name, inspections):
    """The tolerance of 4e-4 is due to finite motions.

    Only effects with the same unknowns in both programs are compared.
    """
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
