"""Zone margin (21), compared with closed forms and with the problem in cvxpy."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.reference.as_printed import margin_as_printed
from forcefit.assembly.linear.zone import Zone, zone_margin
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from forcefit.assembly.robots import BUILT_IN
from forcefit.assembly.solvers.method import METHODS
from tests.robots_for_tests import (
    NUMBERS,
    coaxial_beams,
    irsbot2_with,
    planar_four_bar,
    random_robot,
)

PLAY = Clearance(radial=2e-5, axial=1e-5, tilt=1e-3, spin=2e-3)


@pytest.mark.parametrize(
    ("gap", "margin"),
    [
        ([0, 0, 0, 3e-5, 4e-5, 0], 2.5),  # radial error 5e-5 m, clearance 2e-5 m
        ([0, 0, 0, 0, 0, -7e-6], 0.7),  # along
        ([6e-4, 8e-4, 0, 0, 0, 0], 1.0),  # tilt
        ([0, 0, -3e-3, 0, 0, 0], 1.5),  # spin error of a fixed joint with clearance
        ([0, 0, 0, 2e-5, 0, 2e-5], 2.0),  # the largest of two ratios
        ([0] * 6, 0.0),
    ],
)
def test_margin_of_one_joint_equals_gap_divided_by_clearance(gap, margin):
    robot = coaxial_beams(np.array(gap, dtype=float), clearance=PLAY)
    zone = zone_margin(home_posture(robot))
    assert zone.margin == pytest.approx(margin, rel=1e-9, abs=1e-12)
    assert zone.bound == pytest.approx(margin, rel=1e-9, abs=1e-12)
    assert zone.assemblable == (margin <= 1)


def test_margin_is_infinite_without_clearance_in_the_error_direction():
    robot = coaxial_beams(np.array([0, 0, 0, 0, 0, 1e-5]), clearance=Clearance(tilt=1))
    zone = zone_margin(home_posture(robot))
    assert (zone.margin, zone.bound, zone.assemblable) == (np.inf, np.inf, False)


def test_passive_joints_compensate_in_plane_errors_without_clearance():
    """The pins of a four-bar compensate in-plane errors but not out-of-plane errors."""
    errors = np.zeros((6, 6))
    errors[2] = [0, 0, 1e-3, 1e-4, 2e-4, 0]
    robot = planar_four_bar(errors=errors)
    assert zone_margin(home_posture(robot)).margin == 0.0
    errors[2, 5] = 1e-4
    assert zone_margin(home_posture(robot.with_errors(errors))).margin == np.inf


@pytest.mark.parametrize("method", METHODS)
def test_margin_does_not_scale_the_range_of_passive_joints(method):
    """The margin is (3e-4 - 1e-4) / 1e-5 for a slider range of 1e-4 m."""
    frames = (
        Frame("slide", joint="prismatic", clearance=Clearance(axial=1e-4)),
        Frame("joint", "slide", clearance=Clearance(axial=1e-5)),
        Frame("end", "joint"),
        Frame("wall", geometric_error=[0, 0, 0, 0, 0, 3e-4]),
    )
    wide = replace(frames[0], clearance=Clearance(axial=4e-4))
    tight = replace(frames[1], clearance=None)
    for slide, joint, margin in (
        (*frames[:2], 20.0), (wide, frames[1], 0.0), (frames[0], tight, np.inf)
    ):  # fmt: skip
        robot = Robot("slider", "end", (slide, joint, *frames[2:]), (("end", "wall"),))
        zone = zone_margin(home_posture(robot), method=method)
        assert zone.margin == pytest.approx(margin, rel=1e-9, abs=1e-12)
        assert zone.bound == pytest.approx(margin, rel=1e-6, abs=1e-12)


def test_clearances_multiplied_by_the_margin_allow_assembly():
    robot = irsbot2_with(NUMBERS["cases"][0])
    margin = zone_margin(home_posture(robot), "free").margin

    def scaled(frame, factor):
        if frame.clearance is None:
            return frame
        clearance = vars(frame.clearance)
        larger = {k: v * factor for k, v in clearance.items() if v and k != "spin"}
        return replace(frame, clearance=Clearance(**{**clearance, **larger}))

    for factor, inside in ((margin * 1.0001, True), (margin * 0.9999, False)):
        frames = tuple(scaled(f, factor) for f in robot.frames)
        zone = zone_margin(home_posture(replace(robot, frames=frames)), "free")
        assert zone.assemblable == inside


def test_unknown_compliant_option_is_rejected():
    at = home_posture(planar_four_bar())
    for posture in (at, [at]):
        with pytest.raises(ValueError, match="compliant is 'soft', expected 'rigid'"):
            zone_margin(posture, "soft")


@settings(deadline=None, max_examples=12)
@given(seed=st.integers(0, 2**32 - 1), legs=st.integers(2, 3))
def test_margin_of_random_robots_agrees_with_cvxpy(seed, legs):
    rng = np.random.default_rng(seed)
    posture = home_posture(random_robot(rng, legs, 3))
    for compliant in ("rigid", "free"):
        zone = zone_margin(posture, compliant)
        try:
            expected = margin_as_printed(posture, compliant == "free")
        except RuntimeError:  # cvxpy does not converge for some infeasible problems.
            assert zone.margin == np.inf
            continue
        if expected is None:
            assert zone.margin == np.inf
        else:
            assert zone.margin == pytest.approx(expected, rel=1e-6, abs=1e-7)
            assert zone.bound <= zone.margin * (1 + 1e-9) + 1e-12
            assert zone.bound == pytest.approx(zone.margin, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("compliant", ["rigid", "free"])
def test_margins_of_many_robots_equal_the_reference_method(compliant, rng):
    """The margins agree to 1e-8."""
    homes = [home_posture(make()) for make in BUILT_IN.values()]
    for seed in range(80):
        draw = np.random.default_rng(seed)
        homes.append(home_posture(random_robot(draw, 1 + seed % 3, 1 + seed // 3 % 3)))
    compiled = 0
    for home in homes:
        errors = 1e-4 * rng.normal(size=(len(home.robot.frames), 6))
        erring = replace(home, robot=home.robot.with_errors(errors))
        (zone,) = zone_margin([erring], compliant)
        compiled += zone.method == "compiled"
        one = zone_margin(erring, compliant, method="reference")
        assert zone.margin == pytest.approx(one.margin, rel=1e-7, abs=1e-10)
        assert zone.bound <= zone.margin * (1 + 1e-11) + 1e-15
        assert zone.bound <= one.margin * (1 + 1e-9) + 1e-10
    assert compiled


def test_margins_of_many_points_equal_gap_divided_by_clearance():
    gaps = np.array([1e-5, 4e-5, -3e-5])
    sets = np.zeros((3, 6, 6))
    sets[:, 2, 5] = gaps
    robot = coaxial_beams(np.zeros(6), clearance=PLAY)
    at = home_posture(robot)
    expected = np.abs(gaps) / PLAY.axial
    assert zone_margin(at, errors=sets).margin == pytest.approx(expected)
    assert zone_margin([at], errors=sets).margin == pytest.approx(expected)
    assert zone_margin([at] * 3, errors=sets).margin == pytest.approx(expected)
    assert zone_margin(at, errors=sets[1]).margin == pytest.approx(expected[1])
    assert zone_margin([at], errors=sets[1]).margin == pytest.approx(expected[[1]])
    erring = home_posture(robot.with_errors(sets[1]))
    assert zone_margin([erring]).margin == pytest.approx(expected[[1]])
    assert zone_margin([erring] * 2).margin == pytest.approx(expected[[1, 1]])


def test_margins_can_be_selected_by_index():
    """The norms of the forces on the cones add up to 1."""
    sets = np.zeros((3, 6, 6))
    sets[:, 2, 5] = [1e-5, 4e-5, -3e-5]
    at = home_posture(coaxial_beams(np.zeros(6), clearance=PLAY))
    zones = zone_margin(at, errors=sets)
    assert len(zones) == 3
    assert zones.assemblable.tolist() == [True, False, False]
    assert zones[1:].margin == pytest.approx([4.0, 3.0])
    assert zones[zones.assemblable].margin == pytest.approx([1.0])
    one = zones[-1]
    assert one.margin == pytest.approx(3.0)
    assert (one.method, one.unproved) == ("compiled", "")
    assert one.assemblable is False
    assert np.abs(one.forces).sum() == pytest.approx(1.0)
    with pytest.raises(IndexError):
        zones[3]
    with pytest.raises(TypeError, match="Zone of one point has no length"):
        len(one)


def test_infinite_margin_is_not_reported_as_unproved():
    margin, bound = np.array([[np.inf] * 2, [2.0] * 2, [2.0, 1.99], [2.0, np.nan]]).T
    none = np.full((4, 1), np.nan)
    zones = Zone(margin, bound, np.full(4, "reference"), none, np.full(4, ""))
    assert zones.assemblable.tolist() == [False] * 4
    assert [bool(text) for text in zones.unproved] == [False, False, True, True]
    assert [bool(zone.unproved) for zone in zones] == [False, False, True, True]
    assert zones[2].unproved == "the margin 2 is certified down to 1.99 only"
