"""Energies of many points: closed forms, certificates, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.robot import Frame, MatrixLink, Robot
from tests.robots_for_tests import (
    assemble_at,
    coaxial_beams,
)


def test_redundant_free_motions_have_the_least_norm():
    """Two pins on one axis share its rotation: half each, as by the reference."""
    gap = [1e-3, 0, 2e-3, 1e-4, 0, 0]
    frames = (
        Frame("one", translation=[0.5, 0, 0], link=MatrixLink(1e5 * np.eye(6))),
        Frame("pin", "one", joint="revolute"),
        Frame("mid", "pin"),
        Frame("second", "mid", [0, 0, 0.1], joint="revolute"),
        Frame("end", "second", [0, 0, -0.1]),
        Frame("wall", translation=[0.5, 0, 0], geometric_error=gap),
    )
    robot = Robot("pins", "mid", frames, (("end", "wall"),))
    home = home_posture(robot)
    batch = assemble_at(robot, home.transforms[None])
    one = solve_assembly(home, method="reference")
    assert batch.method[0] == "compiled"
    assert batch.platform_screw[0] == pytest.approx(one.platform_screw, abs=1e-14)
    # the pin below the platform turns half the 2e-3 rad about their common axis
    assert batch.platform_screw[0, 2] == pytest.approx(1e-3, rel=1e-9)


def test_energy_of_a_stiff_spring_in_series_with_a_soft_one_is_accurate():
    """1 and 1e-8 rad/(N m) about one axis, twice 1e-8 across it."""
    soft = np.diag([1.0, 1e8, 1e8, 1e8, 1e8, 1e8])
    gap = np.array([1e-2, 1e-4, 0, 0, 0, 0])
    frames = (
        Frame("one", translation=[0.5, 0, 0], link=MatrixLink(soft)),
        Frame("end", "one", rotation=[0, 0, 0.3], link=MatrixLink(1e8 * np.eye(6))),
        Frame("wall", translation=[0.5, 0, 0], rotation=[0, 0, 0.3],
              geometric_error=gap),
    )  # fmt: skip
    robot = Robot("two", "end", frames, (("end", "wall"),))
    batch = assemble_at(robot, home_posture(robot).transforms[None])
    turned = np.array([
        gap[0] * np.cos(0.3) - gap[1] * np.sin(0.3),
        gap[0] * np.sin(0.3) + gap[1] * np.cos(0.3),
    ])
    # by hand: 1 + 1e-8 about the soft axis, 2e-8 across
    by_hand = turned[0] ** 2 / (1 + 1e-8) / 2 + turned[1] ** 2 / 2e-8 / 2
    assert batch.energy[0] == pytest.approx(by_hand, rel=1e-12)


def test_solution_with_a_changed_value_is_not_certified(grid):
    """Springs are 1.5e-8 too long, or multipliers 2e-4 too small or NaN."""
    robot, postures = grid
    T = postures[0].transforms[None].copy()
    good = assemble_at(robot, T)
    worse = replace(good, elastic=good.elastic * (1 + 1.5e-8))
    assert good.certified.all()
    assert not worse.certified.any()
    weaker = replace(good, multipliers=good.multipliers * (1 - 2e-4))
    assert not weaker.certified.any()
    unknown = replace(good, multipliers=good.multipliers * np.nan)
    assert not unknown.certified.any()


@pytest.mark.parametrize(
    ("shape", "errors", "message"),
    [
        ((2, 5, 4, 4), None, r"transforms of shape \(2, 5, 4, 4\)"),
        ((2, 6, 4, 4), (3, 6, 6), r"errors of shape \(3, 6, 6\), expected"),
        ((2, 6, 3, 4), None, r"transforms of shape \(2, 6, 3, 4\)"),
    ],
)
def test_transforms_or_errors_of_a_wrong_shape_are_refused(shape, errors, message):
    robot = coaxial_beams(np.zeros(6))
    given = None if errors is None else np.zeros(errors)
    with pytest.raises(ValueError, match=message):
        assemble_at(robot, np.zeros(shape), given)


def test_values_that_are_not_finite_are_refused():
    robot = coaxial_beams(np.zeros(6))
    T = home_posture(robot).transforms[None].copy()
    with pytest.raises(ValueError, match="not all finite"):
        assemble_at(robot, T, np.full((6, 6), np.nan))
    T[0, 0, 0, 3] = np.inf
    with pytest.raises(ValueError, match="not all finite"):
        assemble_at(robot, T)


def test_empty_list_of_postures_gives_an_empty_solution():
    robot = coaxial_beams(np.zeros(6))
    assert len(assemble_at(robot, np.zeros((0, 6, 4, 4))).energy) == 0
