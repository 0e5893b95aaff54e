"""Results of an allocation as plain values, text lines and a data set."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.statistics.allocated_tolerances import (
    Allocation,
    allocation_of,
    allocation_text,
)
from forcefit.assembly.statistics.clearance_positions import CLEARANCE_MODELS
from tests.robots_for_tests import coaxial_beams
from tests.tolerances_for_tests import plan_for

NAN = float("nan")
CHECK = {
    "draws": 500, "verdict": "shown", "look": 2, "most_looks": 4, "confidence": 0.95,
    "confidence_of_a_look": 0.9875,
    "yield": {"probability": 0.99, "lower": 0.976, "upper": 0.9967, "undecided": 0},
}  # fmt: skip


def allocation(**values):
    """Two classes: angles of the second bar, and its length with that of the first."""
    plan = plan_for(
        coaxial_beams(np.zeros(6)), [("two", 1), ("one", 3), ("two", 3)], [1] * 3,
        {"energy": 2.0}, asked_yield=0.9,
    )  # fmt: skip
    plan = replace(
        plan, group=np.array([1, 0, 0]), names=("length", "angle"),
        costs=np.array([3.0, 5.0]), most=np.array([1e-2, 0.1]),
    )  # fmt: skip
    options = {name: values.pop(name) for name in list(values) if hasattr(plan, name)}
    found = Allocation(
        plan=replace(plan, **options), tolerances=np.array([1.25e-3, 0.0999]),
        price=20.0, uniformly_scaled=np.array([1e-3, 0.08]),
        price_uniformly_scaled=25.0, price_bound=NAN, cuts=7,
    )  # fmt: skip
    return replace(found, **values)


def test_tolerance_class_has_the_unit_of_its_first_error():
    first, second = allocation_of(allocation())["tolerances"]
    assert first == {
        "name": "length", "tolerance": 1.25e-3, "unit": "m", "scaled_alike": 1e-3,
        "cost": 3.0, "loosest_allowed": 1e-2, "at_loosest": False,
        "share": pytest.approx(3.0 / 1.25e-3 / (3.0 / 1.25e-3 + 5.0 / 0.0999)),
    }  # fmt: skip
    assert (second["name"], second["unit"], second["cost"]) == ("angle", "rad", 5.0)
    for tolerance, loosest in ((0.0999 + 1e-6, True), (0.0999 - 1e-6, False)):
        some = allocation(tolerances=np.array([1e-3, tolerance]))
        assert allocation_of(some)["tolerances"][1]["at_loosest"] == loosest


def test_allocation_states_the_clearance_model_only_for_pose_error_limits():
    for limits, play in (({"rotation": 1e-3}, "worst"), ({"energy": 1.0}, None)):
        plain = allocation_of(allocation(limits=limits))
        assert plain["clearance"] == play
        said = f"pose errors: clearance worst: {CLEARANCE_MODELS['worst']}"
        assert (said in allocation_text(plain).splitlines()) == (play is not None)
        attributes = allocation(limits=limits).to_xarray().attrs
        assert attributes["clearance"] == (play or "")


def test_allocation_data_set_contains_tolerances_and_provenance():
    found = allocation(verification=CHECK, seed=7)
    data = found.to_xarray()
    assert list(data["class"].values) == ["length", "angle"]
    assert list(data["unit"].values) == ["m", "rad"]
    np.testing.assert_array_equal(data["tolerance"], found.tolerances)
    np.testing.assert_array_equal(data["scaled_alike"], found.uniformly_scaled)
    np.testing.assert_array_equal(data["loosest_allowed"], [1e-2, 0.1])
    np.testing.assert_array_equal(data["cost"], [3.0, 5.0])
    table = found.to_pandas()
    assert list(table.index) == ["length", "angle"]
    np.testing.assert_array_equal(table["tolerance", ""], found.tolerances)
    attributes = data.attrs
    assert (attributes["seed"], attributes["yield"]) == (7, 0.9)
    assert (attributes["price"], attributes["price_alike"]) == (20.0, 25.0)
    assert attributes["limit.energy"] == 2.0
    assert attributes["verified_yield"] == 0.99
    assert attributes["said"].startswith("price 20, 25 with those of the convex")
    assert attributes["said"].count("; ") == 1
    assert np.isnan(allocation().to_xarray().attrs["verified_yield"])
