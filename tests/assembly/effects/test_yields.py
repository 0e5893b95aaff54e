"""Functions of wrenches at the same or another frame."""

from dataclasses import replace
from math import cos

import numpy as np
import pytest

from forcefit.assembly.effects import apply_effects
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.robot import MatrixLink
from tests.assembly.effects.test_effects import L, here
from tests.assembly.effects.test_functions import (
    RIGID,
    at_drive,
    campaign_of,
    seen,
    turned,
)

F = 30.0  # [N] transverse force on the arm


def loaded(q):
    return here(RIGID, (0, 0, 0, 0, F, 0), q=q)


@pytest.mark.parametrize("place", ["base", "drive"])
def test_function_of_the_base_moment_rotates_the_drive(place):
    """Base and drive have the same origin and therefore the same moment about z."""
    law = at_drive({"2": 1e-7}, variables=(f"wrench.{place}.mz",))
    turn = 1e-7 * (F * L * cos(0.5)) ** 2
    found = seen(loaded(0.5), law)[0]
    assert found == pytest.approx(turned(turn, 0.5), rel=1e-4, abs=1e-9)


def test_compliance_linear_in_the_moment_equals_the_closed_form():
    """The drive rotates by (c + d M) M."""
    soft = at_drive(
        {"0": 1e-5, "1": 2e-7}, variables=("wrench.drive.mz",), kind="compliance"
    )
    M = F * L * cos(0.3)
    found = seen(loaded(0.3), soft)[0]
    turn = (1e-5 + 2e-7 * M) * M
    assert found == pytest.approx(turned(turn, 0.3), rel=1e-3, abs=1e-8)


def test_reversal_is_proportional_to_the_absolute_moment():
    """The deflection is the direction of motion times |M|."""
    q = [0.0, 0.5, 0.2]
    rows = campaign_of(np.arange(3.0), q=q, approach=1.0)
    side = np.array([1, 1, -1])
    for sign in (1.0, -1.0):
        there = replace(rows, load=np.tile([0, 0, sign * 4.0, 0, 0, 0], (3, 1)))
        back = at_drive({"1": 1e-6}, "reversal", ("q.drive", "wrench.drive.mz"))
        assert seen(there, back)[:, 2] == pytest.approx(side * 4e-6, rel=1e-6)


def test_function_of_two_components_has_separate_parameters():
    both = Function(
        "drive", ("rz", "tx"), ("q.drive",), "powers", {"rz.0": 1e-5, "tx.0": 2e-5}
    )
    found = seen(here(RIGID), both)[0]
    assert found == pytest.approx([0, 0, 1e-5, 2e-5, 1e-5 * L, 0], rel=1e-4, abs=1e-9)


def test_modulus_scale_multiplies_a_stiffness_matrix():
    tip = replace(RIGID.frames[1], link=MatrixLink(np.diag([1e4] * 3 + [1e6] * 3)))
    there = here(replace(RIGID, frames=(RIGID.frames[0], tip)), (0, 0, 0, 0, F, 0))
    link = apply_effects(there, {"modulus_scale": {"tip": 2.0}}).robot.frames[1].link
    assert np.array_equal(link.stiffness, 2.0 * tip.link.stiffness)
