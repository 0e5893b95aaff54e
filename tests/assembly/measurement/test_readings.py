"""Device readings of a displaced platform, compared with SciPy transforms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.assembly.kinematics.posture import place_robot, together
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import predict, read
from forcefit.assembly.model.robot import Frame, Robot

ROWS = 5
POINT = np.array([0.3, -0.4, 0.2])  # [m] reference point in platform axes


@pytest.fixture
def rows():
    """Return five configurations of a rigid arm far from its base."""
    turning = {"joint": "revolute", "actuated": True}
    robot = Robot("arm", "tool", (
        Frame("one", translation=[0.5, -0.3, 0.4], rotation=[0.2, 0.3, 0], **turning),
        Frame("two", "one", [0.6, 0.1, 0], [1.1, 0, 0.4], **turning),
        Frame("tool", "two", [0.4, 0, 0.1], [0, 0.5, 0]),
    ))  # fmt: skip
    placed = [
        place_robot(robot, joints={"one": 0.3 * k, "two": 1 - 0.5 * k})
        for k in range(ROWS)
    ]
    return together(placed)


@pytest.mark.parametrize("own_targets", [False, True])
@pytest.mark.parametrize("by_row", [False, True])
def test_reading_equals_the_rigid_body_transform(rows, own_targets, by_row, rng):
    """A device rotated by 1 rad measures a point on a rotated platform."""
    count = (ROWS,) if by_row else ()
    base, tool = rng.normal(size=(*count, 6)), rng.normal(size=(*count, 3))
    target = rng.normal(size=(ROWS, 3)) if own_targets else None
    here = replace(
        as_declared(rows, point=POINT, target=target), base=base, tool=tool,
        reading=rng.normal(size=(ROWS, 6)),
    )  # fmt: skip
    screws = 0.3 * rng.normal(size=(ROWS, 6))
    seen = read(here, screws)
    for k, T in enumerate(rows.platform):
        at = POINT if target is None else target[k]
        own, longer = (v[k] if by_row else v for v in (base, tool))
        turn, device = (Rotation.from_rotvec(v[:3]) for v in (screws[k], own))
        nominal = T[:3, 3] + T[:3, :3] @ at
        moved = T[:3, 3] + screws[k, 3:] + turn.apply(T[:3, :3] @ (at + longer))
        expected = np.concatenate([
            (device * turn).as_rotvec(), device.apply(moved) + own[3:] - nominal
        ])  # fmt: skip
        assert seen[k] - here.reading[k] == pytest.approx(expected, abs=1e-12)


def test_second_order_part_is_added_to_the_linear_model(rows, rng):
    added = 1e-3 * rng.normal(size=(ROWS, 6))
    here = as_declared(rows)
    linear = replace(here, second_order=added)
    assert predict(linear).deviation == pytest.approx(added, abs=1e-12)
    exact = predict(replace(linear, exact=True)).deviation
    assert exact == pytest.approx(np.zeros((ROWS, 6)), abs=1e-12)


def test_work_does_not_depend_on_the_reference_point(rows, rng):
    """The work M . theta + F . t is equal at both points."""
    load, screw = rng.normal(size=(ROWS, 6)), rng.normal(size=6)
    here = as_declared(rows, load, point=POINT)
    moved = here.load_at_origin()
    for k, T in enumerate(rows.platform):
        at_point = screw.copy()
        at_point[3:] += np.cross(screw[:3], T[:3, :3] @ POINT)
        assert moved[k] @ screw == pytest.approx(load[k] @ at_point, rel=1e-12)
