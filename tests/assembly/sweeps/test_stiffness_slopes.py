"""Derivatives of the platform compliance with respect to numbers in a robot file."""

import json

import numpy as np
import pytest

from forcefit import load_robot, place_robot
from forcefit.assembly.platform_stiffness.linear_tangent import without_clearance
from forcefit.assembly.sweeps.parameters import load_design
from forcefit.assembly.sweeps.stiffness_slopes import CannotChange, stiffness_slopes

POSE = {"tx": 0.1, "tz": -0.5}


def test_derivative_by_youngs_modulus_equals_closed_form():
    """The derivative is -C_links / E, where C_links is the compliance of all links."""
    path = "link_a.link.young"
    slope = stiffness_slopes(load_design("irsbot2"), [path], POSE)[path]
    robot = load_robot("irsbot2")
    answer = without_clearance(place_robot(robot, POSE))
    links = [C for part, C in answer.contributions().items()
             if part.frame.endswith("link_a") and part.kind == "link"]  # fmt: skip
    assert len(links) == 2
    young = robot.frame("leg1.link_a").link.young
    size = np.sqrt(np.outer(*[np.diag(answer.compliance)] * 2))
    np.testing.assert_allclose(slope * young / size, -sum(links) / size, atol=1e-6)


BAR = """
platform = "tip"
[[frame]]
name = "tip"
parent = "PARENT"
translation = [0.5, 0.0, 0.0]
link = { beam = { radius = 0.01 }, young = 7e10, poisson = 0.3 }
"""
DRIVE = """[[frame]]
name = "drive"
parent = "base"
joint = "revolute"
actuated = true
"""
EFFECT = 'effect = [{ name = "drive_compliance", parameters = { drive = 5e4 } }]'


def slope_by_length(tmp_path, text):
    """Return dC / dL for a bar along x, clamped or on a drive."""
    path, name = tmp_path / "bar.toml", "tip.translation.x"
    path.write_text(text)
    return stiffness_slopes(load_design(path), [name])[name]


def test_derivative_by_bar_length_equals_textbook_values(tmp_path):
    """The derivatives of L/EA and L^2/2EI are 1/EA and L/EI."""
    slope = slope_by_length(tmp_path, BAR.replace("PARENT", "base"))
    area, inertia = np.pi * 1e-4, np.pi * 1e-8 / 4
    assert slope[3, 3] == pytest.approx(1 / (7e10 * area), rel=1e-6)
    assert slope[2, 4] == pytest.approx(0.5 / (7e10 * inertia), rel=1e-6)


def test_stiffness_command_computes_derivatives_at_the_exact_equilibrium(run):
    """The derivatives depend on the load."""
    slopes = []
    for words in ([], ["--state", "exact", "--load", "fx=-300"]):
        status, out, _ = run(
            "assembly", "stiffness", "four_bar", "--by", "crank_pin.link.young",
            "--json", "-", *words,
        )  # fmt: skip
        assert status == 0
        slopes.append(json.loads(out)["slopes"]["crank_pin.link.young"][3][3])
    # All other entries are zero except for round-off.
    assert slopes[1] < 0.0
    assert abs(slopes[1] / slopes[0] - 1) > 1e-4


def test_slopes_include_the_effects_in_the_robot_file(tmp_path):
    """A drive of stiffness k at the start of an arm adds the compliance L^2/k with the
    derivative 2 L/k.
    """
    arm = BAR.replace("PARENT", "drive") + DRIVE
    rigid, soft = (slope_by_length(tmp_path, text) for text in (arm, EFFECT + arm))
    difference = np.zeros((6, 6))
    difference[4, 4], difference[2, 4], difference[4, 2] = 2 * 0.5 / 5e4, 2e-5, 2e-5
    np.testing.assert_allclose(soft - rigid, difference, atol=1e-11)


def test_length_in_an_overconstrained_loop_is_rejected(run):
    path = "leg1.link_a.translation.x"
    with pytest.raises(CannotChange, match="leg1.link_a.translation.x cannot change"):
        stiffness_slopes(load_design("irsbot2"), [path], POSE)
    status, out, _ = run(
        "assembly", "stiffness", "irsbot2", "--by", path, "--by", "link_a.link.young",
    )  # fmt: skip
    assert status == 1
    assert "--by leg1.link_a.geometric_error.tx" in out
    assert "dC/d(link_a.link.young), diagonal" in out
