"""Test diagnoses of simulated machines with one or two library effects."""

import numpy as np
import pytest

from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.results import table
from forcefit.validation.synthetic.design import CampaignDesign, varied_for
from forcefit.validation.synthetic.effects import LIBRARY
from forcefit.validation.synthetic.equivalents import SAME, alternatives
from forcefit.validation.synthetic.generator import generate_campaign, write_campaign
from tests.campaigns_for_tests import fitted_numbers
from tests.elastic_arm_for_tests import arm, with_errors

DESIGN = CampaignDesign(
    configurations=16, rows=80, load=40.0, reach=0.8,
    reference_point=(0.02, 0.05, 0.03),
)  # fmt: skip
WIDE = {"geometric_stiffening": 30.0}  # factor on geometric errors for an effect


def understood(wanted, seed, tmp_path):
    """Return the diagnosis of a simulated campaign, and the sets of correct effects."""
    robot = with_errors(arm(), max(WIDE.get(name, 1.0) for name in wanted))
    design = varied_for(DESIGN, wanted)
    made = generate_campaign(robot, wanted, design, seed=seed, program="springs")
    write_campaign(made, tmp_path / "campaign")
    same = [one for one in alternatives(made, len(wanted)) if one.residual < SAME]
    allowed = {tuple(sorted(n.partition("(")[0] for n in one.names)) for one in same}
    found = diagnose(read_campaign(tmp_path / "campaign"))
    if set(found.claimed) == set(wanted):
        assert_true_numbers(found, made)
    return found, allowed | {tuple(sorted(wanted))}


def assert_true_numbers(found, made):
    """Check that parameters are within four standard deviations of the truth.

    Masses are not checked, because different masses have similar effects.
    """
    for one in made.effects:
        numbers = fitted_numbers(table(found)["effects"], one.name)
        for name, true in one.parameters.items():
            if true and one.name != "body_mass":
                value, std = numbers[name]
                assert abs(value - true) < 4 * std, name


@pytest.mark.slow
@pytest.mark.parametrize("name", LIBRARY)
def test_every_library_effect_is_identified_at_five_sigma(name, tmp_path):
    """An equivalent set of effects is also correct."""
    found, allowed = understood({name: 5.0}, 4, tmp_path)
    if found.verdict == "ambiguous":
        assert len(allowed) > 1
        assert {tuple(sorted(names)) for names, _ in found.alternatives[:4]} & allowed
        return
    assert found.verdict == "explained"
    assert tuple(sorted(found.claimed)) in allowed
    kept = 6 * int((found.held.rows & ~found.outliers).sum())
    assert found.after.normalised < 1 + 3 / np.sqrt(2 * kept)
    assert found.before.normalised > 2


@pytest.mark.slow
@pytest.mark.parametrize(
    "wanted",
    [
        {"self_weight": 5.0, "encoder_offset": 4.0},
        {"thermal_expansion": 4.0, "friction_hysteresis": 4.0},
        {"load_gain": 5.0, "drift": 3.0},
    ],
    ids="+".join,
)
def test_two_simulated_effects_are_identified(wanted, tmp_path):
    found, allowed = understood(wanted, 5, tmp_path)
    assert found.verdict == "explained"
    assert tuple(sorted(found.claimed)) in allowed
