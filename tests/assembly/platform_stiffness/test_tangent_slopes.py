"""Tests of compliance derivatives against closed forms and finite differences."""

import numpy as np
import pytest

from forcefit import Clearance, Frame, Robot, platform_stiffness, solve_assembly
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.platform_stiffness.active_set import contacts
from forcefit.assembly.platform_stiffness.tangent_slopes import TangentState
from forcefit.assembly.sweeps.parameters import design_of
from forcefit.assembly.sweeps.stiffness_slopes import stiffness_slopes
from tests.assembly.exact.test_exact import only
from tests.robots_for_tests import NUMBERS, coaxial_beams, irsbot2_with

PAPER = irsbot2_with({case["name"]: case for case in NUMBERS["cases"]}["literal"])
POSE, LOAD = {"tx": 0.1, "tz": -0.45}, [0, 0, 0, 50.0, 0, -320.0]


def torsion_bar(k, L):
    """Return a rigid bar of length L on a torsion spring k."""
    hinge = Frame("hinge", joint="revolute", joint_stiffness=only(2, k))
    return Robot("bar", "bar", (hinge, Frame("bar", "hinge", [L, 0, 0])))


@pytest.mark.parametrize("share", [0.0, 0.5, -1.0, 1.5])
def test_compliance_derivatives_of_loaded_bar_equal_closed_form(share):
    """C = 1 / (k/L^2 - F/L) is differentiated by k and L."""
    k, L = 50.0, 0.4
    F = share * k / L
    paths = ["hinge.joint_stiffness.rz", "bar.translation.x"]
    asked = TangentState("exact", [0, 0, 0, -F, 0, 0])
    slopes = stiffness_slopes(design_of(torsion_bar(k, L)), paths, asked=asked)
    by_k, by_L = slopes.values()
    C = 1.0 / (k / L**2 - F / L)
    assert by_k[4, 4] == pytest.approx(-(C**2) / L**2, rel=1e-6)
    assert by_L[4, 4] == pytest.approx(C**2 * (2 * k / L**3 - F / L**2), rel=1e-6)


def test_compliance_derivative_by_pin_clearance_is_inverse_of_load():
    """The compliance along the rim is C = c / F under the load F."""
    c, F = 1e-4, 200.0
    pin = Frame("pin", clearance=Clearance(radial=c, axial=0.0, tilt=0.0, spin=0.0))
    robot = Robot("pin", "tip", (pin, Frame("tip", "pin")))
    asked = TangentState("contact", [0, 0, 0, F, 0, 0])
    path = "pin.clearance.radial"
    slope = stiffness_slopes(design_of(robot), [path], asked=asked)[path]
    assert slope[4, 4] == pytest.approx(1 / F, rel=1e-6)


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_compliance_derivative_by_ball_clearance_is_inverse_of_load(state):
    """The derivative is zero along the load, and 1 / F in both other directions."""
    ball = Frame("ball", clearance=Clearance(ball=1e-4))
    robot = Robot("ball", "tip", (ball, Frame("tip", "ball")))
    asked = TangentState(state, [0, 0, 0, 0, 0, 200.0])
    path = "ball.clearance.ball"
    slope = stiffness_slopes(design_of(robot), [path], asked=asked)[path]
    expected = np.diag([1 / 200.0, 1 / 200.0, 0.0])
    np.testing.assert_allclose(slope[3:, 3:], expected, atol=1e-8)


@pytest.mark.parametrize("state", ["contact", "exact"])
@pytest.mark.parametrize(
    ("path", "step"),
    [
        ("leg1.link_a.link.beam.radius", 4e-5),
        ("leg1.elbow_a_second.clearance.radial", 2e-8),
        ("leg1.link_a.geometric_error.tx", 1e-7),
    ],
)
def test_compliance_derivatives_of_irsbot2_equal_finite_differences(state, path, step):
    """The robot has the errors of the paper, a load, and contacts in clearances."""
    design, asked = design_of(PAPER), TangentState(state, LOAD, at=(0, 0, 0.05))
    slope = stiffness_slopes(design, [path], POSE, asked=asked)[path]

    def compliance(value):
        posture = place_robot(design.robot({path: value}), POSE)
        return platform_stiffness(posture, state, LOAD, at=asked.at).compliance

    value = design.values[path]
    wide, narrow = ((compliance(value + h) - compliance(value - h)) / (2 * h)
                    for h in (step, step / 2))  # fmt: skip
    size = np.sqrt(np.outer(*[np.diag(compliance(value))] * 2))
    expected = (4 * narrow - wide) / 3 / size
    largest = np.abs(expected).max()
    assert largest * abs(value) > 1e-4
    np.testing.assert_allclose(slope / size, expected, atol=2e-5 * largest)


def test_compliance_derivative_at_change_of_contact_is_nan():
    """The error equals the clearance, so there is contact without a force."""
    touching = coaxial_beams(
        [0, 0, 0, 0, 1e-4, 0], clearance=Clearance(radial=1e-4, axial=0, tilt=0, spin=0)
    )
    _, touches = contacts(solve_assembly(home_posture(touching)))
    assert touches.any()
    path = "two.geometric_error.ty"
    asked = TangentState("contact")
    slope = stiffness_slopes(design_of(touching), [path], asked=asked)[path]
    assert np.isnan(slope).all()
