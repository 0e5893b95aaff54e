"""Test the diagnosis of geometric errors with visible second-order terms.

The readings are calculated from products of homogeneous transforms.  The second-order
terms are about ten times the noise.
"""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.sequence import errors_of
from tests.campaigns_for_tests import campaign_at
from tests.planar_arm_for_tests import SIGMA

TURNING = {"joint": "revolute", "actuated": True}
ARM = Robot("arm", "tool", (
    Frame("j1", **TURNING),
    Frame("j2", "j1", [0.1, 0, 0.3], [np.pi / 2, 0, 0.3], **TURNING),
    Frame("tool", "j2", [0.3, 0.05, 0.1]),
))  # fmt: skip


def moved(rotation, shift=(0.0, 0.0, 0.0)):
    turn = Rotation.from_rotvec(np.array(rotation))
    return RigidTransform.from_components(np.array(shift), turn)


def tool_of(angles, errors):
    """Return the pose of the tool as a product of frames, joints and errors."""
    T = RigidTransform.identity()
    for frame, angle, error in zip(ARM.frames, (*angles, 0.0), errors, strict=True):
        T = T * moved(frame.rotation, frame.translation) * moved([0, 0, angle])
        T = T * moved(error[:3], error[3:])
    return T


@pytest.fixture(scope="module")
def found():
    rng = np.random.default_rng(3)
    errors = rng.normal(size=(3, 6)) * np.repeat([5e-3, 1.25e-3], 3)
    rows = 12
    q = rng.uniform(-1.2, 1.2, (rows, 2))
    seen = SIGMA * rng.normal(size=(rows, 6))
    for k, angles in enumerate(q):
        actual, nominal = tool_of(angles, errors), tool_of(angles, np.zeros((3, 6)))
        seen[k, :3] += (actual.rotation * nominal.rotation.inv()).as_rotvec()
        seen[k, 3:] += actual.translation - nominal.translation
    placed = [place_robot(ARM, joints={"j1": a, "j2": b}) for a, b in q]
    return diagnose(campaign_at(ARM, placed, seen, SIGMA))


def test_large_geometric_errors_are_identified_to_second_order(found):
    """A first-order model would have an error of 1.5 sigma."""
    assert (found.verdict, found.claimed) == ("explained", ())
    assert found.before.normalised > 500
    assert found.after.normalised == pytest.approx(1.0, abs=0.3)
    assert not found.lack.significant
    ((part, _),) = found.fit.unknowns.places
    assert part.name == "geometry"


def test_reported_error_is_the_rms_of_measured_components(found):
    """For one held-out row, the expected values are calculated by hand."""
    campaign = found.campaign
    left = np.zeros((12, 6))
    left[2] = [1e-5, -2e-5, 3e-5, 3e-6, 4e-6, 0.0]
    left[5] = 1.0
    judged = errors_of(campaign, left, np.arange(12) == 2)
    assert judged.position == pytest.approx(np.sqrt(25 / 3) * 1e-6)
    assert judged.rotation == pytest.approx(np.sqrt(14 / 3) * 1e-5)
    whitened = [1, -2, 3, 0.6, 0.8, 0]
    assert judged.normalised == pytest.approx(np.linalg.norm(whitened) / np.sqrt(6))
    nothing = errors_of(campaign, left, np.zeros(12, bool))
    assert np.isnan([nothing.position, nothing.rotation, nothing.normalised]).all()
