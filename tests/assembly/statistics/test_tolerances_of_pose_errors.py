"""Tolerances within a limit on the pose error against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.model.robot import Frame, MatrixLink, Robot
from forcefit.assembly.statistics.allocated_tolerances import (
    allocation_of,
    allocation_text,
)
from forcefit.assembly.statistics.allocation import allocate
from tests.tolerances_for_tests import PLAY, arm, plan_for


def parallel(k1, k2):
    """A platform between two bars along x: errors share out by the stiffnesses."""
    frames = (
        Frame("one", translation=[0.5, 0, 0], link=MatrixLink(np.eye(6) * k1)),
        Frame("mount", translation=[1.0, 0, 0]),
        Frame("two", "mount", [-0.5, 0, 0], link=MatrixLink(np.eye(6) * k2)),
    )
    return Robot("parallel", "one", frames, (("one", "two"),))


def test_tolerances_within_a_pose_error_limit_equal_lagranges_solution():
    """Between springs k1, k2 the platform moves w1 t1 + w2 t2, w_i = k_i / (k1 + k2).

    Minimise c1/t1 + c2/t2 with that sum D: t_i = D sqrt(c_i/w_i) / sum sqrt(c w).  The
    energy depends on t1 + t2 alone, so its proportions are sqrt(c_i).
    """
    k, c, D = np.array([9e6, 1e6]), np.array([1.0, 4.0]), 1e-4
    robot = parallel(*k)
    plan = plan_for(robot, [("one", 3), ("two", 3)], c, {"translation": D}, draws=100)
    found = allocate([place_robot(robot)], plan, fresh=500)
    w = k / k.sum()
    best = D * np.sqrt(c / w) / np.sqrt(c * w).sum()
    np.testing.assert_allclose(found.tolerances, best, rtol=5e-3)
    alike = D * np.sqrt(c) / (w * np.sqrt(c)).sum()
    np.testing.assert_allclose(found.uniformly_scaled, alike, rtol=5e-3)
    assert found.price == pytest.approx((c / best).sum(), rel=2e-3)
    assert found.price_uniformly_scaled == pytest.approx((c / alike).sum(), rel=2e-3)


@pytest.mark.slow
def test_tolerances_with_a_yield_share_the_pose_error_as_squares():
    """Normal errors of deviation t/3: the platform's is |w t| / 3, D at 90 % of it.

    Minimise sum c/t with sum (w t)^2 fixed: t_i ~ (c_i / w_i^2)^(1/3).  Cutting the
    normal at 3 deviations narrows it alike for both, by 0.9866.
    """
    k, c, D = np.array([9e6, 1e6]), np.array([1.0, 4.0]), 1e-4
    robot = parallel(*k)
    plan = plan_for(robot, [("one", 3), ("two", 3)], c, {"translation": D},
                    asked_yield=0.9, draws=10_000)  # fmt: skip
    s = plan.sources
    normal = type(s)(robot, s.frame, s.component, np.full(2, 2), s.centre, s.scale / 3,
                     s.least, np.full(2, 3.0), s.signed)  # fmt: skip
    found = allocate([place_robot(robot)], replace(plan, sources=normal), fresh=5000)
    w = k / k.sum()
    shape = (c / w**2) ** (1 / 3)
    best = shape * 3 * D / (1.6449 * 0.9866 * np.linalg.norm(w * shape))
    # 10000 draws know the quantile to 1 %, and its slopes' ratio to a few
    assert found.price == pytest.approx((c / best).sum(), rel=0.03)
    np.testing.assert_allclose(found.tolerances / best, 1.0, atol=0.12)
    assert found.price < 0.97 * found.price_uniformly_scaled
    assert found.verification["verdict"] != "contradicted"


def test_worst_clearance_reduces_the_tolerance_within_a_pose_error_limit():
    """An error e and a clearance disc r of a serial arm reach e + r <= limit."""
    robot = arm(radial=PLAY)
    plan = plan_for(robot, [("tip", 3)], [1], {"translation": 3e-4}, draws=50)
    for play, tolerance in (("worst", 3e-4 - PLAY), ("least", 3e-4)):
        found = allocate([place_robot(robot)], replace(plan, clearance=play), fresh=100)
        assert found.tolerances[0] == pytest.approx(tolerance, rel=1e-3)
        said = allocation_text(allocation_of(found))
        assert f"pose errors: clearance {play}" in said
