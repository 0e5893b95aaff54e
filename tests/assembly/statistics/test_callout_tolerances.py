"""Tolerances and widths of callouts of minimum cost."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from forcefit import BadInput, Clearance, Frame, Robot, write_robot
from forcefit.assembly.callouts.callout import Callout, Datum
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics.allocated_tolerances import (
    allocation_of,
    allocation_text,
)
from forcefit.assembly.statistics.allocation import allocate
from forcefit.assembly.statistics.tolerance_file import read_plan
from tests.drawn_four_bar_for_tests import COEFFICIENTS, LEVER, four_bar_file
from tests.tolerances_for_tests import two_links

LIMIT = 1e-4  # [m]
ARM = two_links()
FIT = Clearance(radial=10.25e-6)  # mean clearance of 12 H7/g6
PLAN = """
yield = {share}
draws = 400
[limits]
{limit}
[[tolerance]]
name = "arm"
{first}
cost = 1.0
[[tolerance]]
name = "hand"
{second}
cost = 4.0
"""


def plan_of(first="arm", second="hand", limit=f"translation = {LIMIT}", share=1.0):
    first, second = (f'callouts = ["{name}"]' for name in (first, second))
    return PLAN.format(share=share, limit=limit, first=first, second=second)


def allotted(folder, robots, text, fresh=0, **options):
    """Return the allocation for the text of a plan and robots in their home poses."""
    path = folder / "plan.toml"
    path.write_text(text)
    plan = replace(read_plan(path, robots[0]), **options)
    return allocate([home_posture(r) for r in robots], plan, fresh)


def test_length_callouts_have_the_tolerances_of_independent_errors(tmp_path):
    """A length callout has the same distribution as an independent uniform error."""
    frames = PLAN.format(
        share=0.9, limit=f"translation = {LIMIT}",
        first='frames = ["elbow"]\ncomponents = ["TX"]',
        second='frames = ["tip"]\ncomponents = ["TX"]',
    )  # fmt: skip
    of_callouts, of_frames = (
        allotted(tmp_path, [ARM], text, clearance="least")
        for text in (plan_of(share=0.9), frames)
    )
    assert of_callouts.tolerances == pytest.approx(of_frames.tolerances, rel=1e-6)
    assert "arm: +-" in allocation_text(allocation_of(of_callouts))


def test_width_of_a_position_zone_agrees_with_nonlinear_simulation(tmp_path):
    """The tip is 150 mm above a bore of 20 mm length, whose ends are uniform in discs.
    The width is the limit divided by the 90 % quantile of the offset for a width of 1.
    """
    frames = (
        Frame("foot", joint="revolute", actuated=True),
        Frame("bore", "foot", np.array([0.4, 0, 0]), joint="revolute", actuated=True),
        Frame("tip", "bore", np.array([0, 0, 0.15])),
    )
    bore = Callout("bore", "bore", (Datum("foot"),), extent=(0.02,),
                   widths={"position": 0.3e-3})  # fmt: skip
    text = plan_of(share=0.9).partition("[[tolerance]]")[0].replace("400", "4000")
    found = allotted(
        tmp_path, [Robot("post", "tip", frames, callouts=(bore,))],
        text + '[[tolerance]]\ncallouts = ["bore"]\n', clearance="least",
    )  # fmt: skip
    points = np.random.default_rng(5).uniform(-1, 1, (4_000_000, 2))
    points = points[np.hypot(*points.T) <= 1] / 2
    half = len(points) // 2
    up, down = points[:half], points[half : 2 * half]
    offset = (up + down) / 2 + (up - down) / 0.02 * 0.15
    quantile = np.quantile(np.hypot(*offset.T), 0.9)
    # To demonstrate the yield with 95 % confidence, the width is about 1 % smaller.
    assert 0.97 * 1e-4 / quantile < found.tolerances[0] < 1e-4 / quantile
    text = allocation_text(allocation_of(found))
    assert "position of bore: " in text
    assert "+-" not in text.splitlines()[0]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("translation", "energy", "found 1 with callouts"),
        ('["hand"]', '["hnd"]', 'found "hnd"; did'),
        ('["hand"]', '["arm"]', '"arm" twice'),
        ('["hand"]', "[]", "at least one"),
        ('["hand"]', "[1]", "a list of names"),
    ],
)
def test_invalid_callouts_in_a_tolerance_file_are_rejected(tmp_path, old, new, message):
    with pytest.raises(BadInput, match=message) as error:
        allotted(tmp_path, [ARM], plan_of().replace(old, new))
    assert "\n" not in str(error.value)


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
    found = allotted(tmp_path, [ARM], plan_of(), fresh=500)
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
    a, b = allotted(tmp_path, [ARM], plan_of()).tolerances

    def tip(first, second):
        return first * np.exp(0.5j) + second * np.exp(1.3j)

    signs = itertools.product((-1, 1), repeat=2)
    corners = [tip(0.4 + s * a, 0.3 + t * b) - tip(0.4, 0.3) for s, t in signs]
    largest = np.abs(corners).max()
    assert 0.998 * LIMIT < largest <= LIMIT * (1 + 1e-9)


def test_allocation_includes_the_largest_clearance_of_a_fit(tmp_path):
    """The fit adds a radial clearance of 17.5 um."""
    robot = replace(two_links(elbow=FIT), fits={"elbow": "12 H7/g6"})
    found = allotted(tmp_path, [robot], plan_of())
    best = cheapest(0.8, LIMIT - 17.5e-6)
    assert found.price == pytest.approx(1 / best[0] + 4 / best[1], rel=2e-3)
    with pytest.raises(BadInput, match="^limit translation: [^\n]*$"):
        allotted(tmp_path, [robot], plan_of(limit="translation = 1e-5"))


def test_posture_with_the_largest_error_determines_the_tolerances(tmp_path):
    """The error is largest at the posture with the most extended arm."""
    found = allotted(tmp_path, [two_links(bend=1.2), ARM], plan_of())
    alone = allotted(tmp_path, [ARM], plan_of())
    assert found.price == pytest.approx(alone.price, rel=1e-6)


def test_length_tolerances_of_a_four_bar_equal_hand_calculation(tmp_path, write_file):
    """The minimum of 1/a + 4/b subject to (ca a + cb b)/lever <= limit is at a, b ~
    sqrt(cost/c).
    """
    robot = read_robot(write_file(four_bar_file()))
    text = plan_of("B on crank", "C on rocker", "rotation = 1e-4")
    found = allotted(tmp_path, [robot], text)
    roots = np.sqrt([1.0, 4.0])
    c = np.array([COEFFICIENTS["crank"], COEFFICIENTS["rocker"]]) / LEVER
    best = 1e-4 * roots / np.sqrt(c) / (roots @ np.sqrt(c))
    assert found.tolerances == pytest.approx(best, rel=2e-3)


def test_over_constrained_robot_with_clearance_is_rejected(tmp_path, write_file):
    """A planar four-bar linkage with rigid bodies is over-constrained."""
    text = four_bar_file("radial = 1e-5")
    robot = read_robot(write_file(
        text.replace("length =", 'extent = 0.02\nposition = "0.1 mm" #')
    ))  # fmt: skip
    plan = plan_of("B on crank", "C on rocker", "rotation = 1e-2")
    with pytest.raises(BadInput, match="over-constrained robot that is rigid"):
        allotted(tmp_path, [robot], plan)


def test_tolerances_command_allocates_widths_for_the_worst_case(tmp_path, run):
    write_robot(ARM, tmp_path / "arm.toml")
    (tmp_path / "plan.toml").write_text(plan_of())
    words = ["assembly", "tolerances", tmp_path / "arm.toml", "--plan",
             tmp_path / "plan.toml", "--grid", "tx=0.43", "--draws", "100", "--json",
             tmp_path / "answer.json", "--report", tmp_path / "page.html"]  # fmt: skip
    status, _, err = run(*words)
    assert status == 0, err
    found = json.loads((tmp_path / "answer.json").read_text())["allocation"]
    assert found["yield"] == 1.0
    assert found["worst"]["translation"]["proven"] <= LIMIT * (1 + 1e-12)
    assert run(*words, "--clearance", "least")[0] == 2
