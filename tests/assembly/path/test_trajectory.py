"""Tests of motion profiles, splines and path files."""

import numpy as np
import pytest

from forcefit.assembly.path.path_file import PathTable, check_path, read_path
from forcefit.assembly.path.profiles import PROFILES
from forcefit.assembly.path.trajectory import profiled, timed
from forcefit.assembly.robots import load_robot

PEAKS = {
    "quintic": (15 / 8, 10 / np.sqrt(3)),
    "seventh": (35 / 16, 84 * np.sqrt(5) / 25),
    "trapezoid": (1.5, 4.5),
}


def line(*values, times=None):
    return PathTable(("tx",), np.array(values, dtype=float)[:, None], times)


@pytest.mark.parametrize("profile", PEAKS)
def test_profile_peaks_equal_closed_form(profile):
    """The peaks are in units of D / T and D / T^2 for a distance D and a duration T."""
    t = np.linspace(0, 1, 30_001)
    s, speed, acceleration = PROFILES[profile](t)
    peak_speed, peak_acceleration = PEAKS[profile]
    assert speed.max() == pytest.approx(peak_speed, rel=1e-7)
    assert np.abs(acceleration).max() == pytest.approx(peak_acceleration, rel=1e-7)
    assert (s[0], s[-1]) == pytest.approx((0, 1))
    assert (speed[0], speed[-1]) == pytest.approx((0, 0))
    # the trapezoidal rule has an error at each of two jumps of the acceleration
    step = 9.1 * t[1] if profile == "trapezoid" else 1e-8
    np.testing.assert_allclose(integral(speed, t), s, atol=1e-8)
    np.testing.assert_allclose(integral(acceleration, t), speed, atol=step)


def integral(values, t):
    """Return the integral up to each instant by the trapezoidal rule."""
    steps = (values[1:] + values[:-1]) / 2 * np.diff(t)
    return np.concatenate([[0.0], np.cumsum(steps)])


def test_polynomial_profiles_have_zero_acceleration_at_ends():
    """The jerk is also zero at the ends of the profile of degree seven."""
    h = 1e-5
    for profile, order in (("quintic", 1), ("seventh", 2)):
        acceleration = PROFILES[profile](np.array([0.0, h, 2 * h]))[2]
        assert acceleration[0] == 0.0
        growth = np.log2(acceleration[2] / acceleration[1])
        assert growth == pytest.approx(order, abs=1e-3)


@pytest.mark.parametrize("profile", PEAKS)
def test_duration_is_shortest_within_speed_and_acceleration_limits(profile):
    speed, acceleration = PEAKS[profile]
    path, D = line(0.1, 0.3), 0.2
    by_speed = profiled(path, 11, profile, 1.0, speed=0.5)
    by_both = profiled(path, 11, profile, 1.0, speed=0.5, acceleration=1.0)
    assert by_speed.duration == pytest.approx(speed * D / 0.5, rel=1e-6)
    assert by_both.duration == pytest.approx(np.sqrt(acceleration * D), rel=1e-5)


def test_spline_through_two_poses_equals_quintic_profile():
    """Speed and acceleration are zero at both ends."""
    by_time = timed(line(0.0, 0.4, times=np.array([1.0, 3.0])), 9)
    by_profile = profiled(line(0.0, 0.4), 9, "quintic", 1.0, duration=2.0)
    for name in ("values", "first", "second"):
        found, expected = getattr(by_time, name), getattr(by_profile, name)
        np.testing.assert_allclose(found, expected, atol=1e-14)


def test_spline_with_moving_ends_reproduces_quintic_motion():
    """A quintic spline through samples of t^5 is equal to t^5."""
    times = np.array([0.0, 0.3, 0.5, 0.9, 1.4, 1.7, 2.0])
    path = timed(line(*times**5, times=times), 41, ends="moving")
    np.testing.assert_allclose(path.values[:, 0], path.times**5, atol=1e-12)
    np.testing.assert_allclose(path.second[:, 0], 20 * path.times**3, atol=1e-9)


def test_spline_acceleration_converges_with_fourth_order():
    """Far from its ends, the second derivative has an error proportional to h^4."""
    errors = []
    for count in (11, 21, 41):
        times = np.linspace(0, 2 * np.pi, count)
        path = timed(line(*np.sin(times), times=times), 401, ends="moving")
        middle = slice(150, 251)
        errors.append(np.abs(path.second[:, 0] + np.sin(path.times))[middle].max())
    assert (np.log2(np.array(errors[:-1]) / errors[1:]) > 3.5).all()


def test_profile_along_several_poses_has_continuous_acceleration():
    """The path consists of three collinear positions, or of three corners."""
    path = profiled(line(0.0, 0.1, 0.4), 101, "quintic", 1.0, duration=1.0)
    straight = profiled(line(0.0, 0.4), 101, "quintic", 1.0, duration=1.0)
    np.testing.assert_allclose(path.values, straight.values, atol=1e-14)
    bend = PathTable(("tx", "ty"), np.array([[0, 0], [0.1, 0], [0.1, 0.1]], float))
    turned = profiled(bend, 2001, "quintic", 1.0, duration=1.0)
    for part, rate in (("values", "first"), ("first", "second")):
        slope = np.gradient(getattr(turned, part), turned.times, axis=0)[1:-1]
        size = np.abs(slope).max()
        np.testing.assert_allclose(slope, getattr(turned, rate)[1:-1], atol=2e-3 * size)
    steps = np.abs(np.diff(turned.second, axis=0)).max()
    assert steps < 0.02 * np.abs(turned.second).max()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda p: profiled(p, 11, "cubic", 1.0, duration=1.0), '"cubic"'),
        (lambda p: profiled(p, 11, "quintic", 1.0), "expected --duration"),
        (lambda p: profiled(p, 11, "quintic", 1.0, duration=1.0, speed=1.0), "--speed"),
        (lambda p: profiled(p, 1, "quintic", 1.0, duration=1.0), "--points: found 1"),
        (lambda p: profiled(line(0, 0.1, 0.1), 9, "quintic", 1.0, duration=1), "row 3"),
        (lambda p: profiled(PathTable(("rz",), np.array([[0.0], [1.0]])), 9, "quintic",
                            1.0, speed=1), "does not move"),
        (lambda p: timed(line(0, 1, times=np.array([0.0, 1.0])), 9, "moving"),
         "found 2 rows, expected at least 6"),
        (lambda p: check_path(line(0, 1, times=np.array([0.0, -1.0]))),
         "path: row 2, time: found -1 s after 0 s"),
    ],
)  # fmt: skip
def test_invalid_trajectory_options_are_rejected(call, message):
    with pytest.raises(ValueError, match=message):
        call(line(0.0, 0.1))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("time,pose.tx\n0,0\n1,0.1\n1,0.2\n", r'row "3", time: found 1 s after 1 s'),
        ("time,pose.tx\n0,0\n1e-300,0.1\n", "expected steps of at least 1e-15 s"),
        ("time,pose.tx\n0,0\n1,0\n1e30,0.1\n", r'row "3", time: found 1e\+30 s after'),
        ("time,pose.tx\n0,0\n", "found one row, expected at least two poses"),
        ("time,pose.tx\n", "found only a header"),
        ("", "found nothing"),
        ("time,pose.tx\n0,0\n1,nan\n", 'line 3, pose.tx: found "nan"'),
        ("time,pose.tx\n0,0\ninf,1\n", 'line 3, time: found "inf"'),
        ("time\n0\n1\n", "line 1: found no posture"),
        ("time,pose.tw\n0,0\n1,1\n", 'line 1: unknown column "pose.tw"'),
        ("time,pose.tx\n0,0\n1\n", "line 3: found 1 cells, expected 2"),
    ],
)
def test_invalid_path_file_is_rejected(tmp_path, content, message):
    file = tmp_path / "path.csv"
    file.write_text(content)
    with pytest.raises(ValueError, match=message) as raised:
        read_path(file, load_robot("five_bar"))
    assert str(file) in str(raised.value)


def test_path_file_preserves_times_names_and_ids(tmp_path):
    file = tmp_path / "path.csv"
    file.write_text("id,pose.tx,time,pose.ty\na,0,0.5,0.14\nb,0.01,1.5,0.15\n")
    path = read_path(file, load_robot("five_bar"))
    assert path.names == ("tx", "ty")
    assert path.labels == ("a", "b")
    np.testing.assert_array_equal(path.times, [0.5, 1.5])
    np.testing.assert_array_equal(path.values, [[0, 0.14], [0.01, 0.15]])
