"""Importance of errors: indices, parts, gains and ranks."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.importance_slopes import (
    platform_gains,
    platform_slopes,
)
from forcefit.assembly.statistics.importance_table import (
    ImportanceOptions,
    importance_dataset,
    importance_design,
    importance_report,
    importance_rows,
    importance_text,
)
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.ranking import (
    kind_of,
    leaders,
    named_together,
    possible_ranks,
    rank_text,
    shares_sentence,
)
from tests.tolerances_for_tests import arm

WIDTHS = np.array([2e-3, 0, 0, 3e-4, 4e-4, 0.0])
NAMES = ["tip.RX", "tip.TX", "tip.TY"]


def driven_arm(**options):
    """Return a driven arm with one angular error and two length errors."""
    robot = arm()
    sources = tolerance_sources(robot, WIDTHS, ("tip",))
    return Experiment(home_posture(robot), sources, margins=False, **options)


def solved(by="source", draws=400, **options):
    """Return the importance for an arm, as a data set and as a dictionary."""
    experiment = driven_arm(clearance="least", **options)
    design = importance_design(experiment, ImportanceOptions(draws, by))
    rows = importance_rows(experiment, design, 0, len(design))
    data = importance_dataset(experiment, design, rows)
    return data, importance_report(data)


def test_gain_of_each_error_of_an_open_chain_is_one():
    """A uniform error of half width w has the standard deviation w / sqrt(3), which 400
    draws estimate to 4 %. Gains are exact.
    """
    data, report = solved()
    assert list(data["group"].values) == NAMES
    deviation = WIDTHS[WIDTHS > 0] / np.sqrt(3)
    for name, size, unit in zip(NAMES, deviation, ("rad", "m", "m"), strict=True):
        one = report["platform"][name]
        moved, still = ("rotation", "translation")[:: 1 if unit == "rad" else -1]
        assert one["error_unit"] == unit
        assert one[f"{moved}_part"] == pytest.approx(size, rel=0.15)
        assert one[f"{moved}_gain"] == pytest.approx(1.0, rel=1e-12)
        assert one[f"{still}_part"] == pytest.approx(0.0, abs=1e-3 * size)
        assert one[f"{still}_gain"] == pytest.approx(0.0, abs=1e-12)
    assert (report["base_draws"], report["clearance"]) == (400, "least")
    quantities = report["quantities"]
    assert set(quantities) == {"energy", "rotation", "translation", "force"}
    # The energy of an open chain is zero.
    assert quantities["energy"]["reason"] == "it does not vary"
    assert "reason" not in quantities["translation"]
    total = quantities["rotation"]["total_index"]
    assert [total[name][0] for name in NAMES] == pytest.approx([1, 0, 0], abs=0.15)


def test_group_of_angles_and_lengths_has_no_gain():
    """The part of a frame is the root of the sum of squares of its errors' parts."""
    data, report = solved("frame")
    (one,) = report["platform"].values()
    assert one["error_unit"] == "rad, m"
    assert np.isnan(one["translation_gain"])
    assert np.isnan(one["rotation_gain"])
    lengths = np.linalg.norm(WIDTHS[3:]) / np.sqrt(3)
    assert one["translation_part"] == pytest.approx(lengths, rel=0.1)
    assert data["part"].sel(component="rotation").item() == one["rotation_part"]


def test_missing_indices_are_reported_with_a_reason():
    """No indices are reported if more than 5 % of the draws are omitted."""
    experiment = driven_arm(clearance="least")
    design = importance_design(experiment, ImportanceOptions(100, "source"))
    rows = importance_rows(experiment, design, 0, len(design))
    for lost, reason in ((4, None), (6, "6.0%")):
        some = rows.copy()
        for name in ("translation", "platform_screw"):
            some[name][:lost] = np.nan
        report = importance_report(importance_dataset(experiment, design, some))
        one = report["quantities"]["translation"]
        assert one["largest_share_left_out"] == pytest.approx(lost / 100)
        lines = importance_text(report).splitlines()
        if reason is None:
            assert "reason" not in one
            said = "up to 4.0% of the draws have no solution and are left out"
            assert f"translation: {said}" in lines
            assert report["platform"]["tip.TX"]["translation_gain"] > 0.5
            continue
        assert "more than 5% of the draws have no solution: up to 6" in one["reason"]
        assert f"translation: {one['reason']}" in lines
        assert all(np.isnan(v).all() for v in one["total_index"].values())
        # The parts are NaN.
        parts = [v["translation_part"] for v in report["platform"].values()]
        assert np.isnan(parts).all()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_gain_of_a_rotation_error_equals_its_lever_arm(seed):
    """A rotation of the pin about y or z moves the tip at a distance of 0.4 m by 0.4 um
    per urad. A rotation about x does not move the tip.
    """
    robot = arm()
    sources = tolerance_sources(robot, [1e-3, 2e-3, 3e-3, 0, 0, 0], ("pin",))
    experiment = Experiment(home_posture(robot), sources, seed, "least", margins=False)
    design = importance_design(experiment, ImportanceOptions(16, "source"))
    rotation, translation = platform_gains(experiment, design)
    np.testing.assert_allclose(rotation, 1.0, rtol=1e-12)
    np.testing.assert_allclose(translation, [0.0, 0.4, 0.4], atol=1e-12)


def test_gain_of_a_group_is_weighted_by_variance():
    """RY at the pin has a lever arm of 0.4 m, and RY at the tip has none. Their
    standard deviations are in the ratio 1 : 2.
    """
    robot = arm()
    pin = tolerance_sources(robot, [0, 1e-3, 0, 0, 0, 0], ("pin", "tip"))
    pin.scale[1] *= 2.0
    experiment = Experiment(home_posture(robot), pin, 1, "least", margins=False)
    design = importance_design(experiment, ImportanceOptions(16, "source"))
    groups = [("both", np.arange(2))]
    _, translation = platform_gains(
        experiment, type(design)(design.A, design.B, groups)
    )
    assert translation[0] == pytest.approx(0.4 / np.sqrt(5), rel=1e-12)


@pytest.mark.parametrize(
    ("name", "load"),
    [
        ("irsbot2", None),
        ("irsbot2", [3.0, 0, -2.0, 20.0, -10.0, -60.0]),
        ("five_bar", [0, 0, 0, 20.0, -10.0, 0]),
    ],
)
def test_platform_slopes_equal_central_differences(name, load, rng):
    """The robots are loaded by errors or by external loads."""
    robot = load_robot(name)
    pose = {"tx": 0.1, "tz": -0.5} if name == "irsbot2" else None
    posture = place_robot(robot, pose=pose) if pose else home_posture(robot)
    prepared = linear_response(posture, load)
    touched = np.array([f.link is not None for f in robot.frames])[:, None]
    size = np.array([5e-3] * 3 + [2e-4] * 3) * touched
    errors = rng.normal(size=(4, *size.shape)) * size
    draws = prepared.solve(errors)
    slopes = platform_slopes(prepared, draws)
    step = 1e-5 * rng.normal(size=size.shape) * size
    ahead, back = (prepared.solve(errors + s).platform_screw for s in (step, -step))
    along = np.einsum("ckni,ni->kc", slopes, step)
    scale = np.abs(along).max(axis=0)
    assert (ahead - back) / 2 / scale == pytest.approx(along / scale, abs=2e-3)


def shares(**intervals):
    return {name: ((a + b) / 2, a, b) for name, (a, b) in intervals.items()}


def test_overlapping_intervals_have_common_ranks():
    """The intervals of a and b overlap, and so do those of b and c, but not those of a
    and c. The interval of d is below all others.
    """
    ranks = possible_ranks(
        shares(a=(0.5, 0.7), b=(0.4, 0.6), c=(0.3, 0.45), d=(0.0, 0.1))
    )
    assert ranks == {"a": (1, 2), "b": (1, 3), "c": (2, 3), "d": (4, 4)}
    assert leaders(ranks) == ["a", "b"]
    assert [rank_text(ranks[k]) for k in "abd"] == ["1-2", "1-3", "4"]


def test_nan_shares_have_no_rank():
    nan = float("nan")
    ranks = possible_ranks(shares(a=(0.5, 0.7)) | {"b": (nan, nan, nan)})
    assert ranks == {"a": (1, 1)}
    assert rank_text(ranks.get("b")) == ""
    assert possible_ranks({}) == {}


def test_names_of_errors_are_merged_if_all_legs_are_named():
    every = [f"leg{i}.hinge.{c}" for i in (1, 2, 3) for c in ("RX", "RY")]
    some = ["leg3.hinge.RX", "leg1.hinge.RX", "leg2.hinge.RX"]
    assert named_together(some, every) == ["hinge.RX of all legs"]
    # If one leg is missing, the other legs keep their names.
    assert named_together(some[:2], every) == some[:2]
    one_more = named_together(["leg1.hinge.RY", *some], every)
    assert one_more == ["leg1.hinge.RY", "hinge.RX of all legs"]
    assert named_together(["tip.RX"], ["tip.RX", "tip.RY"]) == ["tip.RX"]
    assert kind_of("tip.RX") == "tip.RX"
    assert kind_of("leg1.upper.pin.TZ") == "upper.pin.TZ"
    assert kind_of("leg1.hinge") == "hinge"


def test_shares_in_a_sentence_are_at_most_100_percent():
    few = [("bore", (0.78, 0.3, 1.63)), ("pin", (0.01, -0.02, 0.02))]
    assert shares_sentence(few, "translation") == (
        "bore: 78 % of the variance of the translation (30 to 100 %); "
        "pin: 1 % (0 to 2 %)"
    )
