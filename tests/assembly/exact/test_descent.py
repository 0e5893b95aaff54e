"""Derivatives of the exact equilibrium's potential, and steps that do not exist."""

import numpy as np
import pytest

from forcefit.assembly.exact.dead_load import dead_loads, work_gradient
from forcefit.assembly.exact.descent import NotConverged, advance, expand, potential
from forcefit.assembly.exact.finite_robot import FiniteRobot
from forcefit.assembly.exact.placement import place
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.kinematics.se3 import inverse
from forcefit.assembly.linear.closure import virtual_joints
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from tests.assembly.exact.test_dead_load import heavy
from tests.assembly.exact.test_placement import moved_unknowns
from tests.robots_for_tests import random_robot


def expansion(seed):
    """Far from home, where the closures hold nevertheless, under loads of all kinds."""
    rng = np.random.default_rng(seed)
    posture = home_posture(heavy(random_robot(rng, 3, 3), rng))
    model, x, h = moved_unknowns(posture, rng, 0.1)
    x[model.bounded] *= 0.5 / np.abs(x[model.bounded]).max(initial=1.0)
    T, (first, second) = place(model, x).transforms, model.closed_frames.T
    vars(model)["nominal_closures"] = inverse(T[first]) @ T[second]
    bodies = rng.normal(size=(len(posture.robot.frames), 6))
    loads = dead_loads(posture, rng.normal(size=6), bodies, 9.81 * rng.normal(size=3))
    there = place(model, x)
    return expand(there, loads, rng.normal(size=len(there.residual))), h


@pytest.mark.parametrize("seed", range(3))
def test_expansion_derivatives_equal_central_differences(seed):
    """Central differences of 1e-5; multipliers and basis are held."""
    local, h = expansion(seed)
    model, x, step = local.placement.model, local.placement.x, 1e-5
    ahead, behind = place(model, x + step * h), place(model, x - step * h)
    slope = (potential(ahead, local.loads) - potential(behind, local.loads)) / step / 2
    assert local.gradient @ h == pytest.approx(slope, rel=1e-6)

    def unbalanced(at):
        forces = -work_gradient(at, local.loads) - at.rows.T @ local.multipliers
        forces[model.springs] += at.x[model.springs]
        return forces

    bend = (unbalanced(ahead) - unbalanced(behind)) / (2 * step)
    assert np.abs(local.hessian @ h - bend).max() < 1e-6 * np.abs(bend).max()


def test_gap_that_clearance_cannot_close_raises_an_error_of_no_convergence():
    """A gap of 1 mm between rigid parts with a clearance of 0.1 mm."""
    frames = (
        Frame("one", clearance=Clearance(axial=1e-4)), Frame("tip", "one"),
        Frame("two", geometric_error=[0, 0, 0, 0, 0, 1e-3]), Frame("end", "two"),
    )  # fmt: skip
    posture = home_posture(Robot("rigid", "tip", frames, (("tip", "end"),)))
    model = FiniteRobot(posture, virtual_joints(posture.robot))
    local = expand(place(model, np.zeros(1)), dead_loads(posture), np.zeros(6))
    message = "rigid: the closures stay open: neither a spring nor a clearance"
    with pytest.raises(NotConverged, match=message):
        advance(local, 1.0, 0.0, False)
