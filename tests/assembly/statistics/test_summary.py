"""Summary of given results of draws."""

import numpy as np
import pytest
import xarray
from scipy import stats

from forcefit.assembly.statistics.clearance_positions import CLEARANCE_MODELS
from forcefit.assembly.statistics.summary import summarise, summary_text
from forcefit.inputs.table import BadInput

NAN = float("nan")


def draws(play="least", status=None, screws=None, **values):
    """Return a data set of draws with given results."""
    count = len(next(iter(values.values())))
    status = np.zeros(count) if status is None else np.array(status)
    screws = np.zeros((count, 6)) if screws is None else screws
    dims = {1: ("draw",), 2: ("draw", "link")}
    variables = {k: (dims[np.ndim(v)], np.array(v)) for k, v in values.items()}
    variables.setdefault("duality_gap", (("draw",), np.zeros(count)))
    variables |= {
        "status": (("draw",), status), "platform_screw": (("draw", "screw"), screws),
    }  # fmt: skip
    return xarray.Dataset(variables, attrs={"clearance": play})


def test_probabilities_include_draws_without_a_solution():
    """Of eight draws, two cannot be assembled and three assemble by clearances alone. A
    margin may exceed 1 by round-off.
    """
    data = draws(
        energy=[0.0, 0, 0, 1, 2, 3, NAN, NAN], status=[0, 0, 0, 0, 0, 0, 1, 1],
        margin=[0.2, 0.9, 1 + 5e-7, 1 + 5e-6, 2, 3, 9, np.inf],
        duality_gap=[0, 1e-9, 0, 3e-9, 0, 0, NAN, NAN],
    )  # fmt: skip
    said = summarise(data)
    assert (said["draws"], said["assembled"]) == (8, 6)
    assert said["assembles"]["forced"]["probability"] == 6 / 8
    assert said["assembles"]["rigid"]["probability"] == 3 / 8
    assert "rigid_compliant_free" not in said["assembles"]
    assert said["duality_gap"] == 3e-9
    assert said["confidence"] == 0.95
    assert said["clearance_means"] == CLEARANCE_MODELS["least"]
    none = draws(energy=[NAN] * 3, status=[1] * 3, duality_gap=[-1.0, NAN, NAN])
    assert summarise(none)["duality_gap"] == 0.0


def test_summary_counts_draws_whose_random_walk_did_not_mix():
    data = draws("uniform", status=[0, 0, 0, 1], energy=[1.0, 1, 1, NAN],
                 clearance_mixed=[0, 1, 0, 0])  # fmt: skip
    said = summarise(data)
    assert said["clearance_not_mixed"] == 2
    text = summary_text(said)
    assert "warning: in 2 draws, the random walk of the uniform model" in text
    mixed = summarise(data.assign(clearance_mixed=("draw", [1, 1, 1, 0])))
    assert mixed["clearance_not_mixed"] == 0
    assert "warning" not in summary_text(mixed)
    assert "clearance_not_mixed" not in summarise(draws(energy=[1.0]))


def test_draw_is_undecided_if_its_bounds_include_the_limit():
    """The limit is 2, and the bounds are 0 to 2, 1 to 3, 2 to 3 and 3 to 4."""
    data = draws("worst", translation=[2.0, 3, 3, 4, NAN], status=[0, 0, 0, 0, 1],
                 translation_lower=[0.0, 1, 2, 3, NAN])  # fmt: skip
    said = summarise(data, {"translation": 2.0})
    over, within = said["exceeds"]["translation"], said["within_limits"]
    assert (over["probability"], over["undecided"]) == (2 / 5, 2)
    assert (within["probability"], within["undecided"]) == (1 / 5, 2)
    assert within["clearance"] == over["clearance"] == "worst"
    assert within["upper"] == pytest.approx(stats.binomtest(3, 5).proportion_ci()[1])
    lines = summary_text(said).splitlines()
    assert any(
        line.startswith("translation [clearance worst] above 2 m: 0.4 (")
        and line.endswith(", 2 draws undecided")
        for line in lines
    )


def test_yield_strength_is_the_default_stress_limit():
    """The safety is the yield strength divided by the largest stress."""
    data = draws(stress=[[1e6, 0.0], [4e6, 0.0], [9e6, 0.0]], status=[0, 0, 1])
    said = summarise(data, strength=2e6)
    assert said["exceeds"]["stress"]["limit"] == 2e6
    assert said["exceeds"]["stress"]["probability"] == 2 / 3
    np.testing.assert_array_equal(said["safety"], [0.5, np.inf])
    both = summarise(data, {"stress": 5e6}, strength=2e6)
    assert both["exceeds"]["stress"]["probability"] == 1 / 3
    assert both["safety"][0] == 0.5
    assert "safety" not in summarise(data)


def test_summary_of_a_quantity_omits_infinite_values():
    data = draws(force=[1.0, 2, 4, NAN, np.inf, 7], status=[0, 0, 0, 0, 0, 1])
    one = summarise(data)["quantities"]["force"]
    assert (one["of"], one["assembled"], one["draws"]) == (6, 5, 3)
    assert one["unit"] == "N"
    assert one["mean"]["value"] == pytest.approx(7 / 3)
    assert one["quantiles"]["0.5"]["value"] == 2.0
    assert one["zero"]["probability"] == 0.0
    assert set(one["quantiles"]) == {"0.05", "0.5", "0.95", "0.99"}


@pytest.mark.parametrize(("zeros", "mode"), [(50, 7.0), (51, 0.0)])
def test_mode_is_zero_if_most_values_are_zero(zeros, mode):
    """Values below 1e-18 of the largest value count as zero."""
    energy = np.r_[
        np.zeros(zeros - 2), 9e-19, -7e-18, np.linspace(6.9, 7.1, 100 - zeros)
    ]
    one = summarise(draws(energy=energy))["quantities"]["energy"]
    assert one["most_probable"]["value"] == pytest.approx(mode, abs=0.2)
    assert one["zero"]["probability"] == zeros / 100
    energy[0] = 1e-16
    more = summarise(draws(energy=energy))["quantities"]["energy"]
    assert more["zero"]["probability"] == (zeros - 1) / 100


def test_margin_quantiles_include_draws_that_cannot_be_assembled():
    """A margin of NaN is treated as infinite."""
    data = draws(margin=[0.5, 1.0, 2.0, np.inf, NAN], status=[0, 0, 1, 1, 1])
    one = summarise(data)["quantities"]["margin"]
    assert one["draws"] == 2
    every = one["all_draws"]
    assert every["infinite"]["probability"] == 2 / 5
    assert every["quantiles"]["0.5"]["value"] == 2.0
    assert every["quantiles"]["0.95"]["value"] == np.inf
    text = summary_text(summarise(data))
    assert "margin of all 5 draws: median 2 (" in text
    energy = summarise(draws(energy=[1.0, 2]))["quantities"]["energy"]
    assert "all_draws" not in energy


@pytest.mark.parametrize("key", ["force", "stress"])
def test_limit_on_a_quantity_that_was_not_computed_is_rejected(key):
    """The quantity is missing or has no values."""
    data = draws(energy=[1.0, 2.0], stress=np.zeros((2, 0)))
    with pytest.raises(
        BadInput, match=f"^limit {key}: found a quantity that was not computed; "
    ):
        summarise(data, {"energy": 1.0, key: 1.0})
