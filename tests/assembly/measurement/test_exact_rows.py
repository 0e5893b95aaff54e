"""Exact equilibria of many measurements."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from forcefit.assembly.kinematics.posture import (
    home_posture,
    place_many_joints,
    together,
)
from forcefit.assembly.measurement.conditions import ContactLaw, as_declared
from forcefit.assembly.measurement.exact_rows import solve_rows
from forcefit.assembly.measurement.predict import assemble_row, predict
from forcefit.assembly.measurement.settled_clearance import without_joint_clearances
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.robots import load_robot

ROBOTS = {"five_bar": 0.3, "3rrr": 0.2, "hexapod": 0.02, "arm6": 0.4}


def loaded_rows(name, rng, laws=()):
    """Return conditions of a robot with errors, loads and weight at several postures.

    Errors are 0.2 mm and 0.2 mrad, and forces are about 100 N.
    """
    robot = without_joint_clearances(load_robot(name))
    home = np.array([f.position if f.actuated else np.nan for f in robot.frames])
    wanted = home + ROBOTS[name] * rng.uniform(-1, 1, (3, len(home)))
    postures, _ = place_many_joints(robot, wanted)
    postures = [p for p in postures if p is not None] * 2
    count = len(postures)
    here = as_declared(
        together(postures),
        rng.uniform(-1, 1, (count, 6)) * np.repeat([5.0, 100.0], 3),
        mismatch=[p.mismatch for p in postures],
        point=[0.02, -0.01, 0.03],
        gravity=[1.0, 2.0, -9.81],
    )  # fmt: skip
    errors = rng.uniform(-1, 1, here.errors.shape) * 2e-4
    return replace(here, errors=errors, exact=True, laws=laws)


@pytest.mark.parametrize(("name", "pieces"), [*((n, 1) for n in ROBOTS),
                                              ("five_bar", 3)])  # fmt: skip
def test_exact_solutions_together_equal_single_solutions(name, pieces, rng):
    """Both solutions converge to 1e-12."""
    here = loaded_rows(name, rng)
    if pieces > 1:
        whole, _ = solve_rows(here, np.zeros((len(here), 0)))
        links = {f.name: replace(f.link, pieces=pieces)
                 for f in here.robot.frames if f.link}  # fmt: skip
        here = replace(here, robot=here.robot.with_links(links))
    screws, found = solve_rows(here, np.zeros((len(here), 0)))
    assert found.all()
    for row in range(len(here)):
        alone = assemble_row(here, row).platform_screw
        np.testing.assert_allclose(screws[row], alone, rtol=0, atol=2e-11)
    linear = predict(replace(here, exact=False)).deviation
    # The exact and linear results differ.
    assert np.abs(predict(here).deviation - linear).max() > 1e-7
    assert pieces == 1 or np.abs(screws - whole).max() > 1e-8


BAR = Robot(
    "bar", "tip",
    (
        Frame("drive", "base", joint="revolute", actuated=True),
        Frame("tip", "drive", translation=[1.0, 0.0, 0.0]),
    ),
)  # fmt: skip


@pytest.mark.parametrize("force", [5.0, 200.0, -200.0])
def test_moments_of_a_bar_on_a_contact_are_in_equilibrium(force):
    """The angle a satisfies c |a|^n sign(a) = F L cos a."""
    c, n = 2e5, 1.5
    load = [0, 0, 0, 0, force, 0]
    here = as_declared(home_posture(BAR), load)
    here = replace(here, laws=(ContactLaw("drive", c, n),), exact=True)
    a = brentq(
        lambda x: c * abs(x) ** n * np.sign(x) - force * np.cos(x), -0.5, 0.5,
        xtol=1e-15,
    )  # fmt: skip
    np.testing.assert_allclose(predict(here).deviation[0, 2], a, rtol=1e-10)


def test_contact_without_load_has_zero_deflection():
    """The secant stiffness is infinite without load."""
    here = as_declared(home_posture(BAR), np.zeros(6))
    here = replace(here, laws=(ContactLaw("drive", 2e5, 1.5),), exact=True)
    np.testing.assert_array_equal(predict(here).deviation, 0.0)


def test_measurements_that_do_not_converge_are_solved_one_by_one():
    """The spring is soft, so the bar rotates by several radians."""
    K = np.diag([np.inf, np.inf, 1.0, np.inf, np.inf, np.inf])
    frames = (replace(BAR.frames[0], joint_stiffness=K), BAR.frames[1])
    robot = replace(BAR, frames=frames)
    here = as_declared(home_posture(robot), [0, 0, 0, 0, 3.0, 0])
    here = replace(here, exact=True)
    _, found = solve_rows(here, np.zeros((1, 0)))
    assert not found.any()
    angle = predict(here).deviation[0, 2]
    assert angle == pytest.approx(brentq(lambda x: x - 3 * np.cos(x), 0, 2), rel=1e-9)
