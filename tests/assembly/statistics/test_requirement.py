"""Limits at every posture: random clearances, and limits that cannot be met."""

import numpy as np
import pytest

from forcefit import BadInput, Clearance, Frame, Robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.requirement import Requirement
from tests.tolerances_for_tests import PLAY, arm, plan_for, rigid_pair

ENDS = [("one", 3), ("two", 3)]


def test_draws_that_cannot_be_assembled_exceed_every_limit():
    """Rigid parts without clearance fit only with equal errors."""
    robot = rigid_pair()
    plan = plan_for(robot, ENDS, [1, 1], {"energy": 1.0, "force": 1.0})
    requirement = Requirement([home_posture(robot)], plan)
    for found in requirement.utilisations(np.array([[1e-4, 1e-4], [1e-4, 2e-4]])):
        np.testing.assert_array_equal(np.isinf(found), [[False, True]] * 2)


def test_random_clearances_do_not_depend_on_the_batch():
    """Draw 515 has the same clearance in any batch."""
    posture = home_posture(arm(radial=PLAY))
    plan = plan_for(posture.robot, [("tip", 3)], [1], {"translation": 1e-3},
                    clearance="contact")  # fmt: skip
    values = np.linspace(-1e-3, 1e-3, 516)[:, None]
    _, found = Requirement([posture], plan).utilisations(values)
    rows = Experiment(posture, plan.sources, clearance="contact").evaluate(
        values, range(516)
    )
    np.testing.assert_allclose(found[0], rows["translation"] / 1e-3, rtol=1e-9)
    # clearance of 0.1 mm beside an error of 1 mm
    assert np.ptp(found[0, -8:] - np.abs(values[-8:, 0]) / 1e-3) > 0.01


@pytest.mark.parametrize(
    ("limits", "worst_play", "refused"),
    [
        ({"translation": 0.9 * PLAY}, True, True),
        ({"translation": 1.1 * PLAY}, True, False),
        ({"translation": 0.9 * PLAY}, False, False),
        ({"energy": 1.0}, True, False),
    ],
)
def test_limit_below_the_pose_error_from_clearances_alone_is_rejected(
    limits, worst_play, refused
):
    """The message names the posture with more clearance; this applies only to the worst
    model.
    """
    postures = [home_posture(arm(radial=0.5 * PLAY)), home_posture(arm(radial=PLAY))]
    plan = plan_for(postures[0].robot, [("tip", 3)], [1], limits,
                    clearance="worst" if worst_play else "least")  # fmt: skip
    requirement = Requirement(postures, plan)
    if not refused:
        reached = requirement.perfect_parts()
        assert all(value <= limits[key] for key, (value, _) in reached.items())
        return
    with pytest.raises(BadInput) as error:
        requirement.perfect_parts()
    assert str(error.value) == (
        "limit translation: even perfect parts reach 0.0001 m by clearances alone at "
        "tx = 0.4; expected at most 9e-05 m; tighten the clearances, loosen the limit, "
        "or use --clearance least"
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
def test_error_that_no_clearance_or_spring_can_close_is_rejected_by_name(
    limit, places, named
):
    """Clearance in x and y takes up no error along z, and no spring does. The same
    holds for an error along x of a frame rotated by 1e-3 rad about y, of which 1e-3 is
    along z.
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
        f"limit {limit}: found an error {named} that no clearance or spring can "
        "close; leave this error out, or limit the energy of a robot with a spring "
        "there"
    )
