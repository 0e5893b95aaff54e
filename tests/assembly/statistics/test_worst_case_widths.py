"""Minimum-cost widths of callouts for a yield of 1."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from typer.testing import CliRunner

from forcefit.assembly.callouts.callout import Callout, Datum
from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from forcefit.assembly.statistics.allocated_tolerances import (
    allocation_of,
    allocation_text,
)
from forcefit.assembly.statistics.allocation import allocate
from forcefit.assembly.statistics.tolerance_file import read_plan
from forcefit.commands.app import app
from forcefit.inputs.table import BadInput
from tests.drawn_four_bar_for_tests import COEFFICIENTS, LEVER, four_bar_file

LIMIT = 1e-4  # [m]
PLAN = """
yield = 1.0
[limits]
{limit}
[[tolerance]]
callouts = ["{first}"]
cost = 1.0
[[tolerance]]
callouts = ["{second}"]
cost = 4.0
"""
OF_ARM = PLAN.format(limit=f"translation = {LIMIT}", first="arm", second="hand")


def arm(bend=0.8, **elbow):
    """Return an arm with links of 0.4 and 0.3 m."""
    return Robot(
        "arm",
        "tip",
        (
            Frame("shoulder", joint="revolute", actuated=True, position=0.5),
            Frame("elbow", "shoulder", np.array([0.4, 0, 0]), joint="revolute",
                  actuated=True, position=bend, **elbow),
            Frame("tip", "elbow", np.array([0.3, 0, 0])),
        ),
        callouts=(
            Callout("arm", "elbow", (Datum("shoulder"),), length=(0.4, 50e-6)),
            Callout("hand", "tip", (Datum("elbow"),), length=(0.3, 20e-6)),
        ),
    )  # fmt: skip


def allotted(tmp_path, robots, text, fresh=0):
    path = tmp_path / "plan.toml"
    path.write_text(text)
    return allocate(
        [home_posture(r) for r in robots], read_plan(path, robots[0]), fresh
    )


def cheapest(bend, limit):
    """Return the minimum of 1/a + 4/b subject to |a u + b v| <= limit, where u and v
    are the directions of the links.
    """
    c = abs(np.cos(bend))

    def price(ratio):
        size = np.sqrt(1 + ratio**2 + 2 * ratio * c)
        return (1 + 4 / ratio) * size / limit

    ratio = minimize_scalar(price, bounds=(1e-2, 1e2), method="bounded").x
    a = limit / np.sqrt(1 + ratio**2 + 2 * ratio * c)
    return np.array([a, ratio * a])


def test_minimum_cost_of_arm_lengths_equals_closed_form(tmp_path):
    found = allotted(tmp_path, [arm()], OF_ARM, fresh=500)
    best = cheapest(0.8, LIMIT)
    assert found.price == pytest.approx(1 / best[0] + 4 / best[1], rel=2e-3)
    assert found.price_bound <= found.price
    assert found.price_bound == pytest.approx(found.price, rel=2e-3)
    assert found.tolerances == pytest.approx(best, rel=0.05)  # the minimum is flat
    assert found.verification["yield"]["probability"] == 1.0
    low, high = found.worst["translation"]
    assert 0.998 * LIMIT < low <= high <= LIMIT * (1 + 1e-12)
    assert "no tolerances cost less than" in allocation_text(allocation_of(found))


def test_all_corners_satisfy_the_limit_in_nonlinear_geometry(tmp_path):
    a, b = allotted(tmp_path, [arm()], OF_ARM).tolerances

    def tip(first, second):
        return first * np.exp(0.5j) + second * np.exp(1.3j)

    signs = itertools.product((-1, 1), repeat=2)
    corners = [tip(0.4 + s * a, 0.3 + t * b) - tip(0.4, 0.3) for s, t in signs]
    largest = np.abs(corners).max()
    assert 0.998 * LIMIT < largest <= LIMIT * (1 + 1e-9)


def test_allocation_includes_the_largest_clearance_of_a_fit(tmp_path):
    """The fit adds a radial clearance of 17.5 um."""
    clearance = {"clearance": Clearance(radial=10.25e-6)}
    robot = replace(arm(**clearance), fits={"elbow": "12 H7/g6"})
    found = allotted(tmp_path, [robot], OF_ARM)
    best = cheapest(0.8, LIMIT - 17.5e-6)
    assert found.price == pytest.approx(1 / best[0] + 4 / best[1], rel=2e-3)


def test_posture_with_the_largest_error_determines_the_tolerances(tmp_path):
    """The error is largest at the posture with the most extended arm."""
    found = allotted(tmp_path, [arm(1.2), arm(0.8)], OF_ARM)
    alone = allotted(tmp_path, [arm(0.8)], OF_ARM)
    assert found.price == pytest.approx(alone.price, rel=1e-6)


def test_length_tolerances_of_a_four_bar_equal_hand_calculation(
    tmp_path,
    write_file,
):
    """The minimum of 1/a + 4/b subject to (ca a + cb b)/lever <= limit is at a, b ~
    sqrt(cost/c).
    """
    robot = read_robot(write_file(four_bar_file()))
    text = PLAN.format(
        limit="rotation = 1e-4", first="B on crank", second="C on rocker"
    )
    found = allotted(tmp_path, [robot], text)
    roots = np.sqrt([1.0, 4.0])
    c = np.array([COEFFICIENTS["crank"], COEFFICIENTS["rocker"]]) / LEVER
    best = 1e-4 * roots / np.sqrt(c) / (roots @ np.sqrt(c))
    assert found.tolerances == pytest.approx(best, rel=2e-3)


def test_limit_below_the_clearance_of_a_fit_is_rejected(tmp_path):
    clearance = {"clearance": Clearance(radial=10.25e-6)}
    robot = replace(arm(**clearance), fits={"elbow": "12 H7/g6"})
    text = PLAN.format(limit="translation = 1e-5", first="arm", second="hand")
    with pytest.raises(BadInput, match="^limit translation: [^\n]*$"):
        allotted(tmp_path, [robot], text)


def test_over_constrained_robot_with_clearance_is_rejected(tmp_path):
    """A planar four-bar linkage with rigid bodies is over-constrained."""
    path = tmp_path / "four_bar.toml"
    text = four_bar_file("radial = 1e-5")
    path.write_text(text.replace("length =", 'extent = 0.02\nposition = "0.1 mm" #'))
    robot = read_robot(path)
    plan = PLAN.format(
        limit="rotation = 1e-2", first="B on crank", second="C on rocker"
    )
    with pytest.raises(BadInput, match="over-constrained robot that is rigid"):
        allotted(tmp_path, [robot], plan)


def test_tolerances_command_allocates_widths_for_the_worst_case(tmp_path):
    write_robot(arm(), tmp_path / "arm.toml")
    (tmp_path / "plan.toml").write_text(OF_ARM)
    words = ["assembly", "tolerances", str(tmp_path / "arm.toml"), "--plan",
             str(tmp_path / "plan.toml"), "--grid", "tx=0.43", "--draws", "100",
             "--json", str(tmp_path / "answer.json"),
             "--report", str(tmp_path / "page.html")]  # fmt: skip
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "answer.json").read_text())["allocation"]
    assert found["yield"] == 1.0
    assert found["worst"]["translation"]["proven"] <= LIMIT * (1 + 1e-12)
    refused = CliRunner().invoke(app, [*words, "--clearance", "least"])
    assert isinstance(refused.exception, BadInput)
