"""Tolerance files and verification of tolerances."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from forcefit import BadInput, load_robot, zone_margin
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics import verification
from forcefit.assembly.statistics.quantities import limit_names, parse_limit
from forcefit.assembly.statistics.tolerance_file import read_plan
from forcefit.assembly.statistics.tolerances import (
    grid_postures,
    present_errors,
    present_text,
)
from tests.robots_for_tests import NUMBERS, irsbot2_with


class Coin:
    """Requirement with a known yield that does not depend on the tolerances."""

    asked_yield, postures, cases = 0.9, (None,), (("force", 0),)

    def __init__(self, holds, seed):
        self.holds, self.seed, self.plan = holds, seed, self

    def draws_of(self, stream, count):
        return np.random.default_rng((self.seed, stream)).random((count, 1))

    def spread(self, tolerances):
        return tolerances

    def utilisations(self, values):
        share = np.where(values.T < self.holds, 0.5, 2.0)
        return share, share


def test_repeated_verification_has_the_stated_error_probability(monkeypatch):
    """The final interval does not contain the true yield in at most 5 % of all cases.
    The yield is so low that most verifications are repeated. Without correction for
    repeated verification, the error probability would be 9 %.
    """
    monkeypatch.setattr(verification, "scale_uniformly", lambda *given: given[2])
    monkeypatch.setattr(verification, "bracketed", cache(verification.bracketed))
    holds, trials, missed, looks = 0.85, 3000, 0, 0
    for seed in range(trials):
        check = verification.verify(
            Coin(holds, seed), np.ones(1), 400, lambda *_: None
        )[1]
        missed += not check["yield"]["lower"] <= holds <= check["yield"]["upper"]
        looks += check["look"]
    assert looks > 2 * trials
    # Three standard errors are added.
    assert missed / trials <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / trials)
    assert check["confidence"] == 0.95
    assert check["confidence_of_a_look"] == pytest.approx(1 - 0.05 / 4)


FILE = """
yield = 0.95
cost = "logarithm"
[limits]
margin_free = 1.0
energy = 2.0
[[tolerance]]
name = "length"
frames = ["link_a", "link_b"]
components = ["TX"]
cost = 2.0
most = 1e-3
[[tolerance]]
frames = ["leg1.tip"]
components = ["RX", "RY"]
"""


def test_tolerance_file_is_read_with_groups_costs_and_limits(write_file):
    plan = read_plan(write_file(FILE), load_robot("irsbot2"))
    assert plan.names == ("length", "leg1.tip.RX")
    assert plan.group.tolist() == [0] * 4 + [1] * 2
    assert plan.costs.tolist() == [2.0, 1.0]
    assert plan.most.tolist() == [1e-3, 0.1]
    assert plan.limits == {"margin_free": 1.0, "energy": 2.0}
    assert (plan.asked_yield, plan.cost) == (0.95, "logarithm")


@pytest.mark.parametrize("cost", ["logarithm", "reciprocal"])
def test_cost_of_tolerances_equals_closed_form(cost, write_file):
    """Tolerances with cost coefficients 2 and 1 are multiplied by e or by 2."""
    plan = read_plan(write_file(FILE.replace("logarithm", cost)), load_robot("irsbot2"))
    t = np.array([3e-4, 2e-2])
    if cost == "reciprocal":
        assert plan.price(2 * t) == pytest.approx(plan.price(t) / 2)
        assert plan.price(np.array([3e-4, np.inf])) == pytest.approx(2.0 / 3e-4)
        return
    assert plan.price(np.ones(2)) == 0.0
    assert plan.price(t) - plan.price(np.e * t) == pytest.approx(3.0)
    assert plan.price(t) - plan.price(t * [np.e, 1]) == pytest.approx(2.0)


@pytest.mark.parametrize("name", ["always", "mostly", "forced", "limited"])
def test_example_tolerance_files_are_valid(name):
    folder = Path(__file__).parents[3] / "examples" / "tolerance_allocation"
    plan = read_plan(folder / f"{name}.toml", load_robot("irsbot2"))
    assert len(plan.names) == 7
    # Section IV of the paper: 6 errors of 12 frames, without TY and TZ of four links.
    assert len(plan.sources) == 64
    assert plan.asked_yield == (1.0 if name == "always" else 0.99)


REFUSED = {
    "a yield above 1": ("yield = 0.95", "yield = 1.2",
        "yield: found 1.2, expected a number of magnitude at most 1 [1]"),
    "a yield of none": ("yield = 0.95", "yield = 0.0",
        "yield: found 0.0, expected a finite number > 0 [1]"),
    "no deviations": ("yield", "deviations = 0.0\nyield",
        "deviations: found 0.0, expected a finite number > 0 [1]"),
    "no draws": ("yield", "draws = 0\nyield",
        "draws: found 0, expected a finite number >= 1 [1]"),
    "too many draws": ("yield", "draws = 10000001\nyield",
        "draws: found 10000001, expected a number of magnitude at most 1e+07 [1]"),
    "half a draw": ("yield", "draws = 10.5\nyield",
        "draws: expected whole numbers for draws and seed"),
    "half a seed": ("yield", "seed = 0.5\nyield",
        "draws: expected whole numbers for draws and seed"),
    "a seed below 0": ("yield", "seed = -1\nyield",
        "seed: found -1, expected a finite number >= 0 [1]"),
    "another law of costs": ('"logarithm"', '"log"',
        'cost: found "log"; valid: logarithm, reciprocal'),
    "another limit": ("energy = 2.0", "enrgy = 2.0",
        'limits: unknown key "enrgy"; did you mean "energy"?'),
    "a cost below 0": ("cost = 2.0", "cost = -2.0",
        "tolerance[1].cost: found -2.0, expected a finite number > 0 [1]"),
    "nothing allowed": ("most = 1e-3", "most = 0.0",
        "tolerance[1].most: found 0.0, expected a finite number > 0 [m]"),
    "a least below 0": ("most = 1e-3", "least = -1e-9",
        "tolerance[1].least: found -1e-09, expected a finite number >= 0 and < 0.01 "
        "[m]"),
    "a least of the most": ("most = 1e-3", "most = 1e-3\nleast = 1e-3",
        "tolerance[1].least: found 0.001, expected a finite number >= 0 and < 0.001 "
        "[m]"),
    "an unknown frame": ('"leg1.tip"', '"leg1.tap"',
        'tolerance[2].frames: irsbot2: no frame "leg1.tap"; did you mean "leg1.tip"?'),
    "no frame": ('["leg1.tip"]', "[]",
        "tolerance[2].frames: expected at least one frame"),
    "a word for frames": ('["leg1.tip"]', '"leg1.tip"',
        "tolerance[2].frames: expected a list of names"),
    "an unknown component": ('["RX", "RY"]', '["RX", "RQ"]',
        'tolerance[2].components: found "RQ"; valid: RX, RY, RZ, TX, TY, TZ'),
    "a number for a component": ('["RX", "RY"]', "[3]",
        "tolerance[2].components: expected a list of names"),
    "no component": ('["RX", "RY"]', "[]",
        "tolerance[2].components: expected components that are all angles or all "
        "lengths, at least one"),
    "angles and lengths": ('["RX", "RY"]', '["RZ", "TX"]',
        "tolerance[2].components: expected components that are all angles or all "
        "lengths, at least one"),
    "an error twice in a table": ('"TX"', '"TX", "TX"',
        'tolerance[1]: found "leg1.link_a.TX" twice, first in this table'),
    "an error in two tables": (
        '["leg1.tip"]\ncomponents = ["RX", "RY"]',
        '["leg2.link_a"]\ncomponents = ["TX"]',
        'tolerance[2]: found "leg2.link_a.TX" twice, first in "length"'),
    "a name twice": ('["RX", "RY"]', '["TX"]\nname = "length"',
        "tolerance: found two tolerances of the same name, expected different names"),
    "no table": (FILE, "yield = 0.9",
        "tolerance: missing; expected tables [[tolerance]]"),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), REFUSED.values(), ids=REFUSED)
def test_invalid_tolerance_file_is_rejected_with_one_message(
    old, new, message, write_file
):
    path = write_file(FILE.replace(old, new, 1))
    with pytest.raises(BadInput) as error:
        read_plan(path, load_robot("irsbot2"))
    assert str(error.value) == f"{path}: {message}"


def test_errors_of_an_open_chain_have_zero_margin():
    """An open chain can be assembled for all errors."""
    arm = load_robot("arm6")
    robot = arm.with_errors(np.full((len(arm.frames), 6), 1e-4))
    found = present_errors([home_posture(robot)])
    assert (found["largest_margin"], found["factor_on_errors"]) == (0.0, np.inf)
    assert found["assemblable_share"] == 1.0
    assert len(found["slopes"]) == 6 * len(arm.frames)
    assert {one["share_of_margin"] for one in found["slopes"]} == {0.0}


def test_errors_scaled_by_the_reported_factor_have_margin_one():
    """The margin is proportional to the errors, so it is 1 for the scaled errors."""
    robot = irsbot2_with(NUMBERS["cases"][0])
    postures, _ = grid_postures(robot, "tx=-0.1:0.1:0.1,tz=-0.5")
    found = present_errors(postures)
    assert found["postures"] == 3
    scaled = robot.with_errors(found["factor_on_errors"] * robot.errors)
    margins = [zone_margin(replace(p, robot=scaled), "free").margin for p in postures]
    assert max(margins) == pytest.approx(1.0, rel=1e-7)
    shares = [one["share_of_margin"] for one in found["slopes"]]
    assert sum(shares) == pytest.approx(1.0, rel=1e-6)
    assert shares == sorted(shares, reverse=True)
    text = "all postures assemble if all errors are multiplied by"
    assert text in present_text(found)


@pytest.mark.parametrize(
    ("kind", "deviations", "deviation"),
    [("truncated", "deviations = 4.0", 1 / 4), ("truncated", "", 0.9866 / 3),
     ("uniform", "", 1 / np.sqrt(3))],
)  # fmt: skip
def test_errors_of_a_plan_have_the_requested_distribution(
    write_file, kind, deviations, deviation
):
    """The default distribution is a normal distribution, truncated at three standard
    deviations, which reduces its standard deviation by the factor 0.9866.
    """
    text = f"distribution = '{kind}'\n{deviations}\n"
    plan = read_plan(write_file(text + FILE), load_robot("irsbot2"))
    drawn = plan.sources.draw(0, 4000, seed=1)
    assert 0.9 < np.abs(drawn).max() <= 1.0
    assert np.std(drawn) == pytest.approx(deviation, rel=0.02)


def test_limit_is_read_with_and_without_spaces():
    for name in limit_names():
        assert parse_limit(f"{name}=2.5e-4") == (name, 2.5e-4)
        assert parse_limit(f" {name} = 3 ") == (name, 3.0)


@pytest.mark.parametrize("number", ["0", "-1e-9", "inf", "nan", "", "2 J", "1=2"])
def test_limit_that_is_not_positive_is_rejected(number):
    with pytest.raises(BadInput) as error:
        parse_limit(f"force={number}")
    expected = f'--limit force: found "{number}", expected a number > 0'
    assert str(error.value) == expected


def test_unknown_quantity_is_rejected_with_the_nearest_name():
    with pytest.raises(BadInput, match='unknown quantity "enrgy".*energy'):
        parse_limit("enrgy=2")
    for name in ("translation_lower", "duality_gap", "platform_screw", ""):
        with pytest.raises(BadInput, match=f'^--limit: unknown quantity "{name}"'):
            parse_limit(f"{name}=1")
