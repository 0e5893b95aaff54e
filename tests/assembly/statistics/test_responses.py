"""Limited quantities and their derivatives with respect to errors."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.responses import respond
from tests.tolerances_for_tests import PLAY, arm, rigid_pair, without_clearances

QUANTITIES = ["energy", "force", "moment", "stress", "rotation", "translation"]


@pytest.fixture(scope="module")
def stiff():
    """Return IRSBot-2 without clearances and with errors of its links."""
    robot = without_clearances(load_robot("irsbot2"))
    sources = tolerance_sources(robot, [1e-3] * 3 + [1e-4] * 3)
    prepared = linear_response(place_robot(robot, {"tx": 0.1, "tz": -0.5}))
    return prepared, sources, sources.draw(0, 5, seed=3)


@pytest.mark.parametrize("key", QUANTITIES)
@pytest.mark.parametrize("play", ["least", "worst"])
def test_slopes_without_clearance_satisfy_eulers_theorem(stiff, key, play):
    """The energy is homogeneous of degree 2, all other quantities of degree 1."""
    prepared, sources, values = stiff
    size, slopes = respond(prepared, sources, values, key, play)
    assert (size > 0).all()
    degree = 2 if key == "energy" else 1
    np.testing.assert_allclose((values * slopes).sum(axis=1), degree * size, rtol=1e-5)
    twice, same = respond(prepared, sources, -2 * values, key, play)
    np.testing.assert_allclose(twice, 2**degree * size, rtol=1e-6)
    scale = np.abs(slopes).max()
    np.testing.assert_allclose(same, -degree * slopes, atol=1e-5 * scale)


def tip():
    """Return an arm with a pin clearance and errors of its tip."""
    robot = arm(radial=PLAY)
    sources = tolerance_sources(robot, [1e-3] * 3 + [3e-4] * 3, ("tip",))
    return home_posture(robot), sources


def test_slopes_of_the_largest_pose_error_equal_closed_form():
    """The largest error is R = hypot(e_xy + p, e_z), so dR/dx = (e_xy + p) x / (e_xy R)
    and dR/dz = z / R.
    """
    posture, sources = tip()
    values = sources.draw(0, 20, seed=1)
    prepared = linear_response(posture)
    size, slopes = respond(prepared, sources, values, "translation", "worst")
    x, y, z = values[:, 3:].T
    across = np.hypot(x, y)
    R = np.hypot(across + PLAY, z)
    np.testing.assert_allclose(size, R, atol=2e-9)
    expected = [(across + PLAY) * x / across, (across + PLAY) * y / across, z] / R
    # The error of 1e-9 m in a displacement of 1e-4 m allows an error of 5e-3 rad in its
    # direction.
    np.testing.assert_allclose(slopes[:, 3:], expected.T, atol=1.5e-2)
    np.testing.assert_allclose(slopes[:, :3], 0.0, atol=1e-9)
    turn = values[:, :3]
    size, slopes = respond(prepared, sources, values, "rotation", "worst")
    angle = np.linalg.norm(turn, axis=1)
    np.testing.assert_allclose(size, angle, rtol=1e-9)
    np.testing.assert_allclose(slopes[:, :3], turn / angle[:, None], atol=1e-9)
    np.testing.assert_allclose(slopes[:, 3:], 0.0, atol=1e-9)


@pytest.mark.parametrize("play", ["least", "contact", "uniform"])
@pytest.mark.parametrize("key", ["rotation", "translation"])
def test_response_has_the_random_clearances_of_the_experiment(play, key):
    """The derivatives are the direction of the platform error."""
    posture, sources = tip()
    values = sources.draw(0, 12, seed=1)
    rows = Experiment(posture, sources, seed=1, clearance=play, margins=False).evaluate(
        values, range(12)
    )
    size, slopes = respond(linear_response(posture), sources, values, key, play)
    np.testing.assert_allclose(size, rows[key], rtol=1e-9)
    expected = rows["platform_screw"] / size[:, None]
    kept = slice(0, 3) if key == "rotation" else slice(3, 6)
    np.testing.assert_allclose(slopes[:, kept], expected[:, kept], atol=1e-9)
    assert not np.delete(slopes, np.r_[kept], axis=1).any()


@pytest.mark.parametrize("component", [3, 4])
def test_pin_clearance_compensates_errors_of_the_body_below(component):
    robot = rigid_pair(radial=PLAY)
    sources = tolerance_sources(robot, np.eye(6)[component] * PLAY, ("one", "two"))
    values = np.array([[0.3, 0.6], [-0.2, -0.5]]) * PLAY
    prepared = linear_response(home_posture(robot))
    size, slopes = respond(prepared, sources, values, "translation", "least")
    np.testing.assert_allclose(size, np.abs(values[:, 1]), rtol=1e-6)
    np.testing.assert_allclose(slopes, [[0, 1], [0, -1]], atol=1e-6)
