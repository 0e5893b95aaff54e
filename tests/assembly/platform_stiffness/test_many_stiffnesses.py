"""Tests of the platform stiffness at many postures, and of invalid input."""

import numpy as np
import pytest

from forcefit import BadInput, Clearance, Frame, MatrixLink, Robot, solve_assembly
from forcefit.assembly.kinematics.posture import home_posture, place_many, together
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.platform_stiffness.linear_tangent import without_clearance
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import load_robot
from forcefit.assembly.solvers.method import METHODS
from tests.robots_for_tests import coaxial_beams, random_robot

UNIT = np.eye(6)
LOAD = [0.0, 0, 0, 10, 0, -50]


def assert_same(many, row, one):
    """Assert that posture ``row`` of ``many`` has the stiffness ``one``.

    The entries C_ij are compared relative to sqrt(C_ii C_jj).
    """
    C = one.compliance
    if one.free.size:
        np.testing.assert_array_equal(many.compliance[row], C)
        assert many.apart[row].free_text == one.free_text
        return
    size = np.sqrt(np.diag(C)) + 1e-300
    scale = np.outer(size, size)
    np.testing.assert_allclose(many.compliance[row] / scale, C / scale, atol=1e-9)
    found = many.eigen_stiffnesses[row]
    np.testing.assert_allclose(found, one.eigen.values, rtol=1e-6)
    for axis in UNIT[size > 1e-300]:
        shares = many.shares(axis)
        for part, share in one.shares(axis).items():
            assert shares[part][row] == pytest.approx(share, abs=1e-9)


def test_stiffness_does_not_depend_on_other_postures(rng):
    """The results are bit-identical for one posture and for another order."""
    robot = load_robot("irsbot2")
    poses = np.full((19, 6), np.nan)
    poses[:, 0], poses[:, 2] = np.linspace(-0.3, 0.3, 19), -0.45
    at = together(place_many(robot, poses)[0])
    whole = platform_stiffness(at).compliance
    order = rng.permutation(19)
    assert np.array_equal(platform_stiffness(at[order]).compliance, whole[order])
    for i in (0, 7, 18):
        assert np.array_equal(platform_stiffness([at[i]]).compliance[0], whole[i])


@pytest.mark.parametrize("seed", range(30))
def test_stiffnesses_of_random_robots_agree_with_reference_method(seed):
    """Some of the robots have free motions or rigid directions."""
    rng = np.random.default_rng(seed)
    posture = home_posture(random_robot(rng, legs=int(rng.integers(1, 4))))
    many = platform_stiffness([posture])
    assert_same(many, 0, without_clearance(posture))


@pytest.mark.parametrize("method", METHODS)
def test_stiffnesses_at_many_postures_equal_stiffness_at_each(method):
    """Compliance, stiffness and compliance shares are compared."""
    robot = load_robot("irsbot2")
    poses = np.full((3, 6), np.nan)
    poses[:, 0], poses[:, 2] = [-0.2, 0.0, 0.25], -0.45
    postures, _ = place_many(robot, poses)
    tip = [0.1, -0.05, 0.2]
    many = platform_stiffness(postures, at=tip, method=method)
    assert many.method.tolist() == [method] * len(many) == [method] * 3
    for one, posture in zip(many, postures, strict=False):
        expected = platform_stiffness(posture, at=tip)
        np.testing.assert_allclose(one.point, expected.point, rtol=1e-14)
        for name in ("compliance", "stiffness"):
            other = getattr(expected, name)
            size = np.sqrt(np.diag(other))
            off = (getattr(one, name) - other) / np.outer(size, size)
            assert np.abs(off).max() < 1e-8, name
        for axis in UNIT:
            assert one.along(axis) == pytest.approx(expected.along(axis), rel=1e-6)
            shares = expected.shares(axis)
            assert one.shares(axis) == pytest.approx(shares, abs=1e-8)


@pytest.mark.parametrize("state", ["contact", "exact"])
def test_contact_and_exact_stiffnesses_equal_stiffness_at_each_posture(state):
    """The results are bit-identical."""
    clearance = Clearance(radial=2e-5, axial=1e-5, tilt=1e-3)
    gap = np.array([0, 0, 0, 1e-4, 0, 0])
    posture = home_posture(coaxial_beams(gap, clearance=clearance))
    many = platform_stiffness([posture] * 2, state, LOAD, at=[0, 0.1, 0])
    one = platform_stiffness(posture, state, LOAD, at=[0, 0.1, 0])
    for own in many:
        assert (own.state, own.method) == (state, one.method)
        np.testing.assert_array_equal(own.compliance, one.compliance)
    np.testing.assert_array_equal(many.compliance, [one.compliance] * 2)
    np.testing.assert_array_equal(many.eigen_stiffnesses, [one.eigen.values] * 2)
    np.testing.assert_array_equal(many.along(UNIT[3]), [one.along(UNIT[3])[0]] * 2)
    shares = {part: share.tolist() for part, share in many.shares(UNIT[3]).items()}
    assert shares == {part: [s] * 2 for part, s in one.shares(UNIT[3]).items()}


def test_load_on_free_motion_raises_free_motion():
    """A couple acts on a wheel that can rotate freely."""
    frames = (
        Frame("wheel", joint="revolute"),
        Frame("rim", "wheel", [0.1, 0, 0]),
        Frame("tip", translation=[0, 0, 0.3], link=MatrixLink(np.eye(6))),
    )
    couple = np.zeros((3, 6))
    couple[1, 2] = 2.0
    with pytest.raises(
        FreeMotion, match="it moves wheel rz; the platform does not move"
    ):
        solve_assembly(home_posture(Robot("beside", "tip", frames)), bodies=couple)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"at": [0, np.nan, 0]}, "at: found nan as number 2, expected 3 numbers"),
        ({"at": [0, 1]}, "at: found .* of length 2, expected 3 numbers"),
        ({"load": [1.0]}, "load: found .* of length 1, expected 6 numbers"),
        ({"load": [np.inf] * 6}, "load: found inf as number 1"),
        ({"state": "loaded"}, "found state 'loaded'"),
        ({"side": "left"}, "found side 'left'"),
    ],
)
def test_platform_stiffness_rejects_invalid_arguments(words, message):
    with pytest.raises(ValueError, match=message):
        platform_stiffness(home_posture(load_robot("orthoglide")), **words)


@pytest.mark.parametrize("direction", [[0] * 6, [1, 0, 0], [np.nan] * 6, "tx"])
def test_stiffness_along_invalid_direction_is_rejected(direction):
    stiffness = platform_stiffness(home_posture(load_robot("orthoglide")))
    for asked in (stiffness.along, stiffness.shares):
        with pytest.raises(BadInput, match="direction: found"):
            asked(direction)
