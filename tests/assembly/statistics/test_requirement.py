"""Requirements on tolerances at several postures."""

import numpy as np
import pytest

from forcefit import BadInput, Clearance, Frame, Robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.requirement import Requirement
from tests.tolerances_for_tests import PLAY, arm, plan_for, rigid_pair

ENDS = [("one", 3), ("two", 3)]


def test_draws_that_cannot_be_assembled_exceed_every_limit():
    """Rigid bodies without clearance can be assembled only if both errors are equal."""
    robot = rigid_pair()
    plan = plan_for(robot, ENDS, [1, 1], {"energy": 1.0, "force": 1.0})
    requirement = Requirement([home_posture(robot)], plan)
    for found in requirement.utilisations(np.array([[1e-4, 1e-4], [1e-4, 2e-4]])):
        np.testing.assert_array_equal(np.isinf(found), [[False, True]] * 2)


def test_random_clearances_do_not_depend_on_the_batch():
    """The last draws are solved in a different batch than the first ones."""
    posture = home_posture(arm(radial=PLAY))
    plan = plan_for(posture.robot, [("tip", 3)], [1], {"translation": 1e-3},
                    clearance="contact")  # fmt: skip
    values = np.linspace(-1e-3, 1e-3, 516)[:, None]
    _, found = Requirement([posture], plan).utilisations(values)
    rows = Experiment(posture, plan.sources, clearance="contact").evaluate(
        values, range(516)
    )
    np.testing.assert_allclose(found[0], rows["translation"] / 1e-3, rtol=1e-9)
    # Random clearances of 0.1 mm add to an error of 1 mm.
    assert np.ptp(found[0, -8:] - np.abs(values[-8:, 0]) / 1e-3) > 0.01


@pytest.mark.parametrize(
    ("limits", "play", "refused"),
    [
        ({"translation": 0.9 * PLAY}, "worst", True),
        ({"translation": 1.1 * PLAY}, "worst", False),
        ({"translation": 0.9 * PLAY}, "least", False),
        ({"energy": 1.0}, "worst", False),
    ],
)
def test_limit_exceeded_by_clearances_alone_is_rejected(limits, play, refused):
    """The message contains the posture with the largest error. The limit is rejected
    only in the worst clearance model.
    """
    postures = [home_posture(arm(radial=0.5 * PLAY)), home_posture(arm(radial=PLAY))]
    plan = plan_for(postures[0].robot, [("tip", 3)], [1], limits, clearance=play)
    requirement = Requirement(postures, plan)
    if not refused:
        reached = requirement.perfect_parts()
        assert all(value <= limits[key] for key, (value, _) in reached.items())
        return
    with pytest.raises(BadInput) as error:
        requirement.perfect_parts()
    assert str(error.value) == (
        "limit translation: even without geometric errors, clearances cause 0.0001 m "
        "at tx = 0.4; expected at most 9e-05 m; tighten the clearances, loosen the "
        "limit, or use --clearance least"
    )


@pytest.mark.parametrize(
    ("limit", "places", "named"),
    [
        ("margin", [("one", 3), ("one", 5), ("two", 3)], "one.TZ"),
        ("margin", [("one", 3), ("two", 4)], None),
        ("margin", [("two", 3), ("slanted", 3)], "slanted.TX"),
        ("energy", [("two", 4)], "two.TY"),
    ],
)
def test_error_that_cannot_be_compensated_is_rejected_by_name(limit, places, named):
    """A radial clearance does not compensate errors along z. The second error is along
    x of a frame that is rotated by 1e-3 rad about y, so it has a small component along
    z.
    """
    frames = (
        Frame("slanted", translation=[0.5, 0, 0], rotation=[0, 1e-3, 0]),
        Frame("one", "slanted", rotation=[0, -1e-3, 0]),
        Frame("two", "base", [0.5, 0, 0]),
        Frame("end", "one", clearance=Clearance(radial=PLAY)),
    )
    robot = Robot("pin", "end", frames, (("end", "two"),))
    plan = plan_for(robot, places, [1] * len(places), {limit: 1.0})
    requirement = Requirement([home_posture(robot)], plan)
    if named is None:
        requirement.check_taken_up()
        return
    with pytest.raises(BadInput) as error:
        requirement.check_taken_up()
    assert str(error.value) == (
        f"limit {limit}: found the error {named}, which no clearance or spring can "
        "compensate; omit this error, or add a spring and limit the energy"
    )
