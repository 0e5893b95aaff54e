"""Tests of the compliance along a path, and of force-controlled drives."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput, BeamLink, Clearance, Frame, Robot, errors_along_path
from forcefit.assembly.model.force_control import with_drive_forces
from forcefit.assembly.path.path_errors import path_errors
from forcefit.assembly.path.path_file import PathTable
from tests.assembly.path.moving_robots_for_tests import at_one_instant, hinge, instants

ALONG_X = [0, np.pi / 2, 0]  # rotation vector that rotates z to x
MASS = 3.0
TABLE = PathTable(("tx",), np.array([[0.0], [0.1]]))


def slide(name, **more):
    return Frame(
        name, joint="prismatic", rotation=ALONG_X, actuated=True, limits=None, **more
    )


def spring(k):
    """Return the stiffness of a drive that is compliant along its axis only."""
    return np.diag([np.inf] * 5 + [k])


def test_compliance_along_contact_rim_equals_clearance_over_force():
    """The compliance along the rim of a clearance c is c / (m a)."""
    c, k = 2e-5, 1e7
    rail = slide("rail", joint_stiffness=spring(k))
    seat = Frame("seat", "rail", rotation=[0, -np.pi / 2, 0],
                 clearance=Clearance(radial=c))  # fmt: skip
    tool = Frame("tool", "seat", mass=MASS)
    accelerations = np.array([[10.0], [40.0], [-90.0]])
    zero = np.zeros((3, 1))
    found = path_errors(
        Robot("slide", "tool", (rail, seat, tool)),
        instants(["q.rail"], zero, zero, accelerations), state="contact",
    )  # fmt: skip
    along, across = found.arrays["compliance"][:, [3, 4], [3, 4]].T
    np.testing.assert_allclose(along, 1 / k, rtol=1e-9)
    np.testing.assert_allclose(across, c / (MASS * abs(accelerations[:, 0])), rtol=1e-6)


def test_centrifugal_force_stiffens_elastic_hinge():
    """The stiffness of the hinge is k + m omega^2 L^2."""
    k, length, rates = 200.0, 0.4, np.array([[0.0], [10.0], [25.0]])
    K = np.diag([np.inf] * 2 + [k] + [np.inf] * 3)
    tip = Frame("tip", "hub", [length, 0, 0], mass=MASS)
    robot = Robot("arm", "tip", (hinge("hub", joint_stiffness=K), tip))
    zero = np.zeros((3, 1))
    path = instants(["q.hub"], zero, rates, zero)
    found = path_errors(robot, path, state="exact").arrays["compliance"]
    about = k + MASS * rates[:, 0] ** 2 * length**2
    np.testing.assert_allclose(found[:, 2, 2], 1 / about, rtol=1e-9)
    np.testing.assert_allclose(found[:, 4, 4], length**2 / about, rtol=1e-9)
    nominal = path_errors(robot, path).arrays["compliance"]
    np.testing.assert_allclose(nominal[:, 2, 2], 1 / k, rtol=1e-12)


def test_exact_state_rejects_link_with_density():
    link = BeamLink({"radius": 0.01}, 70e9, 0.3, 2700.0)
    tip = Frame("tip", "hub", [0.4, 0, 0], link=link)
    robot = Robot("arm", "tip", (hinge("hub"), tip))
    path = at_one_instant()
    with pytest.raises(BadInput, match='--state exact: found a link .* frame "tip"'):
        path_errors(robot, path, state="exact")
    with pytest.raises(BadInput, match="--state"):
        path_errors(robot, path, state="tight")


def two_drives():
    """Return a cart with two parallel drives along x."""
    tool = Frame("tool", "a", mass=MASS)
    end = Frame("end", "b")
    drives = slide("a", joint_stiffness=spring(1e6)), slide("b")
    return Robot("cart", "tool", (*drives, tool, end), (("end", "tool"),))


def test_forces_of_two_drives_sum_to_inertial_force():
    """At each instant, m a = F_a + F_b."""
    found = errors_along_path(two_drives(), TABLE, profile="quintic", duration=0.2,
                              points=21, drive_force={"b": 70.0})  # fmt: skip
    assert found.drives == ("a",)
    expected = MASS * found.arrays["platform_acceleration"][:, 3] - 70.0
    np.testing.assert_allclose(found.arrays["drive_force"][:, 0], expected, atol=1e-9)
    by_robot = with_drive_forces(two_drives(), {"b": 70.0})
    assert replace(found.robot, remarks=()) == replace(by_robot, remarks=())


def test_interrupted_path_resumes_with_same_results(tmp_path):
    """The computation is interrupted after the first block of points."""

    def compute(file, progress=lambda done, total: None, duration=0.2):
        return errors_along_path(
            two_drives(), TABLE, profile="quintic", duration=duration, points=4100,
            output=file, progress=progress,
        )  # fmt: skip

    def stop(done, total):
        if done:
            raise KeyboardInterrupt

    seen = []
    file, journal = tmp_path / "way.nc", tmp_path / "way.nc.journal"
    with pytest.raises(KeyboardInterrupt):
        compute(file, stop)
    assert journal.stat().st_size > 2000 * 8
    assert not file.exists()
    resumed = compute(file, lambda done, total: seen.append(done))
    whole = compute(tmp_path / "whole.nc")
    assert seen == [0, 2000, 4000, 4100]
    assert not journal.exists()
    for name, values in whole.arrays.items():
        np.testing.assert_array_equal(resumed.arrays[name], values)
    assert file.read_bytes() == (tmp_path / "whole.nc").read_bytes()
    with pytest.raises(KeyboardInterrupt):
        compute(file, stop)
    with pytest.raises(BadInput, match="journal of another sweep: found path_sha256"):
        compute(file, duration=0.3)
