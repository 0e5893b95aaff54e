"""Tests of load-deflection curves against closed-form solutions."""

import numpy as np
import pytest

from forcefit import deflection_curve, load_robot, platform_stiffness
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.platform_stiffness.arc_length import follow_load
from tests.assembly.exact.test_exact import only

FY, FZ = 4, 5


def bush(clearance=1e-4, stiffness=1e5):
    """Return a spring in series with an axial clearance along z."""
    link = MatrixLink(np.diag([1e3, 1e3, 1e3, 1e5, 1e5, stiffness]))
    spring = Frame("spring", link=link, clearance=Clearance(axial=clearance))
    return home_posture(Robot("bush", "tip", (spring, Frame("tip", "spring"))))


def cantilever(link):
    tip = Frame("tip", translation=[1.0, 0, 0], link=link)
    return home_posture(Robot("cantilever", "tip", (tip,)))


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_rigid_direction_has_infinite_stiffness(state):
    """The axis of the slide is z after a rotation by pi / 2, which has round-off."""
    slide = Frame("slide", rotation=[0, np.pi / 2, 0], joint="prismatic",
                  joint_stiffness=only(5, 1e5))  # fmt: skip
    tip = Frame("tip", "slide", rotation=[0, -np.pi / 2, 0])
    posture = home_posture(Robot("slide", "tip", (slide, tip)))
    curve = deflection_curve(posture, FZ, np.arange(0.0, -101.0, -25.0), state=state)
    assert np.isinf(curve.stiffness).all()
    assert curve.events == ()
    along = deflection_curve(posture, FZ - 2, np.arange(0.0, 101.0, 50.0), state=state)
    np.testing.assert_allclose(along.stiffness, 1e5, rtol=1e-9)


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_deflection_equals_clearance_plus_spring_deflection(state):
    """The deflection is sign(F) c + F / k.  Without load, it is undetermined."""
    c, k = 1e-4, 1e5
    curve = deflection_curve(bush(c, k), FZ, np.arange(-30.0, 31.0, 10.0), state=state)
    loaded = curve.loads != 0.0
    expected = np.sign(curve.loads) * c + curve.loads / k
    found = curve.deflection[loaded]
    np.testing.assert_allclose(found, expected[loaded], rtol=1e-5, atol=1e-9)
    np.testing.assert_array_equal(curve.open_, ~loaded)
    np.testing.assert_allclose(curve.stiffness, np.where(loaded, k, 0.0), rtol=1e-6)
    release, contact = curve.events
    assert (release.kind, release.what) == ("release", "spring axial")
    assert (contact.kind, contact.what) == ("contact", "spring axial")
    assert max(abs(release.load), abs(contact.load)) < 0.01


def test_preloaded_contact_opens_at_its_preload():
    """An error e that exceeds the clearance c preloads the contact.

    Two springs k act on the tip.  The contact opens at the load k (e - c), which the
    second spring then carries alone.
    """
    c, e, k = 1e-4, 3e-4, 1e5
    K = np.diag([1e3, 1e3, 1e3, 1e5, 1e5, k])
    frames = (
        Frame("one", link=MatrixLink(K), clearance=Clearance(axial=c)),
        Frame("tip", "one", geometric_error=[0, 0, 0, 0, 0, e]),
        Frame("two", link=MatrixLink(K)),
        Frame("other", "two"),
    )
    posture = home_posture(Robot("pair", "tip", frames, (("tip", "other"),)))
    curve = deflection_curve(posture, FZ, np.arange(0.0, 60.0, 7.0))
    assert curve.deflection[0] == pytest.approx((e - c) / 2, rel=1e-5)
    assert curve.stiffness[0] == pytest.approx(2 * k, rel=1e-6)
    first, second, *_ = curve.events
    assert (first.kind, first.what) == ("release", "one axial")
    assert first.load == pytest.approx(k * (e - c), abs=0.01)
    # the joint moves through the clearance of width 2 c against the second spring
    assert (second.kind, second.what) == ("contact", "one axial")
    assert second.load == pytest.approx(k * (e + c), abs=0.01)
    between = (curve.loads > k * (e - c)) & (curve.loads < k * (e + c))
    np.testing.assert_allclose(curve.stiffness[between], k, rtol=1e-6)


def test_tangent_stiffness_equals_slope_of_deflection_curve():
    """The slope of the curve is computed by central differences."""
    posture = home_posture(load_robot("four_bar"))
    loads = 100.0 + np.array([-0.5, 0.0, 0.5])
    curve = deflection_curve(posture, FY, loads, state="exact")
    slope = (curve.deflection[2] - curve.deflection[0]) / (loads[2] - loads[0])
    assert 1 / slope == pytest.approx(curve.stiffness[1], rel=1e-6)


@pytest.mark.slow
def test_clamped_column_buckles_at_euler_load():
    width, E = 0.02, 70e9
    link = BeamLink({"width": width, "height": width}, E, 0.3, pieces=16,
                    theory="euler")  # fmt: skip
    euler = np.pi**2 * E * width**4 / 12 / 4
    loads = -euler * np.array([0.0, 0.5, 0.9, 1.1])
    (event,) = deflection_curve(cantilever(link), 3, loads, state="exact").events
    assert event.kind == "critical"
    assert -event.load == pytest.approx(euler, rel=2e-3)
    assert "tip link" in event.what


def test_thin_cantilever_buckles_at_lateral_buckling_load():
    """The buckling load is 4.013 sqrt(EI GJ) / L^2 (Michell, Prandtl 1899).

    With the deflection before buckling, it is divided by
    sqrt((1 - I_y/I_z) (1 - GJ/EI_z)).
    """
    E, nu = 70e9, 0.3
    G = E / (2 * (1 + nu))
    section = {"area": 2e-4, "I_y": 2e-10, "I_z": 2e-8, "J": 1e-9,
               "shear_y": 1.0, "shear_z": 1.0}  # fmt: skip
    link = BeamLink(section, E, nu, up=(0, 0, 1), pieces=16, theory="euler")
    plain = 4.0126 * np.sqrt(E * 2e-10 * G * 1e-9)
    bent = plain / np.sqrt((1 - 0.01) * (1 - G * 1e-9 / (E * 2e-8)))
    loads = plain * np.array([0.0, 0.5, 0.9, 1.2])
    (event,) = deflection_curve(cantilever(link), FY, loads, state="exact").events
    assert event.kind == "critical"
    assert event.load == pytest.approx(bent, rel=5e-3)


def shallow_arch():
    """Return a von Mises truss, two inclined springs k with a common end."""
    half, rise, K = 1.0, 0.1, only(3, 1e5)
    length, angle = np.hypot(half, rise), np.arctan2(rise, half)
    frames = (
        Frame("left", rotation=[0, 0, angle], joint="revolute"),
        Frame("left_end", "left", [length, 0, 0], joint_stiffness=K),
        Frame("pin", "left_end", rotation=[0, 0, -2 * angle], joint="revolute"),
        Frame("right_start", "pin", [length, 0, 0], joint_stiffness=K),
        Frame("foot", "right_start", joint="revolute"),
        Frame("end", "foot", rotation=[0, 0, angle]),
        Frame("ground", translation=[2 * half, 0, 0]),
        Frame("apex", "left_end", rotation=[0, 0, -angle]),
    )
    return home_posture(Robot("arch", "apex", frames, (("end", "ground"),)))


@pytest.mark.slow
def test_shallow_arch_jumps_at_limit_load():
    """The limit load is the maximum of F(w) = 2 k (L / l - 1) (h - w).

    Here l^2 = a^2 + (h - w)^2.
    """
    rise = 0.1
    limit = arch_force(np.linspace(0.0, rise, 100_001)).max()
    loads = -np.array([0.0, 0.5, 0.9, 0.99, 1.05, 1.2]) * limit
    loads = [*loads, *reversed(loads[:-1])]
    curve = deflection_curve(shallow_arch(), FY, loads, state="exact")
    jump = next(event for event in curve.events if event.kind == "jump")
    assert -jump.load == pytest.approx(limit, rel=1e-3)
    assert curve.deflection[3] > -rise
    assert curve.deflection[4] < -2 * rise
    # the arch remains inverted during unloading
    assert curve.deflection[-2] == pytest.approx(curve.deflection[5], rel=0.2)
    assert curve.deflection[-2] < -2 * rise < curve.deflection[1]


def test_pinned_column_buckles_at_euler_load():
    """The Euler load of a column with two pinned ends is pi^2 E I / L^2.

    With n beam elements, the relative error is proportional to 1 / n^2.
    """
    E, width, height = 7e10, 0.01, 0.02
    beam = BeamLink({"width": width, "height": height}, E, 0.3, up=(0, 0, 1), pieces=16)
    turn = [0, np.pi / 2, 0]
    frames = (
        Frame("foot", joint="revolute"),
        Frame("top", "foot", [1.0, 0, 0], joint="revolute", link=beam),
        Frame("tip", "top"),
        Frame("slide", translation=[1.0, 0, 0], rotation=turn, joint="prismatic"),
        Frame("end", "slide", rotation=[0, -np.pi / 2, 0]),
    )
    robot = Robot("column", "tip", frames, (("tip", "end"),))
    euler = np.pi**2 * E * height * width**3 / 12
    loads = [0.0, -0.9 * euler, -1.2 * euler]
    curve = deflection_curve(home_posture(robot), 3, loads, state="exact")
    (event,) = (e for e in curve.events if e.kind == "critical")
    assert event.load == pytest.approx(-euler, rel=0.01)
    deformed = "largest deformation in top link"
    assert event.what == f"buckles: no motion of the platform, {deformed}"


def arch_force(height, half=1.0, rise=0.1, k=1e5):
    """Return the downward load on a von Mises truss at a given height of its apex."""
    length = np.hypot(half, rise)
    return 2 * k * (length / np.hypot(half, height) - 1) * height


def test_arc_length_path_of_shallow_arch_equals_closed_form():
    """The path includes both limit points and the unstable part between them."""
    limit = arch_force(np.linspace(0, 0.1, 100_001)).max()
    curve = follow_load(shallow_arch(), FY, 0.0, -1.5 * limit)
    heights = 0.1 + curve.deflection
    np.testing.assert_allclose(-curve.loads, arch_force(heights), atol=1e-6 * limit)
    assert heights.min() < -0.1  # beyond both limit points
    assert (np.diff(heights) < 0).all()
    first, second = curve.events
    assert -first.load == pytest.approx(limit, rel=1e-9)
    assert -second.load == pytest.approx(-limit, rel=1e-9)
    assert {event.kind for event in curve.events} == {"critical"}
    assert all(event.what.startswith("limit point") for event in curve.events)
    assert (curve.stiffness[np.abs(heights) < 0.03] < 0).all()


def test_bar_on_torsion_spring_buckles_at_k_over_l():
    """The straight bar is in equilibrium under any load, but unstable above k / L."""
    hinge = Frame("hinge", joint="revolute", joint_stiffness=only(2, 50.0))
    bar = Frame("bar", "hinge", [0.4, 0, 0])
    curve = follow_load(home_posture(Robot("bar", "bar", (hinge, bar))), 3, 0.0, -200.0)
    (event,) = curve.events
    assert -event.load == pytest.approx(50.0 / 0.4, rel=1e-5)
    assert event.what.startswith("branch point, buckles: platform motion [0 0 1.768 0 ")
    assert event.what.endswith("largest deformation in hinge joint")
    assert np.abs(curve.screws).max() < 1e-12


def test_two_bars_on_torsion_springs_have_two_buckling_loads():
    """The buckling loads are (3 - sqrt 5) k / 2L and (3 + sqrt 5) k / 2L."""
    foot = Frame("foot", joint_stiffness=only(2, 50.0))
    knee = Frame("knee", "foot", [0.4, 0, 0], joint_stiffness=only(2, 50.0))
    tip = Frame("tip", "knee", [0.4, 0, 0])
    posture = home_posture(Robot("bars", "tip", (foot, knee, tip), ()))
    curve = follow_load(posture, 3, 0.0, -400.0)
    loads = 50.0 / 0.4 * (3 + np.array([-1, 1]) * np.sqrt(5)) / 2
    np.testing.assert_allclose([-e.load for e in curve.events], loads, rtol=1e-5)
    for event in curve.events:
        assert event.what.startswith("branch point, buckles")


def test_spinning_rods_cause_no_critical_loads():
    """The six rods of the Delta robot can spin about their axes."""
    posture = home_posture(load_robot("delta"))
    curve = follow_load(posture, 5, 0.0, -500.0, count=4)
    classical = platform_stiffness(posture).along(np.eye(6)[5])[0]
    assert curve.stiffness[0] == pytest.approx(classical, rel=1e-8)
    assert not curve.events
    assert abs(curve.loads[-1]) >= 500.0
