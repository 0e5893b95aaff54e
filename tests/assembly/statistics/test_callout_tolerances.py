"""Tolerances allocated to callouts."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.callouts.callout import Callout, Datum
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.statistics.allocated_tolerances import (
    allocation_of,
    allocation_text,
)
from forcefit.assembly.statistics.allocation import allocate
from forcefit.assembly.statistics.tolerance_file import read_plan
from forcefit.inputs.table import BadInput

ARM = Robot(
    "arm",
    "tip",
    (
        Frame("shoulder", joint="revolute", actuated=True, position=0.5),
        Frame("elbow", "shoulder", np.array([0.4, 0, 0]), joint="revolute",
              actuated=True, position=0.8),
        Frame("tip", "elbow", np.array([0.3, 0, 0])),
    ),
    callouts=(
        Callout("arm", "elbow", (Datum("shoulder"),), length=(0.4, 50e-6)),
        Callout("hand", "tip", (Datum("elbow"),), length=(0.3, 20e-6)),
    ),
)  # fmt: skip
PLAN = """
yield = 0.9
draws = 400
[limits]
translation = 1e-4
[[tolerance]]
name = "arm"
{arm}
cost = 1.0
[[tolerance]]
name = "hand"
{hand}
cost = 4.0
"""
OF_FRAMES = {
    "arm": 'frames = ["elbow"]\ncomponents = ["TX"]',
    "hand": 'frames = ["tip"]\ncomponents = ["TX"]',
}
OF_CALLOUTS = {"arm": 'callouts = ["arm"]', "hand": 'callouts = ["hand"]'}


def allotted(tmp_path, robot, text):
    path = tmp_path / "plan.toml"
    path.write_text(text)
    plan = replace(read_plan(path, robot), clearance="least")
    return allocate([home_posture(robot)], plan, 0)


def test_length_callouts_have_the_tolerances_of_independent_errors(tmp_path):
    """A length callout has the same distribution as an independent uniform error."""
    callouts = allotted(tmp_path, ARM, PLAN_OF_CALLOUTS)
    frames = allotted(tmp_path, ARM, PLAN.format(**OF_FRAMES))
    assert callouts.tolerances == pytest.approx(frames.tolerances, rel=1e-6)
    assert "arm: +-" in allocation_text(allocation_of(callouts))


def test_width_of_a_position_zone_agrees_with_nonlinear_simulation(tmp_path):
    """The tip is 150 mm above a bore of 20 mm length, whose ends are uniform in discs.
    The width is the limit divided by the 90 % quantile of the offset for a width of 1.
    """
    robot = Robot(
        "post",
        "tip",
        (
            Frame("foot", joint="revolute", actuated=True),
            Frame("bore", "foot", np.array([0.4, 0, 0]), joint="revolute",
                  actuated=True),
            Frame("tip", "bore", np.array([0, 0, 0.15])),
        ),
        callouts=(
            Callout("bore", "bore", (Datum("foot"),), extent=(0.02,),
                    widths={"position": 0.3e-3}),
        ),
    )  # fmt: skip
    text = PLAN.partition("[[tolerance]]")[0].replace("400", "4000")
    found = allotted(tmp_path, robot, text + '[[tolerance]]\ncallouts = ["bore"]\n')
    points = np.random.default_rng(5).uniform(-1, 1, (4_000_000, 2))
    points = points[np.hypot(*points.T) <= 1] / 2
    half = len(points) // 2
    up, down = points[:half], points[half : 2 * half]
    offset = (up + down) / 2 + (up - down) / 0.02 * 0.15
    quantile = np.quantile(np.hypot(*offset.T), 0.9)
    # To demonstrate the yield with 95 % confidence, the width is about 1 % smaller.
    assert 0.97 * 1e-4 / quantile < found.tolerances[0] < 1e-4 / quantile
    text = allocation_text(allocation_of(found))
    assert "position of bore: " in text
    assert "+-" not in text.splitlines()[0]


PLAN_OF_CALLOUTS = PLAN.format(**OF_CALLOUTS)
MISTAKES = [
    (PLAN_OF_CALLOUTS.replace("0.9", "1.0").replace("translation", "energy"),
     "found 1 with callouts"),
    (PLAN_OF_CALLOUTS.replace('["hand"]', '["hnd"]'), 'found "hnd"; did'),
    (PLAN_OF_CALLOUTS.replace('["hand"]', '["arm"]'), '"arm" twice'),
    (PLAN_OF_CALLOUTS.replace('["hand"]', "[]"), "at least one"),
    (PLAN_OF_CALLOUTS.replace('["hand"]', "[1]"), "a list of names"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), MISTAKES)
def test_invalid_callouts_in_a_tolerance_file_are_rejected(tmp_path, text, message):
    with pytest.raises(BadInput, match=message) as error:
        allotted(tmp_path, ARM, text)
    assert "\n" not in str(error.value)
