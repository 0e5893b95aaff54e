"""Tests of the reference method, which uses only NumPy and Clarabel."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import Clearance, natural_modes, solve_assembly, solve_exact, zone_margin
from forcefit.assembly.kinematics import continuation_side_by_side
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear import lanes
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.pose_error import ASSUMPTIONS
from forcefit.assembly.platform_stiffness.arc_length import follow_load
from forcefit.assembly.platform_stiffness.deflection import deflection_curve
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import BUILT_IN
from forcefit.assembly.solvers import one_problem
from forcefit.assembly.solvers.conic import GAP
from forcefit.assembly.solvers.method import METHODS
from forcefit.stiffness.link import scaled
from tests.robots_for_tests import coaxial_beams

LOAD = [1.0, 0, 2, 10, 0, -50]
LOADS = (0.0, 30.0, 60.0)


def beams():
    """Return two beams with a gap that exceeds their clearance, and with masses."""
    gap = np.array([0, 0, 0, 1e-4, 0, 0])
    robot = coaxial_beams(gap, clearance=Clearance(radial=2e-5))
    frames = tuple(replace(frame, mass=1.0) for frame in robot.frames)
    return home_posture(replace(robot, frames=frames))


QUESTIONS = {
    "energy": lambda at, method: solve_assembly(at, method=method),
    "energy, loaded": lambda at, method: solve_assembly(at, LOAD, method=method),
    "energies": lambda at, method: solve_assembly([at], method=method),
    "energies, loaded": lambda at, method: solve_assembly([at], LOAD, method=method),
    "margin": lambda at, method: zone_margin(at, method=method),
    "margins": lambda at, method: zone_margin([at], method=method),
    **{f"pose error, {assumption}": lambda at, method, a=assumption: bound_pose_error(
        solve_assembly(at, method="reference"), a, method=method
    ) for assumption in ASSUMPTIONS},
    "pose errors": lambda at, method: bound_pose_error(
        solve_assembly([at], method="reference"), method=method
    ),
    "exact": lambda at, method: solve_exact(at, LOAD, method=method),
    "stiffnesses": lambda at, method: platform_stiffness([at], method=method),
    "stiffness, contact": lambda at, method: platform_stiffness(
        at, "contact", LOAD, method=method
    ),
    "stiffness, exact": lambda at, method: platform_stiffness(
        at, "exact", LOAD, method=method
    ),
    "deflection": lambda at, method: deflection_curve(at, 4, LOADS, method=method),
    "deflection, finite": lambda at, method: deflection_curve(
        at, 4, LOADS, state="exact", method=method
    ),
    "path": lambda at, method: follow_load(at, 4, 0.0, 60.0, count=4, method=method),
    "modes": lambda at, method: natural_modes(at, method=method),
    "modes, finite": lambda at, method: natural_modes(
        at, load=LOAD, state="exact", method=method
    ),
}  # fmt: skip


@pytest.fixture
def nothing_compiled(monkeypatch):
    """Return a function that makes all C++ functions raise an error."""

    class Refused:
        def __getattr__(self, name):
            raise AssertionError(f"a compiled function was called: {name}")

    def refuse():
        for module in (one_problem, lanes, continuation_side_by_side):
            monkeypatch.setattr(module, "kernels", Refused())

    return refuse


@pytest.mark.parametrize("question", QUESTIONS)
def test_reference_method_calls_no_compiled_function(question, nothing_compiled):
    ask, posture = QUESTIONS[question], beams()
    compiled = ask(posture, "compiled")
    nothing_compiled()
    assert np.all(compiled.method == "compiled")
    assert np.all(ask(posture, "reference").method == "reference")


@pytest.mark.parametrize("question", QUESTIONS)
def test_unknown_method_is_rejected(question):
    with pytest.raises(ValueError, match="is 'numpy', expected 'compiled' or 'ref"):
        QUESTIONS[question](beams(), "numpy")


@pytest.mark.parametrize("start", ["start", "near"])
def test_reference_method_rejects_compiled_start(start):
    posture = beams()
    solve = {"start": solve_assembly, "near": solve_exact}[start]
    compiled, reference = (solve(posture, LOAD, method=m) for m in METHODS)
    message = "start or near: found a solution of the compiled"
    with pytest.raises(ValueError, match=message):
        solve_exact(posture, LOAD, method="reference", **{start: compiled})
    found = solve_exact(posture, LOAD, method="reference", **{start: reference})
    assert found.method == "reference"


@pytest.mark.parametrize("name", sorted(BUILT_IN))
def test_both_methods_satisfy_equilibrium_conditions(name):
    """The energies of both solutions are equal."""
    posture = home_posture(BUILT_IN[name]())
    one, other = (solve_exact(posture, LOAD, method=method) for method in METHODS)
    for found in (one, other):
        assert found.closure_residual() < 1e-10
        assert found.stationarity < 1e-7
        assert found.clearance_excess() < 1e-9
    # the orthoglide has two minima with different contacts
    if name != "orthoglide":
        assert one.energy == pytest.approx(other.energy, rel=GAP)


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_both_methods_compute_same_deflection_curve(state):
    one, other = (
        deflection_curve(beams(), 4, LOADS, state=state, method=method)
        for method in METHODS
    )
    assert one.pressed == other.pressed
    np.testing.assert_allclose(one.energies, other.energies, rtol=GAP)
    np.testing.assert_allclose(one.stiffness, other.stiffness, rtol=1e-6)


def test_both_methods_compute_same_modes_and_stiffness():
    one, other = (
        natural_modes(beams(), load=LOAD, state="exact", method=method)
        for method in METHODS
    )
    np.testing.assert_allclose(one.frequencies, other.frequencies, rtol=1e-6)
    K, same = (
        platform_stiffness(beams(), "exact", LOAD, method=method).stiffness
        for method in METHODS
    )
    assert np.abs(scaled(K - same, K)).max() < 1e-6
