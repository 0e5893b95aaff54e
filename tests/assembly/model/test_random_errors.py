"""Random geometric errors, and the selection of frames by name."""

import numpy as np
import pytest

from forcefit.assembly.model.random_errors import ErrorDraw, draw_errors, frames_named
from forcefit.assembly.robots import load_robot
from forcefit.inputs.table import BadInput


@pytest.fixture(scope="module")
def robot():
    return load_robot("irsbot2")


def test_frame_name_without_a_leg_selects_all_legs(robot):
    assert frames_named(robot, ["link_a"]) == ("leg1.link_a", "leg2.link_a")
    assert frames_named(robot, ["leg2.tip", "leg1.tip"]) == ("leg1.tip", "leg2.tip")
    with pytest.raises(BadInput, match='no frame "link_q"; valid: leg1.drive'):
        frames_named(robot, ["link_q"])


def test_random_errors_are_within_limits_and_reproducible(robot):
    least, most = np.arange(1.0, 7), np.arange(2.0, 8)
    draw = ErrorDraw(("leg1.tip", "leg2.tip"), tuple(least), tuple(most), 5, "signed")
    one, other = draw_errors(robot, draw), draw_errors(robot, draw)
    assert np.array_equal(one, other)
    rows = [robot.index(name) for name in draw.frames]
    sizes = np.abs(one[rows])
    assert np.all((sizes >= least) & (sizes <= most))
    assert np.count_nonzero(one) == 12


def test_unknown_signs_option_is_rejected(robot):
    draw = ErrorDraw(("leg1.tip",), (0.0,) * 6, (1.0,) * 6, signs="positive")
    with pytest.raises(ValueError, match="signs is 'positive', expected one of"):
        draw_errors(robot, draw)
