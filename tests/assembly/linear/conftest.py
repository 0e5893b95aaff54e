"""The IRSBot-2 at 45 poses of its workspace."""

import numpy as np
import pytest

from tests.robots_for_tests import irsbot2_over


@pytest.fixture(scope="module")
def grid():
    """Return the IRSBot-2 with random errors, and 45 poses of its workspace."""
    robot, postures = irsbot2_over(
        np.linspace(-0.4, 0.4, 9), np.linspace(-0.6, -0.2, 5)
    )
    reached = [p for p in postures if p is not None]
    assert len(reached) == 43
    return robot, reached
