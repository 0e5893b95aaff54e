"""Paths past limit points, against closed forms."""

import numpy as np
import pytest

from assembly.platform_stiffness.arc_length import follow_load
from tests.assembly.platform_stiffness.test_deflection import FY, shallow_arch


def arch_force(height, half=1.0, rise=0.1, k=1e5):
    """Load on von Mises' truss at the height of its apex, downwards."""
    length = np.hypot(half, rise)
    return 2 * k * (length / np.hypot(half, height) - 1) * height


def test_the_whole_path_of_a_shallow_arch():
    """Up to the limit point, back through the flat arch, and down again."""
    limit = arch_force(np.linspace(0, 0.1, 100_001)).max()
    curve = follow_load(shallow_arch(), FY, 0.0, -1.5 * limit)
    heights = 0.1 + curve.deflection
    np.testing.assert_allclose(-curve.loads, arch_force(heights), atol=1e-6 * limit)
    assert heights.min() < -0.1  # past both limit points
    assert (np.diff(heights) < 0).all()
    first, second = curve.events
    assert -first.load == pytest.approx(limit, rel=2e-2)
    assert -second.load == pytest.approx(-limit, rel=2e-2)
    assert (curve.stiffness[np.abs(heights) < 0.03] < 0).all()
